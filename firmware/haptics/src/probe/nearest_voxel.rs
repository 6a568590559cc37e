//! Deepest point of one part against a voxmap of the other.

use mortise_protocol::image::Voxel;

use crate::baseline::occupancy::{TangentPlane, inward, shrunk};
use crate::collision::directed_pair::DirectedPair;
use crate::io::Flags;
use crate::probe::nearest::{Measure, Nearest, Progress};

/// Deepest point of a pair against a voxmap, by the method's own distances: depth to a tangent plane, else only a lower bound of the gap.
///
/// Queries every point that may be nearer to a surface voxel than the nearest so far.
pub(crate) fn nearest_voxel(pair: &DirectedPair<'_>, shrunk_m: f32, progress: &mut Progress) {
    let Progress { best, work, .. } = progress;
    let mut index = 0;
    while let Some(node) = pair.nodes.get(index) {
        work.nodes += 1;
        let center = pair.to_field.apply(node.center);
        if pair.field.bound(center.to_array()) - (node.radius + shrunk_m) > best.distance_m {
            index = node.skip as usize;
            continue;
        }
        index += 1;
        if node.skip as usize != index {
            continue;
        }
        for point in node.points(pair.points) {
            work.points += 1;
            let position = shrunk(point, shrunk_m);
            let p = pair.to_field.apply(position);
            let sample = pair.field.voxel(p.to_array());
            let (distance_m, in_band) = match sample.voxel {
                Voxel::Free => (sample.bound, false),
                Voxel::Proximity => (0.0, false),
                Voxel::Interior => {
                    work.flags.insert(Flags::DEEP);
                    (0.0, false)
                }
                Voxel::Surface => {
                    let gap = TangentPlane::of(pair, inward(point), p, &sample).gap;
                    if gap < best.field_distance_m {
                        best.field_distance_m = gap;
                    }
                    // Above the plane the point may still touch: the surface is somewhere in the voxel.
                    if gap < 0.0 { (gap, true) } else { (0.0, false) }
                }
            };
            if distance_m < best.distance_m {
                *best = Nearest {
                    distance_m,
                    field_distance_m: best.field_distance_m,
                    error_m: f32::INFINITY,
                    exact: false,
                    measure: Measure::DeepestPoint,
                    in_band,
                    arm: pair.to_arm.apply(position),
                    moving_face: point.face,
                    fixed_face: sample.faces[0],
                };
            }
        }
    }
}
