//! Contact: accurate to micrometres, at a cost that the board can afford.

mod accuracy;
mod baking;
mod insertion;
mod limits;
mod ticks;

use super::{Plan, Row};
use crate::LabError;

/// Measures every row.
pub(super) fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    accuracy::scene_p(out)?;
    accuracy::centred(out)?;
    insertion::tight(plan, out)?;
    ticks::tight(plan, out)?;
    ticks::large_classic(plan, out)?;
    ticks::large(plan, out)?;
    ticks::more_points(plan, out)?;
    baking::motor(plan, out)?;
    baking::real_parts(plan, out)
}
