//! `docs/figures/claims.json`: the figure stated for each row whose bound is not exact, by table.
//!
//! The program is compiled with this file and judges by it. Measuring a table adds the claims of rows that had none; `--claim` renews all of them.
//!
//! A table is measured in full or in its shorter form, and its page is made from one of the two. Claims of that form's rows are listed under the
//! table's name; those of rows that only the other form has, under the name and [`OTHER_FORM`]. A claim that the page's form no longer measures moves
//! to the other form's list, and is dropped if that form does not measure it either.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use anyhow::{Context, Result};
use tinyjson::JsonValue;

use super::row::Row;

/// File of the claims, from the root.
pub const FILE: &str = "docs/figures/claims.json";

/// Suffix of a table's name for rows of the form from which the page is not made.
const OTHER_FORM: &str = ", other form";

/// Claims by table and row.
#[derive(Debug, Default, PartialEq)]
pub struct Claims(BTreeMap<String, BTreeMap<String, f64>>);

impl Claims {
    /// The stored claims.
    ///
    /// # Errors
    /// When the file cannot be read or is not a table of numbers.
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

    /// Adopts the claims of all rows of one run; `of_page` if the page is made from the run's form. Returns the dropped claims.
    pub fn take(&mut self, table: &str, of_page: bool, rows: &[Row]) -> Vec<String> {
        let other = format!("{table}{OTHER_FORM}");
        for row in rows {
            let (Some(claim), key) = (row.claim, row.key()) else {
                continue;
            };
            let known = self.0.get(table).is_some_and(|rows| rows.contains_key(&key));
            if of_page || known {
                self.insert(table, &key, claim);
                if let Some(rows) = self.0.get_mut(&other) {
                    rows.remove(&key);
                }
            } else {
                self.insert(&other, &key, claim);
            }
        }
        let left = self.without_row(table, of_page, rows);
        let own = if of_page { table } else { &other };
        for key in &left {
            let claim = self.0.get_mut(own).and_then(|rows| rows.remove(key));
            if let (true, Some(claim)) = (of_page, claim) {
                self.insert(&other, key, claim);
            }
        }
        self.0.retain(|_, rows| !rows.is_empty());
        if of_page { Vec::new() } else { left }
    }

    /// Claims stored for this form whose row is missing in a run of it. A skipped row may represent several whose names begin as its does.
    pub fn without_row(&self, table: &str, of_page: bool, rows: &[Row]) -> Vec<String> {
        let own = match of_page {
            true => table.to_owned(),
            false => format!("{table}{OTHER_FORM}"),
        };
        let measured = |key: &str| {
            rows.iter().any(|row| {
                let name = row.key();
                name == key || (row.is_skipped() && key.starts_with(&name))
            })
        };
        let claims = self.0.get(&own).into_iter().flatten();
        claims
            .map(|(key, _)| key.clone())
            .filter(|key| !measured(key))
            .collect()
    }

    /// Writes the claims in order, one a line.
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
        claims.take("contact", true, &[row, Row::default()]);
        let text = claims.text().unwrap();
        assert_eq!(
            text,
            "{\n  \"contact\": {\n    \"gap µm \\\"a\\\"\": 1.505\n  }\n}\n"
        );
        assert_eq!(Claims::parse(&text).unwrap(), claims);
        assert!(Claims::parse("{\"contact\": 1}").is_err());
    }

    #[test]
    fn claims_of_rows_that_are_no_more_go() {
        let rows = |names: &[&str]| -> Vec<Row> {
            let row = |name: &&str| Row {
                what: (*name).to_owned(),
                claim: Some(name.len() as f64),
                ..Row::default()
            };
            names.iter().map(row).collect()
        };
        let mut claims = Claims::default();
        assert!(
            claims
                .take("contact", true, &rows(&["both", "page", "old"]))
                .is_empty()
        );
        assert!(
            claims
                .take("contact", false, &rows(&["both", "short"]))
                .is_empty()
        );
        let other = format!("contact{OTHER_FORM}");
        let named = |claims: &Claims, table: &str| -> Vec<String> {
            claims
                .0
                .get(table)
                .into_iter()
                .flatten()
                .map(|(key, _)| key.clone())
                .collect()
        };
        assert_eq!(named(&claims, "contact"), ["both", "old", "page"]);
        assert_eq!(named(&claims, &other), ["short"]);
        // A claim that the page's form no longer has may be the other form's; a claim of neither is dropped.
        let now = rows(&["both", "page"]);
        assert_eq!(claims.without_row("contact", true, &now), ["old"]);
        assert!(claims.take("contact", true, &now).is_empty());
        assert_eq!(named(&claims, &other), ["old", "short"]);
        let short = rows(&["both", "short"]);
        assert_eq!(claims.without_row("contact", false, &short), ["old"]);
        assert_eq!(claims.take("contact", false, &short), ["old"]);
        assert_eq!(named(&claims, "contact"), ["both", "page"]);
        assert_eq!(named(&claims, &other), ["short"]);
        // Nothing is dropped for rows that cannot be measured here, nor in other tables.
        let skipped = Row {
            what: "pa".into(),
            bound: "skipped".into(),
            ..Row::default()
        };
        assert!(claims.without_row("contact", true, std::slice::from_ref(&skipped)) == ["both"]);
        claims.take("stability", true, &rows(&["other"]));
        claims.take("contact", true, &[skipped]);
        assert_eq!(named(&claims, "contact"), ["page"]);
        assert_eq!(named(&claims, "stability"), ["other"]);
    }

    #[test]
    fn those_of_the_repository_are_read() {
        let root = crate::shell::root().unwrap();
        assert_ne!(Claims::read(&root).unwrap(), Claims::default());
    }
}
