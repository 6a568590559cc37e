//! Pieces of the exact boundary between faces: one for each mesh side where the face changes.
//!
//! A piece carries the exact curve between the side's ends: a straight segment, or an arc when the B-rep edge is a circle. Other curves are
//! followed by their tessellation.

use glam::DVec3;

/// One mesh side of the boundary between faces, with its exact curve.
#[derive(Clone, Debug)]
pub(crate) struct Piece {
    /// Mesh vertices at its ends.
    pub ends: [u32; 2],
    /// Where those are, mm.
    pub points: [DVec3; 2],
    /// What runs between them.
    pub curve: PieceCurve,
    /// The triangles that meet here.
    pub sides: Vec<PieceSide>,
    /// B-rep edge it belongs to, where that is known.
    pub edge: Option<u32>,
}

/// A triangle's use of a piece.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PieceSide {
    /// Triangle.
    pub triangle: u32,
    /// Its face.
    pub face: u32,
    /// The triangle runs from `ends[0]` to `ends[1]` (its interior on the left, seen from outside).
    pub forward: bool,
}

/// Exact curve of a piece.
#[derive(Clone, Copy, Debug)]
pub(crate) enum PieceCurve {
    /// The straight segment between the ends.
    Segment,
    /// The shorter arc between the ends.
    Arc {
        /// Centre, mm.
        center: DVec3,
        /// Unit normal of its plane.
        axis: DVec3,
        /// mm.
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
    /// mm.
    pub point: DVec3,
    /// 0 or 1 when it is that end.
    pub end: Option<usize>,
}

impl PieceCurve {
    /// The arc of the circle (`center`, unit `axis`, `radius`) between `a` and `b`; `None` when they are not on it within `tolerance`, or
    /// so far apart that the shorter arc is in doubt.
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
            PieceCurve::Arc { radius, cos_half, .. } => 2.0 * radius * cos_half.clamp(-1.0, 1.0).acos(),
        }
    }

    /// Angle by which the tangent turns from end to end, rad.
    pub fn turn(&self) -> f64 {
        match self.curve {
            PieceCurve::Segment => 0.0,
            PieceCurve::Arc { cos_half, .. } => 2.0 * cos_half.clamp(-1.0, 1.0).acos(),
        }
    }

    /// Point at the fraction `t` (0..1) of its length from `ends[0]`.
    pub fn at(&self, t: f64) -> DVec3 {
        let [a, b] = self.points;
        match self.curve {
            PieceCurve::Segment => a + (b - a) * t,
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
            PieceCurve::Arc { radius, cos_half, .. } => radius * (1.0 - cos_half),
        }
    }
}
