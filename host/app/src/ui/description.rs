//! The description of the rig as text, checked while it is written.

use egui::{FontId, RichText, TextEdit, Ui, Vec2};
use mortise_rig::{Abilities, EXAMPLES};

use super::{control, theme};
use crate::session::rig_page::RigIntent;
use crate::session::{Intent, Session};

/// Rows of the editor.
const ROWS: usize = 22;

/// Draws the editor, the abilities of the described rig, and the actions on it.
pub fn show(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
    let page = &session.rig_page;
    control::section(ui, "Description");
    ui.add_space(4.0);
    ui.horizontal_wrapped(|ui| {
        let mut act = |ui: &mut Ui, text: &str, intent: RigIntent, hint: &str| {
            let button = egui::Button::new(text).min_size(Vec2::new(0.0, 28.0));
            control::intent_button(ui, session, wanted, button, Intent::Rig(intent), hint);
        };
        act(
            ui,
            "From board",
            RigIntent::Read,
            "Read the description that the board keeps",
        );
        act(
            ui,
            "Open file…",
            RigIntent::Browse,
            "Read a description from a file (TOML)",
        );
        act(
            ui,
            "Save file…",
            RigIntent::Save,
            "Write the description to a file, as a backup",
        );
        examples(ui, wanted);
    });
    ui.add_space(4.0);
    let mut text = page.text().to_owned();
    let edit = TextEdit::multiline(&mut text)
        .font(FontId::monospace(12.0))
        .code_editor()
        .hint_text(
            "Choose an example, open a file, or read what the board keeps. docs/rigs.md explains every key.",
        )
        .desired_rows(ROWS)
        .desired_width(f32::INFINITY);
    let response = egui::ScrollArea::both()
        .id_salt("text")
        .max_height(ROWS as f32 * 16.0)
        .auto_shrink([false, true])
        .show(ui, |ui| ui.add(edit))
        .inner;
    if response.changed() {
        wanted.push(Intent::Rig(RigIntent::Edit(text)));
    }
    response.accessible_name("Text of the description");
    ui.add_space(4.0);
    match page.checked() {
        None => {}
        Some(Err(why)) => {
            ui.label(RichText::new(why).color(theme::of(ui).warning));
        }
        Some(Ok(checked)) => abilities(ui, &checked.abilities),
    }
    ui.add_space(4.0);
    let send = control::primary(ui, "Send to board").min_size(Vec2::new(0.0, 30.0));
    let hint = "The board stores it and starts again with it; motors stay off";
    control::intent_button(ui, session, wanted, send, Intent::Rig(RigIntent::Send), hint);
    ui.label(
        RichText::new(state(session))
            .small()
            .color(theme::of(ui).text_weak),
    );
}

fn examples(ui: &mut Ui, wanted: &mut Vec<Intent>) {
    let list = egui::ComboBox::from_id_salt("examples")
        .selected_text("Examples")
        .width(110.0)
        .show_ui(ui, |ui| {
            for (number, (name, _)) in EXAMPLES.iter().enumerate() {
                if ui.selectable_label(false, *name).clicked() {
                    wanted.push(Intent::Rig(RigIntent::Example(number)));
                }
            }
        });
    list.response.accessible_name("Examples of descriptions");
}

/// What the described rig will be able to do.
fn abilities(ui: &mut Ui, found: &Abilities) {
    ui.spacing_mut().item_spacing.y = 2.0;
    let sensed = if found.senses_orientation {
        "position and orientation"
    } else {
        "position"
    };
    control::row(ui, "Motors, senses", format!("{}, {sensed}", found.joints));
    control::row(
        ui,
        "Force, weakest to strongest direction",
        format!("{:.2} to {:.2} N", found.force_weakest_n, found.force_strongest_n),
    );
    control::row(
        ui,
        "One count at the handle",
        format!("at most {:.4} mm", found.resolution_mm),
    );
    control::row(
        ui,
        "Friction at the handle",
        format!("at most {:.2} N", found.friction_n),
    );
    let singular = "1: all directions alike; 0: the motors cannot push in some direction";
    control::row(ui, "Isotropy at home", format!("{:.2}", found.isotropy)).on_hover_text(singular);
}

/// Whether the board uses what the text describes.
fn state(session: &Session) -> String {
    let page = &session.rig_page;
    if let Some(busy) = page.busy {
        return format!("{busy}…");
    }
    match (&page.on_board, session.connection()) {
        (_, None) => "No rig is connected.".to_owned(),
        (None, _) => "The board's description has not been read yet.".to_owned(),
        (Some((None, _)), _) => "The board keeps no description.".to_owned(),
        (Some((Some(rig), false)), _) => format!("The board keeps {} but does not use it.", rig.name),
        (Some((Some(rig), true)), _) if page.is_in_use() => {
            format!("The board uses this description of {}.", rig.name)
        }
        (Some((Some(rig), true)), _) => format!("The board uses another description, of {}.", rig.name),
    }
}
