//! Free-form faces: the parameters of each triangle on its patch, and the nearest point of a face, searched from its near triangles.

use glam::DVec3;
use mortise_brep::{Shape, Surface};
use rayon::prelude::*;

use crate::patch::{OnPatch, Patch};
use crate::triangles::NearTriangle;

/// Most start points of one query on one face.
const MAX_STARTS: usize = 8;
/// Ten times the customary accuracy of STEP, mm: a patch farther from its triangles than that plus the tessellation's own error is a different
/// surface.
const STRANGE_MM: f64 = 1e-2;

/// The free-form faces of a shape.
pub(crate) struct FreeForms {
    /// Patch of each face; `None` for analytic faces and for splines known only by their tessellation.
    patches: Vec<Option<Patch>>,
    /// Parameters under the centroid of each triangle.
    seeds: Vec<[f64; 2]>,
}

/// Samples of a patch, sorted along the axis in which they extend farthest.
struct Samples {
    axis: usize,
    /// Parameters and place, and the number in the order of the patch.
    sorted: Vec<([f64; 2], DVec3, usize)>,
}

impl Samples {
    fn new(samples: Vec<([f64; 2], DVec3)>) -> Self {
        let (least, most) = (samples.iter())
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(least, most), (_, p)| {
                (least.min(*p), most.max(*p))
            });
        let axis = (most - least).max_position();
        let numbered = samples.into_iter().enumerate();
        let mut sorted: Vec<_> = numbered.map(|(number, (uv, p))| (uv, p, number)).collect();
        sorted.sort_by(|(_, a, _), (_, b, _)| a[axis].total_cmp(&b[axis]));
        Self { axis, sorted }
    }

    /// Parameters of the sample nearest to `p`, searched outwards from it along the axis; of equal ones, as at a pole, the first of the patch.
    fn nearest(&self, p: DVec3) -> Option<[f64; 2]> {
        let from = (self.sorted).partition_point(|(_, q, _)| q[self.axis] < p[self.axis]);
        let (below, above) = self.sorted.split_at(from);
        let (mut best, mut first, mut found) = (f64::INFINITY, usize::MAX, None);
        let mut search = |side: &mut dyn Iterator<Item = &([f64; 2], DVec3, usize)>| {
            for (uv, q, number) in side {
                if (q[self.axis] - p[self.axis]).powi(2) > best {
                    break;
                }
                let far = q.distance_squared(p);
                if far < best || far == best && *number < first {
                    (best, first, found) = (far, *number, Some(*uv));
                }
            }
        };
        search(&mut above.iter());
        search(&mut below.iter().rev());
        found
    }
}

impl FreeForms {
    /// Locates each triangle on the patch of its face. Cost: for each triangle about the square root of the number of samples of the patch, 5 ns each.
    pub fn new(shape: &Shape) -> Self {
        let mesh = &shape.mesh;
        let mut of_face: Vec<Vec<usize>> = vec![Vec::new(); shape.faces.len()];
        for (t, face) in mesh.triangle_face.iter().enumerate() {
            of_face[*face as usize].push(t);
        }
        let mut patches: Vec<Option<Patch>> = shape.faces.iter().map(|_| None).collect();
        let mut seeds = vec![[0.0; 2]; mesh.triangles.len()];
        let found: Vec<_> = shape
            .splines
            .par_iter()
            .filter(|s| {
                let face = shape.faces.get(s.face as usize);
                face.is_some_and(|f| f.surface == Surface::Spline)
            })
            .filter_map(|surface| {
                let patch = Patch::new(surface)?;
                let samples = Samples::new(patch.grid());
                let mut own = Vec::new();
                for &t in &of_face[surface.face as usize] {
                    let [a, b, c] = mesh.triangles[t].map(|v| mesh.vertices[v as usize]);
                    let middle = (a + b + c) / 3.0;
                    let on = patch.project(middle, samples.nearest(middle)?);
                    if on.point.distance(middle) > STRANGE_MM + 4.0 * shape.deflection_mm {
                        return None;
                    }
                    own.push((t, on.uv));
                }
                Some((surface.face, patch, own))
            })
            .collect();
        for (face, patch, own) in found {
            for (t, uv) in own {
                seeds[t] = uv;
            }
            patches[face as usize] = Some(patch);
        }
        Self { patches, seeds }
    }

    /// Exact patch of `face`; `None` where only its tessellation is known.
    pub fn patch(&self, face: u32) -> Option<&Patch> {
        self.patches[face as usize].as_ref()
    }

    /// Nearest point to `p`, a point at or near triangle `t`, of the patch of its face.
    pub fn beside(&self, face: u32, t: u32, p: DVec3) -> Option<OnPatch> {
        self.patch(face)
            .map(|patch| patch.project(p, self.seeds[t as usize]))
    }

    /// Local minima of the distance from `p` to `face`: one search from each of the face's triangles in `near` that may contain the nearest point,
    /// nearest first. `chord` is the largest deviation of the tessellation from the face, mm.
    pub fn feet(
        &self,
        face: u32,
        p: DVec3,
        chord: f64,
        triangles: &[[u32; 3]],
        near: &[NearTriangle],
        mut visit: impl FnMut(OnPatch),
    ) {
        let Some(patch) = self.patch(face) else { return };
        let mut own: Vec<(f64, u32)> = near
            .iter()
            .filter(|n| n.face == face)
            .map(|n| (n.distance, n.triangle))
            .collect();
        own.sort_by(|a, b| a.0.total_cmp(&b.0));
        // A triangle that shares a corner with one already searched leads to the same minimum.
        let mut seen: Vec<u32> = Vec::new();
        let mut starts = 0;
        let mut best = f64::INFINITY;
        for (distance, t) in own {
            let corners = triangles[t as usize];
            if corners.iter().any(|v| seen.contains(v)) {
                continue;
            }
            if starts == MAX_STARTS || distance > best + chord {
                break;
            }
            seen.extend(corners);
            starts += 1;
            let on = patch.project(p, self.seeds[t as usize]);
            best = best.min(on.point.distance(p));
            visit(on);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Against all samples; places of a coarse grid, so that many are equal and many are equally far.
        #[test]
        fn the_nearest_sample_is_the_first_of_the_nearest(
            places in prop::collection::vec(prop::array::uniform3(0u8..4), 0..60),
            p in prop::array::uniform3(-1i8..5),
        ) {
            let samples: Vec<([f64; 2], DVec3)> = (places.iter().enumerate())
                .map(|(number, place)| ([number as f64, 0.0], DVec3::from_array(place.map(f64::from))))
                .collect();
            let p = DVec3::from_array(p.map(f64::from));
            let brute = samples.iter().min_by(|(_, a), (_, b)| {
                a.distance_squared(p).total_cmp(&b.distance_squared(p))
            });
            let brute = brute.map(|(uv, _)| *uv);
            prop_assert_eq!(Samples::new(samples).nearest(p), brute);
        }
    }
}
