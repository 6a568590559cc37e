//! Writes a recording: an MCAP file with one topic for each kind of content, closed often enough that a killed program loses half a second at most.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs;
use std::io::{self, BufWriter, Write as _};
use std::path::{Path, PathBuf};

use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, Compression, WriteOptions, Writer};
use mortise_protocol::image::CRC;
use mortise_protocol::message::{FromDevice, SCHEMA_HASH, Telemetry, ToDevice, Version};
use postcard_schema::Schema;
use postcard_schema::schema::NamedType;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::columns::{Ticks, encode};
use crate::error::RecordError;
use crate::schema::json_schema;

/// Version of the layout described in `docs/recording.md`.
pub(crate) const FORMAT: &str = "1";
/// Name of the metadata record, and of the profile.
pub(crate) const METADATA: &str = "mortise";
/// Name of the metadata record of what is missing, and of its one value.
pub(crate) const LOST: &str = "lost";
pub(crate) const LOST_MESSAGES: &str = "messages";
/// Start of the name of an attached scene image.
pub(crate) const SCENE: &str = "scene-";

/// Level of compression: 3 % smaller than by the default one, at a tenth of a per cent of a processor.
const LEVEL: u32 = 9;

/// Topics of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Topic {
    /// Messages to the board.
    ToBoard,
    /// Messages of the board but telemetry, log and inputs.
    FromBoard,
    Telemetry,
    /// Inputs of ticks in columns.
    Inputs,
}

impl Topic {
    pub const ALL: [Self; 4] = [Self::ToBoard, Self::FromBoard, Self::Telemetry, Self::Inputs];

    pub const fn name(self) -> &'static str {
        match self {
            Self::ToBoard => "/to_board",
            Self::FromBoard => "/from_board",
            Self::Telemetry => "/telemetry",
            Self::Inputs => "/inputs",
        }
    }
}

/// A message in words that other programs read, and in the bytes of the link, which keep every bit.
#[derive(Serialize, Deserialize)]
pub(crate) struct Line {
    pub sequence: u16,
    /// Postcard bytes in hexadecimal.
    pub bytes: String,
    pub message: Value,
}

/// A recording being written.
pub(crate) struct RecordFile {
    path: PathBuf,
    writer: Writer<BufWriter<fs::File>>,
    channels: [u16; Topic::ALL.len()],
    sequence: u32,
    scenes: Vec<u32>,
}

impl RecordFile {
    /// A new file; one that exists is not replaced.
    pub fn create(path: &Path, rig: &str) -> Result<Self, RecordError> {
        let file = fs::File::create_new(path).map_err(|error| match error.kind() {
            io::ErrorKind::AlreadyExists => write_error(
                path,
                "there is a file of this name, and none is replaced; choose another",
            ),
            _ => write_error(path, &error),
        })?;
        let options = WriteOptions::new()
            .profile(METADATA)
            .library(concat!("mortise ", env!("CARGO_PKG_VERSION")))
            .compression(Some(Compression::Zstd))
            .compression_level(LEVEL)
            // Chunks end by time, see `flush`; each is written whole.
            .chunk_size(None)
            .disable_seeking(true);
        let failed = |error: mcap::McapError| write_error(path, &error);
        let mut writer = options.create(BufWriter::new(file)).map_err(failed)?;
        let mut channels = [0; Topic::ALL.len()];
        for (topic, channel) in Topic::ALL.into_iter().zip(&mut channels) {
            *channel = add_channel(&mut writer, topic).map_err(failed)?;
        }
        let [major, minor, patch] = Version::own().release;
        let metadata = [
            ("format", FORMAT.to_owned()),
            ("release", format!("{major}.{minor}.{patch}")),
            ("messages", format!("{SCHEMA_HASH:016x}")),
            ("rig", rig.to_owned()),
        ];
        let metadata = Metadata {
            name: METADATA.to_owned(),
            metadata: (metadata.into_iter().map(|(key, value)| (key.to_owned(), value))).collect(),
        };
        writer.write_metadata(&metadata).map_err(failed)?;
        let mut file = Self {
            path: path.to_owned(),
            writer,
            channels,
            sequence: 0,
            scenes: Vec::new(),
        };
        file.flush()?;
        Ok(file)
    }

    /// A message to the board. The bytes of scenes are left out: the image is attached once.
    pub fn sent(&mut self, at_ns: u64, sequence: u16, message: &ToDevice) -> Result<(), RecordError> {
        if matches!(message, ToDevice::SceneChunk { .. } | ToDevice::Heartbeat) {
            return Ok(());
        }
        self.line(Topic::ToBoard, at_ns, sequence, message)
    }

    /// A message of the board.
    pub fn received(&mut self, at_ns: u64, sequence: u16, message: &FromDevice) -> Result<(), RecordError> {
        match message {
            FromDevice::Telemetry(sample) => {
                let line = serde_json::to_value(sample).map(rounded);
                let line = line.and_then(|line| serde_json::to_vec(&line));
                let line = line.map_err(|error| write_error(&self.path, &error))?;
                self.write(Topic::Telemetry, at_ns, &line)
            }
            // The bytes of a log can be read only with the firmware they come from.
            FromDevice::Inputs(_) | FromDevice::Log(_) => Ok(()),
            message => self.line(Topic::FromBoard, at_ns, sequence, message),
        }
    }

    /// Inputs of consecutive ticks.
    pub fn inputs(&mut self, at_ns: u64, ticks: &Ticks) -> Result<(), RecordError> {
        self.write(Topic::Inputs, at_ns, &encode(ticks))
    }

    /// Attaches a scene image, once.
    pub fn scene(&mut self, at_ns: u64, image: &[u8]) -> Result<(), RecordError> {
        let crc = CRC.checksum(image);
        if self.scenes.contains(&crc) {
            return Ok(());
        }
        self.scenes.push(crc);
        let attachment = Attachment {
            log_time: at_ns,
            create_time: at_ns,
            name: format!("{SCENE}{crc:08x}"),
            media_type: "application/octet-stream".to_owned(),
            data: Cow::Borrowed(image),
        };
        self.done(|writer| writer.attach(&attachment))
    }

    /// Ends the current chunk and hands all bytes to the system, which writes them also when this program is killed.
    pub fn flush(&mut self) -> Result<(), RecordError> {
        self.done(Writer::flush)
    }

    /// Writes index and summary, and how many messages are missing; returns the path.
    pub fn finish(mut self, lost: u64) -> Result<PathBuf, RecordError> {
        if lost > 0 {
            let metadata = Metadata {
                name: LOST.to_owned(),
                metadata: BTreeMap::from([(LOST_MESSAGES.to_owned(), lost.to_string())]),
            };
            self.done(|writer| writer.write_metadata(&metadata))?;
        }
        self.done(|writer| writer.finish().map(|_| ()))?;
        let mut rest = self.writer.into_inner();
        rest.flush().map_err(|error| write_error(&self.path, &error))?;
        Ok(self.path)
    }

    fn line<M: Serialize>(
        &mut self,
        topic: Topic,
        at_ns: u64,
        sequence: u16,
        message: &M,
    ) -> Result<(), RecordError> {
        let failed = |error: &dyn std::fmt::Display| write_error(&self.path, error);
        let bytes = postcard::to_stdvec(message).map_err(|error| failed(&error))?;
        let line = Line {
            sequence,
            bytes: hex(&bytes),
            message: serde_json::to_value(message).map_err(|error| failed(&error))?,
        };
        let line = serde_json::to_vec(&line).map_err(|error| failed(&error))?;
        self.write(topic, at_ns, &line)
    }

    fn write(&mut self, topic: Topic, at_ns: u64, data: &[u8]) -> Result<(), RecordError> {
        let header = MessageHeader {
            channel_id: self.channels[topic as usize],
            sequence: self.sequence,
            log_time: at_ns,
            publish_time: at_ns,
        };
        self.sequence = self.sequence.wrapping_add(1);
        self.done(|writer| writer.write_to_known_channel(&header, data))
    }

    fn done<E: std::fmt::Display>(
        &mut self,
        write: impl FnOnce(&mut Writer<BufWriter<fs::File>>) -> Result<(), E>,
    ) -> Result<(), RecordError> {
        write(&mut self.writer).map_err(|error| write_error(&self.path, &error))
    }
}

fn write_error(path: &Path, why: &(impl std::fmt::Display + ?Sized)) -> RecordError {
    RecordError::Write {
        path: path.to_owned(),
        why: why.to_string(),
    }
}

fn add_channel(writer: &mut Writer<BufWriter<fs::File>>, topic: Topic) -> mcap::McapResult<u16> {
    let line = |of: &NamedType| {
        json!({"type": "object", "title": topic.name(), "properties": {
            "sequence": {"type": "integer"},
            "bytes": {"type": "string"},
            "message": json_schema(of),
        }})
    };
    let (schema, encoding) = match topic {
        Topic::ToBoard => (line(ToDevice::SCHEMA), "json"),
        Topic::FromBoard => (line(FromDevice::SCHEMA), "json"),
        Topic::Telemetry => (json_schema(Telemetry::SCHEMA), "json"),
        // Columns of bits: `docs/recording.md` describes them.
        Topic::Inputs => return writer.add_channel(0, topic.name(), "mortise-columns", &BTreeMap::new()),
    };
    let schema = writer.add_schema(topic.name(), "jsonschema", schema.to_string().as_bytes())?;
    writer.add_channel(schema, topic.name(), encoding, &BTreeMap::new())
}

/// A telemetry sample with the decimals that its signals mean: all digits of single precision would double the file, and a replay has every bit.
fn rounded(sample: Value) -> Value {
    round(sample, "")
}

fn round(value: Value, key: &str) -> Value {
    match value {
        Value::Object(fields) => {
            let fields = fields.into_iter().map(|(key, value)| {
                let value = round(value, &key);
                (key, value)
            });
            Value::Object(fields.collect())
        }
        Value::Array(items) => Value::Array(items.into_iter().map(|item| round(item, key)).collect()),
        Value::Number(number) if number.is_f64() => {
            let scale = 10f64.powi(decimals(key));
            let rounded = number.as_f64().map(|x| (x * scale).round() / scale);
            // −0 takes a digit more.
            json!(rounded.map(|x| if x == 0.0 { 0.0 } else { x }))
        }
        other => other,
    }
}

/// Decimals of a signal in its SI unit: 10 nm, 0.1 µrad, 0.1 mN, 1 µN·m; else six.
fn decimals(key: &str) -> i32 {
    match key {
        "position" | "depth" => 8,
        "orientation" => 7,
        "force" => 4,
        _ => 6,
    }
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The bytes of a text by [`hex`].
pub(crate) fn from_hex(text: &str) -> Option<Vec<u8>> {
    (text.is_ascii() && text.len().is_multiple_of(2)).then_some(())?;
    (0..text.len() / 2)
        .map(|at| u8::from_str_radix(&text[2 * at..2 * at + 2], 16).ok())
        .collect()
}
