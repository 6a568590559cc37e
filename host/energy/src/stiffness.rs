//! Stiffness that majorises an energy, for each depth: sampled from one pose to another one.

use glam::{DAffine3, DVec3};
use mortise_protocol::image::ENERGY_DEPTHS;
use rayon::prelude::*;

use crate::baked::{ASIDE_MM, BakedEnergy, M_PER_MM, Numbers, Way, travels};
use crate::pose::moved;

/// Poses at which the stiffness is sampled, the largest displacement from each, mm, and rotation, rad; and the excess that is none, over the depth.
const STIFFNESS_POSES: usize = 3000;
const STIFFNESS_MM: f64 = 0.8;
const STIFFNESS_RAD: f64 = 0.03;
const STIFFNESS_SLACK: f64 = 1e-4;
/// Largest factor on stiffness for displacements and rotations at once.
const MOST_COUPLED: f64 = 3.0;

/// A pose beside the way: its depth on the scale of the tables, its force, and how much displacements from it exceed the linear model.
struct Beside {
    depth: f64,
    force: f64,
    /// Displacement, rotation vector, and twice the excess: across the way, along it, in rotation, and all at once.
    excess: [(DVec3, DVec3, f64); 4],
}

impl Beside {
    fn random(seed: u64, baked: &BakedEnergy, pose: &DAffine3, center_of_mass: DVec3) -> Self {
        let mut numbers = Numbers(seed);
        let axis = DVec3::from_array(baked.record.way.map(f64::from));
        let share = 0.5 + 0.5 * numbers.next();
        let middle = pose.transform_point3(center_of_mass);
        let by = numbers.vector() * (ASIDE_MM * share);
        let pose = moved(pose, by, numbers.vector() * (0.15 * share), middle);
        let about = pose.transform_point3(center_of_mass);
        let here = baked.at(&pose, about);
        let excess = [0, 1, 2, 3].map(|family| {
            let size = 0.55 + 0.45 * numbers.next();
            let by = numbers.vector().normalize_or_zero() * (STIFFNESS_MM * size);
            let turn = numbers.vector().normalize_or_zero() * (STIFFNESS_RAD * size);
            let along = axis * axis.dot(by);
            let (by, turn) = match family {
                0 => (by - along, DVec3::ZERO),
                1 => (along, DVec3::ZERO),
                2 => (DVec3::ZERO, turn),
                _ => (by, turn),
            };
            let there = baked.at(&moved(&pose, by, turn, about), about).energy;
            let linear = here.slope.dot(by) + here.turn.dot(turn);
            (by, turn, 2.0 * (there - here.energy - linear - STIFFNESS_SLACK))
        });
        Self {
            depth: (-here.energy).clamp(0.0, 1.0) * (ENERGY_DEPTHS - 1) as f64,
            force: here.slope.length(),
            excess,
        }
    }

    /// Entries of a table on either side of its depth, and the share of the second one.
    fn entries(&self) -> ([usize; 2], f64) {
        let below = self.depth.floor();
        ([below as usize, self.depth.ceil() as usize], self.depth - below)
    }
}

/// States the largest force, and the stiffness that majorises the energy at each depth.
pub(crate) fn majorise(baked: &mut BakedEnergy, way: &Way<'_>, center_of_mass: DVec3) {
    let axis = DVec3::from_array(baked.record.way.map(f64::from));
    let travels = travels(way);
    let this = &*baked;
    let seen: Vec<Beside> = (0..STIFFNESS_POSES)
        .into_par_iter()
        .map(|i| {
            let pose = (way.pose)(travels[i % travels.len()]);
            Beside::random(0x5eed_0000 + i as u64, this, &pose, center_of_mass)
        })
        .collect();
    let mut tables = [[0.0f64; ENERGY_DEPTHS]; 3];
    for seen in &seen {
        for (table, (by, turn, excess)) in tables.iter_mut().zip(seen.excess) {
            let squared = (by.length_squared() + turn.length_squared()).max(f64::MIN_POSITIVE);
            for entry in seen.entries().0 {
                table[entry] = table[entry].max(excess / squared);
            }
        }
    }
    // Displacements of both kinds at once need more where translation and rotation are coupled.
    let mut factors = [1.0f64; ENERGY_DEPTHS];
    for seen in &seen {
        let ([below, above], share) = seen.entries();
        let at = |table: &[f64; ENERGY_DEPTHS]| table[below] + share * (table[above] - table[below]);
        let (by, turn, excess) = seen.excess[3];
        let along = axis.dot(by) * axis.dot(by);
        let modelled = at(&tables[0]) * (by.length_squared() - along)
            + at(&tables[1]) * along
            + at(&tables[2]) * turn.length_squared();
        for entry in [below, above] {
            factors[entry] = factors[entry]
                .max(excess / modelled.max(f64::MIN_POSITIVE))
                .min(MOST_COUPLED);
        }
    }
    let table =
        |which: usize, unit: f64| core::array::from_fn(|i| (tables[which][i] * factors[i] * unit) as f32);
    let per_mm2 = 1.0 / (M_PER_MM * M_PER_MM);
    let record = &mut baked.record;
    record.across = table(0, per_mm2);
    record.along = table(1, per_mm2);
    record.turning = table(2, 1.0);
    let force = seen.iter().map(|seen| seen.force).fold(0.0, f64::max);
    record.largest_force = (force / M_PER_MM).max(1.0) as f32;
}
