//! Virtual coupling between handle and object, eqs. 1–2 of Faas 2010.
//!
//! F = k_T·d − b_T·v and τ = k_R·θ − b_R·ω on the object: d and θ lead from the object to where the handle holds it (handle ∘ G), v and ω
//! are the object's motion relative to that place. Both act at the held part's centre of mass, so translation and rotation do not mix.
//! Both are taken at the tick's end, the hand carried on at its measured twist: in free motion the object does not lag and the coupling is silent,
//! and the half period by which a sampled spring comes late, which makes energy (b > k·h/2 of Colgate and Schenkel), is made up for.
//! Beyond its largest force or torque the coupling slips: its stiffness and damping are scaled down together, which keeps the implicit step's matrix
//! positive definite and the force's direction.

use glam::Vec3;

use crate::dynamics::body::Grabbed;
use crate::math::pose::{Pose, Twist, Wrench};
use crate::math::rotation::{self, log_continuous};
use crate::math::vector::{cut, length};
use crate::settings::CouplingSettings;

/// The coupling at the tick's start, world axes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Coupling {
    /// d: from the object's centre of mass to its place in the hand, m.
    pub stretch: Vec3,
    /// θ: rotation vector from the object to its place in the hand, rad.
    pub angle: Vec3,
    /// Motion of the place in the hand, at the held centre of mass.
    pub target: Twist,
    /// From the handle's origin to the held centre of mass, m.
    lever: Vec3,
}

/// Fractions (0 to 1) of stiffness and damping left once the coupling slips.
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
    /// Stretched so far, with the hand at rest.
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

    /// Where the handle must hold the object (G) for the coupling to be stretched and turned no farther than its springs may pull; `None`: it is not.
    pub fn slipped(&self, handle: Pose, grabbed: &Grabbed, settings: &CouplingSettings) -> Option<Pose> {
        // A spring of no stiffness may be as long as it likes: x/0 is infinite, and 0/0 compares false.
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

    /// How far the coupling slips under `pull`.
    pub fn slip(pull: Wrench, settings: &CouplingSettings) -> Slip {
        Slip {
            translation: fraction(pull.force, settings.force_max_n),
            rotation: fraction(pull.torque, settings.torque_max_nm),
        }
    }

    /// What the handle feels at its origin when the object is pulled with `wrench`: the reaction, applied where the hand holds the part.
    pub fn reaction(&self, wrench: Wrench) -> Wrench {
        (-wrench).moved_by(-self.lever)
    }
}

/// Energy in the coupling's springs, J: ½·k·d² until they slip at F, F·d − F²/(2·k) from there on.
pub(crate) fn potential(coupling: &Coupling, settings: &CouplingSettings) -> f32 {
    let spring = |k: f32, stretch: Vec3, most: f32| {
        let squared = stretch.length_squared();
        // The root, dear without an instruction of its own, only where it slips.
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
