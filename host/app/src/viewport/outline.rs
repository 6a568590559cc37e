//! Lines that show a feature of a part in the view. Pure.

use glam::{DAffine3, DVec3};
use mortise_brep::{Curve, Face, Frame, Shape, Surface};
use mortise_inspect::measure::{Feature, Round};

/// How far an axis is drawn beyond what it belongs to, as a share of its length there.
const BEYOND: f64 = 0.1;

/// What marks a feature.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outline {
    /// Lines through points, in the frame asked for, mm.
    pub lines: Vec<Vec<DVec3>>,
    /// A single point, mm.
    pub point: Option<DVec3>,
    /// Whether the lines stand for an axis, which is dashed.
    pub dashed: bool,
}

/// The outline of a feature of `shape` at `pose`; empty for a feature that it does not have.
pub fn outline(shape: &Shape, feature: Feature, pose: &DAffine3) -> Outline {
    let mut found = Outline::default();
    match feature {
        Feature::Vertex { edge, last } => found.point = end(shape, edge, last),
        Feature::Center(round) => found.point = frame_of(shape, round).map(|frame| frame.origin),
        Feature::Edge(edge) => found.lines.extend(polyline(shape, edge)),
        Feature::Face(face) => {
            let edges = shape.faces.get(face as usize).map(|of| &of.edges);
            // A seam, which lists its face twice, bounds nothing.
            let bounds = |e: &&u32| {
                let edge = shape.edges.get(**e as usize);
                edge.is_some_and(|edge| edge.faces.iter().filter(|f| **f == face).count() < 2)
            };
            let edges = edges.into_iter().flatten().filter(bounds);
            found.lines.extend(edges.filter_map(|&e| polyline(shape, e)));
        }
        Feature::Axis(round) => {
            found.lines.extend(axis(shape, round).map(Vec::from));
            found.dashed = true;
        }
    }
    for p in found.lines.iter_mut().flatten().chain(&mut found.point) {
        *p = pose.transform_point3(*p);
    }
    found
}

/// First or last point of an edge, mm.
pub fn end(shape: &Shape, edge: u32, last: bool) -> Option<DVec3> {
    let line = &shape.edges.get(edge as usize)?.polyline;
    if last { line.last() } else { line.first() }.copied()
}

fn polyline(shape: &Shape, edge: u32) -> Option<Vec<DVec3>> {
    Some(shape.edges.get(edge as usize)?.polyline.clone())
}

/// Frame of what is round.
fn frame_of(shape: &Shape, round: Round) -> Option<Frame> {
    match round {
        Round::Edge(edge) => match shape.edges.get(edge as usize)?.curve {
            Curve::Circle { frame, .. } => Some(frame),
            _ => None,
        },
        Round::Face(face) => match shape.faces.get(face as usize)?.surface {
            Surface::Cylinder { frame, .. }
            | Surface::Cone { frame, .. }
            | Surface::Sphere { frame, .. }
            | Surface::Torus { frame, .. } => Some(frame),
            _ => None,
        },
    }
}

/// Both ends of the piece of an axis beside what it belongs to, and a little beyond; `None` for what has no axis.
pub fn axis(shape: &Shape, round: Round) -> Option<[DVec3; 2]> {
    let frame = frame_of(shape, round)?;
    let points: Box<dyn Iterator<Item = DVec3>> = match round {
        Round::Edge(edge) => {
            let Curve::Circle { radius, .. } = shape.edges.get(edge as usize)?.curve else {
                return None;
            };
            Box::new(
                [-radius, radius]
                    .into_iter()
                    .map(move |z| frame.origin + z * frame.z),
            )
        }
        Round::Face(face) => {
            let face = shape.faces.get(face as usize)?;
            match face.surface {
                Surface::Torus { minor, .. } => Box::new(
                    [-minor, minor]
                        .into_iter()
                        .map(move |z| frame.origin + z * frame.z),
                ),
                Surface::Cylinder { .. } | Surface::Cone { .. } => Box::new(border(shape, face)),
                _ => return None,
            }
        }
    };
    let heights = points.map(|p| (p - frame.origin).dot(frame.z));
    let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), z| {
        (low.min(z), high.max(z))
    });
    let beyond = BEYOND * (high - low);
    let ends = [low - beyond, high + beyond].map(|z| frame.origin + z * frame.z);
    ends.iter().all(|end| end.is_finite()).then_some(ends)
}

/// Points along a face's edges.
fn border<'a>(shape: &'a Shape, face: &'a Face) -> impl Iterator<Item = DVec3> + 'a {
    let edges = face.edges.iter().filter_map(|&e| shape.edges.get(e as usize));
    edges.flat_map(|edge| edge.polyline.iter().copied())
}
