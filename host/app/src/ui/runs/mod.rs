//! The panel of the workspace Analyse: recorded runs beside each other, their figures, and what computing them again gives.

mod again;
mod figures;

use egui::{Align, Layout, RichText, ScrollArea, Ui};

pub use self::again::Fields;
use super::plots::line_sample;
use super::{control, theme};
use crate::session::runs::{Playback, RunIntent};
use crate::session::{Intent, Session};

/// Draws the panel.
pub fn show(ui: &mut Ui, session: &Session, fields: &mut Fields, wanted: &mut Vec<Intent>) {
    control::section(ui, "Runs");
    ui.add_space(4.0);
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        for (text, name, intent, hint) in [
            (
                "Open…",
                "Open a run",
                RunIntent::Browse,
                "Show a recorded run alone",
            ),
            (
                "Add…",
                "Add a run",
                RunIntent::BrowseOther,
                "Show another run beside those that are shown, aligned by the first touch",
            ),
            (
                "Figures…",
                "Save the figures",
                RunIntent::SaveTable,
                "Write the figures of all runs to a file of comma-separated values",
            ),
            (
                "Report…",
                "Save a report",
                RunIntent::SaveReport,
                "Write figures and traces to a page (HTML) that needs no other file",
            ),
        ] {
            let button = egui::Button::new(RichText::new(text).size(12.5));
            control::intent_button(ui, session, wanted, button, Intent::Run(intent), hint)
                .accessible_name(name);
        }
    });
    ui.add_space(6.0);
    let Some(playback) = &session.playback else {
        let hint = "No run is open. Record above the plots makes one, of whatever a rig does, the simulated one as well.";
        ui.label(RichText::new(hint).color(theme::of(ui).text_weak));
        return;
    };
    ScrollArea::vertical()
        .id_salt("runs")
        .auto_shrink([false, false])
        .show(ui, |ui| {
            for index in 0..playback.runs().len() {
                run(ui, playback, index, wanted);
            }
            control::divider(ui);
            figures::show(ui, playback);
            control::divider(ui);
            again::show(ui, session, playback, fields, wanted);
        });
}

/// Draws a run of the list: whether it is drawn, how its lines look, its number and name, and a button that closes it.
fn run(ui: &mut Ui, playback: &Playback, index: usize, wanted: &mut Vec<Intent>) {
    let shown = &playback.runs()[index];
    let (name, is_chosen) = (shown.run.name(), index == playback.chosen());
    let act = |wanted: &mut Vec<Intent>, intent| wanted.push(Intent::Run(intent));
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 6.0;
        let mut drawn = shown.drawn || is_chosen;
        let check = ui.add_enabled(!is_chosen, egui::Checkbox::without_text(&mut drawn));
        let check = check.on_hover_text("Draw its traces beside those of the chosen run");
        if check.changed() {
            act(wanted, RunIntent::Draw(index, drawn));
        }
        check.accessible_name(format!("Draw run {}", index + 1));
        line_sample(ui, (!is_chosen).then_some(index));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let close = ui.add(egui::Button::new("×").frame(false));
            let close = close.on_hover_text(format!("Show {name} no more"));
            if close.clicked() {
                act(wanted, RunIntent::Remove(index));
            }
            close.accessible_name(format!("Close run {}", index + 1));
            ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                let text = RichText::new(format!("{}  {name}", index + 1)).color(theme::of(ui).text_strong);
                let row = ui.add(egui::Button::selectable(is_chosen, text).truncate());
                let hint = match shown.moves_parts {
                    true => "Show its time, and the parts as they moved",
                    false => "Show its time; the open file has another collision model, so no part is moved",
                };
                let row = row.on_hover_text(format!("{}\n{hint}", shown.run.path.display()));
                if row.clicked() {
                    act(wanted, RunIntent::Choose(index));
                }
                row.accessible_name(format!("Choose run {}: {name}", index + 1));
            });
        });
    });
}
