//! Pieces of the exact boundary between faces: one for each mesh side at which the face changes.
//!
//! A piece carries the exact curve between the side's ends: a straight segment, or an arc when the B-rep edge is a circle. Other curves are polylines
//! whose chords are within [`mortise_brep::EDGE_TOLERANCE_MM`], where the model has them.

use glam::DVec3;

/// A piece and whether the chain runs along it from `ends[0]` to `ends[1]`.
pub(crate) type Link = (u32, bool);

/// One mesh side of the boundary between faces, with its exact curve.
#[derive(Clone, Debug)]
pub(crate) struct Piece {
    /// Mesh vertices at its ends.
    pub ends: [u32; 2],
    /// Positions of the ends, mm.
    pub points: [DVec3; 2],
    /// Curve between the ends.
    pub curve: PieceCurve,
    /// The triangles that meet here.
    pub sides: Vec<PieceSide>,
    /// B-rep edge of the piece, if known.
    pub edge: Option<u32>,
}

/// Use of a piece by a triangle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PieceSide {
    /// Triangle.
    pub triangle: u32,
    /// Its face.
    pub face: u32,
    /// Whether the triangle runs from `ends[0]` to `ends[1]` (its interior on the left, seen from outside).
    pub forward: bool,
}

/// Exact curve of a piece.
#[derive(Clone, Debug)]
pub(crate) enum PieceCurve {
    /// The straight segment between the ends.
    Segment,
    /// Points from end to end, both included.
    Dense(Box<[DVec3]>),
    /// The shorter arc between the ends.
    Arc {
        /// Centre, mm.
        center: DVec3,
        /// Unit normal of its plane.
        axis: DVec3,
        /// Radius, mm.
        radius: f64,
        /// Unit vector from the centre to the arc's middle.
        middle: DVec3,
        /// Cosine of half the arc's angle.
        cos_half: f64,
    },
}

/// Nearest point of a piece.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OnPiece {
    /// Position, mm.
    pub point: DVec3,
    /// 0 or 1 when the point is that end.
    pub end: Option<usize>,
}

impl PieceCurve {
    /// The arc of the circle (`center`, unit `axis`, `radius`) between `a` and `b`; `None` when they are not on it within `tolerance`, or so far
    /// apart that the shorter arc is ambiguous.
    pub fn arc(center: DVec3, axis: DVec3, radius: f64, [a, b]: [DVec3; 2], tolerance: f64) -> Option<Self> {
        let in_plane = |p: DVec3| {
            let d = p - center;
            d - axis * d.dot(axis)
        };
        let off = |p: DVec3| {
            let d = p - center;
            (d.dot(axis)).abs().max((in_plane(p).length() - radius).abs())
        };
        if off(a).max(off(b)) > tolerance {
            return None;
        }
        let (ua, ub) = (in_plane(a).try_normalize()?, in_plane(b).try_normalize()?);
        if ua.dot(ub) < -0.9 {
            return None;
        }
        let middle = (ua + ub).try_normalize()?;
        Some(Self::Arc {
            center,
            axis,
            radius,
            middle,
            cos_half: ua.dot(middle),
        })
    }
}

impl Piece {
    /// Nearest point to `p`. Exact for segments and arcs.
    pub fn nearest(&self, p: DVec3) -> OnPiece {
        let [a, b] = self.points;
        let end = |i: usize| OnPiece {
            point: self.points[i],
            end: Some(i),
        };
        let nearer_end = || end(usize::from(p.distance_squared(b) < p.distance_squared(a)));
        match self.curve {
            PieceCurve::Segment => {
                let along = b - a;
                let length2 = along.length_squared();
                if length2 == 0.0 {
                    return end(0);
                }
                let t = (p - a).dot(along) / length2;
                if t <= 0.0 {
                    end(0)
                } else if t >= 1.0 {
                    end(1)
                } else {
                    OnPiece {
                        point: a + along * t,
                        end: None,
                    }
                }
            }
            PieceCurve::Dense(ref points) => {
                let mut best = (f64::INFINITY, self.points[0]);
                for pair in points.windows(2) {
                    let q = on_segment(pair[0], pair[1], p);
                    let d2 = q.distance_squared(p);
                    if d2 < best.0 {
                        best = (d2, q);
                    }
                }
                let end = self.points.iter().position(|&end| end == best.1);
                OnPiece { point: best.1, end }
            }
            PieceCurve::Arc {
                center,
                axis,
                radius,
                middle,
                cos_half,
            } => {
                let d = p - center;
                let flat = d - axis * d.dot(axis);
                let length = flat.length();
                if length < 1e-12 * radius {
                    // On the axis every point of the arc is equally near.
                    return OnPiece {
                        point: center + middle * radius,
                        end: None,
                    };
                }
                let u = flat / length;
                if u.dot(middle) > cos_half {
                    OnPiece {
                        point: center + u * radius,
                        end: None,
                    }
                } else {
                    nearer_end()
                }
            }
        }
    }

    /// Unit tangent at a point of the piece, from `ends[0]` towards `ends[1]`.
    pub fn tangent(&self, at: DVec3) -> DVec3 {
        let chord = self.points[1] - self.points[0];
        match self.curve {
            PieceCurve::Segment => chord.normalize_or_zero(),
            PieceCurve::Dense(ref points) => {
                let off = |pair: &&[DVec3]| on_segment(pair[0], pair[1], at).distance_squared(at);
                let nearest = points.windows(2).min_by(|a, b| off(a).total_cmp(&off(b)));
                nearest
                    .map_or(chord, |pair| pair[1] - pair[0])
                    .normalize_or_zero()
            }
            PieceCurve::Arc { center, axis, .. } => {
                let t = axis.cross(at - center).normalize_or_zero();
                if t.dot(chord) < 0.0 { -t } else { t }
            }
        }
    }

    /// Length along the curve, mm.
    pub fn length(&self) -> f64 {
        match self.curve {
            PieceCurve::Segment => self.points[0].distance(self.points[1]),
            PieceCurve::Dense(ref points) => points.windows(2).map(|pair| pair[0].distance(pair[1])).sum(),
            PieceCurve::Arc { radius, cos_half, .. } => 2.0 * radius * cos_half.clamp(-1.0, 1.0).acos(),
        }
    }

    /// Angle by which the tangent turns from end to end, rad.
    pub fn turn(&self) -> f64 {
        match self.curve {
            PieceCurve::Segment => 0.0,
            PieceCurve::Dense(ref points) => {
                let turns = points
                    .windows(3)
                    .map(|w| (w[1] - w[0]).angle_between(w[2] - w[1]));
                let turns: f64 = turns.filter(|t| t.is_finite()).sum();
                // Half a side's turn is missing at each end.
                let sides = points.len() as f64 - 1.0;
                turns * sides / (sides - 1.0).max(1.0)
            }
            PieceCurve::Arc { cos_half, .. } => 2.0 * cos_half.clamp(-1.0, 1.0).acos(),
        }
    }

    /// Point at the fraction `t` (0..1) of its length from `ends[0]`.
    pub fn at(&self, t: f64) -> DVec3 {
        let [a, b] = self.points;
        match self.curve {
            PieceCurve::Segment => a + (b - a) * t,
            PieceCurve::Dense(ref points) => {
                let mut left = t * self.length();
                for pair in points.windows(2) {
                    let length = pair[0].distance(pair[1]);
                    if left <= length && length > 0.0 {
                        return pair[0] + (pair[1] - pair[0]) * (left / length);
                    }
                    left -= length;
                }
                b
            }
            PieceCurve::Arc {
                center,
                radius,
                middle,
                cos_half,
                ..
            } => {
                let forward = self.tangent(center + middle * radius);
                let angle = (2.0 * t - 1.0) * cos_half.clamp(-1.0, 1.0).acos();
                center + (middle * angle.cos() + forward * angle.sin()) * radius
            }
        }
    }

    /// Largest distance between the curve and the straight chord, mm.
    pub fn sagitta(&self) -> f64 {
        match self.curve {
            PieceCurve::Segment => 0.0,
            PieceCurve::Dense(ref points) => {
                let [a, b] = self.points;
                let off = points.iter().map(|&p| on_segment(a, b, p).distance(p));
                off.fold(0.0, f64::max)
            }
            PieceCurve::Arc { radius, cos_half, .. } => radius * (1.0 - cos_half),
        }
    }
}

/// Nearest point of the segment from `a` to `b`; the ends are returned bit-exactly.
pub(crate) fn on_segment(a: DVec3, b: DVec3, p: DVec3) -> DVec3 {
    let along = b - a;
    let length2 = along.length_squared();
    let t = if length2 > 0.0 {
        (p - a).dot(along) / length2
    } else {
        0.0
    };
    if t <= 0.0 {
        a
    } else if t >= 1.0 {
        b
    } else {
        a + along * t
    }
}
