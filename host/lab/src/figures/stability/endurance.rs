//! Endurance: a board kept busy, whose memory, stack and timing must not degrade.

use mortise_rig::{EmulatedMode, RigSpec};

use super::{Plan, Row};
use crate::{LabError, endurance};

/// Virtual time of the full and of the shorter form, s.
const HOUR_S: u32 = 3_600;
const QUICK_S: u32 = 180;
const SEED: u64 = 1;

/// An hour of virtual time on the emulated board with random scenes, a random hand and link faults; the rows state the duration.
pub(super) fn hour(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let emulated = RigSpec::Emulated {
        mode: EmulatedMode::Lockstep,
        firmware: None,
    };
    let seconds = if plan.quick { QUICK_S } else { HOUR_S };
    let report = endurance::run(&emulated, seconds, SEED, &mut |turn| eprintln!("{turn}"))?;
    report.rows().into_iter().for_each(out);
    Ok(())
}
