//! The bar at the top: the program, the file, the state, Arm and STOP.

use egui::{Align, Layout, RichText, Ui, Vec2};
use mortise_protocol::message::DeviceState;
use mortise_rig::describe;

use super::{control, stop, theme};
use crate::session::link::Link;
use crate::session::{Intent, Session};

/// Draws it.
pub fn show(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
    egui::Panel::top("header")
        .exact_size(64.0)
        .resizable(false)
        .show_separator_line(false)
        .frame(theme::panel().inner_margin(egui::Margin::symmetric(14, 10)))
        .show(ui, |ui| {
            ui.horizontal_centered(|ui| {
                let (rect, _) = ui.allocate_exact_size(Vec2::splat(26.0), egui::Sense::hover());
                control::mark(ui.painter(), rect, theme::TEXT);
                ui.label(
                    RichText::new("mortise")
                        .size(19.0)
                        .color(theme::TEXT_STRONG)
                        .strong(),
                );
                ui.add_space(10.0);
                let open = egui::Button::new("Open…").min_size(Vec2::new(72.0, 32.0));
                control::intent_button(
                    ui,
                    session,
                    wanted,
                    open,
                    Intent::Browse,
                    "Open a STEP file (Ctrl+O)",
                );
                title(ui, session);
                ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                    stop::button(ui, session, wanted);
                    ui.add_space(4.0);
                    arm(ui, session, wanted);
                    ui.add_space(4.0);
                    state(ui, session);
                });
            });
        });
}

fn title(ui: &mut Ui, session: &Session) {
    ui.add_space(6.0);
    let Some(document) = &session.document else {
        return;
    };
    let hover = match &document.path {
        Some(path) => path.display().to_string(),
        None => "The sample that comes with the program".to_owned(),
    };
    ui.vertical(|ui| {
        ui.add_space(4.0);
        ui.spacing_mut().item_spacing.y = 1.0;
        let name = RichText::new(&document.title).color(theme::TEXT_STRONG);
        ui.add(egui::Label::new(name).truncate()).on_hover_text(hover);
        let parts = document.model.parts.len();
        let mut text = format!("{parts} part{}", if parts == 1 { "" } else { "s" });
        if let Some(baked) = &document.baked {
            text += &format!(", scene {} KiB", baked.image.len().div_ceil(1024));
        }
        ui.label(RichText::new(text).small().color(theme::TEXT_WEAK));
    });
}

fn arm(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
    let size = Vec2::new(104.0, 36.0);
    let text = |text: &str| RichText::new(text).size(15.0).color(theme::TEXT_STRONG);
    match session.device() {
        Some(DeviceState::Armed | DeviceState::Active | DeviceState::SoftStop) => {
            let button = egui::Button::new(text("Disarm")).min_size(size);
            control::intent_button(
                ui,
                session,
                wanted,
                button,
                Intent::Disarm,
                "Motors off, the part is let go",
            );
        }
        Some(DeviceState::Stopped | DeviceState::Fault(_)) => {
            let button = egui::Button::new(text("Clear stop"))
                .fill(theme::ACCENT_DIM)
                .min_size(size);
            control::intent_button(
                ui,
                session,
                wanted,
                button,
                Intent::ClearFault,
                "Leave the stopped state; the motors stay off",
            );
        }
        Some(DeviceState::Homing) => {
            let button = egui::Button::new(text("Set home"))
                .fill(theme::ACCENT_DIM)
                .min_size(size);
            let hint = "Bring the handle to its marked pose first: the board counts from there";
            control::intent_button(ui, session, wanted, button, Intent::Home, hint);
        }
        _ => {
            let button = egui::Button::new(text("Arm"))
                .fill(theme::ACCENT_DIM)
                .min_size(size);
            control::intent_button(
                ui,
                session,
                wanted,
                button,
                Intent::Arm,
                "Motors on. The handle feels nothing until a part is grabbed",
            );
        }
    }
}

fn state(ui: &mut Ui, session: &Session) {
    let (color, text, hover) = match (&session.link, session.device()) {
        (Link::Connecting { spec, .. }, _) => (
            theme::ACCENT,
            "Connecting".to_owned(),
            format!("Waiting for {spec} to answer"),
        ),
        (_, None) => (
            theme::TEXT_WEAK,
            "No rig".to_owned(),
            "Choose a rig on the right and connect".to_owned(),
        ),
        (_, Some(device)) => {
            let (color, text) = match device {
                DeviceState::Boot => (theme::ACCENT, "Starting"),
                DeviceState::Homing => (theme::WARNING, "No reference"),
                DeviceState::Idle => (theme::TEXT_WEAK, "Idle"),
                DeviceState::Armed => (theme::GOOD, "Armed"),
                DeviceState::Active => (theme::HELD, "In hand"),
                DeviceState::SoftStop => (theme::WARNING, "Stopping"),
                DeviceState::Stopped => (theme::STOP_HOVER, "Stopped"),
                DeviceState::Fault(_) => (theme::STOP_HOVER, "Fault"),
            };
            let named = session.grabbed().and_then(|part| {
                let document = session.document.as_ref()?;
                Some(format!("In hand: {}", document.part_name(part)))
            });
            (color, named.unwrap_or_else(|| text.to_owned()), describe(device))
        }
    };
    control::chip(ui, color, &text).on_hover_text(hover);
}
