//! Sensor readings, and the faults found in them.

use mortise_mechanism::hardware_limits::is_outside;
use mortise_protocol::message::Fault;

use super::ControlPlane;
use crate::board::{Clock, DriverFaultKind, Mechanism};
use crate::parameters::Ticks;
use crate::safety::{Event as SafetyEvent, Motors, Safety};

impl<M: Mechanism, C: Clock> ControlPlane<'_, '_, M, C> {
    /// Reads the sensors; values that are not finite are replaced by the last valid ones, and [`Self::watch`] reports a fault.
    pub(super) fn sense(&mut self) {
        let last = self.sensed;
        self.sensed = self.mechanism.sense();
        self.replaced = !(self.sensed.handle.is_finite() && self.sensed.twist.is_finite());
        if self.replaced {
            self.sensed.handle = last.handle;
            self.sensed.twist = last.twist;
        }
    }

    /// The fault, if any, in the last readings that forbids driving the motors while it persists.
    pub(super) fn persistent_cause(&self) -> Option<Fault> {
        // First, because a falling supply may also open the stop input and trip the drivers.
        if self.sensed.supply_low {
            return Some(Fault::SupplyLow);
        }
        if self.sensed.stop_open {
            return Some(Fault::StopInput);
        }
        if let Some(report) = self.sensed.driver_fault {
            let axis = report.axis;
            return Some(match report.kind {
                DriverFaultKind::Any => Fault::Driver { axis },
                DriverFaultKind::OverCurrent => Fault::OverCurrent { axis },
                DriverFaultKind::OverTemperature => Fault::OverTemperature { axis },
            });
        }
        self.replaced.then_some(Fault::BadReading)
    }

    /// Checks for faults, most severe first, and steps the safety state machine.
    pub(super) fn watch(&mut self, missed: u32) {
        self.late.missed_total = self.late.missed_total.saturating_add(missed);
        self.reports.statistics.missed_ticks = self.reports.statistics.missed_ticks.saturating_add(missed);
        self.late.missed_in_row = if missed == 0 {
            0
        } else {
            self.late.missed_in_row.saturating_add(missed)
        };
        self.listen();
        if self.safety == Safety::Boot {
            self.apply(SafetyEvent::Ready);
        }
        self.apply(if self.sensed.referenced {
            SafetyEvent::Referenced
        } else {
            SafetyEvent::ReferenceLost
        });
        if let Some(fault) = self.persistent_cause().or_else(|| self.live_cause()) {
            self.apply(SafetyEvent::Fault(fault));
        }
    }

    /// The fault, if any, among those that are faults only while motors are driven.
    fn live_cause(&self) -> Option<Fault> {
        if !self.safety.live() {
            return None;
        }
        if let Some(axis) = self.sensed.encoder_jump {
            return Some(Fault::EncoderJump { axis });
        }
        if self.sensed.impossible_posture {
            return Some(Fault::ImpossiblePosture);
        }
        if !self.sensed.referenced {
            return Some(Fault::ReferenceLost);
        }
        if let Some(axis) = self.sensed.encoder_stuck {
            return Some(Fault::EncoderStuck { axis });
        }
        let limit = self.settings.safety.speed_m_per_s;
        if self.sensed.twist.linear.length_squared() > limit * limit {
            return Some(Fault::OverSpeed);
        }
        let limit = self.settings.safety.angular_speed_rad_per_s;
        if self.sensed.twist.angular.length_squared() > limit * limit {
            return Some(Fault::AngularOverSpeed);
        }
        if is_outside(self.sensed.handle.position, self.settings.safety.workspace_m) {
            return Some(Fault::Workspace);
        }
        let overrun = u32::from(self.overrun_ticks);
        if overrun > 0 && self.late.missed_in_row >= overrun {
            return Some(Fault::TickOverrun);
        }
        // Not while fading: a host that disarmed may disconnect before the fade is over.
        let silent = Ticks(self.late.silent_ticks) > self.settings.safety.host_timeout
            && self.safety.motors() != Motors::Fading;
        silent.then_some(Fault::HostSilent {
            silent_ms: self.late.silent_ticks.min(u32::from(u16::MAX)) as u16,
        })
    }

    fn listen(&mut self) {
        let heard = self.ends.shared.heard();
        if heard != self.late.heard || self.lockstep.on || !self.safety.live() {
            self.late.heard = heard;
            self.late.silent_ticks = 0;
        } else {
            self.late.silent_ticks = self.late.silent_ticks.saturating_add(1);
        }
    }
}
