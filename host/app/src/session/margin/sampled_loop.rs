//! The sampled loop of the virtual coupling on one axis, with the held part at rest in contact: its exact stability, and its passivity.
//!
//! The board reads the handle's position x once a period T and renders F = −(K·x + B·v̂) with B = b_T + T·K (it looks one period ahead,
//! `docs/notation.md`). v̂ is the difference of two readings through the speed estimator's low-pass of time constant τ
//! ([`mortise_mechanism::velocity`]), so with g = T/(τ + T) and p = 1 − g the force is H(z)·x with
//!
//! ```text
//! H(z) = z⁻ᵈ·( K + (B·g/T)·(z − 1)/(z − p) )
//! ```
//!
//! held for a period and d periods late.
//!
//! **Stable.** A handle m·v̇ + b·v = F that nobody holds answers a held force with (n₁·z + n₀)/((z − 1)·(z − α)), where x = b·T/m, α = e⁻ˣ,
//! n₁ = T²/m·(x − 1 + e⁻ˣ)/x² and n₀ = T²/m·(1 − (1 + x)·e⁻ˣ)/x². The loop is stable exactly if every root of
//!
//! ```text
//! zᵈ·(z − 1)·(z − α)·(z − p) + (n₁·z + n₀)·( K·(z − p) + (B·g/T)·(z − 1) )
//! ```
//!
//! lies within the unit circle, which the test of Schur and Cohn decides without finding them (Jury, *Theory and application of the z-transform
//! method*, 1964). A part of up to 5 kg that moves freely is stable
//! wherever this one is with gains 4/π times as large, from 10 N/m and a filter of 1 ms on: a property test of this file.
//!
//! **Passive.** By Colgate and Schenkel (J. Robotic Systems 14(1), 1997) the handle delivers no energy to any passive hand exactly if at every
//! θ = ω·T up to π
//!
//! ```text
//! b > T/2·Re{(1 − e^−jθ)·H(e^jθ)}/(1 − cos θ)
//!   = K·T/2·(cos dθ − cos (d+1)θ)/(1 − cos θ) + B·g·(p·cos dθ − cos (d+1)θ)/(1 − 2·p·cos θ + p²)
//! ```
//!
//! Without delay the largest is at θ = π: b > K·T/2 + B·T/(2·τ + T), which without a filter is their K·T/2 + |B|.
//!
//! Rotation is the same with inertia, angles and torques. Readings are exact here; what rounding does is in [`super::limits`].

/// Frequencies at which passivity is checked, up to half the rate.
const FREQUENCIES: u32 = 512;

/// One axis of a handle, and how the board senses and drives it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    /// m, kg, or inertia, kg·m².
    pub inertia: f64,
    /// b, N·s/m or N·m·s/rad: viscous friction of the handle alone.
    pub viscous: f64,
    /// Stiffness up to which dry friction holds the handle between two counts, 2·f_c/Δ, N/m or N·m/rad; infinite for exact readings.
    pub resting: f64,
    /// T, s.
    pub period_s: f64,
    /// τ, s; 0: none.
    pub filter_s: f64,
    /// d: periods from reading to force.
    pub delay: usize,
}

/// Gains of the virtual coupling on an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gains {
    /// k_T, N/m, or k_R, N·m/rad.
    pub stiffness: f64,
    /// b_T, N·s/m, or b_R, N·m·s/rad.
    pub damping: f64,
}

impl Axis {
    /// g.
    fn filter_gain(&self) -> f64 {
        self.period_s / (self.filter_s + self.period_s)
    }

    /// B.
    fn rendered_damping(&self, gains: Gains) -> f64 {
        gains.damping + self.period_s * gains.stiffness
    }

    /// Whether the loop is stable with every force of these gains multiplied by `times`, the handle in nobody's hand.
    pub fn is_stable(&self, gains: Gains, times: f64) -> bool {
        is_within_unit_circle(&self.characteristic(gains, times))
    }

    /// Coefficients of the characteristic polynomial, lowest first.
    fn characteristic(&self, gains: Gains, times: f64) -> Vec<f64> {
        let p = 1.0 - self.filter_gain();
        let (alpha, response) = self.response();
        let mut open = product(&product(&[-1.0, 1.0], &[-alpha, 1.0]), &[-p, 1.0]);
        open.splice(0..0, vec![0.0; self.delay]);
        sum(&open, &product(&response, &self.force(gains, times)))
    }

    /// Numerator of the force over (z − p), lowest first.
    fn force(&self, gains: Gains, times: f64) -> [f64; 2] {
        let (g, stiffness) = (self.filter_gain(), times * gains.stiffness);
        let damper = times * self.rendered_damping(gains) * g / self.period_s;
        [-stiffness * (1.0 - g) - damper, stiffness + damper]
    }

    /// α, and n₀ and n₁.
    fn response(&self) -> (f64, [f64; 2]) {
        let x = self.viscous * self.period_s / self.inertia;
        let alpha = (-x).exp();
        // The closed forms cancel where x is small; two more terms of the series are below 10⁻¹⁰.
        let [late, early] = if x < 1e-3 {
            [0.5 - x / 3.0 + x * x / 8.0, 0.5 - x / 6.0 + x * x / 24.0]
        } else {
            [(1.0 - alpha * (1.0 + x)) / (x * x), (x - 1.0 + alpha) / (x * x)]
        };
        let scale = self.period_s * self.period_s / self.inertia;
        (alpha, [scale * late, scale * early])
    }

    /// Viscous friction that the handle needs for passivity with these gains, N·s/m or N·m·s/rad.
    pub fn viscous_for_passivity(&self, gains: Gains) -> f64 {
        let needed = self.shares();
        let needed = needed.map(|[spring, damper]| spring * gains.stiffness + damper * gains.damping);
        needed.fold(f64::NEG_INFINITY, f64::max)
    }

    /// The largest stiffness with this damping that is passive with so much viscous friction of the handle; 0 if none is.
    pub fn passive_stiffness(&self, damping: f64, viscous: f64) -> f64 {
        let limits = self
            .shares()
            .map(|[spring, damper]| match viscous - damper * damping {
                left if left < 0.0 && spring <= 0.0 => 0.0,
                left if spring > 0.0 => (left / spring).max(0.0),
                _ => f64::INFINITY,
            });
        limits.fold(f64::INFINITY, f64::min)
    }

    /// Viscous friction that a unit of stiffness and one of damping take, at each frequency.
    fn shares(&self) -> impl Iterator<Item = [f64; 2]> {
        let (g, d, period) = (self.filter_gain(), self.delay as f64, self.period_s);
        let p = 1.0 - g;
        (1..=FREQUENCIES).map(move |step| {
            let angle = core::f64::consts::PI * f64::from(step) / f64::from(FREQUENCIES);
            let (now, next) = ((d * angle).cos(), ((d + 1.0) * angle).cos());
            let cos = angle.cos();
            let damper = g * (p * now - next) / (1.0 - 2.0 * p * cos + p * p);
            [
                0.5 * period * (now - next) / (1.0 - cos) + period * damper,
                damper,
            ]
        })
    }
}

fn product(a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut found = vec![0.0; a.len() + b.len() - 1];
    for (i, x) in a.iter().enumerate() {
        for (j, y) in b.iter().enumerate() {
            found[i + j] += x * y;
        }
    }
    found
}

fn sum(a: &[f64], b: &[f64]) -> Vec<f64> {
    let of = |terms: &[f64], i: usize| terms.get(i).copied().unwrap_or(0.0);
    (0..a.len().max(b.len())).map(|i| of(a, i) + of(b, i)).collect()
}

/// Schur and Cohn: a polynomial (lowest coefficient first) has all roots within the unit circle exactly if |a₀| < |aₙ| and the polynomial
/// (aₙ·a(z) − a₀·zⁿ·a(1/z))/z, of one degree less, has. False for a coefficient that is not a number.
fn is_within_unit_circle(polynomial: &[f64]) -> bool {
    let mut terms = polynomial.to_vec();
    while let [first, .., last] = terms[..] {
        // Written so that NaN fails.
        let shrinks = first.abs() < last.abs();
        if !shrinks {
            return false;
        }
        let degree = terms.len() - 1;
        let next: Vec<f64> = (1..=degree)
            .map(|k| last * terms[k] - first * terms[degree - k])
            .collect();
        let largest = next.iter().fold(0.0f64, |most, term| most.max(term.abs()));
        terms = next.iter().map(|term| term / largest).collect();
    }
    true
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn axis(inertia: f64, viscous: f64, filter_s: f64, delay: usize) -> Axis {
        Axis {
            inertia,
            viscous,
            resting: f64::INFINITY,
            period_s: 1e-3,
            filter_s,
            delay,
        }
    }

    /// A part of this mass, which nothing holds, on the coupling: V⁺ − V = T/M·F and y⁺ − y = T·V⁺ with the coupling's F of the tick's end give the
    /// force H(z)·x·(z − 1)²/((z − 1)² + B·T/M·z·(z − 1) + K·T²/M·z); the root z = 1, at which all move together, is divided out.
    fn is_stable_with_a_free_part(axis: &Axis, gains: Gains, mass: f64) -> bool {
        let (alpha, response) = axis.response();
        let damper = axis.rendered_damping(gains) * axis.period_s / mass;
        let spring = gains.stiffness * axis.period_s * axis.period_s / mass;
        let part = [1.0, spring - damper - 2.0, 1.0 + damper];
        let p = 1.0 - axis.filter_gain();
        let mut open = product(&product(&[-alpha, 1.0], &[-p, 1.0]), &part);
        open.splice(0..0, vec![0.0; axis.delay]);
        let force = product(&product(&response, &axis.force(gains, 1.0)), &[-1.0, 1.0]);
        is_within_unit_circle(&sum(&open, &force))
    }

    #[test]
    fn roots_within_and_beyond_the_unit_circle_are_distinguished() {
        for (roots, expected) in [
            (vec![0.5, -0.9, 0.999_9], true),
            (vec![0.5, -1.000_1], false),
            (vec![0.0, 0.0, 0.3], true),
            (vec![2.0], false),
        ] {
            let polynomial = roots.iter().fold(vec![1.0], |p, root| product(&p, &[-root, 1.0]));
            assert_eq!(is_within_unit_circle(&polynomial), expected, "{roots:?}");
        }
        // A pair of radius 0.99, and one of 1.01.
        for (radius, expected) in [(0.99, true), (1.01, false)] {
            let pair = [radius * radius, -2.0 * radius * 0.6, 1.0];
            assert_eq!(is_within_unit_circle(&pair), expected);
        }
        assert!(!is_within_unit_circle(&[f64::NAN, 1.0, 2.0]));
    }

    /// Colgate and Schenkel without filter, b > K·T/2 + |B|, late by d for an undamped wall, b > K·T·(1/2 + d), and with the filter alone. The
    /// rendered damping is B = b_T + T·K, so b_T = B − T·K sets it.
    #[test]
    fn passivity_has_its_closed_forms() {
        let gains = |stiffness: f64, rendered: f64| Gains {
            stiffness,
            damping: rendered - 1e-3 * stiffness,
        };
        for (stiffness, rendered) in [(1000.0, 3.0), (400.0, 0.0), (0.0, 20.0)] {
            let needed = axis(0.1, 1.0, 0.0, 0).viscous_for_passivity(gains(stiffness, rendered));
            assert!(
                (needed - (0.5e-3 * stiffness + rendered)).abs() < 1e-9,
                "{needed}"
            );
            let needed = axis(0.1, 1.0, 3e-3, 0).viscous_for_passivity(gains(stiffness, rendered));
            assert!(
                (needed - (0.5e-3 * stiffness + rendered / 7.0)).abs() < 1e-9,
                "{needed}"
            );
        }
        for delay in 0..4 {
            let needed = axis(0.1, 1.0, 0.0, delay).viscous_for_passivity(gains(1000.0, 0.0));
            let formula = 0.5 + delay as f64;
            // The largest is at the lowest frequency, of which the first is 1/512 of half the rate.
            assert!((needed / formula - 1.0).abs() < 2e-4, "{delay}: {needed}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(400))]

        /// Passive loops are stable; less of everything is stable too: the coupling slips, the valve closes, force fades.
        #[test]
        fn a_stable_loop_stays_so_with_less(
            mass in -2.0..0.5f64, viscous in -2.0..1.0f64, stiffness in 0.0..4.0f64, damping in 0.0..50.0f64,
            filter in 0.0..4e-3f64, delay in 0usize..3, share in 0.001..1.0f64,
        ) {
            let axis = axis(10f64.powf(mass), 10f64.powf(viscous), filter, delay);
            let gains = Gains { stiffness: 10f64.powf(stiffness), damping };
            if axis.viscous_for_passivity(gains) < 0.999 * axis.viscous {
                prop_assert!(axis.is_stable(gains, 1.0));
            }
            if axis.is_stable(gains, 1.0) {
                prop_assert!(axis.is_stable(gains, share));
            }
        }

        /// The passive stiffness is where the friction that is needed is the friction there is.
        #[test]
        fn the_passive_stiffness_takes_all_friction(
            viscous in -2.0..1.0f64, damping in 0.0..50.0f64, filter in 0.0..4e-3f64, delay in 0usize..3,
        ) {
            let axis = axis(0.1, 10f64.powf(viscous), filter, delay);
            let stiffness = axis.passive_stiffness(damping, axis.viscous);
            let needed = axis.viscous_for_passivity(Gains { stiffness, damping });
            if stiffness > 0.0 {
                prop_assert!((needed / axis.viscous - 1.0).abs() < 1e-9, "{needed}");
            } else {
                prop_assert!(needed >= axis.viscous * (1.0 - 1e-9), "{needed}");
            }
        }

        /// Where a part at rest in contact is stable with a reserve, a free one of any mass that the board takes is, from 10 N/m on.
        #[test]
        fn a_free_part_is_stable_too(
            mass in -2.0..0.5f64, viscous in -2.0..1.0f64, stiffness in 1.0..4.3f64, damping in 0.0..50.0f64,
            filter in 1e-3..4e-3f64, delay in 0usize..3, part in 0.01..5.0f64,
        ) {
            let axis = axis(10f64.powf(mass), 10f64.powf(viscous), filter, delay);
            let gains = Gains { stiffness: 10f64.powf(stiffness), damping };
            if axis.is_stable(gains, 4.0 / core::f64::consts::PI) {
                prop_assert!(is_stable_with_a_free_part(&axis, gains, part));
            }
        }

        /// More friction of the handle, and a shorter period with as much delay in periods, keep a loop stable and passive.
        #[test]
        fn friction_and_rate_help(
            mass in -2.0..0.5f64, viscous in -2.0..1.0f64, stiffness in 0.0..4.0f64, damping in 0.0..50.0f64,
            delay in 0usize..3, more in 1.0..3.0f64,
        ) {
            let axis = axis(10f64.powf(mass), 10f64.powf(viscous), 3e-3, delay);
            let gains = Gains { stiffness: 10f64.powf(stiffness), damping };
            let rougher = Axis { viscous: more * axis.viscous, ..axis };
            let slower = Axis { period_s: more * axis.period_s, ..axis };
            if axis.is_stable(gains, 1.0) {
                prop_assert!(rougher.is_stable(gains, 1.0));
            }
            if slower.is_stable(gains, 1.0) {
                prop_assert!(axis.is_stable(gains, 1.0));
            }
            prop_assert!(slower.viscous_for_passivity(gains) >= axis.viscous_for_passivity(gains) * 0.999);
        }
    }
}
