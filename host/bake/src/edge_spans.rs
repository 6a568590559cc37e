//! Spans of sharp convex edges for the pointshell: stretches of an edge, on which the tick finds the deepest place.
//!
//! The number of spans follows the edge's shape, not the accuracy: a rim takes eight, a straight edge one. Against a partner of radius r a span is no
//! longer than [`SHARE_OF_RADIUS`]·r, so that its middle is near the same face; no span is longer than [`SPACINGS`] times `max_spacing_mm`, so that
//! its middle's cell names what is near it.

use glam::DVec3;
use mortise_brep::EDGE_TOLERANCE_MM;
use mortise_protocol::image::NO_FACE;

use crate::distance::ExactSurface;
use crate::edges::sharp;
use crate::piece::Link;
use crate::shell::{PointshellOptions, ShellPoint, ShellSpan};
use crate::stretch::{Chain, Curve, Fineness, Stretch};

/// Spans are as near to the exact edge as that is known, and turn by what the tick's search along them assumes.
const FINENESS: Fineness = Fineness {
    tolerance_mm: EDGE_TOLERANCE_MM,
    most_turn: 0.4,
};
/// Length of a span as a share of the smallest radius of a partner's convex face.
const SHARE_OF_RADIUS: f64 = 0.8;
/// Longest span, in largest spacings of points: between points there is nothing, but a span is looked at all along.
const SPACINGS: f64 = 8.0;

/// The spans of a chain of boundary pieces; `None` where it is not a sharp convex edge all along.
pub(crate) fn spans(
    surface: &ExactSurface,
    links: &[Link],
    options: &PointshellOptions,
) -> Option<Vec<ShellPoint>> {
    let chain = Chain::new(&surface.topology.pieces, links);
    let sharpest = options.partners.sharpest();
    let mut points = Vec::new();
    for stretch in chain.stretches(Curve::Round, FINENESS) {
        let piece = chain.piece(&stretch);
        let (normals, _) = sharp(surface, piece, stretch.middle)?;
        let count = count(&stretch, normals, sharpest, options);
        let [from, to] = stretch.range;
        let end = |k: usize| from + (to - from) * k as f64 / count as f64;
        for k in 0..count {
            let part = Stretch::new(&chain, [end(k), end(k + 1)], Curve::Round);
            let piece = chain.piece(&part);
            let (normals, faces) = sharp(surface, piece, part.middle)?;
            points.push(ShellPoint {
                position: part.middle,
                normal: (normals[0] + normals[1]).try_normalize()?,
                face: faces[0] as u16,
                edge_face: if faces[0] == faces[1] {
                    NO_FACE
                } else {
                    faces[1] as u16
                },
                span: Some(ShellSpan {
                    along: part.along,
                    bend: part.bend,
                    round: part.round,
                }),
            });
        }
    }
    Some(points)
}

/// Number of spans in a stretch at which the faces have these normals.
fn count(stretch: &Stretch, normals: [DVec3; 2], sharpest: f64, options: &PointshellOptions) -> usize {
    let length = stretch.range[1] - stretch.range[0];
    let by_partner = length * sharpest.min(1e9) / SHARE_OF_RADIUS;
    // No more than points would be, whose spacing follows the curvature away from what touches the edge.
    let curvature = stretch.bend * (2.0 / stretch.along.length_squared().max(1e-300));
    let middle = (normals[0] + normals[1]).normalize_or_zero();
    let outward = [normals[0], normals[1], middle].map(|n| -curvature.dot(n));
    let outward = outward.into_iter().fold(0.0, f64::max);
    let by_points = length * ((outward + sharpest.min(1e9)) / (8.0 * options.epsilon_mm)).sqrt();
    let least = if options.least_spacing_mm > 0.0 {
        length / options.least_spacing_mm
    } else {
        f64::INFINITY
    };
    (by_partner.min(by_points).min(least) - 1e-9)
        .max(length / (SPACINGS * options.max_spacing_mm) - 1e-9)
        .ceil()
        .clamp(1.0, 4000.0) as usize
}
