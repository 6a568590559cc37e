//! Position scaling: the held part moves so many times as far as the handle, so that a small rig reaches across a large scene.
//!
//! The force law is given a handle at s·p with the velocity s·v, and its force is multiplied by s for the motors. The power at both handles is equal,
//! F·(s·v) = (s·F)·v, so the energy accounts of the law hold for the real one. Rotations and torques stay as they are. A spring of stiffness k in the
//! law is felt as one of s²·k. A scale of 1 changes nothing, to the bit.
//!
//! Source: Colgate 1991, "Power and Impedance Scaling in Bilateral Manipulation".

use mortise_haptics::{Pose, Settings, Twist, Wrench};

use crate::board::Sensed;

/// The scale s in use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PositionScale(pub f32);

impl PositionScale {
    /// The part moves as far as the handle.
    pub const ONE: Self = Self(1.0);

    /// Pose and twist of the handle that the force law is given.
    pub fn handle(self, sensed: &Sensed) -> (Pose, Twist) {
        let (mut pose, mut twist) = (sensed.handle, sensed.twist);
        pose.position *= self.0;
        twist.linear *= self.0;
        (pose, twist)
    }

    /// Settings with which the force law keeps the limits of force at the real handle, and knows what its friction and a count of its encoders are at the
    /// scaled one.
    pub fn law(self, law: &Settings) -> Settings {
        let mut law = *law;
        law.limits.force_n /= self.0;
        law.limits.force_slew_n_per_s /= self.0;
        law.passivity.damping /= self.0 * self.0;
        law.passivity.position_count_m *= self.0;
        law
    }

    /// Wrench on the real handle.
    pub fn felt(self, wrench: Wrench) -> Wrench {
        Wrench {
            force: wrench.force * self.0,
            torque: wrench.torque,
        }
    }
}
