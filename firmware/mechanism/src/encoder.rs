//! What every board does with encoder counts: tell motion from a jump.

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
}
