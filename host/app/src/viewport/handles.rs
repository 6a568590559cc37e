//! Handles of the selected part in the view: pointer actions that move it, with the state that they need.

use egui::{Key, PointerButton, Pos2, Rect, Response, Ui};

use super::camera::Camera;
use super::gizmo::{Axes, Gizmo, Handle};
use super::hold::{Hold, Snap};
use super::screen::Sight;
use crate::session::Session;

/// State of the handles.
#[derive(Debug)]
pub struct Handles {
    /// Whether they are shown on a selected part that may be moved.
    pub shown: bool,
    /// Directions of the handles, of keys and of numbers.
    pub axes: Axes,
    /// Whether a part that is dragged stops where it meets another one.
    pub stops_at_contact: bool,
    over: Option<Handle>,
    hold: Option<Hold>,
}

impl Default for Handles {
    fn default() -> Self {
        Self {
            shown: true,
            axes: Axes::default(),
            stops_at_contact: false,
            over: None,
            hold: None,
        }
    }
}

impl Handles {
    /// The handles in the view; `None` while they are not shown: without a selected part, on a hidden one, and while parts cannot be moved.
    pub fn gizmo(&self, session: &Session, sight: &Sight) -> Option<Gizmo> {
        let (part, document) = (session.selected?, session.document.as_ref()?);
        let is_held = self.hold.is_some() && session.moves.dragged() == Some(part);
        if document.is_hidden(part) || !(is_held || (self.shown && session.no_moving(part).is_none())) {
            return None;
        }
        Gizmo::of(
            self.axes,
            document.poses.get(part)?,
            document.middle(part)?,
            sight,
        )
    }

    /// The handle under the pointer, or the one that is being dragged.
    pub fn over(&self) -> Option<Handle> {
        self.hold.as_ref().map_or(self.over, |hold| Some(hold.handle))
    }

    /// The handle that is being dragged.
    pub fn hold(&self) -> Option<&Hold> {
        self.hold.as_ref()
    }

    /// Esc, and whatever stops the motors, takes back what is being dragged. Call it once STOP has seen the keys, and before any other control sees them.
    pub fn keys(&mut self, ui: &Ui, session: &mut Session, stops: bool) {
        let is_dragging = self.hold.is_some();
        if is_dragging && (stops || ui.input_mut(|i| i.consume_key(egui::Modifiers::NONE, Key::Escape))) {
            session.take_back();
            self.hold = None;
        }
    }

    /// Handles the pointer over the view, before parts are picked. Returns whether it is on a handle, so that nothing else in the view acts on it.
    pub fn respond(&mut self, ui: &Ui, response: &Response, session: &mut Session, camera: &Camera) -> bool {
        let sight = Sight {
            camera: *camera,
            rect: response.rect,
        };
        if self.hold.is_some() && session.moves.dragged().is_none() {
            // The session has ended it, as when the motors are switched on.
            self.hold = None;
        }
        if self.hold.is_some() {
            self.go_on(ui, response, session, &sight);
            return true;
        }
        let gizmo = self.gizmo(session, &sight);
        let at = response.hover_pos().or(response.interact_pointer_pos());
        let hit = |at: Option<Pos2>| gizmo?.hit(&sight, at?);
        self.over = at.filter(|_| !response.dragged()).and_then(|at| hit(Some(at)));
        let pressed = ui.input(|i| i.pointer.press_origin());
        if response.drag_started_by(PointerButton::Primary)
            && let (Some(gizmo), Some(handle), Some(from)) = (gizmo, hit(pressed), pressed)
        {
            self.begin(gizmo, handle, from, session, &sight);
            self.go_on(ui, response, session, &sight);
        }
        self.hold.is_some() || self.over.is_some()
    }

    fn begin(&mut self, gizmo: Gizmo, handle: Handle, from: Pos2, session: &mut Session, sight: &Sight) {
        let Some(part) = session.selected else { return };
        if session.begin_drag(part, self.stops_at_contact)
            && let Some(pose) = session.dragged_from()
        {
            self.hold = Hold::begin(handle, self.axes, gizmo, pose, sight, from);
            if self.hold.is_none() {
                session.take_back();
            }
        }
    }

    fn go_on(&mut self, ui: &Ui, response: &Response, session: &mut Session, sight: &Sight) {
        let Some(hold) = &mut self.hold else { return };
        let snap = ui.input(
            |i| match (i.modifiers.ctrl || i.modifiers.command, i.modifiers.shift) {
                (false, _) => Snap::Free,
                (true, false) => Snap::Coarse,
                (true, true) => Snap::Fine,
            },
        );
        let at = response.interact_pointer_pos();
        if let Some(pose) = at.and_then(|at| hold.drag(sight, at, snap)) {
            session.drag_to(pose);
        }
        if !response.dragged() {
            session.let_go_of_dragged(hold.handle.verb());
            self.hold = None;
            self.over = None;
        }
    }

    /// Places at which the handles are taken hold of, with what each does: for pointers, and for programs that read the window.
    pub fn grips(&self, session: &Session, camera: &Camera, rect: Rect) -> Vec<(Handle, Pos2)> {
        let sight = Sight {
            camera: *camera,
            rect,
        };
        let Some(gizmo) = self.gizmo(session, &sight) else {
            return Vec::new();
        };
        let drawn = |handle| gizmo.drawn(handle, &sight);
        (Handle::ALL.into_iter())
            .filter_map(|handle| Some((handle, drawn(handle)?.grip())))
            .collect()
    }
}
