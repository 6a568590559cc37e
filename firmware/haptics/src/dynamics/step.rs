//! One implicit (backward Euler) step of the held object.
//!
//! M·(V' − V)/h = w_coupling(V') + Σ λ_i(V')·J_iᵀ, with V' the twist at the step's end, after Otaduy & Lin 2006. Every term on the right is evaluated
//! at the step's end, so contact stiffness is not limited by stability. Contact i has gap φ and row J = (n, r × n); with rate s = J·V' its force is
//!
//! λ = k·max(0, −(φ + h·s + τ·min(0, s)))
//!
//! continuous, decreasing in s, never pulling. The sum of all is minus the gradient of a convex function, so V' is the unique minimum of the step's
//! convex objective. It is found by Newton steps on the set of touching points (primal active set): solve with an assumed set, evaluate the rates,
//! update the set, solve again. Unknowns are scaled to (v, ω·L), L the radius of gyration, so that single precision suffices for both.
//!
//! The gyroscopic torque is neglected: it does no work, and the object's rotation follows the handle within a few ticks.
//!
//! Cost on a Cortex-M7 (counted as in [`crate::tick()`]): 150 instructions to set a system up, 150 to solve it, and about 300 for a contact in all
//! passes over it together.

use glam::{Mat3, Vec3};

use crate::dynamics::contact_force::ContactForce;
use crate::dynamics::force::{ForceTerm, Iterate};
use crate::dynamics::system::System;
use crate::math::pose::{Twist, Wrench};
use crate::math::symmetric6::Symmetric6;

/// Largest number of solves with contacts.
pub(crate) const MAX_SOLVES: u8 = 8;
/// Largest number of solves without contacts: one, and two more while a term saturates.
const MAX_FREE_SOLVES: u8 = 3;

/// The held object at the tick's start, without the forces on it.
pub(crate) struct Step {
    pub period_s: f32,
    pub mass_kg: f32,
    /// Inertia over mass in the world, m².
    pub gyration2: Mat3,
    /// L, m.
    pub length: f32,
    /// V.
    pub twist: Twist,
}

/// A solution of the step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Solution {
    /// V', at the step's end.
    pub twist: Twist,
    /// Sum of contact forces on the object at its centre of mass.
    pub contact: Wrench,
    /// Number of solves.
    pub solves: u8,
    /// Whether the set of touching points had converged.
    pub settled: bool,
}

impl Step {
    /// The step without contacts.
    pub fn free(&self, terms: &mut impl ForceTerm) -> Solution {
        let start = self.scale(self.twist);
        terms.begin(&start);
        let mut solves = 0;
        loop {
            let x = self.system(terms).solve();
            solves += 1;
            if linearise(terms, &x, None) || solves == MAX_FREE_SOLVES {
                return Solution {
                    twist: self.unscale(&x),
                    contact: Wrench::ZERO,
                    solves,
                    settled: true,
                };
            }
        }
    }

    /// The step with contacts, starting from the motion so far, or from the `free` solution when that touches nothing. Phases that have not settled
    /// after `max_solves` are used as they are.
    ///
    /// On return each contact's rate and phase are those of the solution.
    pub fn with_contacts(
        &self,
        free: &Solution,
        terms: &mut impl ForceTerm,
        contact: &mut ContactForce<'_>,
        max_solves: u8,
    ) -> Solution {
        if contact.contacts().is_empty() {
            // Identical to the bits that the loop below would produce.
            return Solution {
                twist: self.unscale(&self.scale(free.twist)),
                ..*free
            };
        }
        // Where the object rests or slides, its previous motion already identifies the points that touch.
        let mut x = self.scale(self.twist);
        let touching = contact.begin(&x);
        if !touching {
            x = self.scale(free.twist);
        }
        linearise(terms, &x, Some(contact));
        let mut solves = 0;
        let mut settled = !touching && contact.linearise(&x, solves);
        while !settled && solves < max_solves {
            let mut system = self.system(terms);
            contact.add_to(&mut system);
            x = system.solve();
            solves += 1;
            let same_contacts = contact.linearise(&x, solves);
            settled = linearise(terms, &x, Some(contact)) && same_contacts;
        }
        Solution {
            twist: self.unscale(&x),
            contact: contact.wrench(),
            solves: free.solves + solves,
            settled,
        }
    }

    /// System of inertia and all terms except contact: (M + Σ h·Kᵢ)·V' = M·V + Σ h·wᵢ.
    fn system(&self, terms: &impl ForceTerm) -> System {
        let mut system = self.inertia();
        terms.add_to(&mut system);
        system
    }

    /// M and M·V, scaled.
    fn inertia(&self) -> System {
        let m = self.mass_kg;
        let inverse_length = 1.0 / self.length;
        let inertia = self.gyration2 * (m * inverse_length * inverse_length);
        let mut matrix = Symmetric6::ZERO;
        let columns = [inertia.x_axis, inertia.y_axis, inertia.z_axis];
        for i in 0..3 {
            matrix.add(i, i, m);
            for (j, column) in columns.iter().enumerate().take(i + 1) {
                matrix.add(3 + i, 3 + j, column[i]);
            }
        }
        let linear = self.twist.linear * m;
        let angular = (self.gyration2 * self.twist.angular) * (m * inverse_length);
        System {
            matrix,
            right: [linear.x, linear.y, linear.z, angular.x, angular.y, angular.z],
        }
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

/// Linearises every term at `x`; returns whether all had settled.
fn linearise(terms: &mut impl ForceTerm, x: &[f32; 6], contact: Option<&ContactForce<'_>>) -> bool {
    terms.linearise(&Iterate { x, contact })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collision::contact::{Contacts, Phase};
    use crate::dynamics::contact_force::{FORCE_BAND_N, RATE_BAND_M_PER_S, Stiffness, TURN_ROUNDING};
    use crate::dynamics::coupling::{Coupling, CouplingForce};
    use crate::math::symmetric6::{add_scaled, dot};
    use glam::Vec3;
    use mortise_protocol::image::NO_FACE;
    use proptest::prelude::*;

    proptest! {
        /// A settled solution solves the step by the force law itself, within the tolerance of each contact: the bands of rate and force. Long pegs
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
                period_s: settings.period_s,
                mass_kg: settings.object.mass_kg,
                gyration2: Mat3::IDENTITY * 0.04,
                length: 0.2,
                twist: Twist { linear: Vec3::from_array(speed), angular: Vec3::from_array(turning) },
            };
            let mut contacts = Contacts::new();
            for &(along, side, gap) in &points {
                let arm = Vec3::new(0.05 * side, -0.05, along);
                let n = Vec3::new(-0.3 * side, 1.0, 0.0).normalize();
                let c = contacts.offer(gap, gap, arm.length_squared()).expect("room");
                let turn = arm.cross(n) / step.length;
                c.row = [n.x, n.y, n.z, turn.x, turn.y, turn.z];
                c.arm = arm;
                (c.rate, c.phase, c.guided, c.edges) = (0.0, Phase::Free, false, [NO_FACE; 2]);
            }
            let farthest = contacts.farthest();
            let (h, damping) = (settings.period_s, settings.contact.damping_s);
            let stiffness = settings.contact.stiffness_n_per_m;
            let k = Stiffness::new(stiffness, 1.0);
            let mut coupling_force = CouplingForce::new(&coupling, &settings.coupling, h, step.length);
            let terms = &mut coupling_force;
            let free = step.free(terms);
            let mut force = ContactForce::new(contacts.as_mut_slice(), k, h, damping, (farthest, step.length));
            let solution = step.with_contacts(&free, terms, &mut force, MAX_SOLVES);
            prop_assert!(solution.settled);
            let x = step.scale(solution.twist);
            linearise(terms, &x, None);
            let System { matrix, right } = step.system(terms);
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
