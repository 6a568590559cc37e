//! Joint solution of all targets: whether they can be satisfied together, and the motion that they leave.
//!
//! Each target gives rows of a 6-column Jacobian: a displacement along e at point p of the moving part is e·v + ((p − c) ×
//! e)·ω, a rotation about e is e·ω, about the reference point c; ω is scaled by the part's size L, so that both are
//! lengths. Gauss–Newton with the pseudo-inverse (singular value decomposition) moves the part to the least-squares pose.
//! Where an alignment error beyond the play remains, the targets contradict each other. The null space at that pose is the
//! remaining freedom, split into pure slides and rotations.
//!
//! Cost: a few decompositions of a 6-column matrix with at most five rows per target.

use std::fmt;

use glam::{DAffine3, DQuat, DVec3};
use mortise_protocol::message::ConstraintKind;
use nalgebra::{DMatrix, DVector};

use super::target::{AlignmentError, Target, Turn, placed, rotation};
use crate::contact::Axis;

/// Singular values below this fraction of the largest count as zero: 1 mm over a part of 1 m.
const RANK: f64 = 1e-3;
/// Largest number of iterations. Gauss–Newton converges quadratically; targets still far apart after these contradict each
/// other.
const STEPS: usize = 12;

/// Result of solving targets together.
#[derive(Clone, Debug)]
pub struct Solution {
    /// Pose of the moving part with the smallest error over all targets.
    pub pose: DAffine3,
    /// Residual alignment error of each target at that pose.
    pub alignment_errors: Vec<AlignmentError>,
    /// Number of independent conditions, 0 to 6.
    pub rank: usize,
    /// Remaining motion.
    pub freedom: Freedom,
}

/// Motion that the targets leave, in the assembly's frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Freedom {
    /// Directions of free slides, orthonormal.
    pub slides: Vec<DVec3>,
    /// Axes of free rotations.
    pub turns: Vec<Axis>,
}

impl Freedom {
    /// Degrees of freedom.
    pub fn count(&self) -> usize {
        self.slides.len() + self.turns.len()
    }

    /// Name of the lower pair with this freedom, or a count.
    pub fn name(&self) -> &'static str {
        match (self.slides.len(), self.turns.len()) {
            (0, 0) => "fixed",
            (0, 1) => "revolute",
            (1, 0) => "prismatic",
            (1, 1) => "cylindrical",
            (2, 1) => "planar",
            (0, 3) => "spherical",
            (1, 3) => "ball in cylinder",
            (3, 3) => "free",
            _ => "partly free",
        }
    }
}

impl fmt::Display for Freedom {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let plural = |n: usize, what: &str| format!("{n} {what}{}", if n == 1 { "" } else { "s" });
        let (slides, turns) = (self.slides.len(), self.turns.len());
        write!(
            f,
            "{}: {}, {}",
            self.name(),
            plural(slides, "slide"),
            plural(turns, "turn")
        )
    }
}

/// A target with the placement of its fixed part.
pub(crate) type Placed<'a> = (&'a Target, DAffine3);

/// Moves the part from `pose` until it satisfies all `targets`. `size` is the part's, mm.
pub(crate) fn solve(targets: &[Placed<'_>], pose: &DAffine3, size: f64) -> Solution {
    let mut pose = *pose;
    for _ in 0..STEPS {
        let center = reference(targets, &pose);
        let (jacobian, alignment_error) = rows(targets, &pose, center, size);
        if jacobian.nrows() == 0 {
            break;
        }
        let svd = jacobian.svd(true, true);
        let floor = RANK * svd.singular_values.max();
        let Ok(step) = svd.solve(&alignment_error, floor) else {
            break;
        };
        let by = DVec3::new(step[0], step[1], step[2]);
        let turn = DQuat::from_scaled_axis(DVec3::new(step[3], step[4], step[5]) / size);
        let about = DAffine3::from_translation(center + by)
            * DAffine3::from_quat(turn)
            * DAffine3::from_translation(-center);
        pose = about * pose;
        if step.norm() < 1e-12 * size {
            break;
        }
    }
    let center = reference(targets, &pose);
    let (jacobian, _) = rows(targets, &pose, center, size);
    let (rank, freedom) = freedom(jacobian, center, size);
    Solution {
        pose,
        alignment_errors: targets
            .iter()
            .map(|(t, fixed)| t.alignment_error(&pose, fixed))
            .collect(),
        rank,
        freedom,
    }
}

/// Mean position of the targets on the moving part.
fn reference(targets: &[Placed<'_>], pose: &DAffine3) -> DVec3 {
    let sum: DVec3 = targets.iter().map(|(t, _)| placed(&t.moving, pose).origin).sum();
    sum / targets.len().max(1) as f64
}

/// The Jacobian, and the motion required by each row, mm.
fn rows(targets: &[Placed<'_>], pose: &DAffine3, center: DVec3, size: f64) -> (DMatrix<f64>, DVector<f64>) {
    let (mut rows, mut asked): (Vec<[f64; 6]>, Vec<f64>) = (Vec::new(), Vec::new());
    for (target, fixed) in targets {
        let (a, b) = (placed(&target.moving, pose), placed(&target.fixed, fixed));
        let mut slide = |e: DVec3| {
            let turn = (a.origin - center).cross(e) / size;
            rows.push([e.x, e.y, e.z, turn.x, turn.y, turn.z]);
            asked.push((b.origin - a.origin).dot(e));
        };
        let across = |z: DVec3| {
            let x = z.any_orthonormal_vector();
            [x, z.cross(x)]
        };
        let travel = (a.origin - b.origin).dot(b.direction);
        // Of a way with a given turn: the rotation that is asked for, and its rate with the travel, rad/mm.
        let mut whole: Option<(DVec3, f64)> = None;
        let turned = match target.kind {
            ConstraintKind::Concentric => {
                across(b.direction).into_iter().for_each(&mut slide);
                Some(b.direction * a.direction.dot(b.direction).signum())
            }
            ConstraintKind::Path => {
                across(b.direction).into_iter().for_each(&mut slide);
                match &target.way {
                    Some(way) if way.turn != Turn::Free => {
                        let goal = way.goal(rotation(fixed), b.direction, travel);
                        let by = (goal * rotation(pose).inverse()).normalize();
                        let by = if by.w < 0.0 { -by } else { by };
                        let rate = match way.turn {
                            Turn::Free => 0.0,
                            Turn::Geared(rate) => rate,
                        };
                        whole = Some((by.to_scaled_axis(), rate));
                        None
                    }
                    _ => Some(b.direction),
                }
            }
            ConstraintKind::Coplanar => {
                slide(b.direction);
                Some(-b.direction)
            }
            ConstraintKind::Conical => {
                DVec3::AXES.into_iter().for_each(&mut slide);
                Some(b.direction)
            }
            ConstraintKind::Spherical => {
                DVec3::AXES.into_iter().for_each(&mut slide);
                None
            }
            ConstraintKind::Annular | ConstraintKind::AnnularBore => {
                across(target.bore(&a, &b)).into_iter().for_each(&mut slide);
                None
            }
        };
        if let Some(goal) = turned {
            let sine = a.direction.cross(goal);
            // atan2 of the full angle, so that a quarter turn is not mistaken for a small one.
            let angle = sine.length().atan2(a.direction.dot(goal));
            let by = sine.normalize_or_zero() * angle;
            for e in across(goal) {
                rows.push([0.0, 0.0, 0.0, e.x, e.y, e.z]);
                asked.push(by.dot(e) * size);
            }
        }
        if let Some((by, rate)) = whole {
            let [x, y] = across(b.direction);
            for e in [x, y, b.direction] {
                rows.push([0.0, 0.0, 0.0, e.x, e.y, e.z]);
                asked.push(by.dot(e) * size);
            }
            // On a screw the turn asked for grows with the travel.
            let travels = rate * size * b.direction;
            let turns = rate * (a.origin - center).cross(b.direction);
            if let Some([vx, vy, vz, wx, wy, wz]) = rows.last_mut() {
                (*vx, *vy, *vz) = (-travels.x, -travels.y, -travels.z);
                (*wx, *wy, *wz) = (*wx - turns.x, *wy - turns.y, *wz - turns.z);
            }
        }
    }
    let jacobian = DMatrix::from_fn(rows.len(), 6, |i, j| rows[i][j]);
    (jacobian, DVector::from_vec(asked))
}

/// Rank and null space, as slides and rotations.
fn freedom(jacobian: DMatrix<f64>, center: DVec3, size: f64) -> (usize, Freedom) {
    // At least six rows, so that the decomposition has all six right singular vectors.
    let count = jacobian.nrows().max(6);
    let svd = jacobian.resize(count, 6, 0.0).svd(false, true);
    let Some(v_t) = svd.v_t else {
        return (0, Freedom::default());
    };
    let floor = RANK * svd.singular_values.max();
    let null: Vec<usize> = (0..6).filter(|&i| svd.singular_values[i] <= floor).collect();
    let rank = 6 - null.len();
    if null.is_empty() {
        return (rank, Freedom::default());
    }
    let basis = DMatrix::from_fn(6, null.len(), |i, j| v_t[(null[j], i)]);
    // Combinations without rotation are slides; the others are rotations.
    let turning = basis
        .rows(3, 3)
        .clone_owned()
        .resize(3.max(null.len()), null.len(), 0.0)
        .svd(false, true);
    let Some(w_t) = turning.v_t else {
        return (rank, Freedom::default());
    };
    let motion = |k: usize| {
        let m = &basis * w_t.row(k).transpose();
        (DVec3::new(m[0], m[1], m[2]), DVec3::new(m[3], m[4], m[5]) / size)
    };
    let mut freedom = Freedom::default();
    let turns = |k: &usize| turning.singular_values[*k] > RANK;
    for k in (0..null.len()).filter(|k| !turns(k)) {
        freedom.slides.extend(motion(k).0.try_normalize());
    }
    for k in (0..null.len()).filter(turns) {
        let (v, w) = motion(k);
        // Removes the component along free slides from a rotation.
        let v = freedom.slides.iter().fold(v, |v, s| v - *s * v.dot(*s));
        let Some(direction) = w.try_normalize() else {
            continue;
        };
        freedom.turns.push(Axis {
            origin: center + w.cross(v) / w.length_squared(),
            direction,
        });
    }
    (rank, freedom)
}
