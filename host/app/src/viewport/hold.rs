//! A handle that is being dragged: the pose that the pointer gives the part, in steps where they are asked for, and the amount in words. Pure.
//!
//! A drag is measured in the plane of the handle: that of a square and a ring, of the screen for the middle, and the one through an axis that faces the viewer
//! most. A ring that is seen from its side is turned by the drag along it. Lengths are mm, angles rad, positions on the screen points.

use std::f64::consts::{PI, TAU};

use egui::Pos2;
use glam::{DAffine3, DQuat, DVec3};

use super::gizmo::{Axes, FLATTEST, Gizmo, Handle, RING};
use super::screen::Sight;
use crate::session::pose::{moved, rigid};

/// Half of a turn over which a ring that is seen from its side is straight, rad.
const SHORT: f64 = 1e-2;

/// Steps to which a drag is rounded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Snap {
    /// None.
    #[default]
    Free,
    /// 1 mm and 5°.
    Coarse,
    /// 0.1 mm and 0.5°.
    Fine,
}

impl Snap {
    /// A length, mm.
    pub fn length(self, mm: f64) -> f64 {
        self.round(mm, 1.0)
    }

    /// An angle, rad.
    pub fn angle(self, rad: f64) -> f64 {
        self.round(rad.to_degrees(), 5.0).to_radians()
    }

    fn round(self, value: f64, step: f64) -> f64 {
        match self {
            Self::Free => value,
            Self::Coarse => (value / step).round() * step,
            // By tenths of whole numbers, so that 0.3 is 0.3.
            Self::Fine => (10.0 * value / step).round() * step / 10.0,
        }
    }
}

/// How far a handle has been dragged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Amount {
    /// Along an axis, mm.
    Along(f64),
    /// Along two axes, mm.
    Across([f64; 2]),
    /// About an axis, rad.
    About(f64),
    /// In the plane of the screen: to the right and up, mm.
    InView([f64; 2]),
}

/// A handle that is being dragged.
#[derive(Clone, Debug)]
pub struct Hold {
    /// The handle.
    pub handle: Handle,
    /// Its amount so far.
    pub amount: Amount,
    gizmo: Gizmo,
    names: [&'static str; 3],
    /// Pose of the part at the beginning.
    pose: DAffine3,
    /// Directions of the amounts: along, across.
    along: [DVec3; 2],
    normal: DVec3,
    /// Place of the pointer at the beginning, by the handle: mm along the directions, or rad and 0.
    start: [f64; 2],
    /// Angle of the pointer seen last, rad, and what it has turned by.
    turned: [f64; 2],
    /// On the screen, for a ring that is seen from its side: beginning, direction of a positive turn, and points per rad.
    edge_on: Option<(Pos2, egui::Vec2, f32)>,
}

impl Hold {
    /// Takes hold of a handle at `at`, with the part at `pose`.
    pub fn begin(
        handle: Handle,
        axes: Axes,
        gizmo: Gizmo,
        pose: DAffine3,
        sight: &Sight,
        at: Pos2,
    ) -> Option<Self> {
        let axis = |i: usize| gizmo.axes[i % 3];
        let (along, normal, amount) = match handle {
            // The normal of the plane through the axis that faces the viewer most.
            Handle::Axis(i) => {
                let across = axis(i).cross(gizmo.towards).try_normalize()?;
                ([axis(i), across], across.cross(axis(i)), Amount::Along(0.0))
            }
            Handle::Plane(i) => ([axis(i + 1), axis(i + 2)], axis(i), Amount::Across([0.0; 2])),
            Handle::Ring(i) => ([axis(i + 1), axis(i + 2)], axis(i), Amount::About(0.0)),
            Handle::Middle => {
                let camera = &sight.camera;
                let plane = [camera.right(), camera.up()];
                (plane, camera.backward(), Amount::InView([0.0; 2]))
            }
        };
        let mut hold = Self {
            handle,
            amount,
            gizmo,
            names: axes.directions(),
            pose,
            along,
            normal,
            start: [0.0; 2],
            turned: [0.0; 2],
            edge_on: None,
        };
        if matches!(handle, Handle::Ring(_)) && normal.dot(gizmo.towards).abs() < FLATTEST {
            hold.edge_on = Some(hold.side_of_ring(sight, at)?);
        } else {
            hold.start = hold.pointed(sight, at)?;
            hold.turned[0] = hold.start[0];
        }
        Some(hold)
    }

    /// The pose of the part with the pointer at `at`; `None` where the pointer says nothing, as beyond the horizon of a plane.
    pub fn drag(&mut self, sight: &Sight, at: Pos2, snap: Snap) -> Option<DAffine3> {
        if matches!(self.handle, Handle::Ring(_)) {
            let angle = snap.angle(self.angle(sight, at)?);
            self.amount = Amount::About(angle);
            let turn = DQuat::from_axis_angle(self.normal, angle);
            return Some(rigid(&moved(&self.pose, self.gizmo.origin, turn, DVec3::ZERO)));
        }
        let now = self.pointed(sight, at)?;
        let [x, y] = [0, 1].map(|i| snap.length(now[i] - self.start[i]));
        let (amount, shift) = match self.handle {
            Handle::Axis(_) => (Amount::Along(x), x * self.along[0]),
            Handle::Middle => (Amount::InView([x, y]), x * self.along[0] + y * self.along[1]),
            _ => (Amount::Across([x, y]), x * self.along[0] + y * self.along[1]),
        };
        self.amount = amount;
        let mut pose = self.pose;
        pose.translation += shift;
        Some(pose)
    }

    /// Where the pointer is in the plane of the handle: mm along its directions; of a ring the angle, rad.
    fn pointed(&self, sight: &Sight, at: Pos2) -> Option<[f64; 2]> {
        let (from, direction) = sight.ray(at);
        let distance = (self.gizmo.origin - from).dot(self.normal) / direction.dot(self.normal);
        // Not finite along the plane, below 0 behind the viewer.
        if !(distance > 0.0 && distance.is_finite()) {
            return None;
        }
        let point = from + distance * direction - self.gizmo.origin;
        let [x, y] = self.along.map(|along| point.dot(along));
        Some(match self.handle {
            Handle::Ring(_) => [y.atan2(x), 0.0],
            _ => [x, y],
        })
    }

    /// What a ring is turned by, rad: several turns add up.
    fn angle(&mut self, sight: &Sight, at: Pos2) -> Option<f64> {
        if let Some((start, along, points)) = self.edge_on {
            return Some(f64::from((at - start).dot(along) / points));
        }
        let [now, _] = self.pointed(sight, at)?;
        let [last, turned] = self.turned;
        let step = (now - last + PI).rem_euclid(TAU) - PI;
        self.turned = [now, turned + step];
        Some(self.turned[1])
    }

    /// How a ring that is seen from its side is turned by a drag along it.
    fn side_of_ring(&self, sight: &Sight, at: Pos2) -> Option<(Pos2, egui::Vec2, f32)> {
        let front =
            (self.gizmo.towards - self.gizmo.towards.dot(self.normal) * self.normal).try_normalize()?;
        let forward = self.normal.cross(front);
        let radius = RING * self.gizmo.reach;
        let point = |angle: f64| {
            let on_ring = angle.cos() * front + angle.sin() * forward;
            sight.place(self.gizmo.origin + radius * on_ring)
        };
        let along = point(SHORT)? - point(-SHORT)?;
        let points = along.length() / (2.0 * SHORT as f32);
        (points > 1.0).then(|| (at, along.normalized(), points))
    }

    /// The amount by which the part has got to `pose`, which is less than that of the pointer where it is stopped.
    fn reached(&self, pose: &DAffine3) -> Amount {
        let shift = pose.translation - self.pose.translation;
        let [x, y] = self.along.map(|along| shift.dot(along));
        match self.amount {
            Amount::Along(_) => Amount::Along(x),
            Amount::Across(_) => Amount::Across([x, y]),
            Amount::InView(_) => Amount::InView([x, y]),
            Amount::About(pointer) => {
                let turn = DQuat::from_mat3(&(pose.matrix3 * self.pose.matrix3.transpose()));
                let angle = 2.0 * turn.xyz().dot(self.normal).atan2(turn.w);
                // Of all whole turns more or less, those of the pointer.
                Amount::About(angle + TAU * ((pointer - angle) / TAU).round())
            }
        }
    }

    /// The amount by which the part has got to `pose`, in words: “x 12.350 mm”.
    pub fn words(&self, pose: &DAffine3) -> String {
        let names = self.names;
        match (self.handle, self.reached(pose)) {
            (Handle::Axis(i), Amount::Along(mm)) => format!("{} {} mm", names[i], number(mm, 3)),
            (Handle::Plane(i), Amount::Across([a, b])) => {
                let (u, v) = (names[(i + 1) % 3], names[(i + 2) % 3]);
                format!("{u} {}, {v} {} mm", number(a, 3), number(b, 3))
            }
            (Handle::Ring(i), Amount::About(rad)) => {
                format!("about {} {}°", names[i], number(rad.to_degrees(), 2))
            }
            (_, Amount::InView([x, y])) => format!("right {}, up {} mm", number(x, 3), number(y, 3)),
            _ => String::new(),
        }
    }
}

/// A number with a minus sign that is as wide as its digits, and no sign before zero.
fn number(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let is_zero = text.chars().all(|c| matches!(c, '-' | '0' | '.'));
    match text.strip_prefix('-') {
        Some(digits) if is_zero => digits.to_owned(),
        Some(digits) => format!("\u{2212}{digits}"),
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::viewport::gizmo::tests::{MIDDLE, axes, of, pose, sight, sights};
    use crate::viewport::gizmo::{AXIS, SQUARE};

    proptest! {
        /// Positions on the screen have 24 bits, a thousand points to 6e-5; at the flattest angle, seen from 600 mm, that is less than 0.01 mm.
        #[test]
        fn the_part_goes_with_the_pointer(sight in sights(), axes in axes(), by in -20.0..20.0f64, handle in 0..7usize) {
            let (handle, gizmo) = (Handle::ALL[handle], of(axes, &sight));
            let Some(drawn) = gizmo.drawn(handle, &sight) else { return Ok(()) };
            let from = drawn.grip();
            let directions = match handle {
                Handle::Axis(i) => vec![gizmo.axes[i]],
                Handle::Plane(i) => vec![gizmo.axes[(i + 1) % 3], gizmo.axes[(i + 2) % 3]],
                _ => vec![sight.camera.right(), sight.camera.up()],
            };
            let mut hold = Hold::begin(handle, axes, gizmo, pose(), &sight, from).expect("it is shown");
            prop_assert_eq!(hold.drag(&sight, from, Snap::Free).map(|p| p.translation.distance(pose().translation) < 1e-6), Some(true));
            for direction in directions {
                // The point that is held, moved.
                let held = match handle {
                    Handle::Axis(_) => gizmo.origin + gizmo.reach * direction,
                    Handle::Plane(i) => {
                        let middle = 0.5 * (SQUARE.0 + SQUARE.1) * gizmo.reach;
                        gizmo.origin + middle * (gizmo.axes[(i + 1) % 3] + gizmo.axes[(i + 2) % 3])
                    }
                    _ => gizmo.origin,
                };
                let Some(start) = sight.place(held) else { return Ok(()) };
                let Some(end) = sight.place(held + by * direction) else { return Ok(()) };
                let mut hold = Hold::begin(handle, axes, gizmo, pose(), &sight, start).expect("it is shown");
                let Some(moved) = hold.drag(&sight, end, Snap::Free) else { return Ok(()) };
                let off = moved.translation - pose().translation - by * direction;
                prop_assert!(off.length() < 0.02, "{handle:?}: {off} after {by}");
                prop_assert_eq!(moved.matrix3, pose().matrix3);
            }
        }
    }

    #[test]
    fn a_ring_turns_about_its_axis_by_where_the_pointer_is() {
        let sight = sight(-0.9, 0.5, 300.0);
        let gizmo = of(Axes::World, &sight);
        let at = |angle: f64| {
            let on_ring = angle.cos() * DVec3::X + angle.sin() * DVec3::Y;
            sight
                .place(MIDDLE + RING * gizmo.reach * on_ring)
                .expect("in front")
        };
        let mut hold =
            Hold::begin(Handle::Ring(2), Axes::World, gizmo, pose(), &sight, at(-1.0)).expect("shown");
        let mut turned = pose();
        // More than one turn.
        for step in 0..=80 {
            turned = hold
                .drag(&sight, at(-1.0 + 0.1 * f64::from(step)), Snap::Free)
                .expect("a pose");
        }
        let wanted = rigid(&moved(&pose(), MIDDLE, DQuat::from_rotation_z(8.0), DVec3::ZERO));
        assert!(turned.abs_diff_eq(wanted, 1e-3), "{turned} {wanted}");
        assert_eq!(hold.words(&turned), "about z 458.37°");
        turned = hold.drag(&sight, at(7.0), Snap::Coarse).expect("a pose");
        assert_eq!(hold.words(&turned), "about z 460.00°");
    }

    #[test]
    fn a_ring_seen_from_its_side_turns_with_the_drag() {
        // Along x: the ring about z is a line.
        let sight = sight(0.0, 0.0, 300.0);
        let gizmo = of(Axes::World, &sight);
        let grip = gizmo.drawn(Handle::Ring(2), &sight).expect("shown").grip();
        let mut hold = Hold::begin(Handle::Ring(2), Axes::World, gizmo, pose(), &sight, grip).expect("shown");
        hold.drag(&sight, grip + egui::vec2(40.0, 0.0), Snap::Free)
            .expect("a pose");
        let Amount::About(rad) = hold.amount else {
            panic!("{:?}", hold.amount)
        };
        // The front, towards +x, goes to the right, which is +y: about +z.
        assert!((rad - 40.0 / (RING * AXIS)).abs() < 0.1, "{rad}");
    }

    #[test]
    fn amounts_snap_and_are_said() {
        let all = [Snap::Free, Snap::Coarse, Snap::Fine];
        assert_eq!(all.map(|snap| snap.length(12.34)), [12.34, 12.0, 12.3]);
        assert_eq!(
            all.map(|snap| (snap.angle(0.3).to_degrees() * 1e9).round() / 1e9),
            [17.188733854, 15.0, 17.0]
        );
        assert_eq!(
            [number(-1.25, 2), number(-0.0001, 3), number(3.0, 1)],
            ["\u{2212}1.25", "0.000", "3.0"]
        );
    }
}
