//! Conversion of poses between the wire (metres, quaternions, f32) and the window (millimetres, affine, f64).

use glam::{DAffine3, DQuat, DVec3};
use mortise_protocol::message::WirePose;

/// Millimetres in a metre.
pub const MM_PER_M: f64 = 1e3;

/// Frame to world, mm. A quaternion that cannot be normalised is taken as no rotation.
pub fn from_wire(pose: &WirePose) -> DAffine3 {
    let [x, y, z, w] = pose.orientation.map(f64::from);
    let q = DQuat::from_xyzw(x, y, z, w);
    let q = if q.length_squared() > 1e-12 && q.is_finite() {
        q.normalize()
    } else {
        DQuat::IDENTITY
    };
    DAffine3::from_rotation_translation(q, MM_PER_M * DVec3::from(pose.position.map(f64::from)))
}

/// Converts to the wire. The linear part must be a rotation.
pub fn to_wire(pose: &DAffine3) -> WirePose {
    let q = DQuat::from_mat3(&pose.matrix3).normalize();
    WirePose {
        position: (pose.translation / MM_PER_M).as_vec3().to_array(),
        orientation: [q.x as f32, q.y as f32, q.z as f32, q.w as f32],
    }
}

/// Converts a vector of the wire (m) to mm.
pub fn point_from_wire(point: [f32; 3]) -> DVec3 {
    MM_PER_M * DVec3::from(point.map(f64::from))
}

/// `pose` rotated about `pivot`, then translated by `shift`, both in the world.
pub fn moved(pose: &DAffine3, pivot: DVec3, turn: DQuat, shift: DVec3) -> DAffine3 {
    let about = DAffine3::from_translation(pivot + shift)
        * DAffine3::from_quat(turn)
        * DAffine3::from_translation(-pivot);
    about * *pose
}

/// The pose without the rounding of its rotation, which must not add up over many turns.
pub fn rigid(pose: &DAffine3) -> DAffine3 {
    let turn = DQuat::from_mat3(&pose.matrix3).normalize();
    DAffine3::from_rotation_translation(turn, pose.translation)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_and_back_is_the_same_within_f32() {
        let q = DQuat::from_xyzw(0.1, -0.2, 0.3, 0.9).normalize();
        let pose = DAffine3::from_rotation_translation(q, DVec3::new(12.5, -400.0, 0.003));
        let back = from_wire(&to_wire(&pose));
        // Resolution of f32 with 24 bits: 400·2⁻²⁴ = 2.4e-5 mm at 400 mm, 6e-8 for a rotation.
        assert!((back.translation - pose.translation).length() < 5e-5);
        for i in 0..3 {
            assert!((back.matrix3.col(i) - pose.matrix3.col(i)).length() < 5e-7);
        }
    }

    #[test]
    fn a_broken_quaternion_does_no_harm() {
        for orientation in [[0.0; 4], [f32::NAN; 4], [f32::INFINITY; 4]] {
            let pose = from_wire(&WirePose {
                position: [0.0; 3],
                orientation,
            });
            assert_eq!(pose, DAffine3::IDENTITY);
        }
    }

    #[test]
    fn a_pivot_stays_where_it_is() {
        let pivot = DVec3::new(1.0, 2.0, 3.0);
        let turned = moved(
            &DAffine3::from_translation(pivot),
            pivot,
            DQuat::from_rotation_x(0.3),
            DVec3::ZERO,
        );
        assert!((turned.translation - pivot).length() < 1e-12);
    }
}
