//! The right side: choice of the rig, its data, the hand's actions, and the parameters.

use egui::text::LayoutJob;
use egui::{FontId, Response, RichText, ScrollArea, TextFormat, Ui, Vec2};
use mortise_protocol::message::{Capabilities, CostUnit};
use mortise_rig::{EmulatedMode, RigEntry, RigSpec};

use super::{control, fits, guidance, parameters, theme};
use crate::session::link::{Connection, Link};
use crate::session::{Intent, Session, obstacle, remaining};

/// Width of the list of rigs, points.
const CHOOSER_WIDTH: f32 = 380.0;

/// Draws the panel.
pub fn show(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
    ScrollArea::vertical()
        .id_salt("rig")
        .auto_shrink([false, false])
        .show(ui, |ui| {
            control::section(ui, "Rig");
            ui.add_space(2.0);
            chooser(ui, session, wanted);
            connect(ui, session, wanted);
            if let Some(connection) = session.connection() {
                ui.add_space(4.0);
                facts(ui, session, connection);
                scene(ui, session, connection, wanted);
            }
            control::divider(ui);
            control::section(ui, "Hand");
            ui.add_space(2.0);
            hand(ui, session, wanted);
            control::divider(ui);
            // With a board, what it guides by comes first.
            let (first, second): (Section, Section) = match session.connection() {
                Some(_) => (guidance::show, fits::show),
                None => (fits::show, guidance::show),
            };
            first(ui, session, wanted);
            control::divider(ui);
            second(ui, session, wanted);
            control::divider(ui);
            parameters::show(ui, session, wanted);
        });
}

/// A section of the panel.
type Section = fn(&mut Ui, &Session, &mut Vec<Intent>);

fn label_of(session: &Session, spec: &RigSpec) -> String {
    let entry = session.rigs.iter().find(|entry| entry.spec == *spec);
    entry.map_or_else(|| spec.to_string(), |entry| entry.label.clone())
}

fn chooser(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
    let blocked = obstacle(session, &Intent::ChooseRig(session.chosen.clone()));
    ui.horizontal(|ui| {
        let wide = ui.available_width() - 74.0;
        let chooser = ui.add_enabled_ui(blocked.is_none(), |ui| {
            let list = egui::ComboBox::from_id_salt("rig")
                .width(wide)
                .selected_text(label_of(session, &session.chosen))
                .truncate()
                .height(420.0)
                .show_ui(ui, |ui| {
                    ui.set_min_width(CHOOSER_WIDTH);
                    for entry in &session.rigs {
                        if choice(ui, entry, entry.spec == session.chosen).clicked() {
                            wanted.push(Intent::ChooseRig(entry.spec.clone()));
                        }
                    }
                });
            list.response.accessible_name("Rig");
        });
        chooser.response.on_hover_text(match &blocked {
            Some(reason) => reason.clone(),
            None => "Simulated rigs and serial ports".to_owned(),
        });
        let again = egui::Button::new("Rescan").min_size(Vec2::new(64.0, 26.0));
        control::intent_button(
            ui,
            session,
            wanted,
            again,
            Intent::RefreshRigs,
            "Search for rigs again",
        );
    });
}

/// An entry of two lines: the rig's name, and its kind or the reason why it cannot be used.
fn choice(ui: &mut Ui, entry: &RigEntry, chosen: bool) -> Response {
    let (ink, text, color) = match &entry.available {
        Ok(()) => (theme::of(ui).text_strong, &entry.detail, theme::of(ui).text_weak),
        Err(hint) => (theme::of(ui).text_weak, hint, theme::of(ui).warning),
    };
    let mut job = LayoutJob::default();
    let format = |size, color| TextFormat::simple(FontId::proportional(size), color);
    job.append(&entry.label, 0.0, format(13.5, ink));
    job.append("\n", 0.0, format(13.5, ink));
    job.append(text, 0.0, format(11.5, color));
    job.wrap.max_width = CHOOSER_WIDTH - 24.0;
    let size = Vec2::new(ui.available_width(), 0.0);
    let line = ui.add(egui::Button::selectable(chosen, job).wrap().min_size(size));
    line.accessible_name(&entry.label)
}

fn connect(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
    ui.vertical_centered_justified(|ui| connect_button(ui, session, wanted));
}

fn connect_button(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
    let wide = Vec2::new(0.0, 32.0);
    match &session.link {
        Link::None => {
            let button = control::primary(ui, "Connect").min_size(wide);
            let hint = "Open the link to the board. Motors stay off until armed";
            control::intent_button(ui, session, wanted, button, Intent::Connect, hint);
            let chosen = session.rigs.iter().find(|entry| entry.spec == session.chosen);
            if let Some(Err(hint)) = chosen.map(|entry| &entry.available) {
                ui.label(RichText::new(hint).small().color(theme::of(ui).warning));
            }
        }
        Link::Connecting { .. } => {
            ui.horizontal(|ui| {
                ui.add(egui::Spinner::new().size(18.0).color(theme::of(ui).accent));
                ui.label("Waiting for the board to answer");
            });
            let button = egui::Button::new("Cancel").min_size(wide);
            control::intent_button(ui, session, wanted, button, Intent::Disconnect, "");
        }
        Link::Connected(_) => {
            let button = egui::Button::new("Disconnect").min_size(wide);
            let hint = "Motors off, and close the link";
            control::intent_button(ui, session, wanted, button, Intent::Disconnect, hint);
        }
    }
}

fn facts(ui: &mut Ui, session: &Session, connection: &Connection) {
    let can = &connection.capabilities;
    ui.spacing_mut().item_spacing.y = 2.0;
    control::row(ui, "Board", can.board.to_string());
    control::row(ui, "Loop", format!("{} Hz", can.tick_hz));
    control::row(ui, "Handle", handle(can));
    if let Some(at) = session.handle().map(|pose| pose.translation) {
        let text = format!("{:.1}, {:.1}, {:.1} mm", at.x, at.y, at.z);
        control::row(ui, "Position", text)
            .on_hover_text("Of the handle: x forward, y left, z up, from the centre of the workspace");
    }
    if session.history.newest().is_some() {
        late(ui, connection, session.history.late());
    }
    if let Some(statistics) = &connection.statistics {
        let (factor, unit) = cost_scale(connection);
        let peak = format!("{:.1} {unit}", statistics.cost_max as f32 * factor);
        control::row(ui, "Longest loop time", peak);
    }
    let counts = connection.link_counts();
    if counts.bad_frames > 0 {
        control::row(ui, "Damaged frames", counts.bad_frames.to_string());
    }
}

fn late(ui: &mut Ui, connection: &Connection, late: u32) {
    let hint = match (late, &connection.spec) {
        (0, _) => "Every loop of the last ten seconds met its deadline",
        (_, RigSpec::Simulated { .. }) => {
            "This computer was busy with other work: the simulation runs by its clock"
        }
        (_, RigSpec::Emulated { .. }) => {
            "The emulator runs at about the clock's speed: use counted mode to measure the board's loop time"
        }
        (_, RigSpec::Serial { .. }) => {
            "A smaller point budget or a coarser collision model shortens the loop"
        }
    };
    let text = match late {
        0 => RichText::new("none"),
        n => RichText::new(n.to_string()).color(theme::of(ui).warning),
    };
    control::rich_row(ui, "Loop overruns, last 10 s", text).on_hover_text(hint);
}

fn handle(can: &Capabilities) -> String {
    let axes = format!("{} force, {} torque axes", can.force_axes, can.torque_axes);
    if can.simulated {
        format!("simulated, {axes}")
    } else {
        axes
    }
}

/// Factor from the board's cost unit to the displayed one, and the displayed unit.
///
/// An emulator that does not count instructions runs by this computer's clock: its "instructions" are time, and its budget is one period.
pub fn cost_scale(connection: &Connection) -> (f32, &'static str) {
    let can = &connection.capabilities;
    let counting = !matches!(
        connection.spec,
        RigSpec::Emulated {
            mode: EmulatedMode::Interactive,
            ..
        }
    );
    match can.cost_unit {
        CostUnit::Instructions if counting => (1e-3, "k instructions"),
        CostUnit::Instructions => {
            let period_us = 1e6 / f32::from(can.tick_hz.max(1));
            (period_us / can.cost_budget.max(1) as f32, "µs")
        }
        CostUnit::Cycles => (1e-3, "k cycles"),
        CostUnit::Nanoseconds => (1e-3, "µs"),
    }
}

fn scene(ui: &mut Ui, session: &Session, connection: &Connection, wanted: &mut Vec<Intent>) {
    if let Some(upload) = connection.upload {
        let part = upload.sent as f32 / upload.total.max(1) as f32;
        let left = remaining::left(connection.upload_since.elapsed(), part).map(remaining::words);
        let (sent, total) = (upload.sent / 1024, upload.total.div_ceil(1024));
        let text = format!("{sent} of {total} KiB, {}", left.as_deref().unwrap_or("…"));
        ui.add_space(2.0);
        control::row(ui, "Collision model", "uploading");
        ui.horizontal(|ui| {
            let bar = egui::ProgressBar::new(part)
                .desired_width(ui.available_width() - 74.0)
                .desired_height(24.0)
                .fill(theme::of(ui).accent_dim)
                .text(text);
            ui.add(bar);
            let cancel = egui::Button::new("Cancel").min_size(Vec2::new(64.0, 24.0));
            let hint = "The model on the board stays in use";
            control::intent_button(ui, session, wanted, cancel, Intent::CancelUpload, hint)
                .accessible_name("Cancel upload");
        });
        return;
    }
    let state = if session.scene_is_on_board() {
        "on the board"
    } else if session.document.is_none() {
        "nothing open"
    } else {
        "not on the board"
    };
    control::row(ui, "Collision model", state);
    let missing =
        session.document.as_ref().is_some_and(|d| d.baked.is_some()) && !session.scene_is_on_board();
    if missing {
        let button = egui::Button::new("Upload model").min_size(Vec2::new(0.0, 28.0));
        let hint = "The current model stays in use until the new one has arrived completely";
        ui.vertical_centered_justified(|ui| {
            control::intent_button(ui, session, wanted, button, Intent::Upload, hint);
        });
    }
}

fn hand(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
    let half = Vec2::new(0.5 * (ui.available_width() - 8.0), 30.0);
    ui.horizontal(|ui| {
        let play = egui::Button::new("Play insertion").min_size(half);
        let hint = "The simulated hand arms, grabs the peg and inserts it into the hole";
        control::intent_button(ui, session, wanted, play, Intent::PlayInsertion, hint);
        let back = egui::Button::new("Reset parts").min_size(half);
        let hint = "Move every part back to its position in the file";
        control::intent_button(ui, session, wanted, back, Intent::ResetScene, hint);
    });
    let simulated = session.connection().is_some_and(|c| c.capabilities.simulated);
    let text = match (simulated, session.grabbed()) {
        (true, Some(_)) => "Drag the part in the view to move the simulated hand; hold Ctrl to turn it.",
        (true, None) => "The hand is simulated: grab a part, then drag it in the view.",
        (false, _) if session.connection().is_some() => "Move the rig's handle to move the held part.",
        (false, _) => "Connect a rig to feel the parts, or to watch a simulated hand.",
    };
    ui.label(RichText::new(text).small().color(theme::of(ui).text_weak));
}
