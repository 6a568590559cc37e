//! Pairs of faces of two shapes that can fit into one another: a convex one in a concave one of nearly the same radius.
//!
//! Fits of round faces follow from the shapes alone, independent of their placement; those of other faces are in [`crate::placed_fits`]. In a fit the surfaces run along each other, so the smallest errors are felt
//! there. Flats that fit flats are exact in any field and need no rule.

use mortise_brep::Surface;

use crate::distance::ExactSurface;

/// Largest clearance of a fit, as a share of the bore's radius; a larger one is free space.
const LOOSEST: f64 = 0.15;
/// Largest interference of a fit, as a share of the bore's radius; a larger pin belongs to another bore.
const TIGHTEST: f64 = 0.02;
/// Half angles of cones that fit differ by less than this, rad.
const SAME_ANGLE: f64 = 0.02;

/// A face of one shape inside, or around, a face of another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Fit {
    /// Faces of the first and of the second shape.
    pub faces: [u32; 2],
    /// Whether the first shape's face is the hollow one.
    pub hollow: bool,
    /// (bore's radius − pin's)/bore's radius, at least 0: relative difference of their curvatures. 1 when one of them is curved in a direction in
    /// which the other is not.
    pub difference: f64,
}

/// Kind, radius and cone half angle of a curved face; the radius is negative for a hollow one.
fn bend(surface: &ExactSurface, face: u32) -> Option<(Round, f64, f64)> {
    let sense = surface.topology.sense[face as usize];
    match surface.shape().faces[face as usize].surface {
        Surface::Cylinder { radius, .. } => Some((Round::Cylinder, sense * radius, 0.0)),
        Surface::Sphere { radius, .. } => Some((Round::Sphere, sense * radius, 0.0)),
        Surface::Cone {
            radius, half_angle, ..
        } => Some((Round::Cone, sense * radius.abs().max(1e-9), half_angle.abs())),
        _ => None,
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Round {
    Cylinder,
    Sphere,
    Cone,
}

/// Whether a surface takes part in fits by radii.
pub(crate) fn is_round(surface: &Surface) -> bool {
    matches!(
        surface,
        Surface::Cylinder { .. } | Surface::Sphere { .. } | Surface::Cone { .. }
    )
}

/// All fits of round faces between two shapes.
pub(crate) fn fits(a: &ExactSurface, b: &ExactSurface) -> Vec<Fit> {
    let of = |s: &ExactSurface| -> Vec<(u32, (Round, f64, f64))> {
        (0..s.shape().faces.len() as u32)
            .filter_map(|face| Some((face, bend(s, face)?)))
            .collect()
    };
    let (a, b) = (of(a), of(b));
    let mut found = Vec::new();
    for &(i, own) in &a {
        for &(j, other) in &b {
            // Put the hollow face second.
            let difference = if own.1 > 0.0 {
                difference(own, other)
            } else {
                difference(other, own)
            };
            found.extend(difference.map(|difference| Fit {
                faces: [i, j],
                hollow: own.1 < 0.0,
                difference,
            }));
        }
    }
    found
}

fn difference(pin: (Round, f64, f64), bore: (Round, f64, f64)) -> Option<f64> {
    let ((pin, r, a), (bore, hollow, b)) = (pin, bore);
    let bore_radius = -hollow;
    if r <= 0.0 || bore_radius <= 0.0 {
        return None;
    }
    if pin == Round::Cone && bore == Round::Cone {
        return ((a - b).abs() <= SAME_ANGLE).then_some(0.0);
    }
    let room = room(r, bore_radius);
    match (pin, bore) {
        (Round::Cylinder, Round::Cylinder) | (Round::Sphere, Round::Sphere) => room,
        (Round::Sphere, Round::Cylinder) => room.map(|_| 1.0),
        _ => None,
    }
}

/// (bore's radius − pin's)/bore's radius, at least 0; `None` where one is too large or too small for the other.
pub(crate) fn room(pin: f64, bore: f64) -> Option<f64> {
    let room = (bore - pin) / bore;
    (-TIGHTEST..=LOOSEST).contains(&room).then_some(room.max(0.0))
}
