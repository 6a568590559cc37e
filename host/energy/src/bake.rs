//! From two densities and a way to an energy for an image.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use crate::baked::{BakedEnergy, MARGIN_MM, Way};
use crate::charges::{Sample, fit};
use crate::density::Density;
use crate::faults::ENOUGH_MM;
use crate::lattice::lattice;
use crate::stiffness::majorise;

/// Charges of an energy.
const CHARGES: usize = 384;
/// Places at which the moving part's density is looked at for its charges, about: the second set where the first leaves a fault.
const PLACES: [f64; 2] = [6000.0, 4000.0];
/// How far from the mating faces it has charges, mm.
const ABOUT_MM: f64 = 12.0;
/// Turn of the charges' lattice about an axis that is none of the part's.
const TURN_RAD: f64 = 0.297;
const TURN_ABOUT: DVec3 = DVec3::new(1.0, 2.0, 3.0);

/// Makes the energy of a moving part in a fixed one's density along a way. `None` where the two have no density for each other.
///
/// Where a minimum is, a few hundred places leave to chance: where one set has minima off the way another is tried, and the better one kept. Cost: 3 to 20 s on
/// two cores, most of it looking for minima.
pub fn bake(moving: &Density, fixed: &Density, way: &Way<'_>) -> Option<BakedEnergy> {
    let zone = zone(moving, way.mating);
    let (record, nodes) = lattice(fixed, zone, way)?;
    let empty = BakedEnergy {
        record,
        charges: Vec::new(),
        nodes,
        deviation: 0.0,
    };
    let mut best: Option<(f64, BakedEnergy)> = None;
    for places in PLACES {
        if best.as_ref().is_some_and(|(off, _)| *off < ENOUGH_MM) {
            break;
        }
        let found = fit(&empty, &strongest(moving, zone, places), way);
        best = (best.into_iter().chain(found)).min_by(|a, b| a.0.total_cmp(&b.0));
    }
    let (_, mut energy) = best?;
    majorise(&mut energy, way, moving.center_of_mass());
    Some(energy)
}

/// Corners of the box in which the moving part has charges, its frame, mm.
fn zone(moving: &Density, [low, high]: [DVec3; 2]) -> [DVec3; 2] {
    let [least, most] = moving.extent();
    [
        (low - ABOUT_MM).max(least - MARGIN_MM),
        (high + ABOUT_MM).min(most + MARGIN_MM),
    ]
}

fn strongest(moving: &Density, [low, high]: [DVec3; 2], places: f64) -> Vec<Sample> {
    let (middle, half) = (low.midpoint(high), 0.5 * (high - low));
    let step = ((high - low).element_product() / places).cbrt();
    let turned = DMat3::from_axis_angle(TURN_ABOUT.normalize(), TURN_RAD);
    let nodes = (half.length() / step).ceil() as i64;
    let places: Vec<DVec3> = (-nodes..=nodes)
        .flat_map(|x| (-nodes..=nodes).flat_map(move |y| (-nodes..=nodes).map(move |z| [x, y, z])))
        // Off the middle, where symmetric solids are.
        .map(|node| {
            turned * (step * (DVec3::from_array(node.map(|n| n as f64)) + DVec3::new(0.31, 0.17, 0.43)))
        })
        .filter(|place| place.abs().cmple(half).all())
        .map(|place| middle + place)
        .collect();
    let mut samples: Vec<Sample> = (places.into_par_iter())
        .map(|place| (place, moving.without_planes(place)))
        .collect();
    samples.sort_by(|a, b| b.1.norm().total_cmp(&a.1.norm()));
    samples.truncate(CHARGES);
    samples
}
