//! A density on a lattice, interpolated between its nodes.
//!
//! Beside a plane the density does not fade with the distance, so that a lattice that just ended would make the energy jump where a sample leaves it. Over
//! its outermost millimetres the density falls to zero instead: the energy is continuous, and its gradient conserves it.

use glam::DVec3;
use nalgebra::Complex;
use rayon::prelude::*;

use crate::density::Density;

/// Values on a lattice; zero beyond it.
#[derive(Clone, Debug)]
pub struct Field {
    origin: DVec3,
    step: f64,
    size: [usize; 3],
    /// x fastest.
    values: Vec<Complex<f64>>,
}

/// A value and its gradient, one complex number an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sloped {
    /// The value.
    pub value: Complex<f64>,
    /// Its derivatives along x, y and z, 1/mm.
    pub slope: [Complex<f64>; 3],
}

impl Field {
    /// The density at the nodes of a lattice over a box, whose last nodes may lie beyond it; it falls to zero over the outermost `fade` mm. Cost: that of
    /// [`Density::at`] at each node, on all cores.
    pub fn of(density: &Density, [low, high]: [DVec3; 2], step: f64, fade: f64) -> Self {
        let size = ((high - low) / step)
            .ceil()
            .max(DVec3::ONE)
            .to_array()
            .map(|n| n as usize + 1);
        let [width, height, depth] = size;
        let values = (0..width * height * depth)
            .into_par_iter()
            .map(|i| {
                let node = [i % width, i / width % height, i / width / height];
                let in_nodes = [0, 1, 2].map(|axis| node[axis].min(size[axis] - 1 - node[axis]));
                let in_mm = step * in_nodes.into_iter().min().unwrap_or(0) as f64;
                let share = (in_mm / fade.max(step)).min(1.0);
                // Smooth at both ends.
                let share = share * share * (3.0 - 2.0 * share);
                if share == 0.0 {
                    return Complex::ZERO;
                }
                density.at(low + step * DVec3::from_array(node.map(|n| n as f64))) * share
            })
            .collect();
        Self {
            origin: low,
            step,
            size,
            values,
        }
    }

    /// The value at `p` by cubic interpolation along each axis (Catmull & Rom 1974), which has no kinks, and its gradient; `None` beyond the lattice. Cost: 64
    /// nodes.
    pub fn at(&self, p: DVec3) -> Option<Sloped> {
        let at = (p - self.origin) / self.step;
        let floor = at.floor();
        let last = DVec3::from_array(self.size.map(|n| n as f64 - 2.0));
        if !(floor.cmpge(DVec3::ZERO).all() && floor.cmple(last).all()) {
            return None;
        }
        let part = (at - floor).to_array();
        let first = floor.to_array().map(|n| n as usize);
        let [x, y, z] = part.map(weights);
        let mut found = Sloped::default();
        for (k, (wz, dz)) in z.into_iter().enumerate() {
            for (j, (wy, dy)) in y.into_iter().enumerate() {
                for (i, (wx, dx)) in x.into_iter().enumerate() {
                    // One node before the first to two after it; beyond the lattice all is zero, as on its border.
                    let node = [first[0] + i, first[1] + j, first[2] + k];
                    let is_inside = (0..3).all(|axis| (1..=self.size[axis]).contains(&node[axis]));
                    if !is_inside {
                        continue;
                    }
                    let [i, j, k] = node.map(|n| n - 1);
                    let value = self.values[i + self.size[0] * (j + self.size[1] * k)];
                    found.value += value * (wx * wy * wz);
                    for (slope, weight) in
                        (found.slope.iter_mut()).zip([dx * wy * wz, wx * dy * wz, wx * wy * dz])
                    {
                        *slope += value * (weight / self.step);
                    }
                }
            }
        }
        Some(found)
    }
}

/// Weights of the four nodes about a place, `t` of the way from the second to the third, and their derivatives.
fn weights(t: f64) -> [(f64, f64); 4] {
    [
        (
            0.5 * t * (-1.0 + t * (2.0 - t)),
            0.5 * (-1.0 + t * (4.0 - 3.0 * t)),
        ),
        (1.0 + 0.5 * t * t * (-5.0 + 3.0 * t), 0.5 * t * (-10.0 + 9.0 * t)),
        (
            0.5 * t * (1.0 + t * (4.0 - 3.0 * t)),
            0.5 * (1.0 + t * (8.0 - 9.0 * t)),
        ),
        (0.5 * t * t * (t - 1.0), 0.5 * t * (3.0 * t - 2.0)),
    ]
}
