//! The last seconds of the loop, for the plots: bounded, oldest first.

use std::collections::VecDeque;

use mortise_protocol::message::{Telemetry, WireWrench};

/// Time span kept, s.
pub const SPAN_S: f64 = 10.0;
/// Largest number of samples kept: the whole span at 200 samples a second.
pub const MAX_SAMPLES: usize = 2_000;

/// One sample of the loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Board time, s.
    pub time_s: f64,
    /// Force on the handle, N.
    pub handle_n: f32,
    /// Force of the contacts on the object, N.
    pub contact_n: f32,
    /// Torque on the handle, N·m.
    pub handle_nm: f32,
    /// Torque of the contacts on the object, N·m.
    pub contact_nm: f32,
    /// Cost of the tick, in the board's unit.
    pub cost: f32,
    /// Loop overruns since the board started.
    pub late: u32,
}

impl Sample {
    /// The sample of a telemetry message from a board of `tick_hz` ticks a second.
    pub fn of(telemetry: &Telemetry, tick_hz: u16) -> Self {
        let length = |v: [f32; 3]| v.iter().map(|x| x * x).sum::<f32>().sqrt();
        let force = |w: &WireWrench| length(w.force);
        let torque = |w: &WireWrench| length(w.torque);
        Self {
            time_s: f64::from(telemetry.tick) / f64::from(tick_hz.max(1)),
            handle_n: force(&telemetry.wrench),
            contact_n: force(&telemetry.contact),
            handle_nm: torque(&telemetry.wrench),
            contact_nm: torque(&telemetry.contact),
            cost: telemetry.cost as f32,
            late: telemetry.missed,
        }
    }
}

/// The samples of the last [`SPAN_S`] seconds.
#[derive(Clone, Debug, Default)]
pub struct History {
    samples: VecDeque<Sample>,
}

impl History {
    /// Adds a sample. One older than the newest (the board restarted) clears the history first; a non-finite sample is dropped.
    pub fn add(&mut self, sample: Sample) {
        let finite = [
            sample.handle_n,
            sample.contact_n,
            sample.handle_nm,
            sample.contact_nm,
            sample.cost,
        ];
        if !finite.iter().all(|x| x.is_finite()) {
            return;
        }
        if self.newest().is_some_and(|newest| sample.time_s < newest.time_s) {
            self.samples.clear();
        }
        self.samples.push_back(sample);
        while self.samples.len() > MAX_SAMPLES
            || self
                .samples
                .front()
                .is_some_and(|oldest| oldest.time_s < sample.time_s - SPAN_S)
        {
            self.samples.pop_front();
        }
    }

    /// Oldest first.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &Sample> {
        self.samples.iter()
    }

    /// The newest.
    pub fn newest(&self) -> Option<&Sample> {
        self.samples.back()
    }

    /// Loop overruns within the span.
    pub fn late(&self) -> u32 {
        let ends = self.samples.front().zip(self.samples.back());
        ends.map_or(0, |(oldest, newest)| newest.late.saturating_sub(oldest.late))
    }

    /// Removes all samples.
    pub fn clear(&mut self) {
        self.samples.clear();
    }

    /// Largest value of `of` over all samples; 0 when there are none.
    pub fn largest(&self, of: impl Fn(&Sample) -> f32) -> f32 {
        self.samples.iter().map(of).fold(0.0, f32::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(time_s: f64) -> Sample {
        Sample {
            time_s,
            handle_n: time_s as f32,
            contact_n: 0.0,
            handle_nm: 0.0,
            contact_nm: 0.0,
            cost: 0.0,
            late: 0,
        }
    }

    #[test]
    fn only_the_last_seconds_are_kept() {
        let mut history = History::default();
        for i in 0..5_000 {
            history.add(at(f64::from(i) / 100.0));
        }
        let oldest = history.iter().next().expect("some").time_s;
        assert!((49.99 - oldest - SPAN_S).abs() < 0.011, "{oldest}");
        for i in 0..50_000 {
            history.add(at(50.0 + f64::from(i) * 1e-4));
        }
        assert_eq!(history.iter().len(), MAX_SAMPLES);
        assert!((history.largest(|s| s.handle_n) - 54.999_9).abs() < 1e-4);
    }

    /// A count since the start would never return to zero.
    #[test]
    fn late_ticks_are_those_of_the_span() {
        let mut history = History::default();
        for i in 0..30 {
            let late = if i < 5 { 3 * i } else { 15 };
            history.add(Sample {
                late,
                ..at(f64::from(i))
            });
            let expected = match i {
                0..5 => late,
                5..=10 => 15,
                11..15 => 15 - 3 * (i - 10),
                _ => 0,
            };
            assert_eq!(history.late(), expected, "at {i} s");
        }
    }

    #[test]
    fn a_restarted_board_starts_a_new_trace() {
        let mut history = History::default();
        history.add(at(100.0));
        history.add(at(0.5));
        assert_eq!(history.iter().len(), 1);
    }

    #[test]
    fn what_is_not_finite_is_left_out() {
        let mut history = History::default();
        history.add(Sample {
            cost: f32::NAN,
            ..at(1.0)
        });
        assert_eq!(history.iter().len(), 0);
    }
}
