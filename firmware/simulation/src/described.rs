//! Simulated mechanism with the links, encoders, motors and friction of a rig's description, moved by the operator model.
//!
//! In joint space, with M = diag(I) + m·JᵀJ (joint inertias and the handle's mass),
//!
//! ```text
//! M·dθ̇/dt = τ_motor + Jᵀ·F_hand − diag(c)·θ̇ − f_c∘sign(θ̇),   F_hand = k·(x_d − x) + b·(v_d − v) + push
//! ```
//!
//! Integrated like the free handle ([`crate::simulated`]) with [`SUBSTEPS`] backward-Euler steps a tick: one 3×3 system with springs, dampers and
//! viscous friction implicit and J frozen over the step. Dry friction is then the impulse, of all those within ±h·f_c at the joints, that leaves the
//! least energy (the principle of maximum dissipation), so that a joint sticks exactly where its own friction can hold the load. Joints end at stops
//! without rebound; a linkage stops before it is fully extended. A wrist is moved by the hand's orientation through the same equation. Sensing and
//! currents are [`DescribedMechanism`], the code of a real rig.

use glam::{Mat3, Vec3};
use mortise_haptics::{Pose, Wrench, rotation};
use mortise_mechanism::joints::{ENCODERS, Joints};
use mortise_mechanism::kinematics::Posture;
use mortise_protocol::limits::MAX_JOINTS;
use mortise_protocol::message::{HandScript, InputFault};
use mortise_protocol::rig::{Rig, RigFault};

use crate::hand::{Hand, HandCommand, HandImpedance};
use crate::input_faults::{AXES, InputScript, Wiring};
use crate::simulated::SUBSTEPS;
use mortise_mechanism::described::DescribedMechanism;
use mortise_mechanism::interface::{Drive, Mechanism, Sensed, Simulation, TICK_S};

/// Inertia of the handle about a wrist axis, kg·m², and its bearings' friction, N·m·s/rad.
const WRIST_INERTIA: f32 = 1e-5;
const WRIST_VISCOUS: f32 = 1e-3;
/// Isotropy at which a linkage is at its stop.
const STOP: f32 = 0.03;
/// Limit of any joint's rate, rad/s: keeps a step below a turn for any hand.
const RATE_MAX: f32 = 2_000.0;
/// Iterations over the joints in the friction solver. Each dissipates energy, so their number affects accuracy alone.
const FRICTION_ROUNDS: usize = 12;

/// The simulated mechanism of a description; see the module.
#[derive(Clone, Debug)]
pub struct Described {
    /// Faults injected by tests.
    pub wiring: Wiring,
    script: InputScript,
    links: Links,
    mechanism: DescribedMechanism,
    counts: [i32; ENCODERS],
    offsets: [i32; ENCODERS],
    hand: Option<Hand>,
    hand_wrench: Wrench,
    /// Motor currents, with the encoders' probes.
    currents: [f32; MAX_JOINTS],
    /// The wiring in this tick, scripted faults included.
    wired: Wiring,
    /// Senses of encoders and motors in the description.
    described: Senses,
}

/// Whether encoders and motors are described as reversed; wrist axes have their sense in their counts.
#[derive(Clone, Copy, Debug)]
struct Senses {
    encoders: [bool; ENCODERS],
    motors: [bool; MAX_JOINTS],
}

/// True state of the mechanism.
#[derive(Clone, Debug)]
struct Links {
    inertia: Vec3,
    viscous: Vec3,
    coulomb: Vec3,
    mass: f32,
    range: [[f32; 2]; MAX_JOINTS],
    start: [f32; ENCODERS],
    angles: [f32; MAX_JOINTS],
    wrist: [f32; 3],
    rates: Vec3,
    wrist_rates: Vec3,
    posture: Posture,
}

impl Described {
    /// In its home pose, at rest, without an operator, motors off.
    ///
    /// # Errors
    /// See [`mortise_mechanism::kinematics::Model::new`].
    pub fn new(rig: &Rig) -> Result<Self, RigFault> {
        let mechanism = DescribedMechanism::new(rig, true)?;
        let of = |number: usize, value: fn(&mortise_protocol::rig::Joint) -> f32, else_: f32| {
            rig.joints.get(number).map_or(else_, value)
        };
        // An absent joint has an inertia and no force on it.
        let each = |value: fn(&mortise_protocol::rig::Joint) -> f32, else_: f32| {
            Vec3::new(of(0, value, else_), of(1, value, else_), of(2, value, else_))
        };
        let mut range = [[0.0; 2]; MAX_JOINTS];
        let mut start = [0.0; ENCODERS];
        let mut described = Senses {
            encoders: [false; ENCODERS],
            motors: [false; MAX_JOINTS],
        };
        for (number, joint) in rig.joints.iter().enumerate() {
            range[number] = joint.range;
            start[number] = joint.home;
            described.encoders[number] = joint.encoder_reversed;
            described.motors[number] = joint.motor_reversed;
        }
        let wrist = rig.wrist.map_or([0.0; 3], |wrist| wrist.home);
        start[MAX_JOINTS..].copy_from_slice(&wrist);
        let posture = *mechanism.joints().posture();
        Ok(Self {
            wiring: Wiring::SOUND,
            script: InputScript::new(),
            links: Links {
                inertia: each(|joint| joint.inertia, 1.0),
                viscous: each(|joint| joint.viscous, 0.0),
                coulomb: each(|joint| joint.coulomb, 0.0),
                mass: rig.handle_mass,
                range,
                start,
                angles: [start[0], start[1], start[2]],
                wrist,
                rates: Vec3::ZERO,
                wrist_rates: Vec3::ZERO,
                posture,
            },
            mechanism,
            counts: [0; ENCODERS],
            offsets: [0; ENCODERS],
            hand: None,
            hand_wrench: Wrench::ZERO,
            currents: [0.0; MAX_JOINTS],
            wired: Wiring::SOUND,
            described,
        })
    }

    /// True pose of the handle before the encoders round it, for tests.
    pub fn true_pose(&self) -> Pose {
        self.links.pose()
    }

    /// Kinetic energy of links and handle, J, for tests.
    pub fn kinetic_energy(&self) -> f32 {
        self.links.kinetic_energy()
    }

    /// Motor currents, A, with the encoders' probes.
    pub fn currents(&self) -> [f32; MAX_JOINTS] {
        self.currents
    }

    /// The encoders' counts as seen through `wiring`.
    fn count(&mut self, wiring: &Wiring) {
        for encoder in 0..ENCODERS {
            // As many encoders as the free handle has axes.
            self.offsets[encoder] = self.offsets[encoder].saturating_add(wiring.glitch[encoder]);
            if !wiring.stuck[encoder] {
                self.counts[encoder] = self
                    .true_count(encoder, wiring)
                    .saturating_add(self.offsets[encoder]);
            }
        }
    }

    /// Count at an input, from the true angle of the joint whose encoder is wired to it.
    fn true_count(&self, encoder: usize, wiring: &Wiring) -> i32 {
        let source = usize::from(wiring.encoders[encoder]);
        let count = self.mechanism.joints().count(source, self.links.angle(source));
        let described = self.described.encoders[source];
        match wiring.encoders_reversed[source] {
            Some(reversed) if reversed != described => count.saturating_neg(),
            _ => count,
        }
    }
}

const _: () = assert!(AXES == ENCODERS);

impl Links {
    fn angle(&self, encoder: usize) -> f32 {
        if encoder < MAX_JOINTS {
            self.angles[encoder]
        } else {
            self.wrist[encoder - MAX_JOINTS]
        }
    }

    fn pose(&self) -> Pose {
        Pose::new(self.posture.position, self.posture.orientation)
    }

    fn mass_matrix(&self) -> Mat3 {
        Mat3::from_diagonal(self.inertia)
            + self.posture.jacobian.transpose() * self.posture.jacobian * self.mass
    }

    fn kinetic_energy(&self) -> f32 {
        0.5 * self.rates.dot(self.mass_matrix() * self.rates)
    }

    /// One backward-Euler step; returns the hand's wrench in it.
    fn step(&mut self, motors: Vec3, held: Option<&(HandImpedance, HandCommand)>, joints: &Joints) -> Wrench {
        const H: f32 = TICK_S / SUBSTEPS as f32;
        // Without an operator the stiffness is zero.
        let (impedance, command) = held
            .copied()
            .unwrap_or((HandImpedance::NONE, HandCommand::at(self.pose())));
        let jacobian = self.posture.jacobian;
        let back = jacobian.transpose();
        let pull = (command.pose.position - self.posture.position) * impedance.stiffness
            + command.twist.linear * impedance.damping
            + command.push;
        let yields = impedance.damping + H * impedance.stiffness;
        let system = self.mass_matrix() + (Mat3::from_diagonal(self.viscous) + back * jacobian * yields) * H;
        let momentum = self.mass_matrix() * self.rates + (motors + back * pull) * H;
        self.rates = solve(system, momentum - friction(system, momentum, self.coulomb * H));

        let axes = self.posture.wrist_axes;
        let turn = rotation::log_continuous(
            command.pose.orientation * self.posture.orientation.conjugate(),
            Vec3::ZERO,
        );
        let carried = self.posture.joint_axes * self.rates;
        let twist = turn * impedance.angular_stiffness
            + (command.twist.angular - carried) * impedance.angular_damping;
        let angular_yields = impedance.angular_damping + H * impedance.angular_stiffness;
        let has_wrist = joints.model().has_wrist();
        if has_wrist {
            let across = axes.transpose() * axes;
            let inertia = across * WRIST_INERTIA;
            let system =
                inertia + (Mat3::from_diagonal(Vec3::splat(WRIST_VISCOUS)) + across * angular_yields) * H;
            self.wrist_rates = solve(system, inertia * self.wrist_rates + axes.transpose() * twist * H);
        }
        let before = self.kinetic_energy();
        self.move_on(H, joints);
        // The inertia changes with the angles; the forces that conserve its energy are neglected above and replaced here.
        let after = self.kinetic_energy();
        if after > before {
            self.rates *= libm::sqrtf(before / after);
        }
        Wrench {
            force: pull - jacobian * self.rates * yields,
            torque: if has_wrist {
                twist - axes * self.wrist_rates * angular_yields
            } else {
                Vec3::ZERO
            },
        }
    }

    /// Advances the angles by `h` at the present rates, up to a stop.
    fn move_on(&mut self, h: f32, joints: &Joints) {
        let model = joints.model();
        let mut angles = self.angles;
        let mut rates = self.rates.to_array();
        for joint in 0..model.joints() {
            let [from, to] = self.range[joint];
            let reached = angles[joint] + h * rates[joint];
            angles[joint] = reached.clamp(from, to);
            if reached != angles[joint] {
                rates[joint] = 0.0;
            }
        }
        let mut wrist = self.wrist;
        for (angle, rate) in wrist.iter_mut().zip(self.wrist_rates.to_array()) {
            *angle += h * rate;
        }
        match model.posture(angles, wrist) {
            // Motion towards a wider posture is always allowed.
            Some(posture) if posture.isotropy > STOP || posture.isotropy >= self.posture.isotropy => {
                self.rates = Vec3::from_array(rates);
                (self.angles, self.wrist, self.posture) = (angles, wrist, posture);
            }
            _ => {
                self.rates = Vec3::ZERO;
                self.wrist_rates = Vec3::ZERO;
            }
        }
    }
}

/// Impulse f of dry friction, |fᵢ| ≤ `most`ᵢ, that minimises ½·(p − f)ᵀA⁻¹(p − f): coordinate by coordinate (projected Gauss–Seidel). Exactly the
/// whole momentum p where friction can hold it.
fn friction(system: Mat3, momentum: Vec3, most: Vec3) -> Vec3 {
    if momentum.abs().cmple(most).all() {
        return momentum;
    }
    let inverse = system.inverse();
    let mut friction = Vec3::ZERO;
    for _ in 0..FRICTION_ROUNDS {
        for joint in 0..MAX_JOINTS {
            let rate = inverse.row(joint).dot(momentum - friction);
            let wanted = friction[joint] + rate / inverse.col(joint)[joint];
            friction[joint] = wanted.clamp(-most[joint], most[joint]);
        }
    }
    friction
}

/// x of A·x = b, each component within ±[`RATE_MAX`]; zero where there is no solution.
fn solve(system: Mat3, momentum: Vec3) -> Vec3 {
    let found = system.inverse() * momentum;
    if found.is_finite() {
        found.clamp(Vec3::splat(-RATE_MAX), Vec3::splat(RATE_MAX))
    } else {
        Vec3::ZERO
    }
}

impl Mechanism for Described {
    fn sense(&mut self) -> Sensed {
        let wiring = self.script.advance(self.wiring);
        self.wiring.glitch = [0; AXES];
        self.wired = wiring;
        self.count(&wiring);
        wiring.through(self.mechanism.read(&self.counts))
    }

    fn drive(&mut self, drive: Drive) {
        self.currents = self.mechanism.currents(drive);
    }

    fn watch_encoders(&mut self, rendered: bool) {
        self.mechanism.watch_encoders(rendered);
    }

    fn count(&self) -> [f32; 2] {
        self.mechanism.joints().count_at_handle()
    }

    fn motors(&self) -> u8 {
        self.mechanism.motors()
    }

    fn counts(&self) -> [i32; ENCODERS] {
        self.counts
    }

    fn currents(&self) -> [f32; MAX_JOINTS] {
        self.mechanism.driven()
    }

    /// The operator model knows the joints' exact positions.
    fn home(&mut self) {
        self.offsets = [0; ENCODERS];
        for encoder in 0..ENCODERS {
            self.counts[encoder] = self.true_count(encoder, &self.wired);
        }
        self.mechanism.reference(&self.counts);
    }

    fn simulation(&mut self) -> Option<&mut dyn Simulation> {
        Some(self)
    }
}

impl Simulation for Described {
    fn advance(&mut self) {
        let held = self.hand.as_mut().map(|hand| (hand.impedance, hand.advance()));
        let joints = self.mechanism.joints();
        let given = core::array::from_fn(|joint| {
            let described = self.described.motors[joint];
            match self.wired.motors_reversed[joint] {
                _ if self.wired.motors_dead[joint] => 0.0,
                Some(reversed) if reversed != described => -self.currents[joint],
                _ => self.currents[joint],
            }
        });
        let motors = joints.torques(&given);
        let mut sum = Wrench::ZERO;
        for _ in 0..SUBSTEPS {
            let hand = self.links.step(motors, held.as_ref(), joints);
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
        let start = self.links.start;
        self.links.angles = [start[0], start[1], start[2]];
        self.links.wrist = [start[3], start[4], start[5]];
        self.links.rates = Vec3::ZERO;
        self.links.wrist_rates = Vec3::ZERO;
        self.mechanism.reset();
        self.links.posture = *self.mechanism.joints().posture();
        self.script = InputScript::new();
        self.counts = [0; ENCODERS];
        self.offsets = [0; ENCODERS];
        self.hand = None;
        self.hand_wrench = Wrench::ZERO;
        self.currents = [0.0; MAX_JOINTS];
        self.wired = Wiring::SOUND;
        Some(self.links.pose())
    }
}
