//! Conversion of telemetry to constraint targets: the desktop side of guidance.
//!
//! The recogniser determines which constraints the touching faces could satisfy. This crate sends them to the board, refreshes them before
//! they expire, and clears those that are released. Faces that share an edge with touching ones count as touching too: a peg that lands on
//! the rim of its hole touches the top with its end. A part that guidance holds off the walls touches nothing; while its surface is still
//! in or at the other one, it counts as near and stays guided.
//!
//! A fit of whole shapes that the operator chose (see [`Guide::follow`]) is a target like these while the part is near its way: it guides parts of any
//! form, with no recognised surface.
//!
//! Planes that face each other are not sent: they meet by contact (`docs/notes/stop-planes.md`). Cost: that of the recogniser, once per
//! telemetry message; with [`When::Near`] also a distance for each pair of surfaces that could mate.

mod nearby;
mod row;
mod settings;
mod way;
mod wire;

use std::collections::BTreeMap;

use glam::{DAffine3, DQuat, DVec3};
use mortise_brep::CadModel;
use mortise_mating::Tolerances;
use mortise_mating::recognise::{
    Entry, Observation, Recogniser, State, Target, TargetId, Thresholds, TouchingFaces,
};
use mortise_protocol::limits::MAX_TARGETS;
use mortise_protocol::message::{ConstraintKind, Telemetry, ToDevice};

use nearby::Nearby;
pub use row::{List, Row, Standing};
pub use settings::{GuideSettings, When};
pub use way::along;

/// Largest number of targets sent at a time: half of what a board holds, so that fading targets leave space for new ones.
pub const MAX_SENT: usize = MAX_TARGETS / 2;

/// Candidates are listed when their alignment error is at most this many times the engagement threshold.
const LISTED: f64 = 3.0;

/// Keeps a board's targets up to date with the telemetry.
pub struct Guide<'a> {
    model: &'a CadModel,
    /// Model part of each part of the image.
    parts: Vec<usize>,
    /// Present pose of each part of the model, mm.
    poses: Vec<DAffine3>,
    nearby: Nearby<'a>,
    recogniser: Recogniser<'a>,
    settings: GuideSettings,
    /// Held part.
    held: Option<usize>,
    /// All targets that the held part could ever satisfy, computed on first use.
    possible: Option<(usize, Vec<Target>)>,
    /// Fits of whole shapes that are followed.
    fits: Vec<Target>,
    sent: BTreeMap<TargetId, Sent>,
    tick: u32,
    ids: u16,
    sequence: u16,
}

struct Sent {
    id: u16,
    /// Tick of the next refresh.
    due: u32,
    /// The board's reason, if its last answer was a refusal.
    refused: Option<String>,
}

impl<'a> Guide<'a> {
    /// A guide for a scene baked from `model`; `parts` maps each part of the image to a part of the model.
    pub fn new(model: &'a CadModel, parts: Vec<usize>, settings: GuideSettings) -> Self {
        Self {
            model,
            parts,
            poses: placements(model),
            nearby: Nearby::new(model),
            recogniser: Recogniser::new(model, &Tolerances::default(), Thresholds::default()),
            settings,
            held: None,
            possible: None,
            fits: Vec::new(),
            sent: BTreeMap::new(),
            tick: 0,
            ids: 0,
            sequence: 0,
        }
    }

    /// The recogniser, whose entries can be displayed and chosen.
    pub fn recogniser(&mut self) -> &mut Recogniser<'a> {
        &mut self.recogniser
    }

    /// Changes how targets are found and sent, from the next sample on; targets on the board are sent again.
    pub fn set(&mut self, settings: GuideSettings) {
        self.settings = settings;
        for sent in self.sent.values_mut() {
            sent.due = self.tick;
        }
    }

    /// Follows these fits of whole shapes, made by [`along`], from the next sample on, and no others. Where two parts fit in several ways, the one whose
    /// way is nearest guides.
    pub fn follow(&mut self, fits: Vec<Target>) {
        for (id, sent) in &mut self.sent {
            if id.surfaces.is_none() {
                sent.due = self.tick;
            }
        }
        self.fits = fits;
    }

    /// Records that a part which nobody holds was put at a pose, mm.
    pub fn place(&mut self, part: usize, pose: DAffine3) {
        if let Some(place) = self.poses.get_mut(part) {
            *place = pose;
        }
    }

    /// Resets every part to its pose in the model.
    pub fn put_back(&mut self) {
        self.poses = placements(self.model);
    }

    /// Records the board's answer about its target `id`.
    pub fn answered(&mut self, id: u16, result: Result<(), String>) {
        if let Some(sent) = self.sent.values_mut().find(|sent| sent.id == id) {
            sent.refused = result.err();
        }
    }

    /// Processes a sample; returns the messages to send.
    pub fn hear(&mut self, sample: &Telemetry) -> Vec<ToDevice> {
        self.tick = sample.tick;
        let held = (sample.object.as_ref())
            .and_then(|(held, pose)| Some((*self.parts.get(usize::from(*held))?, pose)));
        self.held = held.map(|(part, _)| part);
        let Some((moving_part, pose)) = held else {
            // A release ends all guidance on the board.
            self.sent.clear();
            self.recogniser.clear();
            return Vec::new();
        };
        let orientation = DQuat::from_array(pose.orientation.map(f64::from)).normalize();
        let position = DVec3::from_array(pose.position.map(f64::from)) * 1000.0;
        if let Some(place) = self.poses.get_mut(moving_part) {
            *place = DAffine3::from_rotation_translation(orientation, position);
        }
        let mut touching = Vec::new();
        if self.settings.recognising {
            touching.extend(self.touched(moving_part, sample));
            touching.extend(self.kept());
            if self.settings.when == When::Near {
                touching.extend(self.approached(moving_part));
            }
        }
        self.recogniser.update(&Observation {
            moving_part,
            poses: &self.poses,
            touching: &touching,
            fits: &self.near_fits(moving_part, sample),
        });
        self.messages()
    }

    /// The list as of the last sample.
    pub fn list(&self) -> List {
        let Some(held) = self.held else {
            return List {
                tick: self.tick,
                ..List::default()
            };
        };
        let row = |entry: &Entry| Row {
            standing: self.standing(entry),
            alignment_error: entry.alignment_error,
            depth_mm: entry.depth_mm,
            inside_mm: match entry.target.kind {
                ConstraintKind::Concentric
                | ConstraintKind::Conical
                | ConstraintKind::Annular
                | ConstraintKind::AnnularBore
                | ConstraintKind::Path => Some(self.inside(&entry.target)).filter(|x| x.is_finite()),
                ConstraintKind::Coplanar | ConstraintKind::Spherical => None,
            },
            pinned: entry.pinned,
            target: entry.target.clone(),
        };
        let mut rows: Vec<Row> = (self.recogniser.entries())
            .filter(|entry| self.is_worth_reading(entry))
            .map(row)
            .collect();
        // Targets that guide or have an operator's choice come first, regardless of state, so that a clicked line stays in place.
        rows.sort_by_key(|row| match row.standing {
            Standing::ByContact => 1,
            Standing::Candidate => 2,
            _ => 0,
        });
        List {
            tick: self.tick,
            held: Some(held),
            rows,
            freedom: self.recogniser.freedom().clone(),
        }
    }

    /// Faces at right angles touch all the time: a candidate is listed only when a movement of the hand could make it a target.
    fn is_worth_reading(&self, entry: &Entry) -> bool {
        let limits = self.recogniser.thresholds();
        let near = entry.alignment_error.distance_mm <= LISTED * limits.distance_mm
            && entry.alignment_error.angle_rad <= LISTED * limits.angle_rad;
        // What recognised surfaces hold is listed with them.
        let redundant = entry.state == State::Redundant && !entry.pinned;
        !redundant && (near || entry.state != State::Far || entry.pinned)
    }

    fn standing(&self, entry: &Entry) -> Standing {
        match &entry.state {
            State::Off => Standing::Off,
            State::Far => Standing::Candidate,
            State::Conflict(with) => Standing::Conflict(with.clone()),
            // Not listed.
            State::Redundant => Standing::Candidate,
            State::Active if !wire::is_sent(entry.target.kind) => Standing::ByContact,
            State::Active => match self.sent.get(&entry.target.id) {
                None => Standing::Waiting,
                Some(Sent { refused: None, .. }) => Standing::Sent,
                Some(Sent {
                    refused: Some(why), ..
                }) => Standing::Refused(why.clone()),
            },
        }
    }

    /// Touching faces, and those across an edge from them.
    fn touched(&self, moving_part: usize, sample: &Telemetry) -> Vec<TouchingFaces> {
        let mut out = Vec::new();
        for pair in &sample.pairs {
            let Some(&fixed_part) = self.parts.get(usize::from(pair.static_part)) else {
                continue;
            };
            let moving = self.nearby.with_neighbours(moving_part, pair.moving_face);
            let fixed = self.nearby.with_neighbours(fixed_part, pair.static_face);
            for &moving_face in &moving {
                for &fixed_face in &fixed {
                    let touches = moving_face == u32::from(pair.moving_face)
                        && fixed_face == u32::from(pair.static_face);
                    out.push(TouchingFaces {
                        moving_face,
                        fixed_part,
                        fixed_face,
                        depth_mm: if touches {
                            1000.0 * f64::from(pair.depth)
                        } else {
                            0.0
                        },
                    });
                }
            }
        }
        out
    }

    /// Active targets whose surfaces are still in or at each other.
    fn kept(&self) -> Vec<TouchingFaces> {
        let limit = match self.settings.when {
            When::Touching => self.settings.near_mm,
            When::Near => self.settings.near_mm.min(-self.settings.approach_mm),
        };
        let of_surfaces = self.recogniser.active().filter(|t| t.way.is_none());
        (of_surfaces.filter(|t| self.inside(t) > limit))
            .filter_map(faces_of)
            .collect()
    }

    /// Pairs of surfaces that could mate, are aligned, and face each other.
    fn approached(&mut self, moving_part: usize) -> Vec<TouchingFaces> {
        if self
            .possible
            .as_ref()
            .is_none_or(|(part, _)| *part != moving_part)
        {
            let mut targets = self.recogniser.possible(moving_part);
            targets.retain(|target| wire::is_sent(target.kind));
            self.possible = Some((moving_part, targets));
        }
        let limits = self.recogniser.thresholds();
        let near = |target: &&Target| {
            let alignment_error = target.alignment_error(
                &self.poses[target.id.moving_part],
                &self.poses[target.id.fixed_part],
            );
            alignment_error.distance_mm <= limits.distance_mm
                && alignment_error.angle_rad <= limits.angle_rad
                && self.inside(target) > -self.settings.approach_mm
        };
        let targets = self.possible.iter().flat_map(|(_, targets)| targets);
        targets.filter(near).filter_map(faces_of).collect()
    }

    /// Followed fits of the held part that are aligned, and whose faces are in or at each other along the way: for each other part the nearest one, or
    /// the one that guides now. Whether it engages is decided with the thresholds for entering; here those for leaving count.
    fn near_fits(&self, moving_part: usize, sample: &Telemetry) -> Vec<Target> {
        let limits = self.recogniser.thresholds();
        let touches = |part: usize| {
            (sample.pairs.iter()).any(|pair| self.parts.get(usize::from(pair.static_part)) == Some(&part))
        };
        let guides = |target: &Target| self.recogniser.active().any(|active| active == target);
        let off = |target: &Target| {
            let (at, fixed) = (
                self.poses.get(moving_part)?,
                self.poses.get(target.id.fixed_part)?,
            );
            let error = target.alignment_error(at, fixed);
            let distance = error.distance_mm / (limits.distance_mm + target.play_mm.max(0.0));
            let angle = error.angle_rad / limits.angle_rad;
            (distance <= limits.release && angle <= limits.release).then_some(distance + angle)
        };
        let mut near: BTreeMap<TargetId, (f64, &Target)> = BTreeMap::new();
        for target in self
            .fits
            .iter()
            .filter(|target| target.id.moving_part == moving_part)
        {
            let guides = guides(target);
            let farthest = match self.settings.when {
                When::Near => -self.settings.approach_mm,
                When::Touching if guides || touches(target.id.fixed_part) => self.settings.near_mm,
                When::Touching => continue,
            };
            let Some(off) = off(target).filter(|_| self.inside(target) > farthest) else {
                continue;
            };
            // The one that guides stays.
            let off = if guides { -1.0 } else { off };
            if near.get(&target.id).is_none_or(|(least, _)| off < *least) {
                near.insert(target.id, (off, target));
            }
        }
        near.into_values().map(|(_, target)| target.clone()).collect()
    }

    /// Overlap of a target's surfaces along its axis, mm; negative: gap.
    fn inside(&self, target: &Target) -> f64 {
        let (a, b) = (target.id.moving_part, target.id.fixed_part);
        let (Some(at), Some(fixed)) = (self.poses.get(a), self.poses.get(b)) else {
            return f64::NEG_INFINITY;
        };
        let axis = fixed.transform_vector3(target.fixed.direction);
        let moving = (a, target.moving_faces.as_slice(), at);
        self.nearby.overlap(moving, (b, &target.fixed_faces, fixed), axis)
    }

    fn messages(&mut self) -> Vec<ToDevice> {
        let mut active: Vec<&Entry> = (self.recogniser.entries())
            .filter(|e| e.state == State::Active && wire::is_sent(e.target.kind))
            .collect();
        active.sort_by_key(|entry| (!entry.pinned, entry.target.way.is_some()));
        active.truncate(if self.settings.sending { MAX_SENT } else { 0 });
        let mut out = Vec::new();
        self.sent.retain(|id, sent| {
            let kept = active.iter().any(|entry| entry.target.id == *id);
            if !kept {
                out.push(ToDevice::ClearTarget { id: sent.id });
            }
            kept
        });
        let refresh = u32::from(self.settings.expiry_ticks / 3);
        for entry in active {
            let sent = self.sent.entry(entry.target.id).or_insert_with(|| {
                self.ids = self.ids.wrapping_add(1);
                Sent {
                    id: self.ids,
                    due: self.tick,
                    refused: None,
                }
            });
            if (self.tick.wrapping_sub(sent.due) as i32) < 0 {
                continue;
            }
            sent.due = self.tick.wrapping_add(refresh);
            self.sequence = self.sequence.wrapping_add(1);
            let message = wire::message(&entry.target, &self.parts, &self.settings, sent.id, self.sequence);
            out.extend(message.map(ToDevice::SetTarget));
        }
        out
    }
}

fn placements(model: &CadModel) -> Vec<DAffine3> {
    model.parts.iter().map(|part| part.placement).collect()
}

/// A pair of faces that represents a target.
fn faces_of(target: &Target) -> Option<TouchingFaces> {
    Some(TouchingFaces {
        moving_face: *target.moving_faces.first()?,
        fixed_part: target.id.fixed_part,
        fixed_face: *target.fixed_faces.first()?,
        depth_mm: 0.0,
    })
}
