//! Constraint targets: the set in force, their engagement, and the springs they contribute to the step.
//!
//! The desktop sends a target; the board holds it until it expires, is cleared or replaced. A target is never switched abruptly: its *engagement* a
//! rises from 0 to 1 and falls again in steps so small that the caps on all forces, a·F, together change by 0.015 N a tick at most and those on
//! torques by less than 2 mN m. A part on its way to the axis follows the cap's growth, and neither starts nor stops with a step of 0.05 N on the
//! handle. Torque engages first, as fast as it may. Within its cap a target is stiff,
//!
//! f = −a·F·u/√((a·F/(a⁴·k))² + |u|²),   u = e + (h + τ)·J·V'
//!
//! evaluated at the step's end like every other force of the step. Near the goal it is a spring k with damping k·τ that holds to micrometres, far
//! from it a force of constant magnitude, so that a hand stronger than the cap can always move away. While the engagement changes the spring is
//! softer (a⁴), so that it does not stop a part within a tick. The damping makes the approach exponential (τ = 20 ms).
//!
//! A target that ends would let a part fly off that the hand pulled against it. So a damper takes over as the spring's force falls, 200 N s/m up to 1
//! N, and fades in a second: 0.4 N move the part at 2 mm/s.
//!
//! The energy of a target's spring may drive the part freely; what reaches the operator is bounded: see the source of `energy_bound`.
//!
//! Where the target's faces meet, contact makes an allowance: gaps between them count as larger by a·[`GuidanceSettings::allowance_m`]. The axis then
//! holds what the wall held before, an exact fit can be inserted, and a part pulled off its axis against the cap meets the wall again. All other
//! contacts are unchanged, and so are planes and cones: they stop a part, and a push above the cap must not penetrate a stop by 0.1 mm.
//!
//! [`GuidanceMethod::Thesis`] is the blend of Faas 2010 (eqs. 13–19), for comparison: a spring of 0.8·k_T without a cap, weighted with
//! x = ½e^(−θ/θ₀) + ½e^(−d/d₀), θ₀ = voxel/insertion depth, d₀ = voxel, and the contacts of those faces weighted with 1 − x. A target whose caps are 0 exerts no
//! force there either, and only the contacts are softened: her hybrid method “without constraint evaluation” (section 8.2.2).

use glam::Vec3;
use heapless::Vec;
use mortise_protocol::image::SceneImage;
use mortise_protocol::limits::{MAX_PATH_RATE, MAX_TARGETS};
use mortise_protocol::message::{ConstraintKind, ConstraintTarget, Path, PathTurn};

use crate::collision::placement::Placed;
use crate::collision::rules::{ExcludedPairs, FacePairRules, Mating, holds};
use crate::collision::search::APPROACH;
use crate::constraints::alignment::Alignment;
use crate::constraints::fit::Fit;
use crate::constraints::saturating_spring::{Law, MAX_SPRINGS, RELEASE_N, SaturatingSpring};
use crate::io::GuidanceState;
use crate::math::pose::Pose;
use crate::settings::{GuidanceMethod, GuidanceSettings};

/// Largest change of the engagement a tick.
const STEP: f32 = 1.0 / 64.0;
/// Largest change of the force cap a tick, N.
const FORCE_STEP_N: f32 = 0.015;
/// Largest change of the torque cap a tick, N m.
const TORQUE_STEP_NM: f32 = 1.8e-3;
/// Fade of the release damper, a tick.
const RELEASE_STEP: f32 = 1.0 / 1024.0;
/// Smallest share of the stiffness, so that cap over stiffness is defined for a target at zero engagement.
const MIN_STIFFNESS_SHARE: f32 = 1e-6;
/// Stiffness of a path's angle as a multiple of k·L²: on a part of 10 mm, k·L² = 100 N m/rad would let the torque of a hand 3° off turn it by up to 0.7
/// mrad.
const PATH_TURN_STIFFNESS: f32 = 4.0;
/// Stiffness of the thesis' constraint spring as a share of the coupling's.
const THESIS_SHARE: f32 = 0.8;

/// Why a target was rejected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TargetError {
    /// A number is not finite or out of range, or a direction is not of unit length.
    BadNumber,
    /// Its part is not in the scene, or is the held part.
    NoSuchPart,
    /// No space left: the largest number of targets is in force or fading.
    Full,
}

/// A target in force or fading.
#[derive(Clone, Debug)]
struct Slot {
    target: ConstraintTarget,
    /// a.
    engagement: f32,
    /// Ticks until it expires; 0: fading.
    left: u16,
    /// Share of the release damper in force, 0 to 1.
    releasing: f32,
    /// Fit of its faces; `None` until it is first fully engaged.
    fit: Option<Fit>,
    /// Whether it is a contact exclusion at present.
    excluded: bool,
}

/// The targets in force or fading.
#[derive(Clone, Debug)]
pub(crate) struct TargetSet {
    slots: Vec<Slot, MAX_TARGETS>,
    /// Guidance method in use: the one set, once all targets of another method have faded.
    method: GuidanceMethod,
    /// Extent of the contacts of guided faces along the fixed feature's direction in the last tick, m.
    insertion_m: f32,
}

impl TargetSet {
    pub const fn new() -> Self {
        Self {
            slots: Vec::new(),
            // All zero; the first tick applies the method that is set.
            method: GuidanceMethod::Off,
            insertion_m: 0.0,
        }
    }

    /// Adds a target, refreshes it, or replaces the one with its id, which fades while the new one engages. A target older than the known one with
    /// its id is ignored.
    pub fn set(
        &mut self,
        target: &ConstraintTarget,
        parts: usize,
        held: Option<u16>,
    ) -> Result<(), TargetError> {
        check(target)?;
        if usize::from(target.static_part) >= parts || held == Some(target.static_part) {
            return Err(TargetError::NoSuchPart);
        }
        let mut same = None;
        for (i, slot) in self.slots.iter().enumerate() {
            if slot.target.id != target.id {
                continue;
            }
            if !newer(target.sequence, slot.target.sequence) {
                return Ok(());
            }
            if same_constraint(&slot.target, target) {
                same = Some(i);
            }
        }
        if let Some(slot) = same.and_then(|i| self.slots.get_mut(i)) {
            slot.target.sequence = target.sequence;
            slot.left = target.expiry_ticks;
            return Ok(());
        }
        if self.slots.is_full() {
            return Err(TargetError::Full);
        }
        self.clear(target.id);
        let _ = self.slots.push(Slot {
            target: target.clone(),
            engagement: 0.0,
            left: target.expiry_ticks,
            releasing: 0.0,
            fit: None,
            excluded: false,
        });
        Ok(())
    }

    /// Lets the target with this id fade. Unknown ids are ignored.
    pub fn clear(&mut self, id: u16) {
        for slot in self.slots.iter_mut().filter(|slot| slot.target.id == id) {
            slot.left = 0;
        }
    }

    /// Removes all targets at once. For when nothing is held.
    pub fn clear_all(&mut self) {
        self.slots.clear();
        self.insertion_m = 0.0;
    }

    /// Advances all targets by a tick: they engage, expire, fade and vanish. Those that change share the change allowed in a tick. A new method takes
    /// effect when all targets of the previous one have faded.
    pub fn step(&mut self, settings: &GuidanceSettings) {
        if self.method != settings.method && self.slots.iter().all(|slot| slot.engagement == 0.0) {
            self.method = settings.method;
        }
        let guides = matches!(self.method, GuidanceMethod::Capped | GuidanceMethod::Thesis);
        let on = self.method == settings.method && guides;
        let mut changing = 0u8;
        for slot in &mut self.slots {
            slot.left = slot.left.saturating_sub(1);
            changing += u8::from(slot.engagement != slot.goal(on));
        }
        let share = 1.0 / f32::from(changing.max(1));
        for slot in &mut self.slots {
            let step = slot.step() * share;
            if slot.goal(on) > 0.0 {
                slot.engagement = (slot.engagement + step).min(1.0);
                slot.releasing = (slot.releasing - RELEASE_STEP).max(0.0);
            } else if slot.engagement > 0.0 {
                slot.engagement = (slot.engagement - step).max(0.0);
                slot.releasing = (slot.releasing + step).min(1.0);
            } else {
                slot.releasing = (slot.releasing - RELEASE_STEP).max(0.0);
            }
        }
        self.slots
            .retain(|slot| slot.left > 0 || slot.engagement > 0.0 || slot.releasing > 0.0);
    }

    /// Appends the springs of this tick to `springs`: too large to pass by value.
    pub fn add_springs(&self, at: &Situation<'_, '_>, springs: &mut Vec<SaturatingSpring, MAX_SPRINGS>) {
        for (i, slot) in self.slots.iter().enumerate() {
            let Some(alignment) = slot.alignment(at) else {
                continue;
            };
            let target = &slot.target;
            // Rotations count as displacements at the distance L: k·L² for the angle, torque cap over L.
            let (offset, angle) = match self.method {
                GuidanceMethod::Thesis => {
                    let stiffness = THESIS_SHARE * at.coupling_stiffness * self.weight(slot, &alignment, at);
                    let law = |cap: f32| Law::Spring {
                        stiffness: if cap > 0.0 { stiffness } else { 0.0 },
                        ahead: at.period_s,
                    };
                    (law(target.force_cap), law(target.torque_cap))
                }
                GuidanceMethod::Off | GuidanceMethod::Energy | GuidanceMethod::Capped => {
                    let law = |cap: f32, a: f32, times: f32| Law::Capped {
                        stiffness: times * target.stiffness * (a * a * a * a).max(MIN_STIFFNESS_SHARE),
                        cap: cap * a,
                        ahead: at.period_s + at.settings.time_s,
                    };
                    let turning = target.path.as_ref().map_or(1.0, |_| PATH_TURN_STIFFNESS);
                    (
                        law(target.force_cap, slot.engagement, 1.0),
                        law(target.torque_cap / at.length, slot.torque_engagement(), turning),
                    )
                }
            };
            for (turns, rows, law) in [(false, alignment.offset, offset), (true, alignment.angle, angle)] {
                if !rows.rows.is_empty() {
                    // Two a target, within the capacity.
                    let _ = springs.push(SaturatingSpring::new(
                        (i as u8, turns),
                        rows,
                        law,
                        RELEASE_N * slot.releasing,
                    ));
                }
            }
        }
    }

    /// Forms and ends contact exclusions, given the targets' springs and the bound on the object's motion in this tick: `motions` of one period,
    /// scaled as the step's unknowns, and the `slack` within which points are candidates. Returns whether any ended.
    pub fn exclude(
        &mut self,
        at: &Situation<'_, '_>,
        springs: &[SaturatingSpring],
        motions: &[[f32; 6]; 2],
        slack: f32,
    ) -> bool {
        let mut ended = false;
        for (i, slot) in self.slots.iter_mut().enumerate() {
            let was = slot.excluded;
            slot.excluded = slot.left > 0
                && slot.engagement == 1.0
                && at.settings.exclusions
                && self.method == GuidanceMethod::Capped
                && slot.faces_kept_apart(
                    at,
                    springs.iter().filter(|spring| usize::from(spring.slot) == i),
                    motions,
                    slack,
                );
            ended |= was && !slot.excluded;
        }
        ended
    }

    /// Face pairs that contact exclusions towards this part keep apart: the face of the tree's shape first, which is the moving one unless
    /// `backward`.
    pub fn excluded(&self, part: u16, backward: bool) -> ExcludedPairs {
        let mut all = ExcludedPairs::new();
        for slot in (self.slots.iter()).filter(|slot| slot.excluded && slot.target.static_part == part) {
            let Some(fit) = &slot.fit else { continue };
            for (i, &(m, s)) in slot.target.faces.iter().enumerate() {
                if fit.pairs >> i & 1 != 0 {
                    // Points on pairs beyond the capacity are searched as usual.
                    let _ = all.push(if backward { [s, m] } else { [m, s] });
                }
            }
        }
        all
    }

    /// Effect of guidance on contact between these faces: `moving` and `fixed` hold the face, and the second face where the point lies on an edge.
    fn mating(&self, part: u16, moving: [u16; 2], fixed: [u16; 2], settings: &GuidanceSettings) -> Mating {
        let mut mating = Mating::NONE;
        for slot in &self.slots {
            let target = &slot.target;
            let of_these = slot.engagement > 0.0
                && target.static_part == part
                && (target.faces.iter()).any(|(m, s)| holds(moving, *m) && holds(fixed, *s));
            if !of_these {
                continue;
            }
            mating.guided = true;
            let allowance_m = slot.torque_engagement() * settings.allowance_m;
            if self.method != GuidanceMethod::Thesis
                && makes_allowance(target.kind)
                && allowance_m > mating.allowance_m
            {
                mating.allowance_m = allowance_m;
            }
        }
        mating
    }

    /// Factor on the stiffness of contacts between guided faces: 1, except in the thesis' blend.
    pub fn share(&self, at: &Situation<'_, '_>) -> f32 {
        if self.method != GuidanceMethod::Thesis {
            return 1.0;
        }
        let mut weight = 0.0f32;
        for slot in &self.slots {
            if let Some(alignment) = slot.alignment(at) {
                weight = weight.max(self.weight(slot, &alignment, at));
            }
        }
        1.0 - weight
    }

    /// Records the insertion depth of the guided faces; `arms` of the touching points are from the centre of mass.
    pub fn observe(&mut self, arms: impl Iterator<Item = Vec3> + Clone, parts: &[Placed]) {
        self.insertion_m = 0.0;
        for slot in &self.slots {
            let Some(fixed) = parts.get(usize::from(slot.target.static_part)) else {
                continue;
            };
            let axis = fixed
                .pose
                .transform_vector(Vec3::from_array(slot.target.fixed.direction));
            let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
            for along in arms.clone().map(|arm| arm.dot(axis)) {
                low = low.min(along);
                high = high.max(along);
            }
            if high > low {
                self.insertion_m = self.insertion_m.max(high - low);
            }
        }
    }

    /// Weight x of the thesis, times engagement: ½e^(−θ/θ₀) + ½e^(−d/d₀), d₀ the cell of the fixed part's field, θ₀ the cell over the insertion
    /// depth.
    fn weight(&self, slot: &Slot, alignment: &Alignment, at: &Situation<'_, '_>) -> f32 {
        let at_rest = [0.0; 6];
        let d = alignment.offset.error(&at_rest, 0.0);
        let theta = alignment.angle.error(&at_rest, 0.0) / at.length;
        let voxel = at
            .scene
            .shape_of_part(usize::from(slot.target.static_part))
            .field
            .record()
            .cell;
        let theta_0 = voxel / self.insertion_m.max(voxel);
        slot.engagement * (0.5 * libm::expf(-theta / theta_0) + 0.5 * libm::expf(-d / voxel))
    }

    /// Whether there are no targets, not even fading ones.
    pub fn is_empty(&self) -> bool {
        self.slots.is_empty()
    }

    /// Whether any target is engaged at this part.
    pub fn concerns(&self, part: u16) -> bool {
        self.slots
            .iter()
            .any(|slot| slot.target.static_part == part && slot.engagement > 0.0)
    }

    /// Report on the targets, with the springs' wrench at the tick's end `x`.
    pub fn state(&self, springs: &[SaturatingSpring], x: &[f32; 6], length: f32) -> GuidanceState {
        let mut state = GuidanceState::default();
        for slot in &self.slots {
            state.active += u8::from(slot.left > 0);
            state.exclusions += u8::from(slot.excluded);
            if slot.engagement > state.engagement {
                state.engagement = slot.engagement;
            }
        }
        for spring in springs {
            state.wrench = state.wrench + spring.wrench(x, length);
        }
        state
    }
}

/// Contact rules of the targets in force, as the search queries them.
pub(crate) struct TargetRules<'a> {
    pub targets: &'a TargetSet,
    pub settings: &'a GuidanceSettings,
}

impl FacePairRules for TargetRules<'_> {
    fn concerns(&self, part: u16) -> bool {
        self.targets.concerns(part)
    }

    fn excluded(&self, part: u16, backward: bool) -> ExcludedPairs {
        self.targets.excluded(part, backward)
    }

    fn mating(&self, part: u16, moving: [u16; 2], fixed: [u16; 2]) -> Mating {
        self.targets.mating(part, moving, fixed, self.settings)
    }
}

/// Placements and settings at the time springs are made.
pub(crate) struct Situation<'a, 'i> {
    pub scene: &'a SceneImage<'i>,
    pub parts: &'a [Placed],
    /// Index of the held part.
    pub held: u16,
    pub object: Pose,
    pub center: Vec3,
    /// L, m.
    pub length: f32,
    pub period_s: f32,
    pub settings: &'a GuidanceSettings,
    /// k_T, N/m.
    pub coupling_stiffness: f32,
}

impl Slot {
    /// Value that the engagement approaches.
    fn goal(&self, on: bool) -> f32 {
        if on && self.left > 0 { 1.0 } else { 0.0 }
    }

    fn step(&self) -> f32 {
        self.torque_step()
            .min(FORCE_STEP_N / self.target.force_cap.max(FORCE_STEP_N))
    }

    fn torque_step(&self) -> f32 {
        STEP.min(TORQUE_STEP_NM / self.target.torque_cap.max(TORQUE_STEP_NM))
    }

    /// Engagement of the torque and of the allowance, which may grow faster than that of the force: a part that is aligned first enters the bore, one
    /// that reaches the axis first rests on the rim.
    ///
    /// A screw makes a force of its torque, so that both engage alike.
    fn torque_engagement(&self) -> f32 {
        let screw = |path: &Path| matches!(path.turn, PathTurn::Geared(rate) if rate != 0.0);
        if self.target.path.as_ref().is_some_and(screw) {
            return self.engagement;
        }
        (self.engagement * self.torque_step() / self.step()).min(1.0)
    }

    /// Whether the part is, and will be after this tick, so near to the target's goal that the mating faces cannot touch.
    fn faces_kept_apart<'p>(
        &mut self,
        at: &Situation<'_, '_>,
        springs: impl Iterator<Item = &'p SaturatingSpring>,
        motions: &[[f32; 6]; 2],
        slack: f32,
    ) -> bool {
        let (held, fixed) = (usize::from(at.held), usize::from(self.target.static_part));
        if held.max(fixed) >= at.scene.parts().len() {
            return false;
        }
        let fit = *self.fit.get_or_insert_with(|| {
            Fit::of(
                &self.target,
                &at.scene.shape_of_part(held),
                &at.scene.shape_of_part(fixed),
            )
        });
        if fit.pairs == 0 {
            return false;
        }
        // An exclusion forms with half of the clearance to spare: hysteresis against chatter.
        let share = if self.excluded { 1.0 } else { 0.5 };
        let limit = share * (at.settings.allowance_m + fit.gap_m);
        let mut reach = slack;
        for spring in springs {
            // At the part's farthest point, rather than at L.
            let lever = if spring.turns {
                fit.lever_m / at.length
            } else {
                1.0
            };
            reach += lever * spring.rows.error(&[0.0; 6], 0.0);
            if reach <= limit {
                let [a, b] = motions.map(|motion| spring.rows.speed(&motion));
                reach += lever * APPROACH * if a > b { a } else { b };
            }
        }
        reach <= limit
    }

    /// Alignment error of the target, if it exerts a force.
    fn alignment(&self, at: &Situation<'_, '_>) -> Option<Alignment> {
        let part = usize::from(self.target.static_part);
        let fixed = at.parts.get(part).filter(|_| part < at.scene.parts().len())?;
        (self.engagement > 0.0 || self.releasing > 0.0)
            .then(|| Alignment::of(&self.target, &at.object, at.center, &fixed.pose, at.length))
    }
}

/// Whether contact between a target's faces makes an allowance. Planes and cones stop a part, with more force than the target's cap: they are
/// unchanged.
fn makes_allowance(kind: ConstraintKind) -> bool {
    !matches!(kind, ConstraintKind::Coplanar | ConstraintKind::Conical)
}

/// Whether sequence number `a` follows `b`, across the wrap.
fn newer(a: u16, b: u16) -> bool {
    (a.wrapping_sub(b) as i16) > 0
}

/// Whether two targets are equal, sequence and expiry apart.
fn same_constraint(a: &ConstraintTarget, b: &ConstraintTarget) -> bool {
    a.kind == b.kind
        && a.moving == b.moving
        && a.static_part == b.static_part
        && a.fixed == b.fixed
        && a.stiffness == b.stiffness
        && a.force_cap == b.force_cap
        && a.torque_cap == b.torque_cap
        && a.path == b.path
        && a.faces == b.faces
}

/// Rejects numbers that are out of range.
fn check(target: &ConstraintTarget) -> Result<(), TargetError> {
    let unit = |d: [f32; 3]| (Vec3::from_array(d).length_squared() - 1.0).abs() < 1e-3;
    let near = |p: [f32; 3]| p.iter().all(|x| x.abs() < 100.0);
    let within = |x: f32, max: f32| (0.0..=max).contains(&x);
    let path = match &target.path {
        None => target.kind != ConstraintKind::Path,
        Some(path) => {
            let q = path.orientation;
            let squared = q.iter().fold(0.0, |sum, x| sum + x * x);
            let rate = match path.turn {
                PathTurn::Free => 0.0,
                PathTurn::Geared(rate) => rate,
            };
            target.kind == ConstraintKind::Path && (squared - 1.0).abs() < 1e-3 && rate.abs() <= MAX_PATH_RATE
        }
    };
    let good = path
        && unit(target.moving.direction)
        && unit(target.fixed.direction)
        && near(target.moving.point)
        && near(target.fixed.point)
        && (1.0..=1e7).contains(&target.stiffness)
        && within(target.force_cap, 100.0)
        && within(target.torque_cap, 10.0)
        && target.expiry_ticks > 0;
    if good { Ok(()) } else { Err(TargetError::BadNumber) }
}
