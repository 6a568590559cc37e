//! Fingerprint of the link plane's state, for the enumeration of message orders: equal fingerprints imply equal behaviour.

use core::hash::{Hash, Hasher};

use heapless::Vec;
use mortise_protocol::frame::Stamp;
use mortise_protocol::parameter::ParameterId;

use super::LinkPlane;
use crate::board::Flash;
use crate::channel::{EVENTS, Event, Reply};
use crate::parameters::Parameters;

impl<'s, F: Flash<'s>> LinkPlane<'_, 's, F> {
    /// Adds to `hasher` the state that decides the plane's behaviour, and the queued events, relative to the scene in use by the control plane:
    /// without event counters, without the state last reported, which only words a refusal, and without the lengths of the queues of events and
    /// answers. Takes the events out of the queue, so the planes must be dropped or restored afterwards.
    pub fn fingerprint(&mut self, scene_number: u32, hasher: &mut impl Hasher) {
        let shared = self.ends.shared;
        let flags = [self.greeted, self.restarting, shared.live(), shared.storing()];
        (flags, self.arms.wrapping_sub(shared.arms())).hash(hasher);
        self.store.fingerprint(scene_number, hasher);
        self.parameters.fingerprint(hasher);
        let mut values: Vec<(ParameterId, u32), EVENTS> = Vec::new();
        while let Some(event) = self.ends.events.dequeue() {
            match event {
                // The host's, which needs none of it.
                Event::State { .. }
                | Event::Fault { .. }
                | Event::Reply {
                    reply: Reply::Done | Reply::Refused(_),
                    ..
                } => {}
                Event::Reply { session, .. } if session != self.session => {}
                Event::SceneTaken(taken) => (0u8, taken.is_ok()).hash(hasher),
                Event::Reply {
                    reply: Reply::Parameter { id, value },
                    ..
                } => {
                    // No longer than the queue.
                    let _ = values.push((id, value.to_bits()));
                }
                Event::Reply {
                    reply: Reply::MayRestart,
                    ..
                } => 1u8.hash(hasher),
                // Equal to no other: the enumeration causes none of these.
                Event::Reply { seq, session, .. } => (2u8, seq, session).hash(hasher),
            }
        }
        // Their order among the others does not count.
        values.hash(hasher);
    }

    /// Commands queued for the control plane.
    pub fn waiting(&self) -> usize {
        self.ends.commands.len()
    }

    /// Events queued by the control plane.
    pub fn reported(&self) -> usize {
        self.ends.events.len()
    }

    /// Own answers that wait for space on the wire.
    pub fn unsent(&self) -> usize {
        self.answers.len()
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
