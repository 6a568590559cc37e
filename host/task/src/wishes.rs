//! What a user wishes of a sequence: parts that a fixture holds, and a direction in which parts fall.

use glam::DVec3;

/// Wishes of a sequence.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Wishes {
    /// Parts that never move.
    pub held: Vec<usize>,
    /// Unit direction of gravity in the assembly's frame; `None`: parts stay where they are put.
    pub down: Option<DVec3>,
}

impl Wishes {
    /// Whether one of some parts is held.
    pub(crate) fn hold_one_of(&self, parts: &[usize]) -> bool {
        parts.iter().any(|part| self.held.contains(part))
    }
}
