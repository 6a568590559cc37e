//! Exact samples of a brick and the places of a cell's corners among them.

use glam::DVec3;
use mortise_protocol::image::{BRICK_SAMPLES, NO_FACE};

use crate::distance::Nearest;

/// A sample of a brick before rounding.
#[derive(Clone, Copy)]
pub(crate) struct ExactSample {
    /// Distance, mm, outside positive; NaN where it was not computed.
    pub distance: f64,
    /// Nearest face or [`NO_FACE`].
    pub face: u16,
    /// The nearest point, mm.
    pub foot: DVec3,
    /// Outward unit normal there, or zero; see [`Nearest::normal`].
    pub normal: DVec3,
}

impl ExactSample {
    /// A sample that was not computed.
    pub const NONE: Self = Self {
        distance: f64::NAN,
        face: NO_FACE,
        foot: DVec3::NAN,
        normal: DVec3::ZERO,
    };

    /// The sample of an exact query.
    pub fn of(nearest: Nearest) -> Self {
        Self {
            distance: nearest.distance,
            face: nearest.face as u16,
            foot: nearest.point,
            normal: nearest.normal,
        }
    }
}

/// An exact sample at a place.
#[derive(Clone, Copy)]
pub(crate) struct Place {
    pub at: DVec3,
    pub exact: ExactSample,
}

/// Places of the corners of the cell with the lowest corner `at`, x fastest.
pub(crate) fn corner_places(at: [usize; 3]) -> [[usize; 3]; 8] {
    std::array::from_fn(|c| [at[0] + (c & 1), at[1] + (c >> 1 & 1), at[2] + (c >> 2)])
}

/// Places of the samples around the cell with the lowest corner `at`, as far as they lie in its brick: its corners and one more in each direction.
pub(crate) fn about(at: [usize; 3]) -> impl Iterator<Item = [usize; 3]> {
    let [x, y, z] = at.map(|i| i.saturating_sub(1)..(i + 3).min(BRICK_SAMPLES));
    z.flat_map(move |z| {
        let x = x.clone();
        y.clone().flat_map(move |y| x.clone().map(move |x| [x, y, z]))
    })
}

/// Index of a sample in its brick.
pub(crate) fn index([x, y, z]: [usize; 3]) -> usize {
    x + BRICK_SAMPLES * (y + BRICK_SAMPLES * z)
}
