//! Kind of the touching feature of a part: a face, an edge or a corner.
//!
//! The board reports the touching face, and the second face where the point lies on an edge. A corner is an edge's end in which a third
//! face meets.

use std::fmt;

use glam::DVec3;
use mortise_brep::Shape;
use mortise_protocol::image::NO_FACE;

use super::document::Document;

/// Largest distance from an edge's end to a touch that counts as at the corner, mm: twice the board's tolerance for edges.
const AT_CORNER_MM: f64 = 0.02;

/// Feature of a shape's boundary.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Touch {
    /// A two-dimensional feature.
    Face,
    /// A one-dimensional feature.
    Edge,
    /// A point.
    Corner,
}

impl fmt::Display for Touch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Face => "face",
            Self::Edge => "edge",
            Self::Corner => "corner",
        })
    }
}

impl Touch {
    /// Feature of part `part`, or of its group, that touches at `point` (world, mm), for the faces that the board reported.
    pub fn of(document: &Document, part: usize, faces: [u16; 2], point: DVec3) -> Self {
        let model = &document.grouped.model;
        let (Some(shape), Some(pose)) = (
            (model.parts.get(part)).and_then(|part| model.shapes.get(part.shape)),
            document.poses.get(part),
        ) else {
            return Self::Face;
        };
        if faces.contains(&NO_FACE) {
            return Self::Face;
        }
        if is_corner(
            shape,
            faces.map(u32::from),
            pose.inverse().transform_point3(point),
        ) {
            Self::Corner
        } else {
            Self::Edge
        }
    }
}

/// Whether an edge of `faces` ends at `point` (shape frame, mm) and a third face meets it there.
fn is_corner(shape: &Shape, faces: [u32; 2], point: DVec3) -> bool {
    let ends_here = |polyline: &[DVec3]| {
        let ends = [polyline.first(), polyline.last()];
        (ends.into_iter().flatten()).any(|end| end.distance(point) <= AT_CORNER_MM)
    };
    let mut here = shape.edges.iter().filter(|edge| ends_here(&edge.polyline));
    let own = here
        .clone()
        .any(|edge| faces.iter().all(|face| edge.faces.contains(face)));
    own && here.any(|edge| edge.faces.iter().any(|face| !faces.contains(face)))
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::*;

    /// All edges of the sample's parts, in the middle and at their ends: both ends of the block's straight edges are corners; the rim of a
    /// hole or a peg has none, although its seam begins there.
    #[test]
    fn corners_are_where_three_faces_meet() {
        let document = Document::sample(0, &|_| ControlFlow::Continue(())).expect("the sample opens");
        let (mut corners, mut rims) = (0, 0);
        for (part, pose) in document.poses.iter().enumerate() {
            let shape = &document.model.shapes[document.model.parts[part].shape];
            for edge in &shape.edges {
                let [a, b] = edge.faces[..] else { continue };
                let faces = [a as u16, b as u16];
                let touch = |faces, at: DVec3| Touch::of(&document, part, faces, pose.transform_point3(at));
                let (first, last) = (edge.polyline[0], edge.polyline[edge.polyline.len() - 1]);
                let middle = if edge.polyline.len() > 2 {
                    edge.polyline[edge.polyline.len() / 2]
                } else {
                    0.5 * (first + last)
                };
                assert_eq!(touch([faces[0], NO_FACE], first), Touch::Face);
                assert_eq!(touch(faces, middle), Touch::Edge);
                if first.distance(last) < 1e-6 {
                    rims += 1;
                    assert_eq!(touch(faces, first), Touch::Edge, "a rim: {edge:?}");
                } else if a != b {
                    corners += 2;
                    assert_eq!(touch(faces, first), Touch::Corner);
                    assert_eq!(touch(faces, last), Touch::Corner);
                }
            }
        }
        assert!(corners >= 24 && rims >= 2, "{corners} {rims}");
        let beyond = Touch::of(&document, usize::MAX, [0, 1], DVec3::ZERO);
        assert_eq!(beyond, Touch::Face);
    }
}
