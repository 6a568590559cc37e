//! Test whether a point of a face's surface lies inside the face.
//!
//! Away from the face's boundary the tessellation decides; within a few chord errors of it the exact boundary does, by the side of its nearest piece
//! on which the point lies. So a point between a hole's circle and the chord of its facets is classified correctly.

use std::f64::consts::TAU;

use glam::DVec3;

use crate::distance::{ExactSurface, SAME_MM};
use crate::piece::Piece;
use crate::topology::NONE;
use crate::triangles::NearTriangle;
use crate::triangles::nearest_on_triangle;

impl ExactSurface {
    /// Whether `q`, a point of the untrimmed surface of `face`, lies in the face. `near` must hold all triangles within a few
    /// chord errors of `q`.
    pub(crate) fn in_trim(&self, face: u32, q: DVec3, near: &[NearTriangle]) -> bool {
        let chord = self.topology.chord[face as usize];
        let of_face = || near.iter().filter(|n| n.face == face);
        let mut facet = f64::INFINITY;
        for n in of_face() {
            // A triangle whose distance to p already excludes it need not be measured; the first one close enough ends the search.
            let on = nearest_on_triangle(self.triangles.corners(n.triangle), q);
            facet = facet.min(on.point.distance(q));
            if facet <= chord {
                break;
            }
        }
        if facet > 2.0 * chord + 10.0 * SAME_MM {
            return false;
        }
        // Nearest boundary: q is within 2·chord of the tessellated face, so if it is outside, the exact boundary is within 3·chord of it.
        let mut nearest = 3.0 * chord + 20.0 * SAME_MM;
        let mut found = None;
        for n in of_face() {
            for &i in &self.topology.triangle_pieces[n.triangle as usize] {
                if i == NONE {
                    continue;
                }
                let piece = &self.topology.pieces[i as usize];
                let on = piece.nearest(q);
                let d = on.point.distance(q);
                if d < nearest {
                    nearest = d;
                    found = Some((piece, on));
                }
            }
        }
        let Some((piece, on)) = found else {
            return true;
        };
        if nearest <= SAME_MM {
            return true;
        }
        match on.end {
            None => self.on_inner_side(face, piece, on.point, q),
            Some(end) => self.in_sector(face, piece.ends[end], on.point, q),
        }
    }

    /// Whether `q` lies in `face`, with its own search for the triangles near it.
    pub(crate) fn contains(&self, face: u32, q: DVec3) -> bool {
        let mut near = Vec::new();
        self.triangles
            .within(q, 6.0 * self.chord + 100.0 * SAME_MM, |triangle, on, distance| {
                let of = self.shape.mesh.triangle_face[triangle as usize];
                if of == face {
                    near.push(NearTriangle {
                        triangle,
                        face,
                        on,
                        distance,
                    });
                }
            });
        self.in_trim(face, q, &near)
    }

    /// Whether `q` is on the face's inner side, the left of the direction in which the face traverses the piece.
    fn on_inner_side(&self, face: u32, piece: &Piece, at: DVec3, q: DVec3) -> bool {
        let Some(side) = piece.sides.iter().find(|s| s.face == face) else {
            return true;
        };
        let tangent = piece.tangent(at) * if side.forward { 1.0 } else { -1.0 };
        let inward = self
            .topology
            .outward(&self.shape, side.triangle, at)
            .cross(tangent);
        (q - at).dot(inward) >= 0.0
    }

    /// Inside test at a corner of the boundary: the inside is the sector from the outgoing piece anticlockwise to the incoming one.
    fn in_sector(&self, face: u32, vertex: u32, at: DVec3, q: DVec3) -> bool {
        let mut out = None;
        let mut back = None;
        let mut triangle = None;
        for &i in self.topology.vertex_pieces.get(&vertex).into_iter().flatten() {
            let piece = &self.topology.pieces[i as usize];
            for side in piece.sides.iter().filter(|s| s.face == face) {
                triangle = Some(side.triangle);
                let starts_here = (piece.ends[0] == vertex) == side.forward;
                let away = piece.tangent(at) * if piece.ends[0] == vertex { 1.0 } else { -1.0 };
                if starts_here {
                    out = Some(away);
                } else {
                    back = Some(away);
                }
            }
        }
        let (Some(out), Some(back), Some(triangle)) = (out, back, triangle) else {
            return true;
        };
        let normal = self.topology.outward(&self.shape, triangle, at);
        let angle = |v: DVec3| {
            let a = normal.dot(out.cross(v)).atan2(out.dot(v));
            if a < 0.0 { a + TAU } else { a }
        };
        angle(q - at) <= angle(back)
    }
}
