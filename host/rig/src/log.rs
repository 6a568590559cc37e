//! The board's log: defmt frames into lines, when the firmware's ELF is at hand.

use std::path::Path;

use defmt_decoder::{DecodeError, StreamDecoder, Table};

/// Reads the table of log strings out of a firmware ELF; `None` when there is none, or the file is no such ELF.
pub(crate) fn table(elf: &Path) -> Option<Table> {
    let bytes = std::fs::read(elf).ok()?;
    Table::parse(&bytes).ok().flatten()
}

/// Turns log bytes into lines.
pub(crate) struct LogReader<'t>(Option<Box<dyn StreamDecoder + Send + Sync + 't>>);

impl<'t> LogReader<'t> {
    /// With the strings of `table`, or, without, telling only that something was logged.
    pub(crate) fn new(table: Option<&'t Table>) -> Self {
        Self(table.map(Table::new_stream_decoder))
    }

    /// Takes bytes; calls `line` for each line that is complete.
    pub(crate) fn take(&mut self, bytes: &[u8], mut line: impl FnMut(String)) {
        let Some(decoder) = &mut self.0 else {
            line(format!(
                "{} bytes of log (the firmware's ELF is not known)",
                bytes.len()
            ));
            return;
        };
        decoder.received(bytes);
        // Every round takes at least a byte or ends, so this is bounded by what came in.
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
