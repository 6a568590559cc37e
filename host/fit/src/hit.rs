//! Nearest point of a solid's surface.

use glam::DVec3;

/// Nearest point of a solid's surface, exact or tessellated.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hit {
    /// Signed distance, mm, negative inside.
    pub distance: f64,
    /// The nearest point, mm.
    pub foot: DVec3,
    /// Outward unit normal there.
    pub normal: DVec3,
    /// A face it lies on.
    pub face: u32,
}
