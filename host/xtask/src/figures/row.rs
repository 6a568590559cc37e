//! One row as `mortise-lab figures NAME --json` prints it.

use std::collections::HashMap;

use anyhow::{Context, Result};
use tinyjson::JsonValue;

/// One measured figure.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Row {
    /// What was measured.
    pub what: String,
    /// The value in human-readable form.
    pub value: String,
    /// Unit of the value.
    pub unit: String,
    /// The bound, in words.
    pub bound: String,
    /// True if the bound holds; `None` without a bound or a measured value.
    pub holds: Option<bool>,
    /// The row's stated figure.
    pub claim: Option<f64>,
    /// True if the value depends on the machine.
    pub varies: bool,
    /// Remark of the page beside the verdict.
    pub remark: Option<String>,
}

impl Row {
    /// True for a bounded row that does not hold.
    pub fn fails(&self) -> bool {
        self.holds == Some(false)
    }

    /// True for a row that cannot be measured here.
    pub fn is_skipped(&self) -> bool {
        self.bound == "skipped"
    }

    /// The value where it is a number.
    pub fn number(&self) -> Option<f64> {
        self.value.parse().ok()
    }

    /// The row's key, the same in every run: its text without remarks in parentheses. Same as `Row::key` of the laboratory.
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

    /// One line for the terminal.
    pub fn line(&self) -> String {
        let mark = match self.holds {
            Some(true) => "ok  ",
            Some(false) => "FAIL",
            None if self.is_skipped() => "skip",
            None => "    ",
        };
        format!(
            "{mark} {}: {} {} (bound: {})",
            self.what, self.value, self.unit, self.bound
        )
    }

    /// Reads one line of JSON.
    ///
    /// # Errors
    /// When it is not an object with the five keys.
    pub fn parse(line: &str) -> Result<Self> {
        let value: JsonValue = line.parse().map_err(|error| anyhow::anyhow!("{error}"))?;
        let fields: &HashMap<String, JsonValue> = value.get().context("not a JSON object")?;
        let field = |name: &str| fields.get(name).with_context(|| format!("`{name}` is missing"));
        let holds = match field("holds")? {
            JsonValue::Boolean(holds) => Some(*holds),
            JsonValue::Null => None,
            _ => anyhow::bail!("`holds` is neither true, false nor null"),
        };
        Ok(Self {
            what: plain(field("what")?)?,
            value: plain(field("value")?)?,
            unit: plain(field("unit")?)?,
            bound: plain(field("bound")?)?,
            holds,
            claim: fields.get("claim").and_then(|claim| claim.get().copied()),
            varies: fields.get("varies").and_then(|varies| varies.get().copied()) == Some(true),
            remark: fields.get("remark").and_then(|remark| remark.get().cloned()),
        })
    }
}

/// A value in human-readable form: text without quotes, or the shortest number that reads back the same.
fn plain(value: &JsonValue) -> Result<String> {
    Ok(match value {
        JsonValue::String(text) => text.clone(),
        JsonValue::Number(number) => number.to_string(),
        JsonValue::Boolean(truth) => truth.to_string(),
        JsonValue::Null => String::new(),
        other => other.stringify().map_err(|error| anyhow::anyhow!("{error}"))?,
    })
}

/// "31 of 31 bounds hold, 9 unbounded, 2 skipped".
pub fn count(rows: &[Row]) -> String {
    let bounded = rows.iter().filter(|row| row.holds.is_some()).count();
    let held = rows.iter().filter(|row| row.holds == Some(true)).count();
    let skipped = rows.iter().filter(|row| row.is_skipped()).count();
    let unbounded = rows.len() - bounded - skipped;
    format!("{held} of {bounded} bounds hold, {unbounded} unbounded, {skipped} skipped")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_keep_numbers_as_they_were_measured() {
        let row = Row::parse(r#"{"what":"gap","value":0.0031,"unit":"mm","bound":"<= 0.005","holds":true}"#)
            .unwrap();
        assert_eq!(row.value, "0.0031");
        assert_eq!(row.holds, Some(true));
        let error = Row::parse(r#"{"what":"gap","value":1,"unit":"mm","bound":null}"#).unwrap_err();
        assert!(error.to_string().contains("`holds`"), "{error}");
        assert!(Row::parse("measuring…").is_err());
    }

    #[test]
    fn rows_without_a_bound_and_skipped_ones_are_counted_apart() {
        let rows: Vec<Row> = [
            r#"{"what":"a","value":1,"unit":"","bound":"= 1","holds":true}"#,
            r#"{"what":"b","value":1,"unit":"","bound":"none","holds":null}"#,
            r#"{"what":"c","value":"skipped: absent","unit":"","bound":"skipped","holds":null}"#,
            r#"{"what":"d","value":1,"unit":"","bound":"≤ 0.5","holds":false,"claim":0.5}"#,
        ]
        .into_iter()
        .map(|line| Row::parse(line).unwrap())
        .collect();
        assert_eq!(count(&rows), "1 of 2 bounds hold, 1 unbounded, 1 skipped");
        assert_eq!(rows[3].claim, Some(0.5));
        assert!(rows[3].fails() && !rows[2].fails());
    }
}
