//! Traces of the loop's signals: live or held still, over seconds or minutes.

mod bar;
mod line;
mod panel;
mod view;

use egui::{ScrollArea, Ui, Vec2};

pub use self::line::sample as line_sample;
pub use self::view::View;
use crate::session::history::{Quantity, Signal};
use crate::session::{Intent, Session};
use crate::ui::playback;

/// Smallest width at which a plot beside others can be read, points.
const LEAST_WIDTH: f32 = 150.0;
/// Smallest height of a plot under its title, points.
const LEAST_HEIGHT: f32 = 64.0;
/// Space between plots, points.
const SPACE: Vec2 = Vec2::new(26.0, 6.0);

/// Draws the bar and a plot for each quantity that has chosen signals, side by side where there is space.
pub fn show(ui: &mut Ui, session: &Session, view: &mut View, wanted: &mut Vec<Intent>) {
    let history = session.shown_history();
    let run = session.playback.as_ref();
    view.show_run(run.map(|playback| [playback.run().duration_s(), playback.at_s]));
    let ends = history.oldest().zip(history.newest());
    view.follow(ends.map(|(oldest, newest)| [oldest.time_s, newest.time_s]));
    bar::show(ui, session, view, wanted);
    playback::show(ui, session, wanted);
    let panels: Vec<(Quantity, Vec<&Signal>)> = (Quantity::ALL.iter())
        .map(|&quantity| (quantity, view.chosen_of(quantity)))
        .filter(|(_, signals)| !signals.is_empty())
        .collect();
    if panels.is_empty() {
        ui.label("Choose signals to draw with Signals.");
        return;
    }
    let size = ui.available_size();
    let across = ((size.x + SPACE.x) / (LEAST_WIDTH + SPACE.x)) as usize;
    // A few plots stand beside each other or below each other, not in a ragged mixture.
    let columns = if across >= panels.len() {
        panels.len()
    } else {
        (across / 2).clamp(1, panels.len())
    };
    let rows = panels.len().div_ceil(columns);
    let width = (size.x - SPACE.x * (columns - 1) as f32) / columns as f32;
    let height = (size.y - SPACE.y * (rows - 1) as f32) / rows as f32;
    let each = Vec2::new(width.max(20.0), height.max(LEAST_HEIGHT));
    let mut pointed = None;
    ScrollArea::vertical()
        .id_salt("plots")
        // The wheel over a plot zooms.
        .scroll_source(egui::scroll_area::ScrollSource::SCROLL_BAR)
        .show(ui, |ui| {
            ui.spacing_mut().item_spacing = SPACE;
            for row in panels.chunks(columns) {
                ui.horizontal(|ui| {
                    for (quantity, signals) in row {
                        ui.allocate_ui(each, |ui| {
                            ui.set_min_size(each);
                            ui.set_max_size(each);
                            ui.vertical(|ui| {
                                panel::show(ui, session, view, *quantity, signals, &mut pointed)
                            });
                        });
                    }
                });
            }
        });
    view.point(pointed);
}
