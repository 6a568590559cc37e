//! A rig's description: what a board must know of its mechanism, encoders and motors to sense a handle and to push it.
//!
//! A rig builder writes it as a file (`firmware/rigs/*.toml`, `docs/rigs.md`); it crosses the link as one message, so that it arrives whole or not at
//! all; [`Rig::check`] is what host and board both ask before they believe it. Metres, radians, seconds, newtons, amperes here; the file's units are
//! in [`RIG_KEYS`].

mod keys;

use heapless::{String, Vec};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::limits::{MAX_JOINTS, MAX_NAME};

pub use keys::{RIG_KEYS, RigKey, RigKeyRow};

/// Counts a 16-bit counter can move between two ticks before its direction is ambiguous, with a tenth to spare.
pub const MAX_COUNTS_PER_TICK: f32 = 29_000.0;
/// Largest cosine between neighbouring axes of a wrist: 26° apart. The first and the third may be parallel, as in a gimbal.
const WRIST_COSINE: f32 = 0.9;

/// See the module.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Rig {
    /// What it is called.
    pub name: String<MAX_NAME>,
    /// Links.
    pub kinematics: Kinematics,
    /// Where the mechanism stands in the world.
    pub mount: Mount,
    /// Joints with motors, in the order of the kinematics.
    pub joints: Vec<Joint, MAX_JOINTS>,
    /// Three joints without motors that carry the handle, so that its orientation is sensed too.
    pub wrist: Option<Wrist>,
    /// Mass of the handle, kg.
    pub handle_mass: f32,
    /// What no parameter can go beyond.
    pub ceilings: RigCeilings,
}

/// How joint angles θ place the handle, in the mechanism's own frame; lengths in m. `docs/rigs.md` has the drawings.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum Kinematics {
    /// One joint about z: p = radius·(cos θ, sin θ, 0).
    Paddle {
        /// Distance of the handle from the axis.
        radius: f32,
    },
    /// Five links in the plane z = 0. Motors at (∓base/2, 0), angles from x, counter-clockwise; the handle is where the two distal links meet, on the
    /// left of the way from the left elbow to the right one.
    Pantograph {
        /// Distance between the motors.
        base: f32,
        /// Links at the motors, left and right.
        proximal: [f32; 2],
        /// Links at the handle, left and right.
        distal: [f32; 2],
    },
    /// Yaw about z, then two links driven from the base: r = upper·sin θ₂ + lower·sin θ₃,
    /// p = (r·cos θ₁, r·sin θ₁, base_height + upper·cos θ₂ − lower·cos θ₃).
    SerialArm {
        /// Height of the shoulder.
        base_height: f32,
        /// Upper link.
        upper: f32,
        /// Lower link.
        lower: f32,
    },
}

impl Kinematics {
    /// Joints it has.
    pub const fn joints(&self) -> usize {
        match self {
            Self::Paddle { .. } => 1,
            Self::Pantograph { .. } => 2,
            Self::SerialArm { .. } => 3,
        }
    }
}

/// World from mechanism: x = R·(p − origin).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Mount {
    /// m, mechanism's frame.
    pub origin: [f32; 3],
    /// R as a rotation vector, rad.
    pub turn: [f32; 3],
}

/// One joint with its encoder and motor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Joint {
    /// Counts for a turn of the shaft that carries the encoder.
    pub counts_per_turn: f32,
    /// The encoder sits on the motor's shaft; else on the joint's.
    pub encoder_on_motor: bool,
    /// It counts down when the joint turns forward.
    pub encoder_reversed: bool,
    /// Motor turns for a turn of the joint.
    pub gear: f32,
    /// N·m/A.
    pub torque_constant: f32,
    /// A positive current pushes the joint backward.
    pub motor_reversed: bool,
    /// A.
    pub current_limit: f32,
    /// Smallest and largest angle, rad.
    pub range: [f32; 2],
    /// Angle where counting starts, rad.
    pub home: f32,
    /// rad/s.
    pub rate_limit: f32,
    /// Coulomb friction, N·m.
    pub coulomb: f32,
    /// Viscous friction, N·m·s/rad.
    pub viscous: f32,
    /// kg·m².
    pub inertia: f32,
}

impl Joint {
    /// Angle of the joint for an encoder count, rad, signed.
    pub fn radians_per_count(&self) -> f32 {
        let gear = if self.encoder_on_motor { self.gear } else { 1.0 };
        let sense = if self.encoder_reversed { -1.0 } else { 1.0 };
        sense * core::f32::consts::TAU / (self.counts_per_turn * gear)
    }

    /// Torque at the joint for the motor's current, N·m/A, signed, without losses.
    pub fn torque_per_ampere(&self) -> f32 {
        let sense = if self.motor_reversed { -1.0 } else { 1.0 };
        sense * self.torque_constant * self.gear
    }

    /// Most counts the encoder moves in a tick of a millisecond.
    pub fn counts_per_tick(&self) -> f32 {
        1e-3 * self.rate_limit / self.radians_per_count().abs()
    }
}

/// Three passive axes that meet in the handle's origin: R = R_link · exp(a₁q₁) · exp(a₂q₂) · exp(a₃q₃).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Wrist {
    /// Unit vectors.
    pub axes: [[f32; 3]; 3],
    /// Counts for a turn; negative where the encoder counts down when the axis turns forward.
    pub counts_per_turn: [f32; 3],
    /// rad.
    pub home: [f32; 3],
}

/// What no parameter can go beyond; below the firmware's own ceilings.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct RigCeilings {
    /// N.
    pub force: f32,
    /// W.
    pub power: f32,
    /// m/s.
    pub speed: f32,
    /// m from the world's origin.
    pub workspace: f32,
}

/// What is wrong with a description.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum RigFault {
    /// A number outside its range, or none.
    OutOfRange {
        /// Which.
        key: RigKey,
        /// Of which joint or axis, from 0.
        joint: u8,
        /// In the file's unit.
        value: f32,
    },
    /// The kinematics need another number of joints.
    Joints {
        /// As many as these.
        needed: u8,
    },
    /// A joint's range ends before it begins.
    Range {
        /// Which, from 0.
        joint: u8,
    },
    /// A joint's home lies outside its range.
    Home {
        /// Which, from 0.
        joint: u8,
    },
    /// At its fastest a joint's encoder moves more counts in a tick than can be told apart.
    Counts {
        /// Which, from 0.
        joint: u8,
    },
    /// A wrist's axis is no unit vector, or nearly parallel to its neighbour.
    WristAxes,
    /// The links do not reach each other in the home pose.
    Linkage,
    /// The home pose is singular: in some direction the handle can hardly be pushed.
    Singular,
    /// The home pose lies outside the workspace.
    Workspace,
}

impl Rig {
    /// Whether every number is possible and they agree with each other. What takes kinematics (do the links reach each other?) the board finds out
    /// when it builds them.
    ///
    /// # Errors
    /// The first fault.
    pub fn check(&self) -> Result<(), RigFault> {
        self.check_numbers()?;
        let needed = self.kinematics.joints();
        if self.joints.len() != needed {
            return Err(RigFault::Joints { needed: needed as u8 });
        }
        for (number, joint) in self.joints.iter().enumerate() {
            let number = number as u8;
            let [from, to] = joint.range;
            if from >= to {
                return Err(RigFault::Range { joint: number });
            }
            if joint.home < from || joint.home > to {
                return Err(RigFault::Home { joint: number });
            }
            if joint.counts_per_tick() > MAX_COUNTS_PER_TICK {
                return Err(RigFault::Counts { joint: number });
            }
        }
        match &self.wrist {
            Some(wrist) if !wrist.is_spatial() => Err(RigFault::WristAxes),
            _ => Ok(()),
        }
    }

    fn check_numbers(&self) -> Result<(), RigFault> {
        let mut first = Ok(());
        let mut see = |key: RigKey, joint: usize, si: f32| {
            if first.is_ok() && !key.holds(si) {
                let (joint, value) = (joint as u8, si / key.row().si);
                first = Err(RigFault::OutOfRange { key, joint, value });
            }
        };
        match self.kinematics {
            Kinematics::Paddle { radius } => see(RigKey::PaddleRadius, 0, radius),
            Kinematics::Pantograph {
                base,
                proximal,
                distal,
            } => {
                see(RigKey::PantographBase, 0, base);
                for side in 0..2 {
                    see(RigKey::PantographProximal, side, proximal[side]);
                    see(RigKey::PantographDistal, side, distal[side]);
                }
            }
            Kinematics::SerialArm {
                base_height,
                upper,
                lower,
            } => {
                see(RigKey::ArmBaseHeight, 0, base_height);
                see(RigKey::ArmUpper, 0, upper);
                see(RigKey::ArmLower, 0, lower);
            }
        }
        for axis in 0..3 {
            see(RigKey::Origin, axis, self.mount.origin[axis]);
            see(RigKey::Turn, axis, self.mount.turn[axis]);
        }
        for (number, joint) in self.joints.iter().enumerate() {
            for (key, si) in [
                (RigKey::Counts, joint.counts_per_turn),
                (RigKey::Gear, joint.gear),
                (RigKey::TorqueConstant, joint.torque_constant),
                (RigKey::CurrentLimit, joint.current_limit),
                (RigKey::RangeFrom, joint.range[0]),
                (RigKey::RangeTo, joint.range[1]),
                (RigKey::Home, joint.home),
                (RigKey::Rate, joint.rate_limit),
                (RigKey::Coulomb, joint.coulomb),
                (RigKey::Viscous, joint.viscous),
                (RigKey::Inertia, joint.inertia),
            ] {
                see(key, number, si);
            }
        }
        if let Some(wrist) = &self.wrist {
            for axis in 0..3 {
                see(RigKey::WristCounts, axis, wrist.counts_per_turn[axis].abs());
                see(RigKey::WristHome, axis, wrist.home[axis]);
                for part in wrist.axes[axis] {
                    see(RigKey::WristAxis, axis, part);
                }
            }
        }
        see(RigKey::HandleMass, 0, self.handle_mass);
        see(RigKey::CeilingForce, 0, self.ceilings.force);
        see(RigKey::CeilingPower, 0, self.ceilings.power);
        see(RigKey::CeilingSpeed, 0, self.ceilings.speed);
        see(RigKey::CeilingWorkspace, 0, self.ceilings.workspace);
        first
    }
}

impl Wrist {
    /// Angle of an axis for an encoder count, rad, signed.
    pub fn radians_per_count(&self, axis: usize) -> f32 {
        core::f32::consts::TAU / self.counts_per_turn[axis]
    }

    fn is_spatial(&self) -> bool {
        let [a, b, c] = self.axes;
        let unit = |v: [f32; 3]| (v[0] * v[0] + v[1] * v[1] + v[2] * v[2] - 1.0).abs() < 1e-3;
        // Both are false for NaN.
        let apart = |a: [f32; 3], b: [f32; 3]| (a[0] * b[0] + a[1] * b[1] + a[2] * b[2]).abs() < WRIST_COSINE;
        unit(a) && unit(b) && unit(c) && apart(a, b) && apart(b, c)
    }
}

/// Names the layout of a description in bytes: any change to its types changes it.
pub const fn layout() -> u32 {
    let key = u64::from_le_bytes(postcard_schema::key::Key::for_path::<Rig>("rig").to_bytes());
    (key ^ (key >> 32)) as u32
}
