//! Dry friction at contacts: Coulomb's law with Stribeck's transition, regularised at rest.
//!
//! At a contact with normal force λ and tangential velocity u of the held part, |u| = s, friction on the part is
//!
//! f = −μ(s)·λ·u/√(s² + ε²),   μ(s) = μ_k + (μ_s − μ_k)·exp(−(s/s_S)²)
//!
//! with μ_s the static and μ_k the kinetic coefficient, s_S the Stribeck speed and ε the creep speed: at rest the contact is a viscous damper
//! μ_s·λ/ε, so a part held by the law still creeps by a fraction of ε. Each solve uses the damper c = μ(s)·λ/√(s² + ε²) of the last iterate, with the
//! normal force found there; since c is never negative, friction always dissipates and the step stays stable. Off while both coefficients are 0.
//!
//! Source: law and transition after Armstrong-Hélouvry, Dupont & Canudas de Wit, *A survey of models, analysis tools and compensation methods for the
//! control of machines with friction*, Automatica 30(7), 1994; the regularisation is the usual one. Cost on a Cortex-M7: none when off, else about
//! 400 instructions per pushing contact and solve.

use glam::Vec3;

use crate::dynamics::force::{ForceTerm, Iterate};
use crate::dynamics::system::System;
use crate::math::pose::Wrench;
use crate::math::symmetric6::Symmetric6;
use crate::settings::FrictionSettings;

/// Change of force between iterates below which it is settled, N.
const FRICTION_BAND_N: f32 = 0.02;

/// Friction at all contacts of a step.
pub(crate) struct Friction<'a> {
    settings: &'a FrictionSettings,
    period_s: f32,
    /// L, m.
    length: f32,
    /// Σ c·(PᵀP − JᵀJ): P maps the scaled twist to the point's velocity, J to its normal part; N s/m.
    damping: Symmetric6,
}

impl<'a> Friction<'a> {
    pub fn new(settings: &'a FrictionSettings, period_s: f32, length: f32) -> Self {
        Self {
            settings,
            period_s,
            length,
            damping: Symmetric6::ZERO,
        }
    }

    /// μ(s)/√(s² + ε²), s/m.
    fn damping_per_newton(&self, speed2: f32) -> f32 {
        let s = self.settings;
        let share = libm::expf(-speed2 / (s.stribeck_m_per_s * s.stribeck_m_per_s));
        let mu = s.kinetic + (s.fixed - s.kinetic) * share;
        mu / libm::sqrtf(speed2 + s.creep_m_per_s * s.creep_m_per_s)
    }
}

impl ForceTerm for Friction<'_> {
    fn linearise(&mut self, at: &Iterate<'_>) -> bool {
        if self.settings.is_off() {
            return true;
        }
        let Some(contact) = at.contact else {
            return true;
        };
        let last = self.damping.times(at.x);
        self.damping = Symmetric6::ZERO;
        let [x, y, z, a, b, c] = *at.x;
        let (linear, angular) = (Vec3::new(x, y, z), Vec3::new(a, b, c) * (1.0 / self.length));
        for (c, normal_n) in contact.pushing() {
            let n = Vec3::new(c.row[0], c.row[1], c.row[2]);
            let velocity = linear + angular.cross(c.arm);
            let tangential = velocity - n * n.dot(velocity);
            let damping = normal_n * self.damping_per_newton(tangential.length_squared());
            for axis in Vec3::AXES {
                let turn = c.arm.cross(axis) * (1.0 / self.length);
                let row = [axis.x, axis.y, axis.z, turn.x, turn.y, turn.z];
                self.damping.add_outer(damping, &row);
            }
            self.damping.add_outer(-damping, &c.row);
        }
        let now = self.damping.times(at.x);
        now.iter()
            .zip(last)
            .all(|(now, last)| (now - last).abs() < FRICTION_BAND_N)
    }

    fn add_to(&self, system: &mut System) {
        if !self.settings.is_off() {
            system.matrix.add_scaled(self.period_s, &self.damping);
        }
    }

    fn add_wrench(&self, x: &[f32; 6], _: f32, to: &mut Wrench) {
        if !self.settings.is_off() {
            let [fx, fy, fz, tx, ty, tz] = self.damping.times(x);
            to.force += Vec3::new(-fx, -fy, -fz);
            to.torque += Vec3::new(-tx, -ty, -tz) * self.length;
        }
    }

    #[cfg(test)]
    fn energy_j(&self, _: &[f32; 6]) -> f32 {
        0.0
    }
}
