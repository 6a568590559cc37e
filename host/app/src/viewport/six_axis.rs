//! A six-axis device such as a SpaceMouse: the deflection of its cap, and what the cap moves.
//!
//! Directions are those of the screen: right, up, towards the viewer.

use glam::{DAffine3, DVec3};

/// Deflection of the cap along and about right, up, and towards the viewer; full is 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Deflection {
    /// Along the directions.
    pub shift: DVec3,
    /// About them, right-handed.
    pub turn: DVec3,
}

impl Deflection {
    /// Whether the cap is at rest.
    pub fn is_rest(&self) -> bool {
        *self == Self::default()
    }

    /// Speeds over full speed: the square of the deflection, so that small ones are precise.
    pub(super) fn speeds(&self) -> [DVec3; 2] {
        [self.shift, self.turn].map(|of| of.clamp(DVec3::NEG_ONE, DVec3::ONE) * of.abs().min(DVec3::ONE))
    }
}

/// What the cap is for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Use {
    /// Looking around.
    #[default]
    View,
    /// Moving the part: the hand of a simulation that holds one, or the selected part while the motors are off.
    Part,
}

/// What moves with the cap until it is at rest again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Subject {
    /// The camera.
    View,
    /// The hand of a simulation, with the pose at which it wants the handle.
    Hand(DAffine3),
    /// A part, with the pose to which it is dragged.
    Part(usize, DAffine3),
    /// Nothing more, because what was moved is no longer there.
    Nothing,
}

/// State of the cap's motion.
#[derive(Debug, Default)]
pub struct SixAxis {
    /// Whether there is a device.
    pub is_there: bool,
    /// What the cap is for.
    pub used: Use,
    pub(super) subject: Option<Subject>,
}

impl SixAxis {
    /// What moves with the cap now.
    pub fn subject(&self) -> Option<Subject> {
        self.subject
    }

    /// Switches between view and part; takes effect once the cap is at rest.
    pub fn switch(&mut self) {
        self.used = match self.used {
            Use::View => Use::Part,
            Use::Part => Use::View,
        };
    }
}
