//! Scripts of a scenario's operator model for a simulated rig: the motion to the grip point, then the keyframes.

use glam::{DQuat, DVec3};
use mortise_protocol::message::{HandScript, Keyframe};

use crate::scenario::{Hand, Key};
use crate::wire::wire_pose;

/// Tick rate of every simulated rig, Hz.
pub const TICK_HZ: f64 = 1000.0;
/// Ticks in which the hand moves the handle to the grip point.
pub const REACH_TICKS: u32 = 300;
/// Ticks in which it comes to rest there.
pub const REST_TICKS: u32 = 200;

fn with_keyframes(hand: &Hand, keyframes: impl Iterator<Item = Keyframe>) -> HandScript {
    HandScript {
        stiffness: hand.stiffness_n_per_m,
        damping: hand.damping_n_s_per_m,
        angular_stiffness: hand.angular_stiffness_n_m_per_rad,
        angular_damping: hand.angular_damping_n_m_s_per_rad,
        tremor: (1e-3 * hand.tremor_mm) as f32,
        tremor_hz: hand.tremor_hz,
        keyframes: keyframes.collect(),
    }
}

/// Motion from the start of a simulated handle (the world's origin) to the grip point, without tremor.
pub fn reach(hand: &Hand) -> HandScript {
    let keyframe = |tick, position_mm| Keyframe {
        tick,
        pose: wire_pose(position_mm, DQuat::IDENTITY),
        push: [0.0; 3],
    };
    let way = [
        keyframe(0, DVec3::ZERO),
        keyframe(REACH_TICKS, DVec3::from_array(hand.grip_mm)),
    ];
    HandScript {
        tremor: 0.0,
        ..with_keyframes(hand, way.into_iter())
    }
}

/// Motion from the grip point along the scenario's keyframes.
pub fn script(hand: &Hand) -> HandScript {
    let grip = DVec3::from_array(hand.grip_mm);
    let keyframe = |key: &Key| Keyframe {
        tick: (key.t_s * TICK_HZ).round() as u32,
        pose: wire_pose(
            grip + DVec3::from_array(key.offset_mm),
            DQuat::from_scaled_axis(DVec3::from_array(key.turn_deg.map(f64::to_radians))),
        ),
        push: key.push_n,
    };
    with_keyframes(hand, hand.keyframes.iter().map(keyframe))
}
