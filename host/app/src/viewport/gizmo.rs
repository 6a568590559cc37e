//! The handles of a part: three axes, three planes, three rings, and the middle for a move in the view. Pure: their shapes on the screen, and which one is under
//! the pointer.
//!
//! They stand at the part's middle, have the same size on the screen at every zoom, and are drawn over everything. Lengths are mm, angles rad, positions
//! on the screen points.

use std::f64::consts::PI;

use egui::Pos2;
use glam::{DAffine3, DVec3};

use super::camera::Camera;
use super::screen::Sight;

/// Length of an axis, points.
pub(super) const AXIS: f64 = 90.0;
/// Where an axis begins, in its length: beyond the handle in the middle.
const AXIS_FROM: f64 = 0.16;
/// Ends of the squares of the planes, in lengths of an axis.
pub(super) const SQUARE: (f64, f64) = (0.26, 0.46);
/// Radius of the rings, in lengths of an axis.
pub(super) const RING: f64 = 0.74;
/// Sides of the polygon of a whole ring.
const SIDES: usize = 72;
/// Distance within which the pointer is on a line, and on the middle, points.
const NEAR: f32 = 7.0;
const NEAR_MIDDLE: f32 = 10.0;
/// Shortest axis on the screen that is shown, in its length: a shorter one points at the viewer, and no drag along it is defined.
const SHORTEST: f64 = 0.2;
/// Least sine of the angle at which a square is seen, and a ring is turned by where the pointer is in its plane.
pub(super) const FLATTEST: f64 = 0.15;

/// Directions in which a part is moved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Axes {
    /// Those of the world.
    #[default]
    World,
    /// Those of the part's frame in its file.
    Part,
    /// Right, up, and towards the viewer.
    View,
}

impl Axes {
    /// All, in the order of the window.
    pub const ALL: [Self; 3] = [Self::World, Self::Part, Self::View];

    /// Its name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::World => "World",
            Self::Part => "Part",
            Self::View => "View",
        }
    }

    /// Names of the three directions.
    pub const fn directions(self) -> [&'static str; 3] {
        match self {
            Self::World | Self::Part => ["x", "y", "z"],
            Self::View => ["right", "up", "near"],
        }
    }

    /// The directions for a part at `pose`: orthonormal, right-handed, in the world.
    pub fn of(self, pose: &DAffine3, camera: &Camera) -> [DVec3; 3] {
        match self {
            Self::World => DVec3::AXES,
            Self::Part => [pose.matrix3.x_axis, pose.matrix3.y_axis, pose.matrix3.z_axis],
            Self::View => [camera.right(), camera.up(), camera.backward()],
        }
    }
}

/// A handle; numbers are those of the axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Handle {
    /// Moves along an axis.
    Axis(usize),
    /// Moves in the plane across an axis.
    Plane(usize),
    /// Turns about an axis.
    Ring(usize),
    /// Moves in the plane of the screen.
    Middle,
}

impl Handle {
    /// All, those first that lie over others.
    pub const ALL: [Self; 10] = [
        Self::Middle,
        Self::Axis(0),
        Self::Axis(1),
        Self::Axis(2),
        Self::Plane(0),
        Self::Plane(1),
        Self::Plane(2),
        Self::Ring(0),
        Self::Ring(1),
        Self::Ring(2),
    ];

    /// What it does, in words.
    pub fn name(self, axes: Axes) -> String {
        let names = axes.directions();
        match self {
            Self::Axis(i) => format!("Move along {}", names[i]),
            Self::Plane(i) => format!("Move along {} and {}", names[(i + 1) % 3], names[(i + 2) % 3]),
            Self::Ring(i) => format!("Turn about {}", names[i]),
            Self::Middle => "Move in the view".to_owned(),
        }
    }

    /// Name of a step of the history.
    pub fn verb(self) -> &'static str {
        match self {
            Self::Ring(_) => "turn",
            _ => "move",
        }
    }
}

/// A handle on the screen.
#[derive(Clone, Debug, PartialEq)]
pub enum Drawn {
    /// An axis, from its beginning to its tip.
    Arrow([Pos2; 2]),
    /// A plane's square.
    Square([Pos2; 4]),
    /// The half of a ring that faces the viewer.
    Ring(Vec<Pos2>),
    /// The middle.
    Dot(Pos2),
}

impl Drawn {
    /// Where it is taken hold of.
    pub fn grip(&self) -> Pos2 {
        match self {
            Self::Arrow([_, tip]) => *tip,
            Self::Square(corners) => corners[0] + 0.5 * (corners[2] - corners[0]),
            // Away from the ends, where rings meet.
            Self::Ring(points) => points[points.len() * 2 / 5],
            Self::Dot(at) => *at,
        }
    }

    /// Whether the pointer is on it.
    fn is_at(&self, at: Pos2) -> bool {
        match self {
            Self::Arrow([from, to]) => from_segment(at, *from, *to) < NEAR,
            Self::Square(corners) => is_within(at, corners),
            Self::Ring(points) => points
                .windows(2)
                .any(|side| from_segment(at, side[0], side[1]) < NEAR),
            Self::Dot(middle) => middle.distance(at) < NEAR_MIDDLE,
        }
    }
}

fn from_segment(at: Pos2, from: Pos2, to: Pos2) -> f32 {
    let along = to - from;
    let t = ((at - from).dot(along) / along.length_sq().max(1e-6)).clamp(0.0, 1.0);
    (from + t * along).distance(at)
}

/// Whether a point lies in a convex polygon.
fn is_within(at: Pos2, corners: &[Pos2]) -> bool {
    let side = |i: usize| {
        let (from, to) = (corners[i], corners[(i + 1) % corners.len()]);
        let (along, to_point) = (to - from, at - from);
        along.x * to_point.y - along.y * to_point.x
    };
    let sides: Vec<f32> = (0..corners.len()).map(side).collect();
    sides.iter().all(|side| *side >= 0.0) || sides.iter().all(|side| *side <= 0.0)
}

/// Where the handles stand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gizmo {
    /// Middle of the part, mm.
    pub origin: DVec3,
    /// Directions: orthonormal, right-handed.
    pub axes: [DVec3; 3],
    /// Length of an axis, mm.
    pub(super) reach: f64,
    /// From the middle towards the viewer.
    pub(super) towards: DVec3,
}

impl Gizmo {
    /// The handles of a part at `pose` with its middle at `origin`; `None` behind the viewer.
    pub fn of(axes: Axes, pose: &DAffine3, origin: DVec3, sight: &Sight) -> Option<Self> {
        Some(Self {
            origin,
            axes: axes.of(pose, &sight.camera),
            reach: AXIS * sight.mm_per_point(origin)?,
            towards: sight.towards_viewer(origin)?,
        })
    }

    /// A handle on the screen; `None` while it is seen at an angle at which no drag of it is defined.
    pub fn drawn(&self, handle: Handle, sight: &Sight) -> Option<Drawn> {
        let at = |x: f64, u: DVec3, y: f64, v: DVec3| sight.place(self.origin + self.reach * (x * u + y * v));
        match handle {
            Handle::Middle => sight.place(self.origin).map(Drawn::Dot),
            Handle::Axis(i) => {
                let axis = self.axes[i];
                let seen = axis.cross(self.towards).length() > SHORTEST;
                let ends = [at(AXIS_FROM, axis, 0.0, axis)?, at(1.0, axis, 0.0, axis)?];
                seen.then_some(Drawn::Arrow(ends))
            }
            Handle::Plane(i) => {
                let (u, v) = (self.axes[(i + 1) % 3], self.axes[(i + 2) % 3]);
                let seen = self.axes[i].dot(self.towards).abs() > FLATTEST;
                let (near, far) = SQUARE;
                let corners = [
                    at(near, u, near, v)?,
                    at(far, u, near, v)?,
                    at(far, u, far, v)?,
                    at(near, u, far, v)?,
                ];
                seen.then_some(Drawn::Square(corners))
            }
            Handle::Ring(i) => self.half_ring(i, sight).map(Drawn::Ring),
        }
    }

    /// The half of a ring that faces the viewer; all of it where it is seen from above.
    fn half_ring(&self, i: usize, sight: &Sight) -> Option<Vec<Pos2>> {
        let axis = self.axes[i];
        let across = (self.towards - self.towards.dot(axis) * axis).try_normalize();
        let (middle, half) = match across.filter(|_| self.towards.dot(axis).abs() < 0.98) {
            Some(middle) => (middle, 0.5 * PI),
            None => (axis.any_orthonormal_vector(), PI),
        };
        let side = axis.cross(middle);
        let steps = (SIDES as f64 * half / PI) as usize;
        (0..=steps)
            .map(|step| {
                let angle = half * (2.0 * step as f64 / steps as f64 - 1.0);
                let on_ring = angle.cos() * middle + angle.sin() * side;
                sight.place(self.origin + RING * self.reach * on_ring)
            })
            .collect()
    }

    /// The handle under the pointer.
    pub fn hit(&self, sight: &Sight, at: Pos2) -> Option<Handle> {
        let is_at = |handle: &Handle| self.drawn(*handle, sight).is_some_and(|drawn| drawn.is_at(at));
        Handle::ALL.into_iter().find(is_at)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use std::f64::consts::TAU;

    use egui::Rect;
    use glam::DQuat;
    use proptest::prelude::*;

    use super::*;
    use crate::viewport::camera::View;

    pub const MIDDLE: DVec3 = DVec3::new(4.0, -3.0, 12.0);

    pub fn sight(yaw: f64, pitch: f64, distance: f64) -> Sight {
        let mut camera = Camera::default();
        camera.look(View::Iso);
        camera.target = DVec3::new(1.0, 2.0, 3.0);
        (camera.distance, camera.yaw, camera.pitch) = (distance, yaw, pitch);
        Sight {
            camera,
            rect: Rect::from_min_size(Pos2::new(250.0, 60.0), egui::vec2(900.0, 600.0)),
        }
    }

    pub fn pose() -> DAffine3 {
        DAffine3::from_rotation_translation(DQuat::from_rotation_y(0.4), DVec3::new(0.0, 5.0, 0.0))
    }

    pub fn of(axes: Axes, sight: &Sight) -> Gizmo {
        Gizmo::of(axes, &pose(), MIDDLE, sight).expect("in front")
    }

    pub fn sights() -> impl Strategy<Value = Sight> {
        (0.0..TAU, -1.5..1.5f64, 60.0..600.0f64).prop_map(|(yaw, pitch, far)| sight(yaw, pitch, far))
    }

    pub fn axes() -> impl Strategy<Value = Axes> {
        prop_oneof![Just(Axes::World), Just(Axes::Part), Just(Axes::View)]
    }

    proptest! {
        /// The handles have the same size at every distance, and each is found where it is taken hold of.
        #[test]
        fn handles_are_sized_on_the_screen_and_found(sight in sights(), axes in axes()) {
            let gizmo = of(axes, &sight);
            let middle = sight.place(MIDDLE).expect("in front");
            for handle in Handle::ALL {
                let Some(drawn) = gizmo.drawn(handle, &sight) else { continue };
                let grip = drawn.grip();
                // Nearer to the viewer, things are larger.
                prop_assert!(middle.distance(grip) < 1.6 * AXIS as f32, "{handle:?}");
                prop_assert!(drawn.is_at(grip), "{handle:?}");
                prop_assert!(gizmo.hit(&sight, grip).is_some());
            }
            prop_assert_eq!(gizmo.hit(&sight, middle), Some(Handle::Middle));
            prop_assert_eq!(gizmo.hit(&sight, middle + egui::vec2(200.0, 0.0)), None);
        }
    }
}
