//! The selected part moved by numbers: a turn about its middle and a shift, along the axes of the world, of the part, or of the view.

use egui::{Button, CollapsingHeader, DragValue, Key, RichText, Ui, Vec2};
use glam::{DQuat, DVec3};

use super::{control, theme};
use crate::session::moves::Motion;
use crate::session::{Intent, Session, obstacle};
use crate::viewport::gesture::Viewpoint;
use crate::viewport::gizmo::Axes;

/// Largest shift, mm.
const MOST_MM: f64 = 1e5;
/// Height of the section while it is folded, and while it is open, points.
const HEIGHTS: (f32, f32) = (30.0, 178.0);
/// Height of a window from which the section is open at first, points.
const ROOMY: f32 = 760.0;

/// Numbers in the fields, kept so that the same motion can be made again.
#[derive(Debug, Default)]
pub struct Fields {
    /// Along the axes, mm.
    shift_mm: [f64; 3],
    /// About the axes, degrees.
    turn_deg: [f64; 3],
    /// Whether the section was drawn open; `None` before it was drawn.
    is_open: Option<bool>,
}

impl Fields {
    /// The motion of a part along and about `axes`.
    fn motion(&self, part: usize, axes: [DVec3; 3]) -> Motion {
        let shift = (0..3).map(|i| self.shift_mm[i] * axes[i]).sum();
        // About fixed axes, the first one first.
        let turn = (0..3).fold(DQuat::IDENTITY, |turn, i| {
            DQuat::from_axis_angle(axes[i], self.turn_deg[i].to_radians()) * turn
        });
        let turns = self.turn_deg.iter().any(|deg| *deg != 0.0);
        Motion {
            part,
            shift_mm: shift,
            turn: if turns { turn } else { DQuat::IDENTITY },
            goes_on: false,
        }
    }

    /// Height that the section needs, points.
    pub fn height(&self, ui: &Ui) -> f32 {
        match self.is_open.unwrap_or_else(|| is_roomy(ui)) {
            true => HEIGHTS.1,
            false => HEIGHTS.0,
        }
    }

    fn is_zero(&self) -> bool {
        self.shift_mm
            .iter()
            .chain(&self.turn_deg)
            .all(|value| *value == 0.0)
    }
}

fn is_roomy(ui: &Ui) -> bool {
    ui.ctx().content_rect().height() > ROOMY
}

/// Draws the section for a part.
pub fn show(
    ui: &mut Ui,
    session: &Session,
    view: &mut Viewpoint,
    fields: &mut Fields,
    wanted: &mut Vec<Intent>,
    part: usize,
) {
    let roomy = is_roomy(ui);
    let section = CollapsingHeader::new("Move")
        .default_open(roomy)
        .show_unindented(ui, |ui| {
            ui.spacing_mut().item_spacing = Vec2::new(4.0, 4.0);
            axes(ui, view);
            let directions = view.handles.axes.directions();
            let shifted = row(ui, "by mm", &mut fields.shift_mm, |i| Field {
                name: format!("Move by, {}, mm", directions[i]),
                hint: format!("Along {}, mm", directions[i]),
                most: MOST_MM,
                decimals: 3,
            });
            let turned = row(ui, "by °", &mut fields.turn_deg, |i| Field {
                name: format!("Turn by, {}, degrees", directions[i]),
                hint: format!(
                    "About {}, degrees, through the middle of the part; in this order",
                    directions[i]
                ),
                most: 360.0,
                decimals: 2,
            });
            apply(ui, session, view, fields, wanted, part, shifted || turned);
        });
    fields.is_open = Some(section.openness > 0.5);
}

/// The choice of directions, and whether handles are shown.
fn axes(ui: &mut Ui, view: &mut Viewpoint) {
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().button_padding = Vec2::new(7.0, 2.0);
        for axes in Axes::ALL {
            let chosen = view.handles.axes == axes;
            let hint = match axes {
                Axes::World => "Handles, keys and numbers go along the axes of the world",
                Axes::Part => "Handles, keys and numbers go along the axes of the part",
                Axes::View => "Handles, keys and numbers go right, up, and near, which is towards the viewer",
            };
            let response = ui.add(control::flat(ui, axes.name(), chosen));
            let response = response.on_hover_text(hint);
            if response.clicked() {
                view.handles.axes = axes;
            }
            response.accessible_name(format!("Axes of the {}", axes.name().to_lowercase()));
        }
        let shown = control::flat(ui, "Handles", view.handles.shown);
        let hint = "Show handles on the selected part: drag an arrow, a square, a ring or the middle";
        let response = ui.add(shown).on_hover_text(hint);
        if response.clicked() {
            view.handles.shown = !view.handles.shown;
        }
        response.accessible_name("Show handles");
        let stops = control::flat(ui, "No overlap", view.handles.stops_at_contact);
        let hint = "A part that is dragged stops where it meets another one, by exact distances";
        let response = ui.add(stops).on_hover_text(hint);
        if response.clicked() {
            view.handles.stops_at_contact = !view.handles.stops_at_contact;
        }
        response.accessible_name("Drag without overlap");
    });
}

/// What a field is.
struct Field {
    name: String,
    hint: String,
    most: f64,
    decimals: usize,
}

/// Three fields; returns whether Enter ended one.
fn row(ui: &mut Ui, unit: &str, values: &mut [f64; 3], field: impl Fn(usize) -> Field) -> bool {
    let mut entered = false;
    ui.horizontal(|ui| {
        let label = RichText::new(unit).small().color(theme::of(ui).text_weak);
        ui.add_sized(
            Vec2::new(34.0, 22.0),
            egui::Label::new(label).halign(egui::Align::Min),
        );
        let wide = ((ui.available_width() - 8.0) / 3.0).max(30.0);
        for (i, value) in values.iter_mut().enumerate() {
            let Field {
                name,
                hint,
                most,
                decimals,
            } = field(i);
            let edit = DragValue::new(value)
                .range(-most..=most)
                .speed(0.1)
                .max_decimals(decimals);
            let response = ui.add_sized(Vec2::new(wide, 22.0), edit);
            entered |= response.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
            response.on_hover_text(hint).accessible_name(name);
        }
    });
    entered
}

/// The buttons that move the part by the numbers, and set them to zero.
fn apply(
    ui: &mut Ui,
    session: &Session,
    view: &Viewpoint,
    fields: &mut Fields,
    wanted: &mut Vec<Intent>,
    part: usize,
    entered: bool,
) {
    let Some(pose) = session
        .document
        .as_ref()
        .and_then(|document| document.poses.get(part))
    else {
        return;
    };
    let motion = fields.motion(part, view.handles.axes.of(pose, &view.camera));
    ui.horizontal(|ui| {
        let intent = Intent::Move(motion);
        if entered && !fields.is_zero() && obstacle(session, &intent).is_none() {
            wanted.push(intent.clone());
        }
        let button = Button::new("Move by these");
        let hint = "Turn the part about its middle, then move it (Enter in a field); again moves it on";
        if fields.is_zero() {
            ui.add_enabled(false, button)
                .on_disabled_hover_text("Enter a number first");
        } else {
            control::intent_button(ui, session, wanted, button, intent, hint);
        }
        let zero = ui.add_enabled(!fields.is_zero(), Button::new("Zero"));
        if zero.on_hover_text("Set the numbers to zero").clicked() {
            (fields.shift_mm, fields.turn_deg) = ([0.0; 3], [0.0; 3]);
        }
    });
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;

    #[test]
    fn numbers_go_along_the_axes_and_turn_about_them_in_order() {
        let turned = DQuat::from_rotation_z(FRAC_PI_2);
        let axes = DVec3::AXES.map(|axis| turned * axis);
        let mut fields = Fields {
            shift_mm: [1.0, 2.0, 3.0],
            ..Fields::default()
        };
        let motion = fields.motion(4, axes);
        assert!(motion.shift_mm.abs_diff_eq(DVec3::new(-2.0, 1.0, 3.0), 1e-12));
        assert_eq!((motion.part, motion.turn), (4, DQuat::IDENTITY));
        fields.turn_deg = [90.0, 90.0, 0.0];
        let turn = fields.motion(4, DVec3::AXES).turn;
        // About x first: y to z; then about y: z to x.
        assert!((turn * DVec3::Y).abs_diff_eq(DVec3::X, 1e-12));
    }
}
