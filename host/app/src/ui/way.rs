//! The way of a part to its place, drawn over the view: a line with an arrowhead at the place; of a fit that is shown, or of the next step of the sequence.

use egui::{Color32, Painter, Pos2, Rect, Shape, Stroke, Ui, Vec2};
use glam::DVec3;

use super::theme;
use crate::session::Session;
use crate::viewport::gesture::{Viewpoint, on_screen};

/// Length of the arrowhead, and half its width over its length.
const HEAD: (f32, f32) = (11.0, 0.45);

/// Places of points in the view; `None` where one is behind the eye, or there is no line.
pub fn seen(points: &[DVec3], rect: Rect, view: &Viewpoint) -> Option<Vec<Pos2>> {
    let seen: Option<Vec<Pos2>> = (points.iter())
        .map(|&point| on_screen(&view.camera, rect, point))
        .collect();
    seen.filter(|seen| seen.len() > 1)
}

/// Draws a way whose points are [`seen`].
pub fn draw(painter: &Painter, seen: &[Pos2], width: f32, color: Color32) {
    painter.add(Shape::line(seen.to_vec(), Stroke::new(width, color)));
    let Some(last) = seen.last() else { return };
    let before = seen.iter().rev().find(|point| point.distance(*last) > 8.0);
    if let Some(before) = before {
        let along = (*last - *before).normalized() * HEAD.0;
        let side = Vec2::new(-along.y, along.x) * HEAD.1;
        let head = vec![*last, *last - along + side, *last - along - side];
        painter.add(Shape::convex_polygon(head, color, Stroke::NONE));
    }
}

/// Draws the way of what the next step puts on, where the parts are at a step and no fit is shown.
pub fn of_next_step(ui: &Ui, rect: Rect, session: &Session, view: &Viewpoint) {
    let fit = session.fitting.as_ref().and_then(|fitting| fitting.offer());
    if let (None, Some(points)) = (fit, session.next_way())
        && let Some(seen) = seen(&points, rect, view)
    {
        draw(&ui.painter_at(rect), &seen, 1.6, theme::of(ui).accent);
    }
}
