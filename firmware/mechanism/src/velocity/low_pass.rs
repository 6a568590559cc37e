//! Velocity from encoder counts: first-order low-pass of the difference quotient.

use super::estimator::Estimator;
use crate::interface::{TICK_HZ, TICK_S};

/// Time constant of the speed estimate, s.
///
/// The difference of two readings of resolution Δ is quantised to Δ/h; the filter leaves h/(τ+h) of it: with 5 µm and 3 ms 1.25 mm/s. It delays the
/// coupling's damping by τ, which Colgate–Schenkel's bound with filtered velocity takes into account.
pub const VELOCITY_FILTER_S: f32 = 0.003;

/// First-order low-pass of the difference quotient, one axis.
#[derive(Clone, Copy, Debug)]
pub struct LowPass {
    /// m/s or rad/s.
    estimate: f32,
}

impl Estimator for LowPass {
    const AT_REST: Self = Self { estimate: 0.0 };

    fn update(&mut self, moved: i32, per_count: f32) -> f32 {
        const GAIN: f32 = TICK_S / (VELOCITY_FILTER_S + TICK_S);
        self.estimate += GAIN * (moved as f32 * per_count * TICK_HZ as f32 - self.estimate);
        self.estimate
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speed_settles_on_the_true_one() {
        let mut velocity = LowPass::AT_REST;
        let mut estimate = 0.0;
        for _ in 0..60 {
            estimate = velocity.update(1, 5e-6);
        }
        // 60 ticks at gain 1/4 leave 0.75⁶⁰ = 3·10⁻⁸ of the step.
        assert!((estimate - 5e-3).abs() < 1e-9, "{estimate}");
    }
}
