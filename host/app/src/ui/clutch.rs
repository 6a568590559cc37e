//! The key of the clutch: it is open while the key is down.

use egui::{Key, Ui};

use crate::session::clutch::ClutchIntent;
use crate::session::{Intent, Session, obstacle};

/// Takes the key. A window that loses the focus hears nothing of its release, so the part stays where it is.
pub fn keys(ui: &Ui, session: &Session, wanted: &mut Vec<Intent>) {
    let typing = ui.ctx().text_edit_focused();
    let (is_down, pressed, focused) = ui.input(|input| {
        let plain = input.modifiers.is_none();
        (
            input.key_down(Key::C),
            plain && input.key_pressed(Key::C),
            input.focused,
        )
    });
    let intent = match session.clutched() {
        Some(_) if !focused => ClutchIntent::Leave,
        Some(_) if !is_down => ClutchIntent::Close,
        None if pressed && focused && !typing => ClutchIntent::Open,
        _ => return,
    };
    if obstacle(session, &Intent::Clutch(intent)).is_none() {
        wanted.push(Intent::Clutch(intent));
    }
}
