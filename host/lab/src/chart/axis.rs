//! Axes: value range, ticks and their labels, and the mapping from values to pixels.

use std::ops::Range;

use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};

use super::{Axis, AxisScale};

/// Approximate number of ticks on a linear axis.
const MARKS: f64 = 7.0;

impl Axis {
    /// True if the axis can show the value.
    pub(super) fn shows(&self, value: f64) -> bool {
        value.is_finite() && (self.scale == AxisScale::Linear || value > 0.0)
    }

    /// Range from a little below the smallest value to a little above the largest; `None` without a value.
    pub(super) fn range(&self, values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
        let ticks = self.ticks.iter().flatten().copied();
        let (low, high) = values
            .chain(ticks)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value: f64| {
                (low.min(value), high.max(value))
            });
        if !(self.shows(low) && self.shows(high)) {
            return None;
        }
        Some(match self.scale {
            AxisScale::Logarithmic => {
                // A fifteenth of the span on either side, and at least a tenth of a decade in total (0.24 / ln 10).
                let room = ((high / low).ln() / 15.0).max(0.12).exp();
                (low / room, high * room)
            }
            AxisScale::Linear => {
                let span = high - low;
                let room = if span > 0.0 { span / 25.0 } else { 0.5 };
                (low - room, high + room)
            }
        })
    }

    pub(super) fn marks(&self, (low, high): (f64, f64)) -> Vec<f64> {
        if let Some(ticks) = &self.ticks {
            return ticks.clone();
        }
        match self.scale {
            AxisScale::Logarithmic => {
                let decades = (high / low).log10();
                let steps: &[f64] = match decades {
                    ..0.7 => &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0],
                    ..3.2 => &[1.0, 2.0, 5.0],
                    _ => &[1.0],
                };
                let (first, last) = (low.log10().floor() as i32, high.log10().ceil() as i32);
                (first..=last)
                    .flat_map(|power| steps.iter().map(move |step| step * 10f64.powi(power)))
                    .filter(|value| (low..=high).contains(value))
                    .collect()
            }
            AxisScale::Linear => {
                let rough = (high - low) / MARKS;
                let power = 10f64.powi(rough.log10().floor() as i32);
                let step = [1.0, 2.0, 5.0, 10.0]
                    .map(|step| step * power)
                    .into_iter()
                    .find(|&step| step >= rough)
                    .unwrap_or(10.0 * power);
                ((low / step).ceil() as i64..=(high / step).floor() as i64)
                    .map(|i| i as f64 * step)
                    .collect()
            }
        }
    }

    /// The axis as plotters needs it.
    pub(super) fn coordinate(&self, range: (f64, f64)) -> Coordinate {
        Coordinate {
            scale: self.scale,
            range,
            marks: self.marks(range),
        }
    }
}

/// Range and scale of an axis, which map values to pixels.
pub(super) struct Coordinate {
    scale: AxisScale,
    range: (f64, f64),
    marks: Vec<f64>,
}

impl Ranged for Coordinate {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (from, to): (i32, i32)) -> i32 {
        let (low, high) = self.range;
        let share = match self.scale {
            AxisScale::Logarithmic => (value / low).ln() / (high / low).ln(),
            AxisScale::Linear => (value - low) / (high - low),
        };
        from + (f64::from(to - from) * share).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, _hint: Hint) -> Vec<f64> {
        self.marks.clone()
    }

    fn range(&self) -> Range<f64> {
        self.range.0..self.range.1
    }
}

impl ValueFormatter<f64> for Coordinate {
    fn format(value: &f64) -> String {
        number(*value)
    }
}

/// A number for people: thousands separated, no trailing digits.
pub(super) fn number(value: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    if value < 0.0 {
        return format!("−{}", number(-value));
    }
    if value < 1000.0 {
        // No tick needs more than three digits; rounding errors behind them are cut off.
        let digits = (2 - value.log10().floor() as i32).max(0) as usize;
        let text = format!("{value:.digits$}");
        if text.contains('.') {
            return text.trim_end_matches('0').trim_end_matches('.').to_owned();
        }
        return text;
    }
    if value >= 1e6 {
        return format!("{} M", number(value / 1e6));
    }
    let whole = value.round() as u64;
    if whole < 1000 {
        return whole.to_string();
    }
    format!("{},{:03}", whole / 1000, whole % 1000)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        let pairs = [
            (0.0, "0"),
            (-0.5, "−0.5"),
            (0.02, "0.02"),
            (0.5, "0.5"),
            (0.30000000000000004, "0.3"),
            (1.0, "1"),
            (200.0, "200"),
            (50_000.0, "50,000"),
            (2e6, "2 M"),
        ];
        for (value, text) in pairs {
            assert_eq!(number(value), text);
        }
    }

    /// Both scales map their ends to the ends and the middle of the scale to the middle.
    #[test]
    fn values_lie_where_the_scale_says() {
        for (axis, ends, middle) in [
            (Axis::new(""), (1.0, 100.0), 10.0),
            (Axis::new("").linear(), (-1.0, 3.0), 1.0),
        ] {
            let coordinate = axis.coordinate(ends);
            for (value, pixel) in [(ends.0, 0), (middle, 500), (ends.1, 1000)] {
                assert_eq!(coordinate.map(&value, (0, 1000)), pixel);
                // Pixel coordinates grow downwards.
                assert_eq!(coordinate.map(&value, (1000, 0)), 1000 - pixel);
            }
        }
    }

    #[test]
    fn equal_steps_are_round_and_zero_is_zero() {
        let marks = Axis::new("").linear().marks((-0.1, 2.9));
        assert_eq!(marks, [0.0, 0.5, 1.0, 1.5, 2.0, 2.5]);
        assert!(Axis::new("").linear().range([0.0, 0.0].into_iter()).is_some());
        assert!(Axis::new("").range([0.0].into_iter()).is_none());
    }
}
