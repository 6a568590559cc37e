//! Claims: the figure stated for each row whose bound is not exact, stored in `docs/figures/claims.json`.
//!
//! A row is judged near its claim, see [`Row`]. A claim changes only by a change of the file: `cargo xtask figures NAME` adds those of new rows from
//! what it measures, `--claim` renews all of them; claims of rows that no longer exist are dropped (`host/xtask/src/figures/claims.rs`).

use std::collections::BTreeMap;

use crate::LabError;
use crate::row::{MOST_BOUND_OVER_CLAIM, Row, Verdict};

const KEPT: &str = include_str!("../../../../docs/figures/claims.json");
/// Claims of rows that only the form measures of which there is no page (full or shorter) stand in a table of this name behind the table's.
pub(super) const OTHER_FORM: &str = ", other form";
/// A ratio may be rounded: bounds are of four digits.
const ROUNDING: f64 = 1.001;

/// Claims by table and row.
#[derive(Clone, Debug)]
pub struct Claims {
    pub(super) tables: BTreeMap<String, BTreeMap<String, f64>>,
    missing: Missing,
}

/// Treatment of rows that need a claim and have none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Missing {
    /// They are counted, and the table's last row fails.
    Counted,
    /// The measured value becomes the claim.
    Measured,
}

impl Claims {
    /// The stored claims.
    ///
    /// # Errors
    /// `Input` where the file is not a table of numbers.
    pub fn kept() -> Result<Self, LabError> {
        let tables = serde_json::from_str(KEPT).map_err(|error| LabError::Input {
            name: "docs/figures/claims.json".into(),
            what: error.to_string(),
        })?;
        Ok(Self {
            tables,
            missing: Missing::Counted,
        })
    }

    /// The stored claims, completed from measured values where they are missing.
    ///
    /// # Errors
    /// As [`Self::kept`].
    pub fn completed() -> Result<Self, LabError> {
        Ok(Self {
            missing: Missing::Measured,
            ..Self::kept()?
        })
    }

    /// No stored claims: all are taken from measured values.
    pub fn measured() -> Self {
        Self {
            tables: BTreeMap::new(),
            missing: Missing::Measured,
        }
    }

    /// The row with its claim.
    pub(super) fn judge(&self, table: &str, row: Row) -> Row {
        if !row.needs_claim() {
            return row;
        }
        let key = row.key();
        let kept = [table, &format!("{table}{OTHER_FORM}")]
            .iter()
            .find_map(|&table| self.tables.get(table)?.get(&key).copied());
        let measured = || {
            row.supported_claim()
                .filter(|_| self.missing == Missing::Measured)
        };
        match kept.or_else(measured) {
            Some(claim) => row.claimed(claim),
            None => row,
        }
    }
}

/// Numbers of rows by verdict.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Count {
    /// Rows with a bound.
    pub bounded: usize,
    /// Bounded rows that hold.
    pub held: usize,
    /// Rows without a bound.
    pub unbounded: usize,
    /// Rows that cannot be measured here.
    pub skipped: usize,
    /// Rows whose bound is farther from their claim than allowed, or that hold and have no claim: what fails may state no figure.
    pub far: usize,
}

impl Count {
    /// Counts one row.
    pub fn add(&mut self, row: &Row) {
        match row.verdict() {
            Verdict::Holds => {
                self.bounded += 1;
                self.held += 1;
            }
            Verdict::Fails => self.bounded += 1,
            Verdict::Unbounded => self.unbounded += 1,
            Verdict::Skipped => self.skipped += 1,
        }
        if let Some(ratio) = row.bound_over_claim() {
            // Without a claim the ratio is infinite.
            let states_none = ratio.is_infinite() && row.verdict() == Verdict::Fails;
            let is_far = ratio.is_nan() || ratio > MOST_BOUND_OVER_CLAIM * ROUNDING;
            self.far += usize::from(is_far && !states_none);
        }
    }

    /// True if no bound is broken, also when no row is bounded.
    pub fn all_hold(&self) -> bool {
        self.held == self.bounded
    }

    /// The row that holds when every bound is near its claim.
    pub(super) fn row(&self) -> Row {
        Row::exactly(
            format!(
                "rows that have no claim, or a bound of more than {MOST_BOUND_OVER_CLAIM} times their claim"
            ),
            self.far as f64,
            "rows",
            0.0,
        )
    }
}

impl std::fmt::Display for Count {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self {
            bounded,
            held,
            unbounded,
            skipped,
            ..
        } = self;
        write!(
            formatter,
            "{held} of {bounded} bounds hold, {unbounded} unbounded, {skipped} skipped"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_without_a_claim_breaks_the_last_row() {
        let far = |claims: &Claims, row: Row| {
            let mut count = Count::default();
            count.add(&claims.judge("contact", row));
            count.row().fails()
        };
        let row = || Row::at_most("a row of a test", 1.0, "mm", 5.0);
        assert!(far(&Claims::kept().expect("reads"), row()));
        assert!(!far(&Claims::completed().expect("reads"), row()));
        let exact = Row::exactly("a row of a test", 1.0, "mm", 1.0);
        assert!(!far(&Claims::kept().expect("reads"), exact));
        let failing = Row::at_most("a row of a test", 6.0, "mm", 5.0);
        assert!(!far(&Claims::measured(), failing));
    }

    #[test]
    fn only_bounded_rows_are_counted_as_held() {
        let mut count = Count::default();
        for row in [
            Row::exactly("", 1.0, "", 1.0),
            Row::exactly("", 1.0, "", 2.0),
            Row::reported("", 1.0, ""),
            Row::skipped("", "absent"),
        ] {
            count.add(&row);
        }
        assert_eq!(count.to_string(), "1 of 2 bounds hold, 1 unbounded, 1 skipped");
        assert!(!count.all_hold());
    }
}
