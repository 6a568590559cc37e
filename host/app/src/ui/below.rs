//! What is at the lower end of the panel of parts, each folded until it is opened: joints, connections, the sequence, and clearances.

use egui::{Frame, Panel, ScrollArea, Ui};

use super::clearances::Clearances;
use super::connections::Connections;
use super::filmstrip::Filmstrip;
use super::{control, joints, sequence};
use crate::session::{Intent, Session};
use crate::viewport::gesture::Viewpoint;

/// Height that is left to the list of parts, at most half of the panel, points.
const PARTS_HEIGHT: f32 = 170.0;

/// State of the sections.
#[derive(Default)]
pub struct Below {
    connections: Connections,
    filmstrip: Filmstrip,
    clearances: Clearances,
    /// Height of the sections in the last frame, points.
    height: f32,
}

impl Below {
    /// Takes in a finished search.
    pub fn poll(&mut self) {
        self.clearances.poll();
    }

    /// Draws the sections.
    pub fn show(&mut self, ui: &mut Ui, session: &Session, view: &mut Viewpoint, wanted: &mut Vec<Intent>) {
        let height = ui.available_height();
        let room = (height - PARTS_HEIGHT).max(0.5 * height);
        let drawn = Panel::bottom("clearances")
            .resizable(false)
            .frame(Frame::NONE)
            .show(ui, |ui| {
                ScrollArea::vertical()
                    .id_salt("below")
                    .auto_shrink([false, true])
                    .max_height(room)
                    .min_scrolled_height(room)
                    .show(ui, |ui| {
                        ui.spacing_mut().item_spacing.y = 2.0;
                        joints::show(ui, session, wanted);
                        self.connections.show(ui, session, view, wanted);
                        sequence::show(ui, &mut self.filmstrip, session, view, wanted);
                        self.clearances.show(ui, session, view);
                    });
            });
        control::settle(ui, drawn.response.rect.height(), &mut self.height);
    }
}
