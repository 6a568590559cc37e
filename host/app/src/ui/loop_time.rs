//! How long the board's loop takes: a histogram of the samples, beside the limit.

use egui::{RichText, Ui};
use egui_plot::{Bar, BarChart, Plot, VLine};

use super::{control, rig, theme};
use crate::session::Session;
use crate::session::history::{Signal, distribution};

/// Height of the plot, points.
const PLOT: f32 = 120.0;
/// A limit is drawn up to this many times the longest sampled loop.
const NEAR: f64 = 3.0;
/// Bars.
const BINS: usize = 40;

/// Draws the section while a rig is connected.
pub fn show(ui: &mut Ui, session: &Session) {
    let Some(connection) = session.connection() else {
        return;
    };
    let found = Signal::named("loop_cost").and_then(|signal| distribution(&session.history, signal, BINS));
    let Some(found) = found else { return };
    let (factor, unit) = rig::cost_scale(connection);
    let factor = f64::from(factor);
    control::section(ui, "Loop time");
    ui.add_space(4.0);
    let [median, most, longest] = found.quantiles.map(|value| factor * value);
    let samples: u32 = found.counts.iter().sum();
    ui.label(
        RichText::new(format!(
            "Half within {median:.1}, 99 % within {most:.1}, longest {longest:.1} {unit}, of {samples} loops that were sampled"
        ))
        .size(12.5),
    );
    let limit = factor * f64::from(connection.capabilities.cost_budget);
    if let Some(statistics) = connection.statistics {
        let all = factor * f64::from(statistics.cost_max);
        let words = match limit > 0.0 {
            true => format!("Longest of all loops {all:.1}, limit {limit:.1} {unit}"),
            false => format!("Longest of all loops {all:.1} {unit}"),
        };
        ui.label(RichText::new(words).size(12.5));
    }
    let ink = theme::of(ui);
    let [low, width] = found.bins.map(|value| factor * value);
    let bars = found.counts.iter().enumerate().map(|(i, &count)| {
        let middle = low + (i as f64 + 0.5) * width;
        Bar::new(middle, f64::from(count)).width(width)
    });
    let chart = BarChart::new("loops", bars.collect()).color(ink.accent);
    let drawn = Plot::new("loop time")
        .height(PLOT)
        .show_x(false)
        .allow_drag(false)
        .allow_zoom(false)
        .allow_scroll(false)
        .allow_boxed_zoom(false)
        .include_x(0.0)
        .show_background(false)
        .x_axis_label(unit)
        .show(ui, |plot| {
            plot.bar_chart(chart);
            // A limit far beyond would leave no room for the bars.
            if limit > 0.0 && limit < NEAR * longest {
                plot.vline(VLine::new("limit", limit).color(ink.fault_text));
            }
        });
    drawn.response.accessible_name("Histogram of the loop time");
}
