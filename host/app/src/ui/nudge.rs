//! Keys that move the selected part in small steps. Where a text field or another control has the keyboard, they are its keys.

use std::f64::consts::PI;

use egui::{Event, Key, Modifiers, Ui};
use glam::{DQuat, DVec3};

use crate::session::moves::Motion;
use crate::session::{Intent, Session};
use crate::viewport::gesture::Viewpoint;

/// A step, mm: plain, with Shift, with Ctrl.
const STEPS_MM: [f64; 3] = [1.0, 0.1, 10.0];
/// A turn with Alt, degrees: plain, with Shift.
const TURNS_DEG: [f64; 2] = [5.0, 0.5];

/// Takes the keys.
pub fn keys(ui: &Ui, session: &Session, view: &Viewpoint, wanted: &mut Vec<Intent>) {
    let (Some(part), Some(document)) = (session.selected, &session.document) else {
        return;
    };
    let (Some(pose), None) = (document.poses.get(part), ui.memory(|memory| memory.focused())) else {
        return;
    };
    let axes = view.handles.axes.of(pose, &view.camera);
    let toward = [view.camera.right(), view.camera.up(), view.camera.backward()];
    let seen = seen_along(axes, toward);
    ui.input_mut(|input| {
        input.events.retain(|event| match event {
            Event::Key {
                key,
                pressed: true,
                repeat,
                modifiers,
                ..
            } => match step(*key, *modifiers) {
                Some(step) => {
                    wanted.push(Intent::Move(step.motion(part, seen, *repeat)));
                    false
                }
                None => true,
            },
            _ => true,
        });
    });
}

/// A step along or about a direction of the view.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Step {
    /// By mm along right, up, or towards the viewer.
    Shift(usize, f64),
    /// By rad about right, up, or towards the viewer.
    Turn(usize, f64),
}

/// What a key does.
fn step(key: Key, modifiers: Modifiers) -> Option<Step> {
    let (direction, sign) = match key {
        Key::ArrowRight => (0, 1.0),
        Key::ArrowLeft => (0, -1.0),
        Key::ArrowUp => (1, 1.0),
        Key::ArrowDown => (1, -1.0),
        Key::PageUp => (2, 1.0),
        Key::PageDown => (2, -1.0),
        _ => return None,
    };
    let ctrl = modifiers.ctrl || modifiers.command;
    let size = |sizes: &[f64]| sizes[usize::from(modifiers.shift)];
    match (modifiers.alt, ctrl) {
        (false, false) => Some(Step::Shift(direction, sign * size(&STEPS_MM))),
        (false, true) if !modifiers.shift => Some(Step::Shift(direction, sign * STEPS_MM[2])),
        (true, false) => {
            // The side of the part that faces the viewer goes where the arrow points: to the right by a turn about up, up by one against right.
            let (about, sense) = [(1, 1.0), (0, -1.0), (2, 1.0)][direction];
            Some(Step::Turn(about, sense * sign * size(&TURNS_DEG) * PI / 180.0))
        }
        // Desktops use these.
        _ => None,
    }
}

impl Step {
    fn motion(self, part: usize, seen: [DVec3; 3], goes_on: bool) -> Motion {
        let (shift_mm, turn) = match self {
            Self::Shift(direction, mm) => (mm * seen[direction], DQuat::IDENTITY),
            Self::Turn(about, rad) => (DVec3::ZERO, DQuat::from_axis_angle(seen[about], rad)),
        };
        Motion {
            part,
            shift_mm,
            turn,
            goes_on,
        }
    }
}

/// The axes that are nearest to the view's right, up and towards the viewer, each in its sense; every axis once.
fn seen_along(axes: [DVec3; 3], view: [DVec3; 3]) -> [DVec3; 3] {
    let mut left = axes.to_vec();
    view.map(|direction| {
        let nearness = |axis: &DVec3| axis.dot(direction).abs();
        let nearest = (0..left.len()).max_by(|&a, &b| nearness(&left[a]).total_cmp(&nearness(&left[b])));
        let axis = left.swap_remove(nearest.unwrap_or_default());
        if axis.dot(direction) < 0.0 { -axis } else { axis }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::viewport::camera::{Camera, View};

    #[test]
    fn keys_go_along_the_axes_that_the_view_shows() {
        let mut camera = Camera::default();
        let mut seen = |view: View| {
            camera.look(view);
            let view = [camera.right(), camera.up(), camera.backward()];
            seen_along(DVec3::AXES, view).map(|axis| axis.round())
        };
        assert_eq!(seen(View::Top), [DVec3::X, DVec3::Y, DVec3::Z]);
        assert_eq!(seen(View::Front), [DVec3::X, DVec3::Z, DVec3::NEG_Y]);
        assert_eq!(seen(View::Right), [DVec3::Y, DVec3::Z, DVec3::X]);
        let iso = seen(View::Iso);
        assert_eq!(iso[1], DVec3::Z, "up stays up: {iso:?}");
    }

    #[test]
    fn modifiers_choose_the_step() {
        let (none, shift, ctrl, alt) = (Modifiers::NONE, Modifiers::SHIFT, Modifiers::CTRL, Modifiers::ALT);
        let mm = |modifiers| match step(Key::ArrowLeft, modifiers) {
            Some(Step::Shift(0, mm)) => mm,
            other => panic!("{other:?}"),
        };
        assert_eq!([none, shift, ctrl].map(mm), [-1.0, -0.1, -10.0]);
        let turn = step(Key::ArrowUp, alt | shift);
        assert_eq!(turn, Some(Step::Turn(0, -0.5 * PI / 180.0)));
        assert_eq!(step(Key::ArrowUp, alt | ctrl), None);
        assert_eq!(step(Key::A, none), None);
    }
}
