//! What a rig's handle puts against the sampled loop, along its worst axis: inertia, friction, counts, rate and delay.
//!
//! A described mechanism has, in joint space, the inertia M = diag(I) + m·JᵀJ, viscous friction C = diag(c), dry friction f and counts δ
//! ([`mortise_simulation::described`]). Seen from the handle the lightest direction has the inertia 1/λ(J·M⁻¹·Jᵀ) and the one with least friction
//! 1/λ(J·C⁻¹·Jᵀ), λ the largest eigenvalue. A joint i rests between two counts of every joint up to the stiffness 2·f_i/Σ_k |J_i·J_k|·δ_k. Each is
//! taken in its worst posture of a grid over the joints' ranges. Where the force fades (share s < 1 near singular postures) the loop has s times the
//! gains, which is the same as 1/s times inertia, friction and resting stiffness with all of them.
//!
//! The directions of least inertia and of least friction need not be the same: that they are taken together is on the safe side, as limits fall with
//! either. No motor of a described mechanism turns the handle.

use glam::DMat3;
use mortise_mechanism::interface::TICK_S;
use mortise_mechanism::kinematics::{Model, Posture};
use mortise_mechanism::velocity::low_pass::VELOCITY_FILTER_S;
use mortise_protocol::limits::MAX_JOINTS;
use mortise_protocol::rig::{Joint, Rig};
use mortise_simulation::simulated;

use super::sampled_loop::Axis;

/// Postures of each joint that are tried.
const POSTURES: u16 = 9;
/// Delay from reading to force of a board with motors, ticks: what a tick computes acts in the next.
const MOTORS_LATE: usize = 1;

/// The worst axis of a handle, and what is known of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandleAxis {
    /// For the loop.
    pub axis: Axis,
    /// Least dry friction at the handle, N or N·m.
    pub coulomb: f64,
    /// Largest count at the handle, m or rad.
    pub count: f64,
}

impl HandleAxis {
    /// As the force law has it with this position scale: it moves so many times as far, at the same power.
    fn scaled(self, scale: f64) -> Self {
        let square = scale * scale;
        Self {
            axis: Axis {
                inertia: self.axis.inertia / square,
                viscous: self.axis.viscous / square,
                resting: self.axis.resting / square,
                ..self.axis
            },
            coulomb: self.coulomb / scale,
            count: self.count * scale,
        }
    }
}

/// A handle.
#[derive(Clone, Debug, PartialEq)]
pub struct Handle {
    /// Which rig's it is, as part of a sentence.
    pub name: String,
    /// Where motors push it.
    pub translation: HandleAxis,
    /// Where motors turn it; `None`: none does.
    pub rotation: Option<HandleAxis>,
}

impl Handle {
    /// As the force law has it with this position scale.
    pub fn scaled(self, scale: f64) -> Self {
        Self {
            translation: self.translation.scaled(scale),
            ..self
        }
    }
}

/// The loop of a rig whose motors act so many ticks late.
fn axis(inertia: f64, viscous: f64, resting: f64, delay: usize) -> Axis {
    Axis {
        inertia,
        viscous,
        resting,
        period_s: f64::from(TICK_S),
        filter_s: f64::from(VELOCITY_FILTER_S),
        delay,
    }
}

/// The free handle with six motors that simulated rigs have without a description.
pub fn simulated() -> Handle {
    let of = |inertia: f32, viscous: f32, coulomb: f32, count: f32| {
        let [inertia, viscous, coulomb, count] = [inertia, viscous, coulomb, count].map(f64::from);
        HandleAxis {
            axis: axis(inertia, viscous, 2.0 * coulomb / count, 0),
            coulomb,
            count,
        }
    };
    Handle {
        name: "the simulated handle".to_owned(),
        translation: of(
            simulated::MASS,
            simulated::VISCOUS,
            simulated::COULOMB,
            simulated::RESOLUTION,
        ),
        rotation: Some(of(
            simulated::INERTIA,
            simulated::ANGULAR_VISCOUS,
            simulated::ANGULAR_COULOMB,
            simulated::ANGULAR_RESOLUTION,
        )),
    }
}

/// The handle of a described rig; `None` if no posture of its range can be driven. `real`: a board with motors moves it,
/// not a simulation.
pub fn described(rig: &Rig, real: bool) -> Option<Handle> {
    let model = Model::new(rig).ok()?;
    let mut worst: Option<HandleAxis> = None;
    for number in 0..usize::from(POSTURES).pow(rig.joints.len() as u32) {
        let mut angles = [0.0; MAX_JOINTS];
        let mut rest = number;
        for (angle, joint) in angles.iter_mut().zip(&rig.joints) {
            let step = (rest % usize::from(POSTURES)) as f32 / f32::from(POSTURES - 1);
            *angle = joint.range[0] + step * (joint.range[1] - joint.range[0]);
            rest /= usize::from(POSTURES);
        }
        let Some(found) = model
            .posture(angles, [0.0; 3])
            .filter(|found| found.share() > 0.0)
        else {
            continue;
        };
        let here = in_posture(rig, &found, if real { MOTORS_LATE } else { 0 });
        worst = Some(worst.map_or(here, |worst| worse(&worst, &here)));
    }
    Some(Handle {
        name: rig.name.to_string(),
        translation: worst?,
        rotation: None,
    })
}

fn worse(a: &HandleAxis, b: &HandleAxis) -> HandleAxis {
    HandleAxis {
        axis: Axis {
            inertia: a.axis.inertia.min(b.axis.inertia),
            viscous: a.axis.viscous.min(b.axis.viscous),
            resting: a.axis.resting.min(b.axis.resting),
            ..a.axis
        },
        coulomb: a.coulomb.min(b.coulomb),
        count: a.count.max(b.count),
    }
}

fn in_posture(rig: &Rig, posture: &Posture, delay: usize) -> HandleAxis {
    let jacobian = posture.jacobian.as_dmat3();
    let share = f64::from(posture.share());
    // An absent joint has an inertia and friction, and moves nothing.
    let each = |value: fn(&Joint) -> f32| {
        glam::DVec3::from_array(core::array::from_fn(|number| {
            rig.joints
                .get(number)
                .map_or(1.0, |joint| f64::from(value(joint)))
        }))
    };
    let inertia = DMat3::from_diagonal(each(|joint| joint.inertia))
        + jacobian.transpose() * jacobian * f64::from(rig.handle_mass);
    // Without viscous friction the handle has none: the quotient ends at 0.
    let viscous = DMat3::from_diagonal(each(|joint| joint.viscous).max(glam::DVec3::splat(1e-12)));
    let least = |matrix: DMat3| {
        1.0 / (largest_eigenvalue(&(jacobian * matrix.inverse() * jacobian.transpose())) * share)
    };
    let (mut resting, mut coulomb, mut count) = (f64::INFINITY, f64::INFINITY, 0.0f64);
    for (number, joint) in rig.joints.iter().enumerate() {
        let own = jacobian.col(number);
        let steps = rig.joints.iter().enumerate();
        let torque: f64 = steps
            .map(|(other, joint)| {
                own.dot(jacobian.col(other)).abs() * f64::from(joint.radians_per_count().abs())
            })
            .sum();
        let friction = f64::from(joint.coulomb);
        resting = resting.min(2.0 * friction / torque / share);
        coulomb = coulomb.min(friction / own.length());
        count = count.max(own.length() * f64::from(joint.radians_per_count().abs()));
    }
    HandleAxis {
        axis: axis(least(inertia), least(viscous), resting, delay),
        coulomb,
        count,
    }
}

/// The largest eigenvalue of a symmetric matrix, in closed form (O. K. Smith, Communications of the ACM 4(4), 1961).
fn largest_eigenvalue(matrix: &DMat3) -> f64 {
    let mean = (matrix.x_axis.x + matrix.y_axis.y + matrix.z_axis.z) / 3.0;
    let rest = *matrix - DMat3::IDENTITY * mean;
    let square: f64 = rest.to_cols_array().iter().map(|x| x * x).sum();
    let radius = (square / 6.0).sqrt();
    if radius <= 1e-15 * mean.abs() {
        return mean;
    }
    let half = 0.5 * (rest * (1.0 / radius)).determinant();
    mean + 2.0 * radius * (half.clamp(-1.0, 1.0).acos() / 3.0).cos()
}

#[cfg(test)]
mod tests {
    use mortise_rig::{EXAMPLES, parse_rig};
    use proptest::prelude::*;

    use super::*;

    fn example(number: usize) -> Rig {
        let (name, text) = EXAMPLES[number];
        parse_rig(text, name).expect(name)
    }

    /// A paddle is one axis: everything by its radius.
    #[test]
    fn a_paddle_has_its_closed_forms() {
        let rig = example(0);
        let found = described(&rig, true).expect("a handle").translation;
        let r = 0.065_659f64;
        let count = r * core::f64::consts::TAU / 25_967.0;
        for (value, expected) in [
            (found.axis.inertia, 0.02 + 2e-4 / (r * r)),
            (found.axis.viscous, 0.0005 / (r * r)),
            (found.coulomb, 0.01 / r),
            (found.count, count),
            (found.axis.resting, 2.0 * 0.01 / r / count),
        ] {
            assert!((value / expected - 1.0).abs() < 1e-5, "{value} {expected}");
        }
        assert_eq!(found.axis.delay, 1);
    }

    /// Inertia: in no posture and direction has a handle less than was found, and never less than its own mass.
    #[test]
    fn no_direction_is_lighter() {
        for number in 0..EXAMPLES.len() {
            let rig = example(number);
            let found = described(&rig, false).expect("a handle");
            assert!(found.translation.axis.inertia >= f64::from(rig.handle_mass) * 0.999_99);
            assert!(found.translation.axis.viscous > 0.0 && found.translation.axis.resting > 0.0);
            assert!(found.rotation.is_none());
            let model = Model::new(&rig).expect("a model");
            let mut home = [0.0; MAX_JOINTS];
            for (angle, joint) in home.iter_mut().zip(&rig.joints) {
                *angle = joint.home;
            }
            let jacobian = model.posture(home, [0.0; 3]).expect("home").jacobian.as_dmat3();
            for rates in [
                glam::DVec3::X,
                glam::DVec3::new(0.3, 1.0, -0.4),
                glam::DVec3::new(1.0, -0.8, 0.9),
            ] {
                let mut energy = 0.0;
                let mut loss = 0.0;
                let mut moved = glam::DVec3::ZERO;
                for (joint, described) in rig.joints.iter().enumerate() {
                    energy += f64::from(described.inertia) * rates[joint] * rates[joint];
                    loss += f64::from(described.viscous) * rates[joint] * rates[joint];
                    moved += jacobian.col(joint) * rates[joint];
                }
                energy += f64::from(rig.handle_mass) * moved.length_squared();
                let axis = &found.translation.axis;
                assert!(
                    energy / moved.length_squared() >= 0.999 * axis.inertia,
                    "{}",
                    rig.name
                );
                assert!(
                    loss / moved.length_squared() >= 0.999 * axis.viscous,
                    "{}",
                    rig.name
                );
            }
        }
    }

    #[test]
    fn a_joint_without_viscous_friction_leaves_the_handle_none() {
        let mut rig = example(0);
        rig.joints[0].viscous = 0.0;
        assert!(described(&rig, true).expect("a handle").translation.axis.viscous < 1e-8);
    }

    proptest! {
        /// For v a unit vector vᵀ·A·v is never above the eigenvalue, and equal for its own vector, which iteration finds.
        #[test]
        fn the_largest_eigenvalue_is_found(values in prop::array::uniform9(-2.0..2.0f64), v in prop::array::uniform3(-1.0..1.0f64)) {
            let half = DMat3::from_cols_array(&values);
            let matrix = half * half.transpose();
            let found = largest_eigenvalue(&matrix);
            let mut vector = glam::DVec3::from_array(v) + glam::DVec3::new(0.01, 0.02, 0.03);
            for _ in 0..2000 {
                vector = (matrix * vector).normalize_or_zero();
            }
            let reached = vector.dot(matrix * vector);
            prop_assert!(reached <= found * (1.0 + 1e-9) + 1e-12, "{reached} {found}");
            prop_assert!(reached >= 0.98 * found - 1e-9, "{reached} {found}");
        }
    }
}
