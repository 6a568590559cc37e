//! The held part as a rigid body: its mass properties for the step.

use glam::{Mat3, Quat, Vec3};
use mortise_protocol::image::Shape;

use crate::math::pose::{Pose, Twist, renormalize};
use crate::math::rotation;
use crate::math::vector::cut;
use crate::settings::ObjectSettings;

/// Added to every reach to avoid division by zero for a part that is a single point.
const LEAST_REACH_M: f32 = 1e-6;

/// Mass properties of a shape, without mass.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Body {
    /// Centre of mass, shape frame, m.
    pub center_of_mass: Vec3,
    /// Inertia over mass about the centre of mass, shape frame, m². Its eigenvalues are squared radii of gyration.
    gyration2: Mat3,
    /// At least the largest eigenvalue of `gyration2`, m².
    gyration2_largest: f32,
    /// Radius about the centre of mass that contains every point of the shape, m.
    pub reach: f32,
}

impl Body {
    /// From a shape's record. A shape without volume or with an impossible inertia (a leaky mesh) is treated as a ball of its size.
    pub fn of(shape: &Shape<'_>) -> Self {
        let record = shape.record;
        let center_of_mass = Vec3::from_array(record.center_of_mass);
        let [xx, yy, zz, xy, xz, yz] = record.inertia;
        let per_volume = 1.0 / record.volume;
        let inertia = Mat3::from_cols(
            Vec3::new(xx, xy, xz),
            Vec3::new(xy, yy, yz),
            Vec3::new(xz, yz, zz),
        ) * per_volume;
        let reach =
            (center_of_mass - Vec3::from_array(record.center)).length() + record.radius + LEAST_REACH_M;
        // Largest sum of absolute values of a row: an upper bound of every eigenvalue (Gershgorin).
        let largest = [inertia.x_axis, inertia.y_axis, inertia.z_axis]
            .iter()
            .map(|row| row.x.abs() + row.y.abs() + row.z.abs())
            .fold(0.0f32, |a, b| if b > a { b } else { a });
        let possible = record.volume > 0.0
            && positive_definite(inertia)
            && largest.is_finite()
            // No mass within `reach` of the centre can have more.
            && largest <= 4.0 * reach * reach;
        if possible {
            Self {
                center_of_mass,
                gyration2: inertia,
                gyration2_largest: largest,
                reach,
            }
        } else {
            let ball = 0.4 * record.radius * record.radius;
            Self {
                center_of_mass,
                gyration2: Mat3::from_diagonal(Vec3::splat(ball)),
                gyration2_largest: ball,
                reach,
            }
        }
    }

    /// Inertia over mass in the world (m²) within the bounds of `settings`, and the length (m) that makes rotation comparable with
    /// translation: the bounded radius of gyration.
    ///
    /// Scaled down as a whole to the upper bound, then the lower bound squared is added on the diagonal: smooth, and never singular.
    pub fn gyration2_in_world(&self, orientation: Quat, settings: &ObjectSettings) -> (Mat3, f32) {
        let most = settings.gyration_max_m * settings.gyration_max_m;
        let least = settings.gyration_min_m * settings.gyration_min_m;
        let scale = if self.gyration2_largest > most {
            most / self.gyration2_largest
        } else {
            1.0
        };
        let rotation = Mat3::from_quat(orientation);
        let world = rotation * (self.gyration2 * scale) * rotation.transpose();
        let length = libm::sqrtf(self.gyration2_largest * scale + least);
        (world + Mat3::from_diagonal(Vec3::splat(least)), length)
    }
}

/// Sylvester's criterion.
fn positive_definite(m: Mat3) -> bool {
    let minor = m.x_axis.x * m.y_axis.y - m.y_axis.x * m.x_axis.y;
    m.x_axis.x > 0.0 && minor > 0.0 && m.determinant() > 0.0
}

/// The grabbed part.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Grabbed {
    /// Its index.
    pub part: u16,
    /// Placement in the handle's frame (G): handle ∘ G is the pose towards which the coupling pulls the part.
    pub offset: Pose,
    /// World position of the centre of mass, m.
    pub center: Vec3,
    /// Shape to world.
    pub orientation: Quat,
    /// At the centre of mass, world axes.
    pub twist: Twist,
    /// Angle of the coupling in the last tick, for its branch, rad.
    pub angle: Vec3,
    /// Ticks since the grab. (A number rather than a flag: see [`crate::State::new`].)
    pub age: u32,
    /// Its mass properties.
    pub body: Body,
}

impl Grabbed {
    /// Placement of the shape frame in the world.
    pub fn pose(&self) -> Pose {
        Pose {
            position: self.center - self.orientation * self.body.center_of_mass,
            orientation: self.orientation,
        }
    }

    /// Translational kinetic energy, J.
    pub fn moving_energy(&self, mass_kg: f32) -> f32 {
        0.5 * mass_kg * self.twist.linear.length_squared()
    }

    /// Rotational kinetic energy, J.
    pub fn turning_energy(&self, mass_kg: f32, gyration2: Mat3) -> f32 {
        0.5 * mass_kg * self.twist.angular.dot(gyration2 * self.twist.angular)
    }

    /// Moves the part with `twist` for `period_s`.
    pub fn advance(&mut self, twist: Twist, period_s: f32) {
        self.twist = twist;
        self.center += twist.linear * period_s;
        let turn = twist.angular * period_s;
        let turn = cut(turn, rotation::EXP_MAX).0;
        self.orientation = renormalize(rotation::exp(turn) * self.orientation);
    }
}
