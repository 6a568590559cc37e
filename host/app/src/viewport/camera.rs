//! The viewport's camera: its pose and its response to gestures. No I/O and no drawing.
//!
//! World: millimetres, z up. The camera looks from `target + distance · d(yaw, pitch)` at `target`, with
//! d = (cos pitch · cos yaw, cos pitch · sin yaw, sin pitch), so that pitch may reach ±90° without a jump: the right-hand axis
//! (−sin yaw, cos yaw, 0) does not depend on it. Normalised device coordinates (ndc) run from −1 to 1, y up; depth from 0 to 1.
//!
//! In the orthographic projection all rays run along −d. Its scale is that of the perspective one at the target, so that a switch keeps what is there.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::dcamera::rh::proj::directx::perspective;
use glam::{DMat4, DVec2, DVec3, DVec4};

use crate::display::extent::Extent;

/// Vertical angle of view, rad: narrow enough that round parts look round at the rim of the picture.
pub const FIELD_OF_VIEW: f64 = 0.55;
/// Smallest and largest distance of the camera, in radii of the scene.
const REACH: (f64, f64) = (1e-3, 40.0);
/// Depth drawn on each side of the extent's centre in the orthographic projection, in radii of the extent.
const PARALLEL_REACH: f64 = 4.0;

/// A named viewing direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum View {
    /// From front right above.
    Iso,
    /// Along +y.
    Front,
    /// Along −y.
    Back,
    /// Along +x.
    Left,
    /// Along −x.
    Right,
    /// Along −z.
    Top,
    /// Along +z.
    Bottom,
}

impl View {
    /// The views of the toolbar, in its order; keys and the view cube have all.
    pub const ALL: [Self; 4] = [Self::Iso, Self::Front, Self::Right, Self::Top];

    /// Its name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Iso => "Iso",
            Self::Front => "Front",
            Self::Back => "Back",
            Self::Left => "Left",
            Self::Right => "Right",
            Self::Top => "Top",
            Self::Bottom => "Bottom",
        }
    }

    fn angles(self) -> (f64, f64) {
        match self {
            Self::Iso => (-0.30 * PI, 0.42),
            Self::Front => (-FRAC_PI_2, 0.0),
            Self::Back => (FRAC_PI_2, 0.0),
            Self::Left => (PI, 0.0),
            Self::Right => (0.0, 0.0),
            Self::Top => (-FRAC_PI_2, FRAC_PI_2),
            Self::Bottom => (-FRAC_PI_2, -FRAC_PI_2),
        }
    }
}

/// How the picture is projected.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Projection {
    /// Rays meet in the eye.
    #[default]
    Perspective,
    /// Rays are parallel: equal lengths look equal at every depth.
    Orthographic,
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
    /// Projection.
    pub projection: Projection,
}

impl Default for Camera {
    fn default() -> Self {
        let mut camera = Self {
            target: DVec3::ZERO,
            distance: 1.0,
            yaw: 0.0,
            pitch: 0.0,
            projection: Projection::default(),
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

    /// Rotates until the eye is in the direction `from` of the target. Straight from above or below the x axis runs to the right, as in [`View::Top`].
    pub fn look_from(&mut self, from: DVec3) {
        let across = from.truncate().length();
        self.pitch = from.z.atan2(across);
        self.yaw = if across > 1e-9 * from.z.abs() {
            from.y.atan2(from.x)
        } else {
            -FRAC_PI_2
        };
    }

    /// Moves so that all of `extent` is visible, with a small margin, in a picture of aspect ratio `aspect` (width over height).
    ///
    /// A sphere of radius r spans a half angle α when seen from the distance r / sin α; parallel rays see a half height of distance · tan α.
    pub fn fit(&mut self, extent: Extent, aspect: f64) {
        let vertical = 0.5 * FIELD_OF_VIEW;
        let horizontal = (vertical.tan() * aspect).atan();
        let half_angle = vertical.min(horizontal);
        let ratio = match self.projection {
            Projection::Perspective => half_angle.sin(),
            Projection::Orthographic => half_angle.tan(),
        };
        self.target = extent.center;
        self.distance = 1.02 * extent.radius / ratio;
    }

    /// Orbits about the target. `by` is in fractions of the picture's height: a full height turns half a circle.
    pub fn orbit(&mut self, by: DVec2) {
        self.yaw = (self.yaw - PI * by.x).rem_euclid(2.0 * PI);
        self.pitch = (self.pitch + PI * by.y).clamp(-FRAC_PI_2, FRAC_PI_2);
    }

    /// Orbits about `pivot`, which keeps its place in the picture; `by` as in [`Self::orbit`].
    ///
    /// The vector from pivot to target keeps its components along the camera's axes, so the pivot keeps its own in the camera's frame.
    pub fn orbit_about(&mut self, pivot: DVec3, by: DVec2) {
        let arm = self.target - pivot;
        let kept = [self.right(), self.up(), self.backward()].map(|axis| arm.dot(axis));
        self.orbit(by);
        self.target = pivot + kept[0] * self.right() + kept[1] * self.up() + kept[2] * self.backward();
    }

    /// Pans with the pointer. `by` is in fractions of the picture's height, y down; a point at the target's depth follows exactly.
    pub fn pan(&mut self, by: DVec2) {
        let height = self.height_at(self.target);
        self.target += height * (by.y * self.up() - by.x * self.right());
    }

    /// Height of the picture at the depth of `point`, mm.
    pub fn height_at(&self, point: DVec3) -> f64 {
        let depth = match self.projection {
            Projection::Perspective => (self.eye() - point).dot(self.backward()),
            Projection::Orthographic => self.distance,
        };
        2.0 * depth * (0.5 * FIELD_OF_VIEW).tan()
    }

    /// Whether a plane through `point` shows the side to which its `normal` points.
    pub fn sees_front(&self, point: DVec3, normal: DVec3) -> bool {
        let towards = match self.projection {
            Projection::Perspective => self.eye() - point,
            Projection::Orthographic => self.backward(),
        };
        towards.dot(normal) > 0.0
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
        let projection = match self.projection {
            Projection::Perspective => perspective(FIELD_OF_VIEW, aspect, near, far),
            Projection::Orthographic => {
                let half = 0.5 * self.height_at(self.target);
                DMat4::from_translation(DVec3::Z * (near / (near - far)))
                    * DMat4::from_scale(DVec3::new(1.0 / (half * aspect), 1.0 / half, 1.0 / (near - far)))
            }
        };
        projection * self.view()
    }

    /// Nearest and farthest depth drawn, mm: half the extent's radius more on each side, for ghosts and arrows outside the extent. Parallel rays have no
    /// eye, so the nearest depth may be below 0 and the range is wider.
    pub fn depth_range(&self, extent: Extent) -> (f64, f64) {
        let depth = (self.eye() - extent.center).dot(self.backward());
        if self.projection == Projection::Orthographic {
            let reach = PARALLEL_REACH * extent.radius;
            return (depth - reach, depth + reach);
        }
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

    /// The viewing ray through `ndc`: a point of it at the eye's depth, which is the eye in perspective, and a unit vector.
    pub fn ray(&self, ndc: DVec2, aspect: f64) -> (DVec3, DVec3) {
        let t = (0.5 * FIELD_OF_VIEW).tan();
        let aside = ndc.x * t * aspect * self.right() + ndc.y * t * self.up();
        match self.projection {
            Projection::Perspective => (self.eye(), (aside - self.backward()).normalize()),
            Projection::Orthographic => (self.eye() + self.distance * aside, -self.backward()),
        }
    }

    /// As [`Self::ray`], from where it begins to see `extent`: parallel rays see what lies behind the eye's depth, too.
    pub fn ray_before(&self, ndc: DVec2, aspect: f64, extent: Extent) -> (DVec3, DVec3) {
        let (start, direction) = self.ray(ndc, aspect);
        match self.projection {
            Projection::Perspective => (start, direction),
            Projection::Orthographic => (start + self.depth_range(extent).0 * direction, direction),
        }
    }

    /// Intersection of the ray through `ndc` with the plane through `point` perpendicular to the camera's axis, mm.
    pub fn on_plane_through(&self, point: DVec3, ndc: DVec2, aspect: f64) -> DVec3 {
        let (start, direction) = self.ray(ndc, aspect);
        let depth = (start - point).dot(self.backward());
        // The ray is inclined to the axis by at most half the angle of view: the divisor is far from 0.
        start + direction * (depth / -direction.dot(self.backward()))
    }

    /// Projection of `point` in ndc; `None` behind the eye, which parallel rays do not have.
    pub fn project(&self, point: DVec3, aspect: f64) -> Option<DVec2> {
        let seen = self.view().transform_point3(point);
        let half = 0.5 * self.height_at(point);
        (half > 0.0).then(|| DVec2::new(seen.x / (half * aspect), seen.y / half))
    }

    /// Interpolation to `goal` (0: here, 1: there), by the shorter rotation.
    pub fn towards(&self, goal: &Self, part: f64) -> Self {
        let turn = (goal.yaw - self.yaw + PI).rem_euclid(2.0 * PI) - PI;
        Self {
            target: self.target.lerp(goal.target, part),
            distance: self.distance * (goal.distance / self.distance).powf(part),
            yaw: self.yaw + part * turn,
            pitch: self.pitch + part * (goal.pitch - self.pitch),
            projection: goal.projection,
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
            prop::bool::ANY,
        )
            .prop_map(|(t, distance, yaw, pitch, parallel)| Camera {
                target: DVec3::from(t),
                distance,
                yaw,
                pitch,
                projection: if parallel {
                    Projection::Orthographic
                } else {
                    Projection::Perspective
                },
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

        /// Along a ray every point is seen at its place, and a switch of the projection keeps the plane through the target.
        #[test]
        fn rays_run_through_what_is_seen(camera in cameras(), at in spots(), along in 0.1..500.0f64) {
            let extent = Extent { center: DVec3::ZERO, radius: 100.0 };
            let (start, direction) = camera.ray_before(at, 1.6, extent);
            let seen = camera.project(start + along * direction, 1.6).expect("in front");
            prop_assert!((seen - at).length() < 1e-9, "{seen} {at}");
            let other = match camera.projection {
                Projection::Perspective => Projection::Orthographic,
                Projection::Orthographic => Projection::Perspective,
            };
            let switched = Camera { projection: other, ..camera };
            let spot = camera.on_plane_through(camera.target, at, 1.6);
            prop_assert!((switched.on_plane_through(camera.target, at, 1.6) - spot).length() < 1e-9);
        }

        /// A parallel ray begins before every part, wherever the eye of the perspective view would be.
        #[test]
        fn parallel_rays_begin_before_the_parts(camera in cameras(), at in spots()) {
            let extent = Extent { center: DVec3::ZERO, radius: 100.0 };
            let camera = Camera { projection: Projection::Orthographic, ..camera };
            let (start, _) = camera.ray_before(at, 1.6, extent);
            prop_assert!((start - extent.center).dot(camera.backward()) > extent.radius);
        }

        #[test]
        fn orbiting_about_a_point_keeps_it_where_it_is(camera in cameras(), at in spots(), by in spots()) {
            let pivot = camera.on_plane_through(camera.target + 0.3 * camera.distance * DVec3::X, at, 1.6);
            let Some(before) = camera.project(pivot, 1.6) else { return Ok(()) };
            let mut turned = camera;
            turned.orbit_about(pivot, by);
            let seen = turned.project(pivot, 1.6).expect("in front");
            prop_assert!((seen - before).length() < 1e-8 * (1.0 + before.length()), "{seen} {before}");
            prop_assert_eq!(turned.distance, camera.distance);
        }

        #[test]
        fn looking_from_a_direction_looks_from_there(camera in cameras(), from in prop::array::uniform3(-1.0..1.0f64)) {
            let from = DVec3::from(from);
            prop_assume!(from.length() > 0.1);
            let mut turned = camera;
            turned.look_from(from);
            prop_assert!((turned.backward() - from.normalize()).length() < 1e-9);
        }

        #[test]
        fn axes_are_orthonormal_and_right_handed(camera in cameras()) {
            let (r, u, b) = (camera.right(), camera.up(), camera.backward());
            prop_assert!((r.cross(u) - b).length() < 1e-12 && (u.length() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn each_standard_view_looks_along_its_axis() {
        for (view, from) in [
            (View::Front, -DVec3::Y),
            (View::Back, DVec3::Y),
            (View::Left, -DVec3::X),
            (View::Right, DVec3::X),
            (View::Top, DVec3::Z),
            (View::Bottom, -DVec3::Z),
        ] {
            let (mut named, mut turned) = (Camera::default(), Camera::default());
            named.look(view);
            turned.look_from(from);
            assert!((named.backward() - from).length() < 1e-12, "{view:?}");
            assert!((named.right() - turned.right()).length() < 1e-12, "{view:?}");
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
