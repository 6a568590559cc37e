//! State of the search for the steps in which the open assembly goes together, and the step that its parts are at. Pure.

use std::time::Instant;

use glam::DAffine3;

use super::document::Document;
use super::sequence::{Sequence, are_same};
use super::threads::Cancel;

/// What a search found.
pub struct SequenceFound {
    /// Number of the search.
    pub id: u64,
    /// The steps, or one line with the reason why there are none.
    pub result: Result<Sequence, String>,
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
    /// Ends the thread of the search under way.
    cancel: Cancel,
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
        if (self.shown.as_ref()).is_some_and(|shown| are_same(&shown.poses, &document.poses)) {
            return;
        }
        self.shown = self.found(document).map(|found| Shown {
            done: found.done(&document.poses),
            poses: document.poses.clone(),
        });
    }

    /// Begins a search in the document of this number, and ends one under way; returns the number of the search, and what ends it.
    pub(super) fn begin(&mut self, generation: u64) -> (u64, Cancel) {
        self.cancel();
        self.cancel = Cancel::default();
        (self.since, self.generation) = (Some(Instant::now()), Some(generation));
        (self.found, self.shown) = (None, None);
        (self.searches, self.cancel.clone())
    }

    /// Notes where the window has put the parts.
    pub(super) fn put(&mut self, done: f64, poses: Vec<DAffine3>) {
        self.shown = Some(Shown {
            done: Some(done),
            poses,
        });
    }

    /// Ends the search under way.
    pub(super) fn cancel(&mut self) {
        self.cancel.set();
        self.since = None;
        self.searches += 1;
    }

    /// Ends the search under way and forgets what was found, as for parts that are grouped otherwise.
    pub(super) fn forget(&mut self) {
        self.cancel();
        (self.found, self.shown) = (None, None);
    }

    /// Takes in what a search found, unless it is no longer wanted.
    pub(super) fn take_in(&mut self, found: SequenceFound) {
        if self.since.is_some() && found.id == self.searches {
            self.since = None;
            self.found = Some(found.result);
        }
    }
}
