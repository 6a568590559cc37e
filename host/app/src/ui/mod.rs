//! The window: draws a [`Session`] and hands it the operator's wishes. Works without a graphics device, so that tests can drive it.

pub mod app;
mod control;
mod drop;
mod guidance;
mod header;
mod messages;
mod open;
mod parameters;
mod parts;
mod plots;
mod rig;
mod stop;
pub mod theme;
mod view;

use egui::{Key, Modifiers, Ui};

use crate::session::{Intent, Session};
use crate::viewport::gesture::Viewpoint;
use crate::viewport::surface::Surface;

/// Everything between the session and the screen.
pub struct Window {
    /// What is shown.
    pub session: Session,
    /// From where.
    pub view: Viewpoint,
    path: open::PathDialog,
}

impl Window {
    /// Shows `session`.
    pub fn new(session: Session) -> Self {
        Self {
            session,
            view: Viewpoint::default(),
            path: open::PathDialog::default(),
        }
    }

    /// One picture. `surface` draws the 3D view where there is a graphics device.
    pub fn show(&mut self, ui: &mut Ui, surface: Option<&mut Surface>) {
        self.session.poll();
        let mut wanted = Vec::new();
        stop::keys(ui.ctx(), &self.session, &mut wanted);
        shortcuts(ui, &mut wanted);
        let session = &mut self.session;
        header::show(ui, session, &mut wanted);
        egui::Panel::bottom("below")
            .default_size(216.0)
            .size_range(140.0..=420.0)
            .frame(theme::panel())
            .show(ui, |ui| {
                egui::Panel::right("messages")
                    .default_size(400.0)
                    .size_range(220.0..=700.0)
                    .frame(egui::Frame::NONE.inner_margin(egui::Margin {
                        left: 14,
                        ..Default::default()
                    }))
                    .show(ui, |ui| messages::show(ui, session));
                egui::CentralPanel::default()
                    .frame(egui::Frame::NONE.inner_margin(egui::Margin {
                        right: 14,
                        ..Default::default()
                    }))
                    .show(ui, |ui| plots::show(ui, session));
            });
        parts::show(ui, session, &mut wanted);
        rig::show(ui, session, &mut wanted);
        egui::CentralPanel::default()
            .frame(egui::Frame::NONE.fill(theme::GROUND))
            .show(ui, |ui| {
                let rect = ui.available_rect_before_wrap();
                view::show(ui, session, &mut self.view, surface, &mut wanted);
                open::job(ui, rect, session, &mut wanted);
            });
        drop::show(ui.ctx(), session, &mut wanted);
        self.path.show(ui.ctx(), session, &mut wanted);
        // STOP first, whatever else was wanted in the same picture.
        wanted.sort_by_key(|intent| *intent != Intent::Stop);
        for intent in wanted {
            self.session.act(intent);
        }
    }
}

fn shortcuts(ui: &Ui, wanted: &mut Vec<Intent>) {
    ui.input_mut(|input| {
        if input.consume_key(Modifiers::COMMAND, Key::O) {
            wanted.push(Intent::Browse);
        }
    });
}
