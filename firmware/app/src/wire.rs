//! Between the force law's types and the message table's.

use glam::{Quat, Vec3};
use heapless::Vec;
use mortise_haptics::{FacePair, Flags, GuidanceState, LimitSettings, Pose, Wrench};
use mortise_protocol::limits::MAX_PAIRS;
use mortise_protocol::message::{Guidance, TouchingPair, WirePose, WireWrench, flag};

/// A pose for the wire.
pub fn pose_to_wire(pose: &Pose) -> WirePose {
    WirePose {
        position: pose.position.to_array(),
        orientation: pose.orientation.to_array(),
    }
}

/// A pose from the wire; `None` when a number is not finite or the quaternion is not of unit length within 10⁻³.
pub fn pose_from_wire(wire: &WirePose) -> Option<Pose> {
    let position = Vec3::from_array(wire.position);
    let orientation = Quat::from_array(wire.orientation);
    let norm2 = orientation.length_squared();
    // A comparison with NaN is false.
    let unit = norm2 > 0.998 && norm2 < 1.002;
    (position.is_finite() && unit).then(|| Pose {
        position,
        orientation: orientation * (1.0 / libm::sqrtf(norm2)),
    })
}

/// A wrench for the wire.
pub fn wrench_to_wire(wrench: &Wrench) -> WireWrench {
    WireWrench {
        force: wrench.force.to_array(),
        torque: wrench.torque.to_array(),
    }
}

/// How targets stand, for the wire.
pub fn guidance_to_wire(state: &GuidanceState) -> Guidance {
    Guidance {
        active: state.active,
        joints: state.joints,
        engagement: state.engagement,
        wrench: wrench_to_wire(&state.wrench),
    }
}

/// Touching pairs for the wire.
pub fn pairs_to_wire(pairs: &[FacePair]) -> Vec<TouchingPair, MAX_PAIRS> {
    pairs
        .iter()
        .take(MAX_PAIRS)
        .map(|pair| TouchingPair {
            moving_face: pair.moving_face,
            static_part: pair.static_part,
            static_face: pair.static_face,
            moving_edge_face: pair.moving_edge_face,
            static_edge_face: pair.static_edge_face,
            count: pair.count,
            depth: pair.depth_m,
            point: pair.point.to_array(),
            insertion: pair.insertion_m,
        })
        .collect()
}

/// What the force law says was out of the ordinary, in the wire's bits. It has one flag for both limits: the one that `wrench` lies at is named.
pub fn flags_to_wire(flags: Flags, wrench: &Wrench, limits: &LimitSettings) -> u16 {
    let table = [
        (Flags::BUDGET_EXCEEDED, flag::BUDGET),
        (Flags::CONTACTS_DROPPED, flag::CONTACTS),
        (Flags::SATURATED_FORCE, flag::COUPLING_LIMIT),
        (Flags::SATURATED_TORQUE, flag::COUPLING_LIMIT),
        (Flags::SLEW_LIMITED, flag::SLEW_LIMIT),
        (Flags::SPEED_LIMITED, flag::SPEED_LIMIT),
        (Flags::SOFTENED, flag::SOFTENED),
        (Flags::DEEP, flag::DEEP),
        (Flags::UNSETTLED, flag::UNSETTLED),
        (Flags::BAD_INPUT, flag::NON_FINITE),
        (Flags::NON_FINITE, flag::NON_FINITE),
    ];
    let mut wire = 0;
    if flags.intersects(Flags::LIMITED) {
        // A thousandth below the limit is at it: scaling to a length rounds.
        let at = |length2: f32, limit: f32| length2 >= limit * limit * 0.998;
        if at(wrench.force.length_squared(), limits.force_n) {
            wire |= flag::FORCE_LIMIT;
        }
        if at(wrench.torque.length_squared(), limits.torque_nm) {
            wire |= flag::TORQUE_LIMIT;
        }
    }
    for (ours, theirs) in table {
        if flags.intersects(ours) {
            wire |= theirs;
        }
    }
    wire
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whatever the force law flags reaches the host, each by itself and told from nothing.
    #[test]
    fn no_flag_is_lost() {
        let limits = LimitSettings {
            force_n: 10.0,
            torque_nm: 0.5,
            ..mortise_haptics::Settings::default().limits
        };
        let at = |force: f32, torque: f32| Wrench {
            force: Vec3::new(0.0, force, 0.0),
            torque: Vec3::new(torque, 0.0, 0.0),
        };
        for (flag, name) in Flags::NAMES {
            assert_ne!(flags_to_wire(flag, &at(10.0, 0.0), &limits), 0, "{name}");
        }
        assert_eq!(flags_to_wire(Flags::empty(), &at(10.0, 0.5), &limits), 0);
        assert_eq!(
            flags_to_wire(Flags::LIMITED, &at(10.0, 0.1), &limits),
            flag::FORCE_LIMIT
        );
        assert_eq!(
            flags_to_wire(Flags::LIMITED, &at(1.0, 0.5), &limits),
            flag::TORQUE_LIMIT
        );
    }
}
