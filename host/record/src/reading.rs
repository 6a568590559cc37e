//! Reads a recording, also one that ends in the middle because its program was killed.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use mcap::records::Record;
use mortise_protocol::message::{FromDevice, SCHEMA_HASH, Telemetry, ToDevice};
use serde::de::DeserializeOwned;

use crate::columns::{Ticks, decode};
use crate::error::RecordError;
use crate::file::{FORMAT, LOST, LOST_MESSAGES, Line, METADATA, SCENE, Topic, from_hex};
use crate::records::Records;

/// A recording in memory, as its file holds it.
pub struct Recording {
    path: PathBuf,
    bytes: Vec<u8>,
    rig: String,
    scenes: HashMap<u32, Vec<u8>>,
    complete: bool,
    lost_messages: u64,
    duration_s: f64,
}

/// A content of a recording, and when it was recorded.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Nanoseconds since 1970.
    pub at_ns: u64,
    /// The content.
    pub kind: EntryKind,
}

/// What a recording holds.
#[derive(Clone, Debug, PartialEq)]
pub enum EntryKind {
    /// A message to the board, with its sequence number.
    Sent(u16, ToDevice),
    /// A message of the board.
    Received(FromDevice),
    /// A telemetry sample.
    Telemetry(Box<Telemetry>),
    /// Inputs of consecutive ticks.
    Inputs(Ticks),
}

impl Recording {
    /// Opens the file and checks that it is a recording whose messages this program knows.
    ///
    /// # Errors
    /// `Read`, `NotOurs`, `OtherRelease`.
    pub fn open(path: &Path) -> Result<Self, RecordError> {
        let bytes = std::fs::read(path).map_err(|error| RecordError::Read {
            path: path.to_owned(),
            error,
        })?;
        let not_ours = |why: String| RecordError::NotOurs {
            path: path.to_owned(),
            why,
        };
        let mut recording = Self {
            path: path.to_owned(),
            bytes,
            rig: String::new(),
            scenes: HashMap::new(),
            complete: false,
            lost_messages: 0,
            duration_s: 0.0,
        };
        let mut records = Records::new(&recording.bytes);
        let (mut ours, mut times) = (false, None::<(u64, u64)>);
        let mut scenes = HashMap::new();
        for record in records.by_ref() {
            match record {
                Record::Metadata(metadata) if metadata.name == METADATA => {
                    let value = |key| metadata.metadata.get(key).cloned().unwrap_or_default();
                    if value("format") != FORMAT {
                        return Err(not_ours(format!(
                            "its layout is {}, this program reads {FORMAT}",
                            value("format")
                        )));
                    }
                    if value("messages") != format!("{SCHEMA_HASH:016x}") {
                        return Err(RecordError::OtherRelease {
                            path: path.to_owned(),
                            recorded: value("release"),
                        });
                    }
                    recording.rig = value("rig");
                    ours = true;
                }
                Record::Metadata(metadata) if metadata.name == LOST => {
                    let lost = metadata.metadata.get(LOST_MESSAGES);
                    recording.lost_messages = lost.and_then(|lost| lost.parse().ok()).unwrap_or(0);
                }
                Record::Attachment { header, data, .. } => {
                    let crc = header
                        .name
                        .strip_prefix(SCENE)
                        .and_then(|crc| u32::from_str_radix(crc, 16).ok());
                    if let Some(crc) = crc {
                        scenes.insert(crc, data.into_owned());
                    }
                }
                Record::Message { header, .. } => {
                    let (first, _) = times.unwrap_or((header.log_time, 0));
                    times = Some((first, header.log_time));
                }
                _ => {}
            }
        }
        let complete = records.complete();
        if !ours {
            return Err(not_ours("it does not say which program made it".into()));
        }
        recording.scenes = scenes;
        recording.complete = complete;
        recording.duration_s = times.map_or(0.0, |(first, last)| last.saturating_sub(first) as f64 * 1e-9);
        Ok(recording)
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The rig as it was specified.
    pub fn rig(&self) -> &str {
        &self.rig
    }

    /// Whether the recording was ended; otherwise its program was killed, and the last part of a second may be missing.
    pub fn complete(&self) -> bool {
        self.complete
    }

    /// Messages missing because the computer that recorded was too slow. Without them a replay may differ.
    pub fn lost_messages(&self) -> u64 {
        self.lost_messages
    }

    /// Time between the first and the last content, s.
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// The image of the scene with this checksum, if it was attached.
    pub fn scene(&self, crc: u32) -> Option<&[u8]> {
        self.scenes.get(&crc).map(Vec::as_slice)
    }

    /// All contents in their order. Contents that cannot be read are left out.
    pub fn entries(&self) -> impl Iterator<Item = Entry> + '_ {
        let mut channels: HashMap<u16, Topic> = HashMap::new();
        Records::new(&self.bytes).filter_map(move |record| match record {
            Record::Channel(channel) => {
                let topic = Topic::ALL.into_iter().find(|topic| topic.name() == channel.topic);
                if let Some(topic) = topic {
                    channels.insert(channel.id, topic);
                }
                None
            }
            Record::Message { header, data } => {
                let kind = content(*channels.get(&header.channel_id)?, &data)?;
                let at_ns = header.log_time;
                Some(Entry { at_ns, kind })
            }
            _ => None,
        })
    }
}

fn content(topic: Topic, data: &[u8]) -> Option<EntryKind> {
    Some(match topic {
        Topic::ToBoard => {
            let (sequence, message) = line(data)?;
            EntryKind::Sent(sequence, message)
        }
        Topic::FromBoard => EntryKind::Received(line(data)?.1),
        Topic::Telemetry => EntryKind::Telemetry(serde_json::from_slice(data).ok()?),
        Topic::Inputs => EntryKind::Inputs(decode(data)?),
    })
}

fn line<M: DeserializeOwned>(data: &[u8]) -> Option<(u16, M)> {
    let line: Line = serde_json::from_slice(data).ok()?;
    let bytes = from_hex(&line.bytes)?;
    Some((line.sequence, postcard::from_bytes(&bytes).ok()?))
}
