//! Skeletal density of a solid (Behandish & Ilieş 2015, section 2.2).
//!
//! From a point p the surface is seen at distances η(q) = |p − q|, of which ξ, with the sign of the side, is the least. With ζ = ξ + iη (eq. 1) the kernel
//! is φ(ζ) = λ/√(2π) · ζ⁻² · g(η/|ξ| − 1), g the normal distribution of deviation σ (eq. 2), and the density ρ(p) = ∮ φ(ζ) (v·n) dA with
//! v = (p − q)/η (eq. 3). As v·n dA/η² is a solid angle and only η/|ξ| counts besides, a solid scaled about p has the same density there: beside a plane it
//! is the same at every height.
//!
//! The integral is a sum over the tessellation, whose triangles are halved until they are small beside σ|ξ|; triangles farther than (1 + 4σ)|ξ| add less
//! than 0.04 % and are left out. The distance ξ is that of the exact surface.

use std::f64::consts::{PI, TAU};

use glam::DVec3;
use mortise_bake::ExactSurface;
use mortise_brep::Shape;
use nalgebra::Complex;

/// Deviations of g beyond which the surface is left out.
const REACH: f64 = 4.0;
/// Largest distance of a corner of a triangle from its middle, over σ|ξ|: the sum is then within 0.5 % of the integral.
const STEP: f64 = 0.3;
/// Nearer to the surface than so many of its chord errors the density is that beside a plane, which it tends to.
const NEAR_CHORDS: f64 = 4.0;
/// The same in mm, where the tessellation is exact.
const NEAR_MM: f64 = 1e-4;
/// Intervals of the integral beside a plane.
const INTERVALS: usize = 4000;

/// The kernel of the density.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kernel {
    /// σ: the relative difference of distances that counts as equal.
    pub sigma: f64,
    /// λ₁, the weight outside the solid.
    pub outside: f64,
    /// λ₂, the weight inside. Its ratio to λ₁ is the penalty of an overlap over that of a gap.
    pub inside: f64,
}

impl Default for Kernel {
    /// The ratio of the paper's figures, 3; σ, which it does not give, is 0.2.
    fn default() -> Self {
        Self {
            sigma: 0.2,
            outside: 1.0,
            inside: 3.0,
        }
    }
}

impl Kernel {
    /// φ(ξ + iη), eq. 2.
    pub fn at(&self, xi: f64, eta: f64) -> Complex<f64> {
        let lambda = if xi > 0.0 { self.outside } else { -self.inside };
        let x = (eta / xi.abs() - 1.0) / self.sigma;
        let gauss = (-0.5 * x * x).exp() / (TAU.sqrt() * self.sigma);
        let zeta = Complex::new(xi, eta);
        Complex::from(lambda / TAU.sqrt() * gauss) / (zeta * zeta)
    }

    /// Density beside a plane, outside or inside: the same at every distance. With u = η/|ξ|, λ√(2π) ∫₁^∞ (1 + iu)⁻² g(u − 1) du, and its mirror image.
    pub fn beside_a_plane(&self, is_outside: bool) -> Complex<f64> {
        let sign = if is_outside { 1.0 } else { -1.0 };
        let last = 10.0 * self.sigma;
        let step = last / INTERVALS as f64;
        // Simpson's rule; the area element is 2πη dη and v·n = ξ/η.
        let sum: Complex<f64> = (0..=INTERVALS)
            .map(|i| {
                let weight = match i {
                    0 | INTERVALS => 1.0,
                    i if i % 2 == 1 => 4.0,
                    _ => 2.0,
                };
                self.at(sign, 1.0 + step * i as f64) * weight
            })
            .sum();
        sum * (sign * 2.0 * PI * step / 3.0)
    }
}

/// A solid prepared for its density.
pub struct Density {
    surface: ExactSurface,
    triangles: Vec<[DVec3; 3]>,
    kernel: Kernel,
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
            .map(|t| t.map(|i| mesh.vertices[i as usize]));
        Self {
            triangles: triangles.collect(),
            kernel,
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
            Some(nearest) => self.at(p) - self.beside[usize::from(nearest.distance > 0.0)],
            None => Complex::ZERO,
        }
    }

    /// ρ(p), eq. 3; zero for a shape without triangles. Cost: some thousand parts of triangles, about 0.1 ms.
    pub fn at(&self, p: DVec3) -> Complex<f64> {
        let Some(nearest) = self.surface.nearest(p) else {
            return Complex::ZERO;
        };
        let xi = nearest.distance;
        if xi.abs() < self.near {
            return self.beside[usize::from(xi > 0.0)];
        }
        let reach = xi.abs() * (1.0 + REACH * self.kernel.sigma);
        let largest = STEP * self.kernel.sigma * xi.abs();
        let mut sum = Complex::ZERO;
        let mut open: Vec<[DVec3; 3]> = Vec::new();
        for &triangle in &self.triangles {
            open.push(triangle);
            while let Some([a, b, c]) = open.pop() {
                let middle = (a + b + c) / 3.0;
                let radius = [a, b, c]
                    .map(|q| q.distance(middle))
                    .into_iter()
                    .fold(0.0, f64::max);
                let away = p - middle;
                let eta = away.length();
                if eta - radius > reach {
                    continue;
                }
                if radius > largest {
                    open.extend(halves([a, b, c]));
                    continue;
                }
                let flux = 0.5 * (b - a).cross(c - a).dot(away) / eta;
                sum += self.kernel.at(xi, eta) * flux;
            }
        }
        sum
    }
}

/// Both halves of a triangle, divided across its longest side.
fn halves([a, b, c]: [DVec3; 3]) -> [[DVec3; 3]; 2] {
    let [a, b, c] = [[a, b, c], [b, c, a], [c, a, b]]
        .into_iter()
        .max_by(|x, y| {
            x[0].distance_squared(x[1])
                .total_cmp(&y[0].distance_squared(y[1]))
        })
        .unwrap_or([a, b, c]);
    let middle = a.midpoint(b);
    [[a, middle, c], [middle, b, c]]
}
