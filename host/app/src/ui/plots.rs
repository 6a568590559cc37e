//! Live traces of force, torque and loop time over the last seconds.

use egui::{Color32, RichText, Ui, Vec2b};
use egui_plot::{HLine, Line, Plot, PlotPoints};

use super::{rig, theme};
use crate::session::Session;
use crate::session::history::{SPAN_S, Sample};

/// Smallest width at which a plot beside others can be read, points.
const LEAST_WIDTH: f32 = 150.0;

struct Trace {
    name: &'static str,
    color: Color32,
    of: fn(&Sample) -> f32,
    /// Factor from the sample's unit to the unit shown.
    factor: f32,
}

impl Trace {
    fn value(&self, sample: &Sample) -> f32 {
        self.factor * (self.of)(sample)
    }
}

/// One plot.
struct Panel<'a> {
    title: &'static str,
    unit: &'a str,
    /// Smallest upper end of the scale.
    least: f64,
    traces: &'a [Trace],
    /// Upper limit drawn as a line, if there is one.
    budget: Option<f32>,
}

/// Draws the three plots, side by side where there is space.
pub fn show(ui: &mut Ui, session: &Session) {
    let (factor, cost_unit) = session.connection().map_or((1.0, ""), rig::cost_scale);
    let budget = (session.connection().map(|c| c.capabilities.cost_budget))
        .filter(|&budget| budget > 0)
        .map(|budget| budget as f32 * factor);
    let trace = |name, color, of, factor| Trace {
        name,
        color,
        of,
        factor,
    };
    let force = [
        trace("contacts", theme::of(ui).contact, |s| s.contact_n, 1.0),
        trace("handle", theme::of(ui).accent, |s| s.handle_n, 1.0),
    ];
    let torque = [
        trace("contacts", theme::of(ui).contact, |s| s.contact_nm, 1e3),
        trace("handle", theme::of(ui).accent, |s| s.handle_nm, 1e3),
    ];
    let cost = [trace("loop", theme::of(ui).good, |s| s.cost, factor)];
    let panel = |title, unit, least, traces, budget| Panel {
        title,
        unit,
        least,
        traces,
        budget,
    };
    let panels = [
        panel("Force", "N", 1.0, &force[..], None),
        panel("Torque", "mN·m", 10.0, &torque[..], None),
        panel("Loop time", cost_unit, 10.0, &cost[..], budget),
    ];
    if ui.available_width() < 3.0 * LEAST_WIDTH {
        // Stacked where they would be too narrow side by side.
        let high = ((ui.available_height() - 12.0) / 3.0).max(20.0);
        for panel in &panels {
            let size = egui::Vec2::new(ui.available_width(), high);
            ui.allocate_ui(size, |ui| plot(ui, session, panel));
        }
        return;
    }
    ui.spacing_mut().item_spacing.x = 26.0;
    ui.columns_const(|columns: &mut [Ui; 3]| {
        for (ui, panel) in columns.iter_mut().zip(&panels) {
            plot(ui, session, panel);
        }
    });
}

fn plot(ui: &mut Ui, session: &Session, panel: &Panel<'_>) {
    let &Panel {
        title,
        unit,
        least,
        traces,
        budget,
    } = panel;
    let history = &session.history;
    ui.spacing_mut().item_spacing.x = 7.0;
    // Narrow plots drop the names first; colours and the tooltip still identify the traces.
    let narrow = ui.available_width() < 270.0;
    ui.horizontal(|ui| {
        ui.label(RichText::new(title).color(theme::of(ui).text_strong));
        ui.label(RichText::new(unit).small().color(theme::of(ui).text_weak));
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            for trace in traces.iter().rev() {
                if let Some(newest) = history.newest() {
                    let value = trace.value(newest);
                    let text = if value >= 100.0 {
                        format!("{value:.0}")
                    } else {
                        format!("{value:.2}")
                    };
                    ui.label(RichText::new(text).monospace().color(trace.color));
                }
                if !narrow {
                    ui.label(RichText::new(trace.name).small().color(theme::of(ui).text_weak));
                    ui.add_space(2.0);
                }
            }
        });
    });
    let now = history.newest().map_or(0.0, |s| s.time_s);
    let largest = traces
        .iter()
        .map(|trace| f64::from(history.largest(|sample| trace.value(sample))))
        .fold(0.0, f64::max);
    let mut top = nice_above((1.12 * largest).max(least));
    // The budget line is shown once the trace exceeds a quarter of it.
    let shown_budget = budget.map(f64::from).filter(|b| largest > 0.25 * b);
    if let Some(budget) = shown_budget {
        top = top.max(1.1 * budget);
    }
    Plot::new(title)
        .height(ui.available_height())
        .show_background(false)
        .show_axes(Vec2b::new(false, true))
        .show_grid(Vec2b::new(true, true))
        .show_x(false)
        .show_y(false)
        .show_crosshair(false)
        .allow_drag(false)
        .allow_zoom(false)
        .allow_scroll(false)
        .allow_boxed_zoom(false)
        .allow_double_click_reset(false)
        .sense(egui::Sense::hover())
        .set_margin_fraction(egui::Vec2::ZERO)
        .grid_spacing(egui::Rangef::new(4.0, 5.0))
        .grid_color(theme::of(ui).line)
        .grid_fade(0.0)
        .y_axis_min_width(34.0)
        .x_grid_spacer(|_| (-4..=0).map(|n| mark(2.5 * f64::from(n), 2.5)).collect())
        .y_grid_spacer(move |_| {
            (0..=4)
                .map(|n| mark(0.25 * top * f64::from(n), 0.25 * top))
                .collect()
        })
        .y_axis_formatter(|mark, _| axis_number(mark.value))
        .show(ui, |plot| {
            plot.set_plot_bounds_x(-SPAN_S..=0.0);
            // The scale starts a little below zero, so that a trace at zero and its label are fully visible.
            plot.set_plot_bounds_y(-0.07 * top..=1.05 * top);
            if let Some(budget) = shown_budget {
                plot.hline(HLine::new("budget", budget).color(theme::STOP).width(1.0));
            }
            for trace in traces {
                let points: PlotPoints<'_> = history
                    .iter()
                    .map(|s| [s.time_s - now, f64::from(trace.value(s))])
                    .collect();
                plot.line(Line::new(trace.name, points).color(trace.color).width(1.6));
            }
        });
}

fn mark(value: f64, step_size: f64) -> egui_plot::GridMark {
    egui_plot::GridMark { value, step_size }
}

/// The smallest of 1, 2, 5 × 10ⁿ that is not below `value`.
fn nice_above(value: f64) -> f64 {
    let decade = 10f64.powf(value.max(1e-9).log10().floor());
    [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|step| step * decade)
        .find(|&top| top >= value)
        .unwrap_or(10.0 * decade)
}

fn axis_number(value: f64) -> String {
    let (value, unit) = match value.abs() {
        v if v >= 1e6 => (value / 1e6, " M"),
        v if v >= 1e3 => (value / 1e3, " k"),
        _ => (value, ""),
    };
    let text = format!("{value:.2}");
    format!("{}{unit}", text.trim_end_matches('0').trim_end_matches('.'))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tops_are_round() {
        for (value, top) in [
            (0.7, 1.0),
            (1.0, 1.0),
            (1.3, 2.0),
            (2.4, 5.0),
            (7.0, 10.0),
            (41_000.0, 50_000.0),
        ] {
            assert!((nice_above(value) - top).abs() < 1e-9 * top, "{value}");
        }
    }

    #[test]
    fn axis_numbers_are_short() {
        for (value, text) in [
            (0.0, "0"),
            (0.25, "0.25"),
            (1.5, "1.5"),
            (100.0, "100"),
            (12_500.0, "12.5 k"),
        ] {
            assert_eq!(axis_number(value), text);
        }
    }
}
