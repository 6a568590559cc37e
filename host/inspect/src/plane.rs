//! A plane that cuts parts, with coordinates in it.

use glam::{DAffine3, DVec2, DVec3};

/// A plane with right-handed coordinates: x and y in it, the normal along z. Lengths mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CutPlane {
    /// Origin of the coordinates.
    pub origin: DVec3,
    /// Unit x axis.
    pub x: DVec3,
    /// Unit y axis.
    pub y: DVec3,
    /// Unit normal. What lies on its side is above.
    pub normal: DVec3,
}

impl CutPlane {
    /// The plane through `origin` across `normal`; `None` for a normal of zero or infinite length.
    pub fn new(origin: DVec3, normal: DVec3) -> Option<Self> {
        let normal = normal.try_normalize()?;
        let x = normal.any_orthonormal_vector();
        origin.is_finite().then_some(Self {
            origin,
            x,
            y: normal.cross(x),
            normal,
        })
    }

    /// The plane as seen in the frame that `pose` places: `pose` maps that frame to this plane's.
    pub fn seen_from(&self, pose: &DAffine3) -> Self {
        let back = pose.inverse();
        let turn = |v: DVec3| back.transform_vector3(v).normalize();
        Self {
            origin: back.transform_point3(self.origin),
            x: turn(self.x),
            y: turn(self.y),
            normal: turn(self.normal),
        }
    }

    /// Signed height of `p` above the plane.
    pub fn height(&self, p: DVec3) -> f64 {
        (p - self.origin).dot(self.normal)
    }

    /// Coordinates of the foot of `p`.
    pub fn to_plane(&self, p: DVec3) -> DVec2 {
        let d = p - self.origin;
        DVec2::new(d.dot(self.x), d.dot(self.y))
    }

    /// The point with these coordinates.
    pub fn from_plane(&self, q: DVec2) -> DVec3 {
        self.origin + self.x * q.x + self.y * q.y
    }
}
