//! Side from which the points of a leaf came to a part.
//!
//! Past the middle of a thin part the nearest surface is the one on the other side, and its normal would pull a point through. A point whose normal
//! turns round from one tick to the next while it is deep behind the surface that its leaf touched before stays on that surface: its gap is the
//! distance from the surface's tangent plane of then. Only ticks that are deep or fast look at this, so that a part at rest costs nothing more.

use glam::Vec3;
use heapless::Vec;

use crate::collision::exact_surface::OnFace;
use crate::collision::node_cursor::NodeCursor;

/// Leaves whose sides are kept, the deepest ones: a thin part that is deep in another is held at few places.
const LEAVES: usize = 12;
/// Depth, m, from which a side counts: less than a fifth of a thin sheet, more than a hand's force presses.
const DEEP_M: f32 = 20e-6;
/// Way of the object in a tick, m, from which every side within the margin counts: a point may come to the far side before it has been deep.
const FAST_M: f32 = 50e-6;
/// Depth behind a tangent plane, m, from which it no longer stands for its surface.
const DEEPEST_M: f32 = 1e-3;
/// Cosine of the angle by which a normal turns when a point comes to the other side: 120°.
const OTHER_SIDE: f32 = -0.5;

/// Tangent plane of the surface that the deepest point of a leaf is nearest to, in the frame of the field.
#[derive(Clone, Copy, Debug)]
struct Side {
    leaf: NodeCursor,
    normal: Vec3,
    /// Coordinate of the plane along the normal, m.
    offset: f32,
    /// Signed distance of the deepest point, m.
    gap: f32,
    face: u16,
    edge_face: u16,
}

/// Sides of this tick and of the last one.
#[derive(Clone, Debug)]
pub(crate) struct Sides {
    lists: [Vec<Side, LEAVES>; 2],
    /// Index of this tick's list: 0 or 1.
    current: usize,
}

impl Sides {
    pub const fn new() -> Self {
        Self {
            lists: [Vec::new(), Vec::new()],
            current: 0,
        }
    }

    /// Forgets all sides.
    pub fn clear(&mut self) {
        self.lists.iter_mut().for_each(Vec::clear);
    }

    /// Begins a tick.
    pub fn begin(&mut self) {
        self.current = 1 - self.current;
        self.lists[self.current].clear();
    }

    /// Whether the last tick kept any side.
    #[inline]
    pub fn any(&self) -> bool {
        !self.lists[1 - self.current].is_empty()
    }

    /// Whether the side of a point with this gap, m, is to be kept where the object moved by `way`, m, in the last tick.
    #[inline]
    pub fn concerns(gap: f32, way: f32) -> bool {
        gap < -DEEP_M || way > FAST_M
    }

    /// Keeps the side of a point `p` of a leaf, if no deeper one is known.
    pub fn keep(&mut self, leaf: NodeCursor, p: Vec3, found: &OnFace) {
        let side = Side {
            leaf,
            normal: found.normal,
            offset: found.normal.dot(p) - found.distance,
            gap: found.distance,
            face: found.face,
            edge_face: found.edge_face,
        };
        let list = &mut self.lists[self.current];
        // The points of a leaf come one after the other.
        if let Some(last) = list.last_mut().filter(|last| last.leaf == leaf) {
            if side.gap < last.gap {
                *last = side;
            }
        } else if list.push(side).is_err()
            && let Some(least) = list.iter_mut().max_by(|a, b| a.gap.total_cmp(&b.gap))
            && side.gap < least.gap
        {
            *least = side;
        }
    }

    /// Surface of a point `p` of a leaf: `found`, or the one that the leaf touched in the last tick where `found` lies on the other side of the part.
    pub fn surface(&self, leaf: NodeCursor, p: Vec3, found: OnFace) -> OnFace {
        let last = &self.lists[1 - self.current];
        let Some(side) = last.iter().find(|side| side.leaf == leaf) else {
            return found;
        };
        let gap = side.normal.dot(p) - side.offset;
        if side.normal.dot(found.normal) > OTHER_SIDE || !(-DEEPEST_M..-DEEP_M).contains(&gap) {
            return found;
        }
        OnFace {
            distance: gap,
            normal: side.normal,
            face: side.face,
            edge_face: side.edge_face,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEAF: NodeCursor = NodeCursor { pair: 2, node: 7 };

    /// Nearest surface of a sheet of this thickness below z = 0.
    fn sheet(z: f32, thick: f32) -> OnFace {
        let (top, bottom) = (z, -thick - z);
        OnFace {
            distance: if top > bottom { top } else { bottom },
            normal: if top > bottom { Vec3::Z } else { -Vec3::Z },
            face: u16::from(top <= bottom),
            edge_face: 0,
        }
    }

    /// A point pushed into a sheet from above stays on the upper face as deep as it gets, and one that came from below stays below.
    #[test]
    fn a_point_stays_on_the_side_from_which_it_came() {
        for from_above in [true, false] {
            let (thick, mut sides) = (0.2e-3f32, Sides::new());
            for step in 0..30 {
                let depth = 10e-6 * step as f32 + 10e-6;
                let z = if from_above { -depth } else { depth - thick };
                let p = Vec3::new(0.01, -0.02, z);
                sides.begin();
                let found = sides.surface(LEAF, p, sheet(z, thick));
                assert!(
                    (found.distance + depth).abs() < 1e-8,
                    "{found:?}",
                    found = found.distance
                );
                assert_eq!(found.face, u16::from(!from_above));
                if Sides::concerns(found.distance, 0.0) {
                    sides.keep(LEAF, p, &found);
                }
            }
        }
    }

    /// In a slot a point that leaves one wall for the other touches the other.
    #[test]
    fn a_point_that_left_a_surface_forgets_it() {
        let mut sides = Sides::new();
        let wall = |normal: Vec3, distance: f32| OnFace {
            distance,
            normal,
            face: 0,
            edge_face: 0,
        };
        sides.keep(LEAF, Vec3::ZERO, &wall(Vec3::X, -50e-6));
        sides.begin();
        assert!(sides.any());
        let other = wall(-Vec3::X, -30e-6);
        let found = sides.surface(LEAF, Vec3::X * 60e-6, other);
        assert_eq!(found.normal, other.normal);
        let elsewhere = NodeCursor { node: 8, ..LEAF };
        assert_eq!(sides.surface(elsewhere, Vec3::ZERO, other).normal, other.normal);
    }
}
