//! The thesis repeated (Faas 2010, chapters 7 and 8): its printed values and Mortise's.

use crate::LabError;
use crate::figures::{Plan, Row};
use crate::hybrid::{self, Condition, PEGS_MM};
use crate::study::{faas::TABLE_3, feature_size, shrink};

/// Tolerance of the thesis' numbers of voxels, as a share: lengths of 1 m are inferred from them, and how VPS counts voxels at edges is not known.
const VOXELS: f64 = 0.02;

/// Measures every row.
pub(super) fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    for count in hybrid::counts()? {
        let faas = f64::from(count.faas);
        let what = format!(
            "thesis' table 6, {}: voxels of 10 mm (hers: {})",
            count.part, count.faas
        );
        let [least, most] = [1.0 - VOXELS, 1.0 + VOXELS].map(|share| (share * faas).round());
        out(Row::within(what, f64::from(count.ours), "voxels", least, most));
    }
    let word = |through: bool| if through { "through" } else { "stuck" };
    let mut rates = Vec::new();
    for course in hybrid::sweep(true, &mut |_| {})? {
        let of = format!(
            "thesis' section 8.2, peg of {} mm, {}",
            PEGS_MM[1],
            course.condition.name()
        );
        if let Some(hers) = course.faas_lowest_hz {
            let what = format!(
                "thesis' fig. 35, {}: lowest rate (hers: {hers})",
                course.condition.name()
            );
            rates.push(Row::reported(what, course.lowest_hz, "Hz"));
        }
        // Both methods must show their known behaviour; how far the thesis' blend helps depends on unstated details.
        out(match (course.condition, course.faas_through) {
            (Condition::Voxels, Some(hers)) => Row::same(of, word(course.through), word(hers)),
            (Condition::DistanceField, _) => Row::same(of, word(course.through), word(true)),
            (_, hers) => {
                let hers = hers.map_or("none", word);
                Row::noted(format!("{of} (hers: {hers})"), word(course.through))
            }
        });
    }
    rates.into_iter().for_each(&mut *out);
    if plan.quick {
        return Ok(());
    }
    let study = shrink::study(true, &mut |_| {})?;
    for (row, printed) in study.table.iter().zip(TABLE_3) {
        let what = format!(
            "thesis' table 3, {}: χ² of one space-filling design of 27 trials (hers: {})",
            printed.source, printed.statistic
        );
        out(Row::reported(what, row.median_chi_squared, "χ²"));
    }
    for row in feature_size::study(false, &mut |_| {})?.table {
        let what = format!("thesis' {}, {} (hers: {})", row.of, row.what, row.faas);
        out(match row.ours {
            Some(ours) => Row::reported(what, ours, ""),
            None => Row::noted(what, "cannot be computed"),
        });
    }
    Ok(())
}
