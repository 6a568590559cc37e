//! First touch of two parts along a motion: conservative advancement (Mirtich 1996) on proven lower bounds of their distance.
//!
//! The moving part shifts evenly along a straight line and turns evenly about its origin. No point of it moves faster than the shift plus the turn times
//! its distance from the origin, so from a pose with a gap of at least g it is free for the share g over that way. The steps shrink towards the first
//! touch; they end where the gap is at most [`TOUCH_M`]. Cost: one query of the probe's bounds for a step; a part that slides by at a constant gap takes
//! a step for each gap's length.

use glam::{DQuat, DVec3, Vec3};
use mortise_protocol::image::Shape;

use crate::math::pose::Pose;
use crate::probe::clearance::{Clearance, clearance};
use crate::probe::convex::{Separation, separation};
use crate::probe::epa::Epa;
use crate::probe::support::Support;

/// Gap at which the parts touch, m.
pub const TOUCH_M: f64 = 1e-6;
/// A first guess of the gap is enlarged by this, m.
const GUESS_M: f64 = 2e-6;
/// Most steps: 20 mm past a wall at 1 µm.
const STEPS: u32 = 20_000;
/// Most evaluations of a step: a step that proves nothing ends the sweep, so it gets ten times those of a probe.
const BUDGET: u32 = 40_000;
/// Ways past a touch at which an overlap is looked for, m: the first, and the factor from one to the next.
const PAST_M: f64 = 2e-6;
const FARTHER: f64 = 2.0;

/// A motion of the moving part in the frame of the fixed one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Shift of its origin, m.
    pub shift: Vec3,
    /// Turn about its origin, rad: direction and angle.
    pub turn: Vec3,
}

impl Motion {
    /// The pose at a share of the motion from `start`.
    pub fn at(&self, start: &Pose, share: f64) -> Pose {
        let turn = DQuat::from_scaled_axis(self.turn.as_dvec3() * share);
        let from = DQuat::from_array(start.orientation.to_array().map(f64::from));
        Pose::new(
            (start.position.as_dvec3() + self.shift.as_dvec3() * share).as_vec3(),
            (turn * from).normalize().as_quat(),
        )
    }

    /// Upper bound of the way of any point of `shape`, m.
    fn way(&self, shape: &Shape<'_>) -> f64 {
        let reach =
            f64::from(shape.record.radius) + Vec3::from_array(shape.record.center).as_dvec3().length();
        self.shift.as_dvec3().length() + self.turn.as_dvec3().length() * reach
    }
}

/// How a motion ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Course {
    /// The parts touch.
    Touch,
    /// They come within a micrometre, and no overlap is proven after that.
    Near,
    /// They are proven to stay apart all the way.
    Free,
    /// From here on nothing is proven: faces without a formula, or the field is too coarse.
    Unknown,
}

/// Result of a sweep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sweep {
    /// What happens at `share`.
    pub course: Course,
    /// Share of the motion that is proven to be free, 1 for all of it.
    pub share: f64,
    /// The first touch lies no farther beyond `share` than this; infinite where none is proven.
    pub error: f64,
    /// Pose of the moving part there.
    pub pose: Pose,
    /// Smallest distance found between the parts there, m; infinite where none is known.
    pub gap_m: f64,
    /// Point of the moving part there that is nearest, frame of the fixed part, m.
    pub nearest: Vec3,
    /// Steps taken.
    pub steps: u32,
}

/// Proven bounds of a distance.
struct Bounds {
    lower: f64,
    upper: f64,
    /// Proven to overlap.
    overlap: bool,
    nearest: DVec3,
}

impl Bounds {
    fn of_convex(found: &Separation) -> Self {
        Self {
            lower: found.distance - found.error,
            upper: found.distance,
            overlap: found.distance + found.error < 0.0,
            nearest: found.a,
        }
    }

    fn of_any(found: &Clearance, pose: &Pose, held: &Shape<'_>, other: &Shape<'_>) -> Self {
        let proven = found.separation(pose, held, other);
        Self {
            lower: proven.map_or(0.0, |proven| proven.distance - proven.error),
            upper: found.upper,
            overlap: found.overlap,
            nearest: proven.map_or(DVec3::NAN, |proven| proven.a),
        }
    }
}

/// Two shapes, of which the first one moves.
pub(crate) struct Sweeping<'s, 'i> {
    pub held: &'s Shape<'i>,
    pub other: &'s Shape<'i>,
    pub epa: &'s mut Epa,
}

impl Sweeping<'_, '_> {
    /// Bounds at a pose, if the gap is at most `enough` (m) or infinite; `None` for faces without a formula.
    fn bounds(&mut self, pose: &Pose, enough: f64) -> Option<Bounds> {
        let identity = Pose::IDENTITY;
        let supports = [Support::new(self.held, pose), Support::new(self.other, &identity)];
        if let [Some(a), Some(b)] = supports {
            return Some(Bounds::of_convex(&separation(&a, &b, self.epa)));
        }
        let mut found = clearance(self.held, self.other, pose, enough, BUDGET)?;
        if found.upper == enough && !found.overlap {
            found = clearance(self.held, self.other, pose, f64::INFINITY, BUDGET)?;
        }
        Some(Bounds::of_any(&found, pose, self.held, self.other))
    }

    /// First touch along `motion` from `start`, where the parts are apart, by at most about `gap_m`.
    pub fn sweep(&mut self, start: &Pose, motion: &Motion, gap_m: f64) -> Sweep {
        let way = motion.way(self.held);
        let mut sweep = Sweep {
            course: Course::Unknown,
            share: 0.0,
            error: f64::INFINITY,
            pose: *start,
            gap_m: f64::INFINITY,
            nearest: Vec3::NAN,
            steps: 0,
        };
        let mut enough = 1.001 * gap_m + GUESS_M;
        while sweep.steps < STEPS {
            sweep.steps += 1;
            sweep.pose = motion.at(start, sweep.share);
            let Some(found) = self.bounds(&sweep.pose, enough) else {
                return sweep;
            };
            sweep.gap_m = found.upper;
            sweep.nearest = found.nearest.as_vec3();
            if found.overlap {
                // Only at the start: the steps before were free.
                (sweep.course, sweep.error) = (Course::Touch, 0.0);
                return sweep;
            }
            if found.upper <= TOUCH_M {
                self.look_past(start, motion, way, &mut sweep);
                return sweep;
            }
            if found.lower <= 0.0 {
                return sweep;
            }
            if sweep.share >= 1.0 || found.lower >= (1.0 - sweep.share) * way {
                if sweep.share < 1.0 {
                    // The end is free too; the answer is that of the end.
                    enough = found.upper + (1.0 - sweep.share) * way + GUESS_M;
                    sweep.share = 1.0;
                    continue;
                }
                (sweep.course, sweep.error) = (Course::Free, 0.0);
                return sweep;
            }
            sweep.share += found.lower / way;
            enough = found.upper + found.lower + GUESS_M;
        }
        sweep
    }

    /// Looks for a proven overlap beyond a near touch.
    fn look_past(&mut self, start: &Pose, motion: &Motion, way: f64, sweep: &mut Sweep) {
        sweep.course = Course::Near;
        let mut past = PAST_M / way;
        while sweep.share + past <= 1.0 {
            sweep.steps += 1;
            let pose = motion.at(start, sweep.share + past);
            match self.bounds(&pose, f64::INFINITY) {
                Some(found) if found.overlap => {
                    (sweep.course, sweep.error) = (Course::Touch, past);
                    return;
                }
                // Apart again: it only passed by.
                Some(found) if found.lower > TOUCH_M => return,
                _ => past *= FARTHER,
            }
        }
    }
}
