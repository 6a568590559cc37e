//! The bar at the top: program, file, state, Arm and STOP.

use egui::{Align, Layout, RichText, Ui, Vec2};
use mortise_protocol::message::DeviceState;
use mortise_rig::describe;

use super::{control, file_menu, stop, theme, undo, workspaces};
use crate::session::link::Link;
use crate::session::{Intent, Session};

/// Window width below which the bar has two rows, points.
const ONE_ROW: f32 = 760.0;
/// Largest width of the state's label, points.
const STATE_WIDTH: f32 = 260.0;
/// Gap between two items of the bar, points.
const GAP: f32 = 8.0;

/// Layout of the bar for a window of a given width (points).
struct Shape {
    rows: usize,
    margin: egui::Margin,
    stop: Vec2,
    arm: Vec2,
}

impl Shape {
    fn of(width: f32) -> Self {
        if width >= ONE_ROW {
            Self {
                rows: 1,
                margin: egui::Margin::symmetric(14, 10),
                stop: Vec2::new(148.0, 44.0),
                arm: Vec2::new(104.0, 36.0),
            }
        } else {
            Self {
                rows: 2,
                margin: egui::Margin::symmetric(8, 6),
                stop: Vec2::new(112.0, 40.0),
                arm: Vec2::new(96.0, 30.0),
            }
        }
    }

    fn height(&self) -> f32 {
        let second = if self.rows == 1 { 0.0 } else { self.arm.y + 4.0 };
        self.stop.y + second + self.margin.sum().y
    }
}

/// Height of the bar in a window of `width` points.
pub fn height(width: f32) -> f32 {
    Shape::of(width).height()
}

/// Draws the bar. STOP and the state are placed first, at the right and as wide as they need; the rest takes the remaining width.
pub fn show(ui: &mut Ui, session: &Session, help: &mut bool, wanted: &mut Vec<Intent>) {
    let shape = Shape::of(ui.max_rect().width());
    egui::Panel::top("header")
        .exact_size(shape.height())
        .resizable(false)
        .show_separator_line(false)
        .frame(theme::panel().inner_margin(shape.margin))
        .show(ui, |ui| {
            ui.spacing_mut().item_spacing = Vec2::new(GAP, 4.0);
            let row = Vec2::new(ui.available_width(), shape.stop.y);
            let from_right = Layout::right_to_left(Align::Center);
            ui.allocate_ui_with_layout(row, from_right, |ui| {
                stop::button(ui, session, wanted, shape.stop);
                if shape.rows == 1 {
                    arm(ui, session, wanted, shape.arm);
                }
                state(ui, session, ui.available_width().min(STATE_WIDTH));
                if shape.rows == 1 {
                    let left = Layout::left_to_right(Align::Center);
                    ui.with_layout(left, |ui| file(ui, session, help, wanted, shape.arm.y - 4.0));
                }
            });
            if shape.rows == 2 {
                let row = Vec2::new(ui.available_width(), shape.arm.y);
                ui.allocate_ui_with_layout(row, from_right, |ui| {
                    arm(ui, session, wanted, shape.arm);
                    let left = Layout::left_to_right(Align::Center);
                    ui.with_layout(left, |ui| file(ui, session, help, wanted, shape.arm.y));
                });
            }
        });
}

/// The program's mark, the open file, and its history.
fn file(ui: &mut Ui, session: &Session, help: &mut bool, wanted: &mut Vec<Intent>, height: f32) {
    if ui.available_width() > 220.0 {
        let (rect, _) = ui.allocate_exact_size(Vec2::splat(26.0), egui::Sense::hover());
        control::mark(ui, rect, theme::of(ui).text);
        let name = RichText::new("mortise").size(19.0).strong();
        ui.label(name.color(theme::of(ui).text_strong));
        ui.add_space(4.0);
    }
    let open = egui::Button::new("Open…").min_size(Vec2::new(72.0, height));
    let hint = "Open a STEP file or a project (Ctrl+O)";
    control::intent_button(ui, session, wanted, open, Intent::Browse, hint);
    if ui.available_width() > 40.0 {
        file_menu::show(ui, session, help, wanted, height);
    }
    if session.document.is_some() && ui.available_width() > 2.0 * (undo::WIDTH + GAP) {
        undo::show(ui, session, wanted, height);
    }
    if ui.available_width() > workspaces::WIDTH + 60.0 {
        workspaces::show(ui, session, wanted, height);
        ui.add_space(GAP);
        ui.spacing_mut().item_spacing.x = GAP;
    }
    if ui.available_width() > 40.0 {
        title(ui, session);
    }
}

fn title(ui: &mut Ui, session: &Session) {
    let Some(document) = &session.document else {
        return;
    };
    let hover = match &document.path {
        Some(path) => path.display().to_string(),
        None => "The sample that comes with the program".to_owned(),
    };
    ui.vertical(|ui| {
        ui.add_space((0.5 * ui.available_height() - 18.0).max(0.0));
        ui.spacing_mut().item_spacing.y = 1.0;
        let name = RichText::new(&document.title).color(theme::of(ui).text_strong);
        ui.add(egui::Label::new(name).truncate()).on_hover_text(hover);
        let parts = document.model.parts.len();
        let mut text = format!("{parts} part{}", if parts == 1 { "" } else { "s" });
        if let Some(baked) = &document.baked {
            text += &format!(", collision model {} KiB", baked.image.len().div_ceil(1024));
        }
        let text = RichText::new(text).small().color(theme::of(ui).text_weak);
        ui.add(egui::Label::new(text).truncate());
    });
}

fn arm(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>, size: Vec2) {
    let ink = theme::of(ui);
    let text = |text: &str| RichText::new(text).size(15.0).color(ink.text_strong);
    match session.device() {
        Some(DeviceState::Armed | DeviceState::Active | DeviceState::SoftStop | DeviceState::Testing) => {
            let button = egui::Button::new(text("Disarm")).min_size(size);
            control::intent_button(
                ui,
                session,
                wanted,
                button,
                Intent::Disarm,
                "Motors off; the part is released",
            );
        }
        Some(DeviceState::Stopped | DeviceState::Fault(_)) => {
            let button = egui::Button::new(text("Clear stop"))
                .fill(ink.accent_dim)
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
                .fill(ink.accent_dim)
                .min_size(size);
            let hint = "First bring the handle to its marked pose: the board takes it as the reference";
            control::intent_button(ui, session, wanted, button, Intent::Home, hint);
        }
        _ => {
            let button = egui::Button::new(text("Arm")).fill(ink.accent_dim).min_size(size);
            control::intent_button(
                ui,
                session,
                wanted,
                button,
                Intent::Arm,
                "Motors on. The handle stays free of force until a part is grabbed",
            );
        }
    }
}

fn state(ui: &mut Ui, session: &Session, width: f32) {
    let ink = theme::of(ui);
    let (color, text, hover) = match (&session.link, session.device()) {
        (Link::Connecting { spec, .. }, _) => (
            ink.accent,
            "Connecting".to_owned(),
            format!("Waiting for {spec} to answer"),
        ),
        (_, None) => (
            ink.text_weak,
            "No rig".to_owned(),
            "Choose a rig on the right and connect".to_owned(),
        ),
        (_, Some(device)) => {
            let (color, text) = match device {
                DeviceState::Boot => (ink.accent, "Starting"),
                DeviceState::Homing => (ink.warning, "No reference"),
                DeviceState::Idle => (ink.text_weak, "Idle"),
                DeviceState::Armed => (ink.good, "Armed"),
                DeviceState::Active => (ink.held, "Holding"),
                DeviceState::SoftStop => (ink.warning, "Stopping"),
                DeviceState::Stopped => (theme::STOP_HOVER, "Stopped"),
                DeviceState::Fault(_) => (theme::STOP_HOVER, "Fault"),
                DeviceState::Testing => (ink.good, "Testing"),
            };
            let document = session.document.as_ref();
            let words = |part, doing: &str| Some(format!("{doing}: {}", document?.moving_name(part)));
            let held = session.grabbed().and_then(|part| words(part, "Holding"));
            let clutched = session.clutched().and_then(|part| words(part, "Clutch open"));
            let named = clutched.or(held);
            (color, named.unwrap_or_else(|| text.to_owned()), describe(device))
        }
    };
    control::chip(ui, color, &text, width).on_hover_text(hover);
}
