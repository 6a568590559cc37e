//! What goes into a tick and what comes out.

use glam::Vec3;
use heapless::Vec;
use mortise_protocol::limits::MAX_PAIRS;
pub use mortise_protocol::message::Flags;

use crate::math::pose::{Pose, Twist, Wrench};

/// What the mechanism measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Input {
    /// Handle in the world (H).
    pub handle: Pose,
    /// Its twist at its origin, world axes.
    pub handle_twist: Twist,
    /// Whether motors may push: with `false` the object is simulated all the same and [`Output::handle`] is exactly zero.
    pub enabled: bool,
}

/// What a tick computed.
#[derive(Clone, Debug, PartialEq)]
pub struct Output {
    /// On the handle, at its origin, world axes, after every limit.
    pub handle: Wrench,
    /// Of all contacts on the object, at its centre of mass, world axes.
    pub contact: Wrench,
    /// The grabbed part's placement (shape frame in the world) at the tick's end; the last one held while nothing is grabbed.
    pub object: Pose,
    /// Its twist at its centre of mass, world axes.
    pub object_twist: Twist,
    /// Touching faces, deepest first.
    pub pairs: FacePairs,
    /// How constraint targets stand.
    pub guidance: GuidanceState,
    /// What the tick had to do.
    pub work: Work,
}

/// How targets stand, for telemetry.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GuidanceState {
    /// Targets in force (fading ones not counted).
    pub active: u8,
    /// Of those, whose mating faces have left the work.
    pub exclusions: u8,
    /// Largest engagement of any.
    pub engagement: f32,
    /// Their sum on the object at its centre of mass, world axes.
    pub wrench: Wrench,
}

/// Bounded list of touching face pairs, deepest first.
pub type FacePairs = Vec<FacePair, MAX_PAIRS>;

/// Faces that touch, and how.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FacePair {
    /// Face of the grabbed part, counted from its shape's first; [`mortise_protocol::image::NO_FACE`] when unknown.
    pub moving_face: u16,
    /// Index of the other part.
    pub static_part: u16,
    /// Face of the other part, counted from its shape's first; [`mortise_protocol::image::NO_FACE`] when unknown.
    pub static_face: u16,
    /// The grabbed part's other face where the deepest point lies on an edge of it, else [`mortise_protocol::image::NO_FACE`].
    pub moving_edge_face: u16,
    /// The other part's, likewise: where it is within 10 µm of an edge.
    pub static_edge_face: u16,
    /// Points that touch.
    pub count: u16,
    /// Largest depth at the tick's end, m, positive when penetrating.
    pub depth_m: f32,
    /// Where that is, world, m.
    pub point: Vec3,
    /// How far the touching points reach along the axis of the static face, or else the moving one, m; 0 where neither is a cylinder or a cone. The
    /// insertion depth of Faas 2010.
    pub insertion_m: f32,
}

/// What a tick had to do: for telemetry and for budgets in tests.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Tree nodes looked at.
    pub nodes: u32,
    /// Points looked up in a field.
    pub points: u32,
    /// Points near enough to enter the step.
    pub candidates: u16,
    /// Points that push.
    pub contacts: u16,
    /// Solves of the step's 6×6 system.
    pub solves: u8,
    /// What was out of the ordinary.
    pub flags: Flags,
}
