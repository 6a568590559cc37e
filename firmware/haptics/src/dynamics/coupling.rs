//! Virtual coupling between handle and object, eqs. 1–2 of Faas 2010.
//!
//! F = k_T·d − b_T·v and τ = k_R·θ − b_R·ω on the object: d and θ lead from the object to its place in the handle (handle ∘ G), v and ω are the
//! object's motion relative to that place. Both act at the held part's centre of mass, so translation and rotation are decoupled. Both are evaluated
//! at the tick's end, with the handle extrapolated at its measured twist: in free motion the object does not lag and the coupling exerts no force,
//! and the half-period delay of a sampled spring, which generates energy (b > k·h/2 of Colgate and Schenkel), is compensated. Beyond its largest
//! force or torque the coupling slips: its stiffness and damping are scaled down together, which keeps the implicit step's matrix positive definite
//! and the force's direction.

use core::mem;

use glam::Vec3;

use crate::dynamics::body::Grabbed;
use crate::dynamics::force::{ForceTerm, Iterate};
use crate::dynamics::system::System;
use crate::io::Flags;
use crate::math::pose::{Pose, Twist, Wrench};
use crate::math::rotation::{self, log_continuous};
use crate::math::vector::{cut, length};
use crate::settings::CouplingSettings;

/// The coupling at the tick's start, world axes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Coupling {
    /// d: from the object's centre of mass to its place in the handle, m.
    pub stretch: Vec3,
    /// θ: rotation vector from the object to its place in the handle, rad.
    pub angle: Vec3,
    /// Motion of that place, at the held centre of mass.
    pub target: Twist,
    /// From the handle's origin to the held centre of mass, m.
    lever: Vec3,
}

/// Fractions (0 to 1) of stiffness and damping that remain when the coupling slips.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Slip {
    pub translation: f32,
    pub rotation: f32,
}

impl Slip {
    pub const NONE: Self = Self {
        translation: 1.0,
        rotation: 1.0,
    };
}

impl Coupling {
    /// A coupling with this stretch, handle at rest.
    #[cfg(test)]
    pub fn stretched(stretch: Vec3, angle: Vec3) -> Self {
        Self {
            stretch,
            angle,
            target: Twist::ZERO,
            lever: Vec3::ZERO,
        }
    }

    /// Measures stretch and angle.
    pub fn measure(handle: Pose, handle_twist: Twist, grabbed: &Grabbed) -> Self {
        let place = handle.compose(grabbed.offset);
        let center = place.transform_point(grabbed.body.center_of_mass);
        let lever = center - handle.position;
        Self {
            stretch: center - grabbed.center,
            angle: log_continuous(place.orientation * grabbed.orientation.conjugate(), grabbed.angle),
            target: handle_twist.moved_by(lever),
            lever,
        }
    }

    /// The grip offset (G) at which the coupling's springs stay within their limits; `None` when they already do.
    pub fn slipped(&self, handle: Pose, grabbed: &Grabbed, settings: &CouplingSettings) -> Option<Pose> {
        // A spring of zero stiffness may have any length: x/0 is infinite, and 0/0 compares false.
        let (stretch, pulled) = cut(self.stretch, settings.force_max_n / settings.k_t_n_per_m);
        let (angle, turned) = cut(self.angle, settings.torque_max_nm / settings.k_r);
        if !(pulled || turned) {
            return None;
        }
        let orientation = rotation::exp(cut(angle, rotation::EXP_MAX).0) * grabbed.orientation;
        let position = grabbed.center + stretch - orientation * grabbed.body.center_of_mass;
        Some(handle.inverse().compose(Pose {
            position,
            orientation,
        }))
    }

    /// Wrench on the object at its centre of mass at the tick's end, when it has moved with `twist` for `period_s`; before slipping.
    ///
    /// d' = d + h·(V_hand − V'), so F' = k·d + (b + h·k)·(V_hand − V'), and the same for the torque.
    pub fn pull(&self, settings: &CouplingSettings, period_s: f32, twist: Twist) -> Wrench {
        Wrench {
            force: self.stretch * settings.k_t_n_per_m
                + (self.target.linear - twist.linear) * (settings.b_t + period_s * settings.k_t_n_per_m),
            torque: self.angle * settings.k_r
                + (self.target.angular - twist.angular) * (settings.b_r + period_s * settings.k_r),
        }
    }

    /// Slip of the coupling under `pull`.
    pub fn slip(pull: Wrench, settings: &CouplingSettings) -> Slip {
        Slip {
            translation: fraction(pull.force, settings.force_max_n),
            rotation: fraction(pull.torque, settings.torque_max_nm),
        }
    }

    /// Wrench on the handle at its origin when the object is pulled with `wrench`: the reaction, applied where the handle holds the part.
    pub fn reaction(&self, wrench: Wrench) -> Wrench {
        (-wrench).moved_by(-self.lever)
    }
}

/// The coupling at the tick's start, slipping in the handle where it is stretched beyond `limits`. At full limits the part receives the handle's
/// motion at the grab, or the damper would be felt; under reduced limits it starts from rest, since its kinetic energy ½·m·v² must come from the
/// operator.
pub(crate) fn take_hold(
    mut grabbed: Grabbed,
    handle: Pose,
    handle_twist: Twist,
    limits: Option<&CouplingSettings>,
) -> (Grabbed, Coupling) {
    let mut coupling = Coupling::measure(handle, handle_twist, &grabbed);
    if let Some(limits) = limits
        && let Some(offset) = coupling.slipped(handle, &grabbed, limits)
    {
        grabbed.offset = offset;
        coupling = Coupling::measure(handle, handle_twist, &grabbed);
    }
    grabbed.angle = coupling.angle;
    if grabbed.age == 0 && limits.is_none() {
        grabbed.twist = coupling.target;
    }
    grabbed.age = grabbed.age.saturating_add(1);
    (grabbed, coupling)
}

/// `pull` limited to the force and torque that the coupling can transmit.
pub(crate) fn slipping(pull: Wrench, settings: &CouplingSettings, flags: &mut Flags) -> Wrench {
    let slip = Coupling::slip(pull, settings);
    flags.insert_if(slip.translation < 1.0, Flags::COUPLING_FORCE);
    flags.insert_if(slip.rotation < 1.0, Flags::COUPLING_TORQUE);
    Wrench {
        force: pull.force * slip.translation,
        torque: pull.torque * slip.rotation,
    }
}

/// Change of slip below which it is settled.
const SLIP_BAND: f32 = 1e-3;

/// The coupling as a force term: K = B + h·K_spring and w = K_spring·d + (B + h·K_spring)·V_hand, both scaled by the slip.
pub(crate) struct CouplingForce<'a> {
    pub coupling: &'a Coupling,
    pub settings: &'a CouplingSettings,
    pub period_s: f32,
    /// L, m.
    pub length: f32,
    slip: Slip,
}

impl<'a> CouplingForce<'a> {
    pub fn new(coupling: &'a Coupling, settings: &'a CouplingSettings, period_s: f32, length: f32) -> Self {
        Self {
            coupling,
            settings,
            period_s,
            length,
            slip: Slip::NONE,
        }
    }

    fn twist(&self, x: &[f32; 6]) -> Twist {
        Twist {
            linear: Vec3::new(x[0], x[1], x[2]),
            angular: Vec3::new(x[3], x[4], x[5]) * (1.0 / self.length),
        }
    }
}

impl ForceTerm for CouplingForce<'_> {
    /// Without slip, which is the final state in most ticks.
    fn begin(&mut self, _: &[f32; 6]) {
        self.slip = Slip::NONE;
    }

    fn linearise(&mut self, at: &Iterate<'_>) -> bool {
        let pull = self.coupling.pull(self.settings, self.period_s, self.twist(at.x));
        let slip = Coupling::slip(pull, self.settings);
        let last = mem::replace(&mut self.slip, slip);
        (last.translation - slip.translation).abs() < SLIP_BAND
            && (last.rotation - slip.rotation).abs() < SLIP_BAND
    }

    fn add_to(&self, system: &mut System) {
        let (c, s, slip) = (self.coupling, self.settings, self.slip);
        let h = self.period_s;
        let inverse_length = 1.0 / self.length;
        let b_t = s.b_t + h * s.k_t_n_per_m;
        let b_r = s.b_r + h * s.k_r;
        let translation = h * b_t * slip.translation;
        let rotation = h * b_r * slip.rotation * inverse_length * inverse_length;
        for i in 0..3 {
            system.matrix.add(i, i, translation);
            system.matrix.add(3 + i, 3 + i, rotation);
        }
        let linear = (c.stretch * s.k_t_n_per_m + c.target.linear * b_t) * (h * slip.translation);
        let angular = (c.angle * s.k_r + c.target.angular * b_r) * (h * slip.rotation * inverse_length);
        let right = [linear.x, linear.y, linear.z, angular.x, angular.y, angular.z];
        for (r, w) in system.right.iter_mut().zip(right) {
            *r += w;
        }
    }

    fn add_wrench(&self, x: &[f32; 6], period_s: f32, to: &mut Wrench) {
        let pull = self.coupling.pull(self.settings, period_s, self.twist(x));
        let slip = Coupling::slip(pull, self.settings);
        to.force += pull.force * slip.translation;
        to.torque += pull.torque * slip.rotation;
    }

    #[cfg(test)]
    fn energy_j(&self, x: &[f32; 6]) -> f32 {
        let moved = self.twist(x);
        let at_end = Coupling {
            stretch: self.coupling.stretch - moved.linear * self.period_s,
            angle: self.coupling.angle - moved.angular * self.period_s,
            ..*self.coupling
        };
        potential(&at_end, self.settings)
    }
}

/// Energy in the coupling's springs, J: ½·k·d² until they slip at F, F·d − F²/(2·k) from there on.
pub(crate) fn potential(coupling: &Coupling, settings: &CouplingSettings) -> f32 {
    let spring = |k: f32, stretch: Vec3, most: f32| {
        let squared = stretch.length_squared();
        // The square root is expensive without a hardware instruction, so it is computed only where the spring slips.
        if k * k * squared > most * most {
            most * (length(stretch) - 0.5 * most / k)
        } else {
            0.5 * k * squared
        }
    };
    spring(settings.k_t_n_per_m, coupling.stretch, settings.force_max_n)
        + spring(settings.k_r, coupling.angle, settings.torque_max_nm)
}

/// 1 within `most`, else `most / |v|`.
fn fraction(v: Vec3, most: f32) -> f32 {
    if v.length_squared() > most * most {
        most / length(v)
    } else {
        1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dynamics::force::contract;
    use proptest::prelude::*;

    proptest! {
        /// Sticking and slipping.
        #[test]
        fn the_coupling_is_a_force_term(
            stretch in prop::array::uniform3(-0.02f32..0.02),
            angle in prop::array::uniform3(-0.8f32..0.8),
            x in contract::twists(),
            v in contract::twists(),
            along in 0usize..6,
        ) {
            let mut settings = crate::Settings::default().coupling;
            let coupling = Coupling::stretched(Vec3::from_array(stretch), Vec3::from_array(angle));
            let (h, length) = (1e-3, 0.02);
            let mut force = CouplingForce::new(&coupling, &settings, h, length);
            contract::majorises(&mut force, &Iterate { x: &x, contact: None }, &v, h, length)?;
            // Without dampers the whole wrench is conservative.
            (settings.b_t, settings.b_r) = (0.0, 0.0);
            let mut force = CouplingForce::new(&coupling, &settings, h, length);
            contract::conserves(&mut force, &x, (along, 2e-2), h, h, length)?;
        }
    }
}
