//! The density of a flat triangle, by an integral over its border.
//!
//! On a plane at the height h from p the kernel depends on η alone, and v·n dA = h/η dA. With polar coordinates r, θ about the foot of p, r dr = η dη, so the
//! triangle's part of eq. 3 is h ∫ [G(η(θ)) − G(|h|)] dθ once around its border, G the integral of φ(ξ + iη) over η. In units of |ξ| all of it is one table over
//! u = η/|ξ|, λ₁Γ(u) outside a solid and −λ₂ Γ*(u) inside, with Γ(u) = 1/√(2π) ∫₀ᵘ g(t − 1)/(1 + it)² dt.
//!
//! Along an edge at the distance d from the foot, dθ = d ds/(d² + s²). The quotient [Γ(√(h² + d² + s²)) − Γ(|h|)]/(d² + s²) is smooth wherever the foot is, also
//! on the edge, so a few nodes of Gauss' rule integrate it. Where u is beyond the reach of g, Γ is constant and the angle alone counts.

use std::f64::consts::TAU;

use glam::DVec3;
use nalgebra::Complex;

use crate::kernel::{Kernel, REACH};

/// Intervals of the table over σ, and of Simpson's rule in each.
const INTERVALS: f64 = 32.0;
const PARTS: usize = 8;
/// Largest distance of a corner of a triangle from its middle, over σ|ξ|, for which the kernel at the middle stands for all of it.
const SMALL: f64 = 0.3;
/// Longest piece of an edge for one Gauss rule, over σ|ξ|: the integral is then good to a millionth.
const PIECE: f64 = 2.0;
/// Nodes on [−1, 1] and weights of Gauss' rule with four nodes.
const GAUSS: [(f64, f64); 4] = [
    (-0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
    (-0.339_981_043_584_856_26, 0.652_145_154_862_546_1),
    (0.339_981_043_584_856_26, 0.652_145_154_862_546_1),
    (0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
];
/// (r/|ξ|)² below which the quotient is its limit.
const AT_FOOT: f64 = 1e-8;

/// A triangle, prepared.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Triangle {
    corners: [DVec3; 3],
    /// Twice its area times its normal.
    doubled: DVec3,
    normal: DVec3,
    middle: DVec3,
    /// Largest distance of a corner from the middle.
    radius: f64,
}

impl Triangle {
    pub(crate) fn new(corners: [DVec3; 3]) -> Self {
        let [a, b, c] = corners;
        let middle = (a + b + c) / 3.0;
        let doubled = (b - a).cross(c - a);
        Self {
            corners,
            doubled,
            normal: doubled.normalize_or_zero(),
            middle,
            radius: corners
                .map(|q| q.distance(middle))
                .into_iter()
                .fold(0.0, f64::max),
        }
    }
}

/// Γ by a table: its values and derivatives over u, each `step` apart.
#[derive(Clone, Debug)]
pub(crate) struct FlatKernel {
    kernel: Kernel,
    step: f64,
    table: Vec<[Complex<f64>; 2]>,
}

impl FlatKernel {
    pub(crate) fn new(kernel: Kernel) -> Self {
        let step = kernel.sigma / INTERVALS;
        let count = ((1.0 + REACH * kernel.sigma) / step).ceil() as usize;
        let slope = |u: f64| {
            let x = (u - 1.0) / kernel.sigma;
            let gauss = (-0.5 * x * x).exp() / (TAU.sqrt() * kernel.sigma);
            let zeta = Complex::new(1.0, u);
            Complex::from(gauss / TAU.sqrt()) / (zeta * zeta)
        };
        let part = step / PARTS as f64;
        let mut sum = Complex::ZERO;
        let table = (0..=count)
            .map(|i| {
                let here = step * i as f64;
                let entry = [sum, slope(here)];
                let simpson = |k: usize| {
                    let u = here + part * k as f64;
                    (slope(u) + slope(u + 0.5 * part) * 4.0 + slope(u + part)) * (part / 6.0)
                };
                sum += (0..PARTS).map(simpson).sum::<Complex<f64>>();
                entry
            })
            .collect();
        Self { kernel, step, table }
    }

    /// u beyond which Γ is constant.
    fn reach(&self) -> f64 {
        self.step * (self.table.len() - 1) as f64
    }

    /// Γ and its derivative.
    fn at(&self, u: f64) -> [Complex<f64>; 2] {
        let place = u / self.step;
        let index = place as usize;
        let Some([[a, da], [b, db]]) = self.table.get(index..index + 2).and_then(|two| two.first_chunk())
        else {
            return [self.table[self.table.len() - 1][0], Complex::ZERO];
        };
        let t = place - index as f64;
        // Hermite's cubic.
        let (rest, step) = (1.0 - t, self.step);
        let value = *a * (rest * rest * (1.0 + 2.0 * t))
            + *b * (t * t * (3.0 - 2.0 * t))
            + *da * (step * t * rest * rest)
            - *db * (step * t * t * rest);
        [value, *da * rest + *db * t]
    }

    /// Part of a triangle in ρ(p), p at the distance ξ from the whole surface. Cost: about 30 look-ups an edge near p, one for a triangle that is small
    /// beside σ|ξ|.
    pub(crate) fn density(&self, triangle: &Triangle, p: DVec3, xi: f64) -> Complex<f64> {
        let away = p - triangle.middle;
        let far = (1.0 + REACH * self.kernel.sigma) * xi.abs() + triangle.radius;
        let squared = away.length_squared();
        if squared > far * far {
            return Complex::ZERO;
        }
        if triangle.radius < SMALL * self.kernel.sigma * xi.abs() {
            let eta = squared.sqrt();
            return self.kernel.at(xi, eta) * (0.5 * triangle.doubled.dot(away) / eta);
        }
        let [a, b, c] = triangle.corners.map(|corner| (corner - p) / xi.abs());
        let height = -triangle.normal.dot(a);
        let foot = -triangle.normal * height;
        if height == 0.0 || height.abs() >= self.reach() {
            return Complex::ZERO;
        }
        let low = self.at(height.abs());
        let sum: Complex<f64> = [[a, b], [b, c], [c, a]]
            .into_iter()
            .map(|[from, to]| self.edge([from - foot, to - foot], triangle.normal, height.abs(), low))
            .sum();
        let sum = sum * height;
        if xi > 0.0 {
            sum * self.kernel.outside
        } else {
            sum.conj() * -self.kernel.inside
        }
    }

    /// ∫ [Γ(η) − Γ(|h|)] dθ along an edge, its ends relative to the foot; `low` is Γ at the height with its derivative.
    fn edge(
        &self,
        [from, to]: [DVec3; 2],
        normal: DVec3,
        height: f64,
        low: [Complex<f64>; 2],
    ) -> Complex<f64> {
        let Some(along) = (to - from).try_normalize() else {
            return Complex::ZERO;
        };
        // Positive where the edge runs around the foot as the border does.
        let off = normal.dot(from.cross(along));
        if off == 0.0 {
            return Complex::ZERO;
        }
        let (start, end) = (from.dot(along), to.dot(along));
        let reach = self.reach();
        let half = (reach * reach - height * height - off * off).max(0.0).sqrt();
        let (first, last) = (start.clamp(-half, half), end.clamp(-half, half));
        let mut sum = Complex::ZERO;
        let pieces = ((last - first) / (PIECE * self.kernel.sigma)).ceil();
        let piece = (last - first) / pieces.max(1.0);
        for i in 0..pieces as usize {
            let middle = first + piece * (i as f64 + 0.5);
            for (node, weight) in GAUSS {
                let s = middle + 0.5 * piece * node;
                let squared = off * off + s * s;
                let quotient = if squared < AT_FOOT {
                    low[1] / (2.0 * height)
                } else {
                    (self.at((height * height + squared).sqrt())[0] - low[0]) / squared
                };
                sum += quotient * (0.5 * piece * weight * off);
            }
        }
        if start < first || end > last {
            let angle = |s: f64| (s / off).atan();
            let beyond = angle(end) - angle(last) + angle(first) - angle(start);
            sum += (self.table[self.table.len() - 1][0] - low[0]) * beyond;
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Corner of a triangle, millimetres.
    fn point(random: &mut fastrand::Rng) -> DVec3 {
        4.0 * (DVec3::new(random.f64(), random.f64(), random.f64()) - 0.5)
    }

    /// The same by 3 · 4ⁿ parts, each by its middle.
    fn in_parts(kernel: &Kernel, [a, b, c]: [DVec3; 3], p: DVec3, xi: f64, halvings: u32) -> Complex<f64> {
        if halvings == 0 {
            let away = p - (a + b + c) / 3.0;
            let eta = away.length();
            if eta > (1.0 + REACH * kernel.sigma) * xi.abs() {
                return Complex::ZERO;
            }
            return kernel.at(xi, eta) * (0.5 * (b - a).cross(c - a).dot(away) / eta);
        }
        let [ab, bc, ca] = [a.midpoint(b), b.midpoint(c), c.midpoint(a)];
        [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            .into_iter()
            .map(|part| in_parts(kernel, part, p, xi, halvings - 1))
            .sum()
    }

    #[test]
    fn a_triangle_s_integral_is_the_sum_over_its_parts() {
        let mut random = fastrand::Rng::with_seed(5);
        let mut largest = 0.0f64;
        for number in 0..60 {
            let kernel = Kernel {
                sigma: 0.1 + 0.3 * random.f64(),
                ..Kernel::default()
            };
            let corners = [(); 3].map(|()| point(&mut random));
            // Also beside an edge, above a corner, and with the foot on an edge.
            let [u, v] = [random.f64(), random.f64()];
            let on = match number % 4 {
                0 => point(&mut random),
                1 => corners[0],
                2 => corners[0].lerp(corners[1], u),
                _ => corners[0].lerp(corners[1], u).lerp(corners[2], v),
            };
            let normal = (corners[1] - corners[0])
                .cross(corners[2] - corners[0])
                .normalize();
            let side = if number % 3 == 0 { -1.0 } else { 1.0 };
            let p = on + normal * (side * (0.6 + 0.8 * random.f64()));
            // No part of the triangle is nearer to p than the surface: eta is at least |xi|, which is at most the height.
            let xi = normal.dot(p - corners[0]) * (0.6 + 0.4 * random.f64());
            let exact = FlatKernel::new(kernel).density(&Triangle::new(corners), p, xi);
            let sum = in_parts(&kernel, corners, p, xi, 8);
            largest = largest.max(exact.norm());
            // The parts are cut off at the reach, where g is 3·10⁻⁴ of its maximum; the middle rule's error is quadratic in their size.
            assert!((exact - sum).norm() < 3e-3, "{number}: {exact} is not {sum}");
        }
        assert!(largest > 0.1, "something was in reach: {largest}");
    }

    #[test]
    fn the_table_ends_where_the_kernel_does() {
        let flat = FlatKernel::new(Kernel::default());
        let [last, slope] = flat.at(flat.reach() + 1.0);
        assert_eq!(slope, Complex::ZERO);
        assert!((flat.at(flat.reach() - 1e-9)[0] - last).norm() < 1e-9);
        // ∫₀^∞ g(t − 1)/(1 + it)² dt, by a hundred thousand steps of the middle rule.
        let (steps, sigma) = (100_000, flat.kernel.sigma);
        let width = flat.reach() / f64::from(steps);
        let sum: Complex<f64> = (0..steps)
            .map(|i| {
                let t = width * (f64::from(i) + 0.5);
                let x = (t - 1.0) / sigma;
                let g = (-0.5 * x * x).exp() / (TAU.sqrt() * sigma);
                let zeta = Complex::new(1.0, t);
                Complex::from(g * width / TAU.sqrt()) / (zeta * zeta)
            })
            .sum();
        assert!((sum - last).norm() < 1e-8, "{sum} {last}");
    }
}
