//! Recording as the operator sees it: beginning, end, and what is said of it.

use std::path::PathBuf;
use std::time::Instant;

use etcetera::BaseStrategy as _;

use super::document::Document;
use super::link::Command;
use super::notes::Severity;
use super::recording::{Recording, RecordingUpdate};
use super::state::Session;

/// Where the window's recordings are kept: a folder of the user's data.
fn folder() -> Result<PathBuf, String> {
    let base = etcetera::choose_base_strategy();
    let base = base.map_err(|error| format!("There is no folder for recordings: {error}"))?;
    Ok(base.data_dir().join("mortise").join("recordings"))
}

impl Session {
    /// Where recordings go, if there is a folder for them.
    pub(super) fn recordings(&self) -> Option<PathBuf> {
        self.recordings.clone().or_else(|| folder().ok())
    }

    pub(super) fn begin_recording(&mut self) {
        let folder = match self.recordings.clone().map_or_else(folder, Ok) {
            Ok(folder) => folder,
            Err(why) => return self.notes.add(Severity::Error, why),
        };
        self.bring_whole_scene();
        let on_board = self.scene_is_on_board();
        let scene = (self.document.as_ref().filter(|_| on_board)).and_then(Document::scene);
        if let Some(connection) = self.connection() {
            connection.command(Command::Record { folder, scene });
        }
    }

    pub(super) fn end_recording(&mut self) {
        if let Some(connection) = self.connection() {
            connection.command(Command::EndRecording);
        }
    }

    /// Says that the recording has ended with its connection.
    pub(super) fn recording_lost(&mut self) {
        if let Some(recording) = self.recording.take() {
            let path = recording.path.display();
            self.notes.add(
                Severity::Info,
                format!("The recording {path} has ended with the connection"),
            );
        }
    }

    pub(super) fn recording_update(&mut self, update: RecordingUpdate) {
        match update {
            RecordingUpdate::Begun(Ok(path)) => {
                let text = format!("Recording to {}", path.display());
                self.notes.add(Severity::Info, text);
                let since = Instant::now();
                self.recording = Some(Recording { path, since });
            }
            RecordingUpdate::Ended(Ok(written)) => {
                self.recording = None;
                let (path, ticks) = (written.path.display(), written.ticks);
                let text = match written.lost_ticks + written.lost_messages {
                    0 => format!("Recorded {ticks} ticks to {path}: `mortise replay` computes them again"),
                    lost => format!("Recorded {ticks} ticks to {path}; {lost} were lost on the way"),
                };
                self.notes.add(Severity::Good, text);
            }
            RecordingUpdate::Begun(Err(why)) | RecordingUpdate::Ended(Err(why)) => {
                self.recording = None;
                self.notes.add(Severity::Error, why);
            }
        }
    }
}
