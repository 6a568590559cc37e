//! A shape prepared for inspection.

use glam::DVec3;
use mortise_bake::ExactSurface;
use mortise_brep::Shape;
use mortise_task::Body;

use crate::shells;

/// A shape prepared for sections, and with samples also for clearances. Lengths mm, in the shape's frame.
pub struct Solid {
    known: Known,
    /// For each triangle whether its shell is open.
    open: Vec<bool>,
}

enum Known {
    Surface(Box<ExactSurface>),
    Body(Box<Body>),
}

impl Solid {
    /// Prepares `shape` for sections and as the part to which distances are taken.
    pub fn new(shape: &Shape) -> Self {
        Self::with(Known::Surface(Box::new(ExactSurface::new(shape))))
    }

    /// Prepares `shape` also for [`crate::clearances`]; `None` for a shape without triangles. Cost: that of [`Body::new`].
    pub fn sampled(shape: &Shape) -> Option<Self> {
        Some(Self::with(Known::Body(Box::new(Body::new(shape)?))))
    }

    fn with(known: Known) -> Self {
        let mut solid = Self {
            known,
            open: Vec::new(),
        };
        solid.open = shells::open_triangles(&solid.shape().mesh);
        solid
    }

    /// The exact surface.
    pub fn surface(&self) -> &ExactSurface {
        match &self.known {
            Known::Surface(surface) => surface,
            Known::Body(body) => body.surface(),
        }
    }

    /// The shape: its triangles wind outward.
    pub fn shape(&self) -> &Shape {
        self.surface().shape()
    }

    /// Its samples, if it was prepared with them.
    pub fn body(&self) -> Option<&Body> {
        match &self.known {
            Known::Surface(_) => None,
            Known::Body(body) => Some(body),
        }
    }

    /// Signed distance of `p`, mm, negative inside; infinite for a shape without triangles.
    pub fn distance(&self, p: DVec3) -> f64 {
        self.surface().nearest(p).map_or(f64::INFINITY, |n| n.distance)
    }

    /// For each triangle whether its shell is open.
    pub(crate) fn open(&self) -> &[bool] {
        &self.open
    }
}
