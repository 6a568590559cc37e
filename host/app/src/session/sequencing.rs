//! The search for the steps in which the open assembly goes together, beside the window's thread, and putting the parts where they are between two of them.

use std::sync::Arc;
use std::time::{Duration, Instant};

use glam::DAffine3;
use mortise_brep::CadModel;
use mortise_task::{Assembly, sequence};

use super::document::Document;
use super::outbox::Update;
use super::sequence::Sequence;
use super::state::Session;
use super::threads::spawn;

/// Longest search.
pub const LONGEST: Duration = Duration::from_secs(60);
/// Name of a step of the history.
const NAME: &str = "go to a step of the sequence";

/// What a search found.
pub struct SequenceFound {
    /// Number of the search.
    id: u64,
    /// The steps, or one line with the reason why there are none.
    result: Result<Sequence, String>,
}

/// Where the parts are.
struct Shown {
    /// Number of steps done, with a share of the next one; `None` where the parts are elsewhere.
    done: Option<f64>,
    poses: Vec<DAffine3>,
}

/// The search and what it found.
#[derive(Default)]
pub struct Sequencing {
    /// Number of searches so far.
    searches: u64,
    /// Start of the search under way.
    since: Option<Instant>,
    /// Document of the search.
    generation: Option<u64>,
    found: Option<Result<Sequence, String>>,
    shown: Option<Shown>,
}

impl Sequencing {
    /// Start of the search under way.
    pub fn since(&self) -> Option<Instant> {
        self.since
    }

    /// The steps of the open document, once they were found.
    pub fn found(&self, document: &Document) -> Option<&Sequence> {
        let is_its = self.generation == Some(document.generation);
        self.found.as_ref().filter(|_| is_its)?.as_ref().ok()
    }

    /// Why the search failed, in a line.
    pub fn failure(&self, document: &Document) -> Option<&str> {
        let is_its = self.generation == Some(document.generation);
        let failure = self.found.as_ref().filter(|_| is_its)?.as_ref().err();
        failure.map(String::as_str)
    }

    /// Number of steps done, with a share of the next one; `None` where the parts are elsewhere.
    pub fn done(&self) -> Option<f64> {
        self.shown.as_ref()?.done
    }

    /// Follows parts that were moved otherwise, as by undo.
    pub(super) fn follow(&mut self, document: &Document) {
        if (self.shown.as_ref()).is_some_and(|shown| shown.poses == document.poses) {
            return;
        }
        self.shown = self.found(document).map(|found| Shown {
            done: found.done(&document.poses),
            poses: document.poses.clone(),
        });
    }

    /// Forgets the search under way: its thread ends by itself.
    pub(super) fn cancel(&mut self) {
        self.since = None;
        self.searches += 1;
    }

    /// Takes in what a search found, unless it is no longer wanted.
    pub(super) fn take_in(&mut self, found: SequenceFound) {
        if self.since.is_some() && found.id == self.searches {
            self.since = None;
            self.found = Some(found.result);
        }
    }
}

impl Session {
    /// Starts the search, which must be possible.
    pub(super) fn find_sequence(&mut self) {
        let Some(document) = &self.document else { return };
        let sequencing = &mut self.sequencing;
        sequencing.searches += 1;
        (sequencing.since, sequencing.generation) = (Some(Instant::now()), Some(document.generation));
        (sequencing.found, sequencing.shown) = (None, None);
        let (id, model, outbox) = (
            sequencing.searches,
            Arc::clone(&document.model),
            self.outbox.clone(),
        );
        spawn("mortise-sequence", move || {
            let result = search(&model);
            outbox.send(Update::Sequence(SequenceFound { id, result }));
        });
    }

    /// Puts the parts where they are after so many steps, which must be possible, and selects what is put on next.
    pub(super) fn go_to_step(&mut self, done: f64, goes_on: bool) {
        let Some(document) = &self.document else { return };
        let Some(found) = self.sequencing.found(document) else {
            return;
        };
        let done = if done.is_finite() { done } else { 0.0 };
        let done = done.clamp(0.0, found.steps.len() as f64);
        let (poses, next) = (
            found.poses(done),
            found.next(done).and_then(|step| step.parts.first().copied()),
        );
        self.tour = None;
        self.place(poses.clone());
        if goes_on {
            self.moves.steps.go_on_with_others(NAME, &poses);
        } else {
            self.note_step(NAME);
        }
        if next.is_some() {
            self.selected = next;
        }
        self.sequencing.shown = Some(Shown {
            done: Some(done),
            poses,
        });
    }
}

/// The steps of a model. Cost: seconds, at most [`LONGEST`] and some.
fn search(model: &CadModel) -> Result<Sequence, String> {
    let assembly = Assembly::new(model.clone()).map_err(|error| error.to_string())?;
    let all: Vec<usize> = (0..assembly.count()).collect();
    let found = sequence::disassemble(&assembly, &all, LONGEST);
    Ok(Sequence::new(&assembly, &found))
}
