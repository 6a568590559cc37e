//! Which velocity estimator bears the stiffest coupling.

use crate::LabError;
use crate::figures::Row;
use crate::stability::estimators::{DELAYS, geometric_mean, sweep};
use crate::stability::sensor::Counted;

/// Largest stiffness of another estimator, of that of the one in use, %. Either search ends within 1 %.
const MOST_PERCENT: f64 = 102.0;

/// The estimator in use beside the others, force in time and late, over all encoders of the map.
pub(super) fn measure(out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let found = sweep(false, &mut |_| {})?;
    let [in_use, others @ ..] = Counted::ALL.map(|counted| counted.name());
    for delay in DELAYS {
        let what =
            |name: &str| format!("velocity by a {name}, encoders of 1 to 50 µm, force late by {delay} ticks");
        let stiffness = geometric_mean(&found, in_use, delay);
        out(Row::reported(
            format!("{}: largest stiffness that rests, geometric mean", what(in_use)),
            stiffness,
            "N/m",
        ));
        for other in others {
            out(Row::at_most(
                format!("{}: largest stiffness, share of the {in_use}'s", what(other)),
                100.0 * geometric_mean(&found, other, delay) / stiffness,
                "%",
                MOST_PERCENT,
            ));
        }
    }
    Ok(())
}
