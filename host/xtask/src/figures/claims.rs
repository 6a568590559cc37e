//! `docs/figures/claims.json`: the figure that is stated for each row whose bound is not exact, by table.
//!
//! The program is compiled with it and judges by it. Measuring a table adds the claims of rows that had none; `--claim` takes all of them anew.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use anyhow::{Context, Result};
use tinyjson::JsonValue;

use super::Row;

/// Where claims are kept, from the root.
pub const FILE: &str = "docs/figures/claims.json";

/// Claims by table and row.
#[derive(Debug, Default, PartialEq)]
pub struct Claims(BTreeMap<String, BTreeMap<String, f64>>);

impl Claims {
    /// Claims as they are kept.
    ///
    /// # Errors
    /// When the file cannot be read or is no table of numbers.
    pub fn read(root: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(root.join(FILE)).with_context(|| format!("reading {FILE}"))?;
        Self::parse(&text).with_context(|| format!("{FILE} is no table of numbers by table and row"))
    }

    fn parse(text: &str) -> Result<Self> {
        type Object = HashMap<String, JsonValue>;
        let value: JsonValue = text.parse().map_err(|error| anyhow::anyhow!("{error}"))?;
        let tables: &Object = value.get().context("no object")?;
        let mut claims = Self::default();
        for (table, rows) in tables {
            let rows: &Object = rows.get().with_context(|| format!("`{table}` is no object"))?;
            for (key, claim) in rows {
                let claim: &f64 = claim.get().with_context(|| format!("`{key}` is no number"))?;
                claims.insert(table, key, *claim);
            }
        }
        Ok(claims)
    }

    fn insert(&mut self, table: &str, key: &str, claim: f64) {
        let rows = self.0.entry(table.to_owned()).or_default();
        rows.insert(key.to_owned(), claim);
    }

    /// Adds the claims of measured rows.
    pub fn take(&mut self, table: &str, rows: &[Row]) {
        for row in rows {
            if let Some(claim) = row.claim {
                self.insert(table, &row.key(), claim);
            }
        }
    }

    /// Writes them, one a line, in order.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write(&self, root: &Path) -> Result<()> {
        std::fs::write(root.join(FILE), self.text()?).with_context(|| format!("writing {FILE}"))
    }

    fn text(&self) -> Result<String> {
        let quoted = |text: &str| {
            JsonValue::from(text.to_owned())
                .stringify()
                .map_err(|error| anyhow::anyhow!("{error}"))
        };
        let mut tables = Vec::new();
        for (table, rows) in &self.0 {
            let rows = (rows.iter())
                .map(|(key, claim)| Ok(format!("    {}: {claim}", quoted(key)?)))
                .collect::<Result<Vec<_>>>()?;
            tables.push(format!("  {}: {{\n{}\n  }}", quoted(table)?, rows.join(",\n")));
        }
        Ok(format!("{{\n{}\n}}\n", tables.join(",\n")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn claims_are_read_as_they_are_written() {
        let mut claims = Claims::default();
        let row = Row {
            what: "gap µm \"a\" (at 1)".into(),
            claim: Some(1.505),
            ..Row::default()
        };
        claims.take("contact", &[row, Row::default()]);
        let text = claims.text().unwrap();
        assert_eq!(
            text,
            "{\n  \"contact\": {\n    \"gap µm \\\"a\\\"\": 1.505\n  }\n}\n"
        );
        assert_eq!(Claims::parse(&text).unwrap(), claims);
        assert!(Claims::parse("{\"contact\": 1}").is_err());
    }

    #[test]
    fn those_of_the_repository_are_read() {
        let root = crate::shell::root().unwrap();
        assert_ne!(Claims::read(&root).unwrap(), Claims::default());
    }
}
