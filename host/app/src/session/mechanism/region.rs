//! The places that a handle reaches in a plane while two quantities run over their ranges: cells that fill them, and the folds at which they end.
//!
//! The ranges are cut into a grid. A cell where the links can be connected at some corners only is cut where they no longer can, found by bisection.
//! The picture of the rectangle folds back where the determinant of the derivatives changes its sign (links in line): these folds may lie farther out
//! than anything with a joint at its limit.

use glam::DVec2;

/// Cells of a side.
const CELLS: usize = 64;
/// Bisections of an edge: to 10⁻⁹ of a cell.
const HALVINGS: u32 = 30;

/// A place in the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Where, mm.
    pub at: DVec2,
    /// Determinant of the derivatives, of which only the sign counts.
    pub sense: f64,
    /// Share of a force that is rendered, 0 to 1.
    pub share: f64,
}

/// A piece of the region: a polygon.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// Its corners, mm.
    pub corners: Vec<DVec2>,
    /// Share of a force that is rendered at each of them, 0 to 1.
    pub shares: Vec<f64>,
}

/// See the module.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Region {
    /// Pieces that fill it.
    pub cells: Vec<Cell>,
    /// Pieces of the curves at which it folds back.
    pub folds: Vec<[DVec2; 2]>,
}

type Grid = Vec<Option<Place>>;

impl Region {
    /// The region of these ranges.
    pub fn new(ranges: [[f64; 2]; 2], place: impl Fn([f64; 2]) -> Option<Place>) -> Self {
        let at = |[u, v]: [usize; 2]| {
            [(u, ranges[0]), (v, ranges[1])]
                .map(|(step, [from, to])| from + (to - from) * step as f64 / CELLS as f64)
        };
        let nodes: Grid = (0..=CELLS)
            .flat_map(|v| (0..=CELLS).map(move |u| [u, v]))
            .map(|node| place(at(node)))
            .collect();
        let mut region = Self::default();
        for v in 0..CELLS {
            for u in 0..CELLS {
                let corners = [[u, v], [u + 1, v], [u + 1, v + 1], [u, v + 1]];
                let found = corners.map(|[u, v]| nodes[v * (CELLS + 1) + u]);
                region.add(corners.map(at), found, &place);
            }
        }
        region
    }

    fn add(
        &mut self,
        corners: [[f64; 2]; 4],
        found: [Option<Place>; 4],
        place: &impl Fn([f64; 2]) -> Option<Place>,
    ) {
        let (mut outline, mut crossings) = (Vec::new(), Vec::new());
        for (side, here) in found.into_iter().enumerate() {
            let next = (side + 1) % 4;
            let edge = [corners[side], corners[next]];
            outline.extend(here);
            match (here, found[next]) {
                (Some(here), Some(there)) if (here.sense < 0.0) != (there.sense < 0.0) => {
                    let negative = here.sense < 0.0;
                    let fold = last(edge, place, |place| (place.sense < 0.0) == negative);
                    crossings.extend(fold.map(|place| place.at));
                }
                (Some(_), None) => outline.extend(last(edge, place, |_| true)),
                (None, Some(_)) => outline.extend(last([edge[1], edge[0]], place, |_| true)),
                _ => {}
            }
        }
        if outline.len() > 2 {
            self.cells.push(Cell {
                corners: outline.iter().map(|place| place.at).collect(),
                shares: outline.iter().map(|place| place.share).collect(),
            });
        }
        self.folds
            .extend(crossings.chunks_exact(2).map(|ends| [ends[0], ends[1]]));
    }

    /// Whether a point is in the region, or nearer to it than `tolerance`, mm.
    pub fn contains(&self, point: DVec2, tolerance: f64) -> bool {
        self.cells
            .iter()
            .any(|cell| is_in_cell(&cell.corners, point, tolerance))
    }
}

/// The last place along an edge of a cell, from its first end, up to which `holds`.
fn last(
    [mut low, mut high]: [[f64; 2]; 2],
    place: &impl Fn([f64; 2]) -> Option<Place>,
    holds: impl Fn(&Place) -> bool,
) -> Option<Place> {
    for _ in 0..HALVINGS {
        let middle = [0, 1].map(|axis| 0.5 * (low[axis] + high[axis]));
        if place(middle).is_some_and(|place| holds(&place)) {
            low = middle;
        } else {
            high = middle;
        }
    }
    place(low)
}

fn is_in_cell(corners: &[DVec2], point: DVec2, tolerance: f64) -> bool {
    let near = corners
        .iter()
        .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), corner| {
            (low.min(*corner), high.max(*corner))
        });
    let margin = DVec2::splat(tolerance);
    if point.cmplt(near.0 - margin).any() || point.cmpgt(near.1 + margin).any() {
        return false;
    }
    let first = corners[0];
    let edges = corners.iter().zip(corners.iter().cycle().skip(1));
    (corners.windows(2).skip(1)).any(|pair| is_in_triangle(first, pair[0], pair[1], point))
        || edges
            .clone()
            .any(|(a, b)| distance_to_segment(*a, *b, point) <= tolerance)
}

fn is_in_triangle(a: DVec2, b: DVec2, c: DVec2, point: DVec2) -> bool {
    let sides = [(a, b), (b, c), (c, a)].map(|(from, to)| (to - from).perp_dot(point - from));
    sides.iter().all(|side| *side >= 0.0) || sides.iter().all(|side| *side <= 0.0)
}

/// Distance of a point from the line between two others.
pub fn distance_to_segment(a: DVec2, b: DVec2, point: DVec2) -> f64 {
    let (along, from) = (b - a, point - a);
    let share = (from.dot(along) / along.length_squared().max(1e-300)).clamp(0.0, 1.0);
    from.distance(share * along)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// A disc with a sector cut out, and a square folded along its middle.
    #[test]
    fn what_cannot_be_reached_is_cut_off_and_folds_are_found() {
        let disc = Region::new([[-1.0, 1.0]; 2], |[x, y]| {
            (x * x + y * y < 0.5).then_some(Place {
                at: DVec2::new(x, y),
                sense: 1.0,
                share: 1.0,
            })
        });
        for angle in 0..100 {
            let out = DVec2::from_angle(f64::from(angle) * 0.063);
            assert!(disc.contains(out * 0.706, 0.0005), "{angle}");
            assert!(!disc.contains(out * 0.708, 0.0005), "{angle}");
        }
        let folded = Region::new([[-1.0, 1.0]; 2], |[x, y]| {
            Some(Place {
                at: DVec2::new(x * x, y),
                sense: x,
                share: 1.0,
            })
        });
        assert!(folded.contains(DVec2::new(0.5, 0.5), 0.0) && !folded.contains(DVec2::new(-0.01, 0.5), 1e-3));
        assert_eq!(folded.folds.len(), CELLS);
        assert!(folded.folds.iter().flatten().all(|end| end.x.abs() < 1e-9));
    }

    proptest! {
        #[test]
        fn a_distance_is_the_least_to_any_point_of_the_line(
            ends in prop::array::uniform4(-3.0..3.0f64), point in prop::array::uniform2(-3.0..3.0f64), share in 0.0..1.0f64,
        ) {
            let (a, b) = (DVec2::new(ends[0], ends[1]), DVec2::new(ends[2], ends[3]));
            let point = DVec2::from_array(point);
            prop_assert!(distance_to_segment(a, b, point) <= point.distance(a.lerp(b, share)) + 1e-12);
        }
    }
}
