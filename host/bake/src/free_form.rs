//! Free-form faces: where on its patch each triangle lies, and the nearest point of a face from its near triangles.

use glam::DVec3;
use mortise_brep::{Shape, Surface};
use rayon::prelude::*;

use crate::distance::NearTriangle;
use crate::patch::{OnPatch, Patch};

/// Most starts of one query on one face.
const MAX_STARTS: usize = 8;
/// STEP's customary accuracy times ten, mm: a patch farther than that and the tessellation's own error from its triangles is another surface.
const STRANGE_MM: f64 = 1e-2;

/// The free-form faces of a shape.
pub(crate) struct FreeForms {
    /// By face: its patch; `None` for analytic faces and for splines of which only the tessellation is known.
    patches: Vec<Option<Patch>>,
    /// By triangle: parameters under its centroid.
    seeds: Vec<[f64; 2]>,
}

impl FreeForms {
    /// Finds each triangle on the patch of its face. Cost: triangles times samples of the patch, 5 ns each.
    pub fn new(shape: &Shape) -> Self {
        let mesh = &shape.mesh;
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
                let grid = patch.grid();
                let mut own = Vec::new();
                for (t, triangle) in mesh.triangles.iter().enumerate() {
                    if mesh.triangle_face[t] != surface.face {
                        continue;
                    }
                    let [a, b, c] = triangle.map(|v| mesh.vertices[v as usize]);
                    let middle = (a + b + c) / 3.0;
                    let (start, _) = grid.iter().min_by(|(_, p), (_, q)| {
                        p.distance_squared(middle).total_cmp(&q.distance_squared(middle))
                    })?;
                    let on = patch.project(middle, *start);
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

    /// Whether `face` is known beyond its tessellation.
    pub fn patch(&self, face: u32) -> Option<&Patch> {
        self.patches[face as usize].as_ref()
    }

    /// Nearest point to `p`, a point at or near triangle `t`, of the patch of its face.
    pub fn beside(&self, face: u32, t: u32, p: DVec3) -> Option<OnPatch> {
        self.patch(face)
            .map(|patch| patch.project(p, self.seeds[t as usize]))
    }

    /// Local minima of the distance from `p` to `face`: one search from each of the face's triangles in `near` that may hold the nearest
    /// point, nearest first. `chord` is the most the tessellation leaves the face, mm.
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
        // A triangle that shares a corner with one already searched from leads to the same minimum.
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
