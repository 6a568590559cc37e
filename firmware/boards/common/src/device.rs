//! The mechanism of a description on a board's encoder counters and motor outputs: what every real board has for a [`Mechanism`].

use mortise_mechanism::described::DescribedMechanism;
use mortise_mechanism::interface::{Drive, DriverFault, DriverFaultKind, Mechanism, Sensed};
use mortise_mechanism::joints::ENCODERS;
use mortise_protocol::limits::MAX_JOINTS;
use mortise_protocol::rig::Rig;

/// Encoders, motors and safety inputs of a board with [`MAX_JOINTS`] of the first two, in the order of the description's joints. Each call is part of the
/// 1 ms tick: bounded time, no blocking, no panics.
pub trait Hardware {
    /// Largest current a motor driver gives, A.
    const FULL_CURRENT_A: f32;

    /// Counts of the encoders since start or [`Self::restart_counts`].
    fn counts(&mut self) -> [i32; MAX_JOINTS];

    /// All counts are 0 from here on.
    fn restart_counts(&mut self);

    /// Sets the currents of all motors (A, signed), and switches the outputs on if they are off.
    fn drive(&mut self, currents: [f32; MAX_JOINTS]);

    /// Outputs off on return.
    fn off(&mut self);

    /// The stop input is open, was open since the last call, or the hardware cut the outputs by itself.
    fn stop_open(&mut self) -> bool;

    /// The supply is below what motors and sensors need.
    fn supply_low(&mut self) -> bool;

    /// First of `motors` motors whose driver reports a fault.
    fn driver_fault(&mut self, motors: usize) -> Option<u8>;
}

/// See the module.
pub struct Device<H> {
    hardware: H,
    /// `None` while no sound description is kept: nothing is known of the handle, and the board does not arm.
    mechanism: Option<DescribedMechanism>,
}

impl<H: Hardware> Device<H> {
    /// Motors off; counts begin as if the mechanism were in its home pose, which nobody knows until [`Mechanism::home`].
    pub fn new(hardware: H, rig: Option<&Rig>) -> Self {
        let fitted = rig.map(|rig| fitted(rig, H::FULL_CURRENT_A));
        Self {
            hardware,
            mechanism: fitted.and_then(|rig| DescribedMechanism::new(&rig, false).ok()),
        }
    }

    /// Motors the mechanism has.
    fn joints(&self) -> usize {
        self.mechanism
            .as_ref()
            .map_or(MAX_JOINTS, |mechanism| mechanism.joints().model().joints())
    }
}

/// What of a description such a board can do: no motor is given more than its driver's full current, so that a force keeps its direction; a wrist is not
/// sensed.
fn fitted(rig: &Rig, full_current: f32) -> Rig {
    let mut fitted = rig.clone();
    for joint in &mut fitted.joints {
        joint.current_limit = joint.current_limit.min(full_current);
    }
    fitted.wrist = None;
    fitted
}

impl<H: Hardware> Mechanism for Device<H> {
    const DESCRIBED: bool = true;

    fn sense(&mut self) -> Sensed {
        let mut counts = [0; ENCODERS];
        counts[..MAX_JOINTS].copy_from_slice(&self.hardware.counts());
        let sensed = match &mut self.mechanism {
            Some(mechanism) => mechanism.read(&counts),
            None => Sensed {
                referenced: false,
                ..Sensed::AT_REST
            },
        };
        let report = self.hardware.driver_fault(self.joints());
        Sensed {
            stop_open: self.hardware.stop_open(),
            supply_low: self.hardware.supply_low(),
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

    fn motors(&self) -> u8 {
        self.mechanism.as_ref().map_or(0, DescribedMechanism::motors)
    }

    fn counts(&self) -> [i32; ENCODERS] {
        self.mechanism
            .as_ref()
            .map_or([0; ENCODERS], DescribedMechanism::counts)
    }

    fn currents(&self) -> [f32; MAX_JOINTS] {
        self.mechanism
            .as_ref()
            .map_or([0.0; MAX_JOINTS], DescribedMechanism::driven)
    }

    fn home(&mut self) {
        self.hardware.restart_counts();
        if let Some(mechanism) = &mut self.mechanism {
            mechanism.reference(&[0; ENCODERS]);
        }
    }

    fn drive(&mut self, drive: Drive) {
        match &mut self.mechanism {
            Some(mechanism) => {
                let currents = mechanism.currents(drive);
                if drive == Drive::Off {
                    self.hardware.off();
                } else {
                    self.hardware.drive(currents);
                }
            }
            None => self.hardware.off(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rigs::{arm, paddle};
    use mortise_haptics::{Vec3, Wrench};

    /// A board made of memory.
    #[derive(Default)]
    struct Bench {
        counts: [i32; MAX_JOINTS],
        currents: Option<[f32; MAX_JOINTS]>,
        stop_open: bool,
        faults: [bool; MAX_JOINTS],
    }

    impl Hardware for Bench {
        const FULL_CURRENT_A: f32 = 1.0;

        fn counts(&mut self) -> [i32; MAX_JOINTS] {
            self.counts
        }

        fn restart_counts(&mut self) {
            self.counts = [0; MAX_JOINTS];
        }

        fn drive(&mut self, currents: [f32; MAX_JOINTS]) {
            self.currents = Some(currents);
        }

        fn off(&mut self) {
            self.currents = None;
        }

        fn stop_open(&mut self) -> bool {
            self.stop_open
        }

        fn supply_low(&mut self) -> bool {
            false
        }

        fn driver_fault(&mut self, motors: usize) -> Option<u8> {
            let faults = &self.faults[..motors];
            faults.iter().position(|&fault| fault).map(|axis| axis as u8)
        }
    }

    fn push(force: Vec3) -> Drive {
        Drive::Wrench(Wrench {
            force,
            torque: Vec3::ZERO,
        })
    }

    #[test]
    fn without_a_description_nothing_is_known_and_nothing_driven() {
        let mut device = Device::new(Bench::default(), None);
        device.home();
        assert!(!device.sense().referenced);
        device.drive(push(Vec3::X));
        assert_eq!(device.hardware.currents, None);
    }

    #[test]
    fn the_reference_is_known_from_home_on_and_lost_by_a_jump() {
        let mut device = Device::new(Bench::default(), Some(&arm()));
        device.hardware.counts = [40, -40, 7];
        assert!(!device.sense().referenced);
        device.home();
        let home = device.sense();
        assert!(home.referenced);
        assert_eq!(home.handle.position, {
            let fresh = Device::new(Bench::default(), Some(&arm()));
            fresh.mechanism.unwrap().joints().posture().position
        });
        device.hardware.counts[1] = 20_000;
        let jumped = device.sense();
        assert_eq!(jumped.encoder_jump, Some(1));
        assert!(!jumped.referenced && !device.sense().referenced);
    }

    /// 100 N takes more than any motor gives: all are scaled by one factor to the driver's limit, which is below the description's.
    #[test]
    fn no_motor_is_given_more_than_its_driver_has_and_the_force_keeps_its_direction() {
        let mut strong = arm();
        strong.ceilings.force = 20.0;
        let mut device = Device::new(Bench::default(), Some(&strong));
        device.home();
        device.sense();
        let force = Vec3::new(3.0, -14.0, 11.0);
        device.drive(push(force));
        let currents = device.hardware.currents.unwrap();
        let most = currents
            .iter()
            .fold(0.0f32, |most, current| most.max(current.abs()));
        assert!((0.999..=1.000_001).contains(&most), "{currents:?}");
        let joints = device.mechanism.as_ref().unwrap().joints();
        let torques = joints.torques(&currents);
        let wanted = Vec3::from_array(joints.posture().torques(force));
        assert!(torques.cross(wanted).length() <= 1e-5 * torques.length() * wanted.length());
        assert!(torques.dot(wanted) > 0.0);
        device.drive(Drive::Off);
        assert_eq!(device.hardware.currents, None);
    }

    #[test]
    fn a_motor_that_the_mechanism_does_not_have_reports_no_fault() {
        let mut device = Device::new(Bench::default(), Some(&paddle()));
        device.hardware.faults = [false, true, true];
        assert_eq!(device.sense().driver_fault, None);
        device.hardware.faults[0] = true;
        assert_eq!(device.sense().driver_fault.map(|fault| fault.axis), Some(0));
    }

    #[test]
    fn the_stop_input_is_seen_with_and_without_a_description() {
        for rig in [None, Some(arm())] {
            let mut device = Device::new(Bench::default(), rig.as_ref());
            device.hardware.stop_open = true;
            assert!(device.sense().stop_open);
        }
    }
}
