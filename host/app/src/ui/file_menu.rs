//! The menu beside *Open…*: the project, and the files opened last.

use egui::{Button, Shape, Stroke, Ui, Vec2};

use super::{control, recent, theme};
use crate::session::workspace::Workspace;
use crate::session::{Intent, Session};

/// Draws the button that opens the menu.
pub fn show(ui: &mut Ui, session: &Session, help: &mut bool, wanted: &mut Vec<Intent>, height: f32) {
    let button = Button::new("").min_size(Vec2::new(26.0, height));
    let (response, _) = egui::containers::menu::MenuButton::from_button(button).ui(ui, |ui| {
        ui.set_min_width(240.0);
        ui.set_max_width(460.0);
        let save = Button::new("Save project as…").frame(false);
        let hint = "Write placements, hidden parts, choices of fits, settings, signals and the rig to a file. They also save themselves, and come back when the model is opened again";
        if control::intent_button(ui, session, wanted, save, Intent::SaveProject, hint).clicked() {
            ui.close();
        }
        let others = Workspace::ALL.into_iter();
        for workspace in others.filter(|workspace| *workspace != session.workspace) {
            let text = format!("Workspace {}", workspace.name());
            let button = ui.add(Button::new(text).frame(false));
            if button.on_hover_text(workspace.hint()).clicked() {
                wanted.push(Intent::Show(workspace));
                ui.close();
            }
        }
        let keys = Button::new("Keys").frame(false);
        if ui.add(keys).on_hover_text("What the keys and the pointer do (F1)").clicked() {
            *help = true;
            ui.close();
        }
        control::divider(ui);
        recent::in_menu(ui, session, wanted);
    });
    // An arrow that points down; the fonts have none.
    let corners = [Vec2::new(-4.0, -2.0), Vec2::new(4.0, -2.0), Vec2::new(0.0, 3.0)];
    let corners = corners.map(|corner| response.rect.center() + corner).to_vec();
    let ink = theme::of(ui).text_strong;
    ui.painter()
        .add(Shape::convex_polygon(corners, ink, Stroke::NONE));
    response.accessible_name("File menu");
}
