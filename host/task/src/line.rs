//! Axes and directions, and when two of them are one.

use glam::DVec3;

/// Angle within which two directions, and distance within which two axes, are the same.
const SAME_RAD: f64 = 1e-3;
const SAME_MM: f64 = 5e-2;

/// A line about which a part could turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Point on it, mm, in the assembly's frame.
    pub point: DVec3,
    /// Unit direction.
    pub direction: DVec3,
}

/// Whether two directions are parallel, either way.
pub(crate) fn same_direction(a: DVec3, b: DVec3) -> bool {
    a.cross(b).length() < SAME_RAD
}

/// Whether two axes are one line.
pub(crate) fn same_line(a: Line, b: Line) -> bool {
    same_direction(a.direction, b.direction)
        && (b.point - a.point).reject_from_normalized(a.direction).length() < SAME_MM
}
