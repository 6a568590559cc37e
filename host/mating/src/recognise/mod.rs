//! Recognition of constraints from touching faces.
//!
//! From the touching faces and the parts' poses the recogniser maintains a list of targets: concentric, coplanar, conical,
//! spherical, annular. A pair of mating merged surfaces becomes a candidate when its faces touch and it is near: diameters,
//! distance and angle within the thresholds. All near candidates are solved together; one that contradicts earlier ones
//! waits and names them. Thresholds are looser for leaving than for entering, and a target is retained for some updates
//! without touch, so that the list does not flicker. The operator may pin an entry (it stays while it can be satisfied) or
//! switch it off. A fit of two whole shapes, which others found, is a candidate like these; it comes after those of surfaces,
//! and engages only where it holds more than they do.
//!
//! The list after an update is a function of the previous list, the observation and the operator's choices: it depends on
//! no clock and no random numbers.

mod solve;
mod target;

use std::collections::BTreeMap;

use glam::{DAffine3, DVec3};
use mortise_brep::{CadModel, Shape};
use mortise_protocol::message::ConstraintKind;

pub use solve::{Freedom, Solution};
pub use target::{AlignmentError, Target, TargetId, Turn, Way};

use crate::merge::{MergedSurface, merge};
use crate::tolerances::Tolerances;
use solve::solve;

/// Engagement thresholds of a target, and its retention time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thresholds {
    /// Largest d at which a target engages, beyond the play of the fit, mm.
    pub distance_mm: f64,
    /// Largest θ at which a target engages, radians.
    pub angle_rad: f64,
    /// Largest difference of diameters, mm.
    pub diameter_mm: f64,
    /// Largest difference as a share of the larger diameter, where that is more.
    pub diameter_share: f64,
    /// Largest interference of diameters, mm: a press fit is felt, a wrong part is not pulled in.
    pub interference_mm: f64,
    /// An active target is released when d or θ exceeds its threshold by this factor.
    pub release: f64,
    /// Number of updates without touch after which an active target is released.
    pub patience: u32,
}

impl Default for Thresholds {
    /// Typical alignment errors of a hand that tries a fit: 3 mm and 6°. The loosest fit of the thesis is 2.5 mm on the
    /// diameter; of its large parts, a peg of 650 mm in a hole of 700 mm.
    fn default() -> Self {
        Self {
            distance_mm: 3.0,
            angle_rad: 0.1,
            diameter_mm: 2.6,
            diameter_share: 0.075,
            interference_mm: 0.1,
            release: 1.5,
            patience: 30,
        }
    }
}

/// Two faces that touch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TouchingFaces {
    /// Face id of the moving part.
    pub moving_face: u32,
    /// The other part.
    pub fixed_part: usize,
    /// Its face id.
    pub fixed_face: u32,
    /// Largest depth, mm.
    pub depth_mm: f64,
}

/// Input of one update.
#[derive(Clone, Copy, Debug)]
pub struct Observation<'a> {
    /// The held part.
    pub moving_part: usize,
    /// Pose of each part, in the order of [`CadModel::parts`].
    pub poses: &'a [DAffine3],
    /// Faces that touch, or are near enough to count as touching.
    pub touching: &'a [TouchingFaces],
    /// Fits of the held part as a whole with others that are near enough to engage.
    pub fits: &'a [Target],
}

/// State of an entry.
#[derive(Clone, Debug, PartialEq)]
pub enum State {
    /// Engaged and satisfiable.
    Active,
    /// Touches, but its alignment error is too large for it to engage.
    Far,
    /// Contradicts these targets, which came first.
    Conflict(Vec<TargetId>),
    /// A fit of whole shapes that holds nothing which recognised surfaces do not hold, or of whose parts the operator switched such surfaces off.
    Redundant,
    /// Switched off by the operator.
    Off,
}

/// An entry of the list.
#[derive(Clone, Debug)]
pub struct Entry {
    /// The constraint.
    pub target: Target,
    /// Whether it is active, and if not, why.
    pub state: State,
    /// Present alignment error.
    pub alignment_error: AlignmentError,
    /// Largest depth at which its faces touch, mm; 0 without contact.
    pub depth_mm: f64,
    /// Whether the operator pinned it.
    pub pinned: bool,
    /// Whether the operator switched it off.
    pub off: bool,
    /// Number of updates since its faces last touched.
    idle: u32,
}

/// The list of targets. See the [module's documentation](self).
pub struct Recogniser<'a> {
    model: &'a CadModel,
    surfaces: Vec<ShapeSurfaces>,
    thresholds: Thresholds,
    entries: BTreeMap<TargetId, Entry>,
    /// The operator's choices, also for targets that are not in the list now.
    choices: BTreeMap<TargetId, Choice>,
    freedom: Freedom,
}

#[derive(Clone, Copy, Default)]
struct Choice {
    pinned: bool,
    off: bool,
}

struct ShapeSurfaces {
    merged: Vec<MergedSurface>,
    /// Middle of the mesh of each merged surface.
    middles: Vec<DVec3>,
    /// Merged surface of each face.
    of_face: Vec<Option<usize>>,
    /// Half the diagonal of the mesh's box, mm.
    size: f64,
}

impl<'a> Recogniser<'a> {
    /// A recogniser with an empty list.
    pub fn new(model: &'a CadModel, tolerances: &Tolerances, thresholds: Thresholds) -> Self {
        Self {
            model,
            surfaces: model
                .shapes
                .iter()
                .map(|s| ShapeSurfaces::new(s, tolerances))
                .collect(),
            thresholds,
            entries: BTreeMap::new(),
            choices: BTreeMap::new(),
            freedom: Freedom::default(),
        }
    }

    /// Updates the list. Touching faces with invalid numbers are ignored.
    pub fn update(&mut self, seen: &Observation<'_>) {
        for entry in self.entries.values_mut() {
            entry.idle = entry.idle.saturating_add(1);
            entry.depth_mm = 0.0;
        }
        let by_surfaces: Vec<(Target, f64)> = (seen.touching.iter())
            .filter_map(|touch| Some((self.candidate(seen.moving_part, touch)?, touch.depth_mm)))
            .collect();
        let of_shapes = seen.fits.iter().map(|target| (target.clone(), 0.0));
        for (target, depth_mm) in by_surfaces.into_iter().chain(of_shapes) {
            let Choice { pinned, off } = self.choices.get(&target.id).copied().unwrap_or_default();
            let entry = self.entries.entry(target.id).or_insert_with(|| Entry {
                target: target.clone(),
                state: State::Far,
                alignment_error: AlignmentError {
                    distance_mm: 0.0,
                    angle_rad: 0.0,
                },
                depth_mm: 0.0,
                pinned,
                off,
                idle: 0,
            });
            // Another fit of the same two parts takes its place.
            if target.way.is_some() && entry.target != target {
                entry.target = target;
            }
            entry.idle = 0;
            entry.depth_mm = entry.depth_mm.max(depth_mm);
        }
        let patience = self.thresholds.patience;
        self.entries.retain(|id, e| {
            let known =
                id.moving_part == seen.moving_part && seen.poses.len() > id.fixed_part.max(id.moving_part);
            known && (e.idle <= patience || e.pinned || e.off)
        });
        self.decide(seen);
    }

    /// All entries, in order of their surfaces.
    pub fn entries(&self) -> impl Iterator<Item = &Entry> {
        self.entries.values()
    }

    /// The active targets.
    pub fn active(&self) -> impl Iterator<Item = &Target> {
        self.entries
            .values()
            .filter(|e| e.state == State::Active)
            .map(|e| &e.target)
    }

    /// Motion that the active targets leave to the moving part.
    pub fn freedom(&self) -> &Freedom {
        &self.freedom
    }

    /// Pins an entry, which keeps it in the list and gives it priority, or unpins it; from the next update on. `false`: no
    /// such entry.
    pub fn pin(&mut self, id: TargetId, pinned: bool) -> bool {
        self.choose(id, |choice| choice.pinned = pinned)
    }

    /// Switches an entry off or on again, from the next update on. `false`: no such entry.
    pub fn switch_off(&mut self, id: TargetId, off: bool) -> bool {
        self.choose(id, |choice| choice.off = off)
    }

    fn choose(&mut self, id: TargetId, change: impl FnOnce(&mut Choice)) -> bool {
        let Some(entry) = self.entries.get_mut(&id) else {
            return false;
        };
        let choice = self.choices.entry(id).or_default();
        change(choice);
        (entry.pinned, entry.off) = (choice.pinned, choice.off);
        true
    }

    /// Empties the list, as on release of the part. The operator's choices apply again when a target returns.
    pub fn clear(&mut self) {
        self.entries.clear();
        self.freedom = Freedom::default();
    }

    /// Every target that a part could satisfy with any other, near or not: mating surfaces of matching sizes.
    ///
    /// Cost: one comparison per pair of a surface of the part and a surface of another part.
    pub fn possible(&self, moving_part: usize) -> Vec<Target> {
        let surfaces_of = |part: usize| self.surfaces.get(self.model.parts.get(part)?.shape);
        let Some(a) = surfaces_of(moving_part) else {
            return Vec::new();
        };
        let mut out = Vec::new();
        for fixed_part in (0..self.model.parts.len()).filter(|&p| p != moving_part) {
            let fixed = surfaces_of(fixed_part).map_or(0, |s| s.merged.len());
            for (moving_surface, fixed_surface) in
                (0..a.merged.len()).flat_map(|i| (0..fixed).map(move |j| (i, j)))
            {
                out.extend(self.between(
                    TargetId {
                        moving_part,
                        fixed_part,
                        surfaces: Some([moving_surface, fixed_surface]),
                    },
                    [moving_surface, fixed_surface],
                ));
            }
        }
        out
    }

    /// The thresholds.
    pub fn thresholds(&self) -> &Thresholds {
        &self.thresholds
    }

    /// The target of two touching faces, if their sizes match.
    fn candidate(&self, moving_part: usize, touch: &TouchingFaces) -> Option<Target> {
        let surface_of = |part: usize, face: u32| {
            let surfaces = self.surfaces.get(self.model.parts.get(part)?.shape)?;
            *surfaces.of_face.get(face as usize)?
        };
        let surfaces = [
            surface_of(moving_part, touch.moving_face)?,
            surface_of(touch.fixed_part, touch.fixed_face)?,
        ];
        let id = TargetId {
            moving_part,
            fixed_part: touch.fixed_part,
            surfaces: Some(surfaces),
        };
        self.between(id, surfaces)
    }

    fn between(&self, id: TargetId, [moving_surface, fixed_surface]: [usize; 2]) -> Option<Target> {
        let of = |part: usize| self.surfaces.get(self.model.parts.get(part)?.shape);
        let (a, b) = (of(id.moving_part)?, of(id.fixed_part)?);
        let (moving, fixed) = (a.merged.get(moving_surface)?, b.merged.get(fixed_surface)?);
        let target = Target::between(id, moving, fixed, *a.middles.get(moving_surface)?)?;
        let larger = 2.0 * (target.radius_mm + target.play_mm.max(0.0));
        let most = (self.thresholds.diameter_share * larger).max(self.thresholds.diameter_mm);
        let sizes = -self.thresholds.interference_mm..=most;
        (sizes.contains(&(2.0 * target.play_mm)) && id.moving_part != id.fixed_part).then_some(target)
    }

    /// Activates targets one by one while they can be satisfied together: pinned ones first, then those of surfaces before those of whole shapes, then
    /// those active before, then the ones with the smallest alignment error.
    fn decide(&mut self, seen: &Observation<'_>) {
        let limits = self.thresholds;
        let Some(pose) = seen.poses.get(seen.moving_part) else {
            self.entries.clear();
            return;
        };
        let shape = self.model.parts.get(seen.moving_part).map_or(0, |p| p.shape);
        let size = self.surfaces.get(shape).map_or(1.0, |s| s.size).max(1e-6);
        let mut order = Vec::new();
        // Between parts of which the operator switched a target off, no fit of the whole shapes takes its place.
        let switched_off: Vec<[usize; 2]> = (self.entries.values())
            .filter(|entry| entry.off && entry.target.way.is_none())
            .map(|entry| [entry.target.id.moving_part, entry.target.id.fixed_part])
            .collect();
        for (id, entry) in &mut self.entries {
            entry.alignment_error = entry.target.alignment_error(pose, &seen.poses[id.fixed_part]);
            let was_active = entry.state == State::Active;
            let factor = if was_active || entry.pinned {
                limits.release
            } else {
                1.0
            };
            let distance_mm = limits.distance_mm + entry.target.play_mm.max(0.0);
            let near = entry.alignment_error.distance_mm <= factor * distance_mm
                && entry.alignment_error.angle_rad <= factor * limits.angle_rad;
            let replaced = id.surfaces.is_none()
                && !entry.pinned
                && switched_off.contains(&[id.moving_part, id.fixed_part]);
            entry.state = match (entry.off, near) {
                (true, _) => State::Off,
                (false, _) if replaced => State::Redundant,
                (false, false) => State::Far,
                (false, true) => {
                    let off = entry.alignment_error.distance_mm / distance_mm
                        + entry.alignment_error.angle_rad / limits.angle_rad;
                    order.push((!entry.pinned, id.surfaces.is_none(), !was_active, off, *id));
                    State::Conflict(Vec::new())
                }
            };
        }
        order.sort_by(|a, b| {
            (a.0, a.1, a.2)
                .cmp(&(b.0, b.1, b.2))
                .then(a.3.total_cmp(&b.3))
                .then(a.4.cmp(&b.4))
        });
        let mut kept: Vec<TargetId> = Vec::new();
        let mut freedom = solve(&[], pose, size).freedom;
        for (.., id) in order {
            // Contact holds planes, and lets a part stand off them by the play of a way: they do not hinder it.
            let beside: Vec<TargetId> = (kept.iter().copied())
                .filter(|k| id.surfaces.is_some() || self.entries[k].target.kind != ConstraintKind::Coplanar)
                .collect();
            let together = |ids: &[TargetId]| {
                let targets: Vec<_> = (ids.iter().chain([&id]))
                    .map(|i| (&self.entries[i].target, seen.poses[i.fixed_part]))
                    .collect();
                let solution = solve(&targets, pose, size);
                let fits = targets
                    .iter()
                    .zip(&solution.alignment_errors)
                    .all(|((t, _), m)| keeps(t, m, size));
                fits.then_some(solution)
            };
            let is_held = |solution: &Solution| {
                let placed: Vec<_> = (beside.iter())
                    .map(|k| (&self.entries[k].target, seen.poses[k.fixed_part]))
                    .collect();
                id.surfaces.is_none()
                    && solve(&placed, pose, size).freedom.count() == solution.freedom.count()
            };
            let state = match together(&beside) {
                Some(solution) if is_held(&solution) => State::Redundant,
                Some(solution) => {
                    freedom = solution.freedom;
                    kept.push(id);
                    State::Active
                }
                None => {
                    let alone: Vec<TargetId> = beside
                        .iter()
                        .copied()
                        .filter(|k| together(&[*k]).is_none())
                        .collect();
                    State::Conflict(if alone.is_empty() { beside } else { alone })
                }
            };
            if let Some(entry) = self.entries.get_mut(&id) {
                entry.state = state;
            }
        }
        self.freedom = freedom;
    }
}

/// Whether a target is satisfied: within its play plus the effect of a fit error of 1 µm over the part.
fn keeps(target: &Target, alignment_error: &AlignmentError, size: f64) -> bool {
    const FIT_MM: f64 = 1e-3;
    let play = target.play_mm.max(0.0) + FIT_MM;
    alignment_error.distance_mm <= play && alignment_error.angle_rad <= play / size
}

impl ShapeSurfaces {
    fn new(shape: &Shape, tolerances: &Tolerances) -> Self {
        let merged = merge(shape, tolerances);
        let mut of_face = vec![None; shape.faces.len()];
        for (i, m) in merged.iter().enumerate() {
            for &f in &m.faces {
                of_face[f as usize] = Some(i);
            }
        }
        let nothing = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (mut boxes, mut whole) = (vec![nothing; merged.len()], nothing);
        for (triangle, &face) in shape.mesh.triangles.iter().zip(&shape.mesh.triangle_face) {
            for &v in triangle {
                let p = shape.mesh.vertices[v as usize];
                whole = (whole.0.min(p), whole.1.max(p));
                if let Some(b) = of_face[face as usize].map(|i| &mut boxes[i]) {
                    *b = (b.0.min(p), b.1.max(p));
                }
            }
        }
        let size = whole.0.distance(whole.1) / 2.0;
        Self {
            merged,
            middles: boxes.into_iter().map(|(low, high)| (low + high) / 2.0).collect(),
            of_face,
            size: if size.is_finite() { size } else { 1.0 },
        }
    }
}
