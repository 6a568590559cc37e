//! Constraint targets: which are in force, how far engaged, and how they pull.
//!
//! The desktop sends a target; the board holds it until it expires, is cleared or replaced. Nothing about a target is ever switched: its
//! *engagement* a rises from 0 to 1 and falls again by steps so small that the caps on all forces, a·F, together change by 0.015 N a tick at most and
//! those on torques by less than 2 mN m: a part on its way to the axis follows the cap's growth, and neither starts nor stops with a step of 0.05 N
//! on the handle. Torque comes first, as fast as it may. Within its cap a target is stiff,
//!
//! f = −a·F·u/√((a·F/(a⁴·k))² + |u|²),   u = e + (h + τ)·J·V'
//!
//! taken at the step's end like every other force of the step: near the goal a spring k with damping k·τ that holds micrometres, far from it a
//! pull of constant length, so that a hand stronger than the cap always gets away. While it comes or goes it is softer (a⁴), so that it
//! does not stop a part within a tick. The damping makes the way there exponential (τ = 20 ms).
//!
//! A target that ends leaves a part that the hand pulled against it: it would fly off. So a damper takes over where the pull falls, 200 N s/m up to
//! 1 N, and fades in a second: 0.4 N move the part at 2 mm/s.
//!
//! A target's pull is free; what the hand is given of it is not: see the source of `grip`.
//!
//! Where the target's faces meet, contact makes allowance_m: gaps between them count for larger by a·[`GuidanceSettings::allowance_m`]. The axis holds
//! what the wall held before, an exact fit goes in, and a part pulled off its axis against the cap finds the wall again. All other contacts
//! stay as they are, and so do planes and cones: they stop a part, and a push above the cap must not go 0.1 mm into a stop.
//!
//! [`GuidanceMethod::Thesis`] is the blend of Faas 2010 (eqs. 13–19), for comparison: a spring of 0.8·k_T without a cap, weighted with
//! x = ½e^(−θ/θ₀) + ½e^(−d/d₀), θ₀ = voxel/insertion depth, d₀ = voxel, and the contacts of those faces weighted with 1 − x. A target whose caps
//! are 0 pulls with nothing there too, and contacts alone give way: her hybrid method “without constraint evaluation” (section 8.2.2).

use glam::Vec3;
use heapless::Vec;
use mortise_protocol::image::SceneImage;
use mortise_protocol::limits::MAX_TARGETS;
use mortise_protocol::message::{ConstraintKind, ConstraintTarget};

use crate::collision::placement::Placed;
use crate::collision::rules::{ExcludedPairs, FacePairRules, Mating, holds};
use crate::collision::search::APPROACH;
use crate::constraints::alignment::Alignment;
use crate::constraints::fit::Fit;
use crate::constraints::saturating_spring::{Law, MAX_SPRINGS, RELEASE_N, SaturatingSpring};
use crate::io::GuidanceState;
use crate::math::pose::Pose;
use crate::settings::{GuidanceMethod, GuidanceSettings};

/// Engagement grows and falls by this a tick at most.
const STEP: f32 = 1.0 / 64.0;
/// The cap on the force changes by this a tick at most, N.
const FORCE_STEP_N: f32 = 0.015;
/// The cap on the torque likewise, N m.
const TORQUE_STEP_NM: f32 = 1.8e-3;
/// Fading of what lets go, a tick.
const RELEASE_STEP: f32 = 1.0 / 1024.0;
/// Share of the stiffness that is there at least, so that a target without any pull has a number for its slack.
const LEAST_STIFF: f32 = 1e-6;
/// Stiffness of the thesis' constraint spring over the coupling's.
const THESIS_SHARE: f32 = 0.8;

/// Why a target was not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TargetError {
    /// A number in it is not finite or out of range, or a direction is not of unit length.
    BadNumber,
    /// Its part is not in the scene, or is the one in hand.
    NoSuchPart,
    /// No allowance_m: as many targets as there may be are in force or fading.
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
    /// How much of the damper is there that lets the part go slowly, 0 to 1.
    releasing: f32,
    /// How its faces fit; none until it is first fully engaged.
    fit: Option<Fit>,
    /// Whether it keeps them apart now.
    excluded: bool,
}

/// All targets.
#[derive(Clone, Debug)]
pub(crate) struct TargetSet {
    slots: Vec<Slot, MAX_TARGETS>,
    /// How they pull: as set, once all that pulled otherwise has faded.
    method: GuidanceMethod,
    /// How far apart contacts of guided faces lay along the fixed feature's direction in the last tick, m.
    insertion_m: f32,
}

impl TargetSet {
    pub const fn new() -> Self {
        Self {
            slots: Vec::new(),
            // All zero; the first tick takes what is set.
            method: GuidanceMethod::Off,
            insertion_m: 0.0,
        }
    }

    /// Takes a target: new, refreshed, or replacing the one of its id, which fades while the new one engages. One older than what is known of its id
    /// changes nothing.
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

    /// The target of this id fades.
    pub fn clear(&mut self, id: u16) {
        for slot in self.slots.iter_mut().filter(|slot| slot.target.id == id) {
            slot.left = 0;
        }
    }

    /// All targets are gone at once. For when nothing is held.
    pub fn forget(&mut self) {
        self.slots.clear();
        self.insertion_m = 0.0;
    }

    /// A tick passes: targets engage, expire, fade and vanish. Those that change share what may change in a tick. Another method takes over when what
    /// the one before held has faded.
    pub fn step(&mut self, settings: &GuidanceSettings) {
        if self.method != settings.method && self.slots.iter().all(|slot| slot.engagement == 0.0) {
            self.method = settings.method;
        }
        let on = self.method == settings.method && self.method != GuidanceMethod::Off;
        let mut changing = 0u8;
        for slot in &mut self.slots {
            slot.left = slot.left.saturating_sub(1);
            changing += u8::from(slot.engagement != slot.wanted(on));
        }
        let share = 1.0 / f32::from(changing.max(1));
        for slot in &mut self.slots {
            let step = slot.step() * share;
            if slot.wanted(on) > 0.0 {
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

    /// What the targets pull with in this tick, appended to `pulls`: too large to be handed about by value.
    pub fn add_springs(&self, at: &Situation<'_, '_>, springs: &mut Vec<SaturatingSpring, MAX_SPRINGS>) {
        for (i, slot) in self.slots.iter().enumerate() {
            let Some(alignment) = slot.alignment(at) else {
                continue;
            };
            let target = &slot.target;
            // A turn as seen at the distance L: k·L² for the angle, torque cap over L.
            let (offset, angle) = match self.method {
                GuidanceMethod::Thesis => {
                    let stiffness = THESIS_SHARE * at.coupling_stiffness * self.weight(slot, &alignment, at);
                    let law = |cap: f32| Law::Spring {
                        stiffness: if cap > 0.0 { stiffness } else { 0.0 },
                        ahead: at.period_s,
                    };
                    (law(target.force_cap), law(target.torque_cap))
                }
                GuidanceMethod::Off | GuidanceMethod::Capped => {
                    let law = |cap: f32, a: f32| Law::Capped {
                        stiffness: target.stiffness * (a * a * a * a).max(LEAST_STIFF),
                        cap: cap * a,
                        ahead: at.period_s + at.settings.time_s,
                    };
                    (
                        law(target.force_cap, slot.engagement),
                        law(target.torque_cap / at.length, slot.ahead()),
                    )
                }
            };
            for (turns, rows, law) in [(false, alignment.offset, offset), (true, alignment.angle, angle)] {
                if !rows.rows.is_empty() {
                    // Two a target: there is allowance_m.
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

    /// Forms and ends exclusions, given what the targets pull with and how far the object may move in this tick: `motions` of one period, scaled as the
    /// step's unknowns, and the `slack` within which points are wanted. Whether any ended.
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
                && slot.keeps_apart(
                    at,
                    springs.iter().filter(|p| usize::from(p.slot) == i),
                    motions,
                    slack,
                );
            ended |= was && !slot.excluded;
        }
        ended
    }

    /// Pairs of faces that exclusions to this part keep apart: those of the tree's shape first, which is the moving one unless `backward`.
    pub fn excluded(&self, part: u16, backward: bool) -> ExcludedPairs {
        let mut all = ExcludedPairs::new();
        for slot in (self.slots.iter()).filter(|slot| slot.excluded && slot.target.static_part == part) {
            let Some(fit) = &slot.fit else { continue };
            for (i, &(m, s)) in slot.target.faces.iter().enumerate() {
                if fit.pairs >> i & 1 != 0 {
                    // Beyond what there is room for, points are looked at.
                    let _ = all.push(if backward { [s, m] } else { [m, s] });
                }
            }
        }
        all
    }

    /// Of contact between these faces: `moving` and `fixed` name the face, and the other one where the point lies on an edge.
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
            let allowance_m = slot.ahead() * settings.allowance_m;
            if self.method != GuidanceMethod::Thesis
                && makes_allowance(target.kind)
                && allowance_m > mating.allowance_m
            {
                mating.allowance_m = allowance_m;
            }
        }
        mating
    }

    /// What is left of the stiffness of contacts between guided faces: all of it, except in the thesis' blend.
    pub fn share(&self, at: &Situation<'_, '_>) -> f32 {
        if self.method != GuidanceMethod::Thesis {
            return 1.0;
        }
        let mut most = 0.0f32;
        for slot in &self.slots {
            if let Some(alignment) = slot.alignment(at) {
                most = most.max(self.weight(slot, &alignment, at));
            }
        }
        1.0 - most
    }

    /// Takes note of how deep the guided faces are in each other: `arms` of the touching points, from the centre of mass.
    pub fn observe(&mut self, arms: impl Iterator<Item = Vec3> + Clone, parts: &[Placed]) {
        self.insertion_m = 0.0;
        for slot in &self.slots {
            let Some(fixed) = parts.get(usize::from(slot.target.static_part)) else {
                continue;
            };
            let axis = fixed
                .pose
                .transform_vector(Vec3::from_array(slot.target.fixed.direction));
            let (mut least, mut most) = (f32::INFINITY, f32::NEG_INFINITY);
            for along in arms.clone().map(|arm| arm.dot(axis)) {
                least = least.min(along);
                most = most.max(along);
            }
            if most > least {
                self.insertion_m = self.insertion_m.max(most - least);
            }
        }
    }

    /// x of the thesis, times engagement: ½e^(−θ/θ₀) + ½e^(−d/d₀), d₀ the cell of the fixed part's field, θ₀ that over the insertion depth.
    fn weight(&self, slot: &Slot, alignment: &Alignment, at: &Situation<'_, '_>) -> f32 {
        let still = [0.0; 6];
        let d = alignment.offset.error(&still, 0.0);
        let theta = alignment.angle.error(&still, 0.0) / at.length;
        let voxel = at
            .scene
            .shape_of_part(usize::from(slot.target.static_part))
            .field
            .record()
            .cell;
        let theta_0 = voxel / self.insertion_m.max(voxel);
        slot.engagement * (0.5 * libm::expf(-theta / theta_0) + 0.5 * libm::expf(-d / voxel))
    }

    /// Whether there are none, not even fading.
    pub fn is_empty(&self) -> bool {
        self.slots.is_empty()
    }

    /// Whether any target makes room at this part.
    pub fn concerns(&self, part: u16) -> bool {
        self.slots
            .iter()
            .any(|slot| slot.target.static_part == part && slot.engagement > 0.0)
    }

    /// How the targets stand, with the pulls of the tick at its end `x`.
    pub fn state(&self, springs: &[SaturatingSpring], x: &[f32; 6], length: f32) -> GuidanceState {
        let mut state = GuidanceState::default();
        for slot in &self.slots {
            state.active += u8::from(slot.left > 0);
            state.exclusions += u8::from(slot.excluded);
            if slot.engagement > state.engagement {
                state.engagement = slot.engagement;
            }
        }
        for pull in springs {
            state.wrench = state.wrench + pull.wrench(x, length);
        }
        state
    }
}

/// The targets in force, as the search asks for them.
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

    fn max_allowance_m(&self) -> f32 {
        self.settings.allowance_m
    }
}

/// Where things stand when pulls are made.
pub(crate) struct Situation<'a, 'i> {
    pub scene: &'a SceneImage<'i>,
    pub parts: &'a [Placed],
    /// Index of the part in hand.
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
    /// Where engagement goes.
    fn wanted(&self, on: bool) -> f32 {
        if on && self.left > 0 { 1.0 } else { 0.0 }
    }

    fn step(&self) -> f32 {
        self.torque_step()
            .min(FORCE_STEP_N / self.target.force_cap.max(FORCE_STEP_N))
    }

    fn torque_step(&self) -> f32 {
        STEP.min(TORQUE_STEP_NM / self.target.torque_cap.max(TORQUE_STEP_NM))
    }

    /// Engagement of the torque and of the allowance_m, which need not grow as slowly as the force: a part that comes upright first goes in, one that
    /// comes to the axis first stands on the rim.
    fn ahead(&self) -> f32 {
        (self.engagement * self.torque_step() / self.step()).min(1.0)
    }

    /// Whether the part is so near to where the target wants it, and will be after this tick, that the mating faces cannot touch.
    fn keeps_apart<'p>(
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
        // Forms with half the room to spare, so that it does not come and go.
        let share = if self.excluded { 1.0 } else { 0.5 };
        let most = share * (at.settings.allowance_m + fit.gap_m);
        let mut off = slack;
        for pull in springs {
            // Seen at the part's farthest point, not at L.
            let lever = if pull.turns { fit.lever_m / at.length } else { 1.0 };
            off += lever * pull.rows.error(&[0.0; 6], 0.0);
            if off <= most {
                let [a, b] = motions.map(|motion| pull.rows.speed(&motion));
                off += lever * APPROACH * if a > b { a } else { b };
            }
        }
        off <= most
    }

    /// How far the target is from being met, if it pulls at all.
    fn alignment(&self, at: &Situation<'_, '_>) -> Option<Alignment> {
        let part = usize::from(self.target.static_part);
        let fixed = at.parts.get(part).filter(|_| part < at.scene.parts().len())?;
        (self.engagement > 0.0 || self.releasing > 0.0)
            .then(|| Alignment::of(&self.target, &at.object, at.center, &fixed.pose, at.length))
    }
}

/// Whether contact between a target's faces makes allowance_m. Planes and cones stop a part, with more force than the target's cap: they stay where they
/// are.
fn makes_allowance(kind: ConstraintKind) -> bool {
    !matches!(kind, ConstraintKind::Coplanar | ConstraintKind::Conical)
}

/// Whether sequence number `a` came after `b`, across the wrap.
fn newer(a: u16, b: u16) -> bool {
    (a.wrapping_sub(b) as i16) > 0
}

/// Whether two targets ask for the same, sequence and expiry apart.
fn same_constraint(a: &ConstraintTarget, b: &ConstraintTarget) -> bool {
    a.kind == b.kind
        && a.moving == b.moving
        && a.static_part == b.static_part
        && a.fixed == b.fixed
        && a.stiffness == b.stiffness
        && a.force_cap == b.force_cap
        && a.torque_cap == b.torque_cap
        && a.faces == b.faces
}

/// Refuses numbers that make no constraint.
fn check(target: &ConstraintTarget) -> Result<(), TargetError> {
    let unit = |d: [f32; 3]| (Vec3::from_array(d).length_squared() - 1.0).abs() < 1e-3;
    let near = |p: [f32; 3]| p.iter().all(|x| x.abs() < 100.0);
    let within = |x: f32, most: f32| (0.0..=most).contains(&x);
    let good = unit(target.moving.direction)
        && unit(target.fixed.direction)
        && near(target.moving.point)
        && near(target.fixed.point)
        && (1.0..=1e7).contains(&target.stiffness)
        && within(target.force_cap, 100.0)
        && within(target.torque_cap, 10.0)
        && target.expiry_ticks > 0;
    if good { Ok(()) } else { Err(TargetError::BadNumber) }
}
