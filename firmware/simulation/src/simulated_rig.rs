//! The mechanism of a simulated board: the one described in its flash, or a free handle with six motors.

use mortise_protocol::limits::{MAX_ENCODERS, MAX_JOINTS};
use mortise_protocol::rig::Rig;

use crate::described::Described;
use crate::simulated::Simulated;
use mortise_mechanism::interface::{Drive, Mechanism, Sensed, Simulation};

/// Either of the two mechanisms; see the module.
#[derive(Clone, Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "one is made, in a static; there is nothing to allocate from"
)]
pub enum SimulatedRig {
    /// Without a description.
    Free(Simulated),
    /// By a description.
    Described(Described),
}

impl SimulatedRig {
    /// The mechanism of `rig`; a free handle without one, or for one that cannot be built (which is never kept).
    pub fn of(rig: Option<&Rig>) -> Self {
        match rig.map(Described::new) {
            Some(Ok(described)) => Self::Described(described),
            _ => Self::Free(Simulated::new()),
        }
    }
}

macro_rules! each {
    ($self:expr, $mechanism:ident => $call:expr) => {
        match $self {
            SimulatedRig::Free($mechanism) => $call,
            SimulatedRig::Described($mechanism) => $call,
        }
    };
}

impl Mechanism for SimulatedRig {
    const DESCRIBED: bool = true;

    fn sense(&mut self) -> Sensed {
        each!(self, mechanism => mechanism.sense())
    }

    fn drive(&mut self, drive: Drive) {
        each!(self, mechanism => mechanism.drive(drive));
    }

    fn watch_encoders(&mut self, rendered: bool) {
        each!(self, mechanism => mechanism.watch_encoders(rendered));
    }

    fn count(&self) -> [f32; 2] {
        each!(self, mechanism => mechanism.count())
    }

    fn motors(&self) -> u8 {
        each!(self, mechanism => Mechanism::motors(mechanism))
    }

    fn counts(&self) -> [i32; MAX_ENCODERS] {
        each!(self, mechanism => mechanism.counts())
    }

    fn currents(&self) -> [f32; MAX_JOINTS] {
        each!(self, mechanism => Mechanism::currents(mechanism))
    }

    fn home(&mut self) {
        each!(self, mechanism => mechanism.home());
    }

    fn simulation(&mut self) -> Option<&mut dyn Simulation> {
        each!(self, mechanism => mechanism.simulation())
    }
}
