//! One line of `mortise-lab peers --json`: a method on a scene.

use std::collections::HashMap;

use anyhow::{Context, Result};
use tinyjson::JsonValue;

/// A method on a scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Row {
    /// Scene.
    pub scene: String,
    /// Method.
    pub method: String,
    /// How it represents the parts; empty where it is skipped.
    pub kind: String,
    /// Version, where it has one.
    pub version: Option<String>,
    /// Largest deviation of its meshes, µm.
    pub mesh_um: Option<f64>,
    /// Poses.
    pub poses: f64,
    /// Median query, µs.
    pub median_us: Option<f64>,
    /// Slowest query, µs.
    pub worst_us: Option<f64>,
    /// The same call for two balls, µs.
    pub floor_us: Option<f64>,
    /// Median over that of our default bake.
    pub over_ours: Option<f64>,
    /// Poses with a wrong sign.
    pub wrong_signs: Option<f64>,
    /// Largest error of a gap, µm.
    pub gap_error_um: Option<f64>,
    /// Largest error of a depth, µm.
    pub depth_error_um: Option<f64>,
    /// Why it is not measured.
    pub skipped: Option<String>,
}

impl Row {
    /// Reads a line.
    ///
    /// # Errors
    /// When it is no such line, or has neither figures nor a reason why there are none.
    pub fn parse(line: &str) -> Result<Self> {
        let value: JsonValue = line.parse().map_err(|error| anyhow::anyhow!("{error}"))?;
        let fields: &HashMap<String, JsonValue> = value.get().context("no object")?;
        let text = |name: &str| fields.get(name).and_then(|value| value.get::<String>().cloned());
        let number = |name: &str| fields.get(name).and_then(|value| value.get::<f64>().copied());
        let row = Self {
            scene: text("scene").context("no scene")?,
            method: text("method").context("no method")?,
            kind: text("kind").unwrap_or_default(),
            version: text("version"),
            mesh_um: number("mesh_um"),
            poses: number("poses").context("no poses")?,
            median_us: number("median_us"),
            worst_us: number("worst_us"),
            floor_us: number("floor_us"),
            over_ours: number("over_ours"),
            wrong_signs: number("wrong_signs"),
            gap_error_um: number("gap_error_um"),
            depth_error_um: number("depth_error_um"),
            skipped: text("skipped"),
        };
        let measured = row.median_us.is_some() && row.wrong_signs.is_some();
        anyhow::ensure!(
            measured != row.skipped.is_some(),
            "either figures or the reason of a skip are expected"
        );
        Ok(row)
    }
}

/// How many were measured, and how many were not.
pub fn count(rows: &[Row]) -> String {
    let skipped = rows.iter().filter(|row| row.skipped.is_some()).count();
    format!("{} measured, {skipped} skipped", rows.len() - skipped)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_measured_line_and_a_skip_are_read_and_counted_apart() {
        let measured = r#"{"scene":"s","method":"m","kind":"hulls","poses":2,"median_us":1.5,"wrong_signs":0,"gap_error_um":null,"skipped":null}"#;
        let skip = r#"{"scene":"s","method":"n","kind":null,"poses":2,"median_us":null,"wrong_signs":null,"skipped":"not there"}"#;
        let rows = [Row::parse(measured).unwrap(), Row::parse(skip).unwrap()];
        assert_eq!((rows[0].median_us, rows[0].gap_error_um), (Some(1.5), None));
        assert_eq!(rows[1].skipped.as_deref(), Some("not there"));
        assert_eq!(count(&rows), "1 measured, 1 skipped");
    }

    #[test]
    fn a_line_with_neither_figures_nor_a_reason_is_refused() {
        for line in [
            "dance",
            "{}",
            r#"{"scene":"s","method":"m","poses":2,"median_us":null,"skipped":null}"#,
            r#"{"scene":"s","method":"m","poses":2,"median_us":1,"wrong_signs":0,"skipped":"both"}"#,
        ] {
            assert!(Row::parse(line).is_err(), "{line}");
        }
    }
}
