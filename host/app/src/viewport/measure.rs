//! The measuring tool's state: what is picked, and what it measures where the parts are now. No drawing.

use std::sync::Arc;
use std::time::{Duration, Instant};

use egui::{Key, Modifiers, Pos2, Response, Ui};
use glam::{DAffine3, DVec3};
use mortise_inspect::measure::{About, Comparison, Entity, Feature, Placed, compare};

use super::camera::Camera;
use super::outline::{Outline, outline};
use super::snap::{Snap, SnapView, Wanted};
use crate::cut::Shown;
use crate::session::clearances::Search;
use crate::session::document::Document;

/// While parts move, a measurement is taken again after so many times its duration, so that it costs a tenth of the window's time at most.
const REST: u32 = 9;

/// A picked feature.
#[derive(Clone)]
pub struct Picked {
    /// Index of the part.
    pub part: usize,
    /// The feature.
    pub feature: Feature,
    entity: Arc<Entity>,
    /// Where it was clicked, in the shape's frame, mm.
    place: DVec3,
}

/// What is measured.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Measured {
    /// Each picked feature.
    pub about: Vec<About>,
    /// Where each was clicked, world, mm.
    pub places: Vec<DVec3>,
    /// How the two lie to each other.
    pub between: Option<Comparison>,
    /// Poses for which this is so.
    poses: Vec<DAffine3>,
}

/// The measuring tool.
#[derive(Default)]
pub struct Measure {
    /// Whether clicks in the view pick features.
    pub on: bool,
    /// What kind of feature a click picks.
    pub wanted: Wanted,
    /// The least gap of the two parts, on request.
    pub gap: Search,
    picked: Vec<Picked>,
    measured: Measured,
    /// When that was measured, and how long it took.
    taken: Option<(Instant, Duration)>,
    /// What is under the pointer, and for which place and view.
    hover: Option<Snap>,
    hovered_at: Option<(Pos2, Camera, Wanted)>,
    /// Document of the picks.
    generation: Option<u64>,
}

impl Measure {
    /// Takes the keys of the tool: D switches it, Backspace clears it, and so does Esc, which leaves it when nothing is picked, unless `escape_is_taken` by
    /// something else.
    pub(super) fn keys(&mut self, ui: &Ui, escape_is_taken: bool) {
        let pressed = |key| ui.input_mut(|input| input.consume_key(Modifiers::NONE, key));
        if pressed(Key::D) {
            self.toggle();
        }
        if self.on && pressed(Key::Backspace) {
            self.clear();
        }
        if self.on && !escape_is_taken && pressed(Key::Escape) {
            if self.picked.is_empty() {
                self.on = false;
            }
            self.clear();
        }
    }

    /// Switches the tool on or off; off, nothing is picked.
    pub fn toggle(&mut self) {
        self.on = !self.on;
        self.clear();
    }

    /// Picks nothing any more.
    pub fn clear(&mut self) {
        self.picked.clear();
        (self.measured, self.taken) = (Measured::default(), None);
        (self.hover, self.hovered_at) = (None, None);
    }

    /// Takes clicks and the pointer over the view.
    pub(super) fn respond(
        &mut self,
        response: &Response,
        document: &Document,
        cut: Option<Shown<'_>>,
        camera: &Camera,
    ) {
        let sight = SnapView {
            document,
            cut,
            camera,
            rect: response.rect,
        };
        if response.clicked()
            && let Some(at) = response.interact_pointer_pos()
            && let Some(snap) = sight.snap(at, self.wanted)
        {
            self.pick(document, snap);
        }
        let wanted = response.hover_pos().map(|at| (at, *camera, self.wanted));
        if wanted != self.hovered_at {
            self.hovered_at = wanted;
            self.hover = wanted.and_then(|(at, ..)| sight.snap(at, self.wanted));
        }
    }

    /// Picks a feature; again: no more. A third one begins anew.
    pub fn pick(&mut self, document: &Document, snap: Snap) {
        self.taken = None;
        let same = |picked: &Picked| (picked.part, picked.feature) == (snap.part, snap.feature);
        if let Some(index) = self.picked.iter().position(same) {
            self.picked.remove(index);
            return;
        }
        let model = &document.model;
        let shape = model
            .parts
            .get(snap.part)
            .and_then(|part| model.shapes.get(part.shape));
        let (Some(shape), Some(pose)) = (shape, document.poses.get(snap.part)) else {
            return;
        };
        let Some(entity) = Entity::of(shape, snap.feature) else {
            return;
        };
        if self.picked.len() == 2 {
            self.picked.clear();
        }
        self.picked.push(Picked {
            part: snap.part,
            feature: snap.feature,
            entity: Arc::new(entity),
            place: pose.inverse().transform_point3(snap.point),
        });
    }

    /// Brings the measurement up to date with the parts. Returns the time after which it wants to be called again, if any.
    pub fn follow(&mut self, document: &Document) -> Option<Duration> {
        self.gap.poll();
        if self.generation != Some(document.generation) {
            self.generation = Some(document.generation);
            self.clear();
        }
        let poses = (self.picked.iter()).filter_map(|picked| document.poses.get(picked.part).copied());
        let poses: Vec<DAffine3> = poses.collect();
        if poses.len() != self.picked.len() {
            self.clear();
            return None;
        }
        if let Some((at, took)) = self.taken {
            if self.measured.poses == poses {
                return None;
            }
            let left = (REST * took).saturating_sub(at.elapsed());
            if !left.is_zero() {
                return Some(left);
            }
        }
        let begun = Instant::now();
        self.measured = measured(&self.picked, poses);
        self.taken = Some((Instant::now(), begun.elapsed()));
        None
    }

    /// The picked features, at most two.
    pub fn picked(&self) -> &[Picked] {
        &self.picked
    }

    /// What they measure, as of the last [`Self::follow`].
    pub fn measured(&self) -> &Measured {
        &self.measured
    }

    /// Outlines of what is picked, and of what a click would pick.
    pub fn outlines(&self, document: &Document) -> (Vec<Outline>, Option<Outline>) {
        let of = |part: usize, feature| {
            let model = &document.model;
            let shape = model.shapes.get(model.parts.get(part)?.shape)?;
            Some(outline(shape, feature, document.poses.get(part)?))
        };
        let picked = self
            .picked
            .iter()
            .filter_map(|picked| of(picked.part, picked.feature));
        let hover = self.hover.filter(|_| self.on);
        (
            picked.collect(),
            hover.and_then(|snap| of(snap.part, snap.feature)),
        )
    }

    /// What a click would pick.
    pub fn hover(&self) -> Option<Snap> {
        self.hover.filter(|_| self.on)
    }
}

fn measured(picked: &[Picked], poses: Vec<DAffine3>) -> Measured {
    let placed: Vec<Placed<'_>> = (picked.iter().zip(&poses))
        .map(|(picked, &pose)| Placed {
            entity: &picked.entity,
            pose,
        })
        .collect();
    let between = match placed.as_slice() {
        [a, b] => Some(compare(*a, *b)),
        _ => None,
    };
    let places = picked.iter().zip(&poses);
    Measured {
        about: placed.iter().map(|side| side.entity.about(&side.pose)).collect(),
        places: places
            .map(|(picked, pose)| pose.transform_point3(picked.place))
            .collect(),
        between,
        poses,
    }
}
