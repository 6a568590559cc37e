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
