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
use super::run::Run;
use super::run_report::html;
use super::run_table;
use super::runs::{MOST_RUNS, Playback, RunIntent, RunRead};
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
            _ => {
                let Some(playback) = &self.playback else {
                    return Some("Open a run first".to_owned());
                };
                let is_computed = playback.runs().iter().any(|shown| shown.recomputation.is_some());
                match intent {
                    RunIntent::BrowseOther | RunIntent::Compare(_) if playback.runs().len() >= MOST_RUNS => {
                        return Some(format!("{MOST_RUNS} runs are shown: close one first"));
                    }
                    RunIntent::Recompute(..) if is_computed => {
                        "A run is being computed again: wait for it, or cancel it"
                    }
                    RunIntent::CancelRecompute if !is_computed => "No run is being computed again",
                    _ => return None,
                }
            }
        };
        Some(reason.to_owned())
    }

    pub(super) fn perform_on_run(&mut self, intent: RunIntent) {
        match intent {
            RunIntent::Browse => self.ask_for_path(Purpose::OpenRun),
            RunIntent::BrowseOther => self.ask_for_path(Purpose::CompareRun),
            RunIntent::Open(path) => self.read_run(path, false),
            RunIntent::Compare(path) => self.read_run(path, true),
            RunIntent::Choose(index) => {
                if let Some(playback) = &mut self.playback {
                    playback.choose(index);
                }
                self.show_frame();
            }
            RunIntent::Draw(index, drawn) => {
                if let Some(shown) = self.playback.as_mut().and_then(|p| p.shown_mut(index)) {
                    shown.drawn = drawn;
                }
            }
            RunIntent::Remove(index) => {
                if self.playback.as_mut().is_some_and(|p| p.remove(index)) {
                    self.show_frame();
                    // Parts that no run moves any more are the operator's.
                    self.before_run = self.before_run.take().filter(|_| self.replays());
                } else {
                    self.close_run();
                }
            }
            RunIntent::Play(plays) => self.play_run(plays),
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
            RunIntent::Recompute(index, what) => self.recompute(index, what),
            RunIntent::CancelRecompute => self.cancel_recompute(),
            RunIntent::SaveReport => self.ask_for_path(Purpose::SaveRunReport),
            RunIntent::WriteReport { path, replace } => {
                if let Some(playback) = &self.playback {
                    write(&self.outbox, path, replace, html(playback));
                }
            }
            RunIntent::SaveTable => self.ask_for_path(Purpose::SaveRunTable),
            RunIntent::WriteTable { path, replace } => {
                if let Some(playback) = &self.playback {
                    let runs = playback.runs().iter().map(|shown| &shown.run);
                    write(&self.outbox, path, replace, run_table::csv(runs));
                }
            }
            RunIntent::Close => self.close_run(),
        }
    }

    fn play_run(&mut self, plays: bool) {
        if let Some(playback) = &mut self.playback {
            // From the end it begins anew.
            if plays && playback.at_s >= playback.run().duration_s() {
                playback.go_to(0.0);
            }
            playback.plays = plays;
            self.played = Some(Instant::now());
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
        let moves_parts = self.has_scene_of(&run);
        if read.compare {
            // More may have been opened at once than are shown.
            if let Some(playback) = self.playback.as_mut().filter(|p| p.runs().len() < MOST_RUNS) {
                playback.push(run, moves_parts);
                self.keep_poses();
            }
            return;
        }
        // A rig that was connected meanwhile moves the parts.
        if !matches!(self.link, Link::None) {
            return;
        }
        self.close_run();
        self.note_project();
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
        self.playback = Some(Playback::new(run, moves_parts));
        self.keep_poses();
        self.show_frame();
    }

    /// Keeps where the parts are once a run moves them, to put them back when it is closed.
    fn keep_poses(&mut self) {
        if self.replays() && self.before_run.is_none() {
            self.before_run = self.document.as_ref().map(|document| document.poses.clone());
        }
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
        // Parts that another run has moved, and this one does not, are where they were before.
        match &self.before_run {
            Some(before) if before.len() == document.poses.len() => document.poses.clone_from(before),
            _ => return,
        }
        if !playback.shown().moves_parts {
            return;
        }
        for (part, pose) in playback.run().poses(playback.at_s) {
            if let Some(part) = document.model_part(part) {
                document.put(part, pose::from_wire(&pose));
            }
        }
    }
}
