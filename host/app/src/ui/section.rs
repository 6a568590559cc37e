//! The section view's controls over the 3D view: on or off, where the plane lies, and what is not filled.

use std::sync::Arc;
use std::time::Duration;

use egui::{Pos2, Rect, RichText, Slider, Ui, UiBuilder, Vec2};

use super::{control, cube, gaps, theme};
use crate::cut::Across;
use crate::session::Session;
use crate::session::document::Document;
use crate::viewport::gesture::Viewpoint;

/// Brings the section up to date with the plane and the parts; the work itself is done on another thread.
pub fn follow(ui: &Ui, document: &Document, view: &mut Viewpoint) {
    let wake = || -> Arc<dyn Fn() + Send + Sync> {
        let ctx = ui.ctx().clone();
        Arc::new(move || ctx.request_repaint())
    };
    let again = view.section.follow(document, wake);
    if let Some(after) = again {
        ui.ctx()
            .request_repaint_after(after.max(Duration::from_millis(5)));
    }
}

/// Draws the button that switches the section on and off.
pub fn toggle(ui: &mut Ui, document: &Document, view: &mut Viewpoint) {
    let button = control::flat(ui, "Section", view.section.on);
    let hint = "Cut the parts by a plane to see inside (X)";
    if ui.add(button).on_hover_text(hint).clicked() {
        view.section.toggle(document, view.camera.backward());
    }
}

/// Draws the bar of the section under the view's bar, which ends at `top`, while it is on; returns the lower end of both.
pub fn show(ui: &mut Ui, rect: Rect, top: f32, session: &Session, view: &mut Viewpoint) -> f32 {
    let Some(document) = session.document.as_ref().filter(|_| view.section.on) else {
        return top;
    };
    let place = Rect::from_min_max(
        Pos2::new(rect.left() + 12.0, top + 4.0),
        Pos2::new(
            (rect.left() + 690.0).min(rect.right() - 12.0 - cube::height(rect)),
            rect.bottom().max(top + 4.0),
        ),
    );
    let drawn = ui.scope_builder(UiBuilder::new().max_rect(place), |ui| {
        ui.horizontal_wrapped(|ui| {
            ui.spacing_mut().item_spacing.x = 4.0;
            ui.spacing_mut().button_padding = Vec2::new(9.0, 4.0);
            directions(ui, document, view);
            ui.add_space(6.0);
            offset(ui, document, view);
            gaps::controls(ui, view);
        });
        for line in remarks(document, view) {
            let weak = theme::of(ui).warning;
            ui.label(RichText::new(line).size(12.0).color(weak));
        }
    });
    drawn.response.rect.bottom()
}

fn directions(ui: &mut Ui, document: &Document, view: &mut Viewpoint) {
    let viewer = view.camera.backward();
    for (across, text) in [(Across::X, "x"), (Across::Y, "y"), (Across::Z, "z")] {
        let chosen = view.section.setting.across == across;
        let response = ui
            .add(control::flat(ui, text, chosen))
            .accessible_name(format!("Across {text}"))
            .on_hover_text(format!("Plane across the {text} axis"));
        if response.clicked() {
            view.section.lay(across, document.extent, viewer);
        }
    }
    let face = (view.picked)
        .and_then(|pick| Some((pick.part, pick.face?)))
        .and_then(|(part, face)| Across::along(document, part, face));
    let chosen = matches!(view.section.setting.across, Across::Face { .. });
    let response = ui
        .add_enabled(face.is_some(), control::flat(ui, "Face", chosen))
        .accessible_name("Along the face")
        .on_hover_text("Plane along the flat face clicked last")
        .on_disabled_hover_text("Click a flat face first");
    if let Some(across) = face.filter(|_| response.clicked()) {
        view.section.lay(across, document.extent, viewer);
    }
    if ui
        .add(control::flat(ui, "Flip", view.section.setting.flipped))
        .on_hover_text("Cut away the other side")
        .clicked()
    {
        view.section.setting.flipped = !view.section.setting.flipped;
    }
}

fn offset(ui: &mut Ui, document: &Document, view: &mut Viewpoint) {
    ui.spacing_mut().slider_width = 180.0;
    let setting = &mut view.section.setting;
    let range = setting.range(document.extent);
    let slider = Slider::new(&mut setting.offset_mm, range)
        .suffix(" mm")
        .fixed_decimals(3)
        .clamping(egui::SliderClamping::Edits);
    let hint = match setting.across {
        Across::Face { .. } => "Distance from the face, outward",
        _ => "Coordinate of the plane along its axis",
    };
    ui.add(slider)
        .accessible_name("Offset of the plane")
        .on_hover_text(hint);
    if view.section.is_busy() && view.section.shown(document).is_some_and(|s| s.cut.is_none()) {
        ui.add(egui::Spinner::new().size(14.0));
    }
}

/// What the picture does not show, one line each.
fn remarks(document: &Document, view: &Viewpoint) -> Vec<String> {
    if view.section.has_failed() {
        return vec!["The cut is not filled: its computation ended".to_owned()];
    }
    let Some(cut) = view.section.shown(document).and_then(|shown| shown.cut) else {
        return Vec::new();
    };
    let mut names: Vec<&str> = cut.open_parts().map(|part| document.part_name(part)).collect();
    names.sort_unstable();
    names.dedup();
    match names.as_slice() {
        [] => Vec::new(),
        [one] => vec![format!(
            "Not filled: {one} has an open shell, which encloses no solid"
        )],
        several => vec![format!(
            "Not filled: open shells, which enclose no solid, of {}",
            several.join(", ")
        )],
    }
}
