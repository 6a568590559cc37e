//! Contact forces within a step: unilateral springs, damped on approach, with their active set.
//!
//! Contact i has gap φ and row J = (n, r × n); with rate s = J·V' its force is
//!
//! λ = k·max(0, −(φ + h·s + τ·min(0, s)))
//!
//! continuous, decreasing in s, never pulling: minus the gradient of a convex function of V'. The majoriser takes the branch of each contact (its
//! *phase*) from the last iterate (primal active set).
//!
//! Cost on a Cortex-M7 (counted as in [`crate::tick()`]): about 300 instructions for a contact in all passes over it together.

use core::array;

use glam::Vec3;

use crate::collision::contact::{Contact, Phase};
use crate::dynamics::system::System;
use crate::math::pose::Wrench;
use crate::math::symmetric6::{Symmetric6, add_scaled, dot};

/// Force, N, by which a point may push or pull on the wrong branch at the last solution without causing another solve: at 200 kN/m it is 2.5 nm, the
/// rounding of a position of 40 mm.
pub(crate) const FORCE_BAND_N: f32 = 0.5e-3;
/// Rates within this of zero do not change between parting and closing, m/s: k·τ times this is 0.1 mN at 200 kN/m and 0.5 ms.
pub(crate) const RATE_BAND_M_PER_S: f32 = 1e-6;
/// Rotation below which rates do not change the phase either, rad: the rounding of the object's pose. A quaternion resolves no finer rotation, which
/// at the end of an arm a changes a gap by a·2⁻²³ from one tick to the next. Otherwise every second point of a peg that slides along a wall would
/// change in every tick and require two more solves.
pub(crate) const TURN_ROUNDING: f32 = 1.0 / (1 << 23) as f32;
/// Where nothing touches yet, the points first assumed to touch are those whose depth reaches this share of the deepest: they stop the object before
/// the others touch.
const LANDING_SHARE: f32 = 0.8;
/// Solves after which only [`RATE_BAND_M_PER_S`] applies, since a contact that has not settled by then at the finer bands may never do so.
const ROUGH_SOLVES: u8 = 4;

/// Stiffness where an edge meets a face or another edge, as a multiple of a point's: in one place, where faces meet in many points. With two, a
/// peg of 20 µm clearance that tilts at the mouth of its hole presses 6 µm deep; with four, 3.9.
const SINGLE: f32 = 4.0;

/// Stiffness of contacts, N/m.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stiffness {
    /// Stiffness of one point.
    pub point: f32,
    /// Stiffness of one point between guided faces.
    pub guided: f32,
    /// Stiffness where an edge meets a face or another edge in one place.
    pub single: f32,
}

impl Stiffness {
    /// Stiffnesses where one point has stiffness `point`, N/m, and one between guided faces this share of it.
    pub fn new(point: f32, guided_share: f32) -> Self {
        Self {
            point,
            guided: point * guided_share,
            single: SINGLE * point,
        }
    }

    #[inline]
    fn of(&self, c: &Contact) -> f32 {
        if c.guided {
            self.guided
        } else if c.single {
            self.single
        } else {
            self.point
        }
    }
}

/// The contacts of a step and the sums of their majorisers.
pub(crate) struct ContactForce<'a> {
    contacts: &'a mut [Contact],
    k: Stiffness,
    period_s: f32,
    /// τ, s.
    damping_s: f32,
    /// L, m.
    length: f32,
    /// Upper bound of every contact's arm, m.
    farthest: f32,
    /// Σ h·k·(h + τ)·J Jᵀ over touching contacts.
    stiffness: Symmetric6,
    /// Σ −h·k·φ·J over touching contacts.
    push: [f32; 6],
    /// The last iterate.
    last: [f32; 6],
    /// Upper bound of the change of any rate since all were evaluated, m/s.
    rate_change: f32,
}

impl<'a> ContactForce<'a> {
    /// The force of `contacts` with stiffness `k` and approach damping `damping_s` (τ), no arm longer than `farthest` (m), in a step of scale
    /// `length`.
    pub fn new(
        contacts: &'a mut [Contact],
        k: Stiffness,
        period_s: f32,
        damping_s: f32,
        (farthest, length): (f32, f32),
    ) -> Self {
        Self {
            contacts,
            k,
            period_s,
            damping_s,
            length,
            farthest,
            stiffness: Symmetric6::ZERO,
            push: [0.0; 6],
            last: [0.0; 6],
            rate_change: 0.0,
        }
    }

    pub fn contacts(&self) -> &[Contact] {
        self.contacts
    }

    /// Sets the phases at the twist `x` of the tick's start; returns whether any contact touches.
    pub fn begin(&mut self, x: &[f32; 6]) -> bool {
        let (h, band) = (self.period_s, self.band());
        let closing_s = self.closing_s();
        let mut changed = false;
        let (mut landing, mut deepest) = (true, 0.0);
        for c in self.contacts.iter_mut() {
            c.rate = dot(&c.row, x);
            // Most points are free and remain so: a gap that stays open even when it closes in full needs no further evaluation.
            let end = c.gap + closing_s * c.rate;
            if c.gap >= 0.0 && end >= 0.0 {
                continue;
            }
            c.phase = next_phase(c, h, self.damping_s, band, RATE_BAND_M_PER_S);
            changed |= c.phase != Phase::Free;
            landing &= c.gap >= 0.0;
            if end < deepest {
                deepest = end;
            }
        }
        if landing && changed {
            // The deepest points stop the object before the others touch.
            for c in self.contacts.iter_mut() {
                if c.gap + closing_s * c.rate > LANDING_SHARE * deepest {
                    c.phase = Phase::Free;
                }
            }
        }
        let (k, damping_s) = (self.k, self.damping_s);
        let touching = || self.contacts.iter().filter(|c| c.phase != Phase::Free);
        self.stiffness = Symmetric6::sum_of_outer(
            touching().map(|c| (h * k.of(c) * reach(c.phase, h, damping_s), &c.row)),
        );
        let mut push = [0.0f32; 6];
        for c in touching() {
            add_scaled(&mut push, -h * k.of(c) * c.gap, &c.row);
        }
        self.push = push;
        self.last = *x;
        changed
    }

    /// Sets the phases at the iterate `x`, after `solves` solves; returns whether none changed.
    pub fn linearise(&mut self, x: &[f32; 6], solves: u8) -> bool {
        let (h, damping_s, band) = (self.period_s, self.damping_s, self.band());
        let closing_s = self.closing_s();
        let lever = self.farthest / self.length;
        // Upper bound of a rate's change per change of the unknowns: the length of a row, n and (r × n)/L.
        let row_length = above_root(1.0 + lever * lever);
        let moved: [f32; 6] = array::from_fn(|i| x[i] - self.last[i]);
        self.last = *x;
        self.rate_change += row_length * above_root(dot(&moved, &moved));
        // A free point whose gap at the step's end, by the rate last evaluated, exceeds this cannot have closed since, m.
        let out_of_reach = closing_s * self.rate_change;
        let rate_band = if solves <= ROUGH_SOLVES {
            RATE_BAND_M_PER_S + self.farthest * TURN_ROUNDING / h
        } else {
            RATE_BAND_M_PER_S
        };
        let mut changed = false;
        for c in self.contacts.iter_mut() {
            if c.phase == Phase::Free && c.gap + closing_s * c.rate >= out_of_reach {
                continue;
            }
            c.rate = dot(&c.row, x);
            if c.phase == Phase::Free && c.gap >= 0.0 && c.gap + closing_s * c.rate >= 0.0 {
                continue;
            }
            if stays(c, h, damping_s, band, rate_band) {
                continue;
            }
            let phase = next_phase(c, h, damping_s, band, rate_band);
            if phase != c.phase {
                changed = true;
                let k = self.k.of(c);
                let reaches = reach(phase, h, damping_s) - reach(c.phase, h, damping_s);
                self.stiffness.add_outer(h * k * reaches, &c.row);
                let sign = f32::from(phase != Phase::Free) - f32::from(c.phase != Phase::Free);
                add_scaled(&mut self.push, -h * k * c.gap * sign, &c.row);
                c.phase = phase;
            }
        }
        !changed
    }

    /// Contacts that push at the last iterate, each with its normal force, N.
    pub fn pushing(&self) -> impl Iterator<Item = (&Contact, f32)> {
        (self.contacts.iter())
            .filter(|c| c.phase != Phase::Free)
            .map(|c| (c, force(c, self.k.of(c), self.period_s, self.damping_s)))
    }

    /// Adds the majorisers of all contacts.
    pub fn add_to(&self, system: &mut System) {
        system.matrix.add_matrix(&self.stiffness);
        for (r, p) in system.right.iter_mut().zip(&self.push) {
            *r += p;
        }
    }

    /// Sum of the forces on the object at its centre of mass, at the last iterate.
    pub fn wrench(&self) -> Wrench {
        total_force(self.contacts, &self.k, self.period_s, self.damping_s, self.length)
    }

    fn band(&self) -> f32 {
        FORCE_BAND_N / self.k.point
    }

    /// `closing_s` enlarged by a ten-thousandth, so that rounding (some 10⁻⁷ of the gap) cannot make this test contradict the force law.
    fn closing_s(&self) -> f32 {
        1.0001 * (self.period_s + self.damping_s)
    }
}

/// Time that multiplies a contact's rate in its force, s.
#[inline(always)]
fn reach(phase: Phase, period_s: f32, damping_s: f32) -> f32 {
    match phase {
        Phase::Free => 0.0,
        Phase::Parting => period_s,
        Phase::Closing => period_s + damping_s,
    }
}

/// Sum of the forces of `contacts` on the object, at its centre of mass. Their rows are those of a step of this `length`, L.
pub(crate) fn total_force(
    contacts: &[Contact],
    k: &Stiffness,
    period_s: f32,
    damping_s: f32,
    length: f32,
) -> Wrench {
    let mut total = [0.0; 6];
    for c in contacts {
        let force = force(c, k.of(c), period_s, damping_s);
        if force > 0.0 {
            add_scaled(&mut total, force, &c.row);
        }
    }
    let [x, y, z, a, b, c] = total;
    Wrench {
        force: Vec3::new(x, y, z),
        torque: Vec3::new(a, b, c) * length,
    }
}

/// Force of a contact (N) at its rate, never negative.
pub(crate) fn force(c: &Contact, k: f32, period_s: f32, damping_s: f32) -> f32 {
    let reach = match c.phase {
        Phase::Free => return 0.0,
        Phase::Parting => period_s,
        Phase::Closing => period_s + damping_s,
    };
    let force = -k * (c.gap + reach * c.rate);
    if force > 0.0 { force } else { 0.0 }
}

/// Whether a pushing contact continues to push, on its branch: agrees with [`next_phase`] and is faster.
#[inline(always)]
fn stays(c: &Contact, h: f32, damping_s: f32, band: f32, rate_band: f32) -> bool {
    let end = c.gap + h * c.rate;
    match c.phase {
        Phase::Free => false,
        Phase::Parting => c.rate >= -rate_band && end < band,
        Phase::Closing => c.rate < rate_band && end + damping_s * c.rate < band,
    }
}

#[inline]
fn next_phase(c: &Contact, h: f32, damping_s: f32, band: f32, rate_band: f32) -> Phase {
    let closing = match c.phase {
        Phase::Closing => c.rate < rate_band,
        Phase::Parting => c.rate < -rate_band,
        Phase::Free => c.rate < 0.0,
    };
    let end = c.gap + h * c.rate + if closing { damping_s * c.rate } else { 0.0 };
    let most = if c.phase == Phase::Free { -band } else { band };
    if end >= most {
        Phase::Free
    } else if closing {
        Phase::Closing
    } else {
        Phase::Parting
    }
}

/// At least √`squared`.
fn above_root(squared: f32) -> f32 {
    1.000_01 * libm::sqrtf(squared)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collision::contact::Contacts;
    use proptest::prelude::*;

    proptest! {
        /// The shortcut is equivalent: it holds exactly where the branch of a pushing contact does not change.
        #[test]
        fn stays_where_the_phase_does(
            gap in -20e-6f32..20e-6,
            rate in prop_oneof![-0.02f32..0.02, -3e-6f32..3e-6, Just(0.0)],
            closing in any::<bool>(),
            damping_s in 0.0f32..2e-3,
            band in 0.0f32..1e-6,
            rate_band in 1e-6f32..1e-4,
        ) {
            let mut contacts = Contacts::new();
            let c = contacts.offer(gap, gap, 0.0).expect("room");
            (c.gap, c.rate) = (gap, rate);
            for phase in [Phase::Free, if closing { Phase::Closing } else { Phase::Parting }] {
                c.phase = phase;
                let goes_on = phase != Phase::Free && next_phase(c, 1e-3, damping_s, band, rate_band) == phase;
                prop_assert_eq!(stays(c, 1e-3, damping_s, band, rate_band), goes_on, "{:?}", c);
            }
        }
    }
}
