//! The arm as the application sees it: handle pose and velocity in, force on the handle out.

use mortise_firmware::board::{Drive, Mechanism, Sensed, TICK_S};
use mortise_haptics::{Pose, Quat, Twist, Vec3};
use nucleo_h743zi::drive::{AXES, currents};
use nucleo_h743zi::kinematics::Posture;
use nucleo_h743zi::rig::RIG;
use nucleo_h743zi::velocity::Estimator;

use crate::encoders::Encoders;
use crate::motors::Motors;

/// Encoders, kinematics and motors together.
pub struct HapticArm {
    encoders: Encoders,
    motors: Motors,
    estimators: [Estimator; AXES],
    /// Of the last `sense`: torques belong to it.
    posture: Posture,
}

impl HapticArm {
    /// Motors off, arm in its home posture.
    pub fn new(mut encoders: Encoders, motors: Motors) -> Self {
        let counts = encoders.read().map(|reading| reading.count);
        Self {
            encoders,
            motors,
            estimators: counts.map(Estimator::new),
            posture: posture(counts),
        }
    }
}

fn posture(counts: [i32; AXES]) -> Posture {
    let angle = |axis: usize| counts[axis] as f32 * RIG.radians_per_count(axis);
    RIG.arm.posture(Vec3::new(angle(0), angle(1), angle(2)))
}

impl Mechanism for HapticArm {
    const SIMULATED: bool = false;

    fn sense(&mut self) -> Sensed {
        let readings = self.encoders.read();
        self.posture = posture(readings.map(|reading| reading.count));
        let mut rates = Vec3::ZERO;
        for (axis, reading) in readings.iter().enumerate() {
            rates[axis] = self.estimators[axis].update(reading.count) * RIG.radians_per_count(axis) / TICK_S;
        }
        Sensed {
            // The gimbal's orientation is not sensed: the handle keeps the world's.
            handle: Pose::new(self.posture.position(), Quat::IDENTITY),
            twist: Twist {
                linear: self.posture.velocity(rates),
                angular: Vec3::ZERO,
            },
            stop_open: self.motors.stopped(),
            driver_fault: self.motors.driver_fault(),
            encoder_jump: readings
                .iter()
                .position(|reading| reading.jump)
                .map(|axis| axis as u8),
        }
    }

    fn drive(&mut self, drive: Drive) {
        match drive {
            Drive::Off => self.motors.off(),
            Drive::Wrench(wrench) => {
                let wanted = currents(&RIG.drivers, self.posture.torques(wrench.force));
                let setpoint = |axis: usize| RIG.drivers[axis].setpoint(wanted[axis]);
                self.motors.drive(core::array::from_fn(setpoint));
            }
        }
    }
}
