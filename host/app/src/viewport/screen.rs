//! Places of the world on the screen, and back. Points of the screen are egui's.

use egui::{Pos2, Rect};
use glam::{DVec2, DVec3};

use super::camera::Camera;

/// Normalised device coordinates of a place on the screen.
pub fn ndc(rect: Rect, at: Pos2) -> DVec2 {
    let x = f64::from((at.x - rect.left()) / rect.width());
    let y = f64::from((at.y - rect.top()) / rect.height());
    DVec2::new(2.0 * x - 1.0, 1.0 - 2.0 * y)
}

/// Width over height of the view.
pub fn aspect(rect: Rect) -> f64 {
    f64::from((rect.width() / rect.height().max(1.0)).max(0.01))
}

/// Screen position of normalised device coordinates.
pub fn from_ndc(rect: Rect, at: DVec2) -> Pos2 {
    let (x, y) = (0.5 * (at.x + 1.0), 0.5 * (1.0 - at.y));
    rect.min + egui::vec2(x as f32 * rect.width(), y as f32 * rect.height())
}

/// Screen position of a point of the world; `None` behind the eye.
pub fn on_screen(camera: &Camera, rect: Rect, point: DVec3) -> Option<Pos2> {
    Some(from_ndc(rect, camera.project(point, aspect(rect))?))
}

/// A camera and where its picture is in the window.
#[derive(Clone, Copy, Debug)]
pub struct Sight {
    /// The camera.
    pub camera: Camera,
    /// Place of the picture, points.
    pub rect: Rect,
}

impl Sight {
    /// Screen position of a point of the world.
    pub fn place(&self, point: DVec3) -> Option<Pos2> {
        on_screen(&self.camera, self.rect, point)
    }

    /// The viewing ray at a window position: its start, mm, and a unit vector.
    pub fn ray(&self, at: Pos2) -> (DVec3, DVec3) {
        self.camera.ray(ndc(self.rect, at), aspect(self.rect))
    }

    /// Unit vector from a point of the world towards the viewer.
    pub fn towards_viewer(&self, point: DVec3) -> Option<DVec3> {
        Some(-self.ray(self.place(point)?).1)
    }

    /// Length in the world of one point of the screen at the depth of `point`, mm.
    pub fn mm_per_point(&self, point: DVec3) -> Option<f64> {
        /// Long enough that single-precision positions cost nothing.
        const SPAN: f32 = 100.0;
        let at = self.place(point)?;
        let aspect = aspect(self.rect);
        let on_plane = |at: Pos2| self.camera.on_plane_through(point, ndc(self.rect, at), aspect);
        let mm = on_plane(at).distance(on_plane(at + egui::vec2(0.0, SPAN))) / f64::from(SPAN);
        (mm.is_finite() && mm > 0.0).then_some(mm)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_length_on_screen_is_one_in_the_world() {
        let sight = Sight {
            camera: Camera::default(),
            rect: Rect::from_min_size(Pos2::new(200.0, 100.0), egui::vec2(800.0, 500.0)),
        };
        let point = DVec3::new(3.0, -4.0, 5.0);
        let mm = sight.mm_per_point(point).expect("in front");
        let at = sight.place(point).expect("in front");
        let beside = sight
            .place(point + 40.0 * mm * sight.camera.up())
            .expect("in front");
        // Positions have 24 bits: 1000 points · 2⁻²⁴ = 6e-5.
        assert!((at.distance(beside) - 40.0).abs() < 1e-2, "{at} {beside}");
        let (eye, direction) = sight.ray(at);
        let beyond = (point - eye).cross(direction).length();
        assert!(beyond < 1e-2 * mm, "{beyond}");
        let towards = sight.towards_viewer(point).expect("in front");
        assert!((towards + direction).length() < 1e-12);
    }
}
