//! Figures: the tables by which the product is measured; each row is measured on request.

mod claims;
mod constraints;
mod contact;
mod end_to_end;
mod link;
mod parts;
pub mod promises;
mod row;
pub mod stability;

use std::path::Path;

pub use self::claims::{Claims, Count};
pub use self::row::{Row, Value, Verdict};
use crate::LabError;

/// Measures the rows of a table.
type Measure = fn(&Plan<'_>, &mut dyn FnMut(Row)) -> Result<(), LabError>;

/// Every table: its name, and the function that measures it.
const TABLES: &[(&str, Measure)] = &[
    ("end-to-end", end_to_end::measure),
    ("contact", contact::measure),
    ("constraints", constraints::measure),
    ("stability", stability::measure),
    ("promises", promises::measure),
];

/// Names of all tables.
pub fn names() -> Vec<&'static str> {
    TABLES.iter().map(|(name, _)| *name).collect()
}

/// How a table is measured.
#[derive(Clone, Copy, Debug)]
pub struct Plan<'a> {
    /// The shorter form: long measurements run on fewer cases, as each row's text states.
    pub quick: bool,
    /// The program `mortise`, for rows that measure one of its commands.
    pub program: &'a Path,
    /// The thesis pair with 1 mm clearance.
    pub pair: &'a Path,
}

/// Measures the table `name` and judges each row by its claim in `claims`; passes each row to `out` as soon as it is known. The last row counts those
/// whose bound is not near a claim.
///
/// # Errors
/// `NoSuchFigures`; anything that prevents a row from being measured. A row that does not hold is not an error.
pub fn figures(
    name: &str,
    plan: &Plan<'_>,
    claims: &Claims,
    out: &mut dyn FnMut(Row),
) -> Result<Count, LabError> {
    let mut count = Count::default();
    let mut judged = |row: Row| {
        let row = claims.judge(name, row);
        count.add(&row);
        out(row);
    };
    measure(name, plan, &mut judged)?;
    let near = count.row();
    count.add(&near);
    out(near);
    Ok(count)
}

fn measure(name: &str, plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let table = TABLES.iter().find(|(known, _)| *known == name);
    let (_, measure) = table.ok_or_else(|| LabError::NoSuchFigures {
        name: name.to_owned(),
        known: names().join(", "),
    })?;
    measure(plan, out)
}
