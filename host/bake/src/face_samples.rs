//! Points inside faces: a lattice in the surface's parameters, kept where it falls inside the trim.

use std::f64::consts::TAU;

use mortise_brep::Surface;
use mortise_protocol::image::NO_FACE;

use crate::distance::ExactSurface;
use crate::pointshell::{PointshellOptions, ShellPoint};
use crate::surface::{angle_range, at_parameters, natural_normal, parameters};

/// Most rows of a lattice, and most points of a row: a face that would need more is sampled more sparsely.
const MAX_ROWS: f64 = 2000.0;

/// Appends the points inside `face`.
pub(crate) fn sample_face(
    surface: &ExactSurface,
    face: u32,
    options: &PointshellOptions,
    out: &mut Vec<ShellPoint>,
) {
    let kind = surface.shape().faces[face as usize].surface;
    match kind {
        Surface::Spline => crate::spline_samples::sample_spline(surface, face, options, out),
        _ => sample_analytic(surface, face, &kind, options, out),
    }
}

fn sample_analytic(
    surface: &ExactSurface,
    face: u32,
    kind: &Surface,
    options: &PointshellOptions,
    out: &mut Vec<ShellPoint>,
) {
    let Some(Range { u, v, around }) = parameter_range(surface, face, kind) else {
        return;
    };
    let rows = count(v.1 * v_scale(kind), v_spacing(kind, options));
    for row in 0..rows {
        let at_v = v.0 + v.1 * (row as f64 + 0.5) / rows as f64;
        let (scale, curvature) = u_scale(kind, at_v);
        let columns = count(u.1 * scale, options.spacing(curvature));
        // Every other row is shifted by half a step where the row closes on itself: the same count covers more.
        let shift = if around && row % 2 == 1 { 0.0 } else { 0.5 };
        for column in 0..columns {
            let at_u = u.0 + u.1 * (column as f64 + shift) / columns as f64;
            let Some(position) = at_parameters(kind, [at_u, at_v]) else {
                continue;
            };
            if !surface.contains(face, position) {
                continue;
            }
            let sense = surface.topology.sense[face as usize];
            if let Some(normal) = natural_normal(kind, position) {
                out.push(ShellPoint {
                    position,
                    normal: normal * sense,
                    face: face as u16,
                    edge_face: NO_FACE,
                });
            }
        }
    }
}

fn count(length: f64, spacing: f64) -> usize {
    (length / spacing - 1e-9).ceil().clamp(1.0, MAX_ROWS) as usize
}

/// Start and span of both parameters; whether the first goes all the way round.
struct Range {
    u: (f64, f64),
    v: (f64, f64),
    around: bool,
}

fn parameter_range(surface: &ExactSurface, face: u32, kind: &Surface) -> Option<Range> {
    let mesh = &surface.shape().mesh;
    let own = mesh
        .triangles
        .iter()
        .zip(&mesh.triangle_face)
        .filter(|&(_, &f)| f == face)
        .flat_map(|(t, _)| t.iter().map(|&v| mesh.vertices[v as usize]));
    let mut corners: Vec<[f64; 2]> = own.filter_map(|p| parameters(kind, p)).collect();
    if corners.is_empty() {
        return None;
    }
    corners.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    corners.dedup();
    let span = |i: usize| {
        let lo = corners.iter().map(|c| c[i]).fold(f64::INFINITY, f64::min);
        let hi = corners.iter().map(|c| c[i]).fold(f64::NEG_INFINITY, f64::max);
        (lo, hi - lo)
    };
    // Vertices of a face that goes round leave gaps of a facet; one wider than a third of the circle is an opening.
    let angle = |i: usize| angle_range(&mut corners.iter().map(|c| c[i]).collect::<Vec<_>>(), TAU / 3.0);
    let pole = matches!(kind, Surface::Sphere { .. });
    let (u, v) = match kind {
        Surface::Plane { .. } => (span(0), span(1)),
        Surface::Torus { .. } => (angle(0), angle(1)),
        _ => (angle(0), span(1)),
    };
    let mut v = v;
    if pole {
        // A pole inside the face need not be one of its vertices, and an arc may bulge towards it: take the whole range there.
        v = (-TAU / 4.0, TAU / 2.0);
    }
    if matches!(
        kind,
        Surface::Cylinder { .. } | Surface::Cone { .. } | Surface::Torus { .. }
    ) && u.1 < TAU
    {
        // Arcs of the boundary may bulge beyond their vertices by a facet.
        let facet = u.1 / 8.0;
        return Some(Range {
            u: (u.0 - facet, (u.1 + 2.0 * facet).min(TAU)),
            v,
            around: false,
        });
    }
    Some(Range {
        u,
        v,
        around: u.1 >= TAU && !matches!(kind, Surface::Plane { .. }),
    })
}

/// Millimetres along the surface for each unit of v.
fn v_scale(kind: &Surface) -> f64 {
    match *kind {
        Surface::Cone { half_angle, .. } => 1.0 / half_angle.cos().abs().max(1e-3),
        Surface::Sphere { radius, .. } => radius,
        Surface::Torus { minor, .. } => minor,
        _ => 1.0,
    }
}

fn v_spacing(kind: &Surface, options: &PointshellOptions) -> f64 {
    match *kind {
        Surface::Sphere { radius, .. } => options.spacing(1.0 / radius),
        Surface::Torus { minor, .. } => options.spacing(1.0 / minor),
        _ => options.max_spacing_mm,
    }
}

/// Millimetres along the surface for each unit of u at this v, and the normal curvature there (1/mm).
fn u_scale(kind: &Surface, v: f64) -> (f64, f64) {
    match *kind {
        Surface::Cylinder { radius, .. } => (radius, 1.0 / radius),
        Surface::Cone {
            radius, half_angle, ..
        } => {
            let r = (radius + v * half_angle.tan()).abs().max(1e-9);
            (r, half_angle.cos() / r)
        }
        Surface::Sphere { radius, .. } => ((radius * v.cos()).abs(), 1.0 / radius),
        Surface::Torus { major, minor, .. } => {
            let r = (major + minor * v.cos()).abs().max(1e-9);
            (r, v.cos() / r)
        }
        _ => (1.0, 0.0),
    }
}
