//! The described mechanism on this board's encoders and motors.

use mortise_mechanism::described::DescribedMechanism;
use mortise_mechanism::interface::{Drive, DriverFault, DriverFaultKind, Mechanism, Sensed};
use mortise_mechanism::joints::ENCODERS;
use mortise_protocol::rig::Rig;
use nucleo_h743zi::drive::{AXES, Setpoint, fitted};

use crate::encoders::Encoders;
use crate::motors::{self, Motors};

/// Encoders, described mechanism and motors together.
pub struct Device {
    encoders: Encoders,
    motors: Motors,
    /// `None` while no sound description is kept: nothing is known of the handle, and the board does not arm.
    mechanism: Option<DescribedMechanism>,
}

impl Device {
    /// Motors off; counts begin as if the mechanism were in its home pose, which nobody knows until [`Mechanism::home`].
    pub fn new(encoders: Encoders, motors: Motors, rig: Option<&Rig>) -> Self {
        Self {
            encoders,
            motors,
            mechanism: rig.and_then(|rig| DescribedMechanism::new(&fitted(rig), false).ok()),
        }
    }

    /// Motors the mechanism has.
    fn joints(&self) -> usize {
        self.mechanism
            .as_ref()
            .map_or(AXES, |mechanism| mechanism.joints().model().joints())
    }
}

impl Mechanism for Device {
    const DESCRIBED: bool = true;

    fn sense(&mut self) -> Sensed {
        let mut counts = [0; ENCODERS];
        counts[..AXES].copy_from_slice(&self.encoders.read());
        let sensed = match &mut self.mechanism {
            Some(mechanism) => mechanism.read(&counts),
            None => Sensed {
                referenced: false,
                ..Sensed::AT_REST
            },
        };
        let report = self.motors.driver_fault(self.joints());
        Sensed {
            stop_open: self.motors.stopped(),
            supply_low: motors::supply_is_low(),
            // One line for current and heat.
            driver_fault: report.map(|axis| DriverFault {
                axis,
                kind: DriverFaultKind::Any,
            }),
            ..sensed
        }
    }

    fn watch_encoders(&mut self, felt: bool) {
        if let Some(mechanism) = &mut self.mechanism {
            mechanism.watch_encoders(felt);
        }
    }

    fn count(&self) -> [f32; 2] {
        self.mechanism
            .as_ref()
            .map_or([0.0; 2], |mechanism| mechanism.joints().count_at_handle())
    }

    fn home(&mut self) {
        self.encoders.home();
        if let Some(mechanism) = &mut self.mechanism {
            mechanism.reference(&[0; ENCODERS]);
        }
    }

    fn drive(&mut self, drive: Drive) {
        match (&mut self.mechanism, drive) {
            (Some(mechanism), Drive::Wrench(_)) => {
                let currents = mechanism.currents(drive);
                self.motors.drive(currents.map(Setpoint::of));
            }
            (mechanism, _) => {
                self.motors.off();
                if let Some(mechanism) = mechanism {
                    mechanism.currents(Drive::Off);
                }
            }
        }
    }
}
