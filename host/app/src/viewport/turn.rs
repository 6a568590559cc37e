//! Views by key and by direction: standard views, projection, a part framed. What moves glides, or jumps where the system asks for no motion.

use egui::{Key, Modifiers, Rect, Ui};
use glam::DVec3;

use super::camera::{Projection, View};
use super::gesture::Viewpoint;
use super::screen::aspect;
use crate::display::extent::Extent;
use crate::session::document::Document;

/// Keys of the standard views, those of the opposite sides with Ctrl.
pub const VIEW_KEYS: [(Modifiers, Key, View); 7] = [
    (Modifiers::COMMAND, Key::Num1, View::Back),
    (Modifiers::COMMAND, Key::Num3, View::Left),
    (Modifiers::COMMAND, Key::Num7, View::Bottom),
    (Modifiers::NONE, Key::Num1, View::Front),
    (Modifiers::NONE, Key::Num3, View::Right),
    (Modifiers::NONE, Key::Num7, View::Top),
    (Modifiers::NONE, Key::Num0, View::Iso),
];

impl Viewpoint {
    /// Takes the keys of views and projection, unless a text is being typed.
    pub(super) fn turn_keys(&mut self, ui: &Ui, extent: Extent, rect: Rect) {
        let (view, switched) = ui.input_mut(|input| {
            let pressed = |&&(modifiers, key, _): &&(Modifiers, Key, View)| input.consume_key(modifiers, key);
            let view = VIEW_KEYS.iter().find(pressed).map(|(.., view)| *view);
            (view, input.consume_key(Modifiers::NONE, Key::Num5))
        });
        if let Some(view) = view {
            self.look(view, extent, rect);
        }
        if switched {
            self.switch_projection();
        }
    }

    /// Changes between the perspective and the orthographic projection; what is at the target keeps its size.
    pub fn switch_projection(&mut self) {
        let other = match self.camera.projection {
            Projection::Perspective => Projection::Orthographic,
            Projection::Orthographic => Projection::Perspective,
        };
        self.camera.projection = other;
        if let Some(goal) = &mut self.goal {
            goal.projection = other;
        }
    }

    /// Turns smoothly about the target until the eye is in the direction `from` of it.
    pub fn turn_to(&mut self, from: DVec3) {
        let mut goal = self.goal.unwrap_or(self.camera);
        goal.look_from(from);
        self.goal = Some(goal);
    }

    /// Moves smoothly until a part fills the view.
    pub fn frame_part(&mut self, document: &Document, part: usize, rect: Rect) {
        let shape = document.model.parts.get(part).map(|part| part.shape);
        let extent = shape.and_then(|shape| document.extents.get(shape));
        let (Some(extent), Some(pose)) = (extent, document.poses.get(part)) else {
            return;
        };
        let placed = Extent {
            center: pose.transform_point3(extent.center),
            ..*extent
        };
        let mut goal = self.goal.unwrap_or(self.camera);
        goal.fit(placed, aspect(rect));
        self.goal = Some(goal);
    }
}
