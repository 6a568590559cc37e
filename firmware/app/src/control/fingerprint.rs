//! Fingerprint of the control plane's state, for the enumeration of message orders.

use core::hash::{Hash, Hasher};
use core::mem::discriminant;

use mortise_protocol::parameter::PARAMETERS;

use super::ControlPlane;
use crate::board::{Clock, Mechanism};
use crate::safety::{AfterSoftStop, Safety};

impl<M: Mechanism, C: Clock> ControlPlane<'_, '_, M, C> {
    /// Adds to `hasher` the state that decides when motors are driven: without the force law's state and without event counters.
    pub fn fingerprint(&self, hasher: &mut impl Hasher) {
        let shared = self.ends.shared;
        discriminant(&self.safety).hash(hasher);
        if let Safety::Fault(fault) | Safety::SoftStop(AfterSoftStop::Fault(fault)) = &self.safety {
            discriminant(fault).hash(hasher);
        }
        (self.rendered.fade.0, self.late.silent_ticks, self.host.restarting).hash(hasher);
        (self.scene.is_some(), self.scene_number, self.sensed.referenced).hash(hasher);
        (
            self.host.stops == shared.stops(),
            self.host.session == shared.sessions(),
        )
            .hash(hasher);
        (self.persistent_cause().is_some(), self.ends.events.len()).hash(hasher);
        (
            self.lockstep.on,
            self.lockstep.credit,
            self.reports.safety == self.safety,
        )
            .hash(hasher);
        for row in PARAMETERS {
            self.settings.parameters.get(row.id).to_bits().hash(hasher);
        }
    }
}
