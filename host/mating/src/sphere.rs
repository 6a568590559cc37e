//! Common area of two faces on one sphere.

use glam::{DAffine3, DVec3};

use crate::clip::{clip, solid_angle};
use crate::tiles::Tiles;

/// Triangles seen from the sphere's centre: corners as unit vectors, anticlockwise from outside, and a bounding cone of
/// each.
pub(crate) struct SphereDrawing(Vec<SphereTile>);

struct SphereTile {
    corners: [DVec3; 3],
    middle: DVec3,
    /// Angle from the middle to the farthest corner.
    reach: f64,
}

impl SphereDrawing {
    /// Tiles of a face on a sphere about `center`, moved by `place`.
    pub fn new(tiles: &Tiles, place: &DAffine3, center: DVec3) -> Self {
        let tile = |corners: &[DVec3]| {
            let mut c: [DVec3; 3] = corners.try_into().ok()?;
            for p in &mut c {
                *p = (place.transform_point3(*p) - center).try_normalize()?;
            }
            if solid_angle(&c) < 0.0 {
                c.swap(1, 2);
            }
            let middle = (c[0] + c[1] + c[2]).try_normalize()?;
            let reach = c.iter().map(|p| p.angle_between(middle)).fold(0.0, f64::max);
            Some(SphereTile {
                corners: c,
                middle,
                reach,
            })
        };
        Self(
            tiles
                .tiles
                .iter()
                .filter_map(|(range, _)| tile(&tiles.corners[range.clone()]))
                .collect(),
        )
    }

    /// Common solid angle, steradian.
    pub fn common(&self, other: &Self) -> f64 {
        let (mut polygon, mut scratch) = (Vec::new(), Vec::new());
        let mut sum = 0.0;
        for s in &self.0 {
            for t in &other.0 {
                if s.middle.dot(t.middle) < (s.reach + t.reach).min(std::f64::consts::PI).cos() {
                    continue;
                }
                clip(&s.corners, &t.corners, &mut polygon, &mut scratch);
                sum += solid_angle(&polygon);
            }
        }
        sum
    }

    /// Whether the face contains the given direction from the centre.
    pub fn holds(&self, direction: DVec3) -> bool {
        let inside = |t: &SphereTile| {
            let [a, b, c] = t.corners;
            [(a, b), (b, c), (c, a)]
                .iter()
                .all(|(p, q)| p.cross(*q).dot(direction) >= -1e-9)
        };
        self.0.iter().any(|t| t.middle.dot(direction) > 0.0 && inside(t))
    }
}
