//! Section chains on the exact surfaces: crossings of facets moved onto them, and sides divided until they follow the curve.
//!
//! Limit: which loops there are is that of the facets. Where the plane passes within the tessellation's deflection of a place at which it would touch a surface,
//! facets can have a loop that the surface has not, or lack one; the area is off by what lies within the deflection there.

use glam::DVec3;
use mortise_bake::ExactSurface;

use crate::onto::{is_flat, onto};
use crate::trace::{Chain, Crossing};

/// Most halvings of a side.
const HALVINGS: u32 = 10;
/// Largest sag of a side as a share of its length. That of an arc of angle θ is θ/8, and n sides of a circle lack θ²/6 of its area: 2.7·10⁻⁴ here.
const SAG_SHARE: f64 = 0.005;
/// Sag below which no side is divided, mm.
const LEAST_SAG_MM: f64 = 1e-6;

/// `chain` on the exact surfaces of the plane's section; `sag_mm`: largest distance of a side from the curve. `normal`: of the plane, unit length. Points that
/// cannot be moved stay on their facets.
pub fn exact(chain: &Chain, surface: &ExactSurface, normal: DVec3, sag_mm: f64) -> Chain {
    let n = chain.crossings.len();
    let before = |i: usize| match (i, chain.closed) {
        (0, false) => chain.crossings[0].face,
        (0, true) => chain.crossings[n - 1].face,
        _ => chain.crossings[i - 1].face,
    };
    let moved: Vec<DVec3> = chain
        .crossings
        .iter()
        .enumerate()
        .map(|(i, c)| {
            // The curved face first: a flat one needs no step.
            let (own, other) = (c.face, before(i));
            let faces = if is_flat(surface, own) {
                [other, own]
            } else {
                [own, other]
            };
            onto(surface, c.point, faces, Some(normal)).unwrap_or(c.point)
        })
        .collect();
    let curve = Curve {
        surface,
        normal,
        sag_mm,
    };
    let mut crossings = Vec::new();
    for (i, c) in chain.crossings.iter().enumerate() {
        crossings.push(Crossing {
            point: moved[i],
            face: c.face,
        });
        let next = match (i + 1 == n, chain.closed) {
            (true, false) => continue,
            (true, true) => moved[0],
            _ => moved[i + 1],
        };
        if !is_flat(surface, c.face) {
            curve.divide(moved[i], next, c.face, 0, &mut crossings);
        }
    }
    Chain {
        crossings,
        closed: chain.closed,
        open_shell: chain.open_shell,
    }
}

struct Curve<'a> {
    surface: &'a ExactSurface,
    normal: DVec3,
    sag_mm: f64,
}

impl Curve<'_> {
    /// Appends the points strictly between `a` and `b`.
    fn divide(&self, a: DVec3, b: DVec3, face: u32, depth: u32, out: &mut Vec<Crossing>) {
        let length = a.distance(b);
        if depth >= HALVINGS || length <= LEAST_SAG_MM {
            return;
        }
        let middle = a.midpoint(b);
        let Some(point) = onto(self.surface, middle, [face; 2], Some(self.normal)) else {
            return;
        };
        let sag = middle.distance(point);
        if sag <= self.sag_mm.min(length * SAG_SHARE).max(LEAST_SAG_MM) {
            return;
        }
        self.divide(a, point, face, depth + 1, out);
        out.push(Crossing { point, face });
        self.divide(point, b, face, depth + 1, out);
    }
}
