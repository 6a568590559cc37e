//! Force terms: the one interface through which coupling, constraints, contact and friction act on the held object in the implicit step.
//!
//! A term gives a wrench w(x) that depends on the twist x at the step's end. Where it is not linear in x, it is replaced at each iterate by its
//! *majoriser*: the spring and damper that give the same wrench there (the secant), so that each solve is one positive definite 6×6 system,
//!
//! (M + Σ h·Kᵢ)·x = M·V + Σ h·wᵢ,
//!
//! with Kᵢ and wᵢ those of the majorisers. The iteration ends when no term's majoriser changes by more than the step resolves. With every Kᵢ positive
//! semi-definite the step is stable.
//!
//! To add a force, implement [`ForceTerm`] in a file of its own, give it a settings group, and name it in the tuple of terms in `tick.rs`.

use crate::dynamics::contact_force::ContactForce;
use crate::dynamics::system::System;
use crate::math::pose::Wrench;

/// An iterate of the step.
pub(crate) struct Iterate<'a> {
    /// Scaled twist at the step's end.
    pub x: &'a [f32; 6],
    /// Contacts with their forces at that twist; `None` in the step without contacts.
    pub contact: Option<&'a ContactForce<'a>>,
}

/// A force on the held object within one step.
pub(crate) trait ForceTerm {
    /// First linearisation, at the scaled twist of the tick's start.
    fn begin(&mut self, x: &[f32; 6]) {
        self.linearise(&Iterate { x, contact: None });
    }

    /// Computes the majoriser at an iterate; returns whether it equals the last one to within the step's resolution.
    fn linearise(&mut self, at: &Iterate<'_>) -> bool;

    /// Adds h·K and h·w of the majoriser.
    fn add_to(&self, system: &mut System);

    /// Adds the wrench on the object at its centre of mass after the twist `x` has acted for `period_s`; with 0, that at the tick's start.
    fn add_wrench(&self, x: &[f32; 6], period_s: f32, to: &mut Wrench);

    /// Energy that the term stores once the twist `x` has acted, J: the potential of its wrench. A damper stores none.
    #[cfg(test)]
    fn energy_j(&self, x: &[f32; 6]) -> f32;
}

/// Two terms are a term, and so are any number of them in nested pairs: a step takes them so, in the order in which they enter the sums.
impl<A: ForceTerm, B: ForceTerm> ForceTerm for (A, B) {
    fn begin(&mut self, x: &[f32; 6]) {
        self.0.begin(x);
        self.1.begin(x);
    }

    fn linearise(&mut self, at: &Iterate<'_>) -> bool {
        // Both of them, settled or not.
        self.0.linearise(at) & self.1.linearise(at)
    }

    fn add_to(&self, system: &mut System) {
        self.0.add_to(system);
        self.1.add_to(system);
    }

    fn add_wrench(&self, x: &[f32; 6], period_s: f32, to: &mut Wrench) {
        self.0.add_wrench(x, period_s, to);
        self.1.add_wrench(x, period_s, to);
    }

    #[cfg(test)]
    fn energy_j(&self, x: &[f32; 6]) -> f32 {
        self.0.energy_j(x) + self.1.energy_j(x)
    }
}

/// Properties that every term guarantees, for the tests of each.
#[cfg(test)]
pub(crate) mod contract {
    use super::*;
    use crate::math::symmetric6::{Symmetric6, dot};
    use proptest::prelude::*;

    /// A scaled twist of typical hand speed.
    pub fn twists() -> impl Strategy<Value = [f32; 6]> {
        prop::array::uniform6(-0.3f32..0.3)
    }

    /// Linearised at `x`, the majoriser gives the wrench there and removes energy from every motion `v`.
    pub fn majorises(
        term: &mut dyn ForceTerm,
        at: &Iterate<'_>,
        v: &[f32; 6],
        period_s: f32,
        length: f32,
    ) -> Result<(), TestCaseError> {
        term.linearise(at);
        let mut system = System {
            matrix: Symmetric6::ZERO,
            right: [0.0; 6],
        };
        term.add_to(&mut system);
        let mut wrench = Wrench::ZERO;
        term.add_wrench(at.x, period_s, &mut wrench);
        let (f, t) = (wrench.force, wrench.torque * (1.0 / length));
        let wrench = [f.x, f.y, f.z, t.x, t.y, t.z];
        let pulled = system.matrix.times(at.x);
        for i in 0..6 {
            let majoriser = (system.right[i] - pulled[i]) / period_s;
            let size = (system.right[i].abs() + pulled[i].abs()) / period_s;
            prop_assert!(
                (majoriser - wrench[i]).abs() <= 1e-5 * size + 1e-4,
                "{i}: {majoriser} {}",
                wrench[i]
            );
        }
        let taken = dot(v, &system.matrix.times(v));
        let size = dot(v, v)
            * system
                .matrix
                .times(&[1.0; 6])
                .iter()
                .fold(0.0, |a, b| a + b.abs());
        prop_assert!(taken >= -1e-5 * size, "{taken}");
        Ok(())
    }

    /// The energy falls by the work of the wrench, over a small change of the final twist that acts for `ahead_s`.
    pub fn conserves(
        term: &mut dyn ForceTerm,
        x: &[f32; 6],
        (along, step): (usize, f32),
        ahead_s: f32,
        period_s: f32,
        length: f32,
    ) -> Result<(), TestCaseError> {
        let moved = |by: f32| {
            let mut moved = *x;
            moved[along] += by;
            moved
        };
        let fall = term.energy_j(&moved(-step)) - term.energy_j(&moved(step));
        let mut wrench = Wrench::ZERO;
        term.add_wrench(x, period_s, &mut wrench);
        let (f, t) = (wrench.force, wrench.torque * (1.0 / length));
        let work = [f.x, f.y, f.z, t.x, t.y, t.z][along] * 2.0 * step * ahead_s;
        let size = term.energy_j(x);
        prop_assert!(
            (fall - work).abs() <= 0.02 * work.abs() + 1e-6 * size + 1e-8,
            "{fall} {work}"
        );
        Ok(())
    }
}
