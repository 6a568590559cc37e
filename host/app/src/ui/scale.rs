//! Scales of the plots' axes: round ends and marks that contain the values shown.

use crate::session::history::Quantity;

/// Scale of a vertical axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Lower end.
    pub bottom: f64,
    /// Upper end.
    pub top: f64,
    /// Distance of the marks.
    pub step: f64,
}

impl Scale {
    /// A scale for values between these two; an empty one when there are none.
    pub fn of(quantity: Quantity, values: Option<[f64; 2]>) -> Self {
        let [mut low, mut high] = values.unwrap_or([0.0; 2]);
        if quantity.has_zero() {
            (low, high) = (low.min(0.0), high.max(0.0));
        }
        let least = quantity.least_span();
        let missing = (least - (high - low)).max(0.0);
        // What stays at zero grows to the side of its values.
        let below = match (quantity.has_zero(), low < 0.0, high > 0.0) {
            (true, false, _) => 0.0,
            (true, true, false) => missing,
            _ => 0.5 * missing,
        };
        (low, high) = (low - below, high + missing - below);
        let step = nice_above((high - low) / 4.0);
        let (bottom, mut top) = ((low / step).floor() * step, (high / step).ceil() * step);
        if high > top - 0.1 * step {
            top += 0.5 * step;
        }
        Self { bottom, top, step }
    }

    /// Values of the marks.
    pub fn marks(&self) -> impl Iterator<Item = f64> {
        let Self { bottom, top, step } = *self;
        let first = (bottom / step).round();
        let marks = (0..=12).map(move |n| (first + f64::from(n)) * step);
        marks.filter(move |&mark| mark <= top + 1e-9 * step)
    }
}

/// The smallest of 1, 2, 5 × 10ⁿ that is not below `value`.
pub fn nice_above(value: f64) -> f64 {
    let decade = 10f64.powf(value.max(1e-9).log10().floor());
    [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|step| step * decade)
        .find(|&top| top >= value)
        .unwrap_or(10.0 * decade)
}

/// A number of an axis whose marks have this distance.
pub fn number(value: f64, step: f64) -> String {
    let (factor, unit) = match value.abs().max(4.0 * step) {
        v if v >= 1e6 => (1e-6, " M"),
        v if v >= 1e3 => (1e-3, " k"),
        _ => (1.0, ""),
    };
    let decimals = (-(factor * step).log10().floor()).clamp(0.0, 9.0) as usize;
    let text = format!("{:.decimals$}", value * factor);
    let short = if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.')
    } else {
        &text
    };
    match short {
        "0" | "-0" => "0".to_owned(),
        _ => format!("{}{unit}", short.replace('-', "−")),
    }
}

/// A time span, such as “0.5 s” or “2 min”.
pub fn span(seconds: f64) -> String {
    let (value, unit) = match seconds.abs() {
        s if s >= 120.0 => (seconds / 60.0, "min"),
        s if s >= 1.0 => (seconds, "s"),
        _ => (1e3 * seconds, "ms"),
    };
    let text = format!("{value:.1}");
    format!("{} {unit}", text.trim_end_matches('0').trim_end_matches('.'))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn steps_are_round() {
        for (value, top) in [
            (0.7, 1.0),
            (1.0, 1.0),
            (1.3, 2.0),
            (2.4, 5.0),
            (7.0, 10.0),
            (41_000.0, 50_000.0),
        ] {
            assert!((nice_above(value) - top).abs() < 1e-9 * top, "{value}");
        }
    }

    #[test]
    fn axis_numbers_are_short() {
        for (value, step, text) in [
            (0.0, 0.5, "0"),
            (0.75, 0.05, "0.75"),
            (1.5, 0.5, "1.5"),
            (100.0, 20.0, "100"),
            (-40.0, 20.0, "−40"),
            (12_500.0, 500.0, "12.5 k"),
            (0.012, 0.002, "0.012"),
        ] {
            assert_eq!(number(value, step), text);
        }
    }

    #[test]
    fn spans_are_in_their_unit() {
        for (seconds, text) in [(0.05, "50 ms"), (2.5, "2.5 s"), (90.0, "90 s"), (600.0, "10 min")] {
            assert_eq!(span(seconds), text);
        }
    }

    proptest! {
        #[test]
        fn a_scale_contains_its_values(low in -1e6..1e6f64, extent in 0.0..1e6f64, which in 0..9usize) {
            let (quantity, high) = (Quantity::ALL[which], low + extent);
            let scale = Scale::of(quantity, Some([low, high]));
            prop_assert!(scale.bottom <= low && high <= scale.top, "{scale:?}");
            prop_assert!(scale.top - scale.bottom >= quantity.least_span());
            prop_assert!((3..=12).contains(&scale.marks().count()), "{scale:?}");
        }
    }
}
