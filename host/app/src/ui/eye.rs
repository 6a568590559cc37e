//! The eye of a line in the list of parts: hides a part or shows it.

use egui::{Id, Pos2, Rect, Role, Sense, Shape, Stroke, Ui, Vec2, WidgetInfo};

use super::theme;
use crate::session::{Intent, Session, obstacle};

/// Width of the eye's place, points.
pub const WIDTH: f32 = 24.0;

/// Draws the eye at the right end of a line of `parts`: crossed out where all are hidden, else only while the pointer is on the `line` or the eye has the focus.
pub fn show(
    ui: &mut Ui,
    session: &Session,
    line: Rect,
    over: bool,
    (name, parts): (&str, &[usize]),
    wanted: &mut Vec<Intent>,
) {
    let Some(document) = &session.document else { return };
    let hidden = parts.iter().all(|&part| document.is_hidden(part));
    let size = Vec2::new(WIDTH, line.height());
    let place = Rect::from_min_size(line.right_top() - Vec2::new(WIDTH, 0.0), size);
    let intents = parts.iter().map(|&part| Intent::Hide(part, !hidden));
    let why = intents.clone().find_map(|intent| obstacle(session, &intent));
    let response = ui.interact(place, Id::unique("eye").with(parts), Sense::click());
    let verb = if hidden { "Show" } else { "Hide" };
    response.widget_info(|| WidgetInfo::labeled(Role::Button, why.is_none(), format!("{verb} {name}")));
    if response.clicked() {
        wanted.extend(intents);
    }
    if hidden || over || response.hovered() || response.has_focus() {
        let ink = theme::of(ui);
        let color = match response.hovered() {
            true => ink.text_strong,
            false => ink.text_weak,
        };
        draw(ui, place.center(), Stroke::new(1.3, color), hidden);
    }
    response.on_hover_text(why.unwrap_or_else(|| format!("{verb} (H); I shows it alone, Shift+H all")));
}

fn draw(ui: &Ui, at: Pos2, stroke: Stroke, crossed: bool) {
    let lid = |side: f32| {
        let points = (0..=8).map(|i| {
            let x = -1.0 + 0.25 * i as f32;
            at + Vec2::new(6.5 * x, side * 4.0 * (1.0 - x * x))
        });
        Shape::line(points.collect(), stroke)
    };
    ui.painter().extend([lid(-1.0), lid(1.0)]);
    ui.painter().circle_stroke(at, 1.8, stroke);
    if crossed {
        let end = Vec2::new(5.0, 5.0);
        ui.painter().line_segment([at - end, at + end], stroke);
    }
}
