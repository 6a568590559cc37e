//! What could fit and what guides: the list of targets, with a choice for each and for all.

mod words;

use egui::{ComboBox, CornerRadius, Frame, Layout, Margin, RichText, Slider, Stroke, Ui, Vec2};
use mortise_guide::{Row, Standing, When};
use mortise_protocol::parameter::PARAMETERS;

use super::{control, parameters, theme};
use crate::session::document::Document;
use crate::session::{GUIDE_CAP_N, Intent, Session};

/// First word of the parameters that are shown here and not among the others.
pub const WORD: &str = "Guidance";

/// Draws it.
pub fn show(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
    control::section(ui, "Guidance");
    ui.add_space(2.0);
    ui.horizontal(|ui| {
        // Both lists beside each other.
        ui.spacing_mut().item_spacing.x = 4.0;
        ui.spacing_mut().combo_width = 80.0;
        for row in PARAMETERS.iter().filter(|row| row.name == WORD) {
            parameters::choice(ui, session, wanted, row);
        }
        when(ui, session, wanted);
    });
    for row in PARAMETERS
        .iter()
        .filter(|row| row.name.starts_with(WORD) && row.name != WORD)
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
            "While a part is in hand, this lists what it touches and could fit. Nothing needs to be set.",
        );
        return;
    };
    let free = words::freedom(&list.freedom);
    control::row(ui, "Still free", free)
        .on_hover_text("Motion that all targets taken up together leave to the part in hand");
    if list.rows.is_empty() {
        explain(ui, "It touches nothing that could fit.");
    }
    for row in &list.rows {
        line(ui, session, document, row, wanted);
    }
}

fn explain(ui: &mut Ui, text: &str) {
    ui.label(RichText::new(text).small().color(theme::of(ui).text_weak));
}

fn when(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
    let known = session.guide.when;
    let mut chosen = known;
    let list = ComboBox::from_id_salt("guide when")
        .selected_text(known.name())
        .show_ui(ui, |ui| {
            for when in When::ALL {
                ui.selectable_value(&mut chosen, when, when.name());
            }
        });
    let response = list.response.accessible_name("Guide when");
    let hint = "When touching: a fit is taken up once its faces touch.\nWhen near: once surfaces that fit stand before each other";
    response.on_hover_text(hint);
    if chosen != known {
        wanted.push(Intent::GuideWhen(chosen));
    }
}

fn cap(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
    let mut newton = session.guide.force_cap_n;
    ui.horizontal(|ui| {
        let hint = "Guidance never pulls harder: push harder than this, and the part leaves its axis";
        let label = ui.label(
            RichText::new("Pulls up to")
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
            ui.add(small(format!("· {}", words::misfit(row)), theme::of(ui).text_weak).wrap());
        });
    });
    inside.response.on_hover_ui(|ui| {
        ui.label(words::title(document, &row.target));
        ui.label(words::surfaces(&row.target));
        ui.label(RichText::new(words::faces(document, &row.target)).color(theme::of(ui).text_weak));
    });
}

/// What it is, and two switches.
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
                true => ("Switch on", "Let it guide again"),
                false => ("Switch off", "It is not to guide, now or when it comes back"),
            };
            let wish = Intent::SwitchTargetOff(id, !off);
            control::intent_button(ui, session, wanted, switch("Off", off), wish, hint)
                .accessible_name(format!("{name} {title}"));
            let (name, hint) = match row.pinned {
                true => ("Unpin", "Treat it like any other"),
                false => ("Pin", "Keep it in the list, and before what contradicts it"),
            };
            let wish = Intent::PinTarget(id, !row.pinned);
            control::intent_button(ui, session, wanted, switch("Pin", row.pinned), wish, hint)
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
