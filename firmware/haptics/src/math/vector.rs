//! Lengths of vectors, by `libm`: the same bits on a PC and on a board.

use glam::Vec3;

/// A hair less than 1, so that a vector cut to its limit is not above it by a rounding.
const WITHIN: f32 = 0.999_999;

/// Length of `v` by `libm`: the same bits everywhere.
#[inline]
pub(crate) fn length(v: Vec3) -> f32 {
    libm::sqrtf(v.length_squared())
}

/// `v` cut to length `most`, and whether it had to be. The direction stays.
#[inline]
pub(crate) fn cut(v: Vec3, most: f32) -> (Vec3, bool) {
    let squared = v.length_squared();
    if squared > most * most {
        (v * (WITHIN * most / libm::sqrtf(squared)), true)
    } else {
        (v, false)
    }
}
