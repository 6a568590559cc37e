//! Saturating spring of a target within a step: stiff at small errors, limited to its cap, and damped on release.
//!
//! The cap makes the step's equations nonlinear. Each solve replaces the spring by the secant: the linear spring and damper with the same force at
//! the last solution. A few solves converge.

use core::mem;

use glam::Vec3;
use heapless::Vec;
use mortise_protocol::limits::MAX_TARGETS;

use crate::constraints::alignment::Rows;
use crate::dynamics::force::{ForceTerm, Iterate};
use crate::dynamics::system::System;
use crate::math::pose::Wrench;
use crate::math::scalar::inverse_sqrt;
use crate::math::symmetric6::{Symmetric6, dot};

/// Damping on release of a target that ends, N s/m.
const RELEASE_DAMPING: f32 = 200.0;
/// Largest force of that damper, N.
pub(crate) const RELEASE_N: f32 = 1.0;
/// Two springs for each target: offset and angle.
pub(crate) const MAX_SPRINGS: usize = 2 * MAX_TARGETS;
/// Linear: k (N/m), h (s).
#[derive(Clone, Debug)]
pub(crate) struct SaturatingSpring {
    /// Index of its target.
    pub slot: u8,
    /// Whether it acts on the angle rather than the offset.
    pub turns: bool,
    /// Error components it acts on.
    pub rows: Rows,
    /// Σ JᵀJ.
    product: Symmetric6,
    /// Σ e·Jᵀ.
    along: [f32; 6],
    law: Law,
    /// Largest force of the release damper, N.
    damper_n: f32,
}

/// Linear spring (N/m) and damper (N s/m) with the same force as the saturating spring at one solution.
#[derive(Clone, Copy, Debug, Default)]
struct Secant {
    spring: f32,
    damper: f32,
    /// |u| and its rate at that solution, m and m/s.
    reach: f32,
    speed: f32,
    /// Travel beyond the end of the rows at that solution, m: the spring acts along it only while it is positive.
    beyond: f32,
}

impl Secant {
    /// Whether the force of this secant differs from that of the correct one, `other`, by no more than `force_n`.
    fn is_near(&self, other: &Self, force_n: f32) -> bool {
        let spring = (self.spring - other.spring).abs() * other.reach;
        let damper = (self.damper - other.damper).abs() * other.speed;
        let switched = (self.beyond > 0.0) != (other.beyond > 0.0);
        let end = if switched {
            other.spring * (self.beyond + other.beyond)
        } else {
            0.0
        };
        spring + damper + end <= force_n
    }
}

/// Force law of the spring.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Law {
    /// Saturating: k (N/m), cap (N), h + τ (s).
    Capped { stiffness: f32, cap: f32, ahead: f32 },
    /// A plain spring: k (N/m), h (s).
    Spring { stiffness: f32, ahead: f32 },
}

impl SaturatingSpring {
    /// Spring of the target `slot`, on its angle or its offset; `damper_n` is the largest force of the release damper.
    pub fn new((slot, turns): (u8, bool), rows: Rows, law: Law, damper_n: f32) -> Self {
        let mut product = Symmetric6::ZERO;
        let mut along = [0.0; 6];
        for (row, error) in &rows.rows {
            product.add_outer(1.0, row);
            for (a, j) in along.iter_mut().zip(row) {
                *a += error * j;
            }
        }
        Self {
            slot,
            turns,
            rows,
            product,
            along,
            law,
            damper_n,
        }
    }

    /// Secant at the step's end `x`.
    fn secant(&self, x: &[f32; 6]) -> Secant {
        let mut secant = Secant::default();
        match self.law {
            Law::Spring { stiffness, .. } => secant.spring = stiffness,
            Law::Capped {
                stiffness,
                cap,
                ahead,
            } => {
                let squared = self.rows.error2(x, ahead);
                secant.reach = root(squared);
                secant.spring = saturating(stiffness, cap, squared);
            }
        }
        secant.beyond = self.rows.beyond_end(x, self.ahead());
        if self.damper_n > 0.0 {
            secant.speed = self.rows.speed(x);
            secant.damper = saturating(RELEASE_DAMPING, self.damper_n, secant.speed * secant.speed);
        }
        secant
    }

    /// Adds spring and damper to the step's matrix and right side.
    fn add(&self, secant: Secant, period_s: f32, system: &mut System) {
        let impulse = secant.spring * period_s;
        (system.matrix).add_scaled(impulse * self.ahead() + secant.damper * period_s, &self.product);
        for (r, a) in system.right.iter_mut().zip(&self.along) {
            *r -= impulse * a;
        }
        if let Some((row, error)) = self.rows.end.as_ref().filter(|_| secant.beyond > 0.0) {
            system.matrix.add_outer(impulse * self.ahead(), row);
            for (r, j) in system.right.iter_mut().zip(row) {
                *r -= impulse * error * j;
            }
        }
    }

    fn ahead(&self) -> f32 {
        match self.law {
            Law::Capped { ahead, .. } | Law::Spring { ahead, .. } => ahead,
        }
    }

    /// Wrench on the object at its centre of mass.
    pub fn wrench(&self, x: &[f32; 6], length: f32) -> Wrench {
        let secant = self.secant(x);
        let mut wrench = Wrench::ZERO;
        let mut push = |row: &[f32; 6], f: f32| {
            wrench.force += Vec3::new(row[0], row[1], row[2]) * f;
            wrench.torque += Vec3::new(row[3], row[4], row[5]) * (f * length);
        };
        for (row, error) in &self.rows.rows {
            let rate = dot(row, x);
            let f = -secant.spring * (error + self.ahead() * rate) - secant.damper * rate;
            push(row, f);
        }
        if let Some((row, _)) = &self.rows.end {
            push(row, -secant.spring * secant.beyond);
        }
        wrench
    }

    /// Its potential at the step's end, J, with the look-ahead of its own law: c·(√((c/k)² + u²) − c/k), or ½·k·u².
    #[cfg(test)]
    fn energy_j(&self, x: &[f32; 6]) -> f32 {
        let squared = self.rows.error2(x, self.ahead());
        match self.law {
            Law::Spring { stiffness, .. } => 0.5 * stiffness * squared,
            Law::Capped { stiffness, cap, .. } => {
                let slack = cap / stiffness;
                // Without the difference of two numbers that are nearly equal.
                cap * squared / (libm::sqrtf(slack * slack + squared) + slack)
            }
        }
    }
}

/// Force error below which a spring has converged, N: less than half of the force change allowed in a tick.
const SPRING_BAND_N: f32 = 0.02;

/// The springs of all targets as one force term.
pub(crate) struct TargetForce<'a> {
    springs: &'a [SaturatingSpring],
    secants: Vec<Secant, MAX_SPRINGS>,
    period_s: f32,
    /// L, m.
    length: f32,
}

impl<'a> TargetForce<'a> {
    pub fn new(springs: &'a [SaturatingSpring], period_s: f32, length: f32) -> Self {
        let mut secants = Vec::new();
        // The number of springs is within the capacity.
        let _ = secants.resize(springs.len(), Secant::default());
        Self {
            springs,
            secants,
            period_s,
            length,
        }
    }
}

impl ForceTerm for TargetForce<'_> {
    fn linearise(&mut self, at: &Iterate<'_>) -> bool {
        let mut settled = true;
        for (spring, secant) in self.springs.iter().zip(&mut self.secants) {
            let last = mem::replace(secant, spring.secant(at.x));
            settled &= last.is_near(secant, SPRING_BAND_N);
        }
        settled
    }

    fn add_to(&self, system: &mut System) {
        for (spring, secant) in self.springs.iter().zip(&self.secants) {
            spring.add(*secant, self.period_s, system);
        }
    }

    fn add_wrench(&self, x: &[f32; 6], _: f32, to: &mut Wrench) {
        for spring in self.springs {
            *to = *to + spring.wrench(x, self.length);
        }
    }

    #[cfg(test)]
    fn energy_j(&self, x: &[f32; 6]) -> f32 {
        self.springs.iter().map(|spring| spring.energy_j(x)).sum()
    }
}

/// Secant stiffness of a spring that is k·u at first and never exceeds `cap`: cap/√((cap/k)² + u²). Evaluated in each solve for each spring.
fn saturating(k: f32, cap: f32, u2: f32) -> f32 {
    let slack = cap / k;
    let squared = slack * slack + u2;
    if is_ordinary(squared) {
        cap * inverse_sqrt(squared)
    } else {
        0.0
    }
}

/// √x.
fn root(x: f32) -> f32 {
    if is_ordinary(x) { x * inverse_sqrt(x) } else { 0.0 }
}

/// Whether [`inverse_sqrt`] is valid for `x`.
fn is_ordinary(x: f32) -> bool {
    x > f32::MIN_POSITIVE && x < f32::MAX
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dynamics::force::contract;
    use proptest::prelude::*;

    proptest! {
        /// Far below its cap, about it, and far beyond.
        #[test]
        fn targets_are_a_force_term(
            errors in prop::array::uniform2(-2e-3f32..2e-3),
            turn in prop::array::uniform3(-1.0f32..1.0),
            stiffness in 1e2f32..1e4,
            cap in 0.5f32..5.0,
            x in contract::twists(),
            v in contract::twists(),
            along in 0usize..6,
            end in prop::option::of(-2e-3f32..2e-3),
        ) {
            let mut rows = Rows::default();
            let [a, b, c] = turn;
            rows.end = end.map(|error| ([0.0, 0.0, 1.0, b, c, a], error));
            let _ = rows.rows.push(([1.0, 0.0, 0.0, a, b, c], errors[0]));
            let _ = rows.rows.push(([0.0, 1.0, 0.0, c, a, b], errors[1]));
            let ahead = 0.021;
            let law = Law::Capped { stiffness, cap, ahead };
            let springs = [SaturatingSpring::new((0, false), rows, law, 0.0)];
            let (h, length) = (1e-3, 0.02);
            let mut force = TargetForce::new(&springs, h, length);
            contract::majorises(&mut force, &Iterate { x: &x, contact: None }, &v, h, length)?;
            contract::conserves(&mut force, &x, (along, 1e-3), ahead, h, length)?;
        }
    }
}
