//! Figures: the tables the product is measured by, every row measured when it is asked for.

mod constraints;
mod contact;
mod end_to_end;
mod link;
mod parts;
pub mod stability;

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::LabError;

/// One measured figure and whether it keeps its bound.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// What was measured.
    pub what: String,
    /// What it came to: a number, or a word where there is no number.
    pub value: Value,
    /// Unit of the value.
    pub unit: String,
    /// What it must reach, in words.
    pub bound: String,
    /// Whether it does.
    pub holds: bool,
}

/// A figure's value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Value {
    /// A number.
    Number(f64),
    /// A word.
    Text(String),
}

/// Names of the tables there are.
pub const NAMES: &[&str] = &["end-to-end", "contact", "constraints", "stability"];

/// How a table is measured.
#[derive(Clone, Copy, Debug)]
pub struct Plan<'a> {
    /// The shorter form: what takes minutes is done on fewer cases; each row's text says so.
    pub quick: bool,
    /// The program `mortise`, for rows that measure a command of its.
    pub program: &'a Path,
    /// The thesis pair with 1 mm clearance.
    pub pair: &'a Path,
}

/// Measures the table `name`; each row goes to `out` as soon as it is known.
///
/// # Errors
/// `NoSuchFigures`; anything that keeps a row from being measured. A row that does not hold is no error.
pub fn figures(name: &str, plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    match name {
        "end-to-end" => end_to_end::measure(plan, out),
        "contact" => contact::measure(plan, out),
        "constraints" => constraints::measure(plan, out),
        "stability" => stability::measure(plan, out),
        _ => Err(LabError::NoSuchFigures {
            name: name.to_owned(),
            known: NAMES.join(", "),
        }),
    }
}

impl Row {
    /// A row whose value must lie between `min` and `max`; NaN does not.
    pub(crate) fn within(what: impl Into<String>, value: f64, unit: &str, min: f64, max: f64) -> Self {
        let bound = if min == max {
            format!("= {min}")
        } else if min == f64::NEG_INFINITY {
            format!("≤ {max}")
        } else if max == f64::INFINITY {
            format!("≥ {min}")
        } else {
            format!("{min} to {max}")
        };
        Self {
            what: what.into(),
            holds: (min..=max).contains(&value),
            value: Value::Number(value),
            unit: unit.to_owned(),
            bound,
        }
    }

    /// A row whose value must be at most `max`.
    pub(crate) fn at_most(what: impl Into<String>, value: f64, unit: &str, max: f64) -> Self {
        Self::within(what, value, unit, f64::NEG_INFINITY, max)
    }

    /// A row whose value must be exactly `wanted`.
    pub(crate) fn exactly(what: impl Into<String>, value: f64, unit: &str, wanted: f64) -> Self {
        Self::within(what, value, unit, wanted, wanted)
    }

    /// A row whose value is a word and must be `wanted`.
    pub(crate) fn same(what: impl Into<String>, value: &str, wanted: &str) -> Self {
        Self {
            what: what.into(),
            holds: value == wanted,
            value: Value::Text(value.to_owned()),
            unit: String::new(),
            bound: format!("= {wanted}"),
        }
    }

    /// A row without a bound, told for its value. It does not hold when nothing was measured.
    pub(crate) fn told(what: impl Into<String>, value: f64, unit: &str) -> Self {
        Self {
            what: what.into(),
            holds: value.is_finite(),
            value: Value::Number(value),
            unit: unit.to_owned(),
            bound: "told".into(),
        }
    }

    /// A row without a bound whose value is a word.
    pub(crate) fn noted(what: impl Into<String>, value: &str) -> Self {
        Self {
            what: what.into(),
            value: Value::Text(value.to_owned()),
            unit: String::new(),
            bound: "told".into(),
            holds: true,
        }
    }

    /// A row that cannot be measured here, because something that is not part of the repository is absent.
    pub(crate) fn skipped(what: impl Into<String>, why: &str) -> Self {
        Self {
            what: what.into(),
            value: Value::Text(format!("skipped: {why}")),
            unit: String::new(),
            bound: "measured where present".into(),
            holds: true,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_are_kept_on_both_sides_and_never_by_nan() {
        assert!(Row::within("", 1.0, "", 0.5, 1.0).holds);
        assert!(!Row::within("", 0.4, "", 0.5, 1.0).holds);
        assert!(!Row::at_most("", f64::NAN, "", 1.0).holds);
        assert!(!Row::exactly("", 1.0, "", 0.0).holds);
        assert!(!Row::same("", "a", "b").holds);
    }

    #[test]
    fn a_row_has_the_five_documented_keys() {
        let row = Row::at_most("depth", 0.25, "mm", 0.5);
        let text = serde_json::to_string(&row).expect("plain");
        assert_eq!(
            text,
            r#"{"what":"depth","value":0.25,"unit":"mm","bound":"≤ 0.5","holds":true}"#
        );
    }
}
