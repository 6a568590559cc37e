//! Undo and redo: buttons in the bar at the top, and keys.

use egui::{Button, Key, Modifiers, Pos2, Shape, Stroke, Ui, Vec2};

use super::{control, theme};
use crate::session::{Intent, Session};

/// Width of a button, points.
pub const WIDTH: f32 = 32.0;

/// Takes the keys, except where text is being typed: there they belong to the text.
pub fn keys(ui: &Ui, wanted: &mut Vec<Intent>) {
    if ui.ctx().text_edit_focused() {
        return;
    }
    ui.input_mut(|input| {
        // First, because a key without Shift also fits the one with it.
        let again = input.count_and_consume_key(Modifiers::COMMAND | Modifiers::SHIFT, Key::Z)
            + input.count_and_consume_key(Modifiers::COMMAND, Key::Y);
        let back = input.count_and_consume_key(Modifiers::COMMAND, Key::Z);
        wanted.extend((0..again).map(|_| Intent::Redo));
        wanted.extend((0..back).map(|_| Intent::Undo));
    });
}

/// Draws both buttons.
pub fn show(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>, height: f32) {
    let hint =
        |verb: &str, name: Option<&str>, keys: &str| format!("{verb}: {} ({keys})", name.unwrap_or_default());
    let undo = hint("Undo", session.moves.to_undo(), "Ctrl+Z");
    button(ui, session, wanted, height, Intent::Undo, "Undo", &undo);
    let redo = hint("Redo", session.moves.to_redo(), "Ctrl+Shift+Z or Ctrl+Y");
    button(ui, session, wanted, height, Intent::Redo, "Redo", &redo);
}

fn button(
    ui: &mut Ui,
    session: &Session,
    wanted: &mut Vec<Intent>,
    height: f32,
    intent: Intent,
    name: &str,
    hint: &str,
) {
    let is_possible = crate::session::obstacle(session, &intent).is_none();
    let turned = if intent == Intent::Undo { 1.0 } else { -1.0 };
    let button = Button::new("").min_size(Vec2::new(WIDTH, height));
    let response = control::intent_button(ui, session, wanted, button, intent, hint);
    let ink = theme::of(ui);
    let color = match is_possible {
        true => ink.text_strong,
        false => ink.text_weak.gamma_multiply(0.6),
    };
    arrow(ui, response.rect.center(), turned, color);
    response.accessible_name(name);
}

/// An arrow that turns back, or on where `side` is −1; the fonts have none.
fn arrow(ui: &Ui, middle: Pos2, side: f32, color: egui::Color32) {
    let at = |x: f32, y: f32| middle + Vec2::new(side * x, y);
    let arc = (0..=12).map(|step| {
        // From the tip on the left over the top to the right and back below.
        let angle = std::f32::consts::PI * step as f32 / 12.0;
        at(1.5 + 4.5 * angle.sin(), 0.5 - 4.5 * angle.cos())
    });
    let mut points = vec![at(-4.5, -4.0)];
    points.extend(arc);
    points.push(at(-3.5, 5.0));
    ui.painter().add(Shape::line(points, Stroke::new(1.8, color)));
    let head = vec![at(-7.5, -4.0), at(-3.0, -7.6), at(-3.0, -0.4)];
    ui.painter().add(Shape::convex_polygon(head, color, Stroke::NONE));
}
