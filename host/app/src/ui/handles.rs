//! The handles of the selected part over the 3D view, and beside them how far one has been dragged.

use egui::{
    Align2, Color32, CornerRadius, FontId, Id, Pos2, Rect, Role, Sense, Shape, Stroke, StrokeKind, Ui, Vec2,
    WidgetInfo,
};

use super::theme;
use crate::session::Session;
use crate::viewport::gesture::Viewpoint;
use crate::viewport::gizmo::{Drawn, Handle};
use crate::viewport::screen::Sight;

/// Width of a line, and of one under the pointer, points.
const WIDTH: (f32, f32) = (2.2, 3.6);
/// Length and half the width of an arrow's head, points.
const HEAD: (f32, f32) = (12.0, 5.0);
/// Side of the place at which a handle is named, points.
const GRIP: f32 = 18.0;
/// From the pointer to the words beside it.
const BESIDE: Vec2 = Vec2::new(18.0, 20.0);
/// What every handle does.
const KEYS: &str = "Ctrl: steps of 1 mm or 5°, with Shift of 0.1 mm or 0.5°. Esc takes it back";

/// Draws the handles.
pub fn show(ui: &mut Ui, rect: Rect, session: &Session, view: &Viewpoint) {
    let sight = Sight {
        camera: view.camera,
        rect,
    };
    let Some(gizmo) = view.handles.gizmo(session, &sight) else {
        return;
    };
    let ink = theme::of(ui);
    let painter = ui.painter_at(rect);
    let held = view.handles.hold().map(|hold| hold.handle);
    // What lies over others is drawn last.
    for handle in Handle::ALL.into_iter().rev() {
        let (Some(drawn), true) = (
            gizmo.drawn(handle, &sight),
            held.is_none_or(|held| held == handle),
        ) else {
            continue;
        };
        let color = match handle {
            Handle::Axis(i) | Handle::Plane(i) | Handle::Ring(i) => ink.axes[i],
            Handle::Middle => ink.text,
        };
        let (width, color) = match view.handles.over() == Some(handle) {
            true => (WIDTH.1, ink.text_strong),
            false => (WIDTH.0, color),
        };
        painter.extend(shapes(&drawn, width + 2.4, ink.ground));
        painter.extend(shapes(&drawn, width, color));
        if let (Drawn::Arrow([from, tip]), Handle::Axis(i)) = (&drawn, handle) {
            let beyond = *tip + 15.0 * (*tip - *from).normalized();
            let name = view.handles.axes.directions()[i];
            letter(ui, rect, beyond, name, color);
        }
    }
    if held.is_none() {
        grips(ui, rect, session, view);
    }
    amount(ui, rect, session, view);
}

/// A handle with lines of this width.
fn shapes(drawn: &Drawn, width: f32, color: Color32) -> Vec<Shape> {
    let stroke = Stroke::new(width, color);
    match drawn {
        Drawn::Arrow([from, tip]) => {
            let along = (*tip - *from).normalized();
            let side = Vec2::new(-along.y, along.x);
            let foot = *tip - HEAD.0 * along;
            // As much larger on every side as the line is wider.
            let more = 0.5 * (width - WIDTH.0).max(0.0);
            let head = vec![
                *tip + 2.0 * more * along,
                foot + (HEAD.1 + more) * side - more * along,
                foot - (HEAD.1 + more) * side - more * along,
            ];
            vec![
                Shape::line_segment([*from, foot], stroke),
                Shape::convex_polygon(head, color, Stroke::NONE),
            ]
        }
        Drawn::Square(corners) => {
            let fill = color.gamma_multiply(0.35);
            vec![Shape::convex_polygon(corners.to_vec(), fill, stroke)]
        }
        Drawn::Ring(points) => vec![Shape::line(points.clone(), stroke)],
        Drawn::Dot(at) => vec![Shape::circle_filled(*at, 3.6 + 0.6 * width, color)],
    }
}

fn letter(ui: &Ui, rect: Rect, at: Pos2, name: &str, color: Color32) {
    let painter = ui.painter_at(rect);
    let galley = painter.layout_no_wrap(name.to_owned(), FontId::proportional(12.5), color);
    let place = Align2::CENTER_CENTER.anchor_size(at, galley.size());
    let ground = theme::of(ui).ground.gamma_multiply(0.75);
    painter.rect_filled(place.expand2(Vec2::new(3.0, 0.0)), CornerRadius::same(4), ground);
    painter.galley(place.min, galley, color);
}

/// Names the handles where they are taken hold of.
fn grips(ui: &Ui, rect: Rect, session: &Session, view: &Viewpoint) {
    for (handle, at) in view.handles.grips(session, &view.camera, rect) {
        let place = Rect::from_center_size(at, Vec2::splat(GRIP));
        if !rect.contains_rect(place) {
            continue;
        }
        let name = handle.name(view.handles.axes);
        let response = ui.interact(place, Id::unique("handle").with(&name), Sense::hover());
        response.widget_info(|| WidgetInfo::labeled(Role::Image, true, &name));
        response.on_hover_text(format!("{name}. {KEYS}"));
    }
}

/// Says beside the pointer how far the handle has been dragged.
fn amount(ui: &Ui, rect: Rect, session: &Session, view: &Viewpoint) {
    let (Some(hold), Some(pointer)) = (view.handles.hold(), ui.input(|i| i.pointer.latest_pos())) else {
        return;
    };
    let (Some(document), Some(part)) = (&session.document, session.moves.dragged()) else {
        return;
    };
    let Some(pose) = document.poses.get(part) else {
        return;
    };
    let (ink, mut words) = (theme::of(ui), hold.words(pose));
    if let Some(other) = session.moves.stopped_by() {
        words += &format!(", stopped by {}", document.moving_name(other));
    }
    let painter = ui.painter_at(rect);
    let galley = painter.layout_no_wrap(words.clone(), FontId::proportional(14.0), ink.text_strong);
    let size = galley.size() + Vec2::new(16.0, 8.0);
    let most = (rect.max - size - Vec2::splat(4.0)).max(rect.min);
    let place = Rect::from_min_size((pointer + BESIDE).clamp(rect.min, most), size);
    painter.rect(
        place,
        CornerRadius::same(6),
        ink.card,
        Stroke::new(1.0, ink.line),
        StrokeKind::Inside,
    );
    painter.galley(place.min + Vec2::new(8.0, 4.0), galley, ink.text_strong);
    let response = ui.interact(place, Id::unique("dragged by"), Sense::hover());
    response.widget_info(|| WidgetInfo::labeled(Role::Label, true, &words));
}
