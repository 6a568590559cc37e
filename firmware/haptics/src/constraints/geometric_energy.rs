//! Geometric energy: what draws the held part to where it fits, for any shapes, without recognised faces and without targets.
//!
//! Each [`Energy`] of the scene that moves the held part gives an energy E(X), a force −∂E/∂p and a torque −∂E/∂φ at the part's pose X. The depth of the
//! well in joules follows from [`GuidanceSettings::geometric_force_n`], the largest force. Sums over hundreds of charges do not fit a tick, so they are made
//! in *rounds*: [`CHARGES_PER_TICK`] charges a tick at the pose X₀ of the round's start, and the last whole round acts meanwhile, as the model
//!
//! m(δ) = E(X₀) − w₀·δ + ½·δᵀ·K·δ
//!
//! with δ the displacement from X₀. The wrench w₀ − K·δ of the model is linear, and K positive semi-definite, so it enters the implicit step as it is. Where
//! K·δ would exceed the largest force (a hand that moves the part faster than rounds follow), X₀ is dragged along, which takes energy. Where no charge is in
//! the lattice, neither force nor stiffness acts. The engagement rises from the first whole round on, in 256 ticks.
//!
//! K is the writer's majoriser at that depth, or a share of it, [`LOOSE_SHARE`]. With the whole of it m(δ) ≥ E(X), and replacing one model by the next makes
//! no energy, but for the length of a round the part is held back like by a damper. With the share a part moves freely, and a replacement may make energy. So
//! each replacement is accounted for: what the model that ends stored at the part's pose, less what the next one stores there, is *saved*, up to
//! [`MOST_SAVED_J`]. As long as something is saved the share acts; a replacement that overdraws is expanded anew about the part's pose, with the whole and the same
//! force and energy there. A sequence of rounds makes more than [`MOST_SAVED_J`] only by the replacements that overdraw, so where the part is fast.
//!
//! The energy finds and does not hold: interior overlap is left to contact, and a fit that is to be held to micrometres to targets. Its method is chosen
//! instead of theirs. What it stores was supplied by nobody; the operator is kept from it as from that of targets, by [`crate::passivity::energy_bound`].
//!
//! Source: M. Behandish, H. Ilieş, *Peg-in-Hole Revisited: A Generic Force Model for Haptic Assembly*, JCISE 15(4), 2015, eqs. 11 to 13; rounds,
//! majoriser and account are ours. Cost on a Cortex-M7: 230 instructions for each charge of the tick that is in the lattice and 1,300 more; none with another
//! method. A tick after one that is busy with contact takes [`CHARGES_PER_BUSY_TICK`] of them. The budget of the search for contacts is charged for them.

use glam::{Mat3, Quat, Vec3};
use mortise_protocol::image::{ENERGY_DEPTHS, Energy, SceneImage};

use crate::collision::cost::{energy_cost, face_pairs_cost};
use crate::collision::placement::Placed;
use crate::dynamics::body::Grabbed;
use crate::dynamics::force::{ForceTerm, Iterate};
use crate::dynamics::system::System;
use crate::math::pose::{Pose, Wrench};
use crate::math::scalar::{larger, smaller};
use crate::math::vector::length;
use crate::settings::{GuidanceMethod, GuidanceSettings};

/// Charges evaluated in a tick.
pub(crate) const CHARGES_PER_TICK: u16 = 64;
/// Charges evaluated in a tick after one that was busy with contact.
const CHARGES_PER_BUSY_TICK: u16 = 32;
/// Share of the majoriser with which the part is held while energy is saved.
const LOOSE_SHARE: f32 = 0.1;
/// Most that is saved of the energy that replaced models take, J.
const MOST_SAVED_J: f32 = 5e-5;
/// Largest change of the engagement a tick.
const STEP: f32 = 1.0 / 256.0;

/// The energies of the held part over the ticks.
#[derive(Clone, Debug)]
pub(crate) struct GeometricEnergy {
    /// Rises from 0 to 1 with the method, and falls again.
    engagement: f32,
    round: Round,
    /// Result of the last whole round, if an energy moves the held part.
    found: Option<Model>,
    /// Energy that replaced models took, less what others made, J.
    saved_j: f32,
}

/// Sums of a round so far.
#[derive(Clone, Debug)]
struct Round {
    /// Whether it has begun; else the next tick begins it.
    running: bool,
    object: Pose,
    center: Vec3,
    /// Number of the energy, and of its charge, that comes next.
    energy: u32,
    charge: u32,
    /// Of that energy's charges: energy, force and torque in the fixed part's frame, for unit depth.
    sum: Sum,
    /// Of the energies before it.
    model: Model,
    /// Whether there was one of the held part among them.
    acts: bool,
}

/// Energy, force times the lattice's step and torque about the centre of mass, for unit depth.
#[derive(Clone, Copy, Debug)]
struct Sum {
    energy: f32,
    force: Vec3,
    torque: Vec3,
    /// Whether any charge is in the lattice.
    acts: bool,
}

impl Sum {
    const ZERO: Self = Self {
        energy: 0.0,
        force: Vec3::ZERO,
        torque: Vec3::ZERO,
        acts: false,
    };
}

/// The model about the pose of a round, world axes, for a largest force of 1 N.
#[derive(Clone, Copy, Debug)]
struct Model {
    center: Vec3,
    orientation: Quat,
    /// Energy at that pose, J.
    energy: f32,
    wrench: Wrench,
    stiffness: Stiffness,
    /// Energy of the deepest well, which gives the way's direction, for unit depth.
    deepest: f32,
}

/// Majorising stiffness, for a largest force of 1 N.
#[derive(Clone, Copy, Debug)]
struct Stiffness {
    /// Across the way, N/m.
    across: f32,
    /// What that along the way is more, N/m; negative when it is less.
    along_more: f32,
    /// Unit vector along the way.
    way: Vec3,
    /// Of rotations about the centre of mass, N m/rad.
    turning: f32,
}

impl Stiffness {
    const ZERO: Self = Self {
        across: 0.0,
        along_more: 0.0,
        way: Vec3::ZERO,
        turning: 0.0,
    };

    fn times(&self, moved: Vec3) -> Vec3 {
        moved * self.across + self.way * (self.along_more * self.way.dot(moved))
    }

    /// What its springs store, J.
    fn energy(&self, moved: Vec3, turned: Vec3) -> f32 {
        0.5 * (moved.dot(self.times(moved)) + self.turning * turned.length_squared())
    }

    fn scaled(&self, by: f32) -> Self {
        Self {
            across: self.across * by,
            along_more: self.along_more * by,
            way: self.way,
            turning: self.turning * by,
        }
    }
}

impl Model {
    const NONE: Self = Self {
        center: Vec3::ZERO,
        orientation: Quat::from_xyzw(0.0, 0.0, 0.0, 0.0),
        energy: 0.0,
        wrench: Wrench::ZERO,
        stiffness: Stiffness::ZERO,
        deepest: 0.0,
    };

    /// Displacement of the centre of mass and rotation vector since the round, the latter as 2·sin(φ/2).
    fn moved(&self, grabbed: &Grabbed) -> (Vec3, Vec3) {
        let q = grabbed.orientation * self.orientation.conjugate();
        let turned = Vec3::new(q.x, q.y, q.z) * 2.0;
        (
            grabbed.center - self.center,
            if q.w < 0.0 { -turned } else { turned },
        )
    }

    /// m(δ) at the held part's pose, J.
    fn energy(&self, grabbed: &Grabbed) -> f32 {
        let (moved, turned) = self.moved(grabbed);
        let linear = self.wrench.force.dot(moved) + self.wrench.torque.dot(turned);
        self.energy - linear + self.stiffness.energy(moved, turned)
    }

    /// Expands the model anew about the held part's pose, with another stiffness: force, torque and energy at that pose stay the same.
    fn go_on_about(&mut self, grabbed: &Grabbed, stiffness: Stiffness) {
        let (moved, turned) = self.moved(grabbed);
        self.energy = self.energy(grabbed);
        self.wrench.force -= self.stiffness.times(moved);
        self.wrench.torque -= turned * self.stiffness.turning;
        self.center = grabbed.center;
        self.orientation = grabbed.orientation;
        self.stiffness = stiffness;
    }

    /// Drags the pose of the round along where the model's springs exceed 1 N, or the torque `length` (m) times that. What it stores stays the same.
    fn drag(&mut self, grabbed: &Grabbed, length_m: f32) {
        let (moved, turned) = self.moved(grabbed);
        let force = length(self.stiffness.times(moved));
        let torque = self.stiffness.turning * length(turned);
        if force <= 1.0 && torque <= length_m {
            return;
        }
        let stored = self.energy(grabbed);
        if force > 1.0 {
            self.center += moved * (1.0 - 1.0 / force);
        }
        if torque > length_m {
            let by = turned * (1.0 - length_m / torque);
            self.orientation = crate::math::rotation::exp(by) * self.orientation;
        }
        self.energy += stored - self.energy(grabbed);
    }

    /// Adds an energy whose charges are all summed. Where none of them is in the lattice the energy is zero all about, and needs no majoriser: its
    /// stiffness would only drag a part that is far from its fit.
    fn add(&mut self, energy: &Energy<'_>, sum: &Sum, fixed: &Pose) {
        if !sum.acts {
            return;
        }
        let record = energy.record;
        // Joules of depth for a largest force of 1 N.
        let depth_j = 1.0 / record.largest_force;
        self.energy += sum.energy * depth_j;
        let force = sum.force * (depth_j / record.step);
        self.wrench.force += fixed.transform_vector(force);
        self.wrench.torque += fixed.transform_vector(sum.torque * depth_j);
        let at = |row: &[f32; ENERGY_DEPTHS]| depth_j * interpolated(row, -sum.energy);
        let (across, along) = (at(&record.across), at(&record.along));
        let stiffness = &mut self.stiffness;
        stiffness.turning += at(&record.turning);
        if sum.energy < self.deepest {
            self.deepest = sum.energy;
            // Of another energy's way no more is known than the larger of both.
            let before = larger(stiffness.across, stiffness.across + stiffness.along_more);
            stiffness.across = before + across;
            stiffness.along_more = along - across;
            stiffness.way = fixed.transform_vector(Vec3::from_array(record.way));
        } else {
            stiffness.across += larger(across, along);
        }
    }
}

/// Entry of a table over depths from 0 to 1, linear between entries.
fn interpolated(row: &[f32; ENERGY_DEPTHS], depth: f32) -> f32 {
    let last = ENERGY_DEPTHS - 1;
    // In this order what is not a number becomes 0.
    let at = smaller(1.0, larger(0.0, depth)) * last as f32;
    let below = (at as usize).min(last - 1);
    let share = at - below as f32;
    row[below] + share * (row[below + 1] - row[below])
}

/// Scene and held part of a tick.
pub(crate) struct EnergySituation<'a, 'i> {
    pub scene: &'a SceneImage<'i>,
    pub parts: &'a [Placed],
    pub grabbed: &'a Grabbed,
    /// h, s.
    pub period_s: f32,
    /// L, m.
    pub length: f32,
    /// Whether the last tick was busy with contact.
    pub busy: bool,
}

impl GeometricEnergy {
    /// Nothing felt. All bits zero but the tag of `found`.
    pub const fn new() -> Self {
        Self {
            engagement: 0.0,
            round: Round {
                running: false,
                object: Pose {
                    position: Vec3::ZERO,
                    orientation: Quat::from_xyzw(0.0, 0.0, 0.0, 0.0),
                },
                center: Vec3::ZERO,
                energy: 0,
                charge: 0,
                sum: Sum::ZERO,
                model: Model::NONE,
                acts: false,
            },
            found: None,
            saved_j: 0.0,
        }
    }

    /// Forgets everything: for when nothing is held.
    pub fn clear(&mut self) {
        self.engagement = 0.0;
        self.round.running = false;
        self.found = None;
        self.saved_j = 0.0;
    }

    /// What it takes of a tick's budget, field queries; in a busy tick as in a calm one, since a budget that changed with it would make the next tick calm.
    /// With it, since nothing is to spare, what it takes to gather as many `face_pairs` as in the last tick.
    pub fn cost(&self, face_pairs: u16) -> u32 {
        if self.round.running || self.found.is_some() {
            energy_cost(CHARGES_PER_TICK) + face_pairs_cost(face_pairs)
        } else {
            0
        }
    }

    /// 0 to 1.
    pub fn engagement(&self) -> f32 {
        self.engagement
    }

    /// Advances by a tick; returns the force of this one, `None` when there is none.
    pub fn step(&mut self, at: &EnergySituation<'_, '_>, settings: &GuidanceSettings) -> Option<EnergyForce> {
        let is_on = settings.method == GuidanceMethod::Energy && at.scene.energy_count() > 0;
        if !is_on && self.engagement == 0.0 {
            self.clear();
            return None;
        }
        if let Some(next) = self.sum(at) {
            self.replace(next, at.grabbed, self.engagement * settings.geometric_force_n);
        }
        // Not before there is a model: none of the force arrives at once, and without an energy of the held part nothing guides.
        self.engagement = if is_on && self.found.is_some() {
            smaller(self.engagement + STEP, 1.0)
        } else {
            larger(self.engagement - STEP, 0.0)
        };
        if self.engagement == 0.0 {
            return None;
        }
        let model = self.found.as_mut()?;
        model.drag(at.grabbed, at.length);
        let largest_n = self.engagement * settings.geometric_force_n;
        let (moved, turned) = model.moved(at.grabbed);
        Some(EnergyForce {
            wrench: Wrench {
                force: (model.wrench.force - model.stiffness.times(moved)) * largest_n,
                torque: (model.wrench.torque - turned * model.stiffness.turning) * largest_n,
            },
            stiffness: model.stiffness.scaled(largest_n),
            period_s: at.period_s,
            length: at.length,
        })
    }

    /// Puts the model of a whole round in force, for a largest force of `largest_n`, and accounts for it.
    fn replace(&mut self, next: Option<Model>, grabbed: &Grabbed, largest_n: f32) {
        let last = core::mem::replace(&mut self.found, next);
        let Some(next) = &mut self.found else {
            return;
        };
        let whole = next.stiffness;
        next.stiffness = whole.scaled(LOOSE_SHARE);
        let Some(last) = last else {
            return;
        };
        let saved_j = self.saved_j + (last.energy(grabbed) - next.energy(grabbed)) * largest_n;
        if saved_j < 0.0 {
            next.go_on_about(grabbed, whole);
        }
        self.saved_j = smaller(saved_j, MOST_SAVED_J);
    }

    /// Continues the round by a tick's charges; returns the model of a whole one, which is `None` where no energy moves the held part.
    fn sum(&mut self, at: &EnergySituation<'_, '_>) -> Option<Option<Model>> {
        let round = &mut self.round;
        let grabbed = at.grabbed;
        if !round.running {
            *round = Round {
                running: true,
                object: grabbed.pose(),
                center: grabbed.center,
                energy: 0,
                charge: 0,
                sum: Sum::ZERO,
                model: Model {
                    center: grabbed.center,
                    orientation: grabbed.orientation,
                    ..Model::NONE
                },
                acts: false,
            };
        }
        let mut left = if at.busy {
            CHARGES_PER_BUSY_TICK
        } else {
            CHARGES_PER_TICK
        };
        while left > 0 {
            let Some(energy) = at.scene.energy(round.energy as usize) else {
                round.running = false;
                return Some(round.acts.then_some(round.model));
            };
            let fixed = at.parts.get(usize::from(energy.record.fixed));
            let acts = energy.record.moving == grabbed.part;
            let Some(fixed) = fixed.filter(|_| acts) else {
                // A record costs no more than a charge.
                left -= 1;
                round.energy += 1;
                continue;
            };
            let charges = energy.charges.get(round.charge as usize..).unwrap_or(&[]);
            let now = charges.len().min(usize::from(left));
            round.sum_charges(&energy, &fixed.pose, &charges[..now]);
            left -= now as u16;
            round.charge += now as u32;
            if now == charges.len() {
                let sum = round.sum;
                round.model.add(&energy, &sum, &fixed.pose);
                round.acts = true;
                round.sum = Sum::ZERO;
                round.charge = 0;
                round.energy += 1;
                left = left.saturating_sub(1);
            }
        }
        None
    }
}

impl Round {
    /// Adds some of an energy's charges. Not inlined: its loop needs all registers.
    #[inline(never)]
    fn sum_charges(
        &mut self,
        energy: &Energy<'_>,
        fixed: &Pose,
        charges: &[mortise_protocol::image::ChargeRecord],
    ) {
        let record = energy.record;
        let per_step = 1.0 / record.step;
        let back = fixed.orientation.conjugate();
        let to_steps = Mat3::from_quat(back * self.object.orientation) * per_step;
        let origin =
            (back * (self.object.position - fixed.position) - Vec3::from_array(record.origin)) * per_step;
        let center = (back * (self.center - fixed.position) - Vec3::from_array(record.origin)) * per_step;
        let mut sum = self.sum;
        for charge in charges {
            let place = to_steps * Vec3::from_array(charge.at) + origin;
            let Some((value, slope)) = energy.at(place.to_array(), charge.charge) else {
                continue;
            };
            let force = Vec3::from_array(slope);
            sum.acts = true;
            sum.energy -= value;
            sum.force += force;
            sum.torque += (place - center).cross(force);
        }
        self.sum = sum;
    }
}

/// The model of the last round within a step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EnergyForce {
    /// At the tick's start, world axes, at the centre of mass.
    wrench: Wrench,
    stiffness: Stiffness,
    period_s: f32,
    /// L, m.
    length: f32,
}

impl EnergyForce {
    /// Wrench after the twist `x` has acted for `period_s`.
    pub fn wrench(&self, x: &[f32; 6], period_s: f32) -> Wrench {
        let [x, y, z, a, b, c] = *x;
        let turn = Vec3::new(a, b, c) * (self.stiffness.turning * period_s / self.length);
        Wrench {
            force: self.wrench.force - self.stiffness.times(Vec3::new(x, y, z) * period_s),
            torque: self.wrench.torque - turn,
        }
    }
}

impl ForceTerm for EnergyForce {
    /// Linear: its majoriser is itself.
    fn linearise(&mut self, _: &Iterate<'_>) -> bool {
        true
    }

    fn add_to(&self, system: &mut System) {
        let (h, s) = (self.period_s, &self.stiffness);
        let inverse_length = 1.0 / self.length;
        for i in 0..3 {
            system.matrix.add(i, i, h * h * s.across);
            (system.matrix).add(3 + i, 3 + i, h * h * s.turning * inverse_length * inverse_length);
        }
        let [x, y, z] = s.way.to_array();
        (system.matrix).add_outer(h * h * s.along_more, &[x, y, z, 0.0, 0.0, 0.0]);
        let (f, t) = (self.wrench.force * h, self.wrench.torque * (h * inverse_length));
        for (r, w) in system.right.iter_mut().zip([f.x, f.y, f.z, t.x, t.y, t.z]) {
            *r += w;
        }
    }

    fn add_wrench(&self, x: &[f32; 6], period_s: f32, to: &mut Wrench) {
        let wrench = self.wrench(x, period_s);
        to.force += wrench.force;
        to.torque += wrench.torque;
    }

    #[cfg(test)]
    fn energy_j(&self, x: &[f32; 6]) -> f32 {
        let h = self.period_s;
        let [x, y, z, a, b, c] = *x;
        let (moved, turned) = (Vec3::new(x, y, z) * h, Vec3::new(a, b, c) * (h / self.length));
        let linear = self.wrench.force.dot(moved) + self.wrench.torque.dot(turned);
        self.stiffness.energy(moved, turned) - linear
    }
}

/// An energy that may be absent.
impl ForceTerm for Option<EnergyForce> {
    fn linearise(&mut self, at: &Iterate<'_>) -> bool {
        self.as_mut().is_none_or(|force| force.linearise(at))
    }

    fn add_to(&self, system: &mut System) {
        if let Some(force) = self {
            force.add_to(system);
        }
    }

    fn add_wrench(&self, x: &[f32; 6], period_s: f32, to: &mut Wrench) {
        if let Some(force) = self {
            force.add_wrench(x, period_s, to);
        }
    }

    #[cfg(test)]
    fn energy_j(&self, x: &[f32; 6]) -> f32 {
        self.as_ref().map_or(0.0, |force| force.energy_j(x))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dynamics::force::contract;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_energy_is_a_force_term(
            force in prop::array::uniform3(-3.0f32..3.0),
            torque in prop::array::uniform3(-0.1f32..0.1),
            (across, along, turning) in (0.0f32..5000.0, 0.0f32..5000.0, 0.0f32..5.0),
            x in contract::twists(),
            v in contract::twists(),
            along_axis in 0usize..6,
        ) {
            let way = Vec3::new(0.48, -0.6, 0.64);
            let mut term = EnergyForce {
                wrench: Wrench { force: Vec3::from_array(force), torque: Vec3::from_array(torque) },
                stiffness: Stiffness { across, along_more: along - across, way, turning },
                period_s: 1e-3,
                length: 0.02,
            };
            contract::majorises(&mut term, &Iterate { x: &x, contact: None }, &v, 1e-3, 0.02)?;
            contract::conserves(&mut term, &x, (along_axis, 2e-2), 1e-3, 1e-3, 0.02)?;
        }
    }

    #[test]
    fn a_table_is_linear_between_its_entries_and_ends_at_both_sides() {
        let row = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 14.0];
        for (depth, value) in [
            (-0.5, 0.0),
            (0.0, 0.0),
            (0.5, 3.5),
            (6.5 / 7.0, 10.0),
            (1.0, 14.0),
            (3.0, 14.0),
        ] {
            assert!((interpolated(&row, depth) - value).abs() < 1e-4, "{depth}");
        }
        assert!(interpolated(&row, f32::NAN).is_finite());
    }
}
