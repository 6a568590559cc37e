//! A 16-bit quadrature counter made endless, and a check that it moved no further than the mechanism can.

/// Follows a counter that wraps at 2¹⁶.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Follower {
    last: u16,
    count: i32,
    limit: u16,
}

/// What one reading says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reading {
    /// Counts since start.
    pub count: i32,
    /// It moved further than the limit since the last reading: a glitch, a lost reference, or a reading missed.
    pub jump: bool,
}

impl Follower {
    /// Starts at `start` counts with the counter at `raw`; more than `limit` counts between readings is a jump (at most 2¹⁵ − 1).
    pub const fn new(start: i32, raw: u16, limit: u16) -> Self {
        Self {
            last: raw,
            count: start,
            limit,
        }
    }

    /// What the last reading stands for, counts.
    pub const fn set(&mut self, count: i32) {
        self.count = count;
    }

    /// Takes the next reading. Right as long as the counter moves less than 2¹⁵ counts between two calls.
    pub const fn follow(&mut self, raw: u16) -> Reading {
        let moved = raw.wrapping_sub(self.last).cast_signed();
        self.last = raw;
        // Wraps after 2³¹ counts: 67,000 turns of a shaft with 32,000 counts.
        self.count = self.count.wrapping_add(moved as i32);
        Reading {
            count: self.count,
            jump: moved.unsigned_abs() > self.limit,
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn counting_goes_on_from_where_it_is_set() {
        let mut follower = Follower::new(0, 100, 50);
        follower.follow(130);
        follower.set(6000);
        assert_eq!(
            follower.follow(125),
            Reading {
                count: 5995,
                jump: false
            }
        );
    }

    proptest! {
        /// The sum of all motions, whatever the counter's own width.
        #[test]
        fn follows_through_wraps(start in any::<u16>(), moves in prop::collection::vec(-32_767i32..=32_767, 0..200)) {
            let mut follower = Follower::new(0, start, 100);
            let mut truth = 0i32;
            for step in moves {
                truth += step;
                let reading = follower.follow((i32::from(start) + truth) as u16);
                prop_assert_eq!(reading.count, truth);
                prop_assert_eq!(reading.jump, step.abs() > 100);
            }
        }
    }
}
