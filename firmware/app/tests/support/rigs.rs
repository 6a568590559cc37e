//! Descriptions of rigs for tests.

use mortise_protocol::rig::{Joint, Kinematics, Mount, Rig, RigCeilings, Wrist};

pub const JOINT: Joint = Joint {
    counts_per_turn: 2000.0,
    encoder_on_motor: true,
    encoder_reversed: false,
    gear: 12.0,
    torque_constant: 0.0259,
    motor_reversed: false,
    current_limit: 3.0,
    range: [-1.2, 1.4],
    home: 0.0,
    rate_limit: 30.0,
    coulomb: 0.03,
    viscous: 0.002,
    inertia: 1e-3,
};

/// An arm like WoodenHaptics, with a wrist.
pub fn arm() -> Rig {
    let lower = Joint {
        range: [0.2, 2.6],
        home: 1.5,
        encoder_reversed: true,
        motor_reversed: true,
        ..JOINT
    };
    Rig {
        name: "arm".try_into().unwrap(),
        kinematics: Kinematics::SerialArm {
            base_height: 0.08,
            upper: 0.205,
            lower: 0.245,
        },
        mount: Mount {
            origin: [0.22, 0.0, 0.2],
            turn: [0.0; 3],
        },
        joints: [JOINT, JOINT, lower].into_iter().collect(),
        wrist: Some(Wrist {
            axes: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            counts_per_turn: [4096.0, -4096.0, 4096.0],
            home: [0.0; 3],
        }),
        handle_mass: 0.05,
        ceilings: RigCeilings {
            force: 5.0,
            power: 8.0,
            speed: 1.5,
            workspace: 0.3,
        },
    }
}

/// A pantograph like Haply's 2diy.
pub fn pantograph() -> Rig {
    let joint = |range, home| Joint {
        counts_per_turn: 10_000.0,
        encoder_on_motor: false,
        gear: 1.0,
        torque_constant: 0.15,
        current_limit: 1.0,
        range,
        home,
        rate_limit: 40.0,
        coulomb: 0.01,
        viscous: 0.0005,
        inertia: 1e-4,
        ..JOINT
    };
    Rig {
        name: "pantograph".try_into().unwrap(),
        kinematics: Kinematics::Pantograph {
            base: 0.038,
            proximal: [0.07; 2],
            distal: [0.09; 2],
        },
        mount: Mount {
            origin: [0.0, 0.12, 0.0],
            turn: [0.0; 3],
        },
        joints: [joint([1.3, 3.3], 1.9), joint([-0.2, 1.85], 1.25)]
            .into_iter()
            .collect(),
        wrist: None,
        ..arm()
    }
}

/// A paddle like Stanford's Hapkit.
pub fn paddle() -> Rig {
    Rig {
        name: "paddle".try_into().unwrap(),
        kinematics: Kinematics::Paddle { radius: 0.066 },
        mount: Mount {
            origin: [0.0, 0.066, 0.0],
            turn: [0.0; 3],
        },
        joints: [Joint {
            range: [0.9, 2.3],
            home: 1.57,
            ..JOINT
        }]
        .into_iter()
        .collect(),
        wrist: None,
        ..arm()
    }
}
