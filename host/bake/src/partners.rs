//! Curvature of the surfaces that a shape can meet: it determines how densely the shape must be sampled.
//!
//! Two smooth convex surfaces with principal curvatures κ and κ' touch with relative curvature κ + κ'. Both are sampled and both sample sets are
//! queried, so the sharper one finds the contact: its own lattice, with spacings sᵢ = √(4ε/(κᵢ + κ')), misses at most Σ sᵢ²/8·(κᵢ + κ') ≤ ε. A
//! surface therefore counts only partners that are *no sharper* than itself. Flat and concave faces need no samples inside: a partner that touches
//! them there is convex, or has an edge or a corner there.

use mortise_brep::Surface;

use crate::area_curvatures::area_curvatures;
use crate::distance::ExactSurface;
use crate::fits::room;
use crate::surface::{parameters, principal_curvatures};

/// Partners of a shape.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Partners {
    /// Unknown partners, no assumption: every face is sampled, and no two neighbours are farther apart than the largest spacing.
    #[default]
    Unknown,
    /// These surfaces, plus flat and concave ones and edges, which always count.
    Known(Met),
}

/// Surfaces that a shape can meet.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Met {
    /// Convex curvatures, each once, sorted.
    pub convex: Vec<CurvatureRange>,
    /// Radii of bores, mm, each once, sorted.
    pub bores: Vec<f64>,
}

/// Smallest and largest convex principal curvature over a face, 1/mm; the larger of the two principal curvatures at each of its points.
pub type CurvatureRange = [f64; 2];

/// Share of a spline face's area whose curvature is used: curvature from a tessellation's slivers is noise.
const SPLINE_AREA: f64 = 0.9;

impl Partners {
    /// These surfaces plus any flat or concave one.
    pub fn of<'a>(surfaces: impl IntoIterator<Item = &'a ExactSurface>) -> Self {
        let each: Vec<Met> = surfaces.into_iter().map(Met::of).collect();
        Self::Known(Met::all(&each))
    }

    /// Largest curvature of a partner no sharper than `own`, 1/mm; 0 when there are only flats.
    pub(crate) fn no_sharper_than(&self, own: f64) -> f64 {
        match self {
            Self::Unknown => own,
            Self::Known(met) => (met.convex.iter())
                .filter(|[low, _]| *low <= own * (1.0 + 1e-9))
                .map(|[_, high]| high.min(own))
                .fold(0.0, f64::max),
        }
    }

    /// Largest curvature of any partner, 1/mm.
    pub(crate) fn sharpest(&self) -> f64 {
        match self {
            Self::Unknown => f64::INFINITY,
            Self::Known(met) => met.convex.iter().map(|[_, high]| *high).fold(0.0, f64::max),
        }
    }

    /// Largest difference between the curvature of a shaft of this radius (mm) and that of a bore it fits, 1/mm; `None` where it fits no bore.
    pub(crate) fn room(&self, shaft_mm: f64) -> Option<f64> {
        let Self::Known(met) = self else { return None };
        let rooms = met.bores.iter().filter_map(|&bore| room(shaft_mm, bore));
        rooms.map(|room| room / shaft_mm).reduce(f64::max)
    }
}

impl Met {
    /// Surfaces of one shape.
    pub(crate) fn of(surface: &ExactSurface) -> Self {
        let faces = surface.shape().faces.iter().enumerate();
        let bores = faces.filter_map(|(face, of)| match of.surface {
            Surface::Cylinder { radius, .. } if surface.topology.sense[face] < 0.0 => Some(radius),
            _ => None,
        });
        let mut met = Self {
            convex: (0..surface.shape().faces.len() as u32)
                .filter_map(|face| face_range(surface, face))
                .collect(),
            bores: bores.collect(),
        };
        met.tidy();
        met
    }

    /// Surfaces of several shapes.
    pub(crate) fn all<'a>(each: impl IntoIterator<Item = &'a Self>) -> Self {
        let mut all = Self::default();
        for met in each {
            all.convex.extend(&met.convex);
            all.bores.extend(&met.bores);
        }
        all.tidy();
        all
    }

    fn tidy(&mut self) {
        (self.convex).sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
        self.convex.dedup();
        self.bores.sort_by(f64::total_cmp);
        self.bores.dedup();
    }
}

/// Convex curvatures of `face`; `None` when it is flat or concave everywhere.
pub(crate) fn face_range(surface: &ExactSurface, face: u32) -> Option<CurvatureRange> {
    let shape = surface.shape();
    let kind = &shape.faces[face as usize].surface;
    let own = || (0..shape.mesh.triangles.len()).filter(move |&t| shape.mesh.triangle_face[t] == face);
    let [low, high] = match kind {
        Surface::Plane { .. } => return None,
        Surface::Spline => {
            let mut curvatures = area_curvatures(surface, face);
            curvatures.sort_by(|a, b| a.1.total_cmp(&b.1));
            let mut area = SPLINE_AREA * curvatures.iter().map(|c| c.0).sum::<f64>();
            let high = curvatures.iter().find(|c| {
                area -= c.0;
                area <= 0.0
            });
            [curvatures.first()?.1.max(0.0), high?.1]
        }
        _ => {
            let sense = surface.topology.sense[face as usize];
            own()
                .flat_map(|t| shape.mesh.triangles[t])
                .filter_map(|v| parameters(kind, shape.mesh.vertices[v as usize]))
                .map(|[_, v]| {
                    let [a, b] = principal_curvatures(kind, v);
                    (a * sense).max(b * sense)
                })
                .fold([f64::INFINITY, 0.0], |[low, high], k| {
                    [low.min(k.max(0.0)), high.max(k)]
                })
        }
    };
    (high > 1e-9).then_some([low.min(high), high])
}
