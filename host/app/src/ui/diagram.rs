//! A plane with axes: a grid with numbers, and places in it as points of the screen.

use egui::{Align2, Color32, FontId, Painter, Pos2, Rect, Shape, Stroke, Vec2};
use glam::DVec2;

use super::scale;
use super::theme::Palette;

/// Space for the numbers at the left and below, points.
const NUMBERS: Vec2 = Vec2::new(38.0, 17.0);
/// Least distance of two grid lines, points.
const APART: f64 = 34.0;
/// Size of the numbers, points.
const SMALL: f32 = 10.5;

/// Where a part of the plane is on the screen.
#[derive(Clone, Copy, Debug)]
pub struct Diagram {
    /// The plane's part of the screen, without the numbers.
    pub rect: Rect,
    low: DVec2,
    /// Points a unit.
    scale: DVec2,
}

impl Diagram {
    /// The part of the plane between two corners, as large as it goes into `rect`. `equal`: both axes have the same scale, and the part is centred.
    pub fn new(rect: Rect, [low, high]: [DVec2; 2], equal: bool) -> Self {
        let rect = Rect::from_min_max(
            Pos2::new(rect.left() + NUMBERS.x, rect.top() + 4.0),
            Pos2::new(rect.right() - 4.0, rect.bottom() - NUMBERS.y),
        );
        let size = DVec2::new(f64::from(rect.width()), f64::from(rect.height())).max(DVec2::ONE);
        let extent = (high - low).max(DVec2::splat(1e-9));
        let mut scale = size / extent;
        let mut low = low;
        if equal {
            scale = DVec2::splat(scale.min_element());
            low = 0.5 * (low + high) - 0.5 * size / scale;
        }
        Self { rect, low, scale }
    }

    /// A place on the screen.
    pub fn at(&self, place: DVec2) -> Pos2 {
        let from = (place - self.low) * self.scale;
        Pos2::new(
            self.rect.left() + from.x as f32,
            self.rect.bottom() - from.y as f32,
        )
    }

    /// Draws the ground, and a grid with numbers.
    pub fn grid(&self, painter: &Painter, ink: &Palette) {
        painter.rect_filled(self.rect, 4.0, ink.card);
        let size = DVec2::new(f64::from(self.rect.width()), f64::from(self.rect.height()));
        let high = self.low + size / self.scale;
        let font = FontId::proportional(SMALL);
        let steps = [self.scale.x, self.scale.y].map(|scale| scale::nice_above(APART / scale));
        let line = Stroke::new(1.0, ink.line);
        for mark in marks(self.low.x, high.x, steps[0]) {
            let x = self.at(DVec2::new(mark, self.low.y)).x;
            painter.vline(x, self.rect.y_range(), line);
            let text = scale::number(mark, steps[0]);
            let place = Pos2::new(x, self.rect.bottom() + 2.0);
            painter.text(place, Align2::CENTER_TOP, text, font.clone(), ink.text_weak);
        }
        for mark in marks(self.low.y, high.y, steps[1]) {
            let y = self.at(DVec2::new(self.low.x, mark)).y;
            painter.hline(self.rect.x_range(), y, line);
            let text = scale::number(mark, steps[1]);
            let place = Pos2::new(self.rect.left() - 4.0, y);
            painter.text(place, Align2::RIGHT_CENTER, text, font.clone(), ink.text_weak);
        }
    }

    /// Draws a line through places.
    pub fn line(&self, painter: &Painter, places: &[DVec2], stroke: Stroke) {
        let points: Vec<Pos2> = places.iter().map(|place| self.at(*place)).collect();
        painter.add(Shape::line(points, stroke));
    }

    /// Draws a dashed line through places.
    pub fn dashed(&self, painter: &Painter, places: &[DVec2], stroke: Stroke) {
        let points: Vec<Pos2> = places.iter().map(|place| self.at(*place)).collect();
        painter.extend(Shape::dashed_line(&points, stroke, 5.0, 4.0));
    }

    /// Draws a small text beside a place, on a ground that separates it from lines.
    pub fn label(
        &self,
        painter: &Painter,
        place: Pos2,
        align: Align2,
        text: &str,
        ink: &Palette,
        color: Color32,
    ) {
        let galley = painter.layout_no_wrap(text.to_owned(), FontId::proportional(SMALL), color);
        let mut at = align.anchor_size(place, galley.size());
        // Within the plane.
        let inner = self.rect.shrink(2.0);
        let (mut by, low, high) = (Vec2::ZERO, inner.min - at.min, inner.max - at.max);
        by.x = 0.0f32.min(high.x).max(low.x);
        by.y = 0.0f32.min(high.y).max(low.y);
        at = at.translate(by);
        painter.rect_filled(at.expand2(Vec2::new(2.0, 0.0)), 3.0, ink.card.gamma_multiply(0.8));
        painter.galley(at.min, galley, color);
    }
}

/// Multiples of a step between two values.
fn marks(low: f64, high: f64, step: f64) -> impl Iterator<Item = f64> {
    let first = (low / step - 1e-9).ceil();
    let count = ((high / step + 1e-9).floor() - first).clamp(-1.0, 60.0) as i32 + 1;
    (0..count).map(move |number| (first + f64::from(number)) * step)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_lie_within_the_plane() {
        let found: Vec<f64> = marks(-12.0, 21.0, 10.0).collect();
        assert_eq!(found, [-10.0, 0.0, 10.0, 20.0]);
        assert_eq!(marks(1.0, 2.0, 10.0).count(), 0);
        assert_eq!(marks(0.0, 5.0, 5.0).count(), 2);
    }

    #[test]
    fn equal_axes_keep_shapes_and_show_everything() {
        let rect = Rect::from_min_size(Pos2::ZERO, Vec2::new(300.0, 200.0));
        let diagram = Diagram::new(rect, [DVec2::new(-50.0, 0.0), DVec2::new(50.0, 10.0)], true);
        let [a, b] = [DVec2::new(-50.0, 0.0), DVec2::new(50.0, 10.0)].map(|place| diagram.at(place));
        assert!(((b.x - a.x) / (a.y - b.y) - 10.0).abs() < 1e-3);
        assert!(diagram.rect.contains(a) && diagram.rect.expand(0.01).contains(b));
    }
}
