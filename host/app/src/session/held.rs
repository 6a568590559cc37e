//! The part in hand, and the scaled handle, which moves as far as the part. Pure.

use glam::DAffine3;
use mortise_protocol::message::WirePose;

use super::pose;

/// The part in hand.
#[derive(Clone, Copy, Debug)]
pub struct Held {
    /// Its index.
    pub part: usize,
    /// Its pose in the frame of the scaled handle when it was grabbed.
    offset: DAffine3,
    /// How many times as far as the handle it moves.
    scale: f64,
}

impl Held {
    /// Grabbed with this scale, the handle and the part where they are.
    pub fn new(part: usize, scale: f64, handle: &WirePose, object: &DAffine3) -> Self {
        Self {
            part,
            offset: scaled(handle, scale).inverse() * *object,
            scale,
        }
    }

    /// How many times as far as the handle it moves.
    pub fn scale(&self) -> f64 {
        self.scale
    }

    /// The pose that the handle commands.
    pub fn commanded(&self, handle: &WirePose) -> DAffine3 {
        scaled(handle, self.scale) * self.offset
    }
}

/// Pose of a handle that moves so many times as far, mm.
pub fn scaled(handle: &WirePose, scale: f64) -> DAffine3 {
    let mut handle = pose::from_wire(handle);
    handle.translation *= scale;
    handle
}
