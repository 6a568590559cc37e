//! The largest value of a quantity over the ranges of the joints: a grid, then a search around the best of it.

use super::links::Angles;

/// Smallest step of the search, as a share of a joint's range.
const FINEST: f64 = 1e-7;

/// The best that was found: shares of the ranges, and the value there.
type Best = Option<(Angles, f64)>;

/// The angles within `ranges` at which `value` is largest, with it; `None` where it has no value anywhere. `steps` of the grid for each joint.
pub fn largest(
    ranges: &[[f64; 2]],
    steps: u32,
    value: impl Fn(Angles) -> Option<f64>,
) -> Option<(Angles, f64)> {
    let angles = |shares: &Angles| {
        let mut angles = [0.0; 3];
        for ((angle, [from, to]), share) in angles.iter_mut().zip(ranges).zip(shares) {
            *angle = from + share * (to - from);
        }
        angles
    };
    let take = |best: &mut Best, shares: Angles| {
        let better = |value: &f64| best.is_none_or(|(_, known)| *value > known);
        let found = value(angles(&shares)).filter(better);
        *best = found.map(|value| (shares, value)).or(*best);
        found.is_some()
    };
    let mut best = None;
    for cell in cells(ranges.len(), steps + 1) {
        take(&mut best, cell.map(|place| f64::from(place) / f64::from(steps)));
    }
    let mut step = 1.0 / f64::from(steps);
    while step > FINEST {
        let (from, _) = best?;
        let mut moved = false;
        // Every neighbour, also across the corners: a ridge need not run along an axis.
        for cell in cells(ranges.len(), 3) {
            let mut near = from;
            for (share, place) in near.iter_mut().zip(cell).take(ranges.len()) {
                *share = (*share + step * (f64::from(place) - 1.0)).clamp(0.0, 1.0);
            }
            moved |= take(&mut best, near);
        }
        if !moved {
            step *= 0.5;
        }
    }
    best.map(|(shares, value)| (angles(&shares), value))
}

/// The cells of a grid of `count` a side.
pub fn cells(sides: usize, count: u32) -> impl Iterator<Item = [u32; 3]> {
    let of = move |side: usize| if side < sides { count } else { 1 };
    (0..of(2)).flat_map(move |z| (0..of(1)).flat_map(move |y| (0..of(0)).map(move |x| [x, y, z])))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ridge_across_the_axes_and_an_edge_are_found() {
        let ranges = [[-1.0, 2.0], [0.0, 3.0]];
        let ridge = |[a, b, _]: Angles| Some(-(a - 0.123).powi(2) - 50.0 * (a - b + 1.5).powi(2));
        let (angles, value) = largest(&ranges, 8, ridge).expect("a value");
        assert!(
            value > -1e-9 && (angles[0] - 0.123).abs() < 1e-4,
            "{angles:?} {value}"
        );
        let (angles, value) = largest(&ranges, 8, |[a, b, _]| (b < 1.0).then_some(a)).expect("a value");
        assert_eq!((angles[0], value), (2.0, 2.0));
        assert_eq!(largest(&ranges, 8, |_| None), None);
    }
}
