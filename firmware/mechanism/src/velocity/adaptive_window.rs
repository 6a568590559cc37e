//! Velocity from encoder counts: first-order adaptive windowing (Janabi-Sharifi, Hayward & Chen 2000).
//!
//! A difference over one tick is off by up to one count per tick; over n ticks by 1/n of it but late by n/2 ticks. The estimate uses the
//! longest window, up to [`WINDOW`] ticks, whose chord passes within one count of every sample in it: long at rest and at steady speed, short where
//! the speed changes. No tuning constant depends on the speed.
//!
//! Error at steady speed with a window of n ticks: at most 2/n counts per tick. Cost: at most `WINDOW²/2` = 128 comparisons.

/// Ticks of the longest window.
pub const WINDOW: usize = 16;

/// Estimates the rate of one encoder.
#[derive(Clone, Copy, Debug)]
pub struct Estimator {
    /// Counts of the last `WINDOW + 1` ticks, newest at `newest`.
    history: [i32; WINDOW + 1],
    newest: usize,
}

impl Estimator {
    /// At rest at `count`.
    pub const fn new(count: i32) -> Self {
        Self {
            history: [count; WINDOW + 1],
            newest: 0,
        }
    }

    fn ago(&self, ticks: usize) -> i32 {
        self.history[(self.newest + WINDOW + 1 - ticks) % (WINDOW + 1)]
    }

    /// Takes this tick's count; gives the rate in counts per tick.
    pub fn update(&mut self, count: i32) -> f32 {
        self.newest = (self.newest + 1) % (WINDOW + 1);
        self.history[self.newest] = count;
        let mut rate = count.wrapping_sub(self.ago(1)) as f32;
        for ticks in 2..=WINDOW {
            let chord = count.wrapping_sub(self.ago(ticks));
            let within = (1..ticks).all(|between| {
                // |measured − chord| ≤ 1 count, multiplied by `ticks` to stay with integers. A jump can make the products large, not wrong.
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

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn rest_is_zero_even_when_a_count_flickers() {
        let mut estimator = Estimator::new(7);
        let mut worst = 0.0f32;
        for tick in 0..200 {
            let rate = estimator.update(7 + i32::from(tick % 3 == 0));
            if tick > WINDOW as i32 {
                worst = worst.max(rate.abs());
            }
        }
        // One count over the full window.
        assert!(worst <= 1.0 / WINDOW as f32, "{worst}");
        assert!(worst > 0.0, "the flicker must have been seen");
    }

    #[test]
    fn a_step_in_speed_is_seen_at_once() {
        let mut estimator = Estimator::new(0);
        for _ in 0..50 {
            estimator.update(0);
        }
        assert_eq!(estimator.update(30), 30.0);
        assert_eq!(estimator.update(60), 30.0);
    }

    proptest! {
        /// Steady speed v, counts rounded down: each end of the chord is off by less than one count, so the rate by less than 2/n; the window is full
        /// because every sample lies within one count of the chord.
        #[test]
        fn steady_speed_is_found(speed in -150.0f64..150.0, phase in 0.0f64..1.0) {
            let mut estimator = Estimator::new(0);
            let mut rate = 0.0;
            for tick in 0..60 {
                rate = estimator.update(libm::floor(speed * f64::from(tick) + phase) as i32);
            }
            prop_assert!((f64::from(rate) - speed).abs() < 2.0 / WINDOW as f64, "{rate} {speed}");
        }

        /// Never faster than the fastest single step in the window, and finite whatever comes.
        #[test]
        fn never_faster_than_the_steps(counts in prop::collection::vec(any::<i32>(), 1..100)) {
            let mut estimator = Estimator::new(0);
            for count in counts {
                prop_assert!(estimator.update(count).is_finite());
            }
        }
    }
}
