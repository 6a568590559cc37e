//! A human-readable outcome: a verdict in words, then a table with units.

use crate::outcome::{Outcome, QUANTITIES, Quantity, Verdict, three_digits};

/// The verdict in words, one sentence a line; the table of `verdicts`; the rig and the hash of the run.
pub fn report(outcome: &Outcome, verdicts: &[Verdict]) -> String {
    let mut lines = words(outcome);
    lines.push(count(verdicts));
    lines.push(String::new());
    lines.extend(table(verdicts));
    lines.push(String::new());
    lines.push(format!(
        "{}, board {}; {} ticks, state hash {}",
        outcome.rig,
        outcome.board,
        three_digits(f64::from(outcome.ticks)),
        outcome.state_hash
    ));
    lines.join("\n")
}

/// Sentences that describe the outcome.
fn words(outcome: &Outcome) -> Vec<String> {
    let mut lines = Vec::new();
    match (outcome.inserted_mm, outcome.hole_mm) {
        (Some(inserted), Some(hole)) if inserted >= hole => lines.push(format!(
            "The part goes in: {} mm, through the hole of {} mm.",
            three_digits(inserted),
            three_digits(hole)
        )),
        (Some(inserted), Some(hole)) => lines.push(format!(
            "The part does not go in: it ends {} mm deep in the hole of {} mm.",
            three_digits(inserted.max(0.0)),
            three_digits(hole)
        )),
        _ => {}
    }
    lines.push(if outcome.peak_contact_n > 0.0 {
        format!(
            "Contact pushes it with at most {} N; parts overlap by at most {} µm.",
            three_digits(outcome.peak_contact_n),
            three_digits(1e3 * outcome.penetration_mm)
        )
    } else {
        "It touches nothing on the way.".into()
    });
    lines.push(format!(
        "The handle pushes the hand with at most {} N.",
        three_digits(outcome.peak_force_n)
    ));
    if let Some(fault) = &outcome.fault {
        lines.push(format!("The board reports a fault: {fault}."));
    }
    lines
}

fn count(verdicts: &[Verdict]) -> String {
    let broken: Vec<&str> = (verdicts.iter().filter(|verdict| !verdict.holds))
        .map(|verdict| Quantity::named(&verdict.what).map_or(verdict.what.as_str(), |known| known.what))
        .collect();
    if broken.is_empty() {
        format!("All {} bounds hold.", verdicts.len())
    } else {
        format!(
            "{} of {} bounds do not hold: {}.",
            broken.len(),
            verdicts.len(),
            broken.join(", ")
        )
    }
}

/// Rows in the order of [`QUANTITIES`], columns as wide as their widest cell.
fn table(verdicts: &[Verdict]) -> Vec<String> {
    let mut rows = vec![["quantity", "measured", "unit", "bound", "holds"].map(str::to_owned)];
    for quantity in QUANTITIES {
        for verdict in verdicts.iter().filter(|verdict| verdict.what == quantity.name) {
            rows.push([
                quantity.what.to_owned(),
                verdict.value.map_or_else(|| "not measured".into(), three_digits),
                quantity.unit.to_owned(),
                verdict.bound(),
                if verdict.holds { "yes" } else { "NO" }.to_owned(),
            ]);
        }
    }
    let width = |column: usize| {
        rows.iter()
            .map(|row| row[column].chars().count())
            .max()
            .unwrap_or(0)
    };
    let widths: [usize; 5] = std::array::from_fn(width);
    rows.iter()
        .map(|[what, value, unit, bound, holds]| {
            let [a, b, c, d, _] = widths;
            format!("{what:<a$}  {value:>b$} {unit:<c$}  {bound:<d$}  {holds}")
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_has_units_and_aligned_columns() {
        let verdict = |what: &str, value, min, max| Verdict {
            what: what.into(),
            value: Some(value),
            min,
            max,
            holds: value <= max,
        };
        let verdicts = [
            verdict("missed_ticks", 2.0, 0.0, 0.0),
            verdict("inserted_mm", 42.080978, 40.0, 43.0),
        ];
        assert_eq!(
            table(&verdicts),
            [
                "quantity           measured unit   bound      holds",
                "depth in the hole      42.1 mm     40 to 43   yes",
                "loop overruns             2 ticks  exactly 0  NO",
            ]
        );
        assert_eq!(count(&verdicts), "1 of 2 bounds do not hold: loop overruns.");
    }
}
