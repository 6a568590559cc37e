//! The kernel of the density (Behandish & Ilieş 2015, eqs. 1 and 2).

use std::f64::consts::{PI, TAU};

use nalgebra::Complex;

/// Deviations of g beyond which the surface is left out.
pub(crate) const REACH: f64 = 4.0;
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
