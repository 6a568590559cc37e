//! Stability: where theory puts the boundary, and what the whole loop does on either side of it.

mod boundary;

use super::{Plan, Row};
use crate::LabError;

/// Measures every row.
pub(super) fn measure(_plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    boundary::measure(out)
}
