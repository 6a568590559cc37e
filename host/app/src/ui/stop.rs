//! The STOP button: large, red, always visible and always enabled; Space and Esc do the same.

use egui::{
    Color32, CornerRadius, Event, FontId, Key, Modifiers, Rect, Response, Role, Sense, Stroke, Ui, Vec2,
    WidgetInfo,
};

use super::theme;
use crate::session::{Intent, Session};

/// Draws the button. It acts when pressed, not when released.
pub fn button(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>, size: Vec2) -> Response {
    let (rect, response) = ui.allocate_exact_size(size, Sense::click());
    let down = response.is_pointer_button_down_on();
    let fill = match (down, response.hovered()) {
        (true, _) => Color32::from_rgb(170, 30, 34),
        (false, true) => theme::STOP_HOVER,
        (false, false) => theme::STOP,
    };
    let painter = ui.painter();
    painter.rect(
        rect,
        CornerRadius::same(8),
        fill,
        Stroke::new(1.0, Color32::from_rgb(255, 140, 134)),
        egui::StrokeKind::Inside,
    );
    let sign = Rect::from_center_size(
        rect.left_center() + Vec2::new(0.19 * size.x, 0.0),
        Vec2::splat(13.0),
    );
    painter.rect_filled(sign, CornerRadius::same(2), Color32::WHITE);
    painter.text(
        rect.center() + Vec2::new(14.0, 0.0),
        egui::Align2::CENTER_CENTER,
        "STOP",
        FontId::proportional(21.0),
        Color32::WHITE,
    );
    response.widget_info(|| WidgetInfo::labeled(Role::Button, true, "STOP"));
    if pressed_on(ui, rect) || (response.clicked() && !by_pointer(ui)) {
        wanted.push(Intent::Stop);
    }
    let hint = if session.connection().is_some() {
        "Motors off, now (Space or Esc)"
    } else {
        "Motors off, now (Space or Esc). No rig is connected"
    };
    response.on_hover_text(hint)
}

/// Whether a press on `rect` is among the input events. A press and release within one frame counts, and nothing drawn over the button,
/// such as a dialog's backdrop, can intercept it.
fn pressed_on(ui: &Ui, rect: Rect) -> bool {
    let is_press = |event: &Event| match event {
        Event::PointerButton { pos, pressed, .. } => *pressed && rect.contains(*pos),
        _ => false,
    };
    ui.input(|i| i.events.iter().any(is_press))
}

/// Whether the click comes from a pointer, whose press has already acted. A click by keyboard or screen reader has no press.
fn by_pointer(ui: &Ui) -> bool {
    ui.input(|i| {
        let button = |event: &Event| matches!(event, Event::PointerButton { .. });
        i.events.iter().any(button)
    })
}

/// Handles Space and Esc before any other control does. A text field keeps its Space.
pub fn keys(ctx: &egui::Context, session: &Session, wanted: &mut Vec<Intent>) {
    let typing = ctx.text_edit_focused();
    let connected = session.connection().is_some();
    let pressed = ctx.input_mut(|input| {
        // Without a rig Esc closes menus as usual.
        (connected && input.consume_key(Modifiers::NONE, Key::Escape))
            | (!typing && input.consume_key(Modifiers::NONE, Key::Space))
    });
    if pressed {
        wanted.push(Intent::Stop);
    }
}
