//! Parts moved by the window: dragged by handles, nudged by keys, moved by numbers; and undo and redo of every move, whatever made it.
//!
//! Nothing here moves a part while the motors are on, so that undo is never a motion of what a hand holds. What a board moved in the meantime becomes a step of
//! the history once its motors are off.

use std::sync::Arc;

use glam::{DAffine3, DQuat, DVec3};

use super::barrier::Stretch;
use super::moves::{Dragged, Motion};
use super::notes::Severity;
use super::state::Session;
use super::steps::Steps;

/// Least displacement that counts as a motion on the board, mm: well above the rounding of the link's 32-bit numbers.
const NOTICED_MM: f64 = 1e-3;
/// The same for a turn, as the largest change of a unit vector.
const NOTICED_TURN: f64 = 1e-5;

impl Session {
    /// Why a part cannot be moved by the window now (blocked reason), as a sentence.
    pub fn no_moving(&self, part: usize) -> Option<String> {
        let reason = match &self.document {
            None => "No file is open",
            Some(document) if part >= document.poses.len() => "Select a part first",
            Some(_) => self.no_move()?,
        };
        Some(reason.to_owned())
    }

    /// Why nothing can be undone now, or redone (blocked reason), as a sentence.
    pub(super) fn no_rewinding(&self, back: bool) -> Option<String> {
        let (step, none) = match back {
            true => (self.moves.to_undo(), "There is nothing to undo"),
            false => (self.moves.to_redo(), "There is nothing to redo"),
        };
        let reason = match (&self.document, step) {
            (None, _) => "No file is open",
            (_, None) => none,
            _ if self.moves.steps.regroups(back) => self.no_move().or(self.no_other_bake())?,
            _ => self.no_move()?,
        };
        Some(reason.to_owned())
    }

    /// Begins to drag a part, which moves by [`Self::drag_to`], as far as it meets no other part or in any case; returns whether it may be dragged.
    pub fn begin_drag(&mut self, part: usize, stops_at_contact: bool) -> bool {
        if self.no_moving(part).is_some() {
            return false;
        }
        let Some(document) = &self.document else {
            return false;
        };
        self.moves.drags += 1;
        self.moves.dragged = Some(Dragged {
            part,
            first: document.groups().first(part),
            from: document.poses.clone(),
            extent: document.extent,
            stops_at_contact,
            goal: None,
            asked: None,
            stopped_by: None,
            ends: None,
        });
        true
    }

    /// Where the part that is being dragged was, mm.
    pub fn dragged_from(&self) -> Option<DAffine3> {
        let dragged = self.moves.dragged.as_ref()?;
        dragged.from.get(dragged.part).copied()
    }

    /// Drags the part to a pose, mm, or where it is to stop at contact towards it; a board gets it there once it is let go of.
    pub fn drag_to(&mut self, pose: DAffine3) {
        if let (Some(dragged), Some(document)) = (&mut self.moves.dragged, &mut self.document)
            && pose.is_finite()
        {
            if dragged.stops_at_contact {
                let group = document.groups().of(dragged.part);
                let first = group.and_then(|group| group.first_with(dragged.part, pose));
                dragged.goal = Some(first.unwrap_or(pose));
                self.go_towards();
            } else {
                document.put(dragged.part, pose);
                document.extend_to(dragged.part);
            }
        }
    }

    /// Shows what is dragged where its first part is at a pose, mm.
    fn show_dragged(&mut self, pose: DAffine3) {
        if let (Some(dragged), Some(document)) = (&self.moves.dragged, &mut self.document) {
            document.put(dragged.first, pose);
            document.extend_to(dragged.first);
        }
    }

    /// Computes how far the dragged part can go towards its goal, unless that is being computed or known.
    fn go_towards(&mut self) {
        let (Some(dragged), Some(document)) = (&mut self.moves.dragged, &self.document) else {
            return;
        };
        let Some(goal) = dragged.goal.filter(|goal| dragged.asked != Some(*goal)) else {
            return;
        };
        if self.moves.barrier.is_busy() {
            return;
        }
        dragged.asked = Some(goal);
        let stretch = Stretch {
            drag: self.moves.drags,
            model: Arc::clone(&document.grouped.model),
            extents: document.grouped.extents.clone(),
            poses: document.poses.clone(),
            part: dragged.first,
            to: goal,
        };
        self.moves.barrier.ask(stretch, || self.outbox.waker());
    }

    /// Takes in how far a dragged part has come.
    pub(super) fn poll_drag(&mut self) {
        while let Some(reached) = self.moves.barrier.poll() {
            if let Some(dragged) = &mut self.moves.dragged
                && reached.drag == self.moves.drags
            {
                dragged.stopped_by = reached.stopped_by;
                self.show_dragged(reached.pose);
            }
            self.go_towards();
        }
        self.end_drag();
    }

    /// Leaves the part that is being dragged where it is: a step of the history by this verb. One that stops at contact first goes on to where the pointer
    /// was, as far as it can.
    pub fn let_go_of_dragged(&mut self, verb: &str) {
        if let (Some(dragged), Some(document)) = (&mut self.moves.dragged, &self.document) {
            dragged.ends = Some(format!("{verb} {}", document.moving_name(dragged.part)));
        }
        self.end_drag();
    }

    fn end_drag(&mut self) {
        let under_way = |dragged: &Dragged| dragged.ends.is_none() || dragged.goal != dragged.asked;
        if self.moves.barrier.is_busy() || self.moves.dragged.as_ref().is_none_or(under_way) {
            return;
        }
        let name = self.moves.dragged.take().and_then(|dragged| dragged.ends);
        let (Some(name), Some(document)) = (name, &self.document) else {
            return;
        };
        let poses = document.poses.clone();
        self.tour = None;
        self.place(poses);
        self.note_step(&name);
        self.upload_if_due();
    }

    /// Takes back what is being dragged.
    pub fn take_back(&mut self) {
        if let (Some(dragged), Some(document)) = (self.moves.dragged.take(), &mut self.document) {
            document.poses = dragged.from;
            document.extent = dragged.extent;
        }
    }

    /// Moves a part, which must be possible.
    pub(super) fn move_part(&mut self, motion: &Motion) {
        let Some(document) = &self.document else { return };
        let Some(pose) = motion.moved(document) else {
            return;
        };
        let poses = document.poses_with(motion.part, pose);
        let verb = match (motion.turn == DQuat::IDENTITY, motion.shift_mm == DVec3::ZERO) {
            (true, _) => "move",
            (_, true) => "turn",
            _ => "move and turn",
        };
        let name = format!("{verb} {}", document.moving_name(motion.part));
        self.place(poses);
        if let (true, Some(document)) = (motion.goes_on, &self.document) {
            self.moves.steps.go_on(&name, &document.poses);
        } else {
            self.note_step(&name);
        }
    }

    /// Adds what has just moved to the history.
    pub(super) fn note_step(&mut self, name: &str) {
        if let Some(document) = &self.document
            && self.moves.generation == Some(document.generation)
        {
            self.moves.steps.record(name, &document.poses);
        }
    }

    /// Begins the history of a new document, and adds what a board moved while its motors were on. A drag ends with motors on, and with its document.
    pub(super) fn watch_moves(&mut self) {
        if self.is_armed() {
            self.take_back();
            return;
        }
        // A recorded run moves parts for a while only.
        if self.replays() {
            return;
        }
        let Some(document) = &self.document else { return };
        let moves = &mut self.moves;
        if moves.generation != Some(document.generation) {
            moves.steps = Steps::beginning(&document.poses, document.groups().clone());
            moves.generation = Some(document.generation);
            moves.dragged = None;
            return;
        }
        if moves.dragged.is_some() {
            return;
        }
        let pairs = moves.steps.poses().iter().zip(&document.poses);
        let elsewhere: Vec<usize> = (pairs.enumerate())
            .filter(|(_, (before, now))| are_apart(before, now))
            .map(|(part, _)| part)
            .collect();
        let name = match elsewhere[..] {
            [] => return,
            [part, ..] if document.groups().together(part) == elsewhere => {
                format!("motion of {} on the board", document.moving_name(part))
            }
            _ => format!("motion of {} parts on the board", elsewhere.len()),
        };
        moves.steps.record(&name, &document.poses);
    }

    /// Undoes the last step, or redoes the one undone last; returns its name. It must be possible.
    pub(super) fn rewind(&mut self, back: bool) -> Option<String> {
        self.watch_moves();
        let steps = &mut self.moves.steps;
        let name = if back { steps.undo() } else { steps.redo() }?;
        let (poses, groups) = (steps.poses().to_vec(), steps.groups().clone());
        self.instructions.follow(&poses, back);
        let is_regrouped = self.regroup(groups);
        self.place(poses);
        if is_regrouped {
            self.bake();
        }
        let done = if back { "Undone" } else { "Redone" };
        self.notes.add(Severity::Info, format!("{done}: {name}"));
        Some(name)
    }
}

fn are_apart(a: &DAffine3, b: &DAffine3) -> bool {
    let turned = (0..3).map(|i| (a.matrix3.col(i) - b.matrix3.col(i)).length());
    (a.translation - b.translation).length() > NOTICED_MM || turned.fold(0.0, f64::max) > NOTICED_TURN
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::*;
    use crate::session::document::Document;
    use crate::session::intent::{Intent, obstacle};

    fn session() -> Session {
        let mut session = Session::new(Arc::new(|| {}));
        let document = Document::sample(1, &|_| ControlFlow::Continue(())).expect("the sample");
        session.document = Some(document);
        session.watch_moves();
        session
    }

    fn poses(session: &Session) -> Vec<DAffine3> {
        session.document.as_ref().expect("open").poses.clone()
    }

    fn by(x: f64) -> Intent {
        Intent::Move(Motion {
            part: 1,
            shift_mm: x * DVec3::X,
            turn: DQuat::IDENTITY,
            goes_on: false,
        })
    }

    #[test]
    fn every_kind_of_move_is_undone_in_turn() {
        let mut session = session();
        let why = |session: &Session, intent: Intent| obstacle(session, &intent).unwrap_or_default();
        assert_eq!(why(&session, Intent::Undo), "There is nothing to undo");
        let mut states = vec![poses(&session)];
        session.act(by(3.0));
        states.push(poses(&session));
        assert!(session.begin_drag(0, false));
        session.drag_to(DAffine3::from_translation(DVec3::Z));
        let refused = why(&session, Intent::Undo);
        assert!(refused.contains("Let go"), "{refused}");
        session.let_go_of_dragged("move");
        states.push(poses(&session));
        // As a board moves it.
        let document = session.document.as_mut().expect("open");
        document.poses[1].translation.z -= 12.0;
        states.push(poses(&session));
        session.act(Intent::ResetScene);
        states.push(poses(&session));
        assert_eq!(states[4], states[0]);
        let names = [
            "put parts back",
            "motion of peg on the board",
            "move block",
            "move peg",
        ];
        for (state, name) in states.iter().rev().skip(1).zip(names) {
            assert_eq!(session.moves.to_undo(), Some(name));
            session.act(Intent::Undo);
            assert_eq!(poses(&session), *state, "{name}");
        }
        assert_eq!(why(&session, Intent::Undo), "There is nothing to undo");
        for state in &states[1..] {
            session.act(Intent::Redo);
            assert_eq!(poses(&session), *state);
        }
        assert_eq!(why(&session, Intent::Redo), "There is nothing to redo");
    }

    #[test]
    fn a_drag_that_is_taken_back_leaves_nothing() {
        let mut session = session();
        let (before, extent) = (poses(&session), session.document.as_ref().expect("open").extent);
        assert!(session.begin_drag(1, false));
        session.drag_to(DAffine3::from_translation(900.0 * DVec3::X));
        let document = session.document.as_ref().expect("open");
        assert!(document.extent.radius > extent.radius, "it stays in sight");
        session.take_back();
        let document = session.document.as_ref().expect("open");
        assert_eq!((&document.poses, document.extent), (&before, extent));
        assert_eq!(session.moves.to_undo(), None);
    }

    #[test]
    fn a_part_that_stops_at_contact_goes_as_far_as_it_can_after_it_was_let_go_of() {
        let mut session = session();
        // Beside its bore the peg stands 20 mm above the block.
        session.act(by(15.0));
        let start = poses(&session)[1].translation;
        assert!(session.begin_drag(1, true));
        for mm in [3.0, 30.0, 40.0] {
            let mut pose = session.dragged_from().expect("dragged");
            pose.translation.z -= mm;
            session.drag_to(pose);
        }
        session.let_go_of_dragged("move");
        let begun = std::time::Instant::now();
        while session.moves.dragged().is_some() {
            assert!(begun.elapsed().as_secs() < 120);
            std::thread::sleep(std::time::Duration::from_millis(5));
            session.poll();
        }
        let by = poses(&session)[1].translation - start;
        assert!((by.z + 20.0).abs() < 2.1e-3, "{by}");
        session.act(Intent::Undo);
        assert_eq!(poses(&session)[1].translation, start);
    }

    #[test]
    fn a_thousand_turns_leave_a_part_rigid_and_its_middle_in_place() {
        let mut session = session();
        let middle = |session: &Session| {
            session
                .document
                .as_ref()
                .expect("open")
                .middle(1)
                .expect("a part")
        };
        let before = middle(&session);
        for _ in 0..1000 {
            session.move_part(&Motion {
                part: 1,
                shift_mm: DVec3::ZERO,
                turn: DQuat::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 0.1),
                goes_on: true,
            });
        }
        let matrix = poses(&session)[1].matrix3;
        assert!((matrix.determinant() - 1.0).abs() < 1e-12);
        // A rounding of 2⁻⁵² of 60 mm in each of a thousand turns.
        assert!((middle(&session) - before).length() < 1e-9);
        session.act(Intent::Undo);
        assert_eq!(session.moves.to_undo(), None, "one step");
    }
}
