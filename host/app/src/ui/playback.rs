//! The line above the plots for recorded runs: play, scrub, speed, comparison, and figures where the panel of runs is not shown.

use egui::{RichText, Slider, Ui, Vec2};

use super::{control, theme};
use crate::session::run::{Figures, Run};
use crate::session::runs::{Playback, RunIntent};
use crate::session::workspace::Workspace;
use crate::session::{Intent, Session};

/// Speeds that can be chosen.
const SPEEDS: [f64; 6] = [0.1, 0.25, 0.5, 1.0, 2.0, 5.0];

/// Draws the line while a run is shown.
pub fn show(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
    let Some(playback) = &session.playback else {
        return;
    };
    let small = |text: &str| egui::Button::new(RichText::new(text).size(12.0));
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        ui.spacing_mut().button_padding = Vec2::new(7.0, 2.0);
        let (text, intent) = match playback.plays {
            true => ("Hold", RunIntent::Play(false)),
            false => ("Play", RunIntent::Play(true)),
        };
        control::intent_button(ui, session, wanted, small(text), Intent::Run(intent), "")
            .accessible_name(format!("{text} the run"));
        let mut at = playback.at_s;
        ui.spacing_mut().slider_width = (0.35 * ui.available_width()).clamp(60.0, 420.0);
        let slider = Slider::new(&mut at, 0.0..=playback.run().duration_s())
            .suffix(" s")
            // A fixed number of decimals would round the time itself, as if the slider had been moved.
            .custom_formatter(|time, _| format!("{time:.2}"));
        let slider = ui.add(slider);
        if slider.changed() {
            wanted.push(Intent::Run(RunIntent::GoTo(at)));
        }
        slider.accessible_name("Time in the run");
        speeds(ui, playback, wanted);
        let hint = "Draw another run beside this one, dashed and aligned by the first touch; Analyse shows the figures of all";
        let compare = Intent::Run(RunIntent::BrowseOther);
        control::intent_button(ui, session, wanted, small("Compare…"), compare, hint);
        let hint = "Write figures and traces of the runs to a page (HTML) that needs no other file";
        let report = Intent::Run(RunIntent::SaveReport);
        control::intent_button(ui, session, wanted, small("Report…"), report, hint)
            .accessible_name("Report of the run");
        let hint = "Show no run any more; parts go back to where they were";
        let close = Intent::Run(RunIntent::Close);
        control::intent_button(ui, session, wanted, small("Close"), close, hint)
            .accessible_name("Close the run");
    });
    if session.workspace != Workspace::Analyse {
        figures(ui, playback.run());
        for (_, other, _) in playback.others() {
            figures(ui, other);
        }
    }
}

fn speeds(ui: &mut Ui, playback: &Playback, wanted: &mut Vec<Intent>) {
    let list = egui::ComboBox::from_id_salt("speed")
        .selected_text(format!("{} ×", playback.speed))
        .width(64.0)
        .show_ui(ui, |ui| {
            for speed in SPEEDS {
                let text = format!("{speed} ×");
                if ui.selectable_label(speed == playback.speed, text).clicked() {
                    wanted.push(Intent::Run(RunIntent::Speed(speed)));
                }
            }
        });
    list.response.accessible_name("Speed of the run");
}

/// Draws the figures of a run in a line.
fn figures(ui: &mut Ui, run: &Run) {
    let Figures {
        insertion_s,
        contact_n,
        handle_n,
        depth_um,
        insertion_mm,
    } = run.figures;
    let text = format!(
        "{}: {:.1} s; first touch {}; contact up to {contact_n:.2} N, handle {handle_n:.2} N, {depth_um:.0} µm deep; in by {insertion_mm:.1} mm, {insertion_s:.1} s after the touch",
        run.name(),
        run.duration_s(),
        run.touch_s
            .map_or("none".to_owned(), |touch| format!("at {touch:.2} s")),
    );
    let text = RichText::new(text).size(12.0).color(theme::of(ui).text_weak);
    ui.add(egui::Label::new(text).truncate());
}
