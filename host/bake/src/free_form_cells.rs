//! Distance that the board gives in a cell near free-form faces, for the measurement of its error.

use mortise_protocol::image::{NO_FACE, Nearby};

use crate::cell_samples::{Place, about, corner_places, index};
use crate::nearby::BrickCells;
use crate::rule::value;

impl BrickCells<'_> {
    /// Distance that the board computes at a place of the cell with the lowest corner `at`, before rounding; `None` where it is only a bound.
    pub fn rendered(&self, at: [usize; 3], nearby: Nearby, place: &Place) -> Option<f64> {
        let found = value(nearby, |surface| self.surfaces.distance(surface, place.at));
        match (nearby, found) {
            (Nearby::Convex(group), Some(found)) => {
                (group.is_plain() && place.exact.distance <= 0.0).then_some(found)
            }
            (Nearby::Reentrant(group), Some(found)) => {
                (group.is_plain() && place.exact.distance >= 0.0).then_some(found)
            }
            (_, Some(found)) => Some(found),
            (_, None) => Some(self.interpolated(at, place)),
        }
    }

    /// Distance by interpolation at a place of a cell.
    pub fn interpolated(&self, at: [usize; 3], place: &Place) -> f64 {
        let fraction = (place.at - self.place(at).at) / self.cell;
        let weighted = corner_places(at).into_iter().enumerate().map(|(c, corner)| {
            let along = |a: usize| {
                if c >> a & 1 == 1 {
                    fraction[a]
                } else {
                    1.0 - fraction[a]
                }
            };
            along(0) * along(1) * along(2) * self.samples[index(corner)].distance
        });
        weighted.sum()
    }

    /// Whether a cell has another face about it, or at a place `inside` it, than `nearest`.
    pub fn at_edge(&self, at: [usize; 3], nearest: u16, inside: &[Place]) -> bool {
        let inside = inside.iter().map(|place| place.exact.face);
        (about(at)
            .map(|place| self.samples[index(place)].face)
            .chain(inside))
        .any(|face| face != nearest && face != NO_FACE)
    }
}
