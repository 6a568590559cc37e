//! Motions of parts by the window, and the state of its history of moves. Pure. Poses are rigid, part to world, mm.

use glam::{DAffine3, DQuat, DVec3};

use super::barrier::Barrier;
use super::document::Document;
use super::pose::{moved, rigid};
use super::steps::Steps;
use crate::display::extent::Extent;

/// Name of the step that puts every part back.
pub(super) const PUT_BACK: &str = "put parts back";

/// A motion of a part, and of its group with it, by keys or numbers: a turn about the middle of what moves, then a shift, both in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// The part.
    pub part: usize,
    /// The shift, mm.
    pub shift_mm: DVec3,
    /// The turn.
    pub turn: DQuat,
    /// Whether it goes on with the motion before, as while a key is held down: one step of the history.
    pub goes_on: bool,
}

impl Motion {
    /// The part, moved so.
    pub fn moved(&self, document: &Document) -> Option<DAffine3> {
        let pose = document.poses.get(self.part)?;
        if self.turn == DQuat::IDENTITY {
            let mut pose = *pose;
            pose.translation += self.shift_mm;
            return Some(pose);
        }
        Some(rigid(&moved(
            pose,
            document.middle(self.part)?,
            self.turn,
            self.shift_mm,
        )))
    }
}

/// A part that is being dragged.
#[derive(Clone, Debug)]
pub(super) struct Dragged {
    pub part: usize,
    /// The part that stands for it and those of its group: what follows is that one's.
    pub first: usize,
    /// Where all parts were.
    pub from: Vec<DAffine3>,
    /// Bounding sphere of all parts then.
    pub extent: Extent,
    /// Whether it stops where it meets another part.
    pub stops_at_contact: bool,
    /// Where the pointer has it, where it is to stop at contact.
    pub goal: Option<DAffine3>,
    /// The goal of the stretch that was computed last, or is being computed.
    pub asked: Option<DAffine3>,
    /// The part that stops it.
    pub stopped_by: Option<usize>,
    /// Name of the step, once it was let go of: it still goes to where the pointer was.
    pub ends: Option<String>,
}

/// Moves of the open document.
#[derive(Default)]
pub struct Moves {
    pub(super) barrier: Barrier,
    /// Number of drags so far.
    pub(super) drags: u64,
    pub(super) steps: Steps,
    /// Document of the steps.
    pub(super) generation: Option<u64>,
    pub(super) dragged: Option<Dragged>,
}

impl Moves {
    /// Name of the step that is undone next.
    pub fn to_undo(&self) -> Option<&str> {
        self.steps.to_undo()
    }

    /// Name of the step that is redone next.
    pub fn to_redo(&self) -> Option<&str> {
        self.steps.to_redo()
    }

    /// The part that is being dragged.
    pub fn dragged(&self) -> Option<usize> {
        self.dragged.as_ref().map(|dragged| dragged.part)
    }

    /// The part that stops the one that is being dragged.
    pub fn stopped_by(&self) -> Option<usize> {
        self.dragged.as_ref()?.stopped_by
    }
}
