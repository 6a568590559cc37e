//! The simulated mechanism: a handle with mass and friction, encoders of finite resolution, motors that saturate, and the operator model.
//!
//! Per axis m·dv/dt = F_motor + F_hand − c·v − f_c·sign(v), F_hand = k·(x_d − x) + b·(v_d − v) + push, and the same in rotation about the
//! handle's origin with an isotropic inertia. Integrated with [`SUBSTEPS`] backward-Euler steps a tick: springs and viscous damping are implicit,
//! Coulomb friction is solved exactly (it reduces the speed until it is zero), so any script is stable. Single precision and a fixed order of
//! operations: a PC and a Cortex-M7 compute the same bits.

use glam::{Quat, Vec3};
use mortise_haptics::{Pose, Twist, Wrench, rotation};
use mortise_mechanism::encoder::Counter;
use mortise_mechanism::encoder_watch::{
    AxisTick, EncoderWatch, STIFFEST_HAND, STIFFEST_WRIST, amplitude, probed,
};
use mortise_protocol::message::{HandScript, InputFault};

use crate::hand::{Hand, HandCommand, HandImpedance, small_turn};
use crate::input_faults::{AXES, InputScript, Wiring};
use mortise_mechanism::interface::{Drive, Mechanism, Sensed, Simulation, TICK_HZ, TICK_S};
use mortise_mechanism::velocity::{Estimator, InUse};

/// Steps in a tick.
pub const SUBSTEPS: u32 = 4;
/// Handle's mass, kg.
pub const MASS: f32 = 0.15;
/// Handle's inertia about its origin, kg·m².
pub const INERTIA: f32 = 1e-4;
/// Viscous friction, N·s/m. Above k_T·h/2 = 0.5 for the default coupling (Colgate–Schenkel).
pub const VISCOUS: f32 = 1.0;
/// Viscous friction in rotation, N·m·s/rad. Above k_R·h/2 = 0.00025 for the default coupling.
pub const ANGULAR_VISCOUS: f32 = 0.002;
/// Coulomb friction, N: 1 % of a push of 1 N.
pub const COULOMB: f32 = 0.01;
/// Coulomb friction in rotation, N·m.
pub const ANGULAR_COULOMB: f32 = 1e-4;
/// Resolution of the position, m.
pub const RESOLUTION: f32 = 5e-6;
/// Resolution of the angle, rad: 16 bits a turn.
pub const ANGULAR_RESOLUTION: f32 = core::f32::consts::TAU / 65_536.0;
/// Force along each axis at which the motors saturate, N.
pub const MOTOR_FORCE: f32 = 12.0;
/// Torque about each axis at which the motors saturate, N·m.
pub const MOTOR_TORQUE: f32 = 0.6;
/// Speed above which a reading is treated as a jump, m/s and rad/s: above any speed limit that can be set.
const JUMP_SPEED: f32 = 20.0;
const JUMP_ANGULAR_SPEED: f32 = 200.0;

/// Amplitude of the encoders' probe, N: 0.145.
const PROBE_FORCE: f32 = amplitude(STIFFEST_HAND, RESOLUTION, COULOMB);
/// The same about an axis, N·m: 0.006.
const PROBE_TORQUE: f32 = amplitude(STIFFEST_WRIST, ANGULAR_RESOLUTION, ANGULAR_COULOMB);

/// Upper bound of the counts by which a probe swings the handle in a hand at rest. Friction leaves the handle within [`COULOMB`]/k of the desired
/// position, so a probe may move it by 2·[`COULOMB`]/k from one side to the other: 50 µm or 10 counts in a hand of 400 N/m, 27 in one of 150 N/m; the
/// swing beyond its answer is about 4 counts at 400 N/m. `tests/encoder_watch.rs` tests hands from 50 to 5,000 N/m.
const SWING_COUNTS: i32 = 32;

/// A free handle with six motors; see the module.
#[derive(Clone, Debug)]
pub struct Simulated {
    /// Faults injected by tests.
    pub wiring: Wiring,
    script: InputScript,
    body: Body,
    encoders: Encoders,
    hand: Option<Hand>,
    hand_wrench: Wrench,
    /// Commanded wrench of the motors, and the actual one including the probe.
    driven: Wrench,
    motors: Wrench,
    /// Whether a part is rendered, and the encoder watch, which runs while it is.
    rendered: bool,
    watch: EncoderWatch<AXES>,
}

/// True state of the handle.
#[derive(Clone, Copy, Debug)]
struct Body {
    pose: Pose,
    twist: Twist,
}

#[derive(Clone, Copy, Debug)]
struct Encoders {
    position: [Counter; 3],
    /// Counts of the last reading.
    counts: [i32; 3],
    offset: [i32; 3],
    /// No axis jumped since the counters were set.
    referenced: bool,
    linear: [InUse; 3],
    angular: [InUse; 3],
    /// Counted orientation: follows the true one in whole counts about its own axes.
    orientation: Quat,
}

impl Default for Simulated {
    fn default() -> Self {
        Self::new()
    }
}

impl Simulated {
    /// At the world's origin, at rest, without an operator, motors off.
    pub const fn new() -> Self {
        Self {
            wiring: Wiring::SOUND,
            script: InputScript::new(),
            body: Body {
                pose: Pose::IDENTITY,
                twist: Twist::ZERO,
            },
            encoders: Encoders::new(),
            hand: None,
            hand_wrench: Wrench::ZERO,
            driven: Wrench::ZERO,
            motors: Wrench::ZERO,
            rendered: false,
            watch: EncoderWatch::swinging(SWING_COUNTS),
        }
    }

    /// True pose of the handle before the encoders round it, for tests.
    pub fn true_pose(&self) -> Pose {
        self.body.pose
    }

    /// Actual wrench of the motors, after saturation and with the encoders' probe; zero when off.
    pub fn motors(&self) -> Wrench {
        self.motors
    }

    /// The first encoder that does not follow its motor.
    fn dead_encoder(&mut self, moved: [i32; AXES]) -> Option<u8> {
        if !self.rendered {
            self.watch.rest();
            return None;
        }
        let forces = self.driven.force.to_array().map(|f| f / MOTOR_FORCE);
        let torques = self.driven.torque.to_array().map(|t| t / MOTOR_TORQUE);
        self.watch.update(&core::array::from_fn(|axis| AxisTick {
            moved: moved[axis],
            effort: if axis < 3 { forces[axis] } else { torques[axis - 3] },
            able: true,
        }))
    }
}

impl Body {
    /// One backward-Euler step; returns the hand's wrench in it.
    fn step(&mut self, motors: &Wrench, held: Option<&(HandImpedance, HandCommand)>) -> Wrench {
        const H: f32 = TICK_S / SUBSTEPS as f32;
        // Without an operator the stiffness is zero.
        let (impedance, command) = held
            .copied()
            .unwrap_or((HandImpedance::NONE, HandCommand::at(self.pose)));

        let apart = command.pose.position - self.pose.position;
        let pull = apart * impedance.stiffness + command.twist.linear * impedance.damping + command.push;
        let linear = implicit_velocity(
            self.twist.linear,
            motors.force + pull,
            Axis {
                inertia: MASS,
                viscous: VISCOUS,
                coulomb: COULOMB,
                damping: impedance.damping,
                stiffness: impedance.stiffness,
            },
            H,
        );
        let turn = rotation::log_continuous(
            command.pose.orientation * self.pose.orientation.conjugate(),
            Vec3::ZERO,
        );
        let twisting = turn * impedance.angular_stiffness + command.twist.angular * impedance.angular_damping;
        let angular = implicit_velocity(
            self.twist.angular,
            motors.torque + twisting,
            Axis {
                inertia: INERTIA,
                viscous: ANGULAR_VISCOUS,
                coulomb: ANGULAR_COULOMB,
                damping: impedance.angular_damping,
                stiffness: impedance.angular_stiffness,
            },
            H,
        );
        self.twist = Twist { linear, angular };
        self.pose = Pose {
            position: self.pose.position + linear * H,
            orientation: unit(
                rotation::exp((angular * H).clamp_length_max(rotation::EXP_MAX)) * self.pose.orientation,
            ),
        };
        Wrench {
            force: pull - linear * (impedance.damping + H * impedance.stiffness),
            torque: twisting - angular * (impedance.angular_damping + H * impedance.angular_stiffness),
        }
    }
}

struct Axis {
    inertia: f32,
    viscous: f32,
    coulomb: f32,
    damping: f32,
    stiffness: f32,
}

/// v' of m·(v' − v)/h = load − (c + b + h·k)·v' − f_c·v'/|v'|, `load` with the spring's force at the old position.
fn implicit_velocity(v: Vec3, load: Vec3, axis: Axis, h: f32) -> Vec3 {
    let mass = axis.inertia + h * (axis.viscous + axis.damping + h * axis.stiffness);
    let momentum = v * axis.inertia + load * h;
    let size2 = momentum.length_squared();
    let friction = h * axis.coulomb;
    if size2 <= friction * friction {
        return Vec3::ZERO;
    }
    momentum * ((1.0 - friction / libm::sqrtf(size2)) / mass)
}

fn unit(q: Quat) -> Quat {
    q * (1.5 - 0.5 * q.length_squared())
}

impl Encoders {
    const fn new() -> Self {
        let farthest = (JUMP_SPEED * TICK_S / RESOLUTION) as u32;
        Self {
            position: [Counter::new(farthest); 3],
            counts: [0; 3],
            offset: [0; 3],
            referenced: true,
            linear: [InUse::AT_REST; 3],
            angular: [InUse::AT_REST; 3],
            orientation: Quat::IDENTITY,
        }
    }

    /// Reads the true pose through `wiring`.
    fn read(&mut self, pose: &Pose, wiring: &Wiring) -> Reading {
        let mut jump = None;
        let mut steps = [0; AXES];
        let (mut position, mut linear) = ([0.0; 3], [0.0; 3]);
        for (axis, x) in pose.position.to_array().into_iter().enumerate() {
            self.offset[axis] = self.offset[axis].saturating_add(wiring.glitch[axis]);
            let count = if wiring.stuck[axis] {
                self.counts[axis]
            } else {
                // A float beyond the counter's range saturates.
                (rounded(x / RESOLUTION) as i32).saturating_add(self.offset[axis])
            };
            self.counts[axis] = count;
            let step = self.position[axis].update(count);
            if step.jumped && jump.is_none() {
                jump = Some(axis as u8);
            }
            steps[axis] = step.counts;
            position[axis] = count as f32 * RESOLUTION;
            linear[axis] = self.linear[axis].update(step.counts, RESOLUTION);
        }
        let counted = Pose {
            position: Vec3::ZERO,
            orientation: self.orientation,
        };
        let turned = small_turn(counted, *pose);
        let mut moved = [0.0; 3];
        let mut angular = [0.0; 3];
        for (axis, angle) in turned.to_array().into_iter().enumerate() {
            let whole = rounded(angle / ANGULAR_RESOLUTION) + wiring.glitch[3 + axis] as f32;
            let counts = if wiring.stuck[3 + axis] { 0.0 } else { whole };
            moved[axis] = counts * ANGULAR_RESOLUTION;
            // A float beyond the range saturates.
            steps[3 + axis] = counts as i32;
            if moved[axis].abs() > JUMP_ANGULAR_SPEED * TICK_S && jump.is_none() {
                jump = Some(3 + axis as u8);
            }
            angular[axis] = self.angular[axis].update(steps[3 + axis], ANGULAR_RESOLUTION);
        }
        self.orientation = unit(rotation::exp(Vec3::from_array(moved)) * self.orientation);
        let measured = Pose {
            position: Vec3::from_array(position),
            orientation: self.orientation,
        };
        let twist = Twist {
            linear: Vec3::from_array(linear),
            angular: Vec3::from_array(angular),
        };
        self.referenced &= jump.is_none();
        Reading {
            handle: measured,
            twist,
            jump,
            steps,
        }
    }
}

/// Encoder readings of one tick.
struct Reading {
    handle: Pose,
    twist: Twist,
    jump: Option<u8>,
    /// Counts each axis moved.
    steps: [i32; AXES],
}

/// The nearest integer, halves away from zero, without a library call; values above 2²³ are returned unchanged.
fn rounded(x: f32) -> f32 {
    if x.abs() >= 8_388_608.0 || x.is_nan() {
        return x;
    }
    (if x < 0.0 { x - 0.5 } else { x + 0.5 }) as i32 as f32
}

impl Mechanism for Simulated {
    fn sense(&mut self) -> Sensed {
        let wiring = self.script.advance(self.wiring);
        self.wiring.glitch = [0; AXES];
        let reading = self.encoders.read(&self.body.pose, &wiring);
        let encoder_stuck = self.dead_encoder(reading.steps);
        wiring.through(Sensed {
            handle: reading.handle,
            twist: reading.twist,
            encoder_jump: reading.jump,
            encoder_stuck,
            referenced: self.encoders.referenced,
            ..Sensed::AT_REST
        })
    }

    fn drive(&mut self, drive: Drive) {
        let (force, torque) = (Vec3::splat(MOTOR_FORCE), Vec3::splat(MOTOR_TORQUE));
        self.driven = match drive {
            // It has axes in place of joints.
            Drive::Off | Drive::Joint { .. } => Wrench::ZERO,
            Drive::Wrench(w) => Wrench {
                force: w.force.clamp(-force, force),
                torque: w.torque.clamp(-torque, torque),
            },
        };
        self.motors = self.driven;
        if drive == Drive::Off || !self.rendered {
            return;
        }
        for axis in 0..3 {
            let (force, torque) = (&mut self.motors.force[axis], &mut self.motors.torque[axis]);
            *force = probed(*force, PROBE_FORCE, self.watch.share(axis));
            *torque = probed(*torque, PROBE_TORQUE, self.watch.share(3 + axis));
        }
    }

    fn watch_encoders(&mut self, rendered: bool) {
        self.rendered = rendered;
    }

    fn count(&self) -> [f32; 2] {
        [RESOLUTION, ANGULAR_RESOLUTION]
    }

    /// The operator model knows the handle's exact position.
    fn home(&mut self) {
        self.encoders = Encoders {
            orientation: self.body.pose.orientation,
            ..Encoders::new()
        };
    }

    fn simulation(&mut self) -> Option<&mut dyn Simulation> {
        Some(self)
    }
}

impl Simulation for Simulated {
    fn advance(&mut self) {
        let held = self.hand.as_mut().map(|hand| (hand.impedance, hand.advance()));
        let mut sum = Wrench::ZERO;
        for _ in 0..SUBSTEPS {
            let hand = self.body.step(&self.motors, held.as_ref());
            sum = sum + hand;
        }
        let share = 1.0 / SUBSTEPS as f32;
        self.hand_wrench = Wrench {
            force: sum.force * share,
            torque: sum.torque * share,
        };
    }

    fn hand(&self) -> Option<Wrench> {
        Some(self.hand_wrench)
    }

    fn set_hand(&mut self, script: Option<&HandScript>) {
        self.hand = script.and_then(Hand::new);
    }

    fn set_input_faults(&mut self, faults: &[InputFault]) {
        self.script.start(faults);
    }

    fn reset(&mut self) -> Option<Pose> {
        *self = Self {
            wiring: self.wiring,
            ..Self::new()
        };
        Some(self.body.pose)
    }
}

// Speeds are counted per tick.
const _: () = assert!(TICK_HZ == 1000);
