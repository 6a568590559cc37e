//! A measured figure, its bound, and the verdict.
//!
//! A row's author states the *requirement*: the limits the value must never leave, however wide. Beside it stands the *claim*, the figure that is
//! stated for the row ([`crate::figures::Claims`]). The bound is the nearer of the two on each side: the requirement, and the claim times the row's spread,
//! 1.1 for what comes out the same on every machine (ticks, instructions, bytes, forces, lengths, virtual time) and 1.5 for what does not (time of
//! the wall clock, memory of a process). So a bound far from what is claimed cannot be written. Exact bounds and words need no claim.

use serde::{Deserialize, Serialize};

/// Largest ratio of a bound to its claim.
pub const MOST_BOUND_OVER_CLAIM: f64 = 1.5;
/// Bound over claim of values that are the same on every machine: margin for a change of the code too small to report.
const SAME_EVERYWHERE: f64 = 1.1;
/// Bound over claim of values that depend on the machine.
const VARIES: f64 = MOST_BOUND_OVER_CLAIM;
/// Resolution of a claim derived from a value, as a share of the requirement: an energy of 0 where 1 mJ is required is claimed as 0.01 mJ.
const FINEST_CLAIM: f64 = 0.01;
/// Significant digits of claims and of the bounds derived from them.
const CLAIM_DIGITS: i32 = 3;
const BOUND_DIGITS: i32 = 4;

/// One measured figure.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(into = "Line", from = "Line")]
pub struct Row {
    /// What was measured. Text in parentheses is a remark and may hold measured values.
    pub what: String,
    /// The measured value: a number, or a word where there is no number.
    pub value: Value,
    /// Unit of the value.
    pub unit: String,
    required: Requirement,
    claim: Option<f64>,
    varies: bool,
}

/// A figure's value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged, from = "serde_json::Value")]
pub enum Value {
    /// A number.
    Number(f64),
    /// A word.
    Text(String),
}

/// Verdict on a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The value is within its bound.
    Holds,
    /// The value is outside its bound, or nothing was measured.
    Fails,
    /// There is no bound.
    Unbounded,
    /// It cannot be measured here.
    Skipped,
}

#[derive(Clone, Debug, PartialEq)]
enum Requirement {
    Within {
        min: f64,
        max: f64,
    },
    Word(String),
    Nothing,
    NotMeasured,
    /// Another program's row: its bound in words, and its verdict.
    Stated {
        bound: String,
        holds: bool,
    },
}

/// A row in the form of its JSON object.
#[derive(Serialize, Deserialize)]
struct Line {
    what: String,
    value: Value,
    unit: String,
    bound: String,
    holds: Option<bool>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    claim: Option<f64>,
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    varies: bool,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    remark: Option<String>,
}

const NO_BOUND: &str = "none";
const SKIPPED: &str = "skipped";
const TIGHTER: &str = "the claim can be tightened";

impl Row {
    fn new(what: impl Into<String>, value: Value, unit: &str, required: Requirement) -> Self {
        Self {
            what: what.into(),
            value,
            unit: unit.to_owned(),
            required,
            claim: None,
            varies: false,
        }
    }

    /// A row whose value must lie between `min` and `max`; NaN does not.
    pub(crate) fn within(what: impl Into<String>, value: f64, unit: &str, min: f64, max: f64) -> Self {
        Self::new(what, Value::Number(value), unit, Requirement::Within { min, max })
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
        Self::new(
            what,
            Value::Text(value.to_owned()),
            "",
            Requirement::Word(wanted.to_owned()),
        )
    }

    /// A row without a bound. It fails when nothing was measured.
    pub(crate) fn reported(what: impl Into<String>, value: f64, unit: &str) -> Self {
        Self::new(what, Value::Number(value), unit, Requirement::Nothing)
    }

    /// A row without a bound whose value is a word.
    pub(crate) fn noted(what: impl Into<String>, value: &str) -> Self {
        Self::new(what, Value::Text(value.to_owned()), "", Requirement::Nothing)
    }

    /// A row that cannot be measured here, because something outside the repository is absent.
    pub(crate) fn skipped(what: impl Into<String>, why: &str) -> Self {
        Self::new(
            what,
            Value::Text(format!("skipped: {why}")),
            "",
            Requirement::NotMeasured,
        )
    }

    /// The same row, its value specific to this machine: wall-clock time, memory of a process. Its bound is up to 1.5 times its claim.
    #[must_use]
    pub(crate) fn varies(mut self) -> Self {
        self.varies = true;
        self
    }

    /// The same row with its stated figure.
    #[must_use]
    pub(crate) fn claimed(mut self, claim: f64) -> Self {
        if self.needs_claim() {
            self.claim = Some(claim);
        }
        self
    }

    /// The row's key, the same in every run: its text without remarks in parentheses.
    pub fn key(&self) -> String {
        let (mut key, mut depth) = (String::new(), 0usize);
        for letter in self.what.chars() {
            match letter {
                '(' => depth += 1,
                ')' => depth = depth.saturating_sub(1),
                _ if depth == 0 => key.push(letter),
                _ => {}
            }
        }
        key.split_whitespace()
            .collect::<Vec<_>>()
            .join(" ")
            .replace(" :", ":")
    }

    /// The row's stated figure, where its bound needs one.
    pub fn claim(&self) -> Option<f64> {
        self.claim
    }

    /// True for a number whose bound is not exact, and which is therefore judged near its claim.
    pub fn needs_claim(&self) -> bool {
        matches!((&self.required, &self.value), (Requirement::Within { min, max }, Value::Number(_)) if min < max)
    }

    /// The verdict on the row.
    pub fn verdict(&self) -> Verdict {
        let holds = match (&self.required, &self.value) {
            (Requirement::NotMeasured, _) => return Verdict::Skipped,
            (Requirement::Nothing, Value::Text(_)) => return Verdict::Unbounded,
            (Requirement::Nothing, Value::Number(value)) if value.is_finite() => return Verdict::Unbounded,
            (Requirement::Nothing, Value::Number(_)) => false,
            (Requirement::Stated { holds, .. }, _) => *holds,
            (Requirement::Word(wanted), Value::Text(value)) => value == wanted,
            (Requirement::Within { min, max }, Value::Number(value)) => {
                let (low, high) = self.limits(*min, *max);
                (low..=high).contains(value)
            }
            (Requirement::Word(_), Value::Number(_)) | (Requirement::Within { .. }, Value::Text(_)) => false,
        };
        if holds { Verdict::Holds } else { Verdict::Fails }
    }

    /// True for a bounded row that does not hold.
    pub fn fails(&self) -> bool {
        self.verdict() == Verdict::Fails
    }

    /// The bound in words, followed by the requirement where that is wider.
    pub fn bound(&self) -> String {
        match &self.required {
            Requirement::Nothing => NO_BOUND.to_owned(),
            Requirement::NotMeasured => SKIPPED.to_owned(),
            Requirement::Word(wanted) => format!("= {wanted}"),
            Requirement::Stated { bound, .. } => bound.clone(),
            Requirement::Within { min, max } => {
                let (low, high) = self.limits(*min, *max);
                let bound = interval(low, high);
                if (low, high) == (*min, *max) {
                    bound
                } else {
                    format!("{bound}; required {}", interval(*min, *max))
                }
            }
        }
    }

    /// Ratio of the bound to the claim, at least 1; infinite without a claim, `None` where none is needed.
    pub fn bound_over_claim(&self) -> Option<f64> {
        let Requirement::Within { min, max } = self.required else {
            return None;
        };
        if !self.needs_claim() {
            return None;
        }
        let Some(claim) = self.claim else {
            return Some(f64::INFINITY);
        };
        let (low, high) = self.limits(min, max);
        let ratio = |far: f64, near: f64| if far == near { 1.0 } else { far / near };
        let above = if high.is_finite() { ratio(high, claim) } else { 1.0 };
        let below = match low {
            low if low.is_infinite() => 1.0,
            low if low < 0.0 => ratio(-low, claim),
            low => ratio(claim, low),
        };
        Some(above.max(below).max(1.0))
    }

    /// Remark of the page beside the verdict.
    pub fn remark(&self) -> Option<&'static str> {
        let (Requirement::Within { min, max }, Value::Number(value), Some(claim)) =
            (&self.required, &self.value, self.claim)
        else {
            return None;
        };
        let spread = self.spread();
        let tighter = match (min.is_finite(), max.is_finite()) {
            (false, _) => value.abs() * spread < claim && claim > 1.01 * finest(*min, *max),
            (true, false) => *value > claim * spread,
            (true, true) if *min < 0.0 => value.abs() * spread < claim && claim > 1.01 * finest(*min, *max),
            (true, true) => false,
        };
        tighter.then_some(TIGHTER)
    }

    /// The claim that the value supports: the value in three digits, rounded to the side on which it holds, no finer than a hundredth of the
    /// requirement.
    pub fn supported_claim(&self) -> Option<f64> {
        let (Requirement::Within { min, max }, Value::Number(value)) = (&self.required, &self.value) else {
            return None;
        };
        if !self.needs_claim() || !(*min..=*max).contains(value) {
            return None;
        }
        Some(match (min.is_finite(), max.is_finite()) {
            (true, false) if *min >= 0.0 => digits(*value, CLAIM_DIGITS, f64::floor).max(*min),
            (true, true) if *min >= 0.0 => digits(*value, CLAIM_DIGITS, f64::round).clamp(*min, *max),
            _ => {
                let most = if max.is_finite() { *max } else { -min };
                let finest = digits(finest(*min, *max), CLAIM_DIGITS, f64::round);
                digits(value.abs(), CLAIM_DIGITS, f64::ceil)
                    .max(finest)
                    .min(most.abs())
            }
        })
    }

    fn spread(&self) -> f64 {
        if self.varies { VARIES } else { SAME_EVERYWHERE }
    }

    /// Limits by which the value is judged: the requirement, and on each side that it limits the claim times the spread where that is nearer.
    fn limits(&self, min: f64, max: f64) -> (f64, f64) {
        let Some(claim) = self.claim else {
            return (min, max);
        };
        let short = |limit: f64| digits(limit, BOUND_DIGITS, f64::round);
        let spread = self.spread();
        let high = if max.is_finite() {
            max.min(short(claim * spread))
        } else {
            max
        };
        let low = match min {
            min if min.is_infinite() => min,
            min if min < 0.0 => min.max(-short(claim * spread)),
            min => min.max(short(claim / spread)),
        };
        (low, high)
    }
}

/// Smallest step in which a claim is stated, for a requirement from `min` (negative) to `max`.
fn finest(min: f64, max: f64) -> f64 {
    FINEST_CLAIM * if max.is_finite() { max.abs() } else { min.abs() }
}

/// `value` rounded to this many significant digits.
fn digits(value: f64, digits: i32, round: fn(f64) -> f64) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return value;
    }
    let power = digits - 1 - value.abs().log10().floor() as i32;
    let unit = 10f64.powi(power.abs());
    // Multiplied or divided by a whole power of ten, so that the result is the number nearest to its decimal form. Values of that many digits stay
    // unchanged: 1.13 times 100 is a little more than 113.
    let (scaled, back): (f64, fn(f64, f64) -> f64) = if power >= 0 {
        (value * unit, |whole, unit| whole / unit)
    } else {
        (value / unit, |whole, unit| whole * unit)
    };
    let nearest = scaled.round();
    let whole = if (scaled - nearest).abs() <= 1e-9 * scaled.abs() {
        nearest
    } else {
        round(scaled)
    };
    back(whole, unit)
}

fn interval(min: f64, max: f64) -> String {
    if min == max {
        format!("= {min}")
    } else if min == f64::NEG_INFINITY {
        format!("≤ {max}")
    } else if max == f64::INFINITY {
        format!("≥ {min}")
    } else {
        format!("{min} to {max}")
    }
}

impl From<serde_json::Value> for Value {
    fn from(value: serde_json::Value) -> Self {
        match value {
            serde_json::Value::String(text) => Self::Text(text),
            // Non-finite numbers are written as null.
            number => Self::Number(number.as_f64().unwrap_or(f64::NAN)),
        }
    }
}

impl From<Row> for Line {
    fn from(row: Row) -> Self {
        let holds = match row.verdict() {
            Verdict::Holds => Some(true),
            Verdict::Fails => Some(false),
            Verdict::Unbounded | Verdict::Skipped => None,
        };
        Self {
            bound: row.bound(),
            holds,
            claim: row.claim,
            varies: row.varies,
            remark: row.remark().map(str::to_owned),
            what: row.what,
            value: row.value,
            unit: row.unit,
        }
    }
}

impl From<Line> for Row {
    fn from(line: Line) -> Self {
        let required = match (line.holds, line.bound.as_str()) {
            (Some(holds), _) => Requirement::Stated {
                holds,
                bound: line.bound,
            },
            (None, SKIPPED) => Requirement::NotMeasured,
            (None, _) => Requirement::Nothing,
        };
        Self {
            what: line.what,
            value: line.value,
            unit: line.unit,
            required,
            claim: line.claim,
            varies: line.varies,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_are_kept_on_both_sides_and_never_by_nan() {
        assert!(!Row::within("", 1.0, "", 0.5, 1.0).fails());
        assert!(Row::within("", 0.4, "", 0.5, 1.0).fails());
        assert!(Row::at_most("", f64::NAN, "", 1.0).fails());
        assert!(Row::exactly("", 1.0, "", 0.0).fails());
        assert!(Row::same("", "a", "b").fails());
        assert!(Row::reported("", f64::NAN, "").fails());
    }

    #[test]
    fn what_has_no_bound_or_was_skipped_does_not_hold() {
        assert_eq!(Row::reported("", 1.0, "").verdict(), Verdict::Unbounded);
        assert_eq!(Row::noted("", "a").verdict(), Verdict::Unbounded);
        assert_eq!(Row::skipped("", "absent").verdict(), Verdict::Skipped);
    }

    #[test]
    fn a_row_has_the_five_documented_keys() {
        let json = |row: Row| serde_json::to_string(&row).expect("plain");
        assert_eq!(
            json(Row::at_most("depth", 0.25, "mm", 0.5)),
            r#"{"what":"depth","value":0.25,"unit":"mm","bound":"≤ 0.5","holds":true}"#
        );
        assert_eq!(
            json(Row::reported("depth", 0.25, "mm")),
            r#"{"what":"depth","value":0.25,"unit":"mm","bound":"none","holds":null}"#
        );
        assert_eq!(
            json(Row::skipped("depth", "absent")),
            r#"{"what":"depth","value":"skipped: absent","unit":"","bound":"skipped","holds":null}"#
        );
        assert_eq!(
            json(Row::at_most("time", 2.0, "s", 30.0).claimed(4.0).varies()),
            r#"{"what":"time","value":2.0,"unit":"s","bound":"≤ 6; required ≤ 30","holds":true,"claim":4.0,"varies":true,"remark":"the claim can be tightened"}"#
        );
    }

    #[test]
    fn rows_of_other_programs_keep_their_verdict() {
        let read = |text: &str| serde_json::from_str::<Row>(text).expect("a row").verdict();
        assert_eq!(
            read(r#"{"what":"","value":1,"unit":"","bound":"= 0","holds":false}"#),
            Verdict::Fails
        );
        assert_eq!(
            read(r#"{"what":"","value":1,"unit":"","bound":"none","holds":null}"#),
            Verdict::Unbounded
        );
        for row in [
            Row::skipped("", "absent"),
            Row::reported("", 1.0, ""),
            Row::reported("", 2.5e-7, ""),
            Row::reported("", f64::NAN, ""),
            Row::same("", "a", "b"),
        ] {
            let text = serde_json::to_string(&row).expect("plain");
            assert_eq!(read(&text), row.verdict(), "{text}");
        }
    }

    #[test]
    fn the_claim_judges_where_the_requirement_is_wider() {
        let row = |value: f64| Row::at_most("", value, "instructions", 500_000.0).claimed(62_500.0);
        assert_eq!(row(62_500.0).bound(), "≤ 68750; required ≤ 500000");
        assert!(!row(68_750.0).fails());
        assert!(row(68_751.0).fails());
        // The requirement applies where the claim would allow more.
        assert!(Row::at_most("", 5.1, "", 5.0).claimed(4.9).fails());
        let least = |value: f64| Row::within("", value, "mm", 10.0, f64::INFINITY).claimed(40.0);
        assert!(least(36.0).fails());
        assert!(!least(37.0).fails());
        // A range about zero is judged by the magnitude.
        let about = |value: f64| Row::within("", value, "%", -3.0, 3.0).claimed(0.5);
        assert!(about(-0.6).fails());
        assert!(!about(-0.5).fails());
        let both = |value: f64| Row::within("", value, "N", 0.01, 3.0).claimed(1.1);
        assert_eq!(both(1.0).bound(), "1 to 1.21; required 0.01 to 3");
        assert!(both(0.5).fails());
    }

    /// For any value and requirement: the value holds the claim that it supports, and the bound lies within the spread of the claim.
    #[test]
    fn a_supported_claim_is_held_by_its_value() {
        let mut random = fastrand::Rng::with_seed(14);
        for _ in 0..100_000 {
            let value = 10f64.powf(14.0 * random.f64() - 7.0) * if random.bool() { 1.0 } else { -1.0 };
            let far = |random: &mut fastrand::Rng| value.abs() * 10f64.powf(3.0 * random.f64());
            let (min, max) = match random.u8(..4) {
                0 => (f64::NEG_INFINITY, far(&mut random)),
                1 => (value.abs() / 7.0, f64::INFINITY),
                2 => (value.abs() / 7.0, far(&mut random)),
                _ => (-far(&mut random), value.abs()),
            };
            let value = if min > 0.0 { value.abs() } else { value };
            for varies in [false, true] {
                let mut row = Row::within("", value, "", min, max);
                row.varies = varies;
                let claim = row.supported_claim().expect("within");
                row = row.claimed(claim);
                assert!(!row.fails(), "{row:?}: {}", row.bound());
                assert_eq!(row.remark(), None, "{row:?}");
                let ratio = row.bound_over_claim().expect("claimed");
                assert!(ratio <= 1.001 * MOST_BOUND_OVER_CLAIM, "{ratio} {row:?}");
            }
        }
    }

    #[test]
    fn claims_are_written_short() {
        let claim = |value: f64, max: f64| Row::at_most("", value, "", max).supported_claim();
        assert_eq!(claim(72_480.0, 120_000.0), Some(72_500.0));
        assert_eq!(claim(1.505_017, 5.0), Some(1.51));
        assert_eq!(claim(1.13, 5.0), Some(1.13));
        assert_eq!(claim(0.0, 1.0), Some(0.01));
        assert_eq!(claim(2.0, 1.0), None);
        assert_eq!(Row::exactly("", 1.0, "", 1.0).supported_claim(), None);
    }

    #[test]
    fn a_key_has_no_remarks() {
        let key = |what: &str| Row::noted(what, "").key();
        assert_eq!(key("gap error (at 0 mm beside, turned by 0.37)"), "gap error");
        assert_eq!(key("contacts (within 0 mm): time"), "contacts: time");
    }
}
