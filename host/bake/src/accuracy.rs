//! Error bounds of a model, and the coarsest cell whose error stays within a bound.
//!
//! | error | bound |
//! |---|---|
//! | trilinear interpolation of the exact distance | cell²/8·Σ\|κᵢ\|/(1 − \|κᵢ\|·r) over both principal curvatures: the fractions sum to the distance's second derivatives along the axes; r = (¼ + √3) cells is the greatest distance from the surface of a corner of a cell that has a point within a quarter of a cell of it |
//! | number step | half a step: [`SampleFormat`] |
//! | 32-bit positions | 4·2⁻²⁴ of the shape's size |
//! | shell, round in hollow | ε·(1 − R₁/R₂): rims are sampled with spacing s² = 8ε·R₁ and touch a curve of nearly the same curvature |
//! | shell, all other contacts | ε |
//!
//! The bounds hold within a quarter of a cell of the surface, where the nearest point is inside a face that bends less than half a radian per cell.
//! Within a cell of a sharp edge, or where two surfaces are equally near, interpolation smooths the crease: the error is up to half a cell.

use mortise_brep::Surface;

use crate::distance::ExactSurface;
use crate::format::{FieldOptions, SampleFormat, Samples};
use crate::surface::{parameters, principal_curvatures};

/// Distance from the surface, in cells, up to which the bounds hold: touching parts are nearer than that.
pub const NEAR_CELLS: f64 = 0.25;
/// Distance of the farthest corner of a cell that near to the surface, in cells.
pub(crate) const REACH_CELLS: f64 = NEAR_CELLS + 1.733;
/// Distance from a cone's tip, as a fraction of its largest radius, within which the cone is treated as an edge.
const TIP: f64 = 1.0 / 8.0;

/// Largest absolute principal curvatures over a face, 1/mm; 0 for splines, whose curvature is already lost in their tessellation.
pub(crate) fn face_bend(surface: &ExactSurface, face: u32) -> [f64; 2] {
    let shape = surface.shape();
    let kind = &shape.faces[face as usize].surface;
    let own = (0..shape.mesh.triangles.len()).filter(|&t| shape.mesh.triangle_face[t] == face);
    let mut all: Vec<[f64; 2]> = own
        .flat_map(|t| shape.mesh.triangles[t])
        .filter_map(|v| parameters(kind, shape.mesh.vertices[v as usize]))
        .map(|[_, v]| principal_curvatures(kind, v).map(f64::abs))
        .collect();
    if let Surface::Cone { .. } = kind {
        let least = all.iter().map(|k| k[0]).fold(f64::INFINITY, f64::min);
        for k in &mut all {
            k[0] = k[0].min(least / TIP);
        }
    }
    all.into_iter()
        .fold([0.0; 2], |a, b| [a[0].max(b[0]), a[1].max(b[1])])
}

/// Largest interpolation error near a surface with principal curvatures `bend`, mm; infinite where a cell does not resolve it.
pub(crate) fn interpolation_error(cell_mm: f64, bend: [f64; 2]) -> f64 {
    let reach = REACH_CELLS * cell_mm;
    let of = |k: f64| {
        let left = 1.0 - k * reach;
        if left > 0.0 { k / left } else { f64::INFINITY }
    };
    cell_mm * cell_mm / 8.0 * (of(bend[0]) + of(bend[1]))
}

/// Half a step of the samples, mm.
pub(crate) fn step_error(cell_mm: f64, band_cells: f64, format: SampleFormat) -> f64 {
    let options = FieldOptions {
        cell_mm,
        band_cells,
        format,
        patch_tolerance_mm: 0.0,
        samples: Samples::Everywhere,
        finer: None,
    };
    0.5 * cell_mm / options.units_per_cell()
}

/// Rounding of positions to 32 bits, mm, for a shape of this size.
pub(crate) fn rounding_error(size_mm: f64) -> f64 {
    4.0 * size_mm * f64::from(f32::EPSILON) / 2.0
}

/// Whether a cell can resolve a surface with principal curvatures `bend` at an error of `accuracy_mm`. If the required cell were more than half a
/// radian wide, the field treats the surface as an edge.
pub(crate) fn is_resolvable(accuracy_mm: f64, bend: [f64; 2]) -> bool {
    let sharper = bend[0].max(bend[1]);
    sharper <= 0.0 || (8.0 * accuracy_mm / sharper).sqrt() * sharper <= 0.5
}

/// Largest cell, at most `most`, whose `error` is within `bound`; errors increase with the cell.
pub(crate) fn largest_cell(most: f64, bound: f64, error: impl Fn(f64) -> f64) -> f64 {
    if error(most) <= bound {
        return most;
    }
    let (mut low, mut high) = (0.0, most);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if error(middle) <= bound {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_a_millimetre_errs_three_micrometres_on_the_thesis_hole() {
        let e = interpolation_error(0.5, [1.0 / 9.375, 0.0]);
        // cell²/(8R) = 3.33 µm at the surface, more at the cell's far corner.
        assert!(e > 3.33e-3 && e < 3.75e-3, "{e}");
        assert_eq!(interpolation_error(0.5, [0.0; 2]), 0.0);
        assert_eq!(interpolation_error(5.0, [0.2, 0.0]), f64::INFINITY);
    }

    #[test]
    fn steps_are_as_the_formats_say() {
        let step = |band, format| 1.0 / (2.0 * step_error(1.0, band, format));
        assert_eq!(step(2.0, SampleFormat::Int8), 34.0);
        assert_eq!(step(1.0, SampleFormat::Int8), 46.0);
        assert_eq!((step(2.0, SampleFormat::Int16) / 100.0).round(), 88.0);
    }

    #[test]
    fn the_largest_cell_is_the_largest() {
        let error = |h: f64| interpolation_error(h, [0.1, 0.0]);
        let h = largest_cell(10.0, 0.005, error);
        assert!(error(h) <= 0.005 && error(h * 1.0001) > 0.005);
        assert_eq!(largest_cell(0.1, 0.005, error), 0.1);
    }
}
