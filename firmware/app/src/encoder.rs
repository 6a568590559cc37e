//! What every board does with encoder counts: tell motion from a jump, and estimate speed.

use crate::board::{TICK_HZ, TICK_S};

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

/// Tells an encoder that stands still under load.
///
/// A hand that holds a handle against a motor trembles by far more than a count. No count at all for [`Stall::new`]'s ticks, while the motor pushes
/// with more than half of what it can, therefore means that the encoder is stuck or unplugged, or the mechanism jammed. In either case the coupling
/// no longer sees what its force does. Below half load nothing is told: there a hand is stronger by far, and simulated hands need not tremble.
#[derive(Clone, Copy, Debug)]
pub struct Stall {
    ticks: u16,
    patience: u16,
}

impl Stall {
    /// Told after `patience` ticks.
    pub const fn new(patience: u16) -> Self {
        Self { ticks: 0, patience }
    }

    /// One tick: whether the encoder moved, and whether its motor pushes with more than half of what it can. True while stuck.
    pub fn update(&mut self, moved: bool, loaded: bool) -> bool {
        self.ticks = if moved || !loaded {
            0
        } else {
            self.ticks.saturating_add(1)
        };
        self.ticks >= self.patience
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
    fn a_stall_is_told_after_its_patience_and_only_under_load() {
        let mut stall = Stall::new(3);
        let told = |stall: &mut Stall, script: &[(bool, bool)]| {
            (script.iter())
                .map(|&(moved, loaded)| stall.update(moved, loaded))
                .filter(|&told| told)
                .count()
        };
        let (held, free, moving) = ((false, true), (false, false), (true, true));
        assert_eq!(
            told(&mut stall, &[held, held, moving, held, held, free, held, held]),
            0
        );
        assert_eq!(told(&mut stall, &[held, held, moving]), 2);
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
