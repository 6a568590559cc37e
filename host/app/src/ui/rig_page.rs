//! The workspace for the rig: its description and firmware on the left, the described mechanism and its commissioning on the right.

use egui::{ScrollArea, Ui, Vec2};

use super::{commissioning, control, description, firmware, mechanism};
use crate::session::{Intent, Session};

/// Width from which the two stand side by side, points.
const SIDE_BY_SIDE: f32 = 640.0;

/// A section of the page.
type Section = fn(&mut Ui, &Session, &mut Vec<Intent>);

/// Draws the page.
pub fn show(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
    let side_by_side = ui.available_width() >= SIDE_BY_SIDE;
    let size = ui.available_size();
    if side_by_side {
        ui.horizontal_top(|ui| {
            let half = Vec2::new(0.5 * (size.x - 24.0), size.y);
            for (name, draw) in [("board", board as Section), ("commissioning", beside)] {
                ui.allocate_ui(half, |ui| {
                    scrolled(ui, name, |ui| draw(ui, session, wanted));
                });
                ui.add_space(12.0);
            }
        });
    } else {
        scrolled(ui, "rig page", |ui| {
            beside(ui, session, wanted);
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

/// Draws what stands beside the description: commissioning, the described mechanism, and what is read of the rig, which comes before the mechanism while
/// steps are under way.
fn beside(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
    let (steps, picture): (Section, Section) = (commissioning::show, mechanism::show);
    let readings = session.connection().map(|_| commissioning::readings as Section);
    let sections = match session.rig_page.steps {
        None => [Some(steps), Some(picture), readings],
        Some(_) => [Some(steps), readings, Some(picture)],
    };
    for (number, section) in sections.into_iter().flatten().enumerate() {
        if number > 0 {
            control::divider(ui);
        }
        section(ui, session, wanted);
    }
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
