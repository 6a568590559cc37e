//! Places of a cell where the surfaces of a rule meet each other and the cell's sides: where a rule is wrong between its tests, it is wrong there too.
//!
//! A round beyond a cell can be nearest in a corner of it, however small, in which a rule of the two faces beside the round continues these to their
//! sharp edge, up to 0.41 radii off the boundary. No lattice of tests meets each such corner. But places of a wrong sign are bounded by the boundary
//! and by places at which the rule is zero. The latter are parts of the rule's surfaces, which end where these meet each other or leave the cell:
//! that is where the boundary must be. And the magnitude of a rule can exceed the distance most where the rule changes from one surface to another.
//!
//! Distances to surfaces are 1-Lipschitz: a part of the cell whose middle is farther from a surface than its half diagonal holds no place of it.

use glam::{DMat3, DVec3};

/// Parts of a cell along its edge: so many that Newton's steps from a part's middle converge where surfaces bend over half a cell.
const PARTS: usize = 4;
/// Newton steps to a meeting: each squares the error, and the last ones are at the level of rounding.
const STEPS: usize = 6;
/// Step of differences, as a share of a part: they need the direction only.
const DIFFERENCE: f64 = 1e-3;
/// Largest distance of a meeting from its surfaces, mm: rounding in single precision, as patches have it, at some centimetres.
const REACHED_MM: f64 = 2e-5;

/// A box of a cell's size.
#[derive(Clone, Copy)]
pub(crate) struct Extent {
    pub low: DVec3,
    pub high: DVec3,
}

/// A cube in the cell, a square of its sides, or a piece of its edges: its middle, its half edge, and the axes along which it extends.
#[derive(Clone, Copy)]
struct Part {
    middle: DVec3,
    half: f64,
    free: [bool; 3],
}

impl Part {
    /// Number of axes along which it extends: as many surfaces meet in single places of it.
    fn dimensions(&self) -> usize {
        self.free.iter().filter(|free| **free).count()
    }

    /// Largest distance of its places from its middle.
    fn radius(&self) -> f64 {
        self.half * (self.dimensions() as f64).sqrt()
    }

    /// Place in it, or next to it, where the functions are zero, as many as it has dimensions.
    fn meeting(&self, functions: &[&dyn Fn(DVec3) -> f64]) -> Option<DVec3> {
        let step = DIFFERENCE * self.half;
        let mut p = self.middle;
        for _ in 0..STEPS {
            let (mut rows, mut values) = (DMat3::IDENTITY, DVec3::ZERO);
            let axes = (0..3).filter(|&axis| self.free[axis]);
            for (row, function) in axes.zip(functions) {
                let value = function(p);
                let slope = |axis: usize| {
                    let mut beside = p;
                    beside[axis] += step;
                    (function(beside) - value) / step
                };
                values[row] = value;
                // Rows are columns until transposed.
                *rows.col_mut(row) = DVec3::from_array(std::array::from_fn(|axis| {
                    if self.free[axis] { slope(axis) } else { 0.0 }
                }));
            }
            let rows = rows.transpose();
            // False for NaN.
            let is_clear = rows.determinant().abs() > 1e-6;
            if !is_clear {
                return None;
            }
            p -= rows.inverse() * values;
            let is_near = (p - self.middle).abs().max_element() <= 3.0 * self.half;
            if !is_near {
                return None;
            }
        }
        let is_reached = functions.iter().all(|function| function(p).abs() <= REACHED_MM);
        let is_here = (p - self.middle).abs().max_element() <= self.half * (1.0 + 1e-6);
        (is_reached && is_here).then_some(p)
    }
}

impl Extent {
    /// Its inside, its sides and its edges.
    fn whole(self) -> impl Iterator<Item = Part> {
        let (middle, half) = (0.5 * (self.low + self.high), 0.5 * (self.high.x - self.low.x));
        (0..27).filter_map(move |i| {
            let way = [i % 3, i / 3 % 3, i / 9].map(|i| f64::from(i) - 1.0);
            let free = way.map(|way| way == 0.0);
            free.contains(&true).then(|| Part {
                middle: middle + DVec3::from_array(way) * half,
                half,
                free,
            })
        })
    }
}

impl Part {
    /// [`PARTS`] of it along each of its axes.
    fn divided(self) -> impl Iterator<Item = Self> {
        let half = self.half / PARTS as f64;
        let along = self.free.map(|free| if free { PARTS } else { 1 });
        (0..along[0] * along[1] * along[2]).map(move |i| {
            let place = [i % along[0], i / along[0] % along[1], i / along[0] / along[1]];
            let way = |axis: usize| (2 * place[axis] + 1) as f64 - along[axis] as f64;
            Self {
                middle: self.middle + DVec3::from_array(std::array::from_fn(way)) * half,
                half,
                ..self
            }
        })
    }

    /// Those of the functions, which change by at most `slope` of the way, that can be zero in it.
    fn near<'a>(&self, functions: &[&'a dyn Fn(DVec3) -> f64], slope: f64) -> Vec<&'a dyn Fn(DVec3) -> f64> {
        let mut near = functions.to_vec();
        near.retain(|function| function(self.middle).abs() <= slope * self.radius());
        near
    }

    /// Meetings in it of as many of the functions as it has dimensions.
    fn add_meetings(self, functions: &[&dyn Fn(DVec3) -> f64], slope: f64, found: &mut Vec<DVec3>) {
        let count = self.dimensions();
        let near = self.near(functions, slope);
        if near.len() < count {
            return;
        }
        for part in self.divided() {
            let near = part.near(&near, slope);
            for chosen in combinations(near.len(), count) {
                let chosen: Vec<_> = chosen.into_iter().map(|i| near[i]).collect();
                found.extend(part.meeting(&chosen));
            }
        }
    }
}

/// Places where surfaces meet each other and the sides of a box; `distances` are those to the surfaces.
pub(crate) fn meetings(of: Extent, distances: &[&dyn Fn(DVec3) -> f64]) -> Vec<DVec3> {
    let mut found = Vec::new();
    for part in of.whole() {
        part.add_meetings(distances, 1.0, &mut found);
    }
    found
}

/// Places on the edges of a box that are equally far from two surfaces.
pub(crate) fn bends(of: Extent, distances: &[&dyn Fn(DVec3) -> f64]) -> Vec<DVec3> {
    let mut found = Vec::new();
    for pair in combinations(distances.len(), 2) {
        let difference = |p: DVec3| distances[pair[0]](p) - distances[pair[1]](p);
        for part in of.whole().filter(|part| part.dimensions() == 1) {
            part.add_meetings(&[&difference], 2.0, &mut found);
        }
    }
    found
}

/// A lattice of a box with this number of places along each edge.
pub(crate) fn lattice(of: Extent, across: usize) -> impl Iterator<Item = DVec3> {
    (0..across * across * across).map(move |i| {
        let place = [i % across, i / across % across, i / across / across];
        let share = DVec3::from_array(place.map(|i| i as f64)) / (across - 1) as f64;
        of.low + (of.high - of.low) * share
    })
}

/// All choices of `count` of the first `of` numbers, each ascending.
fn combinations(of: usize, count: usize) -> Vec<Vec<usize>> {
    if count > of {
        return Vec::new();
    }
    let mut all: Vec<Vec<usize>> = vec![Vec::new()];
    for _ in 0..count {
        let longer = all.iter().flat_map(|chosen| {
            let first = chosen.last().map_or(0, |last| last + 1);
            (first..of).map(|next| [chosen.as_slice(), &[next]].concat())
        });
        all = longer.collect();
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Least determinant of the normals of surfaces that meet, with those of the sides they meet in: Newton's steps from a part's middle then end at the
    /// meeting.
    const CLEAR: f64 = 0.2;

    fn unit(v: [f64; 3]) -> DVec3 {
        DVec3::from_array(v).try_normalize().unwrap_or(DVec3::X)
    }

    proptest! {
        /// Spheres and planes through a place inside the box, on its sides or on its edges, as many as meet in single places there: the place is found.
        #[test]
        fn every_clear_meeting_is_found(
            p in prop::array::uniform3(0.02f64..0.98),
            on_sides in prop::array::uniform3(prop::option::of(prop::bool::ANY)),
            surfaces in prop::array::uniform3((prop::array::uniform3(-1.0f64..1.0), 0.5f64..20.0, prop::bool::ANY)),
            cell in 0.1f64..5.0,
        ) {
            let low = DVec3::new(3.0, -2.0, 7.0);
            let share: [f64; 3] = std::array::from_fn(|a| on_sides[a].map_or(p[a], f64::from));
            let at = low + DVec3::from_array(share) * cell;
            let free: Vec<usize> = (0..3).filter(|&a| on_sides[a].is_none()).collect();
            prop_assume!(!free.is_empty());
            let normals: Vec<DVec3> = surfaces.iter().map(|of| unit(of.0)).collect();
            let mut rows = DMat3::IDENTITY;
            for (&axis, normal) in free.iter().zip(&normals) {
                let own = |a: usize| if free.contains(&a) { normal[a] } else { 0.0 };
                *rows.col_mut(axis) = DVec3::from_array(std::array::from_fn(own));
            }
            prop_assume!(rows.determinant().abs() > CLEAR);
            let all: Vec<_> = (normals.iter().zip(&surfaces).take(free.len()))
                .map(|(&normal, &(_, radius, is_plane))| move |q: DVec3| {
                    let radius = radius * cell;
                    if is_plane { (q - at).dot(normal) } else { q.distance(at - normal * radius) - radius }
                })
                .collect();
            let all: Vec<&dyn Fn(DVec3) -> f64> = all.iter().map(|of| of as _).collect();
            let found = meetings(Extent { low, high: low + cell }, &all);
            prop_assert!(found.iter().any(|q| q.distance(at) < 1e-3 * cell), "{at} {found:?}");
        }
    }

    #[test]
    fn combinations_are_complete() {
        assert_eq!(combinations(3, 2), [[0, 1], [0, 2], [1, 2]]);
        assert_eq!(combinations(5, 3).len(), 10);
        assert!(combinations(1, 2).is_empty());
    }
}
