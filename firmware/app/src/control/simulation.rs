//! Commands that only a simulated mechanism takes.

use mortise_protocol::message::{HandScript, InputFault, Refusal};

use super::ControlPlane;
use crate::board::{Clock, Mechanism};

impl<M: Mechanism, C: Clock> ControlPlane<'_, '_, M, C> {
    pub(super) fn set_lockstep(&mut self, on: bool) -> Result<(), Refusal> {
        if !M::SIMULATED {
            return Err(Refusal::NotSimulated);
        }
        self.lockstep = on;
        self.silent_ticks = 0;
        Ok(())
    }

    pub(super) fn set_input_faults(&mut self, faults: &[InputFault]) -> Result<(), Refusal> {
        if !M::SIMULATED {
            return Err(Refusal::NotSimulated);
        }
        self.mechanism.set_input_faults(faults);
        Ok(())
    }

    pub(super) fn set_hand(&mut self, script: &HandScript) -> Result<(), Refusal> {
        if !M::SIMULATED {
            return Err(Refusal::NotSimulated);
        }
        self.mechanism.set_hand(Some(script));
        Ok(())
    }
}
