//! Showing recorded runs: reading them beside the window's thread, moving the parts as they moved, and comparing.

use std::path::PathBuf;
use std::time::Instant;

use mortise_protocol::image::CRC;

use super::ask::write;
use super::link::Link;
use super::notes::Severity;
use super::outbox::Update;
use super::pose;
use super::purpose::Purpose;
use super::run::{Playback, Run, RunIntent, RunRead};
use super::run_report::html;
use super::state::Session;
use super::threads::spawn;

/// Longest time that passes between two frames, s: a window that was hidden does not jump.
const MOST_S: f64 = 0.25;

impl Session {
    /// Why an action on runs is not possible now, as a sentence.
    pub(super) fn no_run_action(&self, intent: &RunIntent) -> Option<String> {
        let reason = match intent {
            RunIntent::Browse | RunIntent::Open(_) => match self.link {
                Link::None => return None,
                _ => "Disconnect first: with a rig, the parts are where it has them",
            },
            _ if self.playback.is_none() => "Open a run first",
            _ => return None,
        };
        Some(reason.to_owned())
    }

    pub(super) fn perform_on_run(&mut self, intent: RunIntent) {
        match intent {
            RunIntent::Browse => self.ask_for_path(Purpose::OpenRun),
            RunIntent::BrowseOther => self.ask_for_path(Purpose::CompareRun),
            RunIntent::Open(path) => self.read_run(path, false),
            RunIntent::Compare(path) => self.read_run(path, true),
            RunIntent::Play(plays) => {
                if let Some(playback) = &mut self.playback {
                    // From the end it begins anew.
                    if plays && playback.at_s >= playback.run.duration_s() {
                        playback.go_to(0.0);
                    }
                    playback.plays = plays;
                    self.played = Some(Instant::now());
                }
            }
            RunIntent::GoTo(time_s) => {
                if let Some(playback) = &mut self.playback {
                    playback.plays = false;
                    playback.go_to(time_s);
                }
                self.show_frame();
            }
            RunIntent::Speed(speed) => {
                if let Some(playback) = &mut self.playback
                    && speed.is_finite()
                    && speed > 0.0
                {
                    playback.speed = speed;
                }
            }
            RunIntent::SaveReport => self.ask_for_path(Purpose::SaveRunReport),
            RunIntent::WriteReport { path, replace } => {
                if let Some(playback) = &self.playback {
                    let other = playback.compared.as_ref().map(|run| (run, playback.shift_s()));
                    write(&self.outbox, path, replace, html(&playback.run, other));
                }
            }
            RunIntent::Close => self.close_run(),
        }
    }

    fn read_run(&self, path: PathBuf, compare: bool) {
        let outbox = self.outbox.clone();
        spawn("mortise-run", move || {
            let result = Run::read(&path).map(Box::new);
            outbox.send(Update::Run(RunRead { compare, result }));
        });
    }

    pub(super) fn run_read(&mut self, read: RunRead) {
        let run = match read.result {
            Ok(run) => *run,
            Err(why) => return self.notes.add(Severity::Error, why),
        };
        if read.compare {
            if let Some(playback) = &mut self.playback {
                playback.compared = Some(run);
            }
            return;
        }
        // A rig that was connected meanwhile moves the parts.
        if !matches!(self.link, Link::None) {
            return;
        }
        self.close_run();
        self.note_project();
        let moves_parts = self.has_scene_of(&run);
        let name = run.name();
        self.notes.add(
            Severity::Info,
            if moves_parts {
                format!("{name}: {:.1} s", run.duration_s())
            } else {
                format!(
                    "{name}: {:.1} s; the open file has another collision model, so no part is moved: open the file that was recorded, with its parts grouped as they were",
                    run.duration_s()
                )
            },
        );
        self.before_run =
            (self.document.as_ref().filter(|_| moves_parts)).map(|document| document.poses.clone());
        self.playback = Some(Playback::new(run, moves_parts));
        self.show_frame();
    }

    /// Whether the open document's collision model is one that was on the board.
    fn has_scene_of(&self, run: &Run) -> bool {
        let scene = self.document.as_ref().and_then(|document| document.scene());
        scene.is_some_and(|baked| run.scenes.contains(&CRC.checksum(&baked.image)))
    }

    /// Shows no run any more; the parts go back to where they were.
    pub(super) fn close_run(&mut self) {
        self.playback = None;
        if let (Some(poses), Some(document)) = (self.before_run.take(), &mut self.document)
            && poses.len() == document.poses.len()
        {
            document.poses = poses;
        }
    }

    /// Lets a run, or the motion that shows a freedom, go on. Returns whether one does, so that the window draws the next frame.
    pub fn play(&mut self, now: Instant) -> bool {
        let passed = self.played.replace(now).map_or(0.0, |then| {
            now.saturating_duration_since(then).as_secs_f64().min(MOST_S)
        });
        let shows = self.joints.pass(passed);
        match &mut self.playback {
            Some(playback) if playback.plays => {
                playback.pass(passed);
                self.show_frame();
                true
            }
            _ => shows,
        }
    }

    /// Puts the parts that were held where they were.
    fn show_frame(&mut self) {
        let (Some(playback), Some(document)) = (&self.playback, &mut self.document) else {
            return;
        };
        if !playback.moves_parts {
            return;
        }
        for (part, pose) in playback.run.poses(playback.at_s) {
            if let Some(part) = document.model_part(part) {
                document.put(part, pose::from_wire(&pose));
            }
        }
    }
}
