//! Spans of sharp convex edges for the pointshell: stretches of the pieces of [`crate::edges`], on which the tick finds the deepest place.
//!
//! Within a span the distance to a partner's surface must be nearly a parabola. A piece turns little, so a rim takes as many spans as it has pieces,
//! whatever its size and the accuracy; against a partner of radius r a span is no longer than [`SHARE_OF_RADIUS`]·r, so that its middle is near the
//! same face; no span is longer than [`SPACINGS`] times `max_spacing_mm`, so that its middle's cell names what is near it.

use mortise_protocol::image::{NO_FACE, NO_PIECE};

use crate::distance::ExactSurface;
use crate::edges::{Chain, EdgePiece};
use crate::shell::{PointshellOptions, ShellPoint, ShellSpan};

/// Length of a span as a share of the smallest radius of a partner's convex face.
const SHARE_OF_RADIUS: f64 = 0.8;
/// Longest span, in largest spacings of points: between points there is nothing, but a span is looked at all along.
const SPACINGS: f64 = 2.0;
/// Share of a chain's length that its pieces must cover to stand for it.
const COVER: f64 = 0.99;

/// The spans of a chain; `None` where it is not a sharp convex edge all along. `pieces` are all of the shape's, the chain's from index `first` to
/// before `end`; `sharpest` is the largest curvature of a partner's convex face, 1/mm.
pub(crate) fn spans(
    surface: &ExactSurface,
    chain: &Chain<'_>,
    pieces: &[EdgePiece],
    (first, end): (usize, usize),
    sharpest: f64,
    options: &PointshellOptions,
) -> Option<Vec<ShellPoint>> {
    let own = pieces.get(first..end)?;
    let covered: f64 = own.iter().map(EdgePiece::length).sum();
    if own.is_empty() || end > usize::from(NO_PIECE) || covered < COVER * chain.length() {
        return None;
    }
    let mut points = Vec::new();
    for (index, piece) in (first..end).zip(own) {
        let count = count(piece, sharpest, options);
        for k in 0..count {
            let ends = [k, k + 1].map(|k| 2.0 * k as f64 / count as f64 - 1.0);
            let (boundary, position) = chain.at(piece.arc_length(0.5 * (ends[0] + ends[1])));
            let normal = surface.topology.piece_normal(surface.shape(), boundary, position);
            let faces = piece.faces();
            points.push(ShellPoint {
                position,
                normal: normal.try_normalize()?,
                face: faces[0] as u16,
                edge_face: if faces[0] == faces[1] {
                    NO_FACE
                } else {
                    faces[1] as u16
                },
                span: Some(ShellSpan {
                    piece: index as u16,
                    ends,
                    hull: piece.hull_between(ends, position),
                }),
            });
        }
    }
    Some(points)
}

/// Number of spans of a piece.
fn count(piece: &EdgePiece, sharpest: f64, options: &PointshellOptions) -> usize {
    let length = piece.length();
    let by_partner = length * sharpest.min(1e9) / SHARE_OF_RADIUS;
    // No more than points would be.
    let by_points =
        length * ((piece.curvature_outward() + sharpest.min(1e9)) / (8.0 * options.epsilon_mm)).sqrt();
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
