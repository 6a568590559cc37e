//! The tables of a description file, in the file's units.

use std::f32::consts::PI;

use mortise_protocol::limits::MAX_NAME;
use mortise_protocol::rig::{Joint, Kinematics, Mount, Rig, RigCeilings, Wrist};
use serde::{Deserialize, Serialize};

use super::digits::significant;

const MM: f32 = 1e-3;
const DEG: f32 = PI / 180.0;

#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct File {
    name: String,
    kinematics: KinematicsTable,
    #[serde(default)]
    mount: MountTable,
    handle: HandleTable,
    ceilings: CeilingsTable,
    joint: Vec<JointTable>,
    #[serde(skip_serializing_if = "Option::is_none")]
    wrist: Option<WristTable>,
}

#[derive(Deserialize, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
enum KinematicsTable {
    Paddle {
        radius_mm: f64,
    },
    Pantograph {
        base_mm: f64,
        proximal_mm: [f64; 2],
        distal_mm: [f64; 2],
    },
    SerialArm {
        base_height_mm: f64,
        upper_mm: f64,
        lower_mm: f64,
    },
}

#[derive(Default, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
struct MountTable {
    origin_mm: [f64; 3],
    turn_deg: [f64; 3],
}

#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct HandleTable {
    mass_kg: f64,
}

#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct CeilingsTable {
    force_n: f64,
    power_w: f64,
    speed_m_per_s: f64,
    workspace_mm: f64,
}

#[derive(Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
enum Shaft {
    Motor,
    Joint,
}

#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct JointTable {
    counts_per_turn: f64,
    encoder: Shaft,
    #[serde(default)]
    encoder_reversed: bool,
    gear: f64,
    torque_constant_n_m_per_a: f64,
    #[serde(default)]
    motor_reversed: bool,
    current_limit_a: f64,
    range_deg: [f64; 2],
    home_deg: f64,
    rate_limit_deg_per_s: f64,
    friction_n_m: f64,
    viscous_n_m_s_per_rad: f64,
    inertia_kg_m2: f64,
}

#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct WristTable {
    axes: [[f64; 3]; 3],
    counts_per_turn: [f64; 3],
    #[serde(default)]
    reversed: [bool; 3],
    home_deg: [f64; 3],
}

/// Parses the text. The error is TOML's own with line and column, or concerns the name.
pub(super) fn read(text: &str) -> Result<Rig, String> {
    let file: File = toml::from_str(text).map_err(|error| error.to_string().trim().to_owned())?;
    let name = heapless::String::try_from(file.name.as_str())
        .map_err(|_| format!("name is longer than {MAX_NAME} bytes: shorten it"))?;
    let length = |mm: f64| mm as f32 * MM;
    let angle = |deg: f64| deg as f32 * DEG;
    let found = file.joint.len();
    let joints = (file.joint.iter())
        .map(|joint| Joint {
            counts_per_turn: joint.counts_per_turn as f32,
            encoder_on_motor: matches!(joint.encoder, Shaft::Motor),
            encoder_reversed: joint.encoder_reversed,
            gear: joint.gear as f32,
            torque_constant: joint.torque_constant_n_m_per_a as f32,
            motor_reversed: joint.motor_reversed,
            current_limit: joint.current_limit_a as f32,
            range: joint.range_deg.map(angle),
            home: angle(joint.home_deg),
            rate_limit: angle(joint.rate_limit_deg_per_s),
            coulomb: joint.friction_n_m as f32,
            viscous: joint.viscous_n_m_s_per_rad as f32,
            inertia: joint.inertia_kg_m2 as f32,
        })
        .collect::<Vec<_>>();
    let joints = heapless::Vec::from_slice(&joints).map_err(|_| {
        format!(
            "there are {found} [[joint]] tables: no mechanism here has more than three joints with motors"
        )
    })?;
    Ok(Rig {
        name,
        kinematics: match file.kinematics {
            KinematicsTable::Paddle { radius_mm } => Kinematics::Paddle {
                radius: length(radius_mm),
            },
            KinematicsTable::Pantograph {
                base_mm,
                proximal_mm,
                distal_mm,
            } => Kinematics::Pantograph {
                base: length(base_mm),
                proximal: proximal_mm.map(length),
                distal: distal_mm.map(length),
            },
            KinematicsTable::SerialArm {
                base_height_mm,
                upper_mm,
                lower_mm,
            } => Kinematics::SerialArm {
                base_height: length(base_height_mm),
                upper: length(upper_mm),
                lower: length(lower_mm),
            },
        },
        mount: Mount {
            origin: file.mount.origin_mm.map(length),
            turn: file.mount.turn_deg.map(angle),
        },
        joints,
        wrist: file.wrist.map(|wrist| Wrist {
            axes: wrist.axes.map(|axis| axis.map(|part| part as f32)),
            counts_per_turn: std::array::from_fn(|axis| {
                let sense = if wrist.reversed[axis] { -1.0 } else { 1.0 };
                sense * wrist.counts_per_turn[axis] as f32
            }),
            home: wrist.home_deg.map(angle),
        }),
        handle_mass: file.handle.mass_kg as f32,
        ceilings: RigCeilings {
            force: file.ceilings.force_n as f32,
            power: file.ceilings.power_w as f32,
            speed: file.ceilings.speed_m_per_s as f32,
            workspace: length(file.ceilings.workspace_mm),
        },
    })
}

/// Writes a text that [`read`] reads.
pub(super) fn write(rig: &Rig) -> String {
    let length = |m: f32| significant(m / MM);
    let angle = |rad: f32| significant(rad / DEG);
    let file = File {
        name: rig.name.to_string(),
        kinematics: match rig.kinematics {
            Kinematics::Paddle { radius } => KinematicsTable::Paddle {
                radius_mm: length(radius),
            },
            Kinematics::Pantograph {
                base,
                proximal,
                distal,
            } => KinematicsTable::Pantograph {
                base_mm: length(base),
                proximal_mm: proximal.map(length),
                distal_mm: distal.map(length),
            },
            Kinematics::SerialArm {
                base_height,
                upper,
                lower,
            } => KinematicsTable::SerialArm {
                base_height_mm: length(base_height),
                upper_mm: length(upper),
                lower_mm: length(lower),
            },
        },
        mount: MountTable {
            origin_mm: rig.mount.origin.map(length),
            turn_deg: rig.mount.turn.map(angle),
        },
        handle: HandleTable {
            mass_kg: significant(rig.handle_mass),
        },
        ceilings: CeilingsTable {
            force_n: significant(rig.ceilings.force),
            power_w: significant(rig.ceilings.power),
            speed_m_per_s: significant(rig.ceilings.speed),
            workspace_mm: length(rig.ceilings.workspace),
        },
        joint: (rig.joints.iter())
            .map(|joint| JointTable {
                counts_per_turn: significant(joint.counts_per_turn),
                encoder: if joint.encoder_on_motor {
                    Shaft::Motor
                } else {
                    Shaft::Joint
                },
                encoder_reversed: joint.encoder_reversed,
                gear: significant(joint.gear),
                torque_constant_n_m_per_a: significant(joint.torque_constant),
                motor_reversed: joint.motor_reversed,
                current_limit_a: significant(joint.current_limit),
                range_deg: joint.range.map(angle),
                home_deg: angle(joint.home),
                rate_limit_deg_per_s: angle(joint.rate_limit),
                friction_n_m: significant(joint.coulomb),
                viscous_n_m_s_per_rad: significant(joint.viscous),
                inertia_kg_m2: significant(joint.inertia),
            })
            .collect(),
        wrist: rig.wrist.map(|wrist| WristTable {
            axes: wrist.axes.map(|axis| axis.map(significant)),
            counts_per_turn: wrist.counts_per_turn.map(|counts| significant(counts.abs())),
            reversed: wrist.counts_per_turn.map(|counts| counts < 0.0),
            home_deg: wrist.home.map(angle),
        }),
    };
    // Plain tables of plain values always have a TOML form.
    toml::to_string(&file).unwrap_or_default()
}
