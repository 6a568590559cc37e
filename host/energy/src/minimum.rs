//! The least energy near a pose, by steps along the coordinates.

use std::f64::consts::TAU;

use glam::{DAffine3, DVec3};

use crate::pose::moved;

/// Arm at which tilts count as displacements, mm, and the first step of the search, mm.
pub(crate) const TILT_ARM_MM: f64 = 10.0;
const SEARCH_MM: f64 = 0.5;
/// Displacements from which a search across the way may begin: about the pose at this distance, mm, in so many directions.
const RING_MM: f64 = 0.25;
const RING: u32 = 8;

/// Displacements from a pose: two across the way and two of tilt, times [`TILT_ARM_MM`]; mm.
pub(crate) type Displacement = [f64; 4];

/// A pose from which displacements are taken.
pub(crate) struct Start {
    pose: DAffine3,
    /// Axes across the way, and the point about which it tilts.
    axes: [DVec3; 2],
    about: DVec3,
}

impl Start {
    pub(crate) fn new(pose: DAffine3, way: DVec3, about: DVec3) -> Self {
        let (u, v) = way.any_orthonormal_pair();
        Self {
            pose,
            axes: [u, v],
            about,
        }
    }

    pub(crate) fn displaced(&self, x: &Displacement) -> DAffine3 {
        let [u, v] = self.axes;
        let turn = (u * x[2] + v * x[3]) / TILT_ARM_MM;
        moved(&self.pose, u * x[0] + v * x[1], turn, self.about)
    }

    /// To the least energy near the pose, by steps along all coordinates, to within `fine_mm`.
    pub(crate) fn lowest(&self, energy: impl Fn(&DAffine3) -> f64, fine_mm: f64) -> Displacement {
        self.descend([0.0; 4], 4, energy, fine_mm)
    }

    /// To the least energy across the way, without tilt; also from a little beside the pose, since the energy's lattice has kinks.
    pub(crate) fn lowest_across(&self, energy: impl Fn(&DAffine3) -> f64, fine_mm: f64) -> Displacement {
        let ring = (0..RING).map(|i| {
            let (sin, cos) = (TAU * f64::from(i) / f64::from(RING)).sin_cos();
            [RING_MM * cos, RING_MM * sin, 0.0, 0.0]
        });
        let starts = std::iter::once([0.0; 4]).chain(ring);
        let least = starts
            .map(|x| (energy(&self.displaced(&x)), x))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        let from = least.map_or([0.0; 4], |(_, x)| x);
        self.descend(from, 2, energy, fine_mm)
    }

    /// From a displacement, by the first `free` coordinates.
    fn descend(
        &self,
        from: Displacement,
        free: usize,
        energy: impl Fn(&DAffine3) -> f64,
        fine_mm: f64,
    ) -> Displacement {
        let (mut at, mut step) = (from, SEARCH_MM);
        let of = |x: &Displacement| energy(&self.displaced(x));
        let mut value = of(&at);
        while step > fine_mm {
            let before = value;
            for k in 0..free {
                for sign in [step, -step] {
                    let mut next = at;
                    next[k] += sign;
                    let there = of(&next);
                    if there < value {
                        (at, value) = (next, there);
                    }
                }
            }
            if value == before {
                step *= 0.5;
            }
        }
        at
    }
}
