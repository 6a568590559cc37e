//! The panel at the lower end of a large window: plots and messages, which can be folded to the newest message.

use egui::{Frame, Margin, Panel, RichText, Ui};

use super::{messages, plots, theme};
use crate::session::workspace::Workspace;
use crate::session::{Intent, Session};

/// Name under which it is kept whether the panel is open.
const SECTION: &str = "Plots and messages";

/// Draws the panel. Where runs are analysed it takes half of the window at the start, elsewhere less.
pub fn show(ui: &mut Ui, session: &mut Session, view: &mut plots::View, wanted: &mut Vec<Intent>) {
    let open = session.preferences.open.get(SECTION).copied().unwrap_or(true);
    if !open {
        folded(ui, session, wanted);
        return;
    }
    let height = ui.available_height();
    let (name, usual, most) = match session.workspace {
        Workspace::Analyse => ("runs below", 0.5 * height, 0.8 * height),
        Workspace::Assemble | Workspace::Rig => ("below", 216.0, 420.0),
    };
    let side = |left, right| {
        Frame::NONE.inner_margin(Margin {
            left,
            right,
            ..Margin::ZERO
        })
    };
    Panel::bottom(name)
        .default_size(usual)
        .size_range(140.0..=f32::max(most, 140.0))
        .frame(theme::panel())
        .show(ui, |ui| {
            Panel::right("messages")
                .default_size(400.0)
                .size_range(220.0..=700.0)
                .frame(side(14, 0))
                .show(ui, |ui| messages::show(ui, session, |ui| fold(ui, false, wanted)));
            egui::CentralPanel::default()
                .frame(side(0, 14))
                .show(ui, |ui| plots::show(ui, session, view, wanted));
        });
}

/// Draws the folded panel: a line with the newest message.
fn folded(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
    let tight = theme::panel().inner_margin(Margin::symmetric(8, 4));
    Panel::bottom("folded below")
        .resizable(false)
        .frame(tight)
        .show(ui, |ui| {
            ui.horizontal(|ui| {
                fold(ui, true, wanted);
                if let Some(note) = session.notes.iter().next() {
                    let color = messages::color(theme::of(ui), note.severity);
                    let text = RichText::new(&note.text).size(12.5).color(color);
                    ui.add(egui::Label::new(text).truncate());
                }
            });
        });
}

/// Draws the button that opens or folds the panel.
fn fold(ui: &mut Ui, opens: bool, wanted: &mut Vec<Intent>) {
    let (text, hint) = match opens {
        true => ("Plots and messages", "Show plots and messages"),
        false => ("Fold", "Fold plots and messages to the newest message"),
    };
    let button = egui::Button::new(RichText::new(text).small()).frame(opens);
    if ui.add(button).on_hover_text(hint).clicked() {
        wanted.push(Intent::Fold {
            section: SECTION,
            open: opens,
        });
    }
}
