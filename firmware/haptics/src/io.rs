//! Inputs and outputs of a tick.

use glam::Vec3;
use heapless::Vec;
use mortise_protocol::limits::MAX_PAIRS;
pub use mortise_protocol::message::Flags;

use crate::math::pose::{Pose, Twist, Wrench};

/// Measured state of the mechanism.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Input {
    /// Handle in the world (H).
    pub handle: Pose,
    /// Its twist at its origin, world axes.
    pub handle_twist: Twist,
    /// Whether motors may push. With `false` the object is simulated all the same and [`Output::handle`] is exactly zero.
    pub enabled: bool,
}

/// Result of a tick.
#[derive(Clone, Debug, PartialEq)]
pub struct Output {
    /// Wrench on the handle, at its origin, world axes, after every limit.
    pub handle: Wrench,
    /// Wrench of all contacts on the object, at its centre of mass, world axes.
    pub contact: Wrench,
    /// The grabbed part's placement (shape frame in the world) at the tick's end; the last one held while nothing is grabbed.
    pub object: Pose,
    /// Its twist at its centre of mass, world axes.
    pub object_twist: Twist,
    /// Touching face pairs, deepest first.
    pub pairs: FacePairs,
    /// State of the constraint targets.
    pub guidance: GuidanceState,
    /// Work of the tick.
    pub work: Work,
}

/// State of the constraint targets, for telemetry.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GuidanceState {
    /// Targets in force (fading ones not counted).
    pub active: u8,
    /// Number of those that are contact exclusions at present.
    pub exclusions: u8,
    /// Largest engagement of any target, 0 to 1.
    pub engagement: f32,
    /// Sum of the targets' wrenches on the object at its centre of mass, world axes.
    pub wrench: Wrench,
}

/// Bounded list of touching face pairs, deepest first.
pub type FacePairs = Vec<FacePair, MAX_PAIRS>;

/// A touching face pair.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FacePair {
    /// Face of the grabbed part, index within its shape; [`mortise_protocol::image::NO_FACE`] when unknown.
    pub moving_face: u16,
    /// Index of the other part.
    pub static_part: u16,
    /// Face of the other part, index within its shape; [`mortise_protocol::image::NO_FACE`] when unknown.
    pub static_face: u16,
    /// The grabbed part's second face where the deepest point lies on an edge of it, else [`mortise_protocol::image::NO_FACE`].
    pub moving_edge_face: u16,
    /// The other part's second face, likewise: where the point is within 10 µm of an edge.
    pub static_edge_face: u16,
    /// Number of touching points.
    pub count: u16,
    /// Largest depth at the tick's end, m, positive when penetrating.
    pub depth_m: f32,
    /// Position of the deepest point, world, m.
    pub point: Vec3,
    /// Extent of the touching points along the axis of the static face, or else the moving one, m; 0 where neither is a cylinder or a cone. The
    /// insertion depth of Faas 2010.
    pub insertion_m: f32,
}

/// Work of a tick: for telemetry and for budgets in tests.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Tree nodes queried.
    pub nodes: u32,
    /// Points queried.
    pub points: u32,
    /// Points near enough to enter the step.
    pub candidates: u16,
    /// Points that push.
    pub contacts: u16,
    /// Solves of the step's 6×6 system.
    pub solves: u8,
    /// Exceptional conditions.
    pub flags: Flags,
}
