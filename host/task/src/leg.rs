//! The motions of a search: legs, what opens along them, and what was missed.

use glam::{DAffine3, DVec3};

use crate::line::{Line, same_line};
use crate::motion::Motion;

/// A motion of unit travel, in either sense.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Kind {
    Slide(DVec3),
    /// Turn; the arm of the group's farthest point, mm.
    Turn(Line, f64),
}

impl Kind {
    /// The motion over a travel, mm.
    pub(crate) fn over(&self, travel: f64) -> Motion {
        match *self {
            Self::Slide(d) => Motion::slide(d * travel),
            Self::Turn(line, arm) => Motion::turn(line.point, line.direction, travel / arm),
        }
    }
}

impl Kind {
    pub(crate) fn shifted(self, by: DVec3) -> Self {
        match self {
            Self::Slide(d) => Self::Slide(d),
            Self::Turn(line, arm) => Self::Turn(
                Line {
                    point: line.point + by,
                    ..line
                },
                arm,
            ),
        }
    }
}

/// A place along a leg at which another motion opens.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Opening {
    /// Travel of the leg, mm.
    pub at: f64,
    /// A small slide after it.
    pub shift: Option<DVec3>,
    /// How far the motion goes beyond its range before, mm.
    pub gain: f64,
}

impl Opening {
    pub(crate) fn shift(&self) -> DAffine3 {
        DAffine3::from_translation(self.shift.unwrap_or(DVec3::ZERO))
    }
}

/// An opening that was missed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Missed {
    /// Where the leg starts.
    pub by: DAffine3,
    pub leg: Kind,
    /// Travel of the leg at which the least was missing, mm.
    pub at: f64,
    pub motion: Kind,
    /// Travel of the motion after which it is over, mm.
    pub most: f64,
    /// What was missing, mm.
    pub excess: f64,
    pub pair: [usize; 2],
}

/// A motion of the group after a leg: axes of turns are carried along, directions of slides stay.
pub(crate) fn carry(q: &Kind, leg: &Motion) -> Kind {
    match *q {
        Kind::Slide(d) => Kind::Slide(d),
        Kind::Turn(line, arm) => {
            let by = leg.at(1.0);
            Kind::Turn(
                Line {
                    point: by.transform_point3(line.point),
                    direction: by.transform_vector3(line.direction).normalize(),
                },
                arm,
            )
        }
    }
}

/// Whether two motions are the same one or its reverse.
pub(crate) fn same_axis(p: &Kind, q: &Kind) -> bool {
    match (p, q) {
        (Kind::Slide(a), Kind::Slide(b)) => a.cross(*b).length() < 1e-3,
        (Kind::Turn(a, _), Kind::Turn(b, _)) => same_line(*a, *b),
        _ => false,
    }
}
