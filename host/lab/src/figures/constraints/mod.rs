//! Constraints: contacts are recognised, recognised contacts guide, and neither adds much to a tick.

mod contacts;
mod cost;
mod insertion;
mod joints;
mod latency;
mod link;
mod row_of_holes;
mod steps;

use super::{Plan, Row};
use crate::LabError;

/// Measures every row.
pub(super) fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    contacts::measure(plan, out)?;
    insertion::fits(plan, out)?;
    insertion::large(out)?;
    cost::four_targets(out)?;
    cost::guided_ticks(plan, out)?;
    steps::come_and_go(out)?;
    steps::leave(out)?;
    row_of_holes::measure(out)?;
    joints::measure(out)?;
    link::measure(plan, out)?;
    latency::measure(plan, out)
}
