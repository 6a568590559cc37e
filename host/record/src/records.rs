//! The records of an MCAP file, up to its end or to the first that is damaged or cut off. No bytes lead to a panic or to more memory than [`LARGEST`].

use mcap::read::parse_record;
use mcap::records::{Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};

/// Largest record, bytes: eight times the largest collision model.
const LARGEST: usize = 256 << 20;

/// Iterator over the records, those in chunks among them.
pub(crate) struct Records<'a> {
    rest: &'a [u8],
    reader: LinearReader,
    ended: bool,
    complete: bool,
}

impl<'a> Records<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        let options = LinearReaderOptions::default()
            // A recording whose program was killed has no end.
            .with_skip_end_magic(true)
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(LARGEST);
        Self {
            rest: bytes,
            reader: LinearReader::new_with_options(options),
            ended: false,
            complete: false,
        }
    }

    /// Whether the record that closes the data was read.
    pub fn complete(&self) -> bool {
        self.complete
    }

    fn read(&mut self) -> Option<Record<'static>> {
        while let Some(event) = self.reader.next_event() {
            match event.ok()? {
                LinearReadEvent::ReadRequest(wanted) => {
                    let given = wanted.min(self.rest.len());
                    let (now, later) = self.rest.split_at(given);
                    self.reader.insert(given).copy_from_slice(now);
                    self.reader.notify_read(given);
                    self.rest = later;
                }
                LinearReadEvent::Record { data, opcode } => {
                    if opcode == op::ATTACHMENT && !holds_an_attachment(data) {
                        return None;
                    }
                    return parse_record(opcode, data).ok().map(Record::into_owned);
                }
            }
        }
        None
    }
}

impl Iterator for Records<'_> {
    type Item = Record<'static>;

    fn next(&mut self) -> Option<Record<'static>> {
        if self.ended {
            return None;
        }
        let record = self.read();
        self.ended = record.is_none();
        self.complete |= matches!(record, Some(Record::DataEnd(_)));
        record
    }
}

/// Whether an attachment's fields lie within its record. The library's parser relies on it.
fn holds_an_attachment(body: &[u8]) -> bool {
    // Times of log and creation.
    let mut rest = body.get(16..).unwrap_or_default();
    // Name and media type, with their lengths.
    for _ in 0..2 {
        let Some((length, text)) = rest.split_first_chunk::<4>() else {
            return false;
        };
        let length = u32::from_le_bytes(*length) as usize;
        let Some(after) = text.get(length..) else {
            return false;
        };
        rest = after;
    }
    // Length of the data, the data, and a checksum.
    let Some((length, data)) = rest.split_first_chunk::<8>() else {
        return false;
    };
    data.len() as u64 >= u64::from_le_bytes(*length).saturating_add(4)
}
