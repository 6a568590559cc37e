//! Fingerprint of the link plane's state, for the enumeration of message orders: equal fingerprints imply equal behaviour.

use core::mem::discriminant;

use core::hash::{Hash, Hasher};

use mortise_protocol::frame::Stamp;
use mortise_protocol::parameter::PARAMETERS;

use super::LinkPlane;
use crate::board::Flash;
use crate::parameters::Parameters;

impl<'s, F: Flash<'s>> LinkPlane<'_, 's, F> {
    /// Adds to `hasher` the state that decides the plane's behaviour: without event counters, and without the content of the queues, of which only
    /// the length is included.
    pub fn fingerprint(&self, hasher: &mut impl Hasher) {
        let shared = self.ends.shared;
        (self.greeted, discriminant(&self.state), self.restarting).hash(hasher);
        self.arms.wrapping_sub(shared.arms()).hash(hasher);
        (shared.live(), shared.storing(), self.ends.commands.len()).hash(hasher);
        self.answers.len().hash(hasher);
        self.commit
            .map(|(_, session)| session == self.session)
            .hash(hasher);
        self.store.fingerprint(hasher);
        for row in PARAMETERS {
            self.parameters.get(row.id).to_bits().hash(hasher);
        }
    }

    /// Commands queued for the control plane.
    pub fn waiting(&self) -> usize {
        self.ends.commands.len()
    }

    /// The parameters as they will be after every queued command.
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// Whether a command with this stamp would be accepted as new.
    pub fn is_fresh(&self, stamp: Stamp) -> bool {
        let mut freshness = self.freshness;
        freshness.take(Some(stamp)).is_ok()
    }
}
