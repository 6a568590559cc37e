//! Bounding spheres of what is displayed.

use glam::DVec3;

/// A bounding sphere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    /// Centre, mm.
    pub center: DVec3,
    /// Radius, mm, above 0.
    pub radius: f64,
}

impl Default for Extent {
    fn default() -> Self {
        Self {
            center: DVec3::ZERO,
            radius: 50.0,
        }
    }
}

impl Extent {
    /// Smallest sphere about `points` from the centre of their axis-parallel box; the default when there are none.
    pub fn of_points(points: impl Iterator<Item = DVec3> + Clone) -> Self {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for p in points.clone() {
            (low, high) = (low.min(p), high.max(p));
        }
        let center = 0.5 * (low + high);
        if !center.is_finite() {
            return Self::default();
        }
        let radius = points.map(|p| p.distance(center)).fold(1e-3, f64::max);
        Self { center, radius }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_points_have_the_default_extent() {
        assert_eq!(Extent::of_points(std::iter::empty()), Extent::default());
    }
}
