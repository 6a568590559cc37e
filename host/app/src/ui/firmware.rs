//! The firmware of the board: the file, and writing it through a debug probe.

use egui::{RichText, Ui, Vec2};

use super::{control, theme};
use crate::session::flashing::FlashIntent;
use crate::session::{Intent, Session};

/// Draws the section.
pub fn show(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
    let ink = theme::of(ui);
    control::section(ui, "Firmware");
    ui.add_space(4.0);
    match session.flashing.chosen() {
        None => ui.label(
            RichText::new("Needed for a new board, and when program and firmware do not match.")
                .color(ink.text_weak),
        ),
        Some(Ok(words)) => ui.label(words),
        Some(Err(why)) => ui.label(RichText::new(why).color(ink.warning)),
    };
    if let Some(line) = session.flashing.writing() {
        ui.label(RichText::new(format!("{line}…")).color(ink.text_weak));
    }
    ui.add_space(4.0);
    ui.horizontal_wrapped(|ui| {
        let mut act = |ui: &mut Ui, text: &str, intent: FlashIntent, hint: &str| {
            let button = egui::Button::new(text).min_size(Vec2::new(0.0, 28.0));
            control::intent_button(ui, session, wanted, button, Intent::Flash(intent), hint);
        };
        act(
            ui,
            "Choose firmware…",
            FlashIntent::Browse,
            "A file that `cargo xtask firmware` builds",
        );
        if session.flashing.writing().is_some() {
            let hint = "The board does not start until firmware is written";
            act(ui, "End writing", FlashIntent::End, hint);
        } else {
            let hint = "Through the board's debug probe, by the program probe-rs; motors stay off, the description stays";
            act(ui, "Write firmware", FlashIntent::Write, hint);
        }
    });
}
