//! A rig's description: the data on mechanism, encoders and motors that a board needs to sense and drive a handle.
//!
//! A rig builder writes it as a file (`firmware/rigs/*.toml`, `docs/rigs.md`). It crosses the link as one message, so that it arrives whole or not at
//! all, and both host and board accept it only after [`Rig::check`]. Units here are metres, radians, seconds, newtons, amperes; the file's units are
//! in [`RIG_KEYS`].

mod keys;

use heapless::{String, Vec};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::limits::{MAX_JOINTS, MAX_NAME};

pub use keys::{RIG_KEYS, RigKey, RigKeyRow};

/// Largest motion of a 16-bit counter between two ticks before its direction is ambiguous, with a tenth as margin.
pub const MAX_COUNTS_PER_TICK: f32 = 29_000.0;
/// Largest cosine between neighbouring axes of a wrist: 26° apart. The first and the third may be parallel, as in a gimbal.
const WRIST_COSINE: f32 = 0.9;

/// A rig's description; see the module.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Rig {
    /// Name of the rig.
    pub name: String<MAX_NAME>,
    /// Links.
    pub kinematics: Kinematics,
    /// Placement of the mechanism in the world.
    pub mount: Mount,
    /// Joints with motors, in the order of the kinematics.
    pub joints: Vec<Joint, MAX_JOINTS>,
    /// Three joints without motors that carry the handle, so that its orientation is sensed too.
    pub wrist: Option<Wrist>,
    /// Mass of the handle, kg.
    pub handle_mass: f32,
    /// Hardware limits that no parameter can exceed.
    pub ceilings: RigCeilings,
}

/// Kinematics: how joint angles θ place the handle, in the mechanism's own frame; lengths in m. Drawings are in `docs/rigs.md`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum Kinematics {
    /// One joint about z: p = radius·(cos θ, sin θ, 0).
    Paddle {
        /// Distance of the handle from the axis.
        radius: f32,
    },
    /// Five links in the plane z = 0. Motors at (∓base/2, 0), angles from x, counter-clockwise; the handle is where the two distal links meet, to the
    /// left of the line from the left elbow to the right one.
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
    /// Number of joints.
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
    /// Origin, m, mechanism's frame.
    pub origin: [f32; 3],
    /// R as a rotation vector, rad.
    pub turn: [f32; 3],
}

/// One joint with its encoder and motor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Joint {
    /// Counts per turn of the shaft that carries the encoder.
    pub counts_per_turn: f32,
    /// Whether the encoder is on the motor's shaft; otherwise it is on the joint's.
    pub encoder_on_motor: bool,
    /// Whether the encoder counts down when the joint turns forward.
    pub encoder_reversed: bool,
    /// Motor turns per turn of the joint.
    pub gear: f32,
    /// Torque per current, N·m/A.
    pub torque_constant: f32,
    /// Whether a positive current pushes the joint backward.
    pub motor_reversed: bool,
    /// Largest current, A.
    pub current_limit: f32,
    /// Smallest and largest angle, rad.
    pub range: [f32; 2],
    /// Angle where counting starts, rad.
    pub home: f32,
    /// Largest speed, rad/s.
    pub rate_limit: f32,
    /// Coulomb friction, N·m.
    pub coulomb: f32,
    /// Viscous friction, N·m·s/rad.
    pub viscous: f32,
    /// Inertia, kg·m².
    pub inertia: f32,
}

impl Joint {
    /// Joint angle per encoder count, rad, signed.
    pub fn radians_per_count(&self) -> f32 {
        let gear = if self.encoder_on_motor { self.gear } else { 1.0 };
        let sense = if self.encoder_reversed { -1.0 } else { 1.0 };
        sense * core::f32::consts::TAU / (self.counts_per_turn * gear)
    }

    /// Joint torque per ampere of the motor's current, N·m/A, signed, without losses.
    pub fn torque_per_ampere(&self) -> f32 {
        let sense = if self.motor_reversed { -1.0 } else { 1.0 };
        sense * self.torque_constant * self.gear
    }

    /// Most counts of the encoder in a tick of a millisecond.
    pub fn counts_per_tick(&self) -> f32 {
        1e-3 * self.rate_limit / self.radians_per_count().abs()
    }
}

/// Three passive axes that meet in the handle's origin: R = R_link · exp(a₁q₁) · exp(a₂q₂) · exp(a₃q₃).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Wrist {
    /// Unit vectors of the axes.
    pub axes: [[f32; 3]; 3],
    /// Counts per turn; negative if the encoder counts down when the axis turns forward.
    pub counts_per_turn: [f32; 3],
    /// Angles where counting starts, rad.
    pub home: [f32; 3],
}

/// Hardware limits that no parameter can exceed; they are below the firmware's own limits.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct RigCeilings {
    /// Force, N.
    pub force: f32,
    /// Power, W.
    pub power: f32,
    /// Speed, m/s.
    pub speed: f32,
    /// Distance from the world's origin, m.
    pub workspace: f32,
}

/// Fault of a description.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum RigFault {
    /// A number outside its range, or NaN.
    OutOfRange {
        /// Key of the number.
        key: RigKey,
        /// Its joint or axis, from 0.
        joint: u8,
        /// Its value, in the file's unit.
        value: f32,
    },
    /// The kinematics need a different number of joints.
    Joints {
        /// Number of joints needed.
        needed: u8,
    },
    /// A joint's range ends before it begins.
    Range {
        /// Joint, from 0.
        joint: u8,
    },
    /// A joint's home lies outside its range.
    Home {
        /// Joint, from 0.
        joint: u8,
    },
    /// At its largest speed a joint's encoder moves more counts per tick than can be distinguished.
    Counts {
        /// Joint, from 0.
        joint: u8,
    },
    /// An axis of the wrist is not a unit vector, or is nearly parallel to its neighbour.
    WristAxes,
    /// The links do not reach each other in the home pose.
    Linkage,
    /// The home pose is singular: in some direction the handle can hardly be driven.
    Singular,
    /// The home pose lies outside the workspace.
    Workspace,
}

impl Rig {
    /// Checks that every number is possible and that they are consistent. Conditions that need the kinematics (do the links reach each other?) are
    /// checked by the board when it builds them.
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
    /// Axis angle per encoder count, rad, signed.
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

/// Hash of the byte layout of a description: any change to its types changes it.
pub const fn layout() -> u32 {
    let key = u64::from_le_bytes(postcard_schema::key::Key::for_path::<Rig>("rig").to_bytes());
    (key ^ (key >> 32)) as u32
}
