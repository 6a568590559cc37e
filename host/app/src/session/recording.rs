//! Recording of the connected rig, on the link's thread.

use std::path::{Path, PathBuf};
use std::time::Instant;

use mortise_bake::Baked;
use mortise_record::{Recorder, Written};
use mortise_rig::Client;

/// Most files of the folder, so that the search for a free name ends.
const MOST_FILES: u32 = 100_000;

/// A recording in progress.
#[derive(Clone, Debug)]
pub struct Recording {
    /// The file.
    pub path: PathBuf,
    /// Its beginning.
    pub since: Instant,
}

/// What became of a recording.
pub enum RecordingUpdate {
    /// It has begun, to this file; or one line with the reason why not.
    Begun(Result<PathBuf, String>),
    /// It has ended.
    Ended(Result<Written, String>),
}

/// The recorder of the link's thread, if one records. Dropped with the connection, it ends its file.
#[derive(Default)]
pub(super) struct Recorded(Option<Recorder>);

impl Recorded {
    /// Begins a recording to a new file of `folder`, with the collision model that is on the board.
    pub fn begin(&mut self, client: &Client, folder: &Path, scene: Option<&Baked>) -> RecordingUpdate {
        let begun = free_name(folder).and_then(|path| {
            let recorder = Recorder::start(client, &path).map_err(|error| error.to_string())?;
            Ok((path, recorder))
        });
        RecordingUpdate::Begun(begun.map(|(path, recorder)| {
            if let Some(scene) = scene {
                recorder.scene(&scene.image);
            }
            self.0 = Some(recorder);
            path
        }))
    }

    /// Attaches a collision model that was uploaded.
    pub fn scene(&self, scene: &Baked) {
        if let Some(recorder) = &self.0 {
            recorder.scene(&scene.image);
        }
    }

    /// Ends the recording, if there is one.
    pub fn end(&mut self, client: &Client) -> Option<RecordingUpdate> {
        let written = self.0.take()?.finish(Some(client));
        Some(RecordingUpdate::Ended(written.map_err(|error| error.to_string())))
    }
}

/// The first free name of the folder, which is made if it is missing.
fn free_name(folder: &Path) -> Result<PathBuf, String> {
    let failed = |error| {
        format!(
            "{}: recordings cannot be written there: {error}",
            folder.display()
        )
    };
    std::fs::create_dir_all(folder).map_err(failed)?;
    (1..MOST_FILES)
        .map(|number| folder.join(format!("run-{number}.mcap")))
        .find(|path| !path.exists())
        .ok_or_else(|| format!("{} is full: remove old recordings", folder.display()))
}
