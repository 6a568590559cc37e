//! Lines to draw through a signal: of the samples in one column of pixels only the first, the lowest, the highest and the last.
//!
//! Such a line covers the same pixels as one through every sample (M4, Jugel et al. 2014). Whole chunks that lie in one column are taken by their stored
//! extremes, so that the cost is bounded by the columns and the chunks, not by the samples.

use super::sample::Sample;
use super::signal::{SIGNALS, Signal};
use super::store::{Chunk, History};

/// Points of a line without a gap: time, s, and value.
pub type Line = Vec<[f64; 2]>;

/// Point of a sample.
type Point = [f64; 2];

/// The lines through a signal from one time to another, s, for this number of columns; they reach to the next samples outside.
pub fn envelope(history: &History, signal: &Signal, from_s: f64, to_s: f64, columns: usize) -> Vec<Line> {
    let Some(place) = SIGNALS.iter().position(|other| other.key == signal.key) else {
        return Vec::new();
    };
    let mut lines = Lines::default();
    let start_s = history.time_before(from_s).unwrap_or(from_s);
    let column = |time_s: f64| {
        // Outside of the range each side is one more column.
        let at = (time_s - from_s) / (to_s - from_s) * columns as f64;
        at.floor().clamp(-1.0, columns as f64) as i64
    };
    let mut past = false;
    for chunk in history.chunks_from(start_s) {
        if chunk.breaks {
            lines.end();
        }
        if past {
            break;
        }
        past = add(&mut lines, chunk, (signal, place), [start_s, to_s], &column);
    }
    lines.end();
    lines.done
}

/// Adds a chunk; returns whether a sample lay past the end.
fn add(
    lines: &mut Lines,
    chunk: &Chunk,
    (signal, place): (&Signal, usize),
    [start_s, to_s]: [f64; 2],
    column: &dyn Fn(f64) -> i64,
) -> bool {
    let samples = chunk.samples();
    let ends = [&samples[0], &samples[samples.len() - 1]];
    let [first, last] = ends.map(|s| column(s.time_s));
    let within = ends[0].time_s >= start_s && ends[1].time_s <= to_s;
    let point = |sample: &Sample| signal.of(sample).map(|value| [sample.time_s, f64::from(value)]);
    if first == last
        && within
        && let Some([lowest, highest]) = chunk.extremes(place)
        && let (Some(a), Some(low), Some(high), Some(b)) =
            (point(ends[0]), point(lowest), point(highest), point(ends[1]))
    {
        lines.add(Column {
            index: first,
            first: a,
            low,
            high,
            last: b,
        });
        return false;
    }
    for sample in samples.iter().filter(|s| s.time_s >= start_s) {
        match point(sample) {
            None => lines.end(),
            Some(at) => lines.add(Column {
                index: column(sample.time_s),
                first: at,
                low: at,
                high: at,
                last: at,
            }),
        }
        if sample.time_s > to_s {
            return true;
        }
    }
    false
}

/// Samples of one column.
#[derive(Clone, Copy, Debug)]
struct Column {
    index: i64,
    first: Point,
    low: Point,
    high: Point,
    last: Point,
}

#[derive(Debug, Default)]
struct Lines {
    done: Vec<Line>,
    line: Line,
    open: Option<Column>,
}

impl Lines {
    /// Adds samples that follow those before without a gap.
    fn add(&mut self, next: Column) {
        match &mut self.open {
            Some(open) if open.index == next.index => {
                if next.low[1] < open.low[1] {
                    open.low = next.low;
                }
                if next.high[1] > open.high[1] {
                    open.high = next.high;
                }
                open.last = next.last;
            }
            _ => {
                self.close_column();
                self.open = Some(next);
            }
        }
    }

    fn close_column(&mut self) {
        let Some(column) = self.open.take() else { return };
        let mut points = [column.first, column.low, column.high, column.last];
        points.sort_by(|a, b| a[0].total_cmp(&b[0]));
        for point in points {
            if self.line.last() != Some(&point) {
                self.line.push(point);
            }
        }
    }

    /// Ends the line.
    fn end(&mut self) {
        self.close_column();
        if !self.line.is_empty() {
            self.done.push(std::mem::take(&mut self.line));
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// A step to the next sample: time, value if any, and whether the link was lost before.
    fn steps() -> impl Strategy<Value = Vec<(f64, Option<f32>, bool)>> {
        let value = prop_oneof![9 => (-1e3f32..1e3).prop_map(Some), 1 => Just(None)];
        let rare = prop::bool::weighted(0.01);
        let time = prop_oneof![20 => 0.0..0.03f64, 1 => 0.4..0.7f64];
        // In one of two histories every sample has a value, so that whole chunks are taken.
        let whole = (0.0..0.03f64, (-1e3f32..1e3).prop_map(Some), rare);
        prop_oneof![
            prop::collection::vec((time, value, rare), 1..700),
            prop::collection::vec(whole, 1..700),
        ]
    }

    fn history(steps: &[(f64, Option<f32>, bool)]) -> History {
        let (mut history, mut time_s) = (History::default(), 5.0);
        for &(dt, value, lost) in steps {
            time_s += dt;
            if lost {
                history.interrupt();
                time_s = 0.0;
            }
            history.add(Sample {
                time_s,
                depth_um: value.unwrap_or(f32::NAN),
                ..Sample::default()
            });
        }
        history
    }

    /// Lowest and highest value of each column, by looking at every point.
    fn extremes(
        points: impl Iterator<Item = Point>,
        range: [f64; 2],
        columns: usize,
    ) -> Vec<Option<[f64; 2]>> {
        let mut all = vec![None; columns + 1];
        for [time_s, value] in points.filter(|p| p[0] >= range[0] && p[0] <= range[1]) {
            let column = ((time_s - range[0]) / (range[1] - range[0]) * columns as f64).floor() as usize;
            let entry: &mut Option<[f64; 2]> = &mut all[column];
            let [low, high] = entry.unwrap_or([value; 2]);
            *entry = Some([low.min(value), high.max(value)]);
        }
        all
    }

    proptest! {
        #[test]
        fn a_column_has_the_extremes_of_its_samples(
            steps in steps(),
            (start, share) in (0.0..1.0f64, 0.001..1.5f64),
            columns in 1usize..200,
        ) {
            let history = history(&steps);
            let signal = Signal::named("depth_um").unwrap();
            let (oldest, newest) = (history.oldest().unwrap().time_s, history.newest().unwrap().time_s);
            let span = (newest - oldest).max(0.1);
            let from = oldest + start * span;
            let range = [from, from + share * span];
            let lines = envelope(&history, signal, range[0], range[1], columns);
            let points: Vec<Point> = (history.iter())
                .filter_map(|s| Some([s.time_s, f64::from(signal.of(s)?)]))
                .collect();
            let drawn = extremes(lines.iter().flatten().copied(), range, columns);
            let expected = extremes(points.iter().copied(), range, columns);
            prop_assert_eq!(drawn, expected);
            // At most four points a column, and only ones that are there, in their order.
            prop_assert!(lines.iter().map(Vec::len).sum::<usize>() <= 4 * (columns + 2) + 4 * lines.len());
            for line in &lines {
                prop_assert!(line.is_sorted_by(|a, b| a[0] <= b[0]));
                prop_assert!(line.iter().all(|point| points.contains(point)));
            }
        }

        /// No line leads across a lost link, a hole, or a sample without a value; every other pair of neighbours is connected.
        #[test]
        fn a_gap_is_drawn_as_a_gap(steps in steps()) {
            let history = history(&steps);
            let signal = Signal::named("depth_um").unwrap();
            let (oldest, newest) = (history.oldest().unwrap().time_s, history.newest().unwrap().time_s);
            let mut expected: Vec<Line> = Vec::new();
            let mut open = false;
            for (breaks, sample) in history.between(oldest, newest) {
                let Some(value) = signal.of(sample) else { open = false; continue };
                if breaks || !open {
                    expected.push(Line::new());
                }
                open = true;
                expected.last_mut().unwrap().push([sample.time_s, f64::from(value)]);
            }
            // So many columns that nearly every sample has its own.
            let lines = envelope(&history, signal, oldest, newest + 1e-3, 1_000_000);
            prop_assert_eq!(lines.len(), expected.len());
            for (line, expected) in lines.iter().zip(&expected) {
                prop_assert_eq!(line.first(), expected.first());
                prop_assert_eq!(line.last().map(|p| p[0]), expected.last().map(|p| p[0]));
            }
        }
    }

    #[test]
    fn a_line_reaches_beyond_both_ends_of_the_range() {
        let history = history(&vec![(0.01, Some(1.0), false); 300]);
        let signal = Signal::named("depth_um").unwrap();
        let lines = envelope(&history, signal, 6.005, 6.006, 100);
        assert_eq!(lines.len(), 1);
        assert!(
            lines[0][0][0] < 6.005 && lines[0][lines[0].len() - 1][0] > 6.006,
            "{lines:?}"
        );
        assert!(envelope(&History::default(), signal, 0.0, 1.0, 10).is_empty());
    }
}
