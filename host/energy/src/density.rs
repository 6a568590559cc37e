//! Skeletal density of a solid (Behandish & Ilieş 2015, section 2.2).
//!
//! From a point p the surface is seen at distances η(q) = |p − q|, of which ξ, with the sign of the side, is the least. With ζ = ξ + iη (eq. 1) the kernel
//! is φ(ζ) = λ/√(2π) · ζ⁻² · g(η/|ξ| − 1), g the normal distribution of deviation σ (eq. 2), and the density ρ(p) = ∮ φ(ζ) (v·n) dA with
//! v = (p − q)/η (eq. 3). As v·n dA/η² is a solid angle and only η/|ξ| counts besides, a solid scaled about p has the same density there: beside a plane it
//! is the same at every height.
//!
//! The integral is a sum over the tessellation, each triangle by an integral over its border (`flat.rs`); triangles farther than (1 + 4σ)|ξ| add less
//! than 0.04 % and are left out. The distance ξ is that of the exact surface.

use glam::DVec3;
use mortise_bake::ExactSurface;
use mortise_brep::Shape;
use nalgebra::Complex;

use crate::flat::{FlatKernel, Triangle};
use crate::kernel::Kernel;

/// Nearer to the surface than so many of its chord errors the density is that beside a plane, which it tends to.
const NEAR_CHORDS: f64 = 4.0;
/// The same in mm, where the tessellation is exact.
const NEAR_MM: f64 = 1e-4;

/// A solid prepared for its density.
pub struct Density {
    surface: ExactSurface,
    triangles: Vec<Triangle>,
    flat: FlatKernel,
    /// Distance from the surface below which it is that beside a plane, and its values there, inside and outside.
    near: f64,
    beside: [Complex<f64>; 2],
}

impl Density {
    /// Prepares a closed shape.
    pub fn new(shape: &Shape, kernel: Kernel) -> Self {
        let surface = ExactSurface::new(shape);
        let mesh = &surface.shape().mesh;
        let triangles = mesh
            .triangles
            .iter()
            .map(|t| Triangle::new(t.map(|i| mesh.vertices[i as usize])));
        Self {
            triangles: triangles.collect(),
            flat: FlatKernel::new(kernel),
            near: NEAR_MM.max(NEAR_CHORDS * surface.chord_error_mm()),
            beside: [false, true].map(|is_outside| kernel.beside_a_plane(is_outside)),
            surface,
        }
    }

    /// Bounding box, mm.
    pub fn extent(&self) -> [DVec3; 2] {
        let vertices = &self.surface.shape().mesh.vertices;
        vertices
            .iter()
            .fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], &p| {
                [low.min(p), high.max(p)]
            })
    }

    /// Centre of mass of the solid, mm.
    pub fn center_of_mass(&self) -> DVec3 {
        self.surface.shape().center_of_mass
    }

    /// ρ(p) less the density beside a plane on that side of the surface: zero there, at any distance.
    pub fn without_planes(&self, p: DVec3) -> Complex<f64> {
        match self.surface.nearest(p) {
            Some(nearest) => self.off_surface(p, nearest.distance) - self.beside(nearest.distance),
            None => Complex::ZERO,
        }
    }

    /// ρ(p), eq. 3; zero for a shape without triangles. Cost: that of the nearest point, and some tens of look-ups for each triangle in reach.
    pub fn at(&self, p: DVec3) -> Complex<f64> {
        match self.surface.nearest(p) {
            Some(nearest) => self.off_surface(p, nearest.distance),
            None => Complex::ZERO,
        }
    }

    fn beside(&self, xi: f64) -> Complex<f64> {
        self.beside[usize::from(xi > 0.0)]
    }

    fn off_surface(&self, p: DVec3, xi: f64) -> Complex<f64> {
        if xi.abs() < self.near {
            return self.beside(xi);
        }
        (self.triangles.iter())
            .map(|triangle| self.flat.density(triangle, p, xi))
            .sum()
    }
}
