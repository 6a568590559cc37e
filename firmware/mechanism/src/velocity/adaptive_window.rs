//! Velocity from encoder counts: first-order adaptive windowing (Janabi-Sharifi, Hayward & Chen 2000).
//!
//! A difference over one tick is off by up to one count per tick; over n ticks by 1/n of it but late by n/2 ticks. The estimate uses the
//! longest window, up to `N` ticks, whose chord passes within one count of every sample in it: long at rest and at steady speed, short where
//! the speed changes. No tuning constant depends on the speed.
//!
//! Error at steady speed with a window of n ticks: at most 2/n counts per tick. Cost: at most `N²/2` comparisons, 128 for [`WINDOW`].

use super::estimator::Estimator;
use crate::interface::TICK_HZ;

/// Ticks of the longest window, by default.
pub const WINDOW: usize = 16;

/// First-order adaptive window of at most `N` ticks, one axis.
#[derive(Clone, Copy, Debug)]
pub struct AdaptiveWindow<const N: usize = WINDOW> {
    /// Counts since start; they wrap.
    count: i32,
    /// Counts of the `N` ticks before this one, the latest at `latest`.
    history: [i32; N],
    latest: usize,
}

impl<const N: usize> AdaptiveWindow<N> {
    /// The count `ticks` ago, 1 to `N`.
    fn ago(&self, ticks: usize) -> i32 {
        self.history[(self.latest + N + 1 - ticks) % N]
    }

    /// Processes the counts moved in this tick; returns the rate in counts per tick.
    fn rate(&mut self, moved: i32) -> f32 {
        self.latest = (self.latest + 1) % N;
        self.history[self.latest] = self.count;
        let count = self.count.wrapping_add(moved);
        self.count = count;
        let mut rate = moved as f32;
        for ticks in 2..=N {
            let chord = count.wrapping_sub(self.ago(ticks));
            let within = (1..ticks).all(|between| {
                // |measured − chord| ≤ 1 count, multiplied by `ticks` to stay with integers. After a jump the products are large but correct.
                let behind = i64::from(count.wrapping_sub(self.ago(between))) * ticks as i64;
                (behind - i64::from(chord) * between as i64).abs() <= ticks as i64
            });
            if !within {
                break;
            }
            rate = chord as f32 / ticks as f32;
        }
        rate
    }
}

impl<const N: usize> Estimator for AdaptiveWindow<N> {
    const AT_REST: Self = Self {
        count: 0,
        history: [0; N],
        latest: 0,
    };

    fn update(&mut self, moved: i32, per_count: f32) -> f32 {
        self.rate(moved) * per_count * TICK_HZ as f32
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn rest_is_zero_even_when_a_count_flickers() {
        let mut estimator = AdaptiveWindow::<WINDOW>::AT_REST;
        let (mut worst, mut last) = (0.0f32, 0);
        for tick in 0..200 {
            let count = i32::from(tick % 3 == 0);
            let rate = estimator.rate(count - last);
            last = count;
            if tick > WINDOW as i32 {
                worst = worst.max(rate.abs());
            }
        }
        // One count over the full window.
        assert!(worst <= 1.0 / WINDOW as f32, "{worst}");
        assert!(worst > 0.0, "the flicker must affect the estimate");
    }

    #[test]
    fn a_step_in_speed_is_estimated_at_once() {
        let mut estimator = AdaptiveWindow::<WINDOW>::AT_REST;
        for _ in 0..50 {
            estimator.rate(0);
        }
        assert_eq!(estimator.rate(30), 30.0);
        assert_eq!(estimator.rate(30), 30.0);
    }

    proptest! {
        /// Steady speed v, counts rounded down: each end of the chord is off by less than one count, so the rate by less than 2/n; the window is full
        /// because every sample lies within one count of the chord.
        #[test]
        fn steady_speed_is_found(speed in -150.0f64..150.0, phase in 0.0f64..1.0) {
            let mut estimator = AdaptiveWindow::<WINDOW>::AT_REST;
            let (mut rate, mut last) = (0.0, 0);
            for tick in 0..60 {
                let count = libm::floor(speed * f64::from(tick) + phase) as i32;
                rate = estimator.rate(count - last);
                last = count;
            }
            prop_assert!((f64::from(rate) - speed).abs() < 2.0 / WINDOW as f64, "{rate} {speed}");
        }

        /// Finite for any input.
        #[test]
        fn any_counts_give_a_finite_speed(moves in prop::collection::vec(any::<i32>(), 1..100)) {
            let mut estimator = AdaptiveWindow::<WINDOW>::AT_REST;
            for moved in moves {
                prop_assert!(estimator.update(moved, 0.01).is_finite());
            }
        }
    }
}
