//! Sides of the edges along which faces continue each other smoothly: rounds, fillets, and faces that a modeller splits.
//!
//! At a round of radius r the distance to the plane beside it falls short of that to the cylinder by x²/(2r) at x from their edge, on both sides of
//! it: neither the largest nor the smallest of the two is the solid's. The normals along the edge sweep a surface that separates the points nearest
//! to one face from those nearest to the other. A *side* is one side of that surface, as a distance of plus or minus [`SIDE_M`]; in a clause
//! with a face it limits the face to its own side. The edges are lines, which normals sweep to a plane, and circles, which they sweep to a cone, of
//! which plane and cylinder are special cases.

use glam::DVec3;
use mortise_brep::{Curve, Surface};
#[cfg(doc)]
use mortise_haptics::SIDE_M;
use mortise_protocol::image::{Nearby, PatchRecord, patch_kind};

use crate::cover::MOST_SIDES;
use crate::distance::ExactSurface;
use crate::local_patch::board_distance;

/// Cosine of the largest angle between the normals of faces that continue each other: a rule beside them is tested in any case.
const SMOOTH: f64 = 1.0 - 1e-6;

/// The sides of a shape's smooth edges, two for each, with *surface indices* from a first one on.
pub(crate) struct Sides {
    records: Vec<PatchRecord>,
    /// Faces that meet at the edge of each side, in ascending order.
    between: Vec<[u16; 2]>,
    first: u16,
}

/// The first surface index of sides before they are named: the last ones of all, so that patches can still be added.
const FIRST: u16 = Nearby::MAX_FACES - MOST_SIDES as u16;

impl Sides {
    /// Of all smooth edges between faces with a closed form.
    pub fn of(surface: &ExactSurface) -> Self {
        let (shape, topology) = (surface.shape(), &surface.topology);
        let mut sides = Self {
            records: Vec::new(),
            between: Vec::new(),
            first: FIRST,
        };
        let mut seen: Vec<(u32, [u32; 2])> = Vec::new();
        for piece in &topology.pieces {
            let (Some(edge), &[one, other]) = (piece.edge, piece.sides.as_slice()) else {
                continue;
            };
            let mut faces = [one.face, other.face];
            faces.sort_unstable();
            let surfaces = faces.map(|face| shape.faces[face as usize].surface);
            let closed = surfaces.iter().all(|of| !matches!(of, Surface::Spline));
            if !closed || surfaces[0] == surfaces[1] || seen.contains(&(edge, faces)) {
                continue;
            }
            let at = piece.at(0.5);
            let [a, b] = [one, other].map(|side| topology.outward(shape, side.triangle, at));
            if a.dot(b) < SMOOTH {
                continue;
            }
            seen.push((edge, faces));
            let Some(record) = swept(&shape.edges[edge as usize].curve, at, a) else {
                continue;
            };
            if sides.records.len() + 2 > MOST_SIDES {
                break;
            }
            for way in [1.0, -1.0] {
                let mut record = PatchRecord {
                    face: faces[0] as u16,
                    ..record
                };
                record.height[1] *= way;
                record.height[2] *= way;
                sides.records.push(record);
                sides.between.push(faces.map(|face| face as u16));
            }
        }
        sides
    }

    /// Surface indices of the sides of edges between two of these faces, which are in ascending order.
    pub fn among<'a>(&'a self, faces: &'a [u16]) -> impl Iterator<Item = u16> + 'a {
        (self.first..).zip(&self.between).filter_map(|(index, between)| {
            let both = between.iter().all(|face| faces.binary_search(face).is_ok());
            both.then_some(index)
        })
    }

    /// Distance by which a side counts at `p`, mm, as the board computes it; NaN for another surface.
    pub fn distance(&self, surface: u16, p: DVec3) -> f64 {
        let number = usize::from(surface).checked_sub(usize::from(self.first));
        number
            .and_then(|number| self.records.get(number))
            .map_or(f64::NAN, |side| board_distance(side, p))
    }

    /// The sides that groups of faces name, in order, for the image; `groups` are the words of the groups, which then name these by surface indices from
    /// `first` on.
    pub fn named<'a>(self, groups: impl Iterator<Item = &'a mut [u16]>, first: usize) -> Vec<PatchRecord> {
        let mut groups: Vec<&mut [u16]> = groups.collect();
        let number = |word: u16| {
            usize::from(word & Nearby::MAX_FACES)
                .checked_sub(usize::from(self.first))
                .filter(|&number| number < self.records.len())
        };
        let mut is_named = vec![false; self.records.len()];
        for word in groups.iter().flat_map(|words| words.iter()) {
            if let Some(number) = number(*word) {
                is_named[number] = true;
            }
        }
        let before = |number: usize| is_named[..number].iter().filter(|named| **named).count() as u16;
        for word in groups.iter_mut().flat_map(|words| words.iter_mut()) {
            if let Some(number) = number(*word) {
                *word = (*word & !Nearby::MAX_FACES) | (first as u16 + before(number));
            }
        }
        (self.records.into_iter().zip(is_named))
            .filter_map(|(record, named)| named.then_some(record))
            .collect()
    }
}

/// The surface that the unit normals along a curve sweep, from the normal `n` at one of its points, mm.
fn swept(curve: &Curve, at: DVec3, n: DVec3) -> Option<PatchRecord> {
    let (origin, axis, [radius, out, along]) = match *curve {
        Curve::Line { direction, .. } => (at, n.cross(direction).try_normalize()?, [0.0, 0.0, 1.0]),
        Curve::Circle { frame, radius } => {
            let from = at - frame.origin;
            let out = (from - frame.z * from.dot(frame.z)).try_normalize()?;
            // The points at s along the normals have the radius r + s·n_r and the height s·n_z.
            (frame.origin, frame.z, [radius, n.dot(frame.z), -n.dot(out)])
        }
        Curve::Other => return None,
    };
    let normal = axis.as_vec3();
    let mut height = [0.0; 10];
    (height[0], height[1], height[2]) = ((radius / 1000.0) as f32, out as f32, along as f32);
    Some(PatchRecord {
        origin: (origin / 1000.0).as_vec3().to_array(),
        x: normal.any_orthonormal_vector().to_array(),
        normal: normal.to_array(),
        height,
        radius: 0.0,
        face: 0,
        kind: patch_kind::SIDE,
    })
}
