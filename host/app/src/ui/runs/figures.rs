//! Figures of the runs as a table, a column for each.

use egui::{Grid, RichText, Role, ScrollArea, Ui, WidgetInfo};

use crate::session::run_table::RUN_FIGURES;
use crate::session::runs::Playback;
use crate::ui::{control, theme};

/// Draws the table.
pub fn show(ui: &mut Ui, playback: &Playback) {
    control::section(ui, "Figures");
    ui.add_space(4.0);
    ScrollArea::horizontal()
        .id_salt("figures of runs")
        .auto_shrink([false, true])
        .show(ui, |ui| {
            Grid::new("figures")
                .striped(true)
                .spacing([14.0, 4.0])
                .show(ui, |ui| {
                    ui.label("");
                    for index in 0..playback.runs().len() {
                        let number = RichText::new((index + 1).to_string()).strong();
                        ui.label(number);
                    }
                    ui.end_row();
                    for figure in &RUN_FIGURES {
                        let name = RichText::new(figure.name).size(12.5);
                        ui.label(name.color(theme::of(ui).text_weak));
                        for (index, shown) in playback.runs().iter().enumerate() {
                            let text = figure.text(&shown.run).unwrap_or_else(|| "–".to_owned());
                            let named = format!("{}, run {}: {text}", figure.name, index + 1);
                            let cell = ui.label(RichText::new(text).monospace().size(12.5));
                            cell.widget_info(|| WidgetInfo::labeled(Role::Label, true, &named));
                        }
                        ui.end_row();
                    }
                });
        });
}
