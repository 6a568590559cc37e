//! Solids of machined parts for STEP texts: polyhedra with round bores, and turned parts.

use glam::{DVec2, DVec3};

use crate::step_text::{StepText, number, prism};

/// A round bore at right angles to a face.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bore {
    /// Face in which it begins, and that in which it ends; without the second it is blind, with a flat end.
    pub faces: (usize, Option<usize>),
    /// Middle of its first circle, mm.
    pub mouth: DVec3,
    /// Vector to the middle of its last circle, mm.
    pub depth: DVec3,
    /// Radius, mm.
    pub radius: f64,
}

/// The two circles and the seam of a cylinder from `low` along `axis` to `high`.
struct Pipe {
    circles: [u64; 2],
    seam: u64,
    surface: u64,
}

impl StepText {
    fn circle(&mut self, middle: DVec3, axis: DVec3, radius: f64) -> (u64, u64, DVec3) {
        let x = axis.any_orthonormal_vector();
        let start = middle + x * radius;
        let vertex = self.vertex(start);
        let frame = self.axis(middle, axis, x);
        let circle = self.add(&format!("CIRCLE('',#{frame},{})", number(radius)));
        (self.edge([vertex; 2], circle), vertex, start)
    }

    fn pipe(&mut self, low: DVec3, high: DVec3, radius: f64) -> Pipe {
        let axis = (high - low).normalize();
        let (first, from, p) = self.circle(low, axis, radius);
        let (last, to, q) = self.circle(high, axis, radius);
        let seam = self.straight([from, to], [p, q]);
        let frame = self.axis(low, axis, axis.any_orthonormal_vector());
        let surface = self.add(&format!("CYLINDRICAL_SURFACE('',#{frame},{})", number(radius)));
        Pipe {
            circles: [first, last],
            seam,
            surface,
        }
    }

    /// A polyhedron with bores: vertices, the loop of each planar face, counter-clockwise seen from outside, and the bores.
    pub fn drilled(&mut self, corners: &[DVec3], loops: &[Vec<usize>], bores: &[Bore]) -> u64 {
        let mut faces = Vec::new();
        let mut holes: Vec<Vec<(u64, bool)>> = vec![Vec::new(); loops.len()];
        for bore in bores {
            let end = bore.mouth + bore.depth;
            let pipe = self.pipe(end, bore.mouth, bore.radius);
            let [last, first] = pipe.circles;
            // Counter-clockwise about the outward normal of the first face: clockwise it bounds the face.
            holes[bore.faces.0].push((first, false));
            match bore.faces.1 {
                Some(through) => holes[through].push((last, true)),
                None => {
                    let plane = self.plane(end, -bore.depth.normalize());
                    faces.push(self.face(&[(last, true)], plane));
                }
            }
            let wall = [
                (last, false),
                (pipe.seam, true),
                (first, true),
                (pipe.seam, false),
            ];
            faces.push(self.face_of(&[&wall], pipe.surface, false));
        }
        self.polyhedron_with(corners, loops, &holes, faces)
    }

    /// A prism with bores: faces are the loops of [`prism`]; the outline is convex at its first corner.
    pub fn prism(&mut self, outline: &[DVec2], heights: [f64; 2], bores: &[Bore]) -> u64 {
        let (corners, loops) = prism(outline, heights);
        self.drilled(&corners, &loops, bores)
    }

    /// A turned part about z: its profile as radius and height, mm, counter-clockwise with the radius to the right, of horizontal and vertical pieces;
    /// closed, or open from axis to axis.
    pub fn turned(&mut self, profile: &[DVec2]) -> u64 {
        let circles: Vec<Option<(u64, u64, DVec3)>> = (profile.iter())
            .map(|p| (p.x > 0.0).then(|| self.circle(DVec3::Z * p.y, DVec3::Z, p.x)))
            .collect();
        let mut faces = Vec::new();
        for i in 0..profile.len() {
            let j = (i + 1) % profile.len();
            let (p, q) = (profile[i], profile[j]);
            match (circles[i], circles[j]) {
                // A side: outward where the profile rises.
                (Some(from), Some(to)) if p.x == q.x => {
                    let up = q.y > p.y;
                    let ((low, v, a), (high, w, b)) = if up { (from, to) } else { (to, from) };
                    let seam = self.straight([v, w], [a, b]);
                    let frame = self.axis(DVec3::Z * p.y.min(q.y), DVec3::Z, DVec3::X);
                    let surface = self.add(&format!("CYLINDRICAL_SURFACE('',#{frame},{})", number(p.x)));
                    let wall = [(low, up), (seam, true), (high, !up), (seam, false)];
                    faces.push(self.face_of(&[&wall], surface, up));
                }
                (from, to) => {
                    // An end: downward where the profile goes outward.
                    let down = q.x > p.x;
                    let (outer, inner) = if down { (to, from) } else { (from, to) };
                    let normal = if down { DVec3::NEG_Z } else { DVec3::Z };
                    let plane = self.plane(DVec3::Z * p.y, normal);
                    let outer = outer.map(|(edge, ..)| [(edge, !down)]);
                    let inner = inner.map(|(edge, ..)| [(edge, down)]);
                    let bounds: Vec<&[(u64, bool)]> =
                        outer.iter().chain(&inner).map(<[_; 1]>::as_slice).collect();
                    if !bounds.is_empty() {
                        faces.push(self.face_of(&bounds, plane, true));
                    }
                }
            }
        }
        self.solid(&faces)
    }
}
