//! A pointshell, and the density of one.

use glam::DVec3;

use crate::partners::Partners;

/// Density of a pointshell.
#[derive(Clone, Debug, PartialEq)]
pub struct PointshellOptions {
    /// Bound on how much deeper a contact can be than its deepest sample, mm.
    pub epsilon_mm: f64,
    /// The same bound inside faces that are not convex in both directions, where only another convex face can touch, mm.
    pub crossing_epsilon_mm: f64,
    /// Smallest spacing, mm: where the bound would require less, the error is that of this spacing, s²·κ/8 in each direction.
    pub least_spacing_mm: f64,
    /// Largest spacing along edges, mm; also inside faces when the partners are unknown.
    pub max_spacing_mm: f64,
    /// Partners of the shape.
    pub partners: Partners,
}

impl PointshellOptions {
    /// Samples everywhere, for any partners; no two neighbours are farther apart than `max_spacing_mm`.
    pub fn everywhere(epsilon_mm: f64, max_spacing_mm: f64) -> Self {
        Self {
            epsilon_mm,
            crossing_epsilon_mm: epsilon_mm,
            least_spacing_mm: 0.0,
            max_spacing_mm,
            partners: Partners::Unknown,
        }
    }

    /// Spacing with chord error ε at `curvature` (1/mm), mm, for any partners.
    pub(crate) fn spacing(&self, curvature: f64) -> f64 {
        (8.0 * self.epsilon_mm / curvature.abs().max(1e-12))
            .sqrt()
            .max(self.least_spacing_mm)
            .min(self.max_spacing_mm)
    }

    /// Spacings inside a face of principal curvatures `own` (convex positive), mm; `None` where no partner needs a sample.
    pub(crate) fn face_spacings(&self, own: [f64; 2]) -> Option<[f64; 2]> {
        if self.partners == Partners::Unknown {
            return Some(own.map(|k| self.spacing(k)));
        }
        let sharper = own[0].max(own[1]);
        if sharper <= 0.0 {
            return None;
        }
        let other = self.partners.no_sharper_than(sharper);
        let relative = own.map(|k| k + other);
        let epsilon = if own[0].min(own[1]) > 0.0 {
            self.epsilon_mm
        } else {
            self.crossing_epsilon_mm
        };
        // Curvatures equal and opposite within rounding are a fit, which rims and edges find.
        (relative[0].min(relative[1]) > 1e-9 * sharper)
            .then(|| relative.map(|k| (4.0 * epsilon / k).sqrt().max(self.least_spacing_mm)))
    }
}

/// A sample of the exact surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShellPoint {
    /// Position, mm, shape frame.
    pub position: DVec3,
    /// Outward unit normal; on an edge or corner the mean of its faces' normals.
    pub normal: DVec3,
    /// Face it lies on.
    pub face: u16,
    /// Second face of an edge or corner, else [`NO_FACE`](mortise_protocol::image::NO_FACE).
    pub edge_face: u16,
    /// Stretch of a sharp convex edge of which the point is the middle; the tick finds the deepest place on it.
    pub span: Option<ShellSpan>,
}

/// A stretch of an edge, x(u) = m + a·u + b·u²·(1 − k·(1 − u²)) for −1 ≤ u ≤ 1, with the middle m at its [`ShellPoint`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShellSpan {
    /// a, mm.
    pub along: DVec3,
    /// b, mm.
    pub bend: DVec3,
    /// k, from 0 to 1.
    pub round: f64,
}

impl ShellPoint {
    /// The place at `u` on its span, mm; the point itself without one.
    pub fn at(&self, u: f64) -> DVec3 {
        self.span.map_or(self.position, |span| {
            let bend = span.bend * (u * u * (1.0 - span.round * (1.0 - u * u)));
            self.position + span.along * u + bend
        })
    }

    /// Points whose convex hull contains it, with its span, mm: the ends, and where the tangents there meet.
    pub(crate) fn hull(&self) -> [DVec3; 3] {
        let Some(span) = self.span else {
            return [self.position; 3];
        };
        let control = self.position - span.bend * (1.0 + 2.0 * span.round);
        [self.at(-1.0), control, self.at(1.0)]
    }
}

/// Points of a shape, ordered: faces, then edges, then corners.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pointshell {
    /// The points.
    pub points: Vec<ShellPoint>,
    /// Distance of each point from the surface, mm, outside positive; empty where all lie on it.
    pub offsets: Vec<f64>,
    /// Number of points inside faces.
    pub face_points: usize,
    /// Number of points along edges.
    pub edge_points: usize,
    /// Number of points at corners.
    pub corner_points: usize,
}
