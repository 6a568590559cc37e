//! Opening by path where there is no file dialog, and the card that shows how far reading or baking is.

use std::path::PathBuf;

use egui::{Align2, Id, Key, Modal, Rect, RichText, TextEdit, Ui, Vec2};

use super::{control, theme};
use crate::session::{Intent, Session};

/// Asks for a path.
#[derive(Clone, Debug, Default)]
pub struct PathDialog {
    text: String,
    fresh: bool,
}

impl PathDialog {
    /// Shows it while the session wants a path.
    pub fn show(&mut self, ctx: &egui::Context, session: &mut Session, wanted: &mut Vec<Intent>) {
        if !session.wants_path {
            self.fresh = true;
            return;
        }
        let mut done = false;
        let modal = Modal::new(Id::unique("path"))
            .frame(theme::card().fill(theme::CARD).inner_margin(20))
            .backdrop_color(egui::Color32::from_black_alpha(90))
            .show(ctx, |ui| {
                ui.set_width(460.0);
                ui.label(
                    RichText::new("Open STEP file")
                        .size(18.0)
                        .color(theme::TEXT_STRONG),
                );
                ui.label(
                    RichText::new("This desktop offers no file dialog: give the path, or drop the file onto the window.")
                        .color(theme::TEXT_WEAK),
                );
                ui.add_space(6.0);
                let edit = TextEdit::singleline(&mut self.text)
                    .hint_text("/folder/assembly.step")
                    .desired_width(f32::INFINITY)
                    .margin(Vec2::new(8.0, 7.0));
                let field = ui.add(edit);
                if self.fresh {
                    field.request_focus();
                    self.fresh = false;
                }
                let entered = field.lost_focus() && ui.input(|i| i.key_pressed(Key::Enter));
                ui.add_space(8.0);
                ui.horizontal(|ui| {
                    let path = self.text.trim();
                    let open = control::primary("Open").min_size(Vec2::new(96.0, 30.0));
                    let open = ui.add_enabled(!path.is_empty(), open);
                    if (open.clicked() || entered) && !path.is_empty() {
                        wanted.push(Intent::Open(PathBuf::from(path)));
                        done = true;
                    }
                    open.on_disabled_hover_text("Give a path first");
                    if ui
                        .add(egui::Button::new("Cancel").min_size(Vec2::new(96.0, 30.0)))
                        .clicked()
                    {
                        done = true;
                    }
                });
            });
        if done || modal.should_close() {
            session.wants_path = false;
        }
    }
}

/// How far reading or baking is, over the lower middle of the view.
pub fn job(ui: &Ui, rect: Rect, session: &Session, wanted: &mut Vec<Intent>) {
    let Some(job) = &session.job else { return };
    egui::Area::new(Id::unique("job"))
        .pivot(Align2::CENTER_BOTTOM)
        .fixed_pos(rect.center_bottom() - Vec2::new(0.0, 44.0))
        .order(egui::Order::Middle)
        .show(ui.ctx(), |ui| {
            theme::card().show(ui, |ui| {
                ui.set_width(380.0);
                ui.horizontal(|ui| {
                    ui.add(egui::Spinner::new().size(16.0).color(theme::ACCENT));
                    let text = RichText::new(&job.doing).color(theme::TEXT_STRONG);
                    let room = ui.available_width() - 70.0;
                    ui.add_sized(
                        Vec2::new(room, 20.0),
                        egui::Label::new(text).truncate().halign(egui::Align::Min),
                    );
                    let cancel = egui::Button::new("Cancel").small();
                    control::intent_button(ui, session, wanted, cancel, Intent::CancelWork, "");
                });
                let bar = match job.fraction {
                    Some(fraction) => egui::ProgressBar::new(fraction),
                    // How long the CAD kernel takes it does not tell.
                    None => egui::ProgressBar::new(1.0).animate(true),
                };
                ui.add(bar.desired_height(6.0).fill(theme::ACCENT));
            });
        });
}
