//! The bar above the plots: hold still, zoom, choose signals, export.

use egui::{RichText, Ui, Vec2};

use super::super::scale;
use super::view::View;
use crate::session::history::Quantity;
use crate::session::intent::Traces;
use crate::session::runs::RunIntent;
use crate::session::{Intent, Session};
use crate::ui::{control, theme};

/// Draws the bar.
pub fn show(ui: &mut Ui, session: &Session, view: &mut View, wanted: &mut Vec<Intent>) {
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        ui.spacing_mut().button_padding = Vec2::new(7.0, 2.0);
        let small = |text: &str| egui::Button::new(RichText::new(text).size(12.0));
        let held = view.is_held();
        let (text, hint) = match held {
            true => ("Live", "Follow the newest sample again (or double click a plot)"),
            false => ("Pause", "Hold the plots still; samples are recorded nevertheless"),
        };
        if ui.add(small(text).selected(held)).on_hover_text(hint).clicked() {
            view.hold(!held);
        }
        let zoom = |ui: &mut Ui, view: &mut View, text, name: &str, factor| {
            let button = ui.add(small(text));
            if button.accessible_name(name).on_hover_text(name).clicked() {
                view.zoom(factor, None);
            }
        };
        zoom(ui, view, "−", "Show more time", 2.0);
        zoom(ui, view, "+", "Show less time", 0.5);
        let span = RichText::new(scale::span(view.span_s())).size(12.0);
        ui.label(span.color(theme::of(ui).text_weak))
            .on_hover_text("Time shown. Wheel over a plot: zoom; drag: move through the last ten minutes; double click: back");
        signals(ui, view);
        let traces = Traces {
            range_s: view.range_s(),
            keys: view.keys(),
        };
        let hint = "Write what is shown to a file of comma-separated values, or to a picture (.svg)";
        control::intent_button(ui, session, wanted, small("Export…"), Intent::ExportTraces(traces), hint);
        record(ui, session, wanted);
        let hint = "Show a recorded run: its traces, and the parts as they moved";
        let open = Intent::Run(RunIntent::Browse);
        control::intent_button(ui, session, wanted, small("Open run…"), open, hint);
        if let Some(at) = view.pointed_s() {
            let text = format!("at {:.3} s", at - view.newest_s()).replace('-', "−");
            let label = RichText::new(text).size(12.0).monospace();
            ui.label(label.color(theme::of(ui).text_strong));
        }
    });
}

/// The switch of the recording; while one is under way it shows its time.
fn record(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
    let (text, intent, hint) = match &session.recording {
        None => (
            "Record".to_owned(),
            Intent::Record,
            "Record every message and the inputs of every tick to a new file, for `mortise replay` and Foxglove".to_owned(),
        ),
        Some(recording) => {
            let seconds = recording.since.elapsed().as_secs();
            (
                format!("End recording {}:{:02}", seconds / 60, seconds % 60),
                Intent::EndRecording,
                format!("End the recording {}", recording.path.display()),
            )
        }
    };
    let button = egui::Button::new(RichText::new(text).size(12.0)).selected(session.recording.is_some());
    control::intent_button(ui, session, wanted, button, intent, &hint);
}

/// The menu in which signals are chosen, by quantity.
fn signals(ui: &mut Ui, view: &mut View) {
    let button = egui::Button::new(RichText::new("Signals").size(12.0));
    egui::containers::menu::MenuButton::from_button(button)
        .config(
            egui::containers::menu::MenuConfig::new()
                .close_behavior(egui::PopupCloseBehavior::CloseOnClickOutside),
        )
        .ui(ui, |ui| {
            let high = (ui.ctx().content_rect().height() - 160.0).max(60.0);
            egui::ScrollArea::vertical().max_height(high).show(ui, |ui| {
                let mut last: Option<Quantity> = None;
                for (signal, on) in view.switches() {
                    if last != Some(signal.quantity) {
                        last = Some(signal.quantity);
                        control::section(ui, signal.quantity.name());
                    }
                    let name = format!("{}: {}", signal.quantity.name(), signal.name);
                    ui.checkbox(on, signal.name).accessible_name(name);
                }
            });
        });
}
