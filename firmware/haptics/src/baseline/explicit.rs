//! Textbook integrator: one explicit Newton–Euler step of the held object, eqs. 11–12 of Faas 2010.
//!
//! m·v̇ = F and I·ω̇ + ω × I·ω = τ, with coupling and contact forces taken at the tick's *start* and position moved with the new velocity
//! (semi-implicit Euler). It needs no solver, but is only conditionally stable: a contact of stiffness k is stable while h²·k/m < 4 less the effect
//! of damping, all touching points together. Kept for comparison with the implicit step. As in the sources:
//!
//! * contact is a spring without damping, F = k·depth, and from ten touching points on the sum is divided by a tenth of their number (McNeely,
//!   Puterbaugh & Troy 1999);
//! * points that approach and do not touch yet are braked, F = −b·(v·n)·n (Faas eq. 6, McNeely et al. 1999). In one tick b removes from the object,
//!   to first order, the kinetic energy of its motion along the braking force: with s the approach of each such point, F and τ the sum of s·n and of
//!   its moments, b = Σs²/(2·h·(F²/m + τ·I⁻¹·τ)). This is the sources' rule, written for rotations as well: half of the approach is left after a
//!   tick, and the force can never add energy;
//! * no point moves more than half a cell a tick (Faas eq. 5): see [`crate::tick()`].

use glam::Vec3;

use crate::collision::contact::{Contact, Phase};
use crate::dynamics::force::ForceTerm;
use crate::dynamics::step::{Solution, Step};
use crate::math::pose::{Twist, Wrench};
use crate::math::symmetric6::dot;
use crate::settings::ContactSettings;

/// Number of touching points up to which each pushes with its full stiffness; more share that of this number.
const FULL_POINTS: f32 = 10.0;
/// Squared response below which the approach counts as rest, (m/s)²: avoids a division by zero.
const LEAST_RESPONSE: f32 = 1e-20;

/// Stiffness of each of `touching` points, N/m: as for the implicit step, and at most that of ten points in all.
pub(crate) fn shared_stiffness(contact: &ContactSettings, touching: f32) -> f32 {
    let k = contact.shared_stiffness(touching);
    let share = contact.stiffness_n_per_m * (FULL_POINTS / touching);
    if share < k { share } else { k }
}

/// The step without contacts.
pub(crate) fn free(step: &Step, terms: &impl ForceTerm) -> Solution {
    Solution {
        twist: accelerated(step, at_start(step, terms)),
        contact: Wrench::ZERO,
        solves: 0,
        settled: true,
    }
}

/// The step with `contacts` of stiffness `k` (N/m); those with a gap up to `braking_m` only brake. On return their phases are those of the solution,
/// and their rates those of its motion as limited by `allowed`.
pub(crate) fn with_contacts(
    step: &Step,
    terms: &impl ForceTerm,
    contacts: &mut [Contact],
    k: f32,
    braking_m: f32,
    allowed: impl Fn(Twist) -> Twist,
) -> Solution {
    let before = step.scale(step.twist);
    let brake = braking(step, contacts, braking_m, &before);
    let mut contact = Wrench::ZERO;
    for c in contacts.iter_mut() {
        let force = if c.gap < 0.0 {
            c.phase = Phase::Parting;
            -k * c.gap
        } else {
            c.phase = Phase::Free;
            -brake * approach(c, braking_m, &before)
        };
        let n = normal(c) * force;
        contact.force += n;
        contact.torque += c.arm.cross(n);
    }
    let twist = accelerated(step, at_start(step, terms) + contact);
    let after = step.scale(allowed(twist));
    for c in contacts.iter_mut() {
        c.rate = dot(&c.row, &after);
    }
    Solution {
        twist,
        contact,
        solves: 0,
        settled: true,
    }
}

/// Wrench of all terms at the tick's start.
fn at_start(step: &Step, terms: &impl ForceTerm) -> Wrench {
    let before = step.scale(step.twist);
    let mut wrench = Wrench::ZERO;
    terms.add_wrench(&before, 0.0, &mut wrench);
    wrench
}

/// Rate of a gap that closes within the braking distance, else 0, m/s.
fn approach(c: &Contact, braking_m: f32, twist: &[f32; 6]) -> f32 {
    if c.gap < 0.0 || c.gap > braking_m {
        return 0.0;
    }
    let rate = dot(&c.row, twist);
    if rate < 0.0 { rate } else { 0.0 }
}

/// b, N s/m.
fn braking(step: &Step, contacts: &[Contact], braking_m: f32, twist: &[f32; 6]) -> f32 {
    let mut squares = 0.0;
    let mut sum = Wrench::ZERO;
    for c in contacts {
        let rate = approach(c, braking_m, twist);
        if rate < 0.0 {
            let n = normal(c) * rate;
            squares += rate * rate;
            sum.force += n;
            sum.torque += c.arm.cross(n);
        }
    }
    let turned = step.gyration2.inverse() * sum.torque;
    let response = sum.force.length_squared() + sum.torque.dot(turned);
    if response > LEAST_RESPONSE {
        step.mass_kg * squares / (2.0 * step.period_s * response)
    } else {
        0.0
    }
}

/// Twist at the tick's end under `wrench` and the gyroscopic torque.
fn accelerated(step: &Step, wrench: Wrench) -> Twist {
    let h = step.period_s;
    let spin = step.twist.angular;
    let gyroscopic = spin.cross(step.gyration2 * spin);
    let angular = step.gyration2.inverse() * (wrench.torque * (1.0 / step.mass_kg) - gyroscopic);
    Twist {
        linear: step.twist.linear + wrench.force * (h / step.mass_kg),
        angular: spin + angular * h,
    }
}

fn normal(c: &Contact) -> Vec3 {
    Vec3::new(c.row[0], c.row[1], c.row[2])
}
