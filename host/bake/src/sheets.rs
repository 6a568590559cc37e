//! Sheets of a free-form face in a cell: one face can pass through a cell several times, as the flanks of a tooth or of a thread do.
//!
//! Each sheet has a patch of its own, for no height over one plane passes through two sheets. Two points of a face are on the same sheet if their
//! normals are within 60° and the line between them is nearly tangent to both, or if other points link them. Points without a normal, on the face's
//! border, belong to the sheet of the nearest other point. Cost: the square of the number of points, about 20 in a cell.

use glam::DVec3;

/// Cosine of the largest angle between normals of neighbouring points of a sheet.
const TURNED: f64 = 0.5;
/// Largest sine of the angle between the line of two points and their mean tangent plane.
const STEEP: f64 = 0.35;
/// Height of this many cells between two points is no step from sheet to sheet: points may be arbitrarily near to each other.
const LEVEL_CELLS: f64 = 1e-3;

/// A point of a face and the outward unit normal there, or zero where it is not known.
pub(crate) type OnFace = (DVec3, DVec3);

/// Number of the sheet of each of these points of one face, in the order in which the sheets first appear; all 0 where no normal is known.
pub(crate) fn sheets(points: &[OnFace], cell_mm: f64) -> Vec<usize> {
    const NONE: usize = usize::MAX;
    let mut sheet = vec![NONE; points.len()];
    let mut count = 0;
    for first in 0..points.len() {
        if sheet[first] != NONE || points[first].1 == DVec3::ZERO {
            continue;
        }
        let mut open = vec![first];
        sheet[first] = count;
        while let Some(from) = open.pop() {
            for to in 0..points.len() {
                if sheet[to] == NONE && is_linked(points[from], points[to], cell_mm) {
                    sheet[to] = count;
                    open.push(to);
                }
            }
        }
        count += 1;
    }
    let known = sheet.clone();
    for (own, point) in sheet.iter_mut().zip(points).filter(|(own, _)| **own == NONE) {
        let others = (points.iter().zip(&known)).filter(|(_, sheet)| **sheet != NONE);
        let near = others.min_by(|a, b| {
            let off = |other: &OnFace| other.0.distance_squared(point.0);
            off(a.0).total_cmp(&off(b.0))
        });
        *own = near.map_or(0, |(_, sheet)| *sheet);
    }
    sheet
}

/// The sheet, by some of its points, to which a point of the face belongs: that of the nearest point with a normal on the same side.
pub(crate) fn nearest_sheet<'a>(
    sheets: impl Iterator<Item = &'a [OnFace]>,
    (at, normal): OnFace,
) -> Option<usize> {
    let off = |points: &[OnFace]| {
        let facing = points.iter().filter(|(_, other)| normal.dot(*other) >= 0.0);
        facing
            .map(|(other, _)| other.distance_squared(at))
            .fold(f64::INFINITY, f64::min)
    };
    let by_distance = sheets.enumerate().map(|(i, points)| (off(points), i));
    (by_distance.min_by(|a, b| a.0.total_cmp(&b.0))).map(|(_, sheet)| sheet)
}

/// Whether two points of a face are seen to be on one sheet; false without normals.
fn is_linked((a, of_a): OnFace, (b, of_b): OnFace, cell_mm: f64) -> bool {
    let Some(normal) = (of_a + of_b).try_normalize() else {
        return false;
    };
    let step = b - a;
    of_a.dot(of_b) > TURNED && step.dot(normal).abs() <= STEEP * step.length() + LEVEL_CELLS * cell_mm
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Points of a strip of a circle of this radius about `center`, between two angles, with normals outward or inward.
    fn arc(center: DVec3, radius: f64, angles: [f64; 2], sense: f64) -> Vec<OnFace> {
        (0..18)
            .map(|i| {
                let t = angles[0] + (angles[1] - angles[0]) * f64::from(i % 6) / 5.0;
                let out = DVec3::new(t.cos(), t.sin(), 0.0);
                let along = DVec3::Z * f64::from(i / 6) * 0.5;
                (center + out * radius + along, out * sense)
            })
            .collect()
    }

    proptest! {
        /// One bent strip is one sheet, even half a turn of it; a second one on the other side of a wall or a slot is another.
        #[test]
        fn both_sides_of_a_wall_are_two_sheets(
            radius in 0.6f64..50.0, half in 0.1f64..1.5, thickness in 0.01f64..0.5, inward in prop::bool::ANY,
        ) {
            let sense = if inward { -1.0 } else { 1.0 };
            let angles = [-half.min(1.0 / radius), half.min(1.0 / radius)];
            let mut points = arc(DVec3::ZERO, radius, angles, sense);
            prop_assert!(sheets(&points, 1.0).iter().all(|sheet| *sheet == 0));
            points.extend(arc(DVec3::ZERO, radius - thickness.min(0.9 * radius), angles, -sense));
            let found = sheets(&points, 1.0);
            prop_assert!(found.iter().enumerate().all(|(i, sheet)| *sheet == i / 18), "{found:?}");
        }
    }

    #[test]
    fn points_without_a_normal_join_the_nearest_sheet() {
        let wall = |x: f64, side: f64| (DVec3::X * x, DVec3::X * side);
        let points = [wall(0.0, -1.0), (DVec3::X * 0.9, DVec3::ZERO), wall(1.0, 1.0)];
        assert_eq!(sheets(&points, 1.0), [0, 1, 1]);
        assert_eq!(sheets(&[(DVec3::ZERO, DVec3::ZERO)], 1.0), [0]);
        let of = [&points[..1], &points[2..]];
        assert_eq!(nearest_sheet(of.into_iter(), wall(0.3, 1.0)), Some(1));
    }
}
