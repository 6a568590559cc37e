//! Processing of encoder counts common to every board: extends a short counter, and distinguishes motion from a jump.

/// Counts from one reading to the next, of a counter that wraps at 32 bits.
#[derive(Clone, Copy, Debug)]
pub struct Counter {
    last: Option<i32>,
    farthest: u32,
}

/// Motion of one axis in one tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Step {
    /// Counts moved; 0 after a jump.
    pub counts: i32,
    /// The axis moved further than the mechanism can in a tick: a glitch, a loose connector, or an impact.
    pub jumped: bool,
}

impl Counter {
    /// `farthest`: most counts the axis can move in a tick.
    pub const fn new(farthest: u32) -> Self {
        Self { last: None, farthest }
    }

    /// Processes the next reading. The first one sets the start; after a jump counting continues from the new reading.
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

/// Extension of a hardware counter that wraps at 2¹⁶.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Follower {
    last: u16,
    count: i32,
}

impl Follower {
    /// Counts from 0 with the counter at `raw`.
    pub const fn new(raw: u16) -> Self {
        Self { last: raw, count: 0 }
    }

    /// Makes the last reading the new zero.
    pub const fn restart(&mut self) {
        self.count = 0;
    }

    /// Processes the next reading and returns the counts since start. Correct as long as the counter moves less than 2¹⁵ counts between two calls
    /// ([`mortise_protocol::rig::MAX_COUNTS_PER_TICK`]).
    pub const fn follow(&mut self, raw: u16) -> i32 {
        let moved = raw.wrapping_sub(self.last).cast_signed();
        self.last = raw;
        // Wraps after 2³¹ counts: 67,000 turns of a shaft with 32,000 counts.
        self.count = self.count.wrapping_add(moved as i32);
        self.count
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

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
    fn counting_goes_on_from_where_it_is_restarted() {
        let mut follower = Follower::new(100);
        assert_eq!(follower.follow(130), 30);
        follower.restart();
        assert_eq!(follower.follow(125), -5);
    }

    proptest! {
        /// The sum of all motions, whatever the counter's own width.
        #[test]
        fn follows_through_wraps(start in any::<u16>(), moves in prop::collection::vec(-32_767i32..=32_767, 0..200)) {
            let mut follower = Follower::new(start);
            let mut truth = 0i32;
            for step in moves {
                truth += step;
                prop_assert_eq!(follower.follow((i32::from(start) + truth) as u16), truth);
            }
        }
    }
}
