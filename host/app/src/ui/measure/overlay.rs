//! Marks of the measuring tool over the parts: what is picked, what a click would pick, and the line between two with its length.

use egui::{Align2, Color32, CornerRadius, FontId, Painter, Pos2, Rect, Shape, Stroke, Ui, Vec2};
use glam::DVec3;

use super::words;
use crate::session::document::Document;
use crate::ui::theme;
use crate::viewport::camera::Camera;
use crate::viewport::gesture::Viewpoint;
use crate::viewport::outline::Outline;
use crate::viewport::screen::on_screen;

/// Draws the marks.
pub fn show(ui: &Ui, rect: Rect, document: &Document, view: &Viewpoint) {
    let ink = theme::of(ui);
    let painter = ui.painter_at(rect);
    let marks = Marks {
        painter: &painter,
        rect,
        camera: &view.camera,
        ground: ink.ground,
    };
    let (picked, hover) = view.measure.outlines(document);
    if let Some(hover) = hover {
        marks.outline(&hover, ink.text_strong, 1.5);
    }
    for outline in picked {
        marks.outline(&outline, ink.accent, 2.5);
    }
    let measured = view.measure.measured();
    let label = match (&measured.between, measured.about.as_slice()) {
        (Some(found), _) => {
            let [a, b] = found.least.ends;
            marks.line(&[a, b], Stroke::new(2.0, ink.held), false);
            for end in [a, b] {
                marks.dot(end, ink.held);
            }
            Some((a.midpoint(b), words::mm(found.least.distance_mm)))
        }
        (None, [about]) => {
            let main = words::one(about).into_iter().next();
            let at = measured.places.first();
            at.zip(main).map(|(at, line)| (*at, line.value))
        }
        _ => None,
    };
    if let Some((at, text)) = label {
        marks.label(at, text, ink);
    }
}

struct Marks<'a> {
    painter: &'a Painter,
    rect: Rect,
    camera: &'a Camera,
    ground: Color32,
}

impl Marks<'_> {
    fn seen(&self, point: DVec3) -> Option<Pos2> {
        on_screen(self.camera, self.rect, point)
    }

    fn outline(&self, outline: &Outline, color: Color32, width: f32) {
        for line in &outline.lines {
            self.line(line, Stroke::new(width, color), outline.dashed);
        }
        if let Some(point) = outline.point {
            self.dot(point, color);
        }
    }

    /// A line with a rim in the ground's colour, so that it stands out from the parts' edges on any of their colours.
    fn line(&self, points: &[DVec3], stroke: Stroke, dashed: bool) {
        // A point behind the eye has no place in the picture.
        let seen: Option<Vec<Pos2>> = points.iter().map(|&point| self.seen(point)).collect();
        let Some(seen) = seen else { return };
        let rim = Stroke::new(stroke.width + 2.5, self.ground.gamma_multiply(0.8));
        self.painter.add(Shape::line(seen.clone(), rim));
        if dashed {
            self.painter.extend(Shape::dashed_line(&seen, stroke, 9.0, 5.0));
        } else {
            self.painter.add(Shape::line(seen, stroke));
        }
    }

    fn dot(&self, point: DVec3, color: Color32) {
        if let Some(at) = self.seen(point) {
            self.painter.circle(at, 4.5, color, Stroke::new(1.5, self.ground));
        }
    }

    fn label(&self, at: DVec3, text: String, ink: &theme::Palette) {
        let Some(at) = self.seen(at) else { return };
        let galley = self
            .painter
            .layout_no_wrap(text, FontId::proportional(13.5), ink.text_strong);
        let size = galley.size() + Vec2::new(14.0, 8.0);
        let room = self.rect.shrink(4.0);
        let place = Align2::LEFT_BOTTOM.anchor_size(at + Vec2::new(10.0, -8.0), size);
        let into =
            |low: f32, high: f32, least: f32, most: f32| (least - low).max(0.0) - (high - most).max(0.0);
        let shift = Vec2::new(
            into(place.left(), place.right(), room.left(), room.right()),
            into(place.top(), place.bottom(), room.top(), room.bottom()),
        );
        let place = place.translate(shift);
        self.painter.rect(
            place,
            CornerRadius::same(5),
            ink.card,
            Stroke::new(1.0, ink.line),
            egui::StrokeKind::Inside,
        );
        self.painter
            .galley(place.min + Vec2::new(7.0, 4.0), galley, ink.text_strong);
    }
}
