//! Normal test of a sample against a face: two surfaces touch only where their outward normals oppose each other.
//!
//! Parts that press on each other overlap by a fraction of a micrometre. Where the rim of a shaft passes the rim of its bore, a sample on the shaft's
//! rim lies before the end face of the other part, inside its outline by that overlap. By distance alone the end face would be nearest, and it pushes
//! along the axis: a peg leaving its hole hooked behind the rim and stopped there under 0.7 N. The sample's own outward normal, however, points the
//! same way as that of the end face, so no surface at the sample can touch it. The side face, which can touch, is covered by the neighbouring
//! samples.
//!
//! A contact with normal m (outward from the face) needs −m in the cone of the normals that meet at the sample. Inside a face that is −m = n; along a
//! convex edge n is the middle of the cone, whose half-angle is below 90°, so that m·n ≤ 0 either way.
//!
//! Evaluated only at convex edges and corners of the other part, where more than one face is near: about 60 instructions on a Cortex-M7.

use glam::Vec3;
use mortise_protocol::image::{NO_FACE, Nearby, PointRecord, oct_decode};

use crate::collision::directed_pair::DirectedPair;

/// Largest m·n at which a sample along an edge can touch: a blade, whose cone is nearly a half-space, must not be lost to rounding.
const EDGE_COSINE: f32 = 0.1;
/// Largest m·n at which a sample inside a face can touch. Contact is at m·n = −1 but for tilts and curvature within the margin; this allows 84°.
const FACE_COSINE: f32 = -0.1;

/// Whether the sample's surface cannot touch a face of outward normal `normal` (field frame) at a convex edge.
#[inline]
pub(crate) fn faces_away(pair: &DirectedPair<'_>, nearby: Nearby, point: &PointRecord, normal: Vec3) -> bool {
    if !matches!(nearby, Nearby::Convex(_)) {
        return false;
    }
    let own = pair.to_field.turn(Vec3::from_array(oct_decode(point.normal)));
    let most = if point.edge_face == NO_FACE {
        FACE_COSINE
    } else {
        EDGE_COSINE
    };
    // The decoded normal's length is between 1/√3 and 1; squares avoid a division.
    let along = own.dot(normal);
    along * along.abs() > most * most.abs() * own.length_squared()
}
