//! What every board does with encoder counts: tell motion from a jump, and estimate speed.

use crate::interface::{TICK_HZ, TICK_S};

/// Counts from one reading to the next, of a counter that wraps at 32 bits.
#[derive(Clone, Copy, Debug)]
pub struct Counter {
    last: Option<i32>,
    farthest: u32,
}

/// Motion of one axis in one tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Step {
    /// Counts moved; 0 when it jumped.
    pub counts: i32,
    /// It moved further than the mechanism can in a tick: a glitch, a loose connector, or a hit.
    pub jumped: bool,
}

impl Counter {
    /// `farthest`: counts the axis can move in a tick at the most.
    pub const fn new(farthest: u32) -> Self {
        Self { last: None, farthest }
    }

    /// The next reading. The first one sets the start; after a jump counting goes on from where it landed.
    pub fn update(&mut self, reading: i32) -> Step {
        let counts = self.last.map_or(0, |last| reading.wrapping_sub(last));
        self.last = Some(reading);
        let jumped = counts.unsigned_abs() > self.farthest;
        Step {
            counts: if jumped { 0 } else { counts },
            jumped,
        }
    }
}

/// Time constant of the speed estimate, s.
///
/// The difference of two readings of resolution Δ is quantised to Δ/h; the filter leaves h/(τ+h) of it: with 5 µm and 3 ms 1.25 mm/s. It delays the
/// coupling's damping by τ, which Colgate–Schenkel's bound with filtered velocity takes into account.
pub const VELOCITY_FILTER_S: f32 = 0.003;

/// First-order low-pass of the difference quotient, one axis.
#[derive(Clone, Copy, Debug, Default)]
pub struct Velocity {
    estimate: f32,
}

impl Velocity {
    /// At rest.
    pub const fn new() -> Self {
        Self { estimate: 0.0 }
    }

    /// Takes the motion of one tick (any unit), gives the speed (that unit per second).
    pub fn update(&mut self, moved: f32) -> f32 {
        const GAIN: f32 = TICK_S / (VELOCITY_FILTER_S + TICK_S);
        self.estimate += GAIN * (moved * TICK_HZ as f32 - self.estimate);
        self.estimate
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_across_the_wrap_and_tells_jumps() {
        let mut counter = Counter::new(100);
        assert_eq!(counter.update(i32::MAX - 10).counts, 0);
        let step = |counts, jumped| Step { counts, jumped };
        assert_eq!(counter.update(i32::MIN + 9), step(20, false));
        assert_eq!(counter.update(i32::MIN + 109), step(100, false));
        assert_eq!(counter.update(i32::MIN + 8), step(0, true));
        assert_eq!(counter.update(i32::MIN + 7), step(-1, false));
        assert_eq!(counter.update(0), step(0, true));
    }

    #[test]
    fn speed_settles_on_the_true_one() {
        let mut velocity = Velocity::default();
        let mut estimate = 0.0;
        for _ in 0..60 {
            estimate = velocity.update(5e-6);
        }
        // 60 ticks at gain 1/4 leave 0.75⁶⁰ = 3·10⁻⁸ of the step.
        assert!((estimate - 5e-3).abs() < 1e-9, "{estimate}");
    }
}
