//! Inputs and outputs of a tick.

use glam::Vec3;
use heapless::Vec;
use mortise_protocol::limits::MAX_PAIRS;

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

/// Set of conditions a tick reports.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
pub struct Flags(u16);

impl Flags {
    /// The work reached [`crate::ContactSettings::point_budget`]: points are decimated evenly, and when that does not suffice the rest waits for the
    /// next ticks; contacts found before stay in force.
    pub const BUDGET_EXCEEDED: Self = Self(1 << 0);
    /// More candidates than the store holds: the deepest were kept, and of the rest those that a rotation would bring to touch first. Where more
    /// touch than fit, points are decimated from the next tick on ([`Self::BUDGET_EXCEEDED`]).
    pub const CONTACTS_DROPPED: Self = Self(1 << 1);
    /// The set of touching points had not converged after the last solve allowed.
    pub const UNSETTLED: Self = Self(1 << 2);
    /// Penetration too deep: the field gives no direction at a point, which does not push.
    pub const DEEP: Self = Self(1 << 3);
    /// The object was held to its speed limit.
    pub const SPEED_LIMITED: Self = Self(1 << 4);
    /// The coupling slipped at its force limit.
    pub const SATURATED_FORCE: Self = Self(1 << 5);
    /// The coupling slipped at its torque limit.
    pub const SATURATED_TORQUE: Self = Self(1 << 6);
    /// The handle's force was reduced to its limit.
    pub const FORCE_LIMITED: Self = Self(1 << 7);
    /// The rate of change of the handle's force was reduced to its limit.
    pub const FORCE_SLEW_LIMITED: Self = Self(1 << 8);
    /// The input was not finite, out of range, or not a rotation: zero wrench, no motion.
    pub const BAD_INPUT: Self = Self(1 << 9);
    /// The step gave a non-finite result: zero wrench, object stopped where it was.
    pub const NON_FINITE: Self = Self(1 << 10);
    /// Damped for stability: the coupling had generated energy, and the handle's wrench is scaled down.
    pub const SOFTENED: Self = Self(1 << 11);
    /// The handle's torque was reduced to its limit.
    pub const TORQUE_LIMITED: Self = Self(1 << 12);
    /// The rate of change of the handle's torque was reduced to its limit.
    pub const TORQUE_SLEW_LIMITED: Self = Self(1 << 13);

    /// Every flag with its name, in order of bits.
    pub const NAMES: [(Self, &'static str); 14] = [
        (Self::BUDGET_EXCEEDED, "budget exceeded"),
        (Self::CONTACTS_DROPPED, "contacts dropped"),
        (Self::UNSETTLED, "unsettled"),
        (Self::DEEP, "deep"),
        (Self::SPEED_LIMITED, "speed limited"),
        (Self::SATURATED_FORCE, "saturated force"),
        (Self::SATURATED_TORQUE, "saturated torque"),
        (Self::FORCE_LIMITED, "force limited"),
        (Self::FORCE_SLEW_LIMITED, "force slew limited"),
        (Self::BAD_INPUT, "bad input"),
        (Self::NON_FINITE, "non-finite"),
        (Self::SOFTENED, "softened"),
        (Self::TORQUE_LIMITED, "torque limited"),
        (Self::TORQUE_SLEW_LIMITED, "torque slew limited"),
    ];

    /// No flag.
    pub const fn empty() -> Self {
        Self(0)
    }

    /// Bits as sent in telemetry.
    pub const fn bits(self) -> u16 {
        self.0
    }

    /// Flags from telemetry; unknown bits are kept.
    pub const fn from_bits(bits: u16) -> Self {
        Self(bits)
    }

    /// Whether all of `other` are set.
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// Whether any of `other` is set.
    pub const fn intersects(self, other: Self) -> bool {
        self.0 & other.0 != 0
    }

    /// Sets all of `other`.
    pub fn insert(&mut self, other: Self) {
        self.0 |= other.0;
    }

    /// Sets all of `other` when `condition` holds.
    pub fn insert_if(&mut self, condition: bool, other: Self) {
        if condition {
            self.insert(other);
        }
    }
}

impl core::fmt::Debug for Flags {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let mut set = f.debug_set();
        for (flag, name) in Self::NAMES {
            if self.contains(flag) {
                set.entry(&format_args!("{name}"));
            }
        }
        set.finish()
    }
}
