//! A free-form surface under a face: evaluation and the nearest point to a point near it.
//!
//! S(u, v) = Σ Nᵢ Nⱼ wᵢⱼ Pᵢⱼ / Σ Nᵢ Nⱼ wᵢⱼ with derivatives up to the second (Piegl & Tiller, "The NURBS Book", 2.3, 4.4). The foot of a point p
//! minimises |S(u, v) − p|² by Newton steps within the parameter box, halved until they descend; where the Hessian is not positive definite the
//! Gauss–Newton step is taken. A start in the foot's own triangle takes 2 to 5 steps of about 1 µs. The result is a local minimum: the caller starts
//! from every triangle that may contain the nearest point.

use glam::DVec3;
use mortise_brep::SplineSurface;

/// Highest degree: the CAD kernel's own limit.
const MAX_DEGREE: usize = 25;
const MAX_STEPS: usize = 24;
const MAX_HALVINGS: usize = 10;
/// Step length that ends the search, mm: Newton steps double the number of correct digits, so the foot is then exact to rounding.
const SHORT_MM: f64 = 1e-9;

/// Sides nearer to each other than this are one, mm: rounding of poles in files.
const CLOSED_MM: f64 = 1e-6;

/// A (rational) B-spline surface over its parameter box.
pub(crate) struct Patch {
    degrees: [usize; 2],
    knots: [Vec<f64>; 2],
    /// w·x, w·y, w·z, w; v runs fastest.
    poles: Vec<[f64; 4]>,
    /// Number of poles along v.
    row: usize,
    bounds: [[f64; 2]; 2],
    /// Whether the sides across the parameter coincide, so that it wraps round.
    closed: [bool; 2],
    /// Largest distance from the face's own surface, mm.
    pub deviation: f64,
}

/// A point of a patch.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OnPatch {
    pub uv: [f64; 2],
    /// Position, mm.
    pub point: DVec3,
    /// Unit normal ∂S/∂u × ∂S/∂v; zero where that vanishes (a pole).
    pub normal: DVec3,
}

/// Point and derivatives.
struct Jet {
    s: DVec3,
    first: [DVec3; 2],
    /// Second derivatives: uu, uv, vv.
    second: [DVec3; 3],
}

impl Patch {
    /// `None` when the degree exceeds the limit or the counts are inconsistent.
    pub fn new(surface: &SplineSurface) -> Option<Self> {
        let degrees = surface.degrees.map(|d| d as usize);
        let mut counts = [0; 2];
        let mut bounds = [[0.0; 2]; 2];
        for k in 0..2 {
            let knots = &surface.knots[k];
            counts[k] = knots.len().checked_sub(degrees[k] + 1)?;
            if degrees[k] == 0 || degrees[k] > MAX_DEGREE || counts[k] <= degrees[k] {
                return None;
            }
            bounds[k] = [knots[degrees[k]], knots[counts[k]]];
        }
        if counts[0] * counts[1] != surface.poles.len() || surface.poles.is_empty() {
            return None;
        }
        let mut patch = Self {
            degrees,
            knots: surface.knots.clone(),
            poles: surface
                .poles
                .iter()
                .map(|&[x, y, z, w]| [x * w, y * w, z * w, w])
                .collect(),
            row: counts[1],
            bounds,
            closed: [false; 2],
            deviation: surface.deviation_mm,
        };
        patch.closed = [0, 1].map(|k| patch.closes(k));
        Some(patch)
    }

    /// Whether the two sides across parameter `k` coincide. Poles do not tell: those of a surface that was periodic repeat by its degree.
    fn closes(&self, k: usize) -> bool {
        let at = |end: usize, along: f64| {
            let mut uv = [along; 2];
            uv[k] = self.bounds[k][end];
            self.jet(uv).s
        };
        let [lo, hi] = self.bounds[1 - k];
        let count = 2 * self.knots[1 - k].len();
        (0..=count).all(|i| {
            let along = lo + (hi - lo) * i as f64 / count as f64;
            at(0, along).distance(at(1, along)) < CLOSED_MM
        })
    }

    /// Local minimum of the distance to `p`, reached from `start`.
    pub fn project(&self, p: DVec3, start: [f64; 2]) -> OnPatch {
        let (mut at, mut jet) = self.descend(p, start);
        if let Some(side) = self.collapsed(&jet) {
            // The tip of a cone: every parameter along the side gives the same point, and only some of them descend from it.
            let (off, there) = self.descend(p, self.best_beside(side, at, p));
            if there.s.distance_squared(p) < jet.s.distance_squared(p) {
                (at, jet) = (off, there);
            }
        }
        let normal = match self.collapsed(&jet) {
            Some(_) => DVec3::ZERO,
            None => jet.first[0].cross(jet.first[1]).normalize_or_zero(),
        };
        OnPatch {
            uv: at,
            point: jet.s,
            normal,
        }
    }

    /// The parameter along which the surface does not move there (or hardly moves, relative to its size).
    fn collapsed(&self, jet: &Jet) -> Option<usize> {
        let moves = [0, 1].map(|k| jet.first[k].length() * (self.bounds[k][1] - self.bounds[k][0]));
        (0..2).find(|&k| moves[k] < 1e-6 * moves[1 - k])
    }

    /// The point nearest to `p` among those a thousandth of the other parameter's range away from a collapsed side.
    fn best_beside(&self, side: usize, at: [f64; 2], p: DVec3) -> [f64; 2] {
        const SAMPLES: usize = 32;
        let [lo, hi] = self.bounds[1 - side];
        let inward = if at[1 - side] - lo < hi - at[1 - side] {
            1e-3
        } else {
            -1e-3
        };
        let [first, last] = self.bounds[side];
        let candidates = (0..SAMPLES).map(|i| {
            let mut uv = at;
            uv[1 - side] += inward * (hi - lo);
            uv[side] = first + (last - first) * (i as f64 + 0.5) / SAMPLES as f64;
            uv
        });
        let far = |uv: &[f64; 2]| self.jet(*uv).s.distance_squared(p);
        candidates.min_by(|a, b| far(a).total_cmp(&far(b))).unwrap_or(at)
    }

    fn descend(&self, p: DVec3, start: [f64; 2]) -> ([f64; 2], Jet) {
        let mut at = self.inside(start);
        let mut jet = self.jet(at);
        let mut best = jet.s.distance_squared(p);
        for _ in 0..MAX_STEPS {
            let r = jet.s - p;
            let gradient = jet.first.map(|d| d.dot(r));
            // A parameter at its bound stays there while the distance falls outward.
            let free = [0, 1].map(|k| {
                let [lo, hi] = self.bounds[k];
                self.closed[k] || !(at[k] <= lo && gradient[k] > 0.0 || at[k] >= hi && gradient[k] < 0.0)
            });
            let step = newton_step(&jet, r, gradient, free);
            let mut scale = 1.0;
            let mut found = None;
            for _ in 0..MAX_HALVINGS {
                let next = self.inside([at[0] + scale * step[0], at[1] + scale * step[1]]);
                let there = self.jet(next);
                let d = there.s.distance_squared(p);
                if d < best {
                    found = Some((next, there, d));
                    break;
                }
                scale /= 2.0;
            }
            let Some((next, there, d)) = found else { break };
            let moved = there.s.distance(jet.s);
            (at, jet, best) = (next, there, d);
            if moved < SHORT_MM {
                break;
            }
        }
        (at, jet)
    }

    /// Points over the whole patch, `(uv, point)`: `degree + 1` in each knot span.
    pub fn grid(&self) -> Vec<([f64; 2], DVec3)> {
        let lines: [Vec<f64>; 2] = [0, 1].map(|k| {
            let degree = self.degrees[k];
            let inner = &self.knots[k][degree..self.knots[k].len() - degree];
            let mut out = vec![inner[0]];
            for pair in inner.windows(2).filter(|pair| pair[1] > pair[0]) {
                let steps = degree + 1;
                out.extend((1..=steps).map(|i| pair[0] + (pair[1] - pair[0]) * i as f64 / steps as f64));
            }
            out
        });
        let uv = lines[0]
            .iter()
            .flat_map(|&u| lines[1].iter().map(move |&v| [u, v]));
        uv.map(|uv| (uv, self.jet(uv).s)).collect()
    }

    /// `uv` wrapped or clamped into the parameter box.
    fn inside(&self, uv: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|k| {
            let [lo, hi] = self.bounds[k];
            if self.closed[k] && !(lo..=hi).contains(&uv[k]) {
                lo + (uv[k] - lo).rem_euclid(hi - lo)
            } else {
                uv[k].clamp(lo, hi)
            }
        })
    }

    fn jet(&self, uv: [f64; 2]) -> Jet {
        // Rows no longer than needed: most surfaces are cubic, and rows for the highest degree take most of the time to copy.
        match self.degrees[0].max(self.degrees[1]) {
            0..4 => self.jet_in::<4>(uv),
            4..8 => self.jet_in::<8>(uv),
            _ => self.jet_in::<{ MAX_DEGREE + 1 }>(uv),
        }
    }

    /// [`Self::jet`] for degrees below `N`.
    fn jet_in<const N: usize>(&self, uv: [f64; 2]) -> Jet {
        let spans = [0, 1].map(|k| self.span(k, uv[k]));
        let [bu, bv] = [0, 1].map(|k| basis::<N>(&self.knots[k], self.degrees[k], spans[k], uv[k]));
        let [p, q] = self.degrees;
        // Homogeneous sums for derivatives (0,0), (1,0), (0,1), (2,0), (1,1), (0,2).
        let mut a = [[0.0f64; 4]; 6];
        for (i, &value) in bu[0].iter().enumerate().take(p + 1) {
            let along = [value, bu[1][i], bu[2][i]];
            let first = (spans[0] - p + i) * self.row + spans[1] - q;
            let mut line = [[0.0f64; 4]; 3];
            for (j, pole) in self.poles[first..=first + q].iter().enumerate() {
                for (order, sum) in line.iter_mut().enumerate() {
                    for c in 0..4 {
                        sum[c] += bv[order][j] * pole[c];
                    }
                }
            }
            for (sum, (du, dv)) in a.iter_mut().zip([(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)]) {
                for c in 0..4 {
                    sum[c] += along[du] * line[dv][c];
                }
            }
        }
        let xyz = |c: [f64; 4]| DVec3::new(c[0], c[1], c[2]);
        let w = a[0][3];
        let s = xyz(a[0]) / w;
        let su = (xyz(a[1]) - s * a[1][3]) / w;
        let sv = (xyz(a[2]) - s * a[2][3]) / w;
        Jet {
            s,
            first: [su, sv],
            second: [
                (xyz(a[3]) - su * (2.0 * a[1][3]) - s * a[3][3]) / w,
                (xyz(a[4]) - sv * a[1][3] - su * a[2][3] - s * a[4][3]) / w,
                (xyz(a[5]) - sv * (2.0 * a[2][3]) - s * a[5][3]) / w,
            ],
        }
    }

    /// Last knot not above `t` that begins a span.
    fn span(&self, k: usize, t: f64) -> usize {
        let (knots, degree) = (&self.knots[k], self.degrees[k]);
        let last = knots.len() - degree - 2;
        let above = knots[degree..=last + 1].partition_point(|&knot| knot <= t);
        let mut span = (degree + above).saturating_sub(1).clamp(degree, last);
        while span > degree && knots[span] >= knots[span + 1] {
            span -= 1;
        }
        span
    }
}

/// Newton step: it would end at the minimum if the distance squared were quadratic. Parameters that are not free stay.
fn newton_step(jet: &Jet, r: DVec3, g: [f64; 2], free: [bool; 2]) -> [f64; 2] {
    let [su, sv] = jet.first;
    let [suu, suv, svv] = jet.second;
    let plain = [su.dot(su), su.dot(sv), sv.dot(sv)];
    let full = [
        plain[0] + r.dot(suu),
        plain[1] + r.dot(suv),
        plain[2] + r.dot(svv),
    ];
    let alone = |k: usize| {
        let (full, plain) = (full[2 * k], plain[2 * k]);
        let h = if full > 1e-3 * plain { full } else { plain };
        if h > 0.0 { -g[k] / h } else { 0.0 }
    };
    match free {
        [true, true] => {
            for [a, b, c] in [full, plain] {
                let determinant = a * c - b * b;
                if a > 0.0 && c > 0.0 && determinant > 1e-9 * a * c {
                    return [
                        (b * g[1] - c * g[0]) / determinant,
                        (b * g[0] - a * g[1]) / determinant,
                    ];
                }
            }
            [alone(0), alone(1)]
        }
        [u, v] => [if u { alone(0) } else { 0.0 }, if v { alone(1) } else { 0.0 }],
    }
}

/// The `degree + 1` basis functions that are not zero in `span`, and their first and second derivatives at `t`.
///
/// Cox–de Boor up the degrees; a k-th derivative is degree · (N⁽ᵏ⁻¹⁾ᵢ / (tᵢ₊ₚ − tᵢ) − N⁽ᵏ⁻¹⁾ᵢ₊₁ / (tᵢ₊ₚ₊₁ − tᵢ₊₁)) of one degree less.
/// `degree` is less than `N`.
fn basis<const N: usize>(knots: &[f64], degree: usize, span: usize, t: f64) -> [[f64; N]; 3] {
    let zero = [0.0; N];
    // Recurrence from functions of degree d − 1 (local index j − 1 and j are functions i and i + 1) to one of degree d, i = span − d + j.
    let over = |d: usize, j: usize| {
        let i = span + j - d;
        let left = knots[i + d] - knots[i];
        let right = knots[i + d + 1] - knots[i + 1];
        (
            i,
            if left > 0.0 { 1.0 / left } else { 0.0 },
            if right > 0.0 { 1.0 / right } else { 0.0 },
        )
    };
    let raise = |lower: &[f64; N], d: usize| {
        let mut row = zero;
        for j in 0..=d {
            let (i, left, right) = over(d, j);
            let below = if j > 0 {
                (t - knots[i]) * left * lower[j - 1]
            } else {
                0.0
            };
            let above = if j < d {
                (knots[i + d + 1] - t) * right * lower[j]
            } else {
                0.0
            };
            row[j] = below + above;
        }
        row
    };
    let derive = |lower: &[f64; N], d: usize| {
        let mut row = zero;
        for j in 0..=d {
            let (_, left, right) = over(d, j);
            let below = if j > 0 { left * lower[j - 1] } else { 0.0 };
            let above = if j < d { right * lower[j] } else { 0.0 };
            row[j] = d as f64 * (below - above);
        }
        row
    };
    let mut values = zero;
    values[0] = 1.0;
    let (mut one_less, mut two_less) = (zero, zero);
    for d in 1..=degree {
        two_less = one_less;
        one_less = values;
        values = raise(&values, d);
    }
    let first = derive(&one_less, degree);
    let second = if degree > 1 {
        derive(&derive(&two_less, degree - 1), degree)
    } else {
        zero
    };
    [values, first, second]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A quarter of a cylinder of radius 5 about z, from z = 0 to 20: linear along u, a rational arc along v.
    fn quarter() -> Patch {
        let w = 0.5f64.sqrt();
        let arc = [([5.0, 0.0], 1.0), ([5.0, 5.0], w), ([0.0, 5.0], 1.0)];
        let poles = [0.0, 20.0]
            .iter()
            .flat_map(|&z| arc.iter().map(move |&([x, y], w)| [x, y, z, w]))
            .collect();
        Patch::new(&SplineSurface {
            face: 0,
            degrees: [1, 2],
            knots: [vec![0.0, 0.0, 1.0, 1.0], vec![0.0, 0.0, 0.0, 1.0, 1.0, 1.0]],
            poles,
            deviation_mm: 0.0,
        })
        .unwrap()
    }

    /// A wavy cubic sheet over 30 × 30 mm with a double knot in u.
    fn sheet() -> Patch {
        let (nu, nv) = (7, 6);
        let height = |i: usize, j: usize| 2.0 * ((i * 7 + j * 5) % 4) as f64 - 3.0;
        let poles = (0..nu * nv)
            .map(|k| {
                let (i, j) = (k / nv, k % nv);
                let weight = 1.0 + 0.2 * ((i + j) % 3) as f64;
                [5.0 * i as f64, 6.0 * j as f64, height(i, j), weight]
            })
            .collect();
        Patch::new(&SplineSurface {
            face: 0,
            degrees: [3, 3],
            knots: [
                vec![0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 2.0, 3.0, 3.0, 3.0, 3.0],
                vec![-1.0, -1.0, -1.0, -1.0, 0.5, 1.0, 2.0, 2.0, 2.0, 2.0],
            ],
            poles,
            deviation_mm: 0.0,
        })
        .unwrap()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]

        /// The foot on a cylinder written as a spline equals that on the cylinder, or lies on the patch's border.
        #[test]
        fn a_rational_arc_is_a_circle(rho in 0.5f64..12.0, a in 0.05f64..1.52, z in 0.5f64..19.5, start in prop::array::uniform2(0.0f64..1.0)) {
            let p = DVec3::new(rho * a.cos(), rho * a.sin(), z);
            let on = quarter().project(p, start);
            let foot = DVec3::new(5.0 * a.cos(), 5.0 * a.sin(), z);
            prop_assert!(on.point.distance(foot) < 1e-6, "{on:?} {foot}");
            prop_assert!((on.point.distance(p) - (rho - 5.0).abs()).abs() < 1e-12);
            prop_assert!((on.normal.dot(foot.with_z(0.0)) / 5.0).abs() > 1.0 - 1e-9);
        }

        /// Derivatives agree with finite differences away from the knots.
        #[test]
        fn derivatives_are_limits_of_differences(u in 0.01f64..2.99, v in -0.99f64..1.99) {
            const H: f64 = 1e-4;
            prop_assume!([1.0, 2.0].iter().all(|k| (u - k).abs() > 3.0 * H));
            prop_assume!([0.5, 1.0].iter().all(|k| (v - k).abs() > 3.0 * H));
            let patch = sheet();
            let at = |i: f64, j: f64| patch.jet([u + i * H, v + j * H]).s;
            let jet = patch.jet([u, v]);
            // Central differences have an error of H²/6 and H²/12 times derivatives of up to some hundred mm; second ones also have rounding over H².
            prop_assert!(jet.first[0].distance((at(1.0, 0.0) - at(-1.0, 0.0)) / (2.0 * H)) < 1e-4);
            prop_assert!(jet.first[1].distance((at(0.0, 1.0) - at(0.0, -1.0)) / (2.0 * H)) < 1e-4);
            prop_assert!(jet.second[0].distance((at(1.0, 0.0) + at(-1.0, 0.0) - 2.0 * jet.s) / (H * H)) < 1e-2);
            let mixed = at(1.0, 1.0) + at(-1.0, -1.0) - at(1.0, -1.0) - at(-1.0, 1.0);
            prop_assert!(jet.second[1].distance(mixed / (4.0 * H * H)) < 1e-2);
            prop_assert!(jet.second[2].distance((at(0.0, 1.0) + at(0.0, -1.0) - 2.0 * jet.s) / (H * H)) < 1e-2);
        }

        /// From the nearest of many samples, the foot is at least as near as every sample, and inside the patch the offset is along the normal.
        #[test]
        fn no_sample_is_nearer_than_the_foot(p in (-5.0f64..35.0, -5.0f64..35.0, -8.0f64..8.0)) {
            let p = DVec3::new(p.0, p.1, p.2);
            let patch = sheet();
            let samples = (0..3600).map(|k| [f64::from(k / 60) * 3.0 / 59.0, f64::from(k % 60) * 3.0 / 59.0 - 1.0]);
            let far = |uv: &[f64; 2]| patch.jet(*uv).s.distance(p);
            let start = samples.min_by(|a, b| far(a).total_cmp(&far(b))).unwrap();
            let on = patch.project(p, start);
            let d = on.point.distance(p);
            prop_assert!(d <= far(&start) + 1e-12);
            let inside = on.uv[0] > 0.0 && on.uv[0] < 3.0 && on.uv[1] > -1.0 && on.uv[1] < 2.0;
            // The double knot is a discontinuity of curvature only: the normal is continuous there.
            if inside && d > 1e-3 {
                prop_assert!((p - on.point).dot(on.normal).abs() > d * (1.0 - 1e-9), "{on:?}");
            }
        }
    }

    #[test]
    fn counts_that_do_not_fit_are_refused() {
        let surface = SplineSurface {
            face: 0,
            degrees: [1, 1],
            knots: [vec![0.0, 0.0, 1.0, 1.0], vec![0.0, 0.0, 1.0, 1.0]],
            poles: vec![[0.0, 0.0, 0.0, 1.0]; 3],
            deviation_mm: 0.0,
        };
        assert!(Patch::new(&surface).is_none());
    }
}
