//! Deadlines of the ticks by a free-running count: which passed, and when the next one is.

/// When the running tick was due, with ticks of `PERIOD` counts. The count wraps; a tick may be late by less than 2³¹ counts.
#[derive(Clone, Copy, Debug, Default)]
pub struct Deadlines<const PERIOD: u32> {
    due: u32,
    /// The last tick took at least a period.
    overran: bool,
}

impl<const PERIOD: u32> Deadlines<PERIOD> {
    /// The first tick is due at count 0.
    pub const fn new() -> Self {
        const { assert!(PERIOD > 0) };
        Self {
            due: 0,
            overran: false,
        }
    }

    /// The next tick begins when the count is `now`. Returns the deadlines missed since the last tick began: one for a tick that was still running when the
    /// next was due, and one for each further tick that could not run.
    pub fn begin(&mut self, now: u32) -> u32 {
        self.due = self.due.wrapping_add(PERIOD);
        let skipped = self.since_due(now) / PERIOD;
        self.due = self.due.wrapping_add(skipped * PERIOD);
        skipped + u32::from(core::mem::take(&mut self.overran))
    }

    /// The count at which the tick after the running one is due.
    pub const fn next(&self) -> u32 {
        self.due.wrapping_add(PERIOD)
    }

    /// Counts from the moment the running tick was due until `now`; notes whether it has taken its whole period.
    pub fn cost(&mut self, now: u32) -> u32 {
        let cost = self.since_due(now);
        self.overran = cost >= PERIOD;
        cost
    }

    fn since_due(&self, now: u32) -> u32 {
        // A count of slack between the tick's timer and the counter may make it seem early.
        (now.wrapping_sub(self.due) as i32).max(0) as u32
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const PERIOD: u32 = 25_000;

    #[test]
    fn ticks_in_time_miss_nothing_also_where_the_count_wraps() {
        let mut deadlines = Deadlines::<PERIOD>::new();
        let mut now = 0u32;
        for _ in 0..2 * (u32::MAX / PERIOD) {
            now = now.wrapping_add(PERIOD);
            assert_eq!(deadlines.begin(now), 0);
            assert_eq!(deadlines.cost(now.wrapping_add(PERIOD / 2)), PERIOD / 2);
            assert_eq!(deadlines.next(), now.wrapping_add(PERIOD));
        }
    }

    #[test]
    fn a_tick_that_seems_early_is_not_late() {
        let mut deadlines = Deadlines::<PERIOD>::new();
        assert_eq!(deadlines.begin(PERIOD - 1), 0);
        assert_eq!(deadlines.cost(PERIOD - 1), 0);
    }

    proptest! {
        /// Each tick begins when it is due, or when the one before has ended, whichever is later: what was not begun, and what was still running when the next
        /// was due, is counted.
        #[test]
        fn every_deadline_missed_is_counted(costs in prop::collection::vec(0u32..5 * PERIOD, 1..100)) {
            let mut deadlines = Deadlines::<PERIOD>::new();
            let (mut ended, mut overran) = (0u32, 0u32);
            let (mut ticks, mut missed, mut overruns) = (0u32, 0u32, 0u32);
            for cost in costs {
                let begins = ended.max(deadlines.next());
                missed += deadlines.begin(begins);
                overruns += overran;
                ticks += 1;
                prop_assert!(begins - deadlines.due < PERIOD);
                ended = begins + cost;
                overran = u32::from(ended - deadlines.due >= PERIOD);
                prop_assert_eq!(deadlines.cost(ended), ended - deadlines.due);
            }
            let left_out = deadlines.due / PERIOD - ticks;
            prop_assert_eq!(missed, left_out + overruns);
        }
    }
}
