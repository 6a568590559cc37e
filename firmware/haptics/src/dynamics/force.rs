//! What a force on the held object is to the implicit step: the one interface through which coupling, constraints, contact and friction enter it.
//!
//! A term gives a wrench w(x) that depends on the twist x at the step's end. Where it is not linear in x, it is replaced at each iterate by its
//! *majoriser*: the spring and damper that give the same wrench there (the secant), so that each solve is one positive definite 6×6 system,
//!
//! (M + Σ h·Kᵢ)·x = M·V + Σ h·wᵢ,
//!
//! with Kᵢ and wᵢ those of the majorisers. The iteration ends when no term's majoriser changes by more than the step resolves. With Kᵢ positive
//! semi-definite, whatever its values, the step is stable.
//!
//! To add a force, implement [`ForceTerm`] in a file of its own, give it a settings group, and name it in the list of terms in `tick.rs`.

use crate::collision::contact::Contact;
use crate::math::pose::Wrench;
use crate::math::symmetric6::Symmetric6;

/// A linear system for the scaled twist (v, ω·L) at the step's end: `matrix`·x = `right`, kg and kg m/s.
#[derive(Clone, Debug)]
pub(crate) struct System {
    pub matrix: Symmetric6,
    pub right: [f32; 6],
}

impl System {
    #[inline]
    pub fn solve(&self) -> [f32; 6] {
        self.matrix.solve(&self.right)
    }
}

/// An iterate of the step.
pub(crate) struct Iterate<'a> {
    /// Scaled twist at the step's end.
    pub x: &'a [f32; 6],
    /// Contacts with their phases and rates there; none in the step without contacts.
    pub contacts: &'a [Contact],
}

/// A force on the held object within one step.
pub(crate) trait ForceTerm {
    /// First linearisation, at the scaled twist of the tick's start.
    fn begin(&mut self, x: &[f32; 6]) {
        self.linearise(&Iterate { x, contacts: &[] });
    }

    /// Takes the majoriser at an iterate; whether it is that of the last one, to within what the step resolves.
    fn linearise(&mut self, at: &Iterate<'_>) -> bool;

    /// Adds h·K and h·w of the majoriser.
    fn add_to(&self, system: &mut System);

    /// Adds the wrench on the object at its centre of mass after the twist `x` has acted for `period_s`; with 0, that at the tick's start.
    fn add_wrench(&self, x: &[f32; 6], period_s: f32, to: &mut Wrench);

    /// Energy that the term stores once the twist `x` has acted, J: the potential of its wrench. A damper stores none.
    #[cfg(test)]
    fn energy_j(&self, x: &[f32; 6]) -> f32;
}
