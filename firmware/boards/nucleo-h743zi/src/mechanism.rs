//! The arm as the application sees it: handle pose and velocity in, force on the handle out.

use mortise_firmware::board::{Drive, DriverFault, DriverFaultKind, Mechanism, Sensed};
use mortise_haptics::{Pose, Quat, Twist, Vec3};
use mortise_mechanism::encoder_watch::{AxisTick, EncoderWatch, LOADED, probed};
use mortise_mechanism::velocity::{AdaptiveWindow, Estimator};
use nucleo_h743zi::drive::{AXES, currents};
use nucleo_h743zi::kinematics::Posture;
use nucleo_h743zi::rig::RIG;

use crate::encoders::Encoders;
use crate::motors::{self, Motors};

/// Amplitude of the encoders' probe, as a share of a motor's current limit, 0.28 N·m: twice a dry friction of 0.03 N·m (assumed), and 2.5 counts of
/// 2.6·10⁻⁴ rad at a lever of 0.245 m against a hand of 5,000 N/m, which take 0.26 N·m.
const PROBE_SHARE: f32 = 0.3;

/// Encoders, kinematics and motors together.
pub struct HapticArm {
    encoders: Encoders,
    motors: Motors,
    estimators: [AdaptiveWindow; AXES],
    /// Of the last `sense`: torques belong to it.
    posture: Posture,
    /// A part is felt.
    felt: bool,
    watch: EncoderWatch<AXES>,
    counts: [i32; AXES],
    /// Currents of the last `drive` without the probes, A.
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
            estimators: [AdaptiveWindow::AT_REST; AXES],
            posture: posture(counts),
            felt: false,
            watch: EncoderWatch::new(),
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
    fn sense(&mut self) -> Sensed {
        let readings = self.encoders.read();
        self.posture = posture(readings.map(|reading| reading.count));
        let mut rates = Vec3::ZERO;
        let mut jump = None;
        let mut ticks = [AxisTick {
            moved: 0,
            effort: 0.0,
            able: false,
        }; AXES];
        for (axis, reading) in readings.iter().enumerate() {
            let effort = self.currents[axis] / RIG.drivers[axis].current_limit;
            ticks[axis] = AxisTick {
                moved: reading.count.wrapping_sub(self.counts[axis]),
                effort,
                // Where the arm's end stops are is not known: only a joint that is pushed is judged.
                able: effort.abs() > LOADED,
            };
            if reading.jump && jump.is_none() {
                jump = Some(axis as u8);
            }
            self.counts[axis] = reading.count;
            rates[axis] = self.estimators[axis].update(ticks[axis].moved, RIG.radians_per_count(axis));
        }
        let encoder_stuck = if self.felt {
            self.watch.update(&ticks)
        } else {
            self.watch.rest();
            None
        };
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
            // Any three angles are a posture of this arm.
            impossible_posture: false,
            encoder_stuck,
            referenced: self.referenced,
        }
    }

    fn watch_encoders(&mut self, felt: bool) {
        self.felt = felt;
    }

    fn count(&self) -> [f32; 2] {
        let counts = core::array::from_fn(|axis| RIG.radians_per_count(axis).abs());
        let moved = self.posture.jacobian().abs() * Vec3::from_array(counts);
        [moved.max_element(), 0.0]
    }

    fn home(&mut self) {
        self.encoders.home();
        self.estimators = [AdaptiveWindow::AT_REST; AXES];
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
                let setpoint = |axis: usize| {
                    let (driver, current) = (&RIG.drivers[axis], self.currents[axis]);
                    let share = if self.felt { self.watch.share(axis) } else { 0.0 };
                    driver.setpoint(probed(current, PROBE_SHARE * driver.current_limit, share))
                };
                self.motors.drive(core::array::from_fn(setpoint));
            }
        }
    }
}
