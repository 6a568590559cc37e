//! Commissioning of the rig: the list of its steps, the present one with what to do; and the joints as they are read.

use egui::{Color32, RichText, Ui, Vec2};
use egui_plot::{Plot, PlotPoints};
use mortise_rig::commissioning::{Commissioning, Outcome, Step};

use super::{control, loop_time, theme};
use crate::session::rig_page::{RigIntent, RigPage, TRACE_S, Wiring};
use crate::session::{Intent, Session};

/// Height of the plot of the joints, points.
const PLOT: f32 = 150.0;

/// Draws the section.
pub fn show(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
    control::section(ui, "Commissioning");
    ui.add_space(4.0);
    let page = &session.rig_page;
    match &page.steps {
        None => {
            ui.label(
                "Tries the rig one thing at a time: every encoder by hand with the motors off, the reference, the stop button, then each motor alone with a short push of 1 N. It corrects senses and ranges in the description.",
            );
            ui.add_space(4.0);
            let begin = control::primary(ui, "Begin").min_size(Vec2::new(110.0, 30.0));
            control::intent_button(
                ui,
                session,
                wanted,
                begin,
                Intent::Rig(RigIntent::Begin),
                "Motors stay off until the first motor's step",
            );
        }
        Some(steps) => {
            list(ui, steps);
            ui.add_space(6.0);
            present(ui, session, steps, wanted);
        }
    }
    simulated(ui, session, wanted);
}

/// Draws what is read of the rig: its joints, and how long its loop takes.
pub fn readings(ui: &mut Ui, session: &Session, _: &mut Vec<Intent>) {
    joints(ui, &session.rig_page);
    ui.add_space(6.0);
    loop_time::show(ui, session);
}

/// Draws the steps with their outcomes.
fn list(ui: &mut Ui, steps: &Commissioning) {
    let ink = theme::of(ui);
    egui::Grid::new("steps")
        .num_columns(3)
        .min_row_height(17.0)
        .spacing(Vec2::new(14.0, 1.0))
        .show(ui, |ui| {
            for (number, (step, outcome)) in steps.steps().enumerate() {
                let (mark, color) = match outcome {
                    Outcome::Passed(_) => ("ok", ink.good),
                    Outcome::Corrected(_) => ("corrected", ink.accent),
                    Outcome::Failed(_) => ("failed", ink.fault_text),
                    Outcome::Open if number == steps.at() => ("now", ink.held),
                    Outcome::Open => ("", ink.text_weak),
                };
                let color_of_name = if number == steps.at() {
                    ink.text_strong
                } else {
                    ink.text
                };
                let name = format!("{}. {}", number + 1, step.name());
                ui.label(RichText::new(name).size(12.5).color(color_of_name));
                ui.label(RichText::new(mark).size(12.5).color(color));
                let words = RichText::new(outcome.words()).size(12.5).color(ink.text_weak);
                ui.add(egui::Label::new(words).truncate())
                    .on_hover_text(outcome.words());
                ui.end_row();
            }
        });
}

/// Draws what to do now, and the buttons for it.
fn present(ui: &mut Ui, session: &Session, steps: &Commissioning, wanted: &mut Vec<Intent>) {
    let ink = theme::of(ui);
    theme::card(ink).fill(ink.card).show(ui, |ui| {
        ui.set_width(ui.available_width());
        let name = steps.step().map_or_else(|| "Done".to_owned(), Step::name);
        ui.label(RichText::new(name).size(16.0).color(ink.text_strong));
        ui.label(steps.instruction());
        if let Outcome::Failed(why) = steps.outcome() {
            ui.label(RichText::new(why).color(ink.fault_text));
        }
        for change in steps.changes() {
            ui.label(RichText::new(change).monospace().color(ink.accent));
        }
        if let Some(busy) = session.rig_page.busy {
            ui.label(RichText::new(format!("{busy}…")).color(ink.text_weak));
        }
        ui.add_space(4.0);
        ui.horizontal_wrapped(|ui| {
            if let Some((text, intent)) = action(steps) {
                let button = control::primary(ui, text).min_size(Vec2::new(120.0, 30.0));
                control::intent_button(ui, session, wanted, button, Intent::Rig(intent), "");
            }
            let plain = |text: &str| egui::Button::new(text.to_owned()).min_size(Vec2::new(72.0, 30.0));
            if matches!(steps.step(), Some(Step::Encoder(_) | Step::Workspace)) {
                let hint = "Begin this step again, from the present pose";
                let intent = Intent::Rig(RigIntent::Again);
                control::intent_button(ui, session, wanted, plain("From here"), intent, hint);
            }
            let hint = "Take the step before back, with its correction";
            control::intent_button(
                ui,
                session,
                wanted,
                plain("Back"),
                Intent::Rig(RigIntent::Back),
                hint,
            );
            let hint = "Write the steps and their results to a file";
            let intent = Intent::Rig(RigIntent::SaveReport);
            control::intent_button(ui, session, wanted, plain("Report…"), intent, hint);
            let hint = "What was sent stays on the board";
            control::intent_button(
                ui,
                session,
                wanted,
                plain("End"),
                Intent::Rig(RigIntent::End),
                hint,
            )
            .accessible_name("End commissioning");
        });
    });
}

/// What the operator does in the present step: the words of the button, and its intent.
fn action(steps: &Commissioning) -> Option<(&'static str, RigIntent)> {
    Some(match steps.step()? {
        Step::Encoder(_) => ("I have turned it", RigIntent::Done),
        Step::Send => ("Send them now", RigIntent::SendCorrections),
        Step::Reference => ("Set reference", RigIntent::SetReference),
        Step::StopInput => ("Nothing happens", RigIntent::Done),
        Step::Motor(_) => ("Test motor", RigIntent::TestMotor),
        Step::Workspace => ("I have been everywhere", RigIntent::Done),
    })
}

/// Colours of the joints.
fn color(ui: &Ui, joint: usize) -> Color32 {
    let ink = theme::of(ui);
    [ink.accent, ink.held, ink.mates][joint.min(2)]
}

/// Draws counts and angles of the joints, and their last seconds.
fn joints(ui: &mut Ui, page: &RigPage) {
    let Some((Some(in_use), true)) = &page.on_board else {
        return;
    };
    control::section(ui, "Joints");
    ui.spacing_mut().item_spacing.y = 2.0;
    let newest = page.trace().next_back();
    for (number, joint) in in_use.joints.iter().enumerate() {
        let angle = newest.map(|(_, angles)| angles[number].to_degrees());
        let [from, to] = joint.range.map(f32::to_degrees);
        let text = match angle {
            Some(angle) => format!("{angle:.2}° of {from:.0}° to {to:.0}°"),
            None => "–".to_owned(),
        };
        let turned = page.steps.as_ref().and_then(|steps| steps.turned(number));
        let text = match turned {
            Some(turned) => format!("{text}, turned {:+.1}°", turned.to_degrees()),
            None => text,
        };
        let name = RichText::new(format!("Joint {}", number + 1)).color(color(ui, number));
        ui.horizontal(|ui| {
            ui.label(name);
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                ui.label(text)
            });
        });
    }
    if let Some(readings) = page.steps.as_ref().and_then(Commissioning::readings) {
        let stop = if readings.stop_open { "open" } else { "closed" };
        control::row(ui, "Stop input", stop);
        let counts: Vec<String> = readings.counts[..in_use.joints.len()]
            .iter()
            .map(i32::to_string)
            .collect();
        control::row(ui, "Counts", counts.join(", "));
    }
    traces(ui, page, in_use.joints.len());
}

fn traces(ui: &mut Ui, page: &RigPage, joints: usize) {
    let Some(&(now, _)) = page.trace().next_back() else {
        return;
    };
    let colors = [0, 1, 2].map(|joint| color(ui, joint));
    Plot::new("joints")
        .height(PLOT)
        .show_background(false)
        .allow_drag(false)
        .allow_zoom(false)
        .allow_scroll(false)
        .allow_boxed_zoom(false)
        .show_x(false)
        .show_y(false)
        .x_axis_formatter(|mark, _| format!("{:.0} s", mark.value))
        .y_axis_formatter(|mark, _| format!("{:.0}°", mark.value))
        .show(ui, |plot| {
            plot.set_plot_bounds_x(-TRACE_S..=0.0);
            for joint in 0..joints {
                let points: PlotPoints<'_> = page
                    .trace()
                    .map(|(time, angles)| [time - now, f64::from(angles[joint].to_degrees())])
                    .collect();
                let line = egui_plot::Line::new(format!("Joint {}", joint + 1), points);
                plot.line(line.color(colors[joint.min(2)]).width(1.6));
            }
        });
}

/// Draws what a simulated mechanism offers: an operator, and faults in its wiring.
fn simulated(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
    let is_simulated = session.connection().is_some_and(|c| c.capabilities.simulated);
    let page = &session.rig_page;
    let Some((Some(rig), true)) = page.on_board.as_ref().filter(|_| is_simulated) else {
        return;
    };
    ui.add_space(6.0);
    control::section(ui, "Simulated mechanism");
    ui.add_space(2.0);
    ui.horizontal_wrapped(|ui| {
        let hand = egui::Button::new("Let the simulated hand do it").min_size(Vec2::new(0.0, 28.0));
        let hint = "Turns the joint, presses the stop button, or leads the handle along its limits";
        control::intent_button(ui, session, wanted, hand, Intent::Rig(RigIntent::Simulate), hint);
        let (now, _) = page.wiring;
        let list = egui::ComboBox::from_id_salt("wiring")
            .selected_text(format!("Wired: {}", now.name()))
            .width(200.0)
            .height(420.0)
            .show_ui(ui, |ui| {
                for wiring in Wiring::all(rig.joints.len() as u8) {
                    if ui.selectable_label(wiring == now, wiring.name()).clicked() {
                        wanted.push(Intent::Rig(RigIntent::Wire(wiring)));
                    }
                }
            });
        list.response.accessible_name("Wiring");
    });
}
