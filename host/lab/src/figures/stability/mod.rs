//! Stability: the theoretical boundary, the behaviour of the whole loop on either side of it, and the energy it generates.

mod boundary;
mod contacts;
mod endurance;
mod energy;
mod estimators;
pub mod faults;
mod fuzzing;
mod impact;
mod rate;
pub mod unsafe_commands;

use super::{Plan, Row};
use crate::LabError;

/// Measures every row.
pub(super) fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    boundary::measure(out)?;
    energy::measure(plan, out)?;
    contacts::measure(out)?;
    impact::measure(out)?;
    rate::measure(out)?;
    estimators::measure(out)?;
    faults::measure(plan, out)?;
    unsafe_commands::measure(plan, out)?;
    fuzzing::measure(plan, out)?;
    endurance::hour(plan, out)
}
