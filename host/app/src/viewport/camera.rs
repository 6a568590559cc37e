//! The viewport's camera: its pose and its response to gestures. No I/O and no drawing.
//!
//! World: millimetres, z up. The camera looks from `target + distance · d(yaw, pitch)` at `target`, with
//! d = (cos pitch · cos yaw, cos pitch · sin yaw, sin pitch), so that pitch may reach ±90° without a jump: the right-hand axis
//! (−sin yaw, cos yaw, 0) does not depend on it. Normalised device coordinates (ndc) run from −1 to 1, y up; depth from 0 to 1.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::dcamera::rh::proj::directx::perspective;
use glam::{DMat4, DVec2, DVec3, DVec4};

use crate::display::extent::Extent;

/// Vertical angle of view, rad: narrow enough that round parts look round at the rim of the picture.
pub const FIELD_OF_VIEW: f64 = 0.55;
/// Smallest and largest distance of the camera, in radii of the scene.
const REACH: (f64, f64) = (1e-3, 40.0);

/// A named viewing direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum View {
    /// From front right above.
    Iso,
    /// Along +y.
    Front,
    /// Along −x.
    Right,
    /// Along −z.
    Top,
}

impl View {
    /// All views, in the order of the toolbar.
    pub const ALL: [Self; 4] = [Self::Iso, Self::Front, Self::Right, Self::Top];

    /// Its name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Iso => "Iso",
            Self::Front => "Front",
            Self::Right => "Right",
            Self::Top => "Top",
        }
    }

    fn angles(self) -> (f64, f64) {
        match self {
            Self::Iso => (-0.30 * PI, 0.42),
            Self::Front => (-FRAC_PI_2, 0.0),
            Self::Right => (0.0, 0.0),
            Self::Top => (-FRAC_PI_2, FRAC_PI_2),
        }
    }
}

/// Pose of the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Point at the picture's centre, about which the camera orbits, mm.
    pub target: DVec3,
    /// Distance from the target, mm.
    pub distance: f64,
    /// Angle about z, rad.
    pub yaw: f64,
    /// Angle above the xy plane, rad, −π/2 to π/2.
    pub pitch: f64,
}

impl Default for Camera {
    fn default() -> Self {
        let mut camera = Self {
            target: DVec3::ZERO,
            distance: 1.0,
            yaw: 0.0,
            pitch: 0.0,
        };
        camera.look(View::Iso);
        camera.fit(Extent::default(), 1.0);
        camera
    }
}

impl Camera {
    /// Unit vector from the target to the eye.
    pub fn backward(&self) -> DVec3 {
        let (sp, cp) = self.pitch.sin_cos();
        let (sy, cy) = self.yaw.sin_cos();
        DVec3::new(cp * cy, cp * sy, sp)
    }

    /// Unit vector towards the picture's right edge.
    pub fn right(&self) -> DVec3 {
        let (sy, cy) = self.yaw.sin_cos();
        DVec3::new(-sy, cy, 0.0)
    }

    /// Unit vector towards the picture's top edge.
    pub fn up(&self) -> DVec3 {
        self.backward().cross(self.right())
    }

    /// Position of the eye, mm.
    pub fn eye(&self) -> DVec3 {
        self.target + self.distance * self.backward()
    }

    /// Rotates to a named direction; target and distance stay.
    pub fn look(&mut self, view: View) {
        (self.yaw, self.pitch) = view.angles();
    }

    /// Moves so that all of `extent` is visible, with a small margin, in a picture of aspect ratio `aspect` (width over height).
    ///
    /// A sphere of radius r spans a half angle α when seen from the distance r / sin α.
    pub fn fit(&mut self, extent: Extent, aspect: f64) {
        let vertical = 0.5 * FIELD_OF_VIEW;
        let horizontal = (vertical.tan() * aspect).atan();
        self.target = extent.center;
        self.distance = 1.02 * extent.radius / vertical.min(horizontal).sin();
    }

    /// Orbits about the target. `by` is in fractions of the picture's height: a full height turns half a circle.
    pub fn orbit(&mut self, by: DVec2) {
        self.yaw = (self.yaw - PI * by.x).rem_euclid(2.0 * PI);
        self.pitch = (self.pitch + PI * by.y).clamp(-FRAC_PI_2, FRAC_PI_2);
    }

    /// Pans with the pointer. `by` is in fractions of the picture's height, y down; a point at the target's depth follows exactly.
    pub fn pan(&mut self, by: DVec2) {
        let height = 2.0 * self.distance * (0.5 * FIELD_OF_VIEW).tan();
        self.target += height * (by.y * self.up() - by.x * self.right());
    }

    /// Scales the distance to `anchor` by `factor` (below 1: nearer); the anchor keeps its place in the picture.
    ///
    /// Eye and target are scaled about the anchor, so the ray from the eye through it stays the same ray.
    pub fn zoom_at(&mut self, anchor: DVec3, factor: f64, extent: Extent) {
        let allowed = (
            REACH.0 * extent.radius / self.distance,
            REACH.1 * extent.radius / self.distance,
        );
        // The camera is already beyond one end of the range (the scene changed): that end does not limit it further.
        let factor = factor.clamp(allowed.0.min(1.0), allowed.1.max(1.0));
        self.target = anchor + factor * (self.target - anchor);
        self.distance *= factor;
    }

    /// World to clip space, depth 0 to 1, clipping planes close to `extent`.
    pub fn view_projection(&self, aspect: f64, extent: Extent) -> DMat4 {
        let (near, far) = self.depth_range(extent);
        perspective(FIELD_OF_VIEW, aspect, near, far) * self.view()
    }

    /// Nearest and farthest depth drawn, mm: half the extent's radius more on each side, for ghosts and arrows outside the extent.
    pub fn depth_range(&self, extent: Extent) -> (f64, f64) {
        let depth = (self.eye() - extent.center).dot(self.backward());
        let far = (depth + 1.5 * extent.radius).max(1e-2 * extent.radius);
        let near = (depth - 1.5 * extent.radius).max(1e-3 * far);
        (near, far)
    }

    /// World to camera space (x right, y up, looking along −z).
    pub fn view(&self) -> DMat4 {
        let (x, y, z, eye) = (self.right(), self.up(), self.backward(), self.eye());
        DMat4::from_cols(
            DVec4::new(x.x, y.x, z.x, 0.0),
            DVec4::new(x.y, y.y, z.y, 0.0),
            DVec4::new(x.z, y.z, z.z, 0.0),
            DVec4::new(-x.dot(eye), -y.dot(eye), -z.dot(eye), 1.0),
        )
    }

    /// The viewing ray through `ndc`: the eye, and a unit vector.
    pub fn ray(&self, ndc: DVec2, aspect: f64) -> (DVec3, DVec3) {
        let t = (0.5 * FIELD_OF_VIEW).tan();
        let direction = ndc.x * t * aspect * self.right() + ndc.y * t * self.up() - self.backward();
        (self.eye(), direction.normalize())
    }

    /// Intersection of the ray through `ndc` with the plane through `point` perpendicular to the camera's axis, mm.
    pub fn on_plane_through(&self, point: DVec3, ndc: DVec2, aspect: f64) -> DVec3 {
        let (eye, direction) = self.ray(ndc, aspect);
        let depth = (eye - point).dot(self.backward());
        // The ray is inclined to the axis by at most half the angle of view: the divisor is far from 0.
        eye + direction * (depth / -direction.dot(self.backward()))
    }

    /// Projection of `point` in ndc; `None` behind the eye.
    pub fn project(&self, point: DVec3, aspect: f64) -> Option<DVec2> {
        let seen = self.view().transform_point3(point);
        let t = (0.5 * FIELD_OF_VIEW).tan();
        (seen.z < 0.0).then(|| DVec2::new(seen.x / (-seen.z * t * aspect), seen.y / (-seen.z * t)))
    }

    /// Interpolation to `goal` (0: here, 1: there), by the shorter rotation.
    pub fn towards(&self, goal: &Self, part: f64) -> Self {
        let turn = (goal.yaw - self.yaw + PI).rem_euclid(2.0 * PI) - PI;
        Self {
            target: self.target.lerp(goal.target, part),
            distance: self.distance * (goal.distance / self.distance).powf(part),
            yaw: self.yaw + part * turn,
            pitch: self.pitch + part * (goal.pitch - self.pitch),
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn cameras() -> impl Strategy<Value = Camera> {
        (
            prop::array::uniform3(-100.0..100.0),
            1.0..1e3f64,
            0.0..2.0 * PI,
            -1.55..1.55,
        )
            .prop_map(|(t, distance, yaw, pitch)| Camera {
                target: DVec3::from(t),
                distance,
                yaw,
                pitch,
            })
    }

    fn spots() -> impl Strategy<Value = DVec2> {
        (-1.0..1.0, -1.0..1.0).prop_map(|(x, y)| DVec2::new(x, y))
    }

    proptest! {
        /// Errors are rounding only: a dozen operations at 2⁻⁵² on lengths up to 1.5e3, seen from 1 mm, are a factor of 1e2 below 1e-9.
        #[test]
        fn what_lies_under_the_cursor_stays_there(camera in cameras(), at in spots(), factor in 0.5..2.0) {
            let extent = Extent { center: DVec3::ZERO, radius: 100.0 };
            let anchor = camera.on_plane_through(camera.target, at, 1.6);
            let mut nearer = camera;
            nearer.zoom_at(anchor, factor, extent);
            let seen = nearer.project(anchor, 1.6).expect("in front");
            prop_assert!((seen - at).length() < 1e-9, "{seen} {at}");
        }

        #[test]
        fn panning_carries_the_point_at_the_target(camera in cameras(), by in spots()) {
            let mut panned = camera;
            panned.pan(by);
            let seen = panned.project(camera.target, 1.6).expect("in front");
            // One picture height is 2 ndc; ndc x is relative to the width.
            let expected = DVec2::new(2.0 * by.x / 1.6, -2.0 * by.y);
            prop_assert!((seen - expected).length() < 1e-9, "{seen} {expected}");
        }

        #[test]
        fn projection_and_matrix_agree(camera in cameras(), p in prop::array::uniform3(-80.0..80.0)) {
            let (point, extent) = (DVec3::from(p), Extent { center: DVec3::ZERO, radius: 200.0 });
            if let Some(seen) = camera.project(point, 1.6) {
                let clip = camera.view_projection(1.6, extent) * point.extend(1.0);
                let ndc = DVec2::new(clip.x / clip.w, clip.y / clip.w);
                prop_assert!((ndc - seen).length() < 1e-9 * (1.0 + seen.length()));
            }
        }

        #[test]
        fn a_fitted_extent_lies_in_the_picture(camera in cameras(), radius in 0.01..1e4, aspect in 0.3..3.0) {
            let extent = Extent { center: DVec3::new(3.0, -2.0, 1.0), radius };
            let mut camera = camera;
            camera.fit(extent, aspect);
            let matrix = camera.view_projection(aspect, extent);
            for axis in [DVec3::X, DVec3::Y, DVec3::Z, -DVec3::X, -DVec3::Y, -DVec3::Z] {
                let clip = matrix * (extent.center + radius * axis).extend(1.0);
                prop_assert!(clip.w > 0.0 && clip.x.abs() <= clip.w && clip.y.abs() <= clip.w);
                prop_assert!(clip.z >= 0.0 && clip.z <= clip.w);
            }
        }

        #[test]
        fn axes_are_orthonormal_and_right_handed(camera in cameras()) {
            let (r, u, b) = (camera.right(), camera.up(), camera.backward());
            prop_assert!((r.cross(u) - b).length() < 1e-12 && (u.length() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn top_view_has_x_to_the_right_and_y_up() {
        let mut camera = Camera::default();
        camera.look(View::Top);
        assert!((camera.right() - DVec3::X).length() < 1e-12);
        assert!((camera.up() - DVec3::Y).length() < 1e-12);
    }
}
