//! How deep a disc lies inside a part.

use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::f64::consts::TAU;

use glam::DVec3;

/// Points of a disc's rim that are looked at first, and accuracy of its least depth as a share of it.
const DISC_RIM: usize = 24;
const DISC_SHARE: f64 = 0.1;

/// A lower bound of the depth of a disc's points below the surface, mm; 0 where it is not inside, or less deep than `counts_mm`. The depth changes by no more than its point moves: of the pieces
/// of the disc the one that may be least deep is divided, until it is known to [`DISC_SHARE`] or after as many divisions as `divisions`.
///
/// Cost: of a disc as deep as its rim is wide some tens of distances, of a disc 30 µm inside a rim of radius 3 mm some ten thousand.
pub(crate) fn disc_depth(
    distance: &dyn Fn(DVec3) -> f64,
    center: DVec3,
    normal: DVec3,
    radius: f64,
    counts_mm: f64,
    divisions: usize,
) -> f64 {
    let x = normal.any_orthonormal_vector();
    let y = normal.cross(x);
    let depth = |r: f64, angle: f64| {
        let (s, c) = angle.sin_cos();
        -distance(center + (x * c + y * s) * r)
    };
    // Most discs that are too large are too large at the rim.
    let rim = (0..DISC_RIM).map(|i| depth(radius, TAU * i as f64 / DISC_RIM as f64));
    let mut least = rim.fold(f64::INFINITY, f64::min);
    let mut open = BinaryHeap::from([Piece::new([0.0, radius], [0.0, TAU], &depth)]);
    for _ in 0..divisions {
        let Some(piece) = open.peek() else { break };
        least = least.min(piece.depth);
        if least < counts_mm {
            return 0.0;
        }
        if least - piece.bound() <= DISC_SHARE * least {
            break;
        }
        if let Some(piece) = open.pop() {
            open.extend(piece.halves(&depth));
        }
    }
    open.peek().map_or(0.0, |piece| piece.bound().max(0.0))
}

/// A piece of a disc: between two radii and two angles.
struct Piece {
    radii: [f64; 2],
    angles: [f64; 2],
    /// Depth at its middle, mm.
    depth: f64,
    /// Distance of its farthest point from there, at most, mm.
    reach: f64,
}

impl Piece {
    fn new(radii: [f64; 2], angles: [f64; 2], depth: &dyn Fn(f64, f64) -> f64) -> Self {
        let [[r, across], [angle, turn]] = [radii, angles].map(|[a, b]| [(a + b) / 2.0, (b - a) / 2.0]);
        Self {
            radii,
            angles,
            depth: depth(r, angle),
            reach: across + (radii[1] * turn).min(2.0 * radii[1]),
        }
    }

    /// No point of it is less deep, mm.
    fn bound(&self) -> f64 {
        self.depth - self.reach
    }

    /// Its halves across its longer side.
    fn halves(&self, depth: &dyn Fn(f64, f64) -> f64) -> [Self; 2] {
        let halve = |[a, b]: [f64; 2]| [[a, (a + b) / 2.0], [(a + b) / 2.0, b]];
        if self.radii[1] - self.radii[0] > self.radii[1] * (self.angles[1] - self.angles[0]) {
            halve(self.radii).map(|radii| Self::new(radii, self.angles, depth))
        } else {
            halve(self.angles).map(|angles| Self::new(self.radii, angles, depth))
        }
    }
}

/// By the bound of the depth: the piece that may be least deep is the greatest.
impl Ord for Piece {
    fn cmp(&self, other: &Self) -> Ordering {
        other.bound().total_cmp(&self.bound())
    }
}

impl PartialOrd for Piece {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Eq for Piece {}

impl PartialEq for Piece {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// In a ball the rim of a disc is least deep, in a slab all of it where it lies flat; the bound is below that by no more than it may be.
        #[test]
        fn the_bound_is_near_the_least_depth(
            radius in 0.5..5.0f64,
            height in 0.0..3.0f64,
            excess in 0.002..1.0f64,
            aside in 0.0..1.0f64,
            (u, v) in (-1.0..1.0f64, 0.0..TAU),
        ) {
            let normal = DVec3::new((1.0 - u * u).sqrt() * v.cos(), (1.0 - u * u).sqrt() * v.sin(), u);
            let check = |distance: &dyn Fn(DVec3) -> f64, center: DVec3, depth: f64| {
                let bound = disc_depth(distance, center, normal, radius, 1e-3, 200_000);
                bound <= depth + 1e-9 && (bound >= (1.0 - DISC_SHARE) * depth - 1e-9 || depth < 1.2e-3)
            };
            let ball = radius.hypot(height) + excess;
            prop_assert!(check(&|p: DVec3| p.length() - ball, normal * height, excess));
            let half = radius * (0.3 + excess);
            let slab = |p: DVec3| p.dot(normal).abs() - half;
            prop_assert!(check(&slab, normal * aside * half * 0.5, half * (1.0 - 0.5 * aside)));
            // A disc that reaches out of the material is not inside.
            let small = |p: DVec3| p.length() - 0.99 * radius;
            prop_assert_eq!(disc_depth(&small, DVec3::ZERO, normal, radius, 1e-3, 200_000), 0.0);
        }
    }
}
