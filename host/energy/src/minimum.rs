//! The least energy near a pose, by steps along the coordinates.

use glam::{DAffine3, DVec3};

use crate::pose::moved;

/// Arm at which tilts count as displacements, mm, and the first step of the search, mm.
pub(crate) const TILT_ARM_MM: f64 = 10.0;
const SEARCH_MM: f64 = 0.5;

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

    /// To the least energy near the pose, by the first `free` coordinates, to within `fine_mm`.
    pub(crate) fn lowest(
        &self,
        energy: impl Fn(&DAffine3) -> f64,
        free: usize,
        fine_mm: f64,
    ) -> Displacement {
        let (mut at, mut step) = ([0.0; 4], SEARCH_MM);
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
