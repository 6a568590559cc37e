//! The samples of the last minutes: bounded, oldest first, in chunks that know their extremes.
//!
//! Time runs on over a lost link and a restart of the board: there the times of samples continue by the clock of this computer, and the line that is drawn
//! through them has a gap.

use std::collections::VecDeque;
use std::time::Instant;

use super::sample::Sample;
use super::signal::SIGNALS;

/// Largest number of samples kept: 10 minutes at 200 samples a second, about 25 MB.
pub const MAX_SAMPLES: usize = 120_000 + CHUNK;
/// Samples of a chunk: the most that are read one by one for a place on the screen.
const CHUNK: usize = 64;
/// Largest number of chunks; there are more than full ones only when samples break off all the time.
pub const MAX_CHUNKS: usize = 8 * MAX_SAMPLES / CHUNK;
/// Longest time between two samples that a line is drawn across, s: ten times that of the slowest telemetry.
pub const RESOLVED_HOLE_S: f64 = 0.5;
/// Gap that is drawn at a break, at the least, s.
const LEAST_GAP_S: f64 = 1.0;
/// Time over which loop overruns are counted, s.
pub const OVERRUN_SPAN_S: f64 = 10.0;

/// Where a signal is lowest and highest in a chunk.
#[derive(Clone, Copy, Debug, Default)]
struct Extremes {
    lowest: u8,
    highest: u8,
    /// A sample has no value.
    holes: bool,
}

/// A run of samples without a break.
#[derive(Clone, Debug)]
pub(super) struct Chunk {
    samples: Vec<Sample>,
    /// For each of [`SIGNALS`].
    extremes: Vec<Extremes>,
    /// No line leads from the sample before to this chunk.
    pub(super) breaks: bool,
    /// The board's counters may have restarted before this chunk.
    restarts: bool,
}

impl Chunk {
    fn new(breaks: bool, restarts: bool) -> Self {
        Self {
            samples: Vec::new(),
            extremes: vec![Extremes::default(); SIGNALS.len()],
            breaks,
            restarts,
        }
    }

    fn add(&mut self, sample: Sample) {
        let index = self.samples.len() as u8;
        self.samples.push(sample);
        for (signal, extremes) in SIGNALS.iter().zip(&mut self.extremes) {
            let Some(value) = signal.of(&sample) else {
                extremes.holes = true;
                continue;
            };
            let at = |i: u8| signal.of(&self.samples[usize::from(i)]);
            if at(extremes.lowest).is_none_or(|low| value < low) {
                extremes.lowest = index;
            }
            if at(extremes.highest).is_none_or(|high| value > high) {
                extremes.highest = index;
            }
        }
    }

    /// Oldest first; never empty.
    pub(super) fn samples(&self) -> &[Sample] {
        &self.samples
    }

    /// The samples where the signal at this place of [`SIGNALS`] is lowest and highest; `None` if one has no value.
    pub(super) fn extremes(&self, signal: usize) -> Option<[&Sample; 2]> {
        let extremes = self.extremes.get(signal).filter(|e| !e.holes)?;
        Some([extremes.lowest, extremes.highest].map(|i| &self.samples[usize::from(i)]))
    }

    fn last_s(&self) -> f64 {
        self.samples.last().map_or(f64::NEG_INFINITY, |s| s.time_s)
    }
}

/// The samples of the last minutes.
#[derive(Clone, Debug, Default)]
pub struct History {
    chunks: VecDeque<Chunk>,
    len: usize,
    /// Added to the board's time.
    offset_s: f64,
    interrupted: bool,
    /// When the newest sample was added.
    added: Option<Instant>,
}

impl History {
    /// Adds a sample with the board's time. Before one that is older than the newest (the board restarted), or follows an interruption or a hole, the line breaks.
    pub fn add(&mut self, sample: Sample) {
        self.add_at(sample, Instant::now());
    }

    fn add_at(&mut self, mut sample: Sample, now: Instant) {
        if !sample.time_s.is_finite() {
            return;
        }
        let board_s = sample.time_s;
        sample.time_s += self.offset_s;
        let before = self.newest().copied();
        let restarts = self.interrupted || before.is_some_and(|before| sample.time_s < before.time_s);
        if let Some(before) = before.filter(|_| restarts) {
            let passed = self
                .added
                .map(|then| now.saturating_duration_since(then).as_secs_f64());
            sample.time_s = before.time_s + passed.unwrap_or(0.0).max(LEAST_GAP_S);
            self.offset_s = sample.time_s - board_s;
        }
        let breaks = restarts || before.is_none_or(|b| sample.time_s - b.time_s > RESOLVED_HOLE_S);
        if let Some(before) = before.filter(|_| !breaks) {
            sample = sample.with_speeds(&before);
        }
        let is_full = self
            .chunks
            .back()
            .is_none_or(|chunk| chunk.samples.len() >= CHUNK);
        if breaks || is_full {
            self.chunks.push_back(Chunk::new(breaks, restarts));
        }
        if let Some(chunk) = self.chunks.back_mut() {
            chunk.add(sample);
        }
        self.len += 1;
        self.interrupted = false;
        self.added = Some(now);
        while self.len > MAX_SAMPLES || self.chunks.len() > MAX_CHUNKS {
            let oldest = self.chunks.pop_front();
            self.len -= oldest.map_or(0, |chunk| chunk.samples.len());
        }
    }

    /// Notes that samples break off here, such as by a lost link: what is there is kept, and the next sample begins a new line.
    pub fn interrupt(&mut self) {
        self.interrupted = !self.chunks.is_empty();
    }

    /// Oldest first.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = &Sample> {
        self.chunks.iter().flat_map(|chunk| &chunk.samples)
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The newest.
    pub fn newest(&self) -> Option<&Sample> {
        self.chunks.back()?.samples.last()
    }

    /// The oldest.
    pub fn oldest(&self) -> Option<&Sample> {
        self.chunks.front()?.samples.first()
    }

    /// The sample in force at a time: the newest that is not after it; `None` in a gap.
    pub fn at(&self, time_s: f64) -> Option<&Sample> {
        let chunk = self
            .chunks
            .partition_point(|chunk| chunk.samples[0].time_s <= time_s);
        let chunk = self.chunks.get(chunk.checked_sub(1)?)?;
        let index = chunk.samples.partition_point(|s| s.time_s <= time_s);
        let sample = chunk.samples.get(index.checked_sub(1)?)?;
        (time_s - sample.time_s <= RESOLVED_HOLE_S).then_some(sample)
    }

    /// The samples from one time to another, oldest first, each with whether the line breaks before it.
    pub fn between(&self, from_s: f64, to_s: f64) -> impl Iterator<Item = (bool, &Sample)> {
        self.chunks_from(from_s)
            .take_while(move |chunk| chunk.samples[0].time_s <= to_s)
            .flat_map(|chunk| {
                let first = |index: usize| index == 0 && chunk.breaks;
                (chunk.samples.iter().enumerate()).map(move |(index, sample)| (first(index), sample))
            })
            .filter(move |(_, sample)| (from_s..=to_s).contains(&sample.time_s))
    }

    /// The chunks that end at or after a time.
    pub(super) fn chunks_from(&self, from_s: f64) -> impl Iterator<Item = &Chunk> {
        let first = self.chunks.partition_point(|chunk| chunk.last_s() < from_s);
        self.chunks.range(first..)
    }

    /// The time of the newest sample before a time.
    pub(super) fn time_before(&self, time_s: f64) -> Option<f64> {
        let next = self
            .chunks
            .partition_point(|chunk| chunk.samples[0].time_s < time_s);
        let chunk = self.chunks.get(next.checked_sub(1)?)?;
        let index = chunk.samples.partition_point(|s| s.time_s < time_s);
        Some(chunk.samples[index.checked_sub(1)?].time_s)
    }

    /// Loop overruns within the last [`OVERRUN_SPAN_S`]; none while no samples arrive.
    pub fn late(&self) -> u32 {
        let Some(newest) = self.newest().filter(|_| !self.interrupted) else {
            return 0;
        };
        let mut oldest = newest;
        for chunk in self.chunks.iter().rev() {
            let within = |s: &&Sample| s.time_s >= newest.time_s - OVERRUN_SPAN_S;
            let kept = chunk.samples.iter().rev().take_while(within);
            oldest = kept.last().unwrap_or(oldest);
            if chunk.restarts || chunk.samples[0].time_s < oldest.time_s {
                break;
            }
        }
        newest.late.saturating_sub(oldest.late)
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::session::history::Signal;

    fn at(time_s: f64) -> Sample {
        Sample {
            time_s,
            handle_n: time_s as f32,
            ..Sample::default()
        }
    }

    fn times(history: &History) -> Vec<f64> {
        history.iter().map(|s| s.time_s).collect()
    }

    #[test]
    fn ten_minutes_at_200_samples_a_second_are_kept_and_no_more() {
        let mut history = History::default();
        for i in 0..150_000 {
            history.add(at(f64::from(i) / 200.0));
        }
        let (oldest, newest) = (history.oldest().unwrap(), history.newest().unwrap());
        assert!(newest.time_s - oldest.time_s >= 600.0 - 0.01, "{oldest:?}");
        assert!(history.len() <= MAX_SAMPLES);
        assert_eq!(history.len(), history.iter().count());
    }

    /// Samples that break off all the time, each in a chunk of its own.
    #[test]
    fn memory_is_bounded_when_the_board_restarts_all_the_time() {
        let mut history = History::default();
        for _ in 0..2 * MAX_CHUNKS {
            history.interrupt();
            history.add(at(1.0));
        }
        assert_eq!(history.chunks.len(), MAX_CHUNKS);
        assert_eq!(history.len(), history.iter().count());
        assert!(history.iter().is_sorted_by(|a, b| a.time_s < b.time_s));
    }

    /// A count since the start would never return to zero.
    #[test]
    fn late_ticks_are_those_of_the_span() {
        let mut history = History::default();
        for i in 0..60 {
            let late = if i < 10 { 3 * (i / 2) } else { 15 };
            history.add(Sample {
                late,
                ..at(0.5 * f64::from(i))
            });
            let begun: u32 = match i {
                0..=20 => 0,
                _ => (3 * ((i - 20) / 2)).min(15),
            };
            assert_eq!(history.late(), late - begun, "at {} s", 0.5 * f64::from(i));
        }
        history.interrupt();
        assert_eq!(history.late(), 0);
        history.add(Sample { late: 7, ..at(0.5) });
        assert_eq!(history.late(), 0, "counted before the restart");
    }

    #[test]
    fn a_restarted_board_continues_after_a_gap() {
        let mut history = History::default();
        let begun = Instant::now();
        history.add_at(at(100.0), begun);
        history.add_at(at(0.5), begun + Duration::from_secs(7));
        history.add_at(at(0.6), begun + Duration::from_secs(7));
        assert_eq!(history.newest().map(|s| s.handle_n), Some(0.6));
        let [first, second, third] = times(&history)[..] else {
            panic!("{history:?}")
        };
        assert_eq!((first, second), (100.0, 107.0));
        assert!((third - 107.1).abs() < 1e-9, "{third}");
        let breaks: Vec<bool> = history.between(0.0, 200.0).map(|(breaks, _)| breaks).collect();
        assert_eq!(breaks, [true, true, false]);
    }

    #[test]
    fn an_interruption_keeps_what_was_there() {
        let mut history = History::default();
        history.interrupt();
        history.add(at(3.0));
        history.interrupt();
        history.interrupt();
        history.add(at(3.1));
        assert_eq!(history.len(), 2);
        let [first, second] = times(&history)[..] else {
            panic!("{history:?}")
        };
        assert!(second - first >= LEAST_GAP_S);
        assert!(history.at(first + 1.2 * RESOLVED_HOLE_S).is_none(), "in the gap");
        assert_eq!(history.at(second).map(|s| s.handle_n), Some(3.1));
        assert!(history.at(first - 0.1).is_none());
    }

    #[test]
    fn a_value_that_is_not_finite_is_left_out_and_a_time_refuses_the_sample() {
        let mut history = History::default();
        history.add(Sample {
            cost: f32::NAN,
            ..at(1.0)
        });
        history.add(at(f64::NAN));
        history.add(at(f64::INFINITY));
        assert_eq!(history.len(), 1);
        let cost = Signal::named("loop_cost").unwrap();
        assert_eq!(cost.of(history.newest().unwrap()), None);
    }
}
