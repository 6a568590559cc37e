//! What goes into a tick and what comes out.

use glam::Vec3;
use heapless::Vec;
use mortise_protocol::limits::MAX_PAIRS;

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

/// Set of conditions a tick reports.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
pub struct Flags(u16);

impl Flags {
    /// The work reached [`crate::ContactSettings::point_budget`]: points are left out evenly, and when that is not enough the rest waits for the next
    /// ticks; what touched stays felt.
    pub const BUDGET_EXCEEDED: Self = Self(1 << 0);
    /// More candidates than fit: kept were the deepest, and of the rest those that a turn would bring to touch first. Where more touch than fit,
    /// points are left out evenly from the next tick on ([`Self::BUDGET_EXCEEDED`]).
    pub const CONTACTS_DROPPED: Self = Self(1 << 1);
    /// The set of touching points had not settled after the last solve allowed.
    pub const UNSETTLED: Self = Self(1 << 2);
    /// A point lies deeper than the field tells a direction: it does not push.
    pub const DEEP: Self = Self(1 << 3);
    /// The object was held to its speed limit.
    pub const SPEED_LIMITED: Self = Self(1 << 4);
    /// The coupling slipped at its largest force.
    pub const SATURATED_FORCE: Self = Self(1 << 5);
    /// The coupling slipped at its largest torque.
    pub const SATURATED_TORQUE: Self = Self(1 << 6);
    /// The handle's force was cut to its limit.
    pub const FORCE_LIMITED: Self = Self(1 << 7);
    /// The change of the handle's force was cut to its limit.
    pub const FORCE_SLEW_LIMITED: Self = Self(1 << 8);
    /// The input was not finite, out of all proportion, or not a rotation: zero wrench, nothing moved.
    pub const BAD_INPUT: Self = Self(1 << 9);
    /// The step came out non-finite: zero wrench, object stopped where it was.
    pub const NON_FINITE: Self = Self(1 << 10);
    /// The coupling had made energy: the handle's wrench is turned down.
    pub const SOFTENED: Self = Self(1 << 11);
    /// The handle's torque was cut to its limit.
    pub const TORQUE_LIMITED: Self = Self(1 << 12);
    /// The change of the handle's torque was cut to its limit.
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

    /// None.
    pub const fn empty() -> Self {
        Self(0)
    }

    /// As sent in telemetry.
    pub const fn bits(self) -> u16 {
        self.0
    }

    /// From telemetry; unknown bits are kept.
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
