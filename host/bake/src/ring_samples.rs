//! A ring of points on a shaft beside its rim, for contacts where that rim passes the rim of a bore.
//!
//! In that contact the rims are h apart along the axis and the side of the shaft is p deep in the wall. The samples of either rim are then h from a
//! flat, so they find min(p, h), and where h < p they push along the axis only, regardless of the side's depth. A ring on the side, δ from the rim,
//! finds min(p, δ − h): together they find all of p up to δ/2. With δ = 4ε the side is found up to a depth of 2ε. On a shaft tilted by α the ring is
//! shallower than the rim by δ·tan α, which is at most ε up to 14°.
//!
//! Round the shaft the depth decreases as s²/8·(κ − κ' + 2ε·κ²), where κ is the curvature of the shaft, κ' that of the loosest bore it fits (see
//! [`crate::fits`]), and the last term the clearance that a depth of 2ε adds between both: four points in a tight fit. Shafts that fit no bore have
//! no ring.

use mortise_brep::Surface;
use mortise_protocol::image::NO_FACE;

use crate::distance::ExactSurface;
use crate::piece::{Link, Piece, PieceCurve};
use crate::shell::{PointshellOptions, ShellPoint};
use crate::surface::natural_normal;

/// Distance of the ring from the rim, in error bounds.
const BESIDE: f64 = 4.0;
/// Depth up to which the ring finds the side, in error bounds.
const DEPTH: f64 = 0.5 * BESIDE;
/// Most points of a ring.
const MAX_POINTS: f64 = 1000.0;

/// Appends the ring beside `chain`, a convex edge, if that is the rim of a shaft.
pub(crate) fn sample_ring(
    surface: &ExactSurface,
    chain: &[Link],
    options: &PointshellOptions,
    out: &mut Vec<ShellPoint>,
) {
    let piece = |&(i, _): &Link| &surface.topology.pieces[i as usize];
    let Some(rim) = chain.first().and_then(|link| rim(surface, piece(link))) else {
        return;
    };
    let Some(room) = options.partners.room(rim.radius) else {
        return;
    };
    let length: f64 = chain.iter().map(|link| piece(link).length()).sum();
    let falls_off = room + DEPTH * options.epsilon_mm / rim.radius.powi(2);
    let by_bound = length * (falls_off / (8.0 * options.epsilon_mm)).sqrt();
    let count = (by_bound - 1e-9).ceil().clamp(1.0, MAX_POINTS) as usize;
    let (mut at, mut walked) = (0, 0.0);
    for k in 0..count {
        let target = length * (k as f64 + 0.5) / count as f64;
        while at + 1 < chain.len() && walked + piece(&chain[at]).length() < target {
            walked += piece(&chain[at]).length();
            at += 1;
        }
        let here = piece(&chain[at]);
        let t = ((target - walked) / here.length().max(1e-300)).clamp(0.0, 1.0);
        let on_rim = here.at(if chain[at].1 { t } else { 1.0 - t });
        let Some(own) = self::rim(surface, here).filter(|own| own.face == rim.face) else {
            continue;
        };
        let position = on_rim + own.inward * (BESIDE * options.epsilon_mm);
        let kind = &surface.shape().faces[own.face as usize].surface;
        if surface.contains(own.face, position)
            && let Some(normal) = natural_normal(kind, position)
        {
            out.push(ShellPoint {
                position,
                normal,
                face: own.face as u16,
                edge_face: NO_FACE,
                span: None,
            });
        }
    }
}

/// The shaft beside a piece of its rim.
struct Rim {
    face: u32,
    radius: f64,
    /// Unit vector along the axis, from the rim onto the shaft.
    inward: glam::DVec3,
}

/// `piece` as an arc round a shaft; `None` if it is not one.
fn rim(surface: &ExactSurface, piece: &Piece) -> Option<Rim> {
    let PieceCurve::Arc { axis, .. } = piece.curve else {
        return None;
    };
    piece.sides.iter().find_map(|side| {
        let Surface::Cylinder { frame, radius } = surface.shape().faces[side.face as usize].surface else {
            return None;
        };
        let shaft = surface.topology.sense[side.face as usize] > 0.0;
        // An oblique cut is an ellipse, not an arc; this excludes an arc that only touches the shaft.
        let around = axis.dot(frame.z).abs() > 1.0 - 1e-9;
        let at = piece.at(0.5);
        let along = piece.tangent(at) * if side.forward { 1.0 } else { -1.0 };
        // The face lies on the left of its side.
        let inward = surface
            .topology
            .outward(surface.shape(), side.triangle, at)
            .cross(along);
        (shaft && around).then(|| Rim {
            face: side.face,
            radius,
            inward: frame.z * frame.z.dot(inward).signum(),
        })
    })
}
