//! Pointer actions in the view: orbit, pan, zoom to the cursor, pick, and drag the held part.

use egui::{Key, Modifiers, PointerButton, Pos2, Rect, Response, Ui};
use glam::{DAffine3, DQuat, DVec2, DVec3};

use super::camera::{Camera, View};
use super::handles::Handles;
use super::measure::Measure;
use super::pick::{Pick, pick};
pub use super::screen::on_screen;
use super::screen::{aspect, ndc};
use super::six_axis::SixAxis;
use crate::cut::SectionView;
use crate::display::extent::Extent;
use crate::session::document::Document;
use crate::session::insertion::hold;
use crate::session::pose::moved;
use crate::session::{Intent, Session, obstacle};

/// Rotation of the hand for a drag over the full height, rad.
const HAND_TURN: f64 = 1.5;
/// Distance from which a place is shown, in radii of the scene: a quarter of the one from which all of it is.
const FRAMED_RADII: f64 = 0.9;
/// Zoom per point of wheel travel.
const ZOOM_PER_POINT: f64 = 0.004;

/// Target of a drag.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Drag {
    /// About the point under the pointer at the start, or else the target.
    Orbit(DVec3),
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

/// The part under the pointer, in the view or in the list of parts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Over {
    /// In this frame, as far as it is drawn.
    pub now: Option<usize>,
    /// In the frame before.
    pub before: Option<usize>,
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
    /// What the pointer is on.
    pub over: Over,
    /// The connected parts whose connection the pointer is on, in this frame.
    pub pair: Option<[usize; 2]>,
    /// What was clicked last, in the open document.
    pub picked: Option<Pick>,
    /// The measuring tool.
    pub measure: Measure,
    /// Handles of the selected part; none while measuring.
    pub handles: Handles,
    /// Motion by a six-axis device.
    pub six_axis: SixAxis,
    /// Whether it is to show everything from the next frame on.
    pub wants_all: bool,
    /// Whether it is to show everything in this frame.
    shows_all: bool,
    pub(super) goal: Option<Camera>,
    drag: Option<Drag>,
    /// Document at which the camera looks.
    pub(super) seen: Option<u64>,
}

impl Viewpoint {
    /// Begins a frame, by which what was wanted in the one before has been done.
    pub fn begin(&mut self) {
        self.shows_all |= std::mem::take(&mut self.wants_all);
        self.over = Over {
            now: None,
            before: self.over.now,
        };
        self.pair = None;
    }

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
        let is_held = self.handles.hold().is_some();
        let handles_are_shown = is_held || !self.measure.on && self.six_axis.subject().is_none();
        let on_handle = handles_are_shown && self.handles.respond(ui, response, session, &self.camera);
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
        let shows_all = std::mem::take(&mut self.shows_all);
        if shows_all || !typing && ui.input_mut(|i| i.consume_key(Modifiers::NONE, Key::F)) {
            self.fit(extent, rect);
        }
        if !typing && ui.input_mut(|i| i.consume_key(Modifiers::NONE, Key::X)) {
            self.section.toggle(document, self.camera.backward());
        }
        if !typing {
            self.turn_keys(ui, extent, rect);
            let escape_is_taken = session.connection().is_some() || session.wants_path.is_some();
            self.measure.keys(ui, escape_is_taken);
        }
        if self.measure.on {
            let shown = self.section.shown(document);
            self.measure.respond(response, document, shown, &self.camera);
        } else if response.clicked() && !on_handle {
            let hit = self.pick(document, rect, response.interact_pointer_pos());
            (self.picked, self.marked) = (hit, Marked::default());
            let adds = ui.input(|i| i.modifiers.ctrl || i.modifiers.command);
            match hit {
                Some(hit) if adds => wanted.push(Intent::SelectAlso(vec![hit.part])),
                None if adds => {}
                hit => wanted.push(Intent::Select(hit.map(|hit| hit.part))),
            }
        }
        if response.double_clicked()
            && !self.measure.on
            && !on_handle
            && let Some(hit) = self.pick(document, rect, response.interact_pointer_pos())
        {
            let grab = Intent::Grab(hit.part);
            match obstacle(session, &grab) {
                None => wanted.push(grab),
                Some(_) => self.frame_part(document, hit.part, rect),
            }
        }
        if self.handles.hold().is_some() {
            // The part follows the pointer, so the camera rests.
            self.goal = None;
            return;
        }
        if !self.measure.on
            && self.drag.is_none()
            && !on_handle
            && let Some(hit) = self.pick(document, rect, response.hover_pos())
        {
            self.over.now = Some(hit.part);
        }
        self.start_drag(ui, response, session);
        self.go_on_dragging(ui, response, session);
        if let Some(document) = &session.document {
            self.zoom(ui, response, document);
        }
        self.glide(ui);
    }

    fn pick(&self, document: &Document, rect: Rect, at: Option<Pos2>) -> Option<Pick> {
        let (origin, direction) = self
            .camera
            .ray_before(ndc(rect, at?), aspect(rect), document.extent);
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
        let pressed = ui.input(|i| i.pointer.press_origin());
        let document = session.document.as_ref();
        let under = document.and_then(|document| self.pick(document, response.rect, pressed));
        self.drag = Some(Drag::Orbit(under.map_or(self.camera.target, |hit| hit.point)));
        let simulated = session.connection().is_some_and(|c| c.capabilities.simulated);
        let (Some(_), Some(handle)) = (session.grabbed(), session.scaled_handle()) else {
            return;
        };
        if left
            && simulated
            && let Some(hit) = under
            && session.is_held(hit.part)
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
            Some(Drag::Orbit(pivot)) => {
                self.goal = None;
                self.camera.orbit_about(*pivot, by);
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
                    let height = camera.height_at(*anchor);
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

    /// Covers most of the way in a tenth of a second, or all of it at once where the style has no animation.
    fn glide(&mut self, ui: &Ui) {
        let Some(goal) = self.goal else { return };
        if ui.style().animation_time == 0.0 {
            (self.camera, self.goal) = (goal, None);
            ui.ctx().request_repaint();
            return;
        }
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

    /// Whether the pointer drags anything.
    pub(super) fn is_dragging(&self) -> bool {
        self.drag.is_some() || self.handles.hold().is_some()
    }

    /// Whether the held part is being dragged.
    pub fn drags_hand(&self) -> bool {
        matches!(self.drag, Some(Drag::Hand { .. }))
    }
}
