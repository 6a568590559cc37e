//! The list of messages, newest first.

use egui::{Color32, RichText, ScrollArea, Ui, Vec2};

use super::{control, theme};
use crate::session::Session;
use crate::session::notes::{Note, Severity};

/// Name under which the filter is kept.
const FILTER: &str = "Warnings and errors alone";

/// Colour of a severity.
pub fn color(palette: &theme::Palette, severity: Severity) -> Color32 {
    match severity {
        Severity::Info => palette.text_weak,
        Severity::Good => palette.good,
        Severity::Warning => palette.warning,
        Severity::Error => theme::STOP_HOVER,
    }
}

/// Draws the list; `beside` is drawn at the right end of its heading.
pub fn show(ui: &mut Ui, session: &mut Session, beside: impl FnOnce(&mut Ui)) {
    ui.horizontal(|ui| {
        control::section(ui, "Messages");
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            beside(ui);
            filter(ui, session);
            if session.notes.iter().len() > 0 {
                let button = egui::Button::new(RichText::new("Clear").small().color(theme::of(ui).text_weak))
                    .frame(false);
                if ui.add(button).on_hover_text("Clear all messages").clicked() {
                    session.notes.clear();
                }
            }
        });
    });
    ScrollArea::vertical()
        .id_salt("messages")
        .auto_shrink([false, false])
        .show(ui, |ui| {
            ui.spacing_mut().item_spacing.y = 5.0;
            let least = match only_warnings(session) {
                true => Severity::Warning,
                false => Severity::Info,
            };
            for note in session.notes.iter().filter(|note| note.severity >= least) {
                line(ui, note);
            }
        });
}

fn only_warnings(session: &Session) -> bool {
    session.preferences.open.get(FILTER).copied().unwrap_or(false)
}

/// Draws the switch that leaves out messages for the record.
fn filter(ui: &mut Ui, session: &mut Session) {
    let on = only_warnings(session);
    let text = RichText::new("Warnings").small().color(theme::of(ui).text_weak);
    let button = ui.add(egui::Button::selectable(on, text));
    if button.on_hover_text("Show warnings and errors alone").clicked() {
        session.preferences.open.insert(FILTER.to_owned(), !on);
    }
}

fn line(ui: &mut Ui, note: &Note) {
    ui.horizontal_top(|ui| {
        let (rect, _) = ui.allocate_exact_size(Vec2::new(8.0, 16.0), egui::Sense::hover());
        ui.painter()
            .circle_filled(rect.center(), 3.5, color(theme::of(ui), note.severity));
        ui.vertical(|ui| {
            let ink = match note.severity {
                Severity::Error => theme::of(ui).fault_text,
                Severity::Info => theme::of(ui).text,
                _ => theme::of(ui).text_strong,
            };
            let mut text = note.text.clone();
            if note.times > 1 {
                text += &format!("  (×{})", note.times);
            }
            let seconds = note.at.as_secs_f64();
            ui.add(
                egui::Label::new(RichText::new(text).size(12.5).color(ink))
                    .wrap()
                    .selectable(true),
            )
            .on_hover_text(format!("{seconds:.1} s after the start"));
        });
    });
}
