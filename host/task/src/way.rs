//! Ways out, and the bounds of a search for one.

use std::time::Duration;

use glam::DAffine3;

use crate::deadline::Deadline;
use crate::motion::Motion;
use crate::proof::Proof;

/// A collision-free way of a group from its place: legs one after another, in the assembly's frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Path {
    /// The legs. Each starts where the one before ends.
    pub legs: Vec<Motion>,
}

impl Path {
    /// Motions of the group from its place: the start (identity), and the end of every leg.
    pub fn poses(&self) -> Vec<DAffine3> {
        let mut poses = vec![DAffine3::IDENTITY];
        for leg in &self.legs {
            poses.push(leg.at(1.0) * poses[poses.len() - 1]);
        }
        poses
    }

    /// The way back, from outside into place: its legs, and where the group is at its start.
    pub fn reversed(&self) -> (DAffine3, Self) {
        let start = self.poses().pop().unwrap_or(DAffine3::IDENTITY);
        (
            start,
            Self {
                legs: self.legs.iter().rev().map(Motion::reversed).collect(),
            },
        )
    }
}

/// What keeps a group in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blocked {
    /// Part of the group, and the part that holds it.
    pub pair: [usize; 2],
    /// Overlap that the group would need to leave straight, or turn by half a turn, at the most promising place found, mm: by how much it is held. `None` where
    /// no such place was within a millimetre.
    pub overlap_mm: Option<f64>,
    /// Proof that it stays, and then the overlap is the least that it would need.
    pub proof: Option<Proof>,
}

/// Result of a search.
#[derive(Clone, Debug, PartialEq)]
pub enum Removal {
    /// It comes out on this way.
    Out(Path),
    /// It is proved that it stays, or only straight ways were sought and there is none.
    Blocked(Blocked),
    /// Time ran out first.
    TimedOut(Blocked),
}

/// Bounds of a search.
#[derive(Clone, Debug)]
pub struct Budget {
    /// When it ends.
    pub until: Deadline,
    /// Most legs of a way; 1: straight ways only.
    pub legs: usize,
    /// Seed of the random numbers of walks.
    pub seed: u64,
}

impl Budget {
    /// Ends after this long; up to twelve legs.
    pub fn lasting(time: Duration) -> Self {
        Self {
            until: time.into(),
            legs: 12,
            seed: 0,
        }
    }

    pub(crate) fn is_over(&self) -> bool {
        self.until.is_over()
    }
}
