//! Alignment error of a constraint target, linearised for the step.
//!
//! A feature is a point and a direction: an axis, a plane, an apex, a centre. Some components of the offset between the two points must vanish, and
//! for some kinds the directions must be parallel (in either sense: a peg may enter from both sides):
//!
//! | kind | components of the offset | directions |
//! |---|---|---|
//! | concentric | across the fixed axis | parallel |
//! | coplanar | none | parallel |
//! | conical | all | parallel |
//! | spherical | all | free |
//! | annular | across the fixed axis | free |
//! | annular, bore moving | across the moving axis | free |
//! | path | across the fixed axis; beyond its end also along it | parallel in the same sense, and the turn about them, if it is not free |
//!
//! For planes only the angle is guided: contact keeps the distance and attracts no part, and an attracting plane could hold a part up in the air.
//!
//! Each component is a row J of the step's scaled twist (v, ω·L) and an error e: e' = e + h·J·V'. The offset is taken between the moving point and
//! the fixed feature, the angle as the sine of that between the directions. A path with a given turn has the whole rotation E from the goal's orientation
//! to the part's as its angle, sin θ about its axis; on a screw the goal's orientation turns by c·s over the travel s, which adds −c·∂s to the row about the axis. That
//! row is divided by √(1 + (c·L)²): the torque's cap then bounds the force that the screw makes of it, too.

use glam::{Quat, Vec3};
use heapless::Vec;
use mortise_protocol::message::{ConstraintKind, ConstraintTarget, PathTurn};

use crate::math::pose::Pose;
use crate::math::rotation::exp;
use crate::math::symmetric6::dot;

/// A Jacobian row, and the error (m; for directions rad·L).
pub(crate) type Row = ([f32; 6], f32);

/// Components of the alignment error that must vanish.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rows {
    pub rows: Vec<Row, 3>,
    /// Component that counts only while it is positive: the travel beyond a path's end.
    pub end: Option<Row>,
}

/// Alignment error of a target at one placement.
#[derive(Clone, Debug)]
pub(crate) struct Alignment {
    /// Offset between the points.
    pub offset: Rows,
    /// Angle between the directions.
    pub angle: Rows,
}

impl Alignment {
    /// Error of `target` with the object at `object`, its centre of mass at `center`, and the other part at `fixed`; `length` is L.
    pub fn of(target: &ConstraintTarget, object: &Pose, center: Vec3, fixed: &Pose, length: f32) -> Self {
        let point = object.transform_point(Vec3::from_array(target.moving.point));
        let direction = object.transform_vector(Vec3::from_array(target.moving.direction));
        let axis = fixed.transform_vector(Vec3::from_array(target.fixed.direction));
        let from = point - fixed.transform_point(Vec3::from_array(target.fixed.point));
        let arm = point - center;
        let (u, v) = across(axis);
        let mut offset = Rows::default();
        // Directions fixed to the moving part rotate with it.
        let turning = across(Vec3::from_array(target.moving.direction));
        let turning = [turning.0, turning.1].map(|n| object.transform_vector(n));
        let (directions, arm): (&[Vec3], Vec3) = match target.kind {
            ConstraintKind::Concentric | ConstraintKind::Annular | ConstraintKind::Path => (&[u, v], arm),
            // d(n·from) = n·v + (n·(ω × arm) + (ω × n)·from): the lever ends at the fixed point.
            ConstraintKind::AnnularBore => (&turning, arm - from),
            ConstraintKind::Coplanar => (&[], arm),
            ConstraintKind::Conical | ConstraintKind::Spherical => (&[u, v, axis], arm),
        };
        for n in directions {
            offset.add(slide(*n, arm, length), n.dot(from));
        }
        let mut angle = Rows::default();
        let mut one_sense = false;
        if let Some(path) = &target.path {
            if path.ends {
                offset.end = Some((slide(axis, arm, length), axis.dot(from)));
            }
            match path.turn {
                PathTurn::Free => one_sense = true,
                PathTurn::Geared(rate) => {
                    let travel = axis.dot(from);
                    let goal =
                        turned(axis, rate * travel) * fixed.orientation * Quat::from_array(path.orientation);
                    let error = rotation_between(goal, object.orientation) * length;
                    angle.add_geared([u, v, axis], rate, slide(axis, arm, length), error, length);
                }
            }
        }
        let by_directions = match target.kind {
            ConstraintKind::Concentric | ConstraintKind::Coplanar | ConstraintKind::Conical => true,
            ConstraintKind::Path => one_sense,
            ConstraintKind::Spherical | ConstraintKind::Annular | ConstraintKind::AnnularBore => false,
        };
        if by_directions {
            let opposed = !one_sense && direction.dot(axis) < 0.0;
            let aligned = if opposed { -axis } else { axis };
            let turn = direction.cross(aligned);
            for n in [u, v] {
                // A turn by ω closes the angle: its rate is −n·ω.
                angle.add([0.0, 0.0, 0.0, n.x, n.y, n.z], -n.dot(turn) * length);
            }
        }
        Self { offset, angle }
    }
}

impl Rows {
    fn add(&mut self, row: [f32; 6], error: f32) {
        // Three at most, the capacity.
        let _ = self.rows.push((row, error));
    }

    /// Adds the whole rotation by which a part is off (`error`, rad·L) about the last of three `axes`, the way's, and two across it: about the way it is to
    /// turn by `rate` (rad/m) over the travel, whose row is `travels`; `length` is L.
    fn add_geared(&mut self, axes: [Vec3; 3], rate: f32, travels: [f32; 6], error: Vec3, length: f32) {
        let [u, v, axis] = axes;
        for n in [u, v] {
            self.add([0.0, 0.0, 0.0, n.x, n.y, n.z], n.dot(error));
        }
        let share = 1.0 / libm::sqrtf(1.0 + (rate * length) * (rate * length));
        let [x, y, z, a, b, c] = travels.map(|x| -rate * length * x);
        let row = [x, y, z, a + axis.x, b + axis.y, c + axis.z];
        self.add(row.map(|x| share * x), share * axis.dot(error));
    }

    /// Length of the error after the twist `x` has acted for `ahead` s.
    pub fn error(&self, x: &[f32; 6], ahead: f32) -> f32 {
        libm::sqrtf(self.error2(x, ahead))
    }

    /// Its square.
    pub fn error2(&self, x: &[f32; 6], ahead: f32) -> f32 {
        let two_sided = (self.rows.iter())
            .map(|(row, error)| error + ahead * dot(row, x))
            .fold(0.0, |sum, e| sum + e * e);
        let beyond = self.beyond_end(x, ahead);
        two_sided + beyond * beyond
    }

    /// Travel beyond the end after the twist `x` has acted for `ahead` s, m; 0 before it.
    pub fn beyond_end(&self, x: &[f32; 6], ahead: f32) -> f32 {
        let Some((row, error)) = &self.end else {
            return 0.0;
        };
        let beyond = error + ahead * dot(row, x);
        if beyond > 0.0 { beyond } else { 0.0 }
    }

    /// Length of the error's rate under the twist `x`.
    pub fn speed(&self, x: &[f32; 6]) -> f32 {
        let squared = (self.rows.iter())
            .map(|(row, _)| dot(row, x))
            .fold(0.0, |sum, v| sum + v * v);
        libm::sqrtf(squared)
    }
}

/// Row of the travel along `n` of a point at `arm` from the centre of mass; `length` is L.
fn slide(n: Vec3, arm: Vec3, length: f32) -> [f32; 6] {
    let turn = arm.cross(n) * (1.0 / length);
    [n.x, n.y, n.z, turn.x, turn.y, turn.z]
}

/// Rotation by `angle` rad about a unit vector.
fn turned(axis: Vec3, angle: f32) -> Quat {
    use core::f32::consts::TAU;
    exp(axis * (angle - TAU * libm::rintf(angle / TAU)))
}

/// Rotation by θ from one orientation to another, as sin θ about its axis in the world's frame: without a step where θ passes half a turn.
fn rotation_between(from: Quat, to: Quat) -> Vec3 {
    let by = to * from.conjugate();
    Vec3::new(by.x, by.y, by.z) * (2.0 * by.w)
}

/// Two unit vectors across a unit vector and each other.
fn across(axis: Vec3) -> (Vec3, Vec3) {
    // From the axis' smallest component, so that the product is never short.
    let a = axis.abs();
    let other = if a.x <= a.y && a.x <= a.z {
        Vec3::X
    } else if a.y <= a.z {
        Vec3::Y
    } else {
        Vec3::Z
    };
    let u = axis.cross(other);
    let u = u * (1.0 / libm::sqrtf(u.length_squared()));
    (u, axis.cross(u))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Quat;
    use mortise_protocol::message::{Feature, Path};

    fn target(kind: ConstraintKind) -> ConstraintTarget {
        ConstraintTarget {
            id: 1,
            sequence: 0,
            kind,
            moving: Feature {
                point: [0.01, -0.002, 0.005],
                direction: [0.0, 0.6, 0.8],
            },
            static_part: 0,
            fixed: Feature {
                point: [-0.003, 0.004, 0.02],
                direction: [0.8, 0.0, -0.6],
            },
            stiffness: 1e6,
            force_cap: 3.0,
            torque_cap: 0.1,
            expiry_ticks: 100,
            path: None,
            faces: Vec::new(),
        }
    }

    /// The path of which the object is nearly met at `object`, after the turn over its travel.
    fn nearly_met(target: &ConstraintTarget, turn: PathTurn, object: &Pose, fixed: &Pose) -> Path {
        let axis = fixed.transform_vector(Vec3::from_array(target.fixed.direction));
        let on_axis = object.transform_point(Vec3::from_array(target.moving.point));
        let travel = axis.dot(on_axis - fixed.transform_point(Vec3::from_array(target.fixed.point)));
        let turned = match turn {
            PathTurn::Free => Quat::IDENTITY,
            PathTurn::Geared(rate) => Quat::from_axis_angle(axis.normalize(), -rate * travel),
        };
        let goal = Quat::from_rotation_x(2e-3) * turned * object.orientation;
        Path {
            orientation: (fixed.orientation.conjugate() * goal).normalize().to_array(),
            turn,
            ends: true,
        }
    }

    /// The rows are the errors' derivatives: a small motion along each unknown changes the errors as the rows predict.
    #[test]
    fn rows_are_derivatives() {
        let length = 0.02;
        let fixed = Pose::new(
            Vec3::new(0.1, 0.2, -0.1),
            Quat::from_xyzw(0.1, 0.2, 0.3, 0.9).normalize(),
        );
        // Nearly aligned: the angle's row is exact there, and elsewhere shorter by the cosine.
        let axis = fixed.transform_vector(Vec3::new(0.8, 0.0, -0.6));
        let orientation = Quat::from_rotation_arc(
            Vec3::new(0.0, 0.6, 0.8),
            (axis + Vec3::new(0.0, 1e-3, 0.0)).normalize(),
        );
        let center = Vec3::new(0.11, 0.19, -0.09);
        let body = Vec3::new(0.002, 0.001, 0.003);
        let pose = |center: Vec3, q: Quat| Pose::new(center - q * body, q);
        // Of a path: where the part would be oriented as it nearly is, after the turn over its travel.
        let turns = [PathTurn::Free, PathTurn::Geared(0.0), PathTurn::Geared(-300.0)];
        let paths = turns.map(|turn| (ConstraintKind::Path, Some(turn)));
        let others = ConstraintKind::ALL.map(|kind| (kind, None));
        let others = others
            .into_iter()
            .filter(|(kind, _)| *kind != ConstraintKind::Path);
        for (kind, turn) in others.chain(paths) {
            let mut t = target(kind);
            t.path = turn.map(|turn| nearly_met(&t, turn, &pose(center, orientation), &fixed));
            assert_eq!(t.path.is_some(), kind == ConstraintKind::Path);
            let here = Alignment::of(&t, &pose(center, orientation), center, &fixed, length);
            for unknown in 0..6 {
                let step = 1e-4;
                let mut x = [0.0; 6];
                x[unknown] = step;
                let moved = center + Vec3::new(x[0], x[1], x[2]);
                let turned =
                    Quat::from_scaled_axis(Vec3::new(x[3], x[4], x[5]) * (1.0 / length)) * orientation;
                let there = Alignment::of(&t, &pose(moved, turned), moved, &fixed, length);
                for (a, b) in [(&here.offset, &there.offset), (&here.angle, &there.angle)] {
                    let pairs = a.rows.iter().zip(&b.rows).chain(a.end.iter().zip(&b.end));
                    for ((row, before), (_, after)) in pairs {
                        let found = (after - before) / step;
                        assert!(
                            (found - row[unknown]).abs() < 0.01,
                            "{kind:?} {unknown}: {found} {}",
                            row[unknown]
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn met_by_either_sense() {
        let mut t = target(ConstraintKind::Concentric);
        t.fixed.direction = t.moving.direction.map(|x| -x);
        t.fixed.point = t.moving.point;
        let here = Alignment::of(&t, &Pose::IDENTITY, Vec3::ZERO, &Pose::IDENTITY, 0.02);
        assert!(here.offset.error(&[0.0; 6], 1e-3) < 1e-9 && here.angle.error(&[0.0; 6], 1e-3) < 1e-9);
    }
}
