//! The workspace for the rig: its description and firmware on the left, its commissioning on the right.

use egui::{ScrollArea, Ui, Vec2};

use super::{commissioning, control, description, firmware};
use crate::session::{Intent, Session};

/// Width from which the two stand side by side, points.
const SIDE_BY_SIDE: f32 = 640.0;

/// Draws the page.
pub fn show(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
    let side_by_side = ui.available_width() >= SIDE_BY_SIDE;
    let size = ui.available_size();
    if side_by_side {
        ui.horizontal_top(|ui| {
            let half = Vec2::new(0.5 * (size.x - 24.0), size.y);
            for (name, draw) in [
                ("board", board as fn(&mut Ui, &Session, &mut Vec<Intent>)),
                ("commissioning", commissioning::show),
            ] {
                ui.allocate_ui(half, |ui| {
                    scrolled(ui, name, |ui| draw(ui, session, wanted));
                });
                ui.add_space(12.0);
            }
        });
    } else {
        scrolled(ui, "rig page", |ui| {
            commissioning::show(ui, session, wanted);
            control::divider(ui);
            board(ui, session, wanted);
        });
    }
}

/// Draws what the board keeps: description and firmware.
fn board(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
    description::show(ui, session, wanted);
    control::divider(ui);
    firmware::show(ui, session, wanted);
}

fn scrolled(ui: &mut Ui, name: &str, draw: impl FnOnce(&mut Ui)) {
    ScrollArea::vertical()
        .id_salt(name)
        .auto_shrink([false, false])
        .show(ui, |ui| {
            // The scroll bar covers no values.
            let width = ui.available_width() - 10.0;
            ui.vertical(|ui| {
                ui.set_max_width(width);
                draw(ui);
            });
        });
}
