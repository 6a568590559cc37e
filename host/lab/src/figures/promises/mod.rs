//! Promises: statements of the pages on safety, protocol and files, tested adversarially.

mod energy;
pub mod files;
mod orders;
pub mod stop;
mod thesis;
pub mod watch;
mod window;

use super::{Plan, Row};
use crate::LabError;

/// Measures every row.
pub(super) fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    orders::measure(plan, out);
    stop::measure(plan, out)?;
    watch::measure(plan, out)?;
    energy::measure(plan, out)?;
    files::measure(plan, out)?;
    thesis::measure(plan, out)?;
    window::measure(plan, out)
}
