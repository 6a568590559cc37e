//! Searching the steps in which the open assembly goes together, beside the window's thread, and putting the parts where they are at one of them.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use glam::{DAffine3, DVec3};
use mortise_brep::CadModel;
use mortise_task::{Assembly, Deadline, sequence};

use super::ask::write;
use super::grouped::Grouped;
use super::outbox::Update;
use super::sequence::Sequence;
use super::sequencing::SequenceFound;
use super::state::Session;
use super::threads::{Cancel, spawn};

/// Longest search.
const LONGEST: Duration = Duration::from_secs(60);
/// Name of a step of the history.
const NAME: &str = "go to a step of the sequence";

impl Session {
    /// Way of what the next step puts on, from where it stands to its place, mm; `None` where the parts are at no step, or all are in place.
    pub fn next_way(&self) -> Option<Vec<DVec3>> {
        let found = self.sequencing.found(self.document.as_ref()?)?;
        let way = found.way(self.sequencing.done()?);
        (!way.is_empty()).then_some(way)
    }

    /// Parts that the next step puts on, with their poses after it; none where the parts are at no step, or all are in place.
    pub fn next_places(&self) -> Vec<(usize, DAffine3)> {
        let next = || {
            let found = self.sequencing.found(self.document.as_ref()?)?;
            let done = self.sequencing.done()?;
            Some((found.next(done)?, found.poses(done.floor() + 1.0)))
        };
        let Some((step, poses)) = next() else {
            return Vec::new();
        };
        let place = |&part: &usize| Some((part, *poses.get(part)?));
        step.parts.iter().filter_map(place).collect()
    }

    /// Starts the search, which must be possible.
    pub(super) fn find_sequence(&mut self) {
        let Some(document) = &self.document else { return };
        let (id, cancel) = self.sequencing.begin(document.generation);
        let (grouped, outbox) = (Arc::clone(&document.grouped), self.outbox.clone());
        let title = document.title.clone();
        spawn("mortise-sequence", move || {
            if let Some(result) = search(&title, &grouped, &cancel) {
                outbox.send(Update::Sequence(SequenceFound { id, result }));
            }
        });
    }

    /// Writes the report of the steps, which must be known.
    pub(super) fn write_steps(&self, path: PathBuf, replace: bool) {
        let found = (self.document.as_ref()).and_then(|document| self.sequencing.found(document));
        if let Some(found) = found {
            write(&self.outbox, path, replace, found.page.to_string());
        }
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
            self.select(next);
        }
        self.sequencing.put(done, poses);
    }
}

/// The steps of a model, each group as one part, with their report, or why there are none; `None` when it was cancelled. Cost: seconds, at most [`LONGEST`] and some; after a cancel
/// the contacts of the parts are still found, and a search ends within a sweep of one pair of them.
fn search(title: &str, grouped: &Grouped, cancel: &Cancel) -> Option<Result<Sequence, String>> {
    let (model, numbers) = grouped.bodies();
    let assembly = match Assembly::new(CadModel::clone(&model)) {
        Ok(assembly) => assembly,
        Err(error) => return Some(Err(error.to_string())),
    };
    let all: Vec<usize> = (0..assembly.count()).collect();
    let until = Deadline::from(LONGEST).or_stopped(cancel.flag());
    let found = sequence::disassemble(&assembly, &all, until);
    let steps = || Sequence::new(title, &assembly, &found).with_groups(grouped, &numbers);
    (!cancel.is_set()).then(|| Ok(steps()))
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::*;
    use crate::session::document::Document;

    #[test]
    fn a_cancelled_search_gives_nothing() {
        let document = Document::sample(1, &|_| ControlFlow::Continue(())).expect("the sample");
        let cancel = Cancel::default();
        assert!(search("sample", &document.grouped, &cancel).is_some());
        cancel.set();
        assert_eq!(search("sample", &document.grouped, &cancel), None);
    }
}
