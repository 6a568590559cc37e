//! Pointer actions in the view: orbit, pan, zoom to the cursor, pick, and drag the held part.

use egui::{Key, Modifiers, PointerButton, Pos2, Rect, Response, Ui};
use glam::{DAffine3, DQuat, DVec2, DVec3};

use super::camera::{Camera, View};
use super::handles::Handles;
use super::pick::{Pick, pick};
pub use super::sight::on_screen;
use super::sight::{aspect, ndc};
use crate::cut::SectionView;
use crate::display::extent::Extent;
use crate::session::document::Document;
use crate::session::insertion::hold;
use crate::session::pose::moved;
use crate::session::{Intent, Session};

/// Rotation of the hand for a drag over the full height, rad.
const HAND_TURN: f64 = 1.5;
/// Distance from which a place is shown, in radii of the scene: a quarter of the one from which all of it is.
const FRAMED_RADII: f64 = 0.9;
/// Zoom per point of wheel travel.
const ZOOM_PER_POINT: f64 = 0.004;

/// Target of a drag.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Drag {
    Orbit,
    Pan,
    /// The held part, dragged at `anchor`; `handle` is the handle's pose at the start.
    Hand {
        anchor: DVec3,
        handle: DAffine3,
        shift: DVec3,
        turn: DQuat,
    },
}

/// What is pointed out in the view and in the list of parts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Marked {
    /// A place, mm, which is ringed.
    pub place: Option<DVec3>,
    /// Parts, which are outlined.
    pub parts: Vec<usize>,
}

/// State of the view.
#[derive(Default)]
pub struct Viewpoint {
    /// Camera of the view.
    pub camera: Camera,
    /// Whether fixed parts are drawn as glass.
    pub see_through: bool,
    /// The section view.
    pub section: SectionView,
    /// What is marked, until the next click.
    pub marked: Marked,
    /// What was clicked last, in the open document.
    pub picked: Option<Pick>,
    /// Handles of the selected part.
    pub handles: Handles,
    pub(super) goal: Option<Camera>,
    drag: Option<Drag>,
    /// Document at which the camera looks.
    pub(super) seen: Option<u64>,
}

impl Viewpoint {
    /// Moves smoothly until everything is visible.
    pub fn fit(&mut self, extent: Extent, rect: Rect) {
        let mut goal = self.goal.unwrap_or(self.camera);
        goal.fit(extent, aspect(rect));
        self.goal = Some(goal);
    }

    /// Marks parts and a place, moves smoothly until the place is in the middle, near enough to see its surroundings, and lays the section through it.
    pub fn frame(&mut self, marked: Marked, extent: Extent) {
        if let Some(place) = marked.place {
            let mut goal = self.goal.unwrap_or(self.camera);
            goal.target = place;
            goal.distance = FRAMED_RADII * extent.radius;
            self.goal = Some(goal);
            self.section.setting.pass_through(place);
        }
        self.marked = marked;
    }

    /// Rotates smoothly to a named direction, and fits.
    pub fn look(&mut self, view: View, extent: Extent, rect: Rect) {
        let mut goal = self.camera;
        goal.look(view);
        goal.fit(extent, aspect(rect));
        self.goal = Some(goal);
    }

    /// Handles all pointer and key input over the view.
    pub fn respond(&mut self, ui: &Ui, response: &Response, session: &mut Session, wanted: &mut Vec<Intent>) {
        let rect = response.rect;
        let on_handle = self.handles.respond(ui, response, session, &self.camera);
        let Some(document) = &session.document else { return };
        let extent = document.extent;
        if self.seen != Some(document.generation) {
            self.seen = Some(document.generation);
            self.camera.look(View::Iso);
            self.camera.fit(extent, aspect(rect));
            self.goal = None;
            (self.picked, self.marked) = (None, Marked::default());
        }
        let typing = ui.ctx().text_edit_focused();
        if !typing && ui.input_mut(|i| i.consume_key(Modifiers::NONE, Key::F)) {
            self.fit(extent, rect);
        }
        if !typing && ui.input_mut(|i| i.consume_key(Modifiers::NONE, Key::X)) {
            self.section.toggle(document, self.camera.backward());
        }
        if response.clicked() && !on_handle {
            let hit = self.pick(document, rect, response.interact_pointer_pos());
            (self.picked, self.marked) = (hit, Marked::default());
            wanted.push(Intent::Select(hit.map(|h| h.part)));
        }
        if response.double_clicked()
            && !on_handle
            && let Some(hit) = self.pick(document, rect, response.interact_pointer_pos())
        {
            wanted.push(Intent::Grab(hit.part));
        }
        if self.handles.hold().is_some() {
            // The part follows the pointer, so the camera rests.
            self.goal = None;
            return;
        }
        self.start_drag(ui, response, session);
        self.go_on_dragging(ui, response, session);
        if let Some(document) = &session.document {
            self.zoom(ui, response, document);
        }
        self.glide(ui);
    }

    fn pick(&self, document: &Document, rect: Rect, at: Option<Pos2>) -> Option<Pick> {
        let (origin, direction) = self.camera.ray(ndc(rect, at?), aspect(rect));
        pick(
            &document.model,
            &document.extents,
            &document.poses,
            &document.hidden,
            self.section.shown(document),
            origin,
            direction,
        )
    }

    fn start_drag(&mut self, ui: &Ui, response: &Response, session: &Session) {
        if !response.drag_started() {
            return;
        }
        let shift = ui.input(|i| i.modifiers.shift);
        let left = response.drag_started_by(PointerButton::Primary);
        if response.drag_started_by(PointerButton::Middle) || (left && shift) {
            self.drag = Some(Drag::Pan);
            return;
        }
        self.drag = Some(Drag::Orbit);
        let simulated = session.connection().is_some_and(|c| c.capabilities.simulated);
        let (Some(document), Some(held), Some(handle)) =
            (&session.document, session.grabbed(), session.handle())
        else {
            return;
        };
        let pressed = ui.input(|i| i.pointer.press_origin());
        if left
            && simulated
            && let Some(hit) = self.pick(document, response.rect, pressed)
            && hit.part == held
        {
            self.drag = Some(Drag::Hand {
                anchor: hit.point,
                handle,
                shift: DVec3::ZERO,
                turn: DQuat::IDENTITY,
            });
        }
    }

    fn go_on_dragging(&mut self, ui: &Ui, response: &Response, session: &mut Session) {
        if response.drag_stopped() {
            self.drag = None;
        }
        let by = response.drag_delta();
        if !response.dragged() || by == egui::Vec2::ZERO {
            return;
        }
        let rect = response.rect;
        let by = DVec2::new(f64::from(by.x), f64::from(by.y)) / f64::from(rect.height().max(1.0));
        match &mut self.drag {
            None => {}
            Some(Drag::Orbit) => {
                self.goal = None;
                self.camera.orbit(by);
            }
            Some(Drag::Pan) => {
                self.goal = None;
                self.camera.pan(by);
            }
            Some(Drag::Hand {
                anchor,
                handle,
                shift,
                turn,
            }) => {
                let camera = &self.camera;
                if ui.input(|i| i.modifiers.ctrl || i.modifiers.command) {
                    let about_up = DQuat::from_axis_angle(camera.up(), HAND_TURN * by.x);
                    let about_right = DQuat::from_axis_angle(camera.right(), HAND_TURN * by.y);
                    *turn = (about_up * about_right * *turn).normalize();
                } else {
                    // The drag moves a point at the anchor's depth with the pointer.
                    let depth = (camera.eye() - *anchor).dot(camera.backward());
                    let height = 2.0 * depth * (0.5 * super::camera::FIELD_OF_VIEW).tan();
                    *shift += height * (by.x * camera.right() - by.y * camera.up());
                }
                let target = moved(handle, *anchor, *turn, *shift);
                session.move_hand(hold(&target));
            }
        }
    }

    fn zoom(&mut self, ui: &Ui, response: &Response, document: &Document) {
        let Some(at) = response.hover_pos() else { return };
        let (scroll, pinch) = ui.input(|i| (i.smooth_scroll_delta().y, i.zoom_delta()));
        if scroll == 0.0 && pinch == 1.0 {
            return;
        }
        let rect = response.rect;
        let factor = (-ZOOM_PER_POINT * f64::from(scroll)).exp() / f64::from(pinch);
        // Zooms towards the surface under the pointer; beside the parts, towards the plane through the target.
        let anchor = self.pick(document, rect, Some(at)).map_or_else(
            || {
                self.camera
                    .on_plane_through(self.camera.target, ndc(rect, at), aspect(rect))
            },
            |hit| hit.point,
        );
        self.goal = None;
        self.camera.zoom_at(anchor, factor, document.extent);
    }

    /// Covers most of the way in a tenth of a second.
    fn glide(&mut self, ui: &Ui) {
        let Some(goal) = self.goal else { return };
        let dt = f64::from(ui.input(|i| i.stable_dt)).min(0.1);
        self.camera = self.camera.towards(&goal, 1.0 - (-dt / 0.07).exp());
        let left = (self.camera.target - goal.target).length() / goal.distance
            + (self.camera.distance / goal.distance - 1.0).abs()
            + (self.camera.pitch - goal.pitch).abs()
            + (self.camera.yaw - goal.yaw).sin().abs();
        if left < 1e-3 {
            self.camera = goal;
            self.goal = None;
        }
        ui.ctx().request_repaint();
    }

    /// Whether the held part is being dragged.
    pub fn drags_hand(&self) -> bool {
        matches!(self.drag, Some(Drag::Hand { .. }))
    }
}
