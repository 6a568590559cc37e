//! Computing the chosen run again by the simulation: as it was, or with another value of a parameter, and where the results first differ.

use egui::{ComboBox, DragValue, ProgressBar, RichText, Ui};
use mortise_protocol::parameter::{PARAMETERS, Parameter, ParameterId};

use crate::session::recomputed::{Recomputed, Recomputing};
use crate::session::runs::{Playback, RunIntent};
use crate::session::{Intent, Session};
use crate::ui::{control, parameters, theme};

/// What is to be changed: a parameter and its value.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Fields {
    change: Recomputing,
}

/// Draws the section.
pub fn show(
    ui: &mut Ui,
    session: &Session,
    playback: &Playback,
    fields: &mut Fields,
    wanted: &mut Vec<Intent>,
) {
    control::section(ui, "Compute again");
    ui.add_space(4.0);
    let hint = "The recorded readings and messages pass through the force law once more, in the simulation, and each tick is compared bit by bit. \
        With another value of a parameter, the first tick that it changes is found.";
    ui.label(RichText::new(hint).size(12.5).color(theme::of(ui).text_weak));
    change(ui, fields);
    let (index, shown) = (playback.chosen(), playback.shown());
    ui.horizontal(|ui| {
        let start = Intent::Run(RunIntent::Recompute(index, fields.change));
        let text = format!("Compute run {} again", index + 1);
        let button = control::primary(ui, &text);
        control::intent_button(ui, session, wanted, button, start, "");
    });
    for (other, shown) in playback.runs().iter().enumerate() {
        if let Some(under_way) = &shown.recomputation {
            ui.horizontal(|ui| {
                let done = under_way.done as f32;
                let bar = ProgressBar::new(done)
                    .desired_width((ui.available_width() - 70.0).max(40.0))
                    .text(format!("Run {}: {:.0} %", other + 1, 100.0 * done));
                ui.add(bar);
                let cancel = Intent::Run(RunIntent::CancelRecompute);
                let button = egui::Button::new("Cancel");
                control::intent_button(ui, session, wanted, button, cancel, "")
                    .accessible_name("Cancel computing again");
            });
        }
    }
    if let Some(recomputed) = &shown.recomputed {
        result(ui, index, recomputed, wanted);
    }
}

/// Draws the choice of what is changed.
fn change(ui: &mut Ui, fields: &mut Fields) {
    ui.horizontal(|ui| {
        let row = |id: ParameterId| &PARAMETERS[id as usize];
        let text = fields.change.map_or("Nothing changed".to_owned(), |(id, _)| {
            parameters::words(row(id).name)
        });
        let list = ComboBox::from_id_salt("changed parameter")
            .selected_text(text)
            .width(170.0)
            .show_ui(ui, |ui| {
                ui.selectable_value(&mut fields.change, None, "Nothing changed");
                for row in PARAMETERS {
                    let is_it = fields.change.is_some_and(|(id, _)| id == row.id);
                    let name = parameters::words(row.name);
                    if ui.selectable_label(is_it, name).clicked() && !is_it {
                        fields.change = Some((row.id, row.default));
                    }
                }
            });
        list.response.accessible_name("What is changed");
        if let Some((id, value)) = &mut fields.change {
            let Parameter { min, max, unit, .. } = row(*id);
            let drag = DragValue::new(value)
                .range(*min..=*max)
                .speed((max - min) / 500.0)
                .suffix(format!(" {unit}"));
            ui.add(drag)
                .on_hover_text(format!("{min} to {max} {unit}"))
                .accessible_name("Changed value");
        }
    });
}

/// Draws the result, and a button that goes to the first difference.
fn result(ui: &mut Ui, index: usize, recomputed: &Recomputed, wanted: &mut Vec<Intent>) {
    let ink = theme::of(ui);
    let changed = recomputed.what.map(|(id, value)| {
        let row = &PARAMETERS[id as usize];
        format!("{} {value} {}: ", parameters::words(row.name), row.unit)
    });
    let color = match (&recomputed.differs, changed.is_some()) {
        (None, _) => ink.good,
        (Some(_), true) => ink.text_strong,
        (Some(_), false) => ink.warning,
    };
    ui.add_space(2.0);
    let text = format!(
        "Run {}: {}{}",
        index + 1,
        changed.unwrap_or_default(),
        recomputed.words()
    );
    ui.label(RichText::new(text).color(color));
    if let Some(at_s) = recomputed.differs.as_ref().and_then(|found| found.at_s)
        && ui.button("Go to the difference").clicked()
    {
        wanted.push(Intent::Run(RunIntent::GoTo(at_s)));
    }
    for left_out in &recomputed.left_out {
        ui.label(RichText::new(left_out).size(12.5).color(ink.text_weak));
    }
}
