//! Kinematics of the mechanisms a rig's description can name: joint angles to handle pose and Jacobians, and force to joint torques.
//!
//! A [`Model`] is built from a [`Rig`] once; [`Model::posture`] is called each tick. The handle's velocity is v = J·θ̇, and a force F on the handle
//! requires the torques τ = Jᵀ·F (virtual work: τ·θ̇ = F·v), so that torques need no inverse and no iteration.
//!
//! **Singular postures.** Where J loses rank the motors cannot push the handle in some direction, and where a closed linkage is fully extended J
//! grows without bound and so would τ. One number indicates both, the isotropy of J (Kim & Khosla 1991): geometric over arithmetic mean of the
//! eigenvalues of JᵀJ, 1 where all directions are alike, 0 in a singular posture. Force is applied in full above [`WHOLE`], not at all below
//! [`NONE`], and in proportion between.
//!
//! Metres, radians, newtons; positions and Jacobians in the world. Cost: at most three sine–cosine pairs, three roots and 150 operations a posture.

mod paddle;
mod pantograph;
mod placed;
mod serial_arm;

use glam::{Mat3, Quat, Vec3};
use mortise_haptics::rotation;
use mortise_protocol::limits::MAX_JOINTS;
use mortise_protocol::rig::{Kinematics, Rig, RigFault, Wrist};

/// Isotropy from which force is applied in full.
pub const WHOLE: f32 = 0.3;
/// Isotropy below which no force is applied.
pub const NONE: f32 = 0.1;

/// Kinematic model of a mechanism.
#[derive(Clone, Copy, Debug)]
pub struct Model {
    kinematics: Kinematics,
    joints: usize,
    origin: Vec3,
    turn: Quat,
    wrist: Option<Wrist>,
}

/// The mechanism in one posture.
#[derive(Clone, Copy, Debug)]
pub struct Posture {
    /// Handle, world, m.
    pub position: Vec3,
    /// Handle's orientation, world; the identity where none is sensed.
    pub orientation: Quat,
    /// J = ∂p/∂θ, m/rad, world; columns by joint, zero for absent joints.
    pub jacobian: Mat3,
    /// Angular velocity of the handle for each joint's rate, world; zero where no orientation is sensed.
    pub joint_axes: Mat3,
    /// Angular velocity of the handle for each wrist axis' rate, world: unit vectors, or zero without a wrist.
    pub wrist_axes: Mat3,
    /// Isotropy of J over the existing joints, 0 to 1.
    pub isotropy: f32,
}

impl Model {
    /// The model of a description.
    ///
    /// # Errors
    /// The errors of [`Rig::check`]; `Linkage`, `Singular`, `Workspace` when the home pose is not usable.
    pub fn new(rig: &Rig) -> Result<Self, RigFault> {
        rig.check()?;
        let turn = Vec3::from_array(rig.mount.turn).clamp_length_max(rotation::EXP_MAX);
        let model = Self {
            kinematics: rig.kinematics,
            joints: rig.joints.len(),
            origin: Vec3::from_array(rig.mount.origin),
            turn: rotation::exp(turn),
            wrist: rig.wrist,
        };
        let mut home = [0.0; MAX_JOINTS];
        for (angle, joint) in home.iter_mut().zip(&rig.joints) {
            *angle = joint.home;
        }
        let wrist = rig.wrist.map_or([0.0; 3], |wrist| wrist.home);
        let posture = model.posture(home, wrist).ok_or(RigFault::Linkage)?;
        if posture.isotropy < WHOLE {
            return Err(RigFault::Singular);
        }
        if posture.position.length_squared() > rig.ceilings.workspace * rig.ceilings.workspace {
            return Err(RigFault::Workspace);
        }
        Ok(model)
    }

    /// Number of joints.
    pub fn joints(&self) -> usize {
        self.joints
    }

    /// Whether the handle's orientation is sensed.
    pub fn has_wrist(&self) -> bool {
        self.wrist.is_some()
    }

    /// The posture at these joint angles and, where there is a wrist, these wrist angles, rad. `None` where the links cannot be connected.
    pub fn posture(&self, angles: [f32; MAX_JOINTS], wrist: [f32; 3]) -> Option<Posture> {
        let placed = match self.kinematics {
            Kinematics::Paddle { radius } => paddle::place(radius, angles),
            Kinematics::Pantograph {
                base,
                proximal,
                distal,
            } => pantograph::place(base, proximal, distal, angles)?,
            Kinematics::SerialArm {
                base_height,
                upper,
                lower,
            } => serial_arm::place(base_height, upper, lower, angles),
        };
        let world = Mat3::from_quat(self.turn);
        let jacobian = world * placed.linear;
        let mut posture = Posture {
            position: world * (placed.position - self.origin),
            orientation: Quat::IDENTITY,
            jacobian,
            joint_axes: Mat3::ZERO,
            wrist_axes: Mat3::ZERO,
            isotropy: isotropy(&jacobian, self.joints),
        };
        if let Some(passive) = &self.wrist {
            let mut orientation = self.turn * placed.link;
            let mut axes = [Vec3::ZERO; 3];
            for (number, axis) in axes.iter_mut().enumerate() {
                let own = Vec3::from_array(passive.axes[number]);
                *axis = orientation * own;
                let (sin, cos) = libm::sincosf(0.5 * wrist[number]);
                let turned = own * sin;
                orientation *= Quat::from_xyzw(turned.x, turned.y, turned.z, cos);
            }
            // Six factors, each within 2⁻²² of unit length.
            posture.orientation = orientation * (1.5 - 0.5 * orientation.length_squared());
            posture.joint_axes = world * placed.angular;
            posture.wrist_axes = Mat3::from_cols(axes[0], axes[1], axes[2]);
        }
        let finite = posture.position.is_finite() && posture.jacobian.is_finite();
        finite.then_some(posture)
    }
}

impl Posture {
    /// Share of a force that is applied here: 1 in ordinary postures, 0 near singular ones.
    pub fn share(&self) -> f32 {
        // NaN compares false and gives 0.
        if self.isotropy >= WHOLE {
            1.0
        } else if self.isotropy > NONE {
            (self.isotropy - NONE) / (WHOLE - NONE)
        } else {
            0.0
        }
    }

    /// Joint torques that push the handle with `force` (N, world), N·m: τ = Jᵀ·F.
    pub fn torques(&self, force: Vec3) -> [f32; MAX_JOINTS] {
        (self.jacobian.transpose() * force).to_array()
    }

    /// The handle's velocity, m/s, from joint rates, rad/s: v = J·θ̇.
    pub fn velocity(&self, rates: [f32; MAX_JOINTS]) -> Vec3 {
        self.jacobian * Vec3::from_array(rates)
    }

    /// The handle's angular velocity, rad/s.
    pub fn angular_velocity(&self, rates: [f32; MAX_JOINTS], wrist: [f32; 3]) -> Vec3 {
        self.joint_axes * Vec3::from_array(rates) + self.wrist_axes * Vec3::from_array(wrist)
    }
}

/// Geometric over arithmetic mean of the eigenvalues of JᵀJ over the first `joints` columns.
fn isotropy(jacobian: &Mat3, joints: usize) -> f32 {
    let [a, b, c] = [jacobian.x_axis, jacobian.y_axis, jacobian.z_axis];
    let trace = a.length_squared() + b.length_squared() + c.length_squared();
    let found = match joints {
        1 => return if trace > 0.0 { 1.0 } else { 0.0 },
        // det(JᵀJ) = |a × b|².
        2 => 2.0 * libm::sqrtf(a.cross(b).length_squared()) / trace,
        _ => {
            let volume = a.cross(b).dot(c);
            3.0 * libm::cbrtf(volume * volume) / trace
        }
    };
    // Exceeds the inequality of the means only by rounding.
    if found.is_finite() {
        found.clamp(0.0, 1.0)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests;
