//! The STOP button: large, red, always there, always enabled; also Space and Esc.

use egui::{
    Color32, CornerRadius, Event, FontId, Key, Modifiers, Rect, Response, Role, Sense, Stroke, Ui, Vec2,
    WidgetInfo,
};

use super::theme;
use crate::session::{Intent, Session};

/// Draws it. A press counts, not a click: it acts when the button goes down.
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

/// The events themselves are looked at: a press that is over within one picture counts, and nothing that lies over the button,
/// such as the backdrop of a dialog, can take it.
fn pressed_on(ui: &Ui, rect: Rect) -> bool {
    let is_press = |event: &Event| match event {
        Event::PointerButton { pos, pressed, .. } => *pressed && rect.contains(*pos),
        _ => false,
    };
    ui.input(|i| i.events.iter().any(is_press))
}

/// The click that follows a press is not a second wish; one by keyboard or screen reader has no press.
fn by_pointer(ui: &Ui) -> bool {
    ui.input(|i| {
        let button = |event: &Event| matches!(event, Event::PointerButton { .. });
        i.events.iter().any(button)
    })
}

/// Space and Esc, taken before any other control sees them. A text field keeps its Space.
pub fn keys(ctx: &egui::Context, session: &Session, wanted: &mut Vec<Intent>) {
    let typing = ctx.text_edit_focused();
    let connected = session.connection().is_some();
    let pressed = ctx.input_mut(|input| {
        // Without a rig Esc closes menus as everywhere else.
        (connected && input.consume_key(Modifiers::NONE, Key::Escape))
            | (!typing && input.consume_key(Modifiers::NONE, Key::Space))
    });
    if pressed {
        wanted.push(Intent::Stop);
    }
}
