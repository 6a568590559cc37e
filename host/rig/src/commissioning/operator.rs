//! The operator of a simulated mechanism: scripts of the hand that do what a step asks for.

use mortise_mechanism::kinematics::Model;
use mortise_protocol::limits::{MAX_JOINTS, MAX_KEYFRAMES};
use mortise_protocol::message::{HandScript, Keyframe, WirePose};
use mortise_protocol::rig::Rig;

/// Angle by which it turns a joint, rad: more than a step needs.
const TURN: f32 = 0.2;
/// Share of its range that it moves a joint over, to either side.
const REACH: f32 = 0.9;
/// Time from one pose to the next, ticks.
const STRIDE: u32 = 400;

/// A hand that holds nothing.
pub fn loose() -> HandScript {
    HandScript {
        stiffness: 0.0,
        damping: 0.0,
        angular_stiffness: 0.0,
        angular_damping: 0.0,
        tremor: 0.0,
        tremor_hz: 0.0,
        keyframes: [Keyframe {
            tick: 0,
            pose: WirePose {
                position: [0.0; 3],
                orientation: [0.0, 0.0, 0.0, 1.0],
            },
            push: [0.0; 3],
        }]
        .into_iter()
        .collect(),
    }
}

/// A hand that leads the handle through these joint angles of the mechanism that `rig` describes, rad; poses that are no posture of its links are left
/// out. `None`: none is one.
pub fn lead(rig: &Rig, poses: &[[f32; MAX_JOINTS]]) -> Option<HandScript> {
    let model = Model::new(rig).ok()?;
    let wrist = rig.wrist.map_or([0.0; 3], |wrist| wrist.home);
    let postures = poses.iter().filter_map(|&angles| model.posture(angles, wrist));
    let keyframes: heapless::Vec<Keyframe, MAX_KEYFRAMES> = postures
        .take(MAX_KEYFRAMES)
        .enumerate()
        .map(|(number, posture)| Keyframe {
            tick: STRIDE * (1 + number as u32),
            pose: WirePose {
                position: posture.position.to_array(),
                orientation: posture.orientation.to_array(),
            },
            push: [0.0; 3],
        })
        .collect();
    (!keyframes.is_empty()).then_some(HandScript {
        stiffness: 3_000.0,
        damping: 30.0,
        angular_stiffness: 1.0,
        angular_damping: 0.05,
        tremor: 0.0,
        tremor_hz: 0.0,
        keyframes,
    })
}

/// Ticks after which the hand of [`turn`] rests in the reference pose, before it turns the joint.
pub const READY: u32 = 2 * STRIDE - 100;

/// A hand that brings the mechanism to its reference pose and then turns a joint forward. It knows the true mechanism, whatever its encoders say.
pub fn turn(rig: &Rig, joint: u8) -> Option<HandScript> {
    let home = homes(rig);
    let mut turned = home;
    *turned.get_mut(usize::from(joint))? += TURN;
    // It rests between the first two poses.
    lead(rig, &[home, home, turned])
}

/// A hand that leads every joint to both of its ends.
pub fn reach(rig: &Rig) -> Option<HandScript> {
    let home = homes(rig);
    let mut poses = Vec::new();
    for (number, joint) in rig.joints.iter().enumerate() {
        for end in joint.range {
            let mut pose = home;
            pose[number] += REACH * (end - joint.home);
            poses.push(pose);
        }
        poses.push(home);
    }
    lead(rig, &poses)
}

/// Angles of the reference pose, rad; 0 for an absent joint.
pub fn homes(rig: &Rig) -> [f32; MAX_JOINTS] {
    std::array::from_fn(|joint| rig.joints.get(joint).map_or(0.0, |joint| joint.home))
}
