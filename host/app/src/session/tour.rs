//! The steps of the automatic insertion: resets the parts, arms, grabs the peg, moves the simulated hand.

use std::time::{Duration, Instant};

use mortise_rig::RigSpec;

/// Longest wait for the board in one step; reading, baking and uploading have no limit here.
const PATIENCE: Duration = Duration::from_secs(20);

/// The condition that a demonstration waits for, and its next action.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Step {
    /// Wait until the file is read and baked, then connect.
    Connect(RigSpec),
    /// Wait until the scene is on the board.
    Scene,
    /// Wait until the motors are off, then reset the parts.
    PutBack,
    /// Wait until they are reset, then arm.
    Arm,
    /// Wait until armed, then grab.
    Grab,
    /// Wait until the peg is held, then move the hand.
    Play,
}

/// A demonstration under way.
#[derive(Clone, Debug)]
pub struct Tour {
    pub(super) step: Step,
    since: Instant,
    pub(super) asked: bool,
}

impl Tour {
    /// A demonstration from the beginning: a file is being opened, no rig is connected.
    pub fn from_the_start(rig: RigSpec) -> Self {
        Self::at(Step::Connect(rig))
    }

    /// A demonstration on a connected rig.
    pub fn from_the_rig() -> Self {
        Self::at(Step::Scene)
    }

    pub(super) fn at(step: Step) -> Self {
        Self {
            step,
            since: Instant::now(),
            asked: false,
        }
    }

    /// The same step, with its request sent.
    pub(super) fn with_request_sent(&self) -> Self {
        Self {
            asked: true,
            ..self.clone()
        }
    }

    /// Whether the board has not completed the step within [`PATIENCE`].
    pub(super) fn is_stuck(&self) -> bool {
        !matches!(self.step, Step::Connect(_) | Step::Scene) && self.since.elapsed() > PATIENCE
    }
}
