//! What decides how the link plane goes on, for the enumeration of message orders: equal fingerprints, equal behaviour.

use core::mem::discriminant;

use core::hash::{Hash, Hasher};

use mortise_protocol::frame::Stamp;
use mortise_protocol::parameter::PARAMETERS;

use super::LinkPlane;
use crate::board::Flash;
use crate::parameters::Parameters;

impl<'s, F: Flash<'s>> LinkPlane<'_, 's, F> {
    /// Adds the plane's state to `hasher`, as far as it decides what the plane does: without counters of what was, and without the content of the
    /// queues, of which only the length is seen.
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

    /// Commands that wait for the control plane.
    pub fn waiting(&self) -> usize {
        self.ends.commands.len()
    }

    /// The parameters as they will be when every waiting command is carried out.
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// Whether a command with this stamp would be taken as new.
    pub fn is_fresh(&self, stamp: Stamp) -> bool {
        let mut freshness = self.freshness;
        freshness.take(Some(stamp)).is_ok()
    }
}
