//! Points inside faces: a lattice in the surface's parameters, kept where it falls inside the trim.

use std::f64::consts::TAU;

use mortise_brep::Surface;
use mortise_protocol::image::NO_FACE;

use crate::distance::ExactSurface;
use crate::partners::Partners;
use crate::shell::{PointshellOptions, ShellPoint};
use crate::surface::{angle_range, at_parameters, natural_normal, parameters, principal_curvatures};

/// Most rows of a lattice, and most points of a row: a face that would need more is sampled more sparsely.
const MAX_ROWS: f64 = 2000.0;
/// Steps of the numeric integral of the row density.
const STEPS: usize = 256;

/// Appends the points inside `face`. `flat_mm`: largest spacing inside spline faces when the partners are known.
pub(crate) fn sample_face(
    surface: &ExactSurface,
    face: u32,
    options: &PointshellOptions,
    flat_mm: f64,
    out: &mut Vec<ShellPoint>,
) {
    let kind = surface.shape().faces[face as usize].surface;
    match kind {
        Surface::Spline => {
            let largest = match options.partners {
                Partners::Unknown => options.max_spacing_mm,
                Partners::Known(_) => options.max_spacing_mm.max(flat_mm),
            };
            let options = PointshellOptions {
                max_spacing_mm: largest,
                ..options.clone()
            };
            crate::spline_samples::sample_spline(surface, face, &options, out);
        }
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
    let sense = surface.topology.sense[face as usize];
    let mut push = |position, normal| {
        if surface.contains(face, position) {
            out.push(ShellPoint {
                position,
                normal: normal * sense,
                face: face as u16,
                edge_face: NO_FACE,
                span: None,
            });
        }
    };
    let spacings = |at_v: f64| options.face_spacings(principal_curvatures(kind, at_v).map(|k| k * sense));
    // Rows follow the local density required: they divide the integrated density into equal shares.
    let step = v.1 / STEPS as f64;
    let mut summed = 0.0;
    let sums: Vec<f64> = (0..STEPS)
        .map(|i| {
            let along = spacings(v.0 + step * (i as f64 + 0.5)).map(|[_, s]| s);
            summed += along.map_or(0.0, |s| step * v_scale(kind) / s);
            summed
        })
        .collect();
    let rows = if summed > 0.0 { count(summed, 1.0) } else { 0 };
    for row in 0..rows {
        let share = summed * (row as f64 + 0.5) / rows as f64;
        let i = sums.partition_point(|&s| s < share).min(STEPS - 1);
        let before = if i == 0 { 0.0 } else { sums[i - 1] };
        let at_v = v.0 + step * (i as f64 + (share - before) / (sums[i] - before).max(1e-300));
        // A row covers its neighbourhood, half-way to the next row: its density is that of the most curved place there.
        let half = spacings(at_v).map_or(0.0, |[_, along]| 0.5 * along / v_scale(kind));
        let neighbourhood = [at_v - half, at_v, at_v + half];
        let across = neighbourhood
            .iter()
            .filter_map(|&v| spacings(v))
            .map(|[across, _]| across);
        let Some(across) = across.reduce(f64::min) else {
            continue;
        };
        let columns = count(u.1 * u_scale(kind, at_v), across);
        // Every other row is shifted by half a step where the row closes on itself: the same number of points covers more.
        let shift = if around && row % 2 == 1 { 0.0 } else { 0.5 };
        for column in 0..columns {
            let at_u = u.0 + u.1 * (column as f64 + shift) / columns as f64;
            if let Some(position) = at_parameters(kind, [at_u, at_v])
                && let Some(normal) = natural_normal(kind, position)
            {
                push(position, normal);
            }
        }
    }
    if let Surface::Cone {
        frame,
        radius,
        half_angle,
    } = *kind
        && sense > 0.0
    {
        // A tip is sharp, although no edge ends there.
        let tip = frame.origin - frame.z * (radius / half_angle.tan());
        push(tip, -frame.z * half_angle.signum());
    }
}

fn count(length: f64, spacing: f64) -> usize {
    (length / spacing - 1e-9).ceil().clamp(1.0, MAX_ROWS) as usize
}

/// Start and span of both parameters, and whether the first one covers a full turn.
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
    // Vertices of a face that covers a full turn leave gaps of one facet; a gap wider than a third of the circle is an opening.
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

/// Millimetres along the surface for each unit of u at this v.
fn u_scale(kind: &Surface, v: f64) -> f64 {
    match *kind {
        Surface::Cylinder { radius, .. } => radius,
        Surface::Cone {
            radius, half_angle, ..
        } => (radius + v * half_angle.tan()).abs().max(1e-9),
        Surface::Sphere { radius, .. } => (radius * v.cos()).abs(),
        Surface::Torus { major, minor, .. } => (major + minor * v.cos()).abs().max(1e-9),
        _ => 1.0,
    }
}
