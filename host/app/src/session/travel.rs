//! Poses of a part along its way into a fit. Pure.

use std::f64::consts::TAU;

use glam::{DAffine3, DQuat, DVec3};
use mortise_fit::Path;

/// Pose at a travel from the fit, mm, on the way in to a fit at `seat`; beyond both ends it goes on straight, or on its screw.
pub fn pose_at(path: &Path, seat: &DAffine3, travel_mm: f64) -> DAffine3 {
    let Some((on_axis, pitch)) = screw(path) else {
        return DAffine3::from_translation(shift(path, travel_mm)) * *seat;
    };
    let turn = DQuat::from_axis_angle(path.direction, -TAU * travel_mm / pitch);
    DAffine3::from_translation(on_axis - path.direction * travel_mm)
        * DAffine3::from_quat(turn)
        * DAffine3::from_translation(-on_axis)
        * *seat
}

/// Point on the axis of a way that is a screw, mm, and its pitch, mm a turn.
pub fn screw(path: &Path) -> Option<(DVec3, f64)> {
    path.screw.filter(|(_, pitch)| pitch.abs() > 1e-9)
}

/// Displacement from the fit on a way of straight lines.
fn shift(path: &Path, travel_mm: f64) -> DVec3 {
    let mut at = path.corners_mm.last().copied().unwrap_or_default();
    let mut left = travel_mm;
    let mut outward = -path.direction;
    for ends in path.corners_mm.windows(2).rev() {
        let leg = ends[0] - ends[1];
        let Some(direction) = leg.try_normalize() else {
            continue;
        };
        outward = direction;
        if left <= leg.length() {
            break;
        }
        at = ends[0];
        left -= leg.length();
    }
    at + outward * left
}

#[cfg(test)]
mod tests {
    use mortise_fit::PathKind;

    use super::*;

    fn path(kind: PathKind, corners_mm: Vec<DVec3>, screw: Option<(DVec3, f64)>) -> Path {
        Path {
            kind,
            direction: -DVec3::Z,
            length_mm: 20.0,
            smallest_clearance_mm: 0.0,
            corners_mm,
            screw,
            spin: None,
            ends: true,
            sliding: Vec::new(),
        }
    }

    #[test]
    fn straight_lines_are_followed_from_the_fit_and_beyond_both_ends() {
        let corners = vec![DVec3::new(5.0, 0.0, 15.0), 15.0 * DVec3::Z, DVec3::ZERO];
        let path = path(PathKind::Polyline, corners, None);
        let seat = DAffine3::from_translation(DVec3::ONE);
        for (travel, to) in [
            (-2.0, -2.0 * DVec3::Z),
            (0.0, DVec3::ZERO),
            (15.0, 15.0 * DVec3::Z),
            (18.0, DVec3::new(3.0, 0.0, 15.0)),
            (30.0, DVec3::new(15.0, 0.0, 15.0)),
        ] {
            let at = pose_at(&path, &seat, travel).translation;
            assert!(at.abs_diff_eq(DVec3::ONE + to, 1e-12), "{travel}: {at}");
        }
    }

    #[test]
    fn a_screw_turns_by_its_pitch() {
        let path = path(PathKind::Screw, Vec::new(), Some((DVec3::X, 4.0)));
        let pose = pose_at(&path, &DAffine3::IDENTITY, 4.0);
        assert!(
            pose.abs_diff_eq(DAffine3::from_translation(4.0 * DVec3::Z), 1e-9),
            "a whole turn"
        );
        let half = pose_at(&path, &DAffine3::IDENTITY, 2.0);
        assert!(
            half.transform_point3(DVec3::ZERO)
                .abs_diff_eq(DVec3::new(2.0, 0.0, 2.0), 1e-9)
        );
    }
}
