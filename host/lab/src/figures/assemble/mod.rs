//! Assembly by task: ways out and proofs that there is none, sequences, and instructions in words. Every way is checked by two engines that share nothing
//! with the search ([`checked`]).

mod assembly_file;
mod channels;
mod checked;
mod extraction;
mod interlocked;
mod iso;
mod large;
mod played;
mod sequences;
mod words;

use super::{Plan, Row};
use crate::{LabError, corpus};

const ABSENT: &str = "the shared parts are not there; set MORTISE_SHARED to their folder";

/// Measures every row.
pub(super) fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    sequences::own(out)?;
    iso::measure(out)?;
    extraction::own(plan, out)?;
    interlocked::measure(plan, out)?;
    large::measure(plan, out)?;
    played::own(out)?;
    let Some(cad) = corpus::folder() else {
        for what in [
            "tasks of extraction",
            "pairs that stay together",
            "sequences of whole assemblies",
            "the motor of 18 parts by words",
            "assemblies played by a simulated hand",
        ] {
            out(Row::skipped(what, ABSENT));
        }
        return Ok(());
    };
    extraction::measure(&cad, plan, out)?;
    sequences::measure(&cad, plan, out)?;
    words::measure(&cad, out)?;
    played::measure(&cad, out)
}
