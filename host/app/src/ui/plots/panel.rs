//! One plot: the signals of one quantity on one axis, with the values at the pointer or the newest ones.

use egui::{Color32, RichText, Ui, Vec2b};
use egui_plot::{GridMark, HLine, Plot, PlotPoints, VLine};

use super::super::scale::{self, Scale};
use super::line;
use super::view::View;
use crate::session::Session;
use crate::session::chart::beside;
use crate::session::history::{Line, Quantity, Signal, envelope};
use crate::ui::{rig, theme};

/// Zoom for a point of wheel travel.
const ZOOM_PER_POINT: f64 = 0.004;
/// Smallest height at which the axis of time is drawn, points.
const AXIS_FROM: f32 = 84.0;

/// A signal as drawn.
struct Trace {
    signal: &'static Signal,
    color: Color32,
    lines: Vec<Line>,
    /// The same of other runs, at the times of the chosen one, with their place among all.
    compared: Vec<(usize, Line)>,
}

/// Draws the plot in the space there is. `pointed` becomes the time under the pointer.
pub fn show(
    ui: &mut Ui,
    session: &Session,
    view: &mut View,
    quantity: Quantity,
    signals: &[&'static Signal],
    pointed: &mut Option<f64>,
) {
    let (factor, unit) = match quantity {
        Quantity::LoopTime => session.connection().map_or((1.0, ""), rig::cost_scale),
        other => (1.0, other.unit()),
    };
    let factor = f64::from(factor);
    let [from, to] = view.range_s();
    let columns = (ui.available_width() * ui.pixels_per_point()).clamp(1.0, 8192.0) as usize;
    let traces: Vec<Trace> = (signals.iter())
        .map(|signal| Trace {
            signal,
            color: color(ui, signal),
            lines: envelope(session.shown_history(), signal, from, to, columns),
            compared: (session.playback.iter())
                .flat_map(|playback| beside(playback, signal, [from, to], columns))
                .collect(),
        })
        .collect();
    heading(ui, session, view, (quantity, unit, factor), &traces);
    let budget = (session.connection().filter(|_| quantity == Quantity::LoopTime))
        .map(|c| factor * f64::from(c.capabilities.cost_budget))
        .filter(|&budget| budget > 0.0);
    plot(ui, view, quantity, traces, factor, budget, pointed);
}

/// Draws title, unit, and the name and value of each signal.
fn heading(
    ui: &mut Ui,
    session: &Session,
    view: &View,
    (quantity, unit, factor): (Quantity, &str, f64),
    traces: &[Trace],
) {
    let sample = match view.pointed_s().or(view.mark_s()) {
        Some(at) => session.shown_history().at(at),
        None if view.is_held() => session.shown_history().at(view.range_s()[1]),
        // An old value would look like a live one.
        None => session
            .shown_history()
            .newest()
            .filter(|_| session.connection().is_some()),
    };
    // Narrow plots drop the names first; colours and the tooltip still identify the traces.
    let narrow = ui.available_width() < 135.0 * (1 + traces.len()) as f32 * 0.67;
    ui.spacing_mut().item_spacing.x = 7.0;
    let row = ui.horizontal(|ui| {
        ui.label(RichText::new(quantity.name()).color(theme::of(ui).text_strong));
        ui.label(RichText::new(unit).small().color(theme::of(ui).text_weak));
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            for trace in traces.iter().rev() {
                let value = sample.and_then(|sample| trace.signal.of(sample));
                let text = value.map_or("–".to_owned(), |v| readout(factor * f64::from(v)));
                if ui.available_width() < 34.0 {
                    break;
                }
                ui.label(RichText::new(text).monospace().color(trace.color));
                if !narrow {
                    let name = RichText::new(trace.signal.name).small();
                    ui.label(name.color(theme::of(ui).text_weak));
                    ui.add_space(2.0);
                }
            }
        });
    });
    row.response.on_hover_ui(|ui| {
        for trace in traces {
            let value = sample.and_then(|sample| trace.signal.of(sample));
            let text = value.map_or("–".to_owned(), |v| readout(factor * f64::from(v)));
            let text = format!("{} {text} {unit}", trace.signal.name);
            ui.label(RichText::new(text).color(trace.color));
        }
    });
}

/// A value in the heading: three digits or more.
fn readout(value: f64) -> String {
    if value.abs() >= 99.95 {
        format!("{value:.0}")
    } else {
        format!("{value:.2}")
    }
}

/// Colour of a signal: its own among those of its quantity, whichever are chosen.
fn color(ui: &Ui, signal: &Signal) -> Color32 {
    let ink = theme::of(ui);
    match signal.key {
        "contact_force_n" | "contact_torque_mnm" => return ink.contact,
        "handle_force_n" | "handle_torque_mnm" => return ink.accent,
        "loop_cost" => return ink.good,
        "guidance_force_n" | "guidance_torque_mnm" => return ink.mates,
        _ => {}
    }
    let place = crate::session::history::SIGNALS
        .iter()
        .filter(|other| other.quantity == signal.quantity)
        .position(|other| other.key == signal.key)
        .unwrap_or(0);
    // Hues by the golden section are far apart from their neighbours'.
    let hue = (0.13 + 0.618_034 * place as f32).fract();
    let (saturation, value) = if ui.visuals().dark_mode {
        (0.55, 0.92)
    } else {
        (0.85, 0.62)
    };
    egui::ecolor::Hsva::new(hue, saturation, value, 1.0).into()
}

fn plot(
    ui: &mut Ui,
    view: &mut View,
    quantity: Quantity,
    traces: Vec<Trace>,
    factor: f64,
    budget: Option<f64>,
    pointed: &mut Option<f64>,
) {
    let ([from, to], zero) = (view.range_s(), view.newest_s());
    let values = (traces.iter().flat_map(|trace| {
        let compared = trace.compared.iter().map(|(_, line)| line);
        trace.lines.iter().chain(compared).flatten()
    }))
    .filter(|[time, _]| (from..=to).contains(time))
    .map(|&[_, value]| factor * value)
    .fold(None, |all: Option<[f64; 2]>, v| {
        let [low, high] = all.unwrap_or([v; 2]);
        Some([low.min(v), high.max(v)])
    });
    let mut scale = Scale::of(quantity, values);
    // The budget line is shown once the trace exceeds a quarter of it.
    let budget = budget.filter(|budget| values.is_some_and(|[_, high]| high > 0.25 * budget));
    if let Some(budget) = budget {
        scale = Scale::of(quantity, values.map(|[low, high]| [low, high.max(1.05 * budget)]));
    }
    let step_s = scale::nice_above((to - from) / 5.0);
    let mark = |value, step_size| GridMark { value, step_size };
    let times = move |from: f64, to: f64| {
        let first = (from / step_s).ceil() as i64;
        let last = (to / step_s).floor() as i64;
        (first..=last.min(first + 20)).map(move |n| n as f64 * step_s)
    };
    let (start, end) = (from - zero, to - zero);
    let ink = theme::of(ui);
    let (line, cursor) = (ink.line, ink.text_weak);
    let (pointed_s, mark_s) = (view.pointed_s(), view.mark_s());
    let mark_color = ink.text_strong;
    let response = Plot::new(quantity.name())
        .height(ui.available_height())
        .show_background(false)
        .show_axes(Vec2b::new(ui.available_height() > AXIS_FROM, true))
        .show_grid(Vec2b::new(true, true))
        .show_x(false)
        .show_y(false)
        .show_crosshair(false)
        // Drags and the wheel move all plots together, see below.
        .allow_drag(false)
        .allow_zoom(false)
        .allow_scroll(false)
        .allow_boxed_zoom(false)
        .allow_double_click_reset(false)
        .allow_axis_zoom_drag(false)
        .sense(egui::Sense::click_and_drag())
        .set_margin_fraction(egui::Vec2::ZERO)
        .grid_spacing(egui::Rangef::new(4.0, 5.0))
        .grid_color(line)
        .grid_fade(0.0)
        .y_axis_min_width(34.0)
        .x_grid_spacer(move |_| times(start, end).map(|at| mark(at, step_s)).collect())
        .x_axis_formatter(move |mark, _| scale::number(mark.value, step_s) + " s")
        .y_grid_spacer(move |_| scale.marks().map(|value| mark(value, scale.step)).collect())
        .y_axis_formatter(move |mark, _| scale::number(mark.value, scale.step))
        .show(ui, |plot| {
            plot.set_plot_bounds_x(start..=end);
            // The scale starts a little below its end, so that a trace at zero and its label are fully visible.
            let margin = 0.06 * (scale.top - scale.bottom);
            plot.set_plot_bounds_y(scale.bottom - margin..=scale.top);
            if let Some(budget) = budget {
                plot.hline(HLine::new("budget", budget).color(theme::STOP).width(1.0));
            }
            for trace in traces {
                for (run, points) in trace.compared {
                    let points: PlotPoints<'_> = points
                        .into_iter()
                        .map(|[time, value]| [time - zero, factor * value])
                        .collect();
                    let drawn = egui_plot::Line::new(format!("{}, compared", trace.signal.name), points);
                    let style = line::style(Some(run));
                    plot.line(drawn.color(trace.color).style(style).width(1.2));
                }
                for points in trace.lines {
                    let points: PlotPoints<'_> = points
                        .into_iter()
                        .map(|[time, value]| [time - zero, factor * value])
                        .collect();
                    let drawn = egui_plot::Line::new(trace.signal.name, points);
                    plot.line(drawn.color(trace.color).width(1.6));
                }
            }
            if let Some(at) = mark_s {
                plot.vline(VLine::new("run", at - zero).color(mark_color).width(1.0));
            }
            if let Some(at) = pointed_s {
                plot.vline(VLine::new("pointer", at - zero).color(cursor).width(1.0));
            }
        });
    let (response, seconds_per_point) = (
        response.response,
        (to - from) / f64::from(response.transform.frame().width().max(1.0)),
    );
    let frame = response.rect;
    if response.dragged() {
        view.pan(-seconds_per_point * f64::from(response.drag_delta().x));
    }
    if response.double_clicked() {
        view.reset();
    }
    if let Some(at) = response.hover_pos().filter(|at| frame.contains(*at)) {
        let at_s = from + seconds_per_point * f64::from(at.x - frame.left());
        *pointed = Some(at_s);
        let (scroll, pinch) = ui.input(|i| (i.smooth_scroll_delta().y, i.zoom_delta()));
        if scroll != 0.0 || pinch != 1.0 {
            view.zoom(
                (-ZOOM_PER_POINT * f64::from(scroll)).exp() / f64::from(pinch),
                Some(at_s),
            );
        }
    }
}
