//! Figures: the tables by which the product is measured; each row is measured on request.

mod assemble;
mod claims;
mod constraints;
mod contact;
mod end_to_end;
mod guidance;
mod link;
mod parts;
mod plan;
mod planning;
pub mod promises;
pub mod stability;
mod workbench;

pub use self::claims::{Claims, Count};
pub use self::plan::Plan;
use crate::LabError;
pub use crate::row::{Row, Value, Verdict};

/// Measures the rows of a table.
type Measure = fn(&Plan<'_>, &mut dyn FnMut(Row)) -> Result<(), LabError>;

/// Every table: its name, and the function that measures it.
const TABLES: &[(&str, Measure)] = &[
    ("end-to-end", end_to_end::measure),
    ("contact", contact::measure),
    ("constraints", constraints::measure),
    ("guidance", guidance::measure),
    ("stability", stability::measure),
    ("promises", promises::measure),
    ("plan", planning::measure),
    ("assemble", assemble::measure),
    ("workbench", workbench::measure),
];

/// Names of all tables.
pub fn names() -> Vec<&'static str> {
    TABLES.iter().map(|(name, _)| *name).collect()
}

/// Measures the table `name`, each row judged by its claim of `claims`; each row goes to `out` as soon as it is known. The last row counts those
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
    match plan.only {
        Some(only) if name != "contact" => Err(LabError::NoSuchFigures {
            name: only.to_owned(),
            known: format!("{name} as a whole"),
        }),
        _ => measure(plan, out),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kept_claims_are_positive_numbers_of_known_tables() {
        let claims = Claims::kept().expect("reads");
        for (table, rows) in &claims.tables {
            let name = table.strip_suffix(claims::OTHER_FORM).unwrap_or(table);
            assert!(names().contains(&name), "{table}");
            for (key, claim) in rows {
                assert!(claim.is_finite() && *claim >= 0.0, "{table}: {key}: {claim}");
                assert_eq!(&Row::noted(key, "").key(), key, "{table}");
            }
        }
    }
}
