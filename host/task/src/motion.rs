//! A rigid motion with constant twist directions, and bounds on how far it moves points.

use glam::{DAffine3, DMat3, DQuat, DVec3};

/// A motion of parts in the assembly's frame: at share t of it X(t) = translation by t·`slide` after a turn by t·`angle` about the line through `point` along
/// `axis`. Any rigid motion between two poses is one of these. Lengths mm, angles radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Translation at its end.
    pub slide: DVec3,
    /// A point of the axis of its turn.
    pub point: DVec3,
    /// Unit direction of that axis.
    pub axis: DVec3,
    /// Angle at its end.
    pub angle: f64,
}

impl Motion {
    /// A translation.
    pub fn slide(by: DVec3) -> Self {
        Self { slide: by, point: DVec3::ZERO, axis: DVec3::Z, angle: 0.0 }
    }

    /// A turn about the line through `point` along `axis`.
    pub fn turn(point: DVec3, axis: DVec3, angle: f64) -> Self {
        Self { slide: DVec3::ZERO, point, axis: axis.normalize_or(DVec3::Z), angle }
    }

    /// The motion from one pose to another in which `center` (fixed to the moving parts, given at the first pose, in the assembly's frame) moves on a
    /// straight line.
    pub fn between(from: &DAffine3, to: &DAffine3, center: DVec3) -> Self {
        let by = *to * from.inverse();
        let (axis, angle) = DQuat::from_mat3(&by.matrix3).normalize().to_axis_angle();
        let (axis, angle) = if angle > std::f64::consts::PI { (-axis, std::f64::consts::TAU - angle) } else { (axis, angle) };
        Self { slide: by.transform_point3(center) - center, point: center, axis: axis.normalize_or(DVec3::Z), angle }
    }

    /// The pose at share `t`, 0 to 1, relative to its start.
    pub fn at(&self, t: f64) -> DAffine3 {
        let turn = DMat3::from_quat(DQuat::from_axis_angle(self.axis, self.angle * t));
        DAffine3 { matrix3: turn, translation: self.point - turn * self.point + self.slide * t }
    }

    /// The first part of the motion, up to share `t`.
    pub fn until(&self, t: f64) -> Self {
        Self { slide: self.slide * t, angle: self.angle * t, ..*self }
    }

    /// The motion backwards, from its end to its start.
    pub fn reversed(&self) -> Self {
        Self { slide: -self.slide, point: self.point + self.slide, axis: self.axis, angle: -self.angle }
    }

    /// Bound on how far the motion moves a point at distance `arm` of its axis, per unit of t, mm.
    pub fn speed(&self, arm: f64) -> f64 {
        self.slide.length() + self.angle.abs() * arm
    }

    /// Distance of `p` from the axis, mm; 0 when it does not turn.
    pub fn arm(&self, p: DVec3) -> f64 {
        if self.angle == 0.0 { 0.0 } else { (p - self.point).reject_from_normalized(self.axis).length() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn vector(size: f64) -> impl Strategy<Value = DVec3> {
        prop::array::uniform3(-size..size).prop_map(DVec3::from_array)
    }

    fn pose() -> impl Strategy<Value = DAffine3> {
        (vector(30.0), vector(1.0), -3.0..3.0f64).prop_map(|(t, axis, angle)| {
            DAffine3::from_rotation_translation(DQuat::from_axis_angle(axis.normalize_or(DVec3::X), angle), t)
        })
    }

    proptest! {
        /// The motion between two poses ends at the second, and backwards at the first.
        #[test]
        fn between_ends_where_it_should(from in pose(), to in pose(), center in vector(20.0), p in vector(20.0)) {
            let motion = Motion::between(&from, &to, center);
            let end = (motion.at(1.0) * from).transform_point3(p);
            prop_assert!(end.distance(to.transform_point3(p)) < 1e-8);
            let back = (motion.reversed().at(1.0) * to).transform_point3(p);
            prop_assert!(back.distance(from.transform_point3(p)) < 1e-8);
        }

        /// The bound on a point's speed holds between any two shares.
        #[test]
        fn speed_is_a_bound(to in pose(), center in vector(20.0), p in vector(20.0), s in 0.0..1.0f64, t in 0.0..1.0f64) {
            let motion = Motion::between(&DAffine3::IDENTITY, &to, center);
            let moved = motion.at(s).transform_point3(p).distance(motion.at(t).transform_point3(p));
            prop_assert!(moved <= motion.speed(motion.arm(p)) * (s - t).abs() + 1e-9);
        }
    }
}
