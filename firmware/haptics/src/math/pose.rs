//! Poses, twists and wrenches of rigid bodies.
//!
//! SI and radians. Unless a name says otherwise everything is in the world frame; a twist or a wrench belongs to a reference point that its owner
//! names (the handle's origin, or the object's centre of mass).

use glam::{Mat3, Quat, Vec3};

/// A rigid placement: `x_parent = orientation · x_child + position`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Origin of the child frame in the parent frame, m.
    pub position: Vec3,
    /// Child to parent, unit quaternion.
    pub orientation: Quat,
}

impl Pose {
    /// Identity.
    pub const IDENTITY: Self = Self {
        position: Vec3::ZERO,
        orientation: Quat::IDENTITY,
    };

    /// Pose from its components; `orientation` must be of unit length.
    pub const fn new(position: Vec3, orientation: Quat) -> Self {
        Self {
            position,
            orientation,
        }
    }

    /// Pose from the arrays of a scene image (m; unit quaternion x, y, z, w, normalised).
    pub fn from_arrays(position: [f32; 3], orientation: [f32; 4]) -> Self {
        Self {
            position: Vec3::from_array(position),
            orientation: renormalize(Quat::from_array(orientation)),
        }
    }

    /// `self ∘ child`: the child's pose, given in this pose's frame, in this pose's parent frame.
    #[inline]
    #[must_use]
    pub fn compose(self, child: Self) -> Self {
        Self {
            position: self.transform_point(child.position),
            orientation: renormalize(self.orientation * child.orientation),
        }
    }

    /// Pose of the parent in the child: `p.inverse().compose(p)` is the identity up to rounding.
    #[inline]
    #[must_use]
    pub fn inverse(self) -> Self {
        let orientation = self.orientation.conjugate();
        Self {
            position: -(orientation * self.position),
            orientation,
        }
    }

    /// Transforms a point from the child frame to the parent frame, m.
    #[inline]
    #[must_use]
    pub fn transform_point(self, point: Vec3) -> Vec3 {
        self.orientation * point + self.position
    }

    /// Transforms a direction from the child frame to the parent frame.
    #[inline]
    #[must_use]
    pub fn transform_vector(self, vector: Vec3) -> Vec3 {
        self.orientation * vector
    }

    /// The rotation as a matrix: cheaper for many points.
    #[inline]
    #[must_use]
    pub fn rotation(self) -> Mat3 {
        Mat3::from_quat(self.orientation)
    }

    /// Whether every number is finite.
    pub fn is_finite(self) -> bool {
        self.position.is_finite() && self.orientation.is_finite()
    }
}

impl Default for Pose {
    fn default() -> Self {
        Self::IDENTITY
    }
}

/// Velocity of a rigid body at a reference point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Twist {
    /// Velocity of the reference point, m/s.
    pub linear: Vec3,
    /// Angular velocity, rad/s.
    pub angular: Vec3,
}

impl Twist {
    /// At rest.
    pub const ZERO: Self = Self {
        linear: Vec3::ZERO,
        angular: Vec3::ZERO,
    };

    /// Velocity (m/s) of the body's point that lies `arm` (m) from the reference point: v + ω × r.
    #[inline]
    #[must_use]
    pub fn velocity_at(self, arm: Vec3) -> Vec3 {
        self.linear + self.angular.cross(arm)
    }

    /// The same motion with the reference point moved by `arm` (m).
    #[inline]
    #[must_use]
    pub fn moved_by(self, arm: Vec3) -> Self {
        Self {
            linear: self.velocity_at(arm),
            angular: self.angular,
        }
    }

    /// Whether every number is finite.
    pub fn is_finite(self) -> bool {
        self.linear.is_finite() && self.angular.is_finite()
    }
}

/// Force and torque on a rigid body at a reference point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wrench {
    /// Force, N.
    pub force: Vec3,
    /// Torque about the reference point, N m.
    pub torque: Vec3,
}

impl Wrench {
    /// Zero wrench.
    pub const ZERO: Self = Self {
        force: Vec3::ZERO,
        torque: Vec3::ZERO,
    };

    /// The same load with the reference point moved by `arm` (m): τ' = τ − arm × F.
    #[inline]
    #[must_use]
    pub fn moved_by(self, arm: Vec3) -> Self {
        Self {
            force: self.force,
            torque: self.torque - arm.cross(self.force),
        }
    }

    /// Power (W) delivered to a body that moves with `twist`, both at the same reference point.
    #[inline]
    #[must_use]
    pub fn power(self, twist: Twist) -> f32 {
        self.force.dot(twist.linear) + self.torque.dot(twist.angular)
    }

    /// Whether every number is finite.
    pub fn is_finite(self) -> bool {
        self.force.is_finite() && self.torque.is_finite()
    }
}

impl core::ops::Add for Wrench {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self {
            force: self.force + other.force,
            torque: self.torque + other.torque,
        }
    }
}

impl core::ops::Sub for Wrench {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self {
            force: self.force - other.force,
            torque: self.torque - other.torque,
        }
    }
}

impl core::ops::Neg for Wrench {
    type Output = Self;
    fn neg(self) -> Self {
        Self {
            force: -self.force,
            torque: -self.torque,
        }
    }
}

/// Normalises a nearly unit quaternion with one Newton step of 1/√x at 1: a length error of e leaves 1.5·e². No square root, so the cost is the same
/// ten instructions everywhere.
#[inline]
pub(crate) fn renormalize(q: Quat) -> Quat {
    q * (1.5 - 0.5 * q.length_squared())
}

/// Largest plausible coordinate, m: positions beyond it are an encoder fault.
const FARTHEST_M: f32 = 100.0;
/// Largest plausible speed, m/s.
const FASTEST_M_PER_S: f32 = 100.0;
/// Largest plausible angular speed, rad/s.
const FASTEST_RAD_PER_S: f32 = 1000.0;

/// The pose with its quaternion normalised; `None` if it is not finite, too far off, or not a rotation.
pub(crate) fn usable_pose(pose: &Pose) -> Option<Pose> {
    let near = pose.position.abs().max_element() <= FARTHEST_M;
    let norm2 = pose.orientation.length_squared();
    let rotation = norm2 > 0.81 && norm2 < 1.21;
    if !(pose.is_finite() && near && rotation) {
        return None;
    }
    Some(Pose {
        position: pose.position,
        orientation: pose.orientation * (1.0 / libm::sqrtf(norm2)),
    })
}

/// Whether a twist is finite and plausible for a handle.
pub(crate) fn usable_twist(twist: &Twist) -> bool {
    twist.is_finite()
        && twist.linear.abs().max_element() <= FASTEST_M_PER_S
        && twist.angular.abs().max_element() <= FASTEST_RAD_PER_S
}
