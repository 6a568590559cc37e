//! Quick rating of candidate poses: how much of one solid's surface then lies against the other, and whether they overlap deeply.
//!
//! Some hundred samples of the solid with the smaller surface, each face with at least its share by the square root of its area, so that a small key or
//! boss counts. Cost: at most one distance to the facets a sample; a pose with a deep overlap ends after some.

use glam::DAffine3;

use crate::gaps::Pair;
use crate::solid::{Sample, Solid};

/// Samples of a pose, about.
const SAMPLES: usize = 120;
/// Share of the weight that may be inside the other solid.
const MOST_INSIDE: f64 = 0.06;

/// Samples of the solid that is probed, and its side.
pub(crate) struct Screen {
    of_moving: bool,
    samples: Vec<Sample>,
    total: f64,
}

impl Screen {
    /// The samples to take.
    pub fn new(pair: &Pair<'_>) -> Self {
        let of_moving = pair.moving.area <= pair.fixed.area;
        let solid: &Solid = if of_moving { pair.moving } else { pair.fixed };
        let faces = solid.exact.shape().faces.len();
        let mut of_face: Vec<Vec<Sample>> = vec![Vec::new(); faces];
        for &sample in &solid.samples {
            of_face[sample.face as usize].push(sample);
        }
        let root = |face: usize| solid.exact.shape().faces[face].area_mm2.max(0.0).sqrt();
        let all: f64 = (0..faces).map(root).sum();
        let mut samples = Vec::new();
        for (face, own) in of_face.iter().enumerate() {
            let wanted = ((SAMPLES as f64 * root(face) / all) as usize).clamp(3, own.len().max(3));
            let stride = own.len().div_ceil(wanted).max(1);
            let taken: Vec<Sample> = own.iter().step_by(stride).copied().collect();
            let weight = root(face) / taken.len().max(1) as f64;
            samples.extend(taken.into_iter().map(|s| Sample { area: weight, ..s }));
        }
        // Mixed, so that a deep overlap shows early.
        let mixed = (0..samples.len()).map(|k| samples[(k * 61) % samples.len()]);
        let samples: Vec<Sample> = if samples.len() % 61 == 0 {
            samples
        } else {
            mixed.collect()
        };
        Self {
            of_moving,
            total: samples.iter().map(|s| s.area).sum(),
            samples,
        }
    }

    /// Share of the surface that lies against the other solid within `window` of `gap` mm; 0 where more than a little is deeper inside than `window`.
    pub fn rate(&self, pair: &Pair<'_>, pose: &DAffine3, gap: f64, window: f64) -> f64 {
        let (other, to) = if self.of_moving {
            (pair.fixed, *pose)
        } else {
            (pair.moving, pose.inverse())
        };
        let (mut inside, mut against) = (0.0, 0.0);
        for sample in &self.samples {
            let p = to.transform_point3(sample.p);
            if other.box_distance(p) > gap + window {
                continue;
            }
            let Some(near) = other.facets.hit(p, f64::MAX) else {
                continue;
            };
            if near.distance < -window {
                inside += sample.area;
                if inside > MOST_INSIDE * self.total {
                    return 0.0;
                }
            }
            let n = to.transform_vector3(sample.n);
            if near.distance < gap + window && near.distance > -window && near.normal.dot(n) < -0.85 {
                let off = (near.distance - gap).abs().min(near.distance.abs()) / window;
                against += sample.area * (1.0 - 0.5 * off.min(1.0));
            }
        }
        (against - 2.0 * inside).max(0.0) / self.total
    }
}
