//! Whether a sample can touch a face: two surfaces touch only where their outward normals oppose each other.
//!
//! Parts that press each other overlap by a fraction of a micrometre. Where the rim of a shaft then passes the rim of its bore, a sample of the one
//! rim stands before the face that ends the other part, inside its outline by that overlap. The nearest face alone would be the end, which pushes
//! along the axis: a peg leaving its hole hooked behind the rim and stopped there under 0.7 N. But the sample's own outward normal points the same way
//! as that end's, so no surface at the sample can touch it; its side, which can, is felt by the samples around.
//!
//! Contact with normal m (outward from the face) needs −m in the cone of the normals that meet at the sample. Inside a face that is −m = n; along
//! a convex edge n is the middle of the cone, whose half-angle is below 90°, so that m·n ≤ 0 either way.
//!
//! Asked only at convex edges and corners of the other part, where more than one face is near: about 60 instructions on a Cortex-M7.

use glam::Vec3;
use mortise_protocol::image::{NO_FACE, Nearby, PointRecord, oct_decode};

use crate::collision::directed_pair::DirectedPair;

/// Largest m·n of a sample along an edge that counts as touching: a blade, whose cone is nearly a half-space, must not be lost to rounding.
const EDGE_COSINE: f32 = 0.1;
/// Of a sample inside a face, which touches at m·n = −1 but for tilts and curvature within the margin: 84° leave that out of the question.
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
    // The code's length is between 1/√3 and 1: squared rather than divided by.
    let along = own.dot(normal);
    along * along.abs() > most * most.abs() * own.length_squared()
}
