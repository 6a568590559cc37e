//! Tolerances for equal position and direction.

/// Tolerances for equal position and direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerances {
    /// Largest distance between two surfaces over their common region, mm. The default, 1 µm, is above the rounding of
    /// exchange files (coordinates of seven digits) and below the tightest running fit in use (H6/g5 of 3 mm: 2 µm).
    pub linear_mm: f64,
    /// Largest angle between their normals or axes, radians.
    pub angular_rad: f64,
    /// Smallest common area of a contact, mm².
    pub min_area_mm2: f64,
}

impl Default for Tolerances {
    fn default() -> Self {
        Self {
            linear_mm: 1e-3,
            angular_rad: 1e-3,
            min_area_mm2: 1e-3,
        }
    }
}
