//! Guidance for parts of any shape: a fit that the finder found is followed, with recognition off.

mod energy;
mod felt;
mod insertion;

use super::{Plan, Row};
use crate::LabError;

/// Measures every row.
pub(super) fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    insertion::shared_shapes(plan, out)?;
    insertion::random_shapes(plan, out)?;
    insertion::starts(plan, out)?;
    energy::measure(plan, out)?;
    felt::measure(plan, out)
}
