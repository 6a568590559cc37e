//! Encoder counts to handle pose and velocity, and force to motor currents, for a described rig in each tick, simulated or real.

use glam::Vec3;
use mortise_haptics::{Pose, Twist};
use mortise_protocol::limits::{MAX_ENCODERS, MAX_JOINTS};
use mortise_protocol::rig::{Rig, RigFault};

use crate::encoder::Counter;
use crate::encoder_watch::{AxisTick, amplitude};
use crate::interface::TICK_S;
use crate::kinematics::{Model, Posture};
use crate::velocity::{Estimator, InUse};

/// Encoders of a description: joints, then wrist axes. Counts of absent ones stay 0.
pub const ENCODERS: usize = MAX_ENCODERS;
/// Rate of a wrist axis above which a reading is treated as a jump, rad/s: above any speed limit that can be set.
const WRIST_RATE: f32 = 200.0;
/// Stiffest hand in which a probe moves the handle, N/m: a tensed arm. Less than that of a free handle ([`crate::encoder_watch::STIFFEST_HAND`]),
/// because a joint's counts are ten times as coarse and require ten times the force.
const STIFFEST_HAND: f32 = 5_000.0;
/// Largest share of a motor's current for a probe of its encoder.
const PROBE_SHARE: f32 = 0.5;
/// Softest hand in which the joint must still answer a probe, N/m; where that needs more current, the joint's encoder is not judged.
const LEAST_STIFFEST_HAND: f32 = 1_000.0;
/// Distance from the end of its range, in counts, within which a joint is considered to be at its stop.
const STOP_COUNTS: f32 = 4.0;

/// Conversion between encoder counts and the handle.
#[derive(Clone, Debug)]
pub struct Joints {
    model: Model,
    radians_per_count: [f32; ENCODERS],
    home: [f32; ENCODERS],
    farthest: [u32; ENCODERS],
    counters: [Counter; ENCODERS],
    velocities: [InUse; ENCODERS],
    torque_per_ampere: [f32; MAX_JOINTS],
    current_limit: [f32; MAX_JOINTS],
    coulomb: [f32; MAX_JOINTS],
    range: [[f32; 2]; MAX_JOINTS],
    force_max: f32,
    posture: Posture,
    /// Joint angles of the last reading.
    angles: [f32; MAX_JOINTS],
}

/// Encoder readings of one tick, converted.
#[derive(Clone, Copy, Debug)]
pub struct Reading {
    /// Handle in the world.
    pub handle: Pose,
    /// Its velocity.
    pub twist: Twist,
    /// First encoder that moved further than is possible in a tick.
    pub jump: Option<u8>,
    /// The readings correspond to no posture of the links.
    pub impossible: bool,
    /// Counts each encoder moved.
    pub moved: [i32; ENCODERS],
}

impl Joints {
    /// The joints in the home pose, at rest, all counts 0.
    ///
    /// # Errors
    /// See [`Model::new`].
    pub fn new(rig: &Rig) -> Result<Self, RigFault> {
        let model = Model::new(rig)?;
        let mut home = [0.0; ENCODERS];
        let mut radians_per_count = [0.0; ENCODERS];
        let mut farthest = [0; ENCODERS];
        let mut torque_per_ampere = [1.0; MAX_JOINTS];
        let mut current_limit = [0.0; MAX_JOINTS];
        let mut coulomb = [0.0; MAX_JOINTS];
        let mut range = [[0.0; 2]; MAX_JOINTS];
        for (number, joint) in rig.joints.iter().enumerate() {
            home[number] = joint.home;
            radians_per_count[number] = joint.radians_per_count();
            // At least one count, so that a slow joint with a coarse encoder still counts. The cast saturates.
            farthest[number] = (joint.counts_per_tick() + 1.0) as u32;
            torque_per_ampere[number] = joint.torque_per_ampere();
            current_limit[number] = joint.current_limit;
            coulomb[number] = joint.coulomb;
            range[number] = joint.range;
        }
        if let Some(wrist) = &rig.wrist {
            for axis in 0..3 {
                let number = MAX_JOINTS + axis;
                home[number] = wrist.home[axis];
                radians_per_count[number] = wrist.radians_per_count(axis);
                farthest[number] = (WRIST_RATE * TICK_S / radians_per_count[number].abs() + 1.0) as u32;
            }
        }
        let posture = posture(&model, &home).ok_or(RigFault::Linkage)?;
        let mut joints = Self {
            model,
            radians_per_count,
            home,
            farthest,
            counters: farthest.map(Counter::new),
            velocities: [InUse::AT_REST; ENCODERS],
            torque_per_ampere,
            current_limit,
            coulomb,
            range,
            force_max: rig.ceilings.force,
            posture,
            angles: [home[0], home[1], home[2]],
        };
        joints.start();
        Ok(joints)
    }

    /// Restarts in the home pose, all counts 0.
    pub fn start(&mut self) {
        self.start_at(&[0; ENCODERS]);
    }

    /// Restarts at rest at these counts, with which the next reading is compared. If they correspond to no posture, the last posture stays.
    pub fn start_at(&mut self, counts: &[i32; ENCODERS]) {
        self.counters = self.farthest.map(Counter::new);
        self.velocities = [InUse::AT_REST; ENCODERS];
        let mut angles = [0.0; ENCODERS];
        for encoder in 0..ENCODERS {
            self.counters[encoder].update(counts[encoder]);
            angles[encoder] = self.angle(encoder, counts[encoder]);
        }
        if let Some(posture) = posture(&self.model, &angles) {
            self.posture = posture;
        }
        self.angles = [angles[0], angles[1], angles[2]];
    }

    /// The model.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// The posture of the last reading.
    pub fn posture(&self) -> &Posture {
        &self.posture
    }

    /// Angle of an encoder's axis at a count, rad.
    pub fn angle(&self, encoder: usize, count: i32) -> f32 {
        self.home[encoder] + count as f32 * self.radians_per_count[encoder]
    }

    /// The count nearest to an angle; 0 for an absent encoder.
    pub fn count(&self, encoder: usize, angle: f32) -> i32 {
        let scale = self.radians_per_count[encoder];
        if scale == 0.0 {
            return 0;
        }
        let count = (angle - self.home[encoder]) / scale;
        (if count < 0.0 { count - 0.5 } else { count + 0.5 }) as i32
    }

    /// Effect of one count of every encoder together, at the handle in the posture of the last reading: the largest along a world axis, m, and about
    /// one, rad.
    pub fn count_at_handle(&self) -> [f32; 2] {
        let [a, b, c, d, e, f] = self.radians_per_count.map(f32::abs);
        let (joints, wrist) = (Vec3::new(a, b, c), Vec3::new(d, e, f));
        let posture = &self.posture;
        let moved = posture.jacobian.abs() * joints;
        let turned = posture.joint_axes.abs() * joints + posture.wrist_axes.abs() * wrist;
        [moved.max_element(), turned.max_element()]
    }

    /// Processes the counts of one tick. If they correspond to no posture of the links, the last posture stays.
    pub fn read(&mut self, counts: &[i32; ENCODERS]) -> Reading {
        let mut jump = None;
        let mut rates = [0.0; ENCODERS];
        let mut moved = [0; ENCODERS];
        let mut angles = [0.0; ENCODERS];
        for encoder in 0..ENCODERS {
            let step = self.counters[encoder].update(counts[encoder]);
            if step.jumped && jump.is_none() {
                jump = Some(encoder as u8);
            }
            moved[encoder] = step.counts;
            rates[encoder] = self.velocities[encoder].update(step.counts, self.radians_per_count[encoder]);
            angles[encoder] = self.angle(encoder, counts[encoder]);
        }
        let found = posture(&self.model, &angles);
        if let Some(posture) = found {
            self.posture = posture;
        }
        self.angles = [angles[0], angles[1], angles[2]];
        let [a, b, c, d, e, f] = rates;
        Reading {
            handle: Pose::new(self.posture.position, self.posture.orientation),
            twist: Twist {
                linear: self.posture.velocity([a, b, c]),
                angular: self.posture.angular_velocity([a, b, c], [d, e, f]),
            },
            jump,
            impossible: found.is_none(),
            moved,
        }
    }

    /// Currents (A, signed in the motor's sense) that push the handle with `force` (N, world) in the posture of the last reading: τ = Jᵀ·F, i =
    /// τ/(gear·k).
    ///
    /// The force is limited to the rig's hardware limit, fades near singular postures ([`Posture::share`]), and when a motor would exceed its limit
    /// all are scaled by one factor: the force weakens but keeps its direction. A force that is not a number gives no current.
    pub fn currents(&self, force: Vec3) -> [f32; MAX_JOINTS] {
        let given = force.clamp_length_max(self.force_max) * self.posture.share();
        let torques = self.posture.torques(given);
        let mut currents = [0.0; MAX_JOINTS];
        let mut scale = 1.0f32;
        for joint in 0..MAX_JOINTS {
            let wanted = torques[joint] / self.torque_per_ampere[joint];
            if !wanted.is_finite() {
                return [0.0; MAX_JOINTS];
            }
            let limit = self.current_limit[joint];
            if wanted.abs() > limit {
                scale = scale.min(limit / wanted.abs());
            }
            currents[joint] = wanted;
        }
        currents.map(|wanted| wanted * scale)
    }

    /// Currents (A, signed in the motor's sense) that push one joint alone with `force` (N, positive: forward) at the handle along its own path: with
    /// the others free, the torque is force·|J_j|. At most the motor's limit; none for an absent joint or a force that is not a number.
    pub fn joint_currents(&self, joint: usize, force: f32) -> [f32; MAX_JOINTS] {
        let mut currents = [0.0; MAX_JOINTS];
        if joint < self.model.joints() {
            let torque = force * self.posture.jacobian.col(joint).length();
            let wanted = torque / self.torque_per_ampere[joint];
            if wanted.is_finite() {
                let limit = self.current_limit[joint];
                currents[joint] = wanted.clamp(-limit, limit);
            }
        }
        currents
    }

    /// Joint torques of these currents, N·m.
    pub fn torques(&self, currents: &[f32; MAX_JOINTS]) -> Vec3 {
        Vec3::from_array(core::array::from_fn(|joint| {
            currents[joint] * self.torque_per_ampere[joint]
        }))
    }

    /// Amplitude of the probe of a joint's encoder, A; `None` for an encoder that is not judged: it has no motor, is at a stop or near a singular
    /// posture, or its motor is too weak for its friction and resolution.
    ///
    /// A hand of stiffness k at the handle corresponds to a stiffness k·|J_j|² at joint j while the others are fixed.
    pub fn probe(&self, encoder: usize) -> Option<f32> {
        if encoder >= self.model.joints() || self.posture.share() < 1.0 {
            return None;
        }
        let count = self.radians_per_count[encoder].abs();
        let [from, to] = self.range[encoder];
        let (angle, margin) = (self.angles[encoder], STOP_COUNTS * count);
        if angle <= from + margin || angle >= to - margin {
            return None;
        }
        let lever2 = self.posture.jacobian.col(encoder).length_squared();
        let for_hand = |stiffness: f32| {
            amplitude(stiffness * lever2, count, self.coulomb[encoder])
                / self.torque_per_ampere[encoder].abs()
        };
        let most = PROBE_SHARE * self.current_limit[encoder];
        (for_hand(LEAST_STIFFEST_HAND) <= most).then(|| for_hand(STIFFEST_HAND).min(most))
    }

    /// The watch's input for each encoder: motion `moved` read under `currents`.
    pub fn axis_ticks(&self, moved: &[i32; ENCODERS], currents: &[f32; MAX_JOINTS]) -> [AxisTick; ENCODERS] {
        core::array::from_fn(|encoder| AxisTick {
            moved: moved[encoder],
            effort: match (currents.get(encoder), self.current_limit.get(encoder)) {
                (Some(current), Some(&limit)) if limit > 0.0 => current / limit,
                _ => 0.0,
            },
            able: self.probe(encoder).is_some(),
        })
    }
}

fn posture(model: &Model, angles: &[f32; ENCODERS]) -> Option<Posture> {
    let [a, b, c, d, e, f] = *angles;
    model.posture([a, b, c], [d, e, f])
}
