//! Commands that only a simulated mechanism takes.

use mortise_protocol::message::{HandScript, InputFault, Refusal};

use super::ControlPlane;
use crate::board::{Clock, Mechanism, Simulation};

impl<M: Mechanism, C: Clock> ControlPlane<'_, '_, M, C> {
    pub(super) fn set_lockstep(&mut self, on: bool) -> Result<(), Refusal> {
        self.simulation()?;
        self.lockstep.on = on;
        self.late.silent_ticks = 0;
        Ok(())
    }

    pub(super) fn set_input_faults(&mut self, faults: &[InputFault]) -> Result<(), Refusal> {
        self.simulation()?.set_input_faults(faults);
        Ok(())
    }

    pub(super) fn set_hand(&mut self, script: &HandScript) -> Result<(), Refusal> {
        self.simulation()?.set_hand(Some(script));
        Ok(())
    }

    fn simulation(&mut self) -> Result<&mut dyn Simulation, Refusal> {
        self.mechanism.simulation().ok_or(Refusal::NotSimulated)
    }
}
