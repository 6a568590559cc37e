//! How large a ball can leave: a bound from above, for a distance that changes by no more than its point moves.
//!
//! Space is divided into cells; the distance at a cell's middle plus half of its diagonal bounds those in the cell. The widest way over cells from the start to the outside bounds every way
//! of a point, and the cells on it that are not certain are divided until it is certain that no way is wide enough, or likely that one is.

use std::cmp::Ordering;
use std::collections::{BinaryHeap, HashMap};

use glam::DVec3;

/// Cells along the longest side of the box at first.
const FIRST: i32 = 12;
/// Most evaluations of the distance, and deepest division.
const MOST_CELLS: usize = 30_000;
const DEEPEST: u32 = 18;

/// Level, and place in cells of that level.
type Key = (u32, [i32; 3]);

struct Open {
    width: f64,
    key: Key,
}

impl PartialEq for Open {
    fn eq(&self, o: &Self) -> bool {
        self.cmp(o) == Ordering::Equal
    }
}

impl Eq for Open {}

impl PartialOrd for Open {
    fn partial_cmp(&self, o: &Self) -> Option<Ordering> {
        Some(self.cmp(o))
    }
}

impl Ord for Open {
    fn cmp(&self, o: &Self) -> Ordering {
        self.width.total_cmp(&o.width).then(self.key.cmp(&o.key))
    }
}

struct Space<'a> {
    distance: &'a dyn Fn(DVec3) -> f64,
    low: DVec3,
    cell: f64,
    counts: [i32; 3],
    /// Distance at the middle of every undivided cell.
    leaves: HashMap<Key, f64>,
    evaluated: usize,
}

impl Space<'_> {
    fn size(&self, level: u32) -> f64 {
        self.cell / f64::from(1u32 << level)
    }

    fn half_diagonal(&self, level: u32) -> f64 {
        self.size(level) * 3f64.sqrt() / 2.0
    }

    fn middle(&self, (level, at): Key) -> DVec3 {
        self.low + DVec3::from_array(at.map(|i| f64::from(i) + 0.5)) * self.size(level)
    }

    fn add(&mut self, key: Key) {
        let d = (self.distance)(self.middle(key));
        self.evaluated += 1;
        self.leaves.insert(key, d);
    }

    fn divide(&mut self, key: Key) {
        if self.leaves.remove(&key).is_none() {
            return;
        }
        for child in 0..8 {
            let at = [0, 1, 2].map(|i| 2 * key.1[i] + ((child >> i) & 1));
            self.add((key.0 + 1, at));
        }
    }

    /// Most that a point in a cell can be away.
    fn upper(&self, key: Key) -> f64 {
        self.leaves
            .get(&key)
            .map_or(f64::NEG_INFINITY, |d| d + self.half_diagonal(key.0))
    }

    fn inside(&self, (level, at): Key) -> bool {
        (0..3).all(|i| at[i] >= 0 && at[i] < self.counts[i] << level)
    }

    /// Undivided cells beside one; whether one of its sides is a side of the box.
    fn beside(&self, (level, at): Key, found: &mut Vec<Key>) -> bool {
        let mut outside = false;
        for axis in 0..3 {
            for sign in [-1, 1] {
                let mut next = at;
                next[axis] += sign;
                if !self.inside((level, next)) {
                    outside = true;
                    continue;
                }
                // A larger or equal cell.
                let larger = (0..=level).rev().map(|l| (l, next.map(|i| i >> (level - l))));
                if let Some(key) = larger.into_iter().find(|k| self.leaves.contains_key(k)) {
                    found.push(key);
                    continue;
                }
                // Smaller ones on the side that is common.
                let mut open = vec![(level, next)];
                while let Some((l, place)) = open.pop() {
                    if self.leaves.contains_key(&(l, place)) {
                        found.push((l, place));
                    } else if l < DEEPEST {
                        let near = i32::from(sign < 0);
                        for child in 0..8 {
                            let bits = [0, 1, 2].map(|i| (child >> i) & 1);
                            if bits[axis] == near {
                                open.push((l + 1, [0, 1, 2].map(|i| 2 * place[i] + bits[i])));
                            }
                        }
                    }
                }
            }
        }
        outside
    }

    fn leaf_of(&self, p: DVec3) -> Option<Key> {
        (0..=DEEPEST).find_map(|level| {
            let size = self.cell / f64::from(1u32 << level);
            let at = ((p - self.low) / size).floor();
            let key = (level, at.to_array().map(|x| x as i32));
            self.leaves.contains_key(&key).then_some(key)
        })
    }

    /// The way over cells from the one of `start` to a side of the box whose least bound is largest: that bound, and the cells.
    fn widest(&self, start: DVec3) -> (f64, Vec<Key>) {
        let Some(first) = self.leaf_of(start) else {
            return (f64::INFINITY, Vec::new());
        };
        let mut from: HashMap<Key, Key> = HashMap::from([(first, first)]);
        let mut open = BinaryHeap::from([Open {
            width: self.upper(first),
            key: first,
        }]);
        let mut beside = Vec::new();
        while let Some(Open { width, key }) = open.pop() {
            beside.clear();
            if self.beside(key, &mut beside) {
                let mut way = vec![key];
                let mut at = key;
                while at != first {
                    at = from.get(&at).copied().unwrap_or(first);
                    way.push(at);
                }
                return (width, way);
            }
            for &next in &beside {
                from.entry(next).or_insert_with(|| {
                    open.push(Open {
                        width: width.min(self.upper(next)),
                        key: next,
                    });
                    key
                });
            }
        }
        (f64::NEG_INFINITY, Vec::new())
    }
}

/// An upper bound of the radius with which a ball at `start` can leave the box `low`..`high`, when it is below `radius`; `None` where a way is likely, or the
/// question is too hard. `distance` of a point from the obstacle changes by no more than the point moves. The bound is tightened to `within` mm where that is cheap.
pub(crate) fn widest_below(
    distance: &dyn Fn(DVec3) -> f64,
    start: DVec3,
    [low, high]: [DVec3; 2],
    radius: f64,
    within: f64,
    over: &dyn Fn() -> bool,
) -> Option<f64> {
    let extent = high - low;
    let cell = extent.max_element() / f64::from(FIRST);
    let mut space = Space {
        distance,
        low,
        cell,
        counts: extent.to_array().map(|e| ((e / cell).ceil() as i32).max(1)),
        leaves: HashMap::new(),
        evaluated: 0,
    };
    for x in 0..space.counts[0] {
        for y in 0..space.counts[1] {
            for z in 0..space.counts[2] {
                space.add((0, [x, y, z]));
            }
        }
    }
    let mut bound = None;
    loop {
        let (width, way) = space.widest(start);
        let certain = width < radius;
        if certain {
            bound = Some(width.max(0.0));
        }
        // The narrowest cell of the way, of those that a ball of this radius is not known to pass; it and what is beside it on the way are divided. Always the
        // narrowest one, so that of a long passage one cross-section is divided and not all of it.
        let open = |k: &Key| certain || space.leaves.get(k).is_none_or(|&d| d < radius);
        let narrowest =
            (way.iter().copied().filter(open)).min_by(|a, b| space.upper(*a).total_cmp(&space.upper(*b)));
        let Some(narrow) = narrowest else { return bound };
        if space.half_diagonal(narrow.0) < within
            || narrow.0 >= DEEPEST
            || space.evaluated > MOST_CELLS
            || over()
        {
            return bound;
        }
        let before = space.evaluated;
        let at = space.middle(narrow);
        for key in way {
            if key.0 <= narrow.0
                && space.middle(key).distance(at) < 1.1 * space.size(key.0).max(space.size(narrow.0))
            {
                space.divide(key);
            }
        }
        if space.evaluated == before {
            return bound;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        /// A plate with a round hole, closed around the start by a sphere of wall: the bound is the hole's radius, to within the tolerance and never below.
        #[test]
        fn a_ball_leaves_a_shell_through_its_hole(hole in 0.5..3.0f64, x in -1.0..1.0f64, y in -1.0..1.0f64) {
            // A thin sphere of radius 5 but for a cap: distance to it.
            let rim = (25.0 - hole * hole).sqrt();
            let shell = |p: DVec3| {
                let on = p.normalize_or(DVec3::NEG_Z) * 5.0;
                if on.z <= rim {
                    return p.distance(on);
                }
                let across = DVec3::new(p.x, p.y, 0.0).normalize_or(DVec3::X);
                p.distance(across * hole + DVec3::Z * rim)
            };
            let start = DVec3::new(x, y, 0.0);
            let (low, high) = (DVec3::splat(-12.0), DVec3::splat(12.0));
            let bound = widest_below(&shell, start, [low, high], 3.9, 1e-3, &|| false);
            let Some(bound) = bound else { return Err(TestCaseError::fail("no bound")) };
            prop_assert!(bound >= hole - 1e-9 && bound < hole + 2e-2, "{bound} {hole}");
            // What is smaller leaves.
            prop_assert_eq!(widest_below(&shell, start, [low, high], 0.9 * hole, 1e-3, &|| false), None);
        }
    }
}
