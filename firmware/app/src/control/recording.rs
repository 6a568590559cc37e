//! Inputs of every tick, for a recording that can be computed again to the bit.

use mortise_haptics::Twist;
use mortise_protocol::message::{Refusal, TickInput, WireTwist};

use super::ControlPlane;
use crate::board::{Clock, Mechanism};
use crate::channel::Recorded;
use crate::wire::{driver_to_wire, pose_to_wire};

impl<M: Mechanism, C: Clock> ControlPlane<'_, '_, M, C> {
    pub(super) fn set_recording(&mut self, on: bool) -> Result<(), Refusal> {
        (self.recording.on, self.recording.lost) = (on, 0);
        Ok(())
    }

    /// Queues the inputs of the tick that has just run; without space they are lost and counted.
    pub(super) fn record(&mut self) {
        if !self.recording.on {
            return;
        }
        if !self.ends.recorded.ready() {
            self.recording.lost = self.recording.lost.saturating_add(1);
            return;
        }
        let sensed = &self.sensed;
        let input = TickInput {
            handle: pose_to_wire(&sensed.handle),
            twist: twist_to_wire(&sensed.twist),
            bad_reading: self.replaced,
            stop_open: sensed.stop_open,
            supply_low: sensed.supply_low,
            impossible_posture: sensed.impossible_posture,
            referenced: sensed.referenced,
            driver: sensed.driver_fault.map(driver_to_wire),
            encoder_jump: sensed.encoder_jump,
            encoder_stuck: sensed.encoder_stuck,
            carried_out: self.recording.carried_out,
            stops: self.host.stops as u8,
            hash: self.reports.hash.value() as u32,
        };
        let recorded = Recorded {
            session: self.host.session,
            tick: self.tick,
            lost: self.recording.lost,
            count: self.mechanism.count(),
            input,
        };
        // Space was checked above.
        let _ = self.ends.recorded.enqueue(recorded);
    }
}

fn twist_to_wire(twist: &Twist) -> WireTwist {
    WireTwist {
        linear: twist.linear.to_array(),
        angular: twist.angular.to_array(),
    }
}
