//! Pairs of near parts: the least gap or the deepest overlap of each, by exact distances.

use glam::DVec3;
use mortise_task::{Gap, Placed, refined};
use rayon::prelude::*;

/// Distance within which two surfaces touch, mm: a tenth of a micrometre, at which modellers treat points as identical.
pub const TOUCH_MM: f64 = 1e-4;

/// Two parts whose distance is within the range asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// Indices of the parts, the lower one first.
    pub parts: [usize; 2],
    /// Least signed distance and its place: the gap, or minus the depth of the deepest surface point of either in the other.
    pub least: Gap,
}

impl Pair {
    /// Whether the parts overlap by more than [`TOUCH_MM`].
    pub fn overlaps(&self) -> bool {
        self.least.distance_mm < -TOUCH_MM
    }

    /// Whether the surfaces touch: apart or into each other by [`TOUCH_MM`] at the most.
    pub fn touches(&self) -> bool {
        self.least.distance_mm.abs() <= TOUCH_MM
    }
}

/// All pairs of `parts` closer than `within` mm, those that overlap most first, then by gap. Each pair's samples are searched for the least distance,
/// from which a descent on the exact surfaces goes on ([`mortise_task::refined`]).
pub fn clearances(parts: &[Placed<'_>], within: f64) -> Vec<Pair> {
    let boxes: Vec<_> = parts.iter().map(bounds).collect();
    let mut near = Vec::new();
    for b in 0..parts.len() {
        for a in 0..b {
            let apart = (boxes[a].0 - boxes[b].1).max(boxes[b].0 - boxes[a].1);
            if apart.max(DVec3::ZERO).length() < within {
                near.push([a, b]);
            }
        }
    }
    let mut found: Vec<Pair> = near
        .par_iter()
        .filter_map(|&[a, b]| {
            let least = refined(parts[a], parts[b], within)?;
            Some(Pair { parts: [a, b], least })
        })
        .collect();
    found.sort_by(|s, t| s.least.distance_mm.total_cmp(&t.least.distance_mm));
    found
}

/// Box of a placed body in the assembly's frame.
fn bounds(part: &Placed<'_>) -> (DVec3, DVec3) {
    let (low, high) = part.body.bounds();
    let center = part.pose.transform_point3((low + high) / 2.0);
    let half = (high - low) / 2.0;
    let m = part.pose.matrix3;
    let reach = m.x_axis.abs() * half.x + m.y_axis.abs() * half.y + m.z_axis.abs() * half.z;
    (center - reach, center + reach)
}
