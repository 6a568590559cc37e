//! The board's log: decodes defmt frames to lines when the firmware's ELF is available.

use std::path::Path;

use defmt_decoder::{DecodeError, StreamDecoder, Table};

/// The table of log strings in a firmware ELF; `None` when there is none, or the file is not such an ELF.
pub(crate) fn table(elf: &Path) -> Option<Table> {
    let bytes = std::fs::read(elf).ok()?;
    Table::parse(&bytes).ok().flatten()
}

/// Decodes log bytes to lines.
pub(crate) struct LogReader<'t>(Option<Box<dyn StreamDecoder + Send + Sync + 't>>);

impl<'t> LogReader<'t> {
    /// A reader with the strings of `table`; without a table it only reports that something was logged.
    pub(crate) fn new(table: Option<&'t Table>) -> Self {
        Self(table.map(Table::new_stream_decoder))
    }

    /// Takes bytes; calls `line` for each completed line.
    pub(crate) fn take(&mut self, bytes: &[u8], mut line: impl FnMut(String)) {
        let Some(decoder) = &mut self.0 else {
            line(format!(
                "{} bytes of log (the firmware's ELF is not known)",
                bytes.len()
            ));
            return;
        };
        decoder.received(bytes);
        // Every iteration consumes at least a byte or ends, which bounds the loop by the input.
        for _ in 0..=bytes.len() {
            match decoder.decode() {
                Ok(frame) => line(frame.display(false).to_string()),
                Err(DecodeError::UnexpectedEof) => return,
                Err(DecodeError::Malformed) => {
                    line("a damaged piece of log (is this the ELF the board runs?)".into());
                    return;
                }
            }
        }
    }
}
