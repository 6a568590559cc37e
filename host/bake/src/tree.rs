//! The sphere tree over a pointshell, in preorder with skip links.

use glam::DVec3;
use mortise_protocol::image::NodeRecord;

/// Most points of a leaf.
pub const LEAF_POINTS: usize = 16;
/// Most pieces of edges of a leaf.
const LEAF_PIECES: usize = 4;

/// A tree and the order of points it refers to.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SphereTree {
    /// Nodes in preorder; lengths in the unit of the positions given.
    pub nodes: Vec<NodeRecord>,
    /// For each place in the new order, the old index of the point there.
    pub order: Vec<u32>,
}

/// Weight of a point's offset from the surface in the choice of the axis to halve.
const OFFSET_WEIGHT: f32 = 128.0;

/// Builds the tree over points and spans as they will be stored, each given by points whose convex hull contains it: it halves along the longest axis down to leaves of at most 16 points. Every sphere
/// contains all points below it, also in the board's `f32`. Cost: n log² n.
///
/// `offsets` (same unit; may be empty) are the points' distances from the surface. They count as a fourth axis, so that points of equal depth share a
/// leaf: they come near together, and a leaf with one near point is examined as a whole.
pub fn build_tree(hulls: &[[[f32; 3]; 3]], offsets: &[f32]) -> SphereTree {
    build(hulls, offsets, LEAF_POINTS)
}

/// Builds the tree over pieces of edges, each given by points whose convex hull contains it; leaves have at most 4 pieces.
pub(crate) fn build_edge_tree(hulls: &[[[f32; 3]; 3]]) -> SphereTree {
    build(hulls, &[], LEAF_PIECES)
}

/// Builds the tree over items of three points each.
fn build(items: &[[[f32; 3]; 3]], offsets: &[f32], leaf: usize) -> SphereTree {
    let mut tree = SphereTree {
        nodes: Vec::new(),
        order: (0..items.len() as u32).collect(),
    };
    if !items.is_empty() {
        split(items, offsets, leaf, &mut tree, 0, items.len());
    }
    tree
}

/// Number of nodes of the tree over `points` points.
pub(crate) fn node_count(points: usize) -> usize {
    count_nodes(points, LEAF_POINTS)
}

/// Number of nodes of the tree over this many pieces of edges.
pub(crate) fn edge_node_count(pieces: usize) -> usize {
    count_nodes(pieces, LEAF_PIECES)
}

fn count_nodes(items: usize, leaf: usize) -> usize {
    match items {
        0 => 0,
        n if n <= leaf => 1,
        n => 1 + count_nodes(n / 2, leaf) + count_nodes(n - n / 2, leaf),
    }
}

fn split(
    items: &[[[f32; 3]; 3]],
    offsets: &[f32],
    leaf: usize,
    tree: &mut SphereTree,
    first: usize,
    count: usize,
) {
    let run = &mut tree.order[first..first + count];
    let points: Vec<DVec3> = (run.iter().flat_map(|&i| items[i as usize]))
        .map(|p| DVec3::from_array(p.map(f64::from)))
        .collect();
    let (center, radius) = sphere(&points);
    let index = tree.nodes.len();
    tree.nodes.push(NodeRecord {
        center,
        radius,
        first_point: first as u32,
        point_count: count as u32,
        skip: 0,
    });
    if count > leaf {
        let along = |i: u32, axis: usize| match axis {
            3 => OFFSET_WEIGHT * offsets.get(i as usize).copied().unwrap_or(0.0),
            // The middle one stands for all.
            _ => items[i as usize][1][axis],
        };
        let extent: [f32; 4] = std::array::from_fn(|axis| {
            let range = run.iter().map(|&i| along(i, axis));
            range.clone().fold(f32::NEG_INFINITY, f32::max) - range.fold(f32::INFINITY, f32::min)
        });
        let axis = (0..4)
            .max_by(|&a, &b| extent[a].total_cmp(&extent[b]).then(b.cmp(&a)))
            .unwrap_or(0);
        // The index breaks ties, so the order is the same on every machine.
        run.sort_unstable_by(|&a, &b| along(a, axis).total_cmp(&along(b, axis)).then(a.cmp(&b)));
        let half = count / 2;
        split(items, offsets, leaf, tree, first, half);
        split(items, offsets, leaf, tree, first + half, count - half);
    }
    tree.nodes[index].skip = tree.nodes.len() as u32;
}

/// A small sphere about `points`: Ritter's, tightened by moving the centre towards the farthest point (Bădoiu & Clarkson 2003).
fn sphere(points: &[DVec3]) -> ([f32; 3], f32) {
    let farthest = |from: DVec3| {
        points
            .iter()
            .copied()
            .max_by(|a, b| a.distance_squared(from).total_cmp(&b.distance_squared(from)))
            .unwrap_or(from)
    };
    let lo = points.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let hi = points.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    let mut center = (lo + hi) / 2.0;
    let mut best = (farthest(center).distance(center), center);
    for i in 1..64 {
        let far = farthest(center);
        center += (far - center) / f64::from(i + 1);
        let radius = farthest(center).distance(center);
        if radius < best.0 {
            best = (radius, center);
        }
    }
    // Radius measured again from the centre as stored, rounded up.
    let stored = best.1.as_vec3();
    let radius = farthest(stored.as_dvec3()).distance(stored.as_dvec3());
    (stored.to_array(), round_up(radius))
}

/// The next `f32` not below `x`, increased by a millionth for the board's own rounding.
pub(crate) fn round_up(x: f64) -> f32 {
    let mut r = (x * (1.0 + 1e-6)) as f32;
    while f64::from(r) < x {
        r = r.next_up();
    }
    r
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Preorder, skip links, leaf size, containment, and every point exactly once.
        #[test]
        fn tree_is_sound(positions in prop::collection::vec(prop::array::uniform3(-1.0f32..1.0), 0..400)) {
            let hulls: Vec<_> = positions.iter().map(|&p| [p; 3]).collect();
            let tree = build_tree(&hulls, &[]);
            let mut seen = tree.order.clone();
            seen.sort_unstable();
            prop_assert_eq!(seen, (0..positions.len() as u32).collect::<Vec<_>>());
            prop_assert_eq!(tree.nodes.len(), node_count(positions.len()));
            let mut leaf_points = 0;
            for (i, node) in tree.nodes.iter().enumerate() {
                let leaf = node.skip as usize == i + 1;
                prop_assert!(node.skip as usize > i && node.skip as usize <= tree.nodes.len());
                let run = &tree.order[node.first_point as usize..][..node.point_count as usize];
                for &p in run {
                    let p = DVec3::from_array(positions[p as usize].map(f64::from));
                    prop_assert!(p.distance(DVec3::from_array(node.center.map(f64::from))) <= f64::from(node.radius));
                }
                if leaf {
                    prop_assert!(run.len() <= LEAF_POINTS);
                    leaf_points += run.len();
                } else {
                    let left = &tree.nodes[i + 1];
                    let right = &tree.nodes[left.skip as usize];
                    prop_assert_eq!(right.skip, node.skip);
                    prop_assert_eq!(left.point_count + right.point_count, node.point_count);
                    prop_assert_eq!(left.first_point, node.first_point);
                    prop_assert_eq!(right.first_point, node.first_point + left.point_count);
                }
            }
            prop_assert_eq!(leaf_points, positions.len());
        }
    }
}
