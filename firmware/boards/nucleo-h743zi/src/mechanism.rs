//! The arm as the application sees it: handle pose and velocity in, force on the handle out.

use mortise_firmware::board::{Drive, DriverFault, DriverFaultKind, Mechanism, Sensed, TICK_S};
use mortise_firmware::encoder::Stall;
use mortise_haptics::{Pose, Quat, Twist, Vec3};
use nucleo_h743zi::drive::{AXES, currents};
use nucleo_h743zi::kinematics::Posture;
use nucleo_h743zi::rig::RIG;
use nucleo_h743zi::velocity::Estimator;

use crate::encoders::Encoders;
use crate::motors::{self, Motors};

/// Ticks without a count under load that are a stall. A hand trembles at 8 Hz and more: it never holds still for so long.
const STALL_TICKS: u16 = 200;

/// Encoders, kinematics and motors together.
pub struct HapticArm {
    encoders: Encoders,
    motors: Motors,
    estimators: [Estimator; AXES],
    /// Of the last `sense`: torques belong to it.
    posture: Posture,
    stalls: [Stall; AXES],
    counts: [i32; AXES],
    /// Currents of the last `drive`, A.
    currents: [f32; AXES],
    /// The arm was in its home posture when told so, and nothing jumped since. Counting encoders know nothing at power-on.
    referenced: bool,
}

impl HapticArm {
    /// Motors off; counts begin as if the arm were in its home posture, which nobody knows until [`Mechanism::home`].
    pub fn new(mut encoders: Encoders, motors: Motors) -> Self {
        let counts = encoders.read().map(|reading| reading.count);
        Self {
            encoders,
            motors,
            estimators: counts.map(Estimator::new),
            posture: posture(counts),
            stalls: [Stall::new(STALL_TICKS); AXES],
            counts,
            currents: [0.0; AXES],
            referenced: false,
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
        let (mut jump, mut stuck) = (None, None);
        for (axis, reading) in readings.iter().enumerate() {
            let moved = reading.count != self.counts[axis];
            let loaded = self.currents[axis].abs() > 0.5 * RIG.drivers[axis].current_limit;
            if self.stalls[axis].update(moved, loaded) {
                stuck = Some(axis as u8);
            }
            if reading.jump && jump.is_none() {
                jump = Some(axis as u8);
            }
            self.counts[axis] = reading.count;
            rates[axis] = self.estimators[axis].update(reading.count) * RIG.radians_per_count(axis) / TICK_S;
        }
        self.referenced &= jump.is_none();
        Sensed {
            // The gimbal's orientation is not sensed: the handle keeps the world's.
            handle: Pose::new(self.posture.position(), Quat::IDENTITY),
            twist: Twist {
                linear: self.posture.velocity(rates),
                angular: Vec3::ZERO,
            },
            stop_open: self.motors.stopped(),
            supply_low: motors::supply_is_low(),
            // One line for current and heat.
            driver_fault: self.motors.driver_fault().map(|axis| DriverFault {
                axis,
                kind: DriverFaultKind::Any,
            }),
            encoder_jump: jump,
            encoder_stuck: stuck,
            referenced: self.referenced,
        }
    }

    fn count(&self) -> [f32; 2] {
        let counts = core::array::from_fn(|axis| RIG.radians_per_count(axis).abs());
        let moved = self.posture.jacobian().abs() * Vec3::from_array(counts);
        [moved.max_element(), 0.0]
    }

    fn home(&mut self) {
        self.encoders.home();
        self.estimators = RIG.home_counts.map(Estimator::new);
        self.counts = RIG.home_counts;
        self.referenced = true;
    }

    fn drive(&mut self, drive: Drive) {
        match drive {
            Drive::Off => {
                self.currents = [0.0; AXES];
                self.motors.off();
            }
            Drive::Wrench(wrench) => {
                self.currents = currents(&RIG.drivers, self.posture.torques(wrench.force));
                let setpoint = |axis: usize| RIG.drivers[axis].setpoint(self.currents[axis]);
                self.motors.drive(core::array::from_fn(setpoint));
            }
        }
    }
}
