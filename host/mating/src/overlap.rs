//! Common area of two faces on one plane, cylinder or cone.
//!
//! Both faces are mapped to one chart: (x, y) of the plane; (angle, height) of a cylinder or cone, where an area element is
//! r(height)/cos(half angle) · d(angle) d(height). r is linear, so a polygon's area is its area in the chart times that
//! factor at its centroid. Areas of signed convex tiles add up: |A ∩ B| = Σᵢⱼ sᵢ sⱼ |Aᵢ ∩ Bⱼ|.

use std::f64::consts::{PI, TAU};
use std::ops::Range;

use glam::{DAffine3, DVec2, DVec3};
use mortise_brep::{Frame, Surface};

use crate::clip::{area_and_centroid, clip};
use crate::tiles::Tiles;

/// A plane to which faces are mapped.
pub(crate) struct Chart {
    frame: Frame,
    /// Whether the first coordinate is an angle, which is periodic.
    round: bool,
    /// Area of a chart unit at height v: factor.0 + v · factor.1.
    factor: (f64, f64),
}

impl Chart {
    /// The chart of a plane, cylinder or cone.
    pub fn new(surface: &Surface) -> Option<Self> {
        let (frame, round, factor) = match *surface {
            Surface::Plane { frame } => (frame, false, (1.0, 0.0)),
            Surface::Cylinder { frame, radius } => (frame, true, (radius, 0.0)),
            Surface::Cone {
                frame,
                radius,
                half_angle,
            } => (
                frame,
                true,
                (radius / half_angle.cos(), half_angle.tan() / half_angle.cos()),
            ),
            Surface::Sphere { .. } | Surface::Torus { .. } | Surface::Spline => return None,
        };
        Some(Self { frame, round, factor })
    }

    /// Maps tiles to the chart after moving them by `place`.
    pub fn draw(&self, tiles: &Tiles, place: &DAffine3) -> Drawing {
        let mut drawing = Drawing::default();
        let mut local = Vec::new();
        for (range, sign) in &tiles.tiles {
            local.clear();
            local.extend(tiles.corners[range.clone()].iter().map(|&p| {
                let d = place.transform_point3(p) - self.frame.origin;
                DVec3::new(d.dot(self.frame.x), d.dot(self.frame.y), d.dot(self.frame.z))
            }));
            let start = drawing.corners.len();
            if self.round {
                unroll(&local, &mut drawing.corners);
            } else {
                drawing
                    .corners
                    .extend(local.iter().map(|p| DVec3::new(p.x, p.y, 1.0)));
            }
            drawing.finish(start, *sign);
        }
        drawing
    }

    /// Area of A ∩ B, mm², and its centroid in the chart.
    pub fn common(&self, a: &Drawing, b: &Drawing) -> (f64, DVec2) {
        let (mut area, mut moment) = (0.0, DVec2::ZERO);
        let (mut polygon, mut moved, mut scratch) = (Vec::new(), Vec::new(), Vec::new());
        let turns: &[f64] = if self.round { &[-TAU, 0.0, TAU] } else { &[0.0] };
        for s in &a.tiles {
            for t in &b.tiles {
                if t.low.y > s.high.y || s.low.y > t.high.y {
                    continue;
                }
                for &turn in turns {
                    if t.low.x + turn > s.high.x || s.low.x > t.high.x + turn {
                        continue;
                    }
                    moved.clear();
                    moved.extend(b.corners[t.range.clone()].iter().map(|p| *p + DVec3::X * turn));
                    clip(&moved, &a.corners[s.range.clone()], &mut polygon, &mut scratch);
                    let (flat, middle) = area_and_centroid(&polygon);
                    let piece = s.sign * t.sign * flat * (self.factor.0 + self.factor.1 * middle.y);
                    area += piece;
                    moment += middle * piece;
                }
            }
        }
        (area, moment / area)
    }

    /// The point in space at chart coordinates; for a cylinder or cone, the point on its axis at that height.
    pub fn point(&self, at: DVec2) -> DVec3 {
        let f = &self.frame;
        if self.round {
            f.origin + f.z * at.y
        } else {
            f.origin + f.x * at.x + f.y * at.y
        }
    }

    /// Whether a tile of `drawing` contains the cylinder's point at an angle and height.
    pub fn holds(&self, drawing: &Drawing, angle: f64, height: f64) -> bool {
        // Rounding of an unrolled coordinate.
        let epsilon = 1e-9;
        drawing.tiles.iter().any(|t| {
            [-TAU, 0.0, TAU].iter().any(|turn| {
                let p = DVec2::new(angle + turn, height);
                p.cmpge(t.low - epsilon).all() && p.cmple(t.high + epsilon).all() && {
                    let corners = &drawing.corners[t.range.clone()];
                    (0..corners.len()).all(|i| {
                        let (a, b) = (corners[i].truncate(), corners[(i + 1) % corners.len()].truncate());
                        (b - a).perp_dot(p - a) >= -epsilon * a.distance(b)
                    })
                }
            })
        })
    }
}

/// Tiles of a face in a chart: corners (u, v, 1), anticlockwise.
#[derive(Default)]
pub(crate) struct Drawing {
    corners: Vec<DVec3>,
    tiles: Vec<DrawnTile>,
}

struct DrawnTile {
    range: Range<usize>,
    sign: f64,
    low: DVec2,
    high: DVec2,
}

impl Drawing {
    /// Area in the chart and its centroid, not a number where there is no area.
    pub fn area_and_middle(&self) -> (f64, DVec2) {
        let (mut area, mut moment) = (0.0, DVec2::ZERO);
        for tile in &self.tiles {
            let (piece, middle) = area_and_centroid(&self.corners[tile.range.clone()]);
            area += tile.sign * piece;
            moment += middle * (tile.sign * piece);
        }
        (area, moment / area)
    }

    /// Closes the tile whose corners begin at `start`.
    fn finish(&mut self, start: usize, sign: f64) {
        let corners = &mut self.corners[start..];
        if area_and_centroid(corners).0 < 0.0 {
            corners.reverse();
        }
        let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for c in corners.iter() {
            low = low.min(c.truncate());
            high = high.max(c.truncate());
        }
        self.tiles.push(DrawnTile {
            range: start..self.corners.len(),
            sign,
            low,
            high,
        });
    }
}

/// Corners of a triangle in the frame of a cylinder or cone, as (angle, height, 1) without jumps; the first angle is within
/// −π..π.
fn unroll(local: &[DVec3], out: &mut Vec<DVec3>) {
    let on_axis = |p: &DVec3| p.x.hypot(p.y) <= 1e-9 * (1.0 + p.z.abs());
    let Some(start) = local.iter().find(|p| !on_axis(p)).map(|p| p.y.atan2(p.x)) else {
        return;
    };
    let angle = |p: &DVec3| {
        let turned = p.y.atan2(p.x) - start;
        start + turned - TAU * ((turned + PI) / TAU).floor()
    };
    let n = local.len();
    for (i, p) in local.iter().enumerate() {
        if !on_axis(p) {
            out.push(DVec3::new(angle(p), p.z, 1.0));
            continue;
        }
        // The apex of a cone is a line in the chart: it spans the angles of its neighbours.
        for q in [&local[(i + n - 1) % n], &local[(i + 1) % n]] {
            if !on_axis(q) {
                out.push(DVec3::new(angle(q), p.z, 1.0));
            }
        }
    }
}
