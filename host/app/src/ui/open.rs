//! Dialog for the path of a file, for desktops without a file dialog.

use std::path::PathBuf;

use egui::{Align2, Id, Key, Modal, RichText, TextEdit, Ui, Vec2};

use super::{control, header, theme};
use crate::session::ask::answer;
use crate::session::{Intent, Session};

/// Margin inside the dialog, points.
const MARGIN: f32 = 20.0;

/// A dialog for a path.
#[derive(Clone, Debug, Default)]
pub struct PathDialog {
    text: String,
    fresh: bool,
    replace: bool,
}

impl PathDialog {
    /// Draws the dialog while the session waits for a path.
    pub fn show(&mut self, ui: &Ui, session: &mut Session, wanted: &mut Vec<Intent>) {
        let ctx = ui.ctx();
        let Some(purpose) = session.wants_path else {
            self.fresh = true;
            self.replace = false;
            return;
        };
        let mut done = false;
        // Placed below the bar, so that STOP and the state stay visible.
        let size = ctx.content_rect().size();
        let below = header::height(size.x) + 4.0;
        let room = egui::Rect::from_min_max(egui::pos2(0.0, below), size.to_pos2());
        let area = Modal::default_area(Id::unique("path"))
            .anchor(Align2::CENTER_TOP, Vec2::new(0.0, below.max(0.3 * size.y)))
            .constrain_to(room);
        let modal = Modal::new(Id::unique("path"))
            .area(area)
            .frame(theme::card(theme::of(ui)).fill(theme::of(ui).card).inner_margin(MARGIN))
            .backdrop_color(egui::Color32::from_black_alpha(90))
            .show(ctx, |ui| {
                ui.set_width(460.0f32.min(size.x - 60.0).max(120.0));
                // Contents that do not fit under the bar scroll; otherwise the area would cover STOP.
                let height = (room.height() - 2.0 * MARGIN - 4.0).max(20.0);
                egui::ScrollArea::vertical().max_height(height).show(ui, |ui| {
                ui.label(
                    RichText::new(purpose.title())
                        .size(18.0)
                        .color(theme::of(ui).text_strong),
                );
                let hint = match purpose.is_saved() {
                    true => "This desktop offers no file dialog: enter the path of the file to write.",
                    false => "This desktop offers no file dialog: enter the path, or drop the file onto the window.",
                };
                ui.label(RichText::new(hint).color(theme::of(ui).text_weak));
                ui.add_space(6.0);
                let edit = TextEdit::singleline(&mut self.text)
                    .hint_text(purpose.example())
                    .desired_width(f32::INFINITY)
                    .margin(Vec2::new(8.0, 7.0));
                let field = ui.add(edit);
                if self.fresh {
                    field.request_focus();
                    self.fresh = false;
                }
                let entered = field.lost_focus() && ui.input(|i| i.key_pressed(Key::Enter));
                if purpose.is_saved() {
                    ui.checkbox(&mut self.replace, "Replace an existing file");
                }
                ui.add_space(8.0);
                ui.horizontal(|ui| {
                    let path = self.text.trim();
                    let open = control::primary(ui, if purpose.is_saved() { "Save" } else { "Open" }).min_size(Vec2::new(96.0, 30.0));
                    let open = ui.add_enabled(!path.is_empty(), open);
                    if (open.clicked() || entered) && !path.is_empty() {
                        wanted.push(answer(purpose, PathBuf::from(path), self.replace));
                        done = true;
                    }
                    open.on_disabled_hover_text("Enter a path first");
                    if ui
                        .add(egui::Button::new("Cancel").min_size(Vec2::new(96.0, 30.0)))
                        .clicked()
                    {
                        done = true;
                    }
                });
                });
            });
        if done || modal.should_close() {
            session.wants_path = None;
        }
    }
}
