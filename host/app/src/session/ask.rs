//! Questions for a path: by the desktop's file dialog, or where there is none by a field in the window.

use std::path::PathBuf;
use std::time::Instant;

use mortise_output::{Existing, Output, OutputError};

use super::chart::{TracesFile, charts, picture};
use super::flashing::FlashIntent;
use super::history::{Signal, csv};
use super::intent::{Intent, Traces};
use super::outbox::{Outbox, Update};
use super::purpose::Purpose;
use super::rig_page::RigIntent;
use super::runs::RunIntent;
use super::state::Session;
use super::threads::spawn;

/// What follows once the path is known.
pub fn answer(purpose: Purpose, path: PathBuf, replace: bool) -> Intent {
    match purpose {
        Purpose::OpenModel => Intent::Open(path),
        Purpose::SaveProject => Intent::WriteProject { path, replace },
        Purpose::SaveTraces => Intent::SaveTraces { path, replace },
        Purpose::SaveSteps => Intent::WriteSteps { path, replace },
        Purpose::OpenRun => Intent::Run(RunIntent::Open(path)),
        Purpose::CompareRun => Intent::Run(RunIntent::Compare(path)),
        Purpose::SaveRunReport => Intent::Run(RunIntent::WriteReport { path, replace }),
        Purpose::SaveRunTable => Intent::Run(RunIntent::WriteTable { path, replace }),
        Purpose::OpenFirmware => Intent::Flash(FlashIntent::Choose(path)),
        Purpose::OpenRig => Intent::Rig(RigIntent::Load(path)),
        Purpose::SaveRig => Intent::Rig(RigIntent::Write { path, replace }),
        Purpose::SaveRigReport => Intent::Rig(RigIntent::WriteReport { path, replace }),
    }
}

impl Session {
    /// Asks for a path by the desktop's file dialog, where there is one.
    pub(super) fn ask_for_path(&self, purpose: Purpose) {
        let folder = match purpose {
            Purpose::OpenRun | Purpose::CompareRun => self.recordings(),
            _ => self.folder(),
        };
        let dialog = move || {
            let (name, endings) = purpose.filter();
            let dialog = rfd::FileDialog::new()
                .set_title(purpose.title())
                .add_filter(name, endings)
                .add_filter("All files", &["*"]);
            let dialog = match folder {
                Some(folder) => dialog.set_directory(folder),
                None => dialog,
            };
            match purpose.is_saved() {
                true => dialog.set_file_name(purpose.file_name()).save_file(),
                false => dialog.pick_file(),
            }
        };
        let outbox = self.outbox.clone();
        let ask = move || {
            let asked = Instant::now();
            match dialog() {
                Some(path) => outbox.send(Update::Chosen(purpose, path)),
                // A dialog that closes within 0.5 s was never shown: none is available.
                None if asked.elapsed().as_millis() < 500 => outbox.send(Update::NoDialog(purpose)),
                None => true,
            };
        };
        if cfg!(target_os = "macos") {
            // On macOS dialogs must run on the main thread.
            ask();
        } else {
            spawn("mortise-dialog", ask);
        }
    }

    /// Makes files of traces as they are now, and asks where to write one.
    pub(super) fn export(&mut self, traces: &Traces) {
        let signals: Vec<&Signal> = (traces.keys.iter())
            .filter_map(|key| Signal::named(key))
            .collect();
        let ([from_s, to_s], history) = (traces.range_s, self.shown_history());
        self.table = Some(TracesFile {
            csv: csv(history, &signals, from_s, to_s),
            svg: picture(&charts(history, self.playback.as_ref(), &signals, traces.range_s)),
        });
        self.ask_for_path(Purpose::SaveTraces);
    }

    /// Writes the traces that wait for their path: a picture where it ends in `.svg`, otherwise a table.
    pub(super) fn save_traces(&mut self, path: PathBuf, replace: bool) {
        if let Some(TracesFile { csv, svg }) = self.table.take() {
            let is_picture = path
                .extension()
                .is_some_and(|ending| ending.eq_ignore_ascii_case("svg"));
            write(&self.outbox, path, replace, if is_picture { svg } else { csv });
        }
    }
}

/// Writes a file, all or nothing, on a thread of its own, which reports the end.
pub(super) fn write(outbox: &Outbox, path: PathBuf, replace: bool, text: String) {
    let outbox = outbox.clone();
    spawn("mortise-write", move || {
        let existing = Existing::from_force(replace);
        let written = Output::new(path, existing, &[] as &[PathBuf]).and_then(|output| {
            output.write(text.as_bytes())?;
            Ok(format!("Written: {}", output.path().display()))
        });
        outbox.send(Update::Written(written.map_err(|error| in_words(&error))));
    });
}

/// The reason why a file is not written; the window has no options.
fn in_words(error: &OutputError) -> String {
    match error {
        OutputError::Exists { path } => {
            format!(
                "{}: exists already; give another name, or choose to replace it",
                path.display()
            )
        }
        other => other.to_string(),
    }
}
