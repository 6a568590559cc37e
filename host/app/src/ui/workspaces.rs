//! The buttons that choose the workspace.

use egui::{RichText, Ui, Vec2};

use super::theme;
use crate::session::workspace::Workspace;
use crate::session::{Intent, Session};

/// Width of the buttons, points.
pub const WIDTH: f32 = 214.0;

/// Draws the buttons.
pub fn show(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>, height: f32) {
    ui.spacing_mut().item_spacing.x = 2.0;
    for workspace in Workspace::ALL {
        let text = RichText::new(workspace.name()).size(12.5);
        let text = text.color(theme::of(ui).text_strong);
        let button = egui::Button::selectable(session.workspace == workspace, text);
        let button = ui.add(button.min_size(Vec2::new(0.0, height)));
        if button.on_hover_text(workspace.hint()).clicked() {
            wanted.push(Intent::Show(workspace));
        }
    }
}
