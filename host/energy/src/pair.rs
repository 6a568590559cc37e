//! Energy, force and torque of a moving solid in the density of a fixed one (Behandish & Ilieş 2015, sections 2.3 and 2.4).

use glam::{DAffine3, DMat3, DVec3};
use nalgebra::Complex;
use rayon::prelude::*;

use crate::density::Density;
use crate::field::Field;

/// Share of the margin over which the density of the fixed solid falls to zero.
const FADE: f64 = 0.5;

/// Density of the moving solid at a place of its frame, times the volume that it stands for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Place, mm, in the moving solid's frame.
    pub at: DVec3,
    /// ρ₂ δV, mm³.
    pub charge: Complex<f64>,
}

/// What a pose costs, and what acts on the moving solid there.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Felt {
    /// Energy.
    pub energy: f64,
    /// Force, energy a millimetre, in the fixed solid's frame.
    pub force: DVec3,
    /// Torque about the origin of the moving solid's frame, energy a radian, in the fixed solid's frame.
    pub torque: DVec3,
}

/// Two solids.
#[derive(Clone, Debug)]
pub struct Pair {
    fixed: Field,
    samples: Vec<Sample>,
    scale: f64,
}

impl Pair {
    /// Prepares two solids: the density of the fixed one on a lattice of `step` mm that extends `margin` mm beyond it, that of the moving one on another
    /// lattice with the same step and margin, turned by `turned` so that no symmetry of both hides an error. The energy is `scale` times the negative
    /// score.
    pub fn new(
        fixed: &Density,
        moving: &Density,
        [step, margin]: [f64; 2],
        turned: DMat3,
        scale: f64,
    ) -> Self {
        let [low, high] = fixed.extent();
        let field = Field::of(fixed, [low - margin, high + margin], step, FADE * margin);
        Self {
            fixed: field,
            samples: samples(moving, [step, margin], turned),
            scale,
        }
    }

    /// Samples of the moving solid, the strongest first.
    pub fn samples(&self) -> &[Sample] {
        &self.samples
    }

    /// The same with the strongest samples alone, each as it is: what a board has time for.
    pub fn strongest(&self, count: usize) -> Self {
        Self {
            fixed: self.fixed.clone(),
            samples: self.samples.iter().take(count).copied().collect(),
            scale: self.scale,
        }
    }

    /// Energy and its negative gradient at a pose, which takes the moving solid's frame to the fixed one's: E = −s Σ Re(ρ₁(p) ρ₂ δV) over the samples, at
    /// p where the pose puts each.
    pub fn at(&self, pose: &DAffine3) -> Felt {
        let of = |sample: &Sample| {
            let p = pose.transform_point3(sample.at);
            let Some(here) = self.fixed.at(p) else {
                return Felt::default();
            };
            let real = |value: Complex<f64>| self.scale * (value * sample.charge).re;
            let force = DVec3::from_array(here.slope.map(real));
            Felt {
                energy: -real(here.value),
                force,
                torque: (p - pose.translation).cross(force),
            }
        };
        let add = |a: Felt, b: Felt| Felt {
            energy: a.energy + b.energy,
            force: a.force + b.force,
            torque: a.torque + b.torque,
        };
        // In pieces of fixed size, so that the sum does not depend on the number of cores.
        let pieces: Vec<Felt> = (self.samples.par_chunks(4096))
            .map(|piece| piece.iter().map(of).fold(Felt::default(), add))
            .collect();
        pieces.into_iter().fold(Felt::default(), add)
    }
}

/// Samples on a lattice, the strongest first.
fn samples(moving: &Density, [step, margin]: [f64; 2], turned: DMat3) -> Vec<Sample> {
    let [low, high] = moving.extent();
    let middle = low.midpoint(high);
    let half = (0.5 * (high - low)).to_array().map(|half| half + margin);
    // A cube that holds the box however it is turned.
    let nodes = (DVec3::from_array(half).length() / step).ceil() as i64;
    let places: Vec<DVec3> = (-nodes..=nodes)
        .flat_map(|x| (-nodes..=nodes).flat_map(move |y| (-nodes..=nodes).map(move |z| [x, y, z])))
        // Off the middle, where symmetric solids are.
        .map(|node| {
            turned * (step * (DVec3::from_array(node.map(|n| n as f64)) + DVec3::new(0.31, 0.17, 0.43)))
        })
        .filter(|place| place.abs().cmple(DVec3::from_array(half)).all())
        .collect();
    let volume = step.powi(3);
    let mut samples: Vec<Sample> = (places.into_par_iter())
        .map(|place| Sample {
            at: middle + place,
            charge: moving.at(middle + place) * volume,
        })
        .collect();
    samples.sort_by(|a, b| b.charge.norm().total_cmp(&a.charge.norm()));
    samples
}
