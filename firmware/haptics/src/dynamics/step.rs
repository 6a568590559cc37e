//! One implicit (backward Euler) step of the held object.
//!
//! M·(V' − V)/h = w_coupling(V') + Σ λ_i(V')·J_iᵀ, with V' the twist at the step's end, after Otaduy & Lin 2006. Every term on the right
//! is taken at the step's end, which is why contact may be as stiff as it likes. Contact i has gap φ and row J = (n, r × n); with
//! rate s = J·V' its force is
//!
//! λ = k·max(0, −(φ + h·s + τ·min(0, s)))
//!
//! continuous, falling in s, never pulling. The sum of all is the gradient of a convex function, and V' its one minimum. It is found by Newton
//! steps on the set of touching points (primal active set): solve with the set assumed, look at the rates, change the set, solve again.
//! Unknowns are scaled to (v, ω·L), L the radius of gyration, so that single precision serves both.
//!
//! The gyroscopic torque is left out: it does no work, and the object's rotation is led by the hand within a few ticks.
//!
//! Cost on a Cortex-M7 (counted as in [`crate::tick()`]): 150 instructions to set a system up, 150 to solve it, and about 300 for a contact in all
//! passes over it together.

use core::{array, mem};

use glam::{Mat3, Vec3};
use heapless::Vec;

use crate::collision::contact::{Contact, Phase};
use crate::constraints::saturating_spring::{MAX_SPRINGS, SaturatingSpring, Secant};
use crate::dynamics::coupling::{Coupling, Slip};
use crate::math::pose::{Twist, Wrench};
use crate::math::symmetric6::{Symmetric6, add_scaled, dot};
use crate::settings::CouplingSettings;

/// Solves allowed with contacts.
pub(crate) const MAX_SOLVES: u8 = 8;
/// Solves allowed without contacts: one, and two more while the coupling slips.
const MAX_FREE_SOLVES: u8 = 3;
/// A point that the last solution lets push or pull by less than this where it should not, N, does not ask for another solve: at 200 kN/m
/// it is 2.5 nm, the rounding of a position of 40 mm.
const FORCE_BAND_N: f32 = 0.5e-3;
/// Rates within this of zero do not change between parting and closing, m/s: k·τ times this is 0.1 mN at 200 kN/m and 0.5 ms.
const RATE_BAND_M_PER_S: f32 = 1e-6;
/// Nor do rates that the rounding of the object's pose makes: a quaternion tells no turn finer than this, rad, which at the end of an arm a is a
/// gap's change by a·2⁻²³ from one tick to the next. Of a peg that slides along a wall every second point would change in every tick else, and ask
/// for two more solves.
const TURN_ROUNDING: f32 = 1.0 / (1 << 23) as f32;
/// Where nothing touches yet, those points are first taken to touch that would go so far as this share of what would go deepest: that stops the
/// object before the others do.
const LANDING_SHARE: f32 = 0.8;
/// What has not settled so after this many solves need not ever: from then on only [`RATE_BAND_M_PER_S`] counts.
const ROUGH_SOLVES: u8 = MAX_SOLVES / 2;
/// A slip that changes by less than this is settled.
const SLIP_BAND: f32 = 1e-3;

/// A pull that is wrong by less than this is settled, N: less than half of what may change in a tick.
const PULL_BAND_N: f32 = 0.02;

/// The object and its coupling at the tick's start.
pub(crate) struct Step<'a> {
    pub coupling: &'a Coupling,
    pub settings: &'a CouplingSettings,
    pub period_s: f32,
    pub mass_kg: f32,
    /// Inertia over mass in the world, m².
    pub gyration2: Mat3,
    /// L, m.
    pub length: f32,
    /// V.
    pub twist: Twist,
    /// What constraint targets pull with.
    pub springs: &'a [SaturatingSpring],
}

/// Everything in the step that saturates, as the springs that pull as hard at one solution.
#[derive(Clone, Debug)]
struct Secants {
    slip: Slip,
    springs: Vec<Secant, MAX_SPRINGS>,
}

impl Secants {
    const fn new() -> Self {
        Self {
            slip: Slip::NONE,
            springs: Vec::new(),
        }
    }
}

/// Stiffness of contacts, N/m.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stiffness {
    /// Of a point.
    pub point: f32,
    /// Of a point between guided faces.
    pub guided: f32,
}

impl Stiffness {
    #[inline]
    fn of(&self, c: &Contact) -> f32 {
        if c.guided { self.guided } else { self.point }
    }
}

/// A solution of the step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Solution {
    /// V', at the step's end.
    pub twist: Twist,
    /// Sum of contact forces on the object at its centre of mass.
    pub contact: Wrench,
    /// Solves it took.
    pub solves: u8,
    /// Whether the set of touching points had come to rest.
    pub settled: bool,
}

impl Step<'_> {
    /// The step without contacts.
    pub fn free(&self) -> Solution {
        let (secants, next) = &mut (Secants::new(), Secants::new());
        let (mut secants, mut next) = (secants, next);
        self.find_secants(&self.scale(self.twist), secants);
        secants.slip = Slip::NONE;
        let mut solves = 0;
        loop {
            let (matrix, right) = self.without_contact(secants);
            let x = matrix.solve(&right);
            solves += 1;
            self.find_secants(&x, next);
            if settled(secants, next) || solves == MAX_FREE_SOLVES {
                return Solution {
                    twist: self.unscale(&x),
                    contact: Wrench::ZERO,
                    solves,
                    settled: true,
                };
            }
            mem::swap(&mut secants, &mut next);
        }
    }

    /// The step with `contacts` of stiffness `k` and approach damping `damping_s` (τ), starting from the motion so far, or from the
    /// `free` solution when that touches nothing. No contact's arm is longer than `farthest` (m). What has not settled after `most_solves` is taken
    /// as it is.
    ///
    /// On return each contact's rate and phase are those of the solution.
    pub fn with_contacts(
        &self,
        free: &Solution,
        contacts: &mut [Contact],
        k: &Stiffness,
        damping_s: f32,
        farthest: f32,
        most_solves: u8,
    ) -> Solution {
        if contacts.is_empty() {
            // What the loop below comes to then, to the bit.
            return Solution {
                twist: self.unscale(&self.scale(free.twist)),
                ..*free
            };
        }
        let h = self.period_s;
        let lever = farthest / self.length;
        // No rate changes by more than the unknowns' change times this: the length of a row, n and (r × n)/L.
        let row_length = above_root(1.0 + lever * lever);
        let reach = |phase| match phase {
            Phase::Free => 0.0,
            Phase::Parting => h,
            Phase::Closing => h + damping_s,
        };
        let band = FORCE_BAND_N / k.point;
        // A ten-thousandth more than the force law's own, so that rounding (some 10⁻⁷ of the gap) cannot decide otherwise than it does.
        let closing_s = 1.0001 * (h + damping_s);
        // Two, taken in turn: they are too large to be handed about.
        let (secants, next) = &mut (Secants::new(), Secants::new());
        let (mut secants, mut next) = (secants, next);
        self.find_secants(&self.scale(free.twist), secants);
        // Where the object rests or slides, its motion up to now already tells which points touch.
        let mut x = self.scale(self.twist);
        let mut changed = false;
        let (mut landing, mut deepest) = (true, 0.0);
        for c in contacts.iter_mut() {
            c.rate = dot(&c.row, &x);
            // Most points are free and stay so: a gap that closing in full would leave open needs no closer look.
            let end = c.gap + closing_s * c.rate;
            if c.gap >= 0.0 && end >= 0.0 {
                continue;
            }
            c.phase = next_phase(c, h, damping_s, band, RATE_BAND_M_PER_S);
            changed |= c.phase != Phase::Free;
            landing &= c.gap >= 0.0;
            if end < deepest {
                deepest = end;
            }
        }
        if landing && changed {
            // What goes deepest stops the object before the others touch.
            for c in contacts.iter_mut() {
                if c.gap + closing_s * c.rate > LANDING_SHARE * deepest {
                    c.phase = Phase::Free;
                }
            }
        }
        let touching = || contacts.iter().filter(|c| c.phase != Phase::Free);
        let mut stiffness =
            Symmetric6::sum_of_outer(touching().map(|c| (h * k.of(c) * reach(c.phase), &c.row)));
        let mut push = [0.0f32; 6];
        for c in touching() {
            add_scaled(&mut push, -h * k.of(c) * c.gap, &c.row);
        }
        let rough_rate_band = RATE_BAND_M_PER_S + farthest * TURN_ROUNDING / h;
        let mut solves = 0;
        // Whether `x` solves the step with some set of touching points.
        let mut solved = false;
        // How far any rate can have changed since all were looked at, m/s.
        let mut way = 0.0;
        let is_settled = loop {
            let last = x;
            if !solved && !changed {
                x = self.scale(free.twist);
            } else {
                self.find_secants(&x, next);
                if solved && !changed && settled(secants, next) {
                    break true;
                }
                if solves >= most_solves {
                    break false;
                }
                mem::swap(&mut secants, &mut next);
                let (mut matrix, mut right) = self.without_contact(secants);
                matrix.add_matrix(&stiffness);
                for (r, p) in right.iter_mut().zip(&push) {
                    *r += p;
                }
                x = matrix.solve(&right);
                solves += 1;
            }
            solved = true;
            // What of a free point's gap is left at the step's end by the rate last looked at, m, can have been closed since when it is less than
            // this.
            let moved: [f32; 6] = array::from_fn(|i| x[i] - last[i]);
            way += row_length * above_root(dot(&moved, &moved));
            let out_of_reach = closing_s * way;
            changed = false;
            let rate_band = if solves <= ROUGH_SOLVES {
                rough_rate_band
            } else {
                RATE_BAND_M_PER_S
            };
            for c in contacts.iter_mut() {
                if c.phase == Phase::Free && c.gap + closing_s * c.rate >= out_of_reach {
                    continue;
                }
                c.rate = dot(&c.row, &x);
                if c.phase == Phase::Free && c.gap >= 0.0 && c.gap + closing_s * c.rate >= 0.0 {
                    continue;
                }
                if stays(c, h, damping_s, band, rate_band) {
                    continue;
                }
                let phase = next_phase(c, h, damping_s, band, rate_band);
                if phase != c.phase {
                    changed = true;
                    let k = k.of(c);
                    stiffness.add_outer(h * k * (reach(phase) - reach(c.phase)), &c.row);
                    let sign = f32::from(phase != Phase::Free) - f32::from(c.phase != Phase::Free);
                    add_scaled(&mut push, -h * k * c.gap * sign, &c.row);
                    c.phase = phase;
                }
            }
        };
        let contact = total_force(contacts, k, h, damping_s, self.length);
        Solution {
            twist: self.unscale(&x),
            contact,
            solves: free.solves + solves,
            settled: is_settled,
        }
    }

    fn find_secants(&self, x: &[f32; 6], found: &mut Secants) {
        let pull = self.coupling.pull(self.settings, self.period_s, self.unscale(x));
        found.slip = Coupling::slip(pull, self.settings);
        found.springs.clear();
        for pull in self.springs {
            // No more than there is room for springs.
            let _ = found.springs.push(pull.secant(x));
        }
    }

    /// Matrix and right side of mass and coupling, scaled: (M + h·B + h²·K)·V' = M·V + h·(K·d + (B + h·K)·V_hand).
    fn without_contact(&self, secants: &Secants) -> (Symmetric6, [f32; 6]) {
        let slip = secants.slip;
        let h = self.period_s;
        let m = self.mass_kg;
        let s = self.settings;
        let c = self.coupling;
        let inverse_length = 1.0 / self.length;
        let b_t = s.b_t + h * s.k_t_n_per_m;
        let b_r = s.b_r + h * s.k_r;
        let translation = m + h * b_t * slip.translation;
        let rotation = h * b_r * slip.rotation * inverse_length * inverse_length;
        let inertia = self.gyration2 * (m * inverse_length * inverse_length);
        let mut matrix = Symmetric6::ZERO;
        let columns = [inertia.x_axis, inertia.y_axis, inertia.z_axis];
        for i in 0..3 {
            matrix.add(i, i, translation);
            for (j, column) in columns.iter().enumerate().take(i + 1) {
                matrix.add(3 + i, 3 + j, column[i]);
            }
            matrix.add(3 + i, 3 + i, rotation);
        }
        let linear = self.twist.linear * m
            + (c.stretch * s.k_t_n_per_m + c.target.linear * b_t) * (h * slip.translation);
        let angular = (self.gyration2 * self.twist.angular) * (m * inverse_length)
            + (c.angle * s.k_r + c.target.angular * b_r) * (h * slip.rotation * inverse_length);
        let mut right = [linear.x, linear.y, linear.z, angular.x, angular.y, angular.z];
        for (pull, secant) in self.springs.iter().zip(&secants.springs) {
            pull.add(*secant, h, &mut matrix, &mut right);
        }
        (matrix, right)
    }

    /// The step's unknowns for a twist: (v, ω·L).
    pub fn scale(&self, twist: Twist) -> [f32; 6] {
        let (v, w) = (twist.linear, twist.angular * self.length);
        [v.x, v.y, v.z, w.x, w.y, w.z]
    }

    fn unscale(&self, x: &[f32; 6]) -> Twist {
        Twist {
            linear: Vec3::new(x[0], x[1], x[2]),
            angular: Vec3::new(x[3], x[4], x[5]) * (1.0 / self.length),
        }
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

/// Whether a contact that pushes goes on to, on its branch: what [`next_phase`] says too, sooner.
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

fn settled(a: &Secants, b: &Secants) -> bool {
    let (s, t) = (a.slip, b.slip);
    (s.translation - t.translation).abs() < SLIP_BAND
        && (s.rotation - t.rotation).abs() < SLIP_BAND
        && a.springs
            .iter()
            .zip(&b.springs)
            .all(|(p, q)| p.is_near(q, PULL_BAND_N))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collision::contact::Contacts;
    use proptest::prelude::*;

    proptest! {
        /// The short cut is no other rule: it holds exactly where the branch of a contact that pushes does not change.
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

        /// What has settled solves the step by the force law itself, but for what each contact may be off by: the bands of rate and force. Long pegs
        /// that lie on a wall and hardly move.
        #[test]
        fn solves_the_step_within_the_bands(
            points in prop::collection::vec((-0.35f32..0.35, -1.0f32..1.0, -2e-6f32..4e-6), 1..120),
            push in -2e-3f32..1e-3,
            speed in prop::array::uniform3(-3e-5f32..3e-5),
            turning in prop::array::uniform3(-1e-4f32..1e-4),
            lean in -1e-3f32..1e-3,
        ) {
            let settings = crate::Settings::default();
            let coupling = Coupling::stretched(Vec3::new(0.0, push, 0.0), Vec3::new(lean, 0.0, 0.0));
            let step = Step {
                coupling: &coupling,
                settings: &settings.coupling,
                period_s: settings.period_s,
                mass_kg: settings.object.mass_kg,
                gyration2: Mat3::IDENTITY * 0.04,
                length: 0.2,
                twist: Twist { linear: Vec3::from_array(speed), angular: Vec3::from_array(turning) },
                springs: &[],
            };
            let mut contacts = Contacts::new();
            for &(along, side, gap) in &points {
                let arm = Vec3::new(0.05 * side, -0.05, along);
                let n = Vec3::new(-0.3 * side, 1.0, 0.0).normalize();
                let c = contacts.offer(gap, gap, arm.length_squared()).expect("room");
                let turn = arm.cross(n) / step.length;
                c.row = [n.x, n.y, n.z, turn.x, turn.y, turn.z];
                c.arm = arm;
                (c.rate, c.phase, c.guided) = (0.0, Phase::Free, false);
            }
            let farthest = contacts.farthest();
            let (h, damping) = (settings.period_s, settings.contact.damping_s);
            let stiffness = settings.contact.stiffness_n_per_m;
            let k = Stiffness { point: stiffness, guided: stiffness };
            let solution = step.with_contacts(&step.free(), contacts.as_mut_slice(), &k, damping, farthest, MAX_SOLVES);
            prop_assert!(solution.settled);
            let x = step.scale(solution.twist);
            let mut secants = Secants::new();
            step.find_secants(&x, &mut secants);
            let (matrix, right) = step.without_contact(&secants);
            let mut left = matrix.times(&x);
            let (mut allowed, mut size) = (0.0, 0.0);
            let most = 1.0 + farthest / step.length;
            for c in contacts.as_slice() {
                let rate = dot(&c.row, &x);
                let law = -stiffness * (c.gap + h * rate + damping * rate.min(0.0));
                add_scaled(&mut left, -h * law.max(0.0), &c.row);
                if rate.abs() < RATE_BAND_M_PER_S + farthest * TURN_ROUNDING / h {
                    allowed += h * most * stiffness * damping * rate.abs();
                }
                if law.abs() < FORCE_BAND_N {
                    allowed += h * most * FORCE_BAND_N;
                }
                // Rounding of the terms that cancel.
                size += h * most * stiffness * (c.gap.abs() + (h + damping) * rate.abs());
            }
            for i in 0..6 {
                let off = (left[i] - right[i]).abs();
                prop_assert!(off <= allowed + 1e-5 * (size + right[i].abs()), "{} of {}, {:?}", off, allowed, solution);
            }
        }
    }
}
