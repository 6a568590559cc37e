//! The lattice of the fixed part's density, in bytes as an image has it.

use glam::DVec3;
use mortise_protocol::image::EnergyRecord;
use nalgebra::Complex;
use rayon::prelude::*;

use crate::baked::{ASIDE_MM, BEYOND_MM, M_PER_MM, MARGIN_MM, Way, travels};
use crate::density::Density;

/// Nodes at most: with all charges 31.9 KiB.
const NODES: usize = 12_400;
/// No farther from the fixed part than its density is of use, mm.
const REACH_MM: f64 = BEYOND_MM + ASIDE_MM + MARGIN_MM;

/// Lattice of the fixed part's density over all that the zone of the charges passes.
pub(crate) fn lattice(
    fixed: &Density,
    zone: [DVec3; 2],
    way: &Way<'_>,
) -> Option<(EnergyRecord, Vec<[i8; 2]>)> {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for travel in travels(way) {
        let pose = (way.pose)(travel);
        for corner in 0..8 {
            let [x, y, z] = [0, 1, 2].map(|axis| zone[corner >> axis & 1][axis]);
            let place = pose.transform_point3(DVec3::new(x, y, z));
            (low, high) = (low.min(place), high.max(place));
        }
    }
    let [least, most] = fixed.extent();
    let low = (low - ASIDE_MM).max(least - REACH_MM);
    let high = (high + ASIDE_MM).min(most + REACH_MM);
    let extent = high - low;
    if !extent.cmpgt(DVec3::ZERO).all() {
        return None;
    }
    let counts = |step: f64| (extent / step).ceil().to_array().map(|n| n as usize + 1);
    let mut step = (extent.element_product() / NODES as f64).cbrt();
    while counts(step).into_iter().product::<usize>() > NODES {
        step *= 1.005;
    }
    let size = counts(step);
    let [width, height, depth] = size;
    let values: Vec<Complex<f64>> = (0..width * height * depth)
        .into_par_iter()
        .map(|i| {
            let node = [i % width, i / width % height, i / width / height];
            // It falls to zero over the outermost two steps, so that the energy does not jump where a charge leaves the lattice.
            let inside = [0, 1, 2].map(|axis| node[axis].min(size[axis] - 1 - node[axis]));
            let share = 0.5 * inside.into_iter().min().unwrap_or(0) as f64;
            let share = share.min(1.0) * share.min(1.0) * (3.0 - 2.0 * share.min(1.0));
            if share == 0.0 {
                return Complex::ZERO;
            }
            let place = low + step * DVec3::from_array(node.map(|n| n as f64));
            fixed.without_planes(place) * share
        })
        .collect();
    let most = values
        .iter()
        .map(|v| v.re.abs().max(v.im.abs()))
        .fold(0.0, f64::max);
    if most <= 0.0 {
        return None;
    }
    let unit = |v: f64| (127.0 * v / most).round() as i8;
    let nodes = values.iter().map(|v| [unit(v.re), unit(v.im)]).collect();
    let record = EnergyRecord {
        origin: (low * M_PER_MM).as_vec3().to_array(),
        step: (step * M_PER_MM) as f32,
        size: size.map(|n| n as u16),
        way: way.outward.as_vec3().to_array(),
        // Until it is known.
        largest_force: 1.0,
        ..EnergyRecord::default()
    };
    Some((record, nodes))
}

/// The same for many look-ups on a PC.
pub(crate) struct Lattice {
    origin_mm: DVec3,
    per_mm: f64,
    size: [usize; 3],
    nodes: Vec<[f32; 2]>,
}

impl Lattice {
    pub(crate) fn new(record: &EnergyRecord, nodes: &[[i8; 2]]) -> Self {
        Self {
            origin_mm: DVec3::from_array(record.origin.map(f64::from)) / M_PER_MM,
            per_mm: M_PER_MM / f64::from(record.step),
            size: record.size.map(usize::from),
            nodes: nodes.iter().map(|node| node.map(f32::from)).collect(),
        }
    }

    /// Density at a place of the fixed part's frame, mm, linear between nodes as on a board; zero beyond the lattice.
    pub(crate) fn at(&self, place: DVec3) -> [f32; 2] {
        let place = ((place - self.origin_mm) * self.per_mm).as_vec3().to_array();
        let [width, height, depth] = self.size;
        if !place.iter().all(|x| *x >= 0.0) {
            return [0.0; 2];
        }
        let [i, j, k] = place.map(|x| x as usize);
        if i + 1 >= width || j + 1 >= height || k + 1 >= depth {
            return [0.0; 2];
        }
        let [x, y, z] = [place[0] - i as f32, place[1] - j as f32, place[2] - k as f32];
        let first = i + width * (j + height * k);
        let between = |a: [f32; 2], b: [f32; 2], t: f32| [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])];
        let row = |at: usize| between(self.nodes[at], self.nodes[at + 1], x);
        let face = |at: usize| between(row(at), row(at + width), y);
        between(face(first), face(first + width * height), z)
    }
}

#[cfg(test)]
mod tests {
    use mortise_protocol::image::Energy;

    use super::*;

    #[test]
    fn it_answers_as_a_board_does() {
        let mut random = fastrand::Rng::with_seed(8);
        let record = EnergyRecord {
            origin: [0.01, -0.02, 0.03],
            step: 0.0015,
            size: [5, 4, 6],
            way: [0.0, 0.0, 1.0],
            largest_force: 1.0,
            ..EnergyRecord::default()
        };
        let nodes: Vec<[i8; 2]> = (0..120).map(|_| [random.i8(..), random.i8(..)]).collect();
        let (lattice, energy) = (
            Lattice::new(&record, &nodes),
            Energy::new(&record, &[], &nodes).unwrap(),
        );
        let mut inside = 0;
        for _ in 0..2000 {
            let node = [5.0, 4.0, 6.0].map(|size| random.f64() * (size + 1.0) - 1.0);
            let place = (DVec3::from_array(node) * 1.5) + DVec3::new(10.0, -20.0, 30.0);
            let [re, im] = lattice.at(place);
            // At the border a board's coordinates may round to the other side.
            if node
                .iter()
                .zip([4.0, 3.0, 5.0])
                .any(|(x, last)| x.abs() < 1e-3 || (x - last).abs() < 1e-3)
            {
                continue;
            }
            for (charge, found) in [([1.0, 0.0], re), ([0.0, -1.0], im)] {
                let own = energy.at(node.map(|x| x as f32), charge);
                inside += u32::from(own.is_some());
                let own = own.map_or(0.0, |(value, _)| value);
                assert!((own - found).abs() < 0.01, "{node:?}: {own} {found}");
            }
        }
        assert!(inside > 500, "{inside}");
    }
}
