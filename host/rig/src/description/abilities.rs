//! Capabilities of a described rig at its home pose: resolution of its sensors, and force.

use mortise_mechanism::kinematics::Model;
use mortise_protocol::limits::MAX_JOINTS;
use mortise_protocol::rig::{Rig, RigFault};
use serde::Serialize;

/// Number of steps per axis of the grid of force directions: corners, edges and faces of a cube.
const DIRECTIONS: i8 = 3;

/// Figures of a description.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Abilities {
    /// Name of the rig.
    pub name: String,
    /// Number of motors.
    pub joints: usize,
    /// Whether the handle's orientation is measured.
    pub senses_orientation: bool,
    /// Position of the handle at home, world, mm.
    pub home_mm: [f64; 3],
    /// Largest step of the handle for one count of any encoder, mm.
    pub resolution_mm: f64,
    /// Force that the motors can hold in their weakest direction among those in which the handle can move, N. Limited by the hardware
    /// limit.
    pub force_weakest_n: f64,
    /// Force in their strongest direction, N.
    pub force_strongest_n: f64,
    /// Coulomb friction at the handle, at most, N.
    pub friction_n: f64,
    /// Isotropy of the Jacobian, 0 (singular) to 1.
    pub isotropy: f64,
    /// Largest number of counts of any encoder in a tick.
    pub counts_per_tick: f64,
}

/// Computes the figures. Cost: one posture and 26 directions.
///
/// # Errors
/// See [`Model::new`].
pub fn abilities(rig: &Rig) -> Result<Abilities, RigFault> {
    let model = Model::new(rig)?;
    let mut home = [0.0; MAX_JOINTS];
    for (angle, joint) in home.iter_mut().zip(&rig.joints) {
        *angle = joint.home;
    }
    let wrist = rig.wrist.map_or([0.0; 3], |wrist| wrist.home);
    let posture = model.posture(home, wrist).ok_or(RigFault::Linkage)?;
    let mut found = Abilities {
        name: rig.name.to_string(),
        joints: rig.joints.len(),
        senses_orientation: rig.wrist.is_some(),
        home_mm: posture.position.to_array().map(|x| 1e3 * f64::from(x)),
        resolution_mm: 0.0,
        force_weakest_n: f64::INFINITY,
        force_strongest_n: 0.0,
        friction_n: 0.0,
        isotropy: f64::from(posture.isotropy),
        counts_per_tick: 0.0,
    };
    for (number, joint) in rig.joints.iter().enumerate() {
        let lever = f64::from(posture.jacobian.col(number).length());
        let step = 1e3 * lever * f64::from(joint.radians_per_count().abs());
        found.resolution_mm = found.resolution_mm.max(step);
        found.friction_n = found.friction_n.max(f64::from(joint.coulomb) / lever);
        found.counts_per_tick = found.counts_per_tick.max(f64::from(joint.counts_per_tick()));
    }
    for direction in directions() {
        // Only the component within J's column space counts, in which the handle can move; for one or two joints most directions have
        // little of it. The columns are orthogonalised to project onto it.
        let Some(direction) = within(&posture.jacobian, rig.joints.len(), direction) else {
            continue;
        };
        let torques = posture.torques(direction);
        let most = rig.joints.iter().enumerate().map(|(number, joint)| {
            let limit = joint.current_limit * joint.torque_per_ampere().abs();
            f64::from(limit) / f64::from(torques[number].abs())
        });
        let most = most.fold(f64::from(rig.ceilings.force), f64::min);
        found.force_weakest_n = found.force_weakest_n.min(most);
        found.force_strongest_n = found.force_strongest_n.max(most);
    }
    Ok(found)
}

fn directions() -> impl Iterator<Item = glam::Vec3> {
    let steps = |number: i8| f32::from(number - 1);
    (0..DIRECTIONS).flat_map(move |x| {
        (0..DIRECTIONS)
            .flat_map(move |y| (0..DIRECTIONS).map(move |z| glam::Vec3::new(steps(x), steps(y), steps(z))))
    })
}

/// `direction` projected onto the span of the first `joints` columns, as a unit vector; `None` when the projection vanishes.
fn within(jacobian: &glam::Mat3, joints: usize, direction: glam::Vec3) -> Option<glam::Vec3> {
    let mut basis: Vec<glam::Vec3> = Vec::new();
    for number in 0..joints {
        let column = jacobian.col(number);
        let rest = basis
            .iter()
            .fold(column, |rest, &unit| rest - unit * unit.dot(rest));
        basis.extend(rest.try_normalize());
    }
    let inside: glam::Vec3 = basis.iter().map(|&unit| unit * unit.dot(direction)).sum();
    (inside.length() > 0.1).then(|| inside.normalize())
}
