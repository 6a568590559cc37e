//! Reports from the control plane to the link plane: replies, state changes, faults, statistics, telemetry.

use mortise_haptics::Wrench;
use mortise_protocol::message::{Flags, Statistics, Telemetry};

use super::ControlPlane;
use crate::board::{Clock, Mechanism};
use crate::channel::{EVENTS_AT_ONCE, Event, Reply};
use crate::wire::{guidance_to_wire, pairs_to_wire, pose_to_wire, wrench_to_wire};

impl<M: Mechanism, C: Clock> ControlPlane<'_, '_, M, C> {
    pub(super) fn lockstep_has_room(&self) -> bool {
        let events = self.ends.events.capacity() - self.ends.events.len() >= EVENTS_AT_ONCE;
        let samples = self.telemetry.every == 0 || self.ends.samples.ready();
        events && samples && (!self.recording.on || self.ends.recorded.ready())
    }

    pub(super) fn send(&mut self, event: Event) {
        // Commands are taken only when there is space, and `report` checks first.
        let _ = self.ends.events.enqueue(event);
    }

    /// Reports a fault and a changed state to the link plane when the queue has space, else at the next tick.
    pub(super) fn report(&mut self) {
        if let Some((tick, fault)) = self.reports.fault
            && self.ends.events.ready()
        {
            self.reports.fault = None;
            self.send(Event::Fault { tick, fault });
        }
        if self.reports.safety != self.safety && self.ends.events.ready() {
            self.reports.safety = self.safety;
            self.send(Event::State {
                tick: self.tick,
                state: self.safety.reported(),
            });
        }
        self.answer_test();
    }

    pub(super) fn reply(&mut self, seq: u16, session: u32, reply: Reply) {
        self.send(Event::Reply { seq, session, reply });
    }

    pub(super) fn ran(&mut self) {
        let ran = Reply::Ran {
            tick: self.tick,
            state_hash: self.reports.hash.value(),
        };
        self.reply(self.lockstep.run_seq, self.host.session, ran);
    }

    pub(super) fn send_statistics(&mut self, seq: u16, reset: bool) {
        let statistics = Statistics {
            state_hash: self.reports.hash.value(),
            ..self.reports.statistics
        };
        self.reply(seq, self.host.session, Reply::Statistics { statistics, reset });
        if reset {
            self.reports.statistics = Statistics::default();
        }
    }

    /// Queues a telemetry sample when one is due.
    pub(super) fn sample(&mut self) {
        if self.telemetry.every == 0 {
            return;
        }
        self.telemetry.left = self.telemetry.left.saturating_sub(1);
        if self.telemetry.left > 0 {
            return;
        }
        self.telemetry.left = self.telemetry.every;
        if !self.ends.samples.ready() {
            self.ends.shared.drop_sample();
            return;
        }
        let sample = self.telemetry();
        let _ = self.ends.samples.enqueue(sample);
    }

    fn telemetry(&mut self) -> Telemetry {
        let hand = self
            .mechanism
            .simulation()
            .and_then(|simulation| simulation.hand());
        let output = self.rendered.output.as_ref();
        let mut flags = output.map_or(Flags::empty(), |o| o.work.flags);
        flags.insert_if(self.replaced, Flags::BAD_INPUT);
        flags.insert_if(output.is_some_and(|o| o.pairs.is_full()), Flags::PAIRS);
        Telemetry {
            tick: self.tick,
            handle: pose_to_wire(&self.sensed.handle),
            object: self
                .ends
                .law
                .grabbed()
                .zip(self.ends.law.object())
                .map(|(part, (pose, _))| (part, pose_to_wire(&pose))),
            wrench: wrench_to_wire(&self.rendered.commanded),
            contact: wrench_to_wire(&output.map_or(Wrench::ZERO, |o| o.contact)),
            hand: hand.as_ref().map(wrench_to_wire),
            points: output.map_or(0, |o| o.work.points.min(u32::from(u16::MAX)) as u16),
            flags: flags.bits(),
            missed: self.late.missed_total,
            dropped: self.ends.shared.dropped(),
            guidance: output.map(|o| guidance_to_wire(&o.guidance)).unwrap_or_default(),
            pairs: output.map(|o| pairs_to_wire(&o.pairs)).unwrap_or_default(),
            // Measured last, so that it covers all work before it.
            cost: self.cost(),
        }
    }
}
