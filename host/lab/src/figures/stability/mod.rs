//! Stability: where theory puts the boundary, and what the whole loop does on either side of it.

mod boundary;
pub mod faults;
pub mod unsafe_commands;

use super::{Plan, Row};
use crate::LabError;

/// Measures every row.
pub(super) fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    boundary::measure(out)?;
    faults::measure(plan, out)?;
    unsafe_commands::measure(plan, out)
}
