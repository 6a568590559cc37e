//! Points of the tessellation moved onto the exact surfaces, by Newton steps of least length.
//!
//! With distances d₁, d₂ of a point from the surfaces of its two faces and their gradients g₁, g₂ (within a plane: their components in it) the step is
//! −Jᵀ(JJᵀ)⁻¹d. Where the gradients are nearly parallel, as across a smooth edge, the first surface alone decides.

use glam::DVec3;
use mortise_bake::ExactSurface;
use mortise_brep::Surface;

/// Distance from a surface at which a point is on it, mm.
const ON_MM: f64 = 1e-9;
/// Most Newton steps.
const STEPS: usize = 12;
/// Sine of the angle of two gradients below which they count as parallel.
const PARALLEL: f64 = 1e-3;
/// Least component of a unit gradient in the plane: below it the plane touches the surface, and its section there is ill-conditioned.
const LEAST_SLOPE: f64 = 0.05;

/// Whether a point of the face's tessellation lies on the face's surface as it is.
pub fn is_flat(surface: &ExactSurface, face: u32) -> bool {
    matches!(
        surface.shape().faces.get(face as usize).map(|f| &f.surface),
        Some(Surface::Plane { .. })
    )
}

/// `p` moved onto the surfaces of both `faces`, within the plane across `normal` if there is one. `None` where the steps do not end near `p`.
pub fn onto(surface: &ExactSurface, p: DVec3, faces: [u32; 2], normal: Option<DVec3>) -> Option<DVec3> {
    if faces.iter().all(|&f| is_flat(surface, f)) {
        return Some(p);
    }
    if faces[0] == faces[1] {
        return steps(surface, p, faces, normal);
    }
    steps(surface, p, faces, normal).or_else(|| steps(surface, p, [faces[0]; 2], normal))
}

fn steps(surface: &ExactSurface, p: DVec3, faces: [u32; 2], normal: Option<DVec3>) -> Option<DVec3> {
    let within = |g: DVec3| normal.map_or(g, |n| g - n * g.dot(n));
    let mut at = p;
    let mut most = None;
    for _ in 0..STEPS {
        let (d, g) = offset(surface, at, faces[0])?;
        let g = within(g);
        let slope = g.length_squared();
        // The tessellation is within its chord error of the surface, and the section of both within that over the slope.
        let most =
            *most.get_or_insert((4.0 * surface.chord_error_mm() + ON_MM) / slope.sqrt().max(LEAST_SLOPE));
        let second = (faces[1] != faces[0])
            .then(|| offset(surface, at, faces[1]))
            .flatten()
            .map(|(d, g)| (d, within(g)))
            .filter(|(_, h)| g.cross(*h).length_squared() > PARALLEL * PARALLEL * slope * h.length_squared());
        let (step, error) = match second {
            Some((e, h)) => {
                let (gg, gh, hh) = (slope, g.dot(h), h.length_squared());
                let det = gg * hh - gh * gh;
                let (a, b) = ((d * hh - e * gh) / det, (e * gg - d * gh) / det);
                (g * a + h * b, d.abs().max(e.abs()))
            }
            None => (g * (d / slope), d.abs()),
        };
        if error <= ON_MM {
            return Some(at);
        }
        at -= step;
        if !at.is_finite() || at.distance(p) > most {
            return None;
        }
    }
    None
}

/// Distance of `p` from the surface of `face`, and its gradient. A free-form face answers by the nearest point of the solid.
fn offset(surface: &ExactSurface, p: DVec3, face: u32) -> Option<(f64, DVec3)> {
    if let Some(found) = surface.shape().faces.get(face as usize)?.surface.distance(p) {
        return Some(found);
    }
    let near = surface.nearest(p)?;
    let gradient = if near.distance.abs() > ON_MM {
        (p - near.point) / near.distance
    } else {
        near.normal
    };
    Some((near.distance, gradient))
}
