//! Guidance by geometric energy: its force, the energies that the scene has, and why none acts.

use std::time::Duration;

use egui::{Align, Layout, RichText, Ui, Vec2};
use mortise_protocol::parameter::ParameterId;

use super::super::{control, parameters, theme};
use crate::session::document::Document;
use crate::session::energies::{EnergyIntent, Made, Making};
use crate::session::{Intent, Session, obstacle};

/// Time between two pictures while an energy is made, which show the time passed.
const TICK: Duration = Duration::from_millis(500);
/// What making one takes on two cores, s.
const TAKES_S: [u64; 2] = [5, 25];

/// Draws the lines below the choice of the method.
pub fn show(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
    parameters::one(ui, session, wanted, ParameterId::GeometricForce.row());
    if let Some(document) = &session.document {
        for made in session.scene_energies() {
            let text = RichText::new(energy(document, made)).color(theme::of(ui).text_strong);
            ui.label(text).on_hover_text(
                "In the scene: while the part is held, it is drawn to this fit from where the glow in the view is",
            );
        }
    }
    if let Some(making) = session.energy_under_way() {
        progress(ui, session, making, wanted);
    } else if let Some(why) = session.why_not_drawn() {
        ui.add(egui::Label::new(RichText::new(why).small().color(theme::of(ui).warning)).wrap());
    }
    let make = Intent::Energy(EnergyIntent::Make);
    if obstacle(session, &make).is_none() {
        let button = egui::Button::new("Make energy");
        let hint = "Make the energy of the fit that is shown";
        control::intent_button(ui, session, wanted, button, make, hint);
    }
}

/// An energy in a line.
fn energy(document: &Document, made: &Made) -> String {
    let [part, other] = [made.of.moving, made.of.against].map(|part| document.moving_name(part));
    format!(
        "Energy: {part} into {other}, {:.1} KiB",
        made.bytes() as f64 / 1024.0
    )
}

fn progress(ui: &mut Ui, session: &Session, making: &Making, wanted: &mut Vec<Intent>) {
    let seconds = making.since.elapsed().as_secs();
    ui.allocate_ui_with_layout(
        Vec2::new(ui.available_width(), 24.0),
        Layout::right_to_left(Align::Center),
        |ui| {
            let cancel = egui::Button::new("Cancel").min_size(Vec2::new(64.0, 24.0));
            let intent = Intent::Energy(EnergyIntent::Cancel);
            let hint = "Do without it: what the scene has stays";
            control::intent_button(ui, session, wanted, cancel, intent, hint)
                .accessible_name("Cancel energy");
            ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                let [least, most] = TAKES_S;
                let label = egui::Label::new(format!("Making the energy, {seconds} s")).truncate();
                let hint = format!("It takes {least} to {most} s of two cores");
                ui.add(label).on_hover_text(hint);
            });
        },
    );
    ui.ctx().request_repaint_after(TICK);
}
