//! The files opened last: on the empty page, and in the menu beside *Open…*.

use std::ffi::OsStr;
use std::path::Path;

use egui::text::LayoutJob;
use egui::{Align, Button, FontId, Layout, Rect, RichText, TextFormat, Ui, UiBuilder, Vec2};

use super::{control, theme};
use crate::session::{Intent, Session};

/// Height of a line, points.
const LINE: f32 = 24.0;
/// Width of the list on the empty page, points.
const WIDTH: f32 = 420.0;
/// Space from the middle of the page to the list, points: below the card that invites to drop a file.
const BELOW: f32 = 178.0;

/// Draws the list on the empty page, as far as there is space below its card.
pub fn on_empty_page(ui: &mut Ui, rect: Rect, session: &Session, wanted: &mut Vec<Intent>) {
    if session.document.is_some() || session.is_busy() || session.preferences.recent.iter().len() == 0 {
        return;
    }
    let top = rect.center().y + BELOW;
    let lines = ((rect.bottom() - 8.0 - top) / LINE).floor() - 1.0;
    if lines < 1.0 {
        return;
    }
    let width = WIDTH.min(rect.width() - 24.0);
    let place = Rect::from_min_size(
        egui::pos2(rect.center().x - 0.5 * width, top),
        Vec2::new(width, rect.bottom() - 8.0 - top),
    );
    ui.scope_builder(UiBuilder::new().max_rect(place), |ui| {
        ui.spacing_mut().item_spacing.y = 0.0;
        ui.spacing_mut().button_padding.y = 2.0;
        control::section(ui, "Recent files");
        for file in session.preferences.recent.iter().take(lines as usize) {
            line(ui, session, file, wanted);
        }
    });
}

/// Draws the list as items of a menu.
pub fn in_menu(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
    control::section(ui, "Recent files");
    if session.preferences.recent.iter().len() == 0 {
        ui.label(RichText::new("None yet").color(theme::of(ui).text_weak));
    }
    for file in session.preferences.recent.iter() {
        line(ui, session, file, wanted);
    }
}

/// One file: its name and its folder. A missing one says so, and can be taken out of the list; it may also be opened, as it can be back.
fn line(ui: &mut Ui, session: &Session, file: &Path, wanted: &mut Vec<Intent>) {
    let missing = session.missing.iter().any(|missing| missing == file);
    let text =
        |part: Option<&OsStr>| part.map_or_else(String::new, |part| part.to_string_lossy().into_owned());
    let name = text(file.file_name());
    let ink = theme::of(ui);
    let (strong, weak, note) = match missing {
        true => (ink.text_weak, ink.warning, "missing".to_owned()),
        false => (
            ink.text_strong,
            ink.text_weak,
            text(file.parent().map(Path::as_os_str)),
        ),
    };
    let format = |size, color| TextFormat::simple(FontId::proportional(size), color);
    let mut job = LayoutJob::default();
    job.append(&name, 0.0, format(13.0, strong));
    job.append(&note, 10.0, format(11.0, weak));
    ui.allocate_ui_with_layout(
        Vec2::new(ui.available_width(), LINE),
        Layout::right_to_left(Align::Center),
        |ui| {
            if missing {
                let forget = ui.add(Button::new("×").frame(false));
                if forget.clicked() {
                    wanted.push(Intent::ForgetRecent(file.to_owned()));
                }
                forget
                    .accessible_name(format!("Forget {name}"))
                    .on_hover_text("Take it out of the list");
            }
            let open = Intent::Open(file.to_owned());
            let button = Button::new(job).frame(false).truncate();
            let path = file.display();
            let hint = match missing {
                true => format!("{path} was not there when the list was checked"),
                false => path.to_string(),
            };
            ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                let response = control::intent_button(ui, session, wanted, button, open, &hint);
                if response.clicked() {
                    ui.close();
                }
                response.accessible_name(match missing {
                    true => format!("{name}, missing"),
                    false => name,
                });
            });
        },
    );
}
