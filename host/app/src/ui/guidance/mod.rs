//! Guidance: its method; by targets the list of them, candidate and active, with choices for each and for all; by energy what acts.

mod energy;
mod words;

use egui::{CornerRadius, Frame, Layout, Margin, RichText, Slider, Stroke, Ui, Vec2};
use mortise_guide::{Row, Standing, When};
use mortise_protocol::parameter::PARAMETERS;

use super::{control, parameters, theme};
use crate::session::document::Document;
use crate::session::{GUIDE_CAP_N, Intent, Session};

/// Draws the section.
pub fn show(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
    control::section(ui, "Guidance");
    ui.add_space(2.0);
    for row in PARAMETERS.iter().filter(|row| row.name == parameters::GUIDANCE) {
        parameters::choice(ui, session, wanted, row);
    }
    if session.guides_by_energy() {
        // Targets do not guide beside it.
        energy::show(ui, session, wanted);
        return;
    }
    when(ui, session, wanted);
    for row in PARAMETERS
        .iter()
        .filter(|row| row.name.starts_with(parameters::GUIDANCE) && row.name != parameters::GUIDANCE)
    {
        parameters::one(ui, session, wanted, row);
    }
    cap(ui, session, wanted);
    let Some((document, list)) = (session.document.as_ref())
        .map(|document| (document, &session.guidance))
        .filter(|(_, list)| list.held.is_some())
    else {
        explain(
            ui,
            "While a part is held, this lists the surfaces it could fit. Nothing needs to be set.",
        );
        return;
    };
    let free = words::freedom(&list.freedom);
    // On two lines: side by side the value would be cut off.
    ui.label(RichText::new("Remaining motion").color(theme::of(ui).text_weak))
        .on_hover_text("Motion that all active targets together leave to the held part");
    ui.label(free);
    if list.rows.is_empty() {
        explain(ui, "It touches no surface that it could fit.");
    }
    for row in &list.rows {
        line(ui, session, document, row, wanted);
    }
}

fn explain(ui: &mut Ui, text: &str) {
    ui.label(RichText::new(text).small().color(theme::of(ui).text_weak));
}

fn when(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
    let known = When::ALL
        .iter()
        .position(|&w| w == session.guide.when)
        .unwrap_or(0);
    let names = When::ALL.map(|when| match when {
        When::Touching => "on contact",
        When::Near => "when near",
    });
    let hint = "On contact: guidance engages once the faces of a fit touch.\nWhen near: once surfaces that fit face each other, at most 2 mm apart";
    if let Some(chosen) = parameters::combo(ui, "Engage", &names, known, hint, None) {
        wanted.push(Intent::GuideWhen(When::ALL[chosen]));
    }
}

fn cap(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
    let mut newton = session.guide.force_cap_n;
    ui.horizontal(|ui| {
        let hint = "Upper limit of the guidance force: push harder than this, and the part leaves its axis";
        let label = ui.label(
            RichText::new("Max guidance force")
                .small()
                .color(theme::of(ui).text_weak),
        );
        let label = label.on_hover_text(hint);
        ui.spacing_mut().slider_width = (ui.available_width() - 82.0).max(60.0);
        let slider = Slider::new(&mut newton, GUIDE_CAP_N)
            .suffix(" N")
            .fixed_decimals(1);
        let slider = ui.add(slider).labelled_by(label.id).on_hover_text(hint);
        if slider.changed() && newton != session.guide.force_cap_n {
            wanted.push(Intent::GuideCap(newton));
        }
    });
}

fn line(ui: &mut Ui, session: &Session, document: &Document, row: &Row, wanted: &mut Vec<Intent>) {
    let color = match &row.standing {
        Standing::Sent => theme::of(ui).mates,
        Standing::ByContact | Standing::Waiting => theme::of(ui).text,
        Standing::Candidate | Standing::Off => theme::of(ui).text_weak,
        Standing::Conflict(_) | Standing::Refused(_) => theme::of(ui).warning,
    };
    let edge = match row.standing {
        Standing::Sent => theme::of(ui).mates.gamma_multiply(0.6),
        _ => theme::of(ui).line,
    };
    let card = Frame::NONE
        .fill(theme::of(ui).card)
        .stroke(Stroke::new(1.0, edge))
        .corner_radius(CornerRadius::same(6))
        .inner_margin(Margin::symmetric(9, 6));
    let inside = card.show(ui, |ui| {
        ui.spacing_mut().item_spacing = Vec2::new(4.0, 1.0);
        ui.take_available_width();
        let title = words::title(document, &row.target);
        choices(ui, session, row, &title, wanted);
        let small = |text: String, color| egui::Label::new(RichText::new(text).small().color(color));
        ui.add(small(words::surfaces(&row.target), theme::of(ui).text_weak).truncate());
        ui.horizontal_wrapped(|ui| {
            ui.spacing_mut().interact_size.y = 0.0;
            let standing = words::standing(document, &session.guidance, row, session.guides());
            ui.add(small(standing, color).wrap());
            ui.add(small(format!("· {}", words::alignment(row)), theme::of(ui).text_weak).wrap());
        });
    });
    inside.response.on_hover_ui(|ui| {
        ui.label(words::title(document, &row.target));
        ui.label(words::surfaces(&row.target));
        ui.label(RichText::new(words::faces(document, &row.target)).color(theme::of(ui).text_weak));
    });
}

/// The target's title and its two switches.
fn choices(ui: &mut Ui, session: &Session, row: &Row, title: &str, wanted: &mut Vec<Intent>) {
    let (id, off) = (row.target.id, row.standing == Standing::Off);
    let switch = |text: &str, on: bool| {
        egui::Button::new(RichText::new(text).small())
            .selected(on)
            .min_size(Vec2::new(34.0, 20.0))
    };
    ui.horizontal(|ui| {
        ui.with_layout(Layout::right_to_left(egui::Align::Center), |ui| {
            let (name, hint) = match off {
                true => ("Switch on", "Let this target guide again"),
                false => (
                    "Switch off",
                    "Keep this target from guiding, also when the part returns to it",
                ),
            };
            let input = Intent::SwitchTargetOff(id, !off);
            control::intent_button(ui, session, wanted, switch("Off", off), input, hint)
                .accessible_name(format!("{name} {title}"));
            let (name, hint) = match row.pinned {
                true => ("Unpin", "Treat it like any other target"),
                false => (
                    "Pin",
                    "Keep it in the list, with priority over targets that contradict it",
                ),
            };
            let input = Intent::PinTarget(id, !row.pinned);
            control::intent_button(ui, session, wanted, switch("Pin", row.pinned), input, hint)
                .accessible_name(format!("{name} {title}"));
            ui.with_layout(Layout::left_to_right(egui::Align::Center), |ui| {
                let ink = if off {
                    theme::of(ui).text_weak
                } else {
                    theme::of(ui).text_strong
                };
                ui.add(egui::Label::new(RichText::new(title).color(ink)).truncate());
            });
        });
    });
}
