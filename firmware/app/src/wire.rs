//! Conversions between the force law's types and those of the message table.

use glam::{Quat, Vec3};
use heapless::Vec;
use mortise_haptics::{FacePair, Flags, GuidanceState, Pose, Wrench};
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

/// The targets' state, for the wire.
pub fn guidance_to_wire(state: &GuidanceState) -> Guidance {
    Guidance {
        active: state.active,
        joints: state.exclusions,
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

/// Each flag of the force law and its bit on the wire.
pub const FLAGS_ON_WIRE: [(Flags, u16); Flags::NAMES.len()] = [
    (Flags::BUDGET_EXCEEDED, flag::BUDGET),
    (Flags::CONTACTS_DROPPED, flag::CONTACTS),
    (Flags::UNSETTLED, flag::UNSETTLED),
    (Flags::DEEP, flag::DEEP),
    (Flags::SPEED_LIMITED, flag::SPEED_LIMIT),
    (Flags::SATURATED_FORCE, flag::COUPLING_FORCE),
    (Flags::SATURATED_TORQUE, flag::COUPLING_TORQUE),
    (Flags::FORCE_LIMITED, flag::FORCE_LIMIT),
    (Flags::TORQUE_LIMITED, flag::TORQUE_LIMIT),
    (Flags::FORCE_SLEW_LIMITED, flag::FORCE_SLEW),
    (Flags::TORQUE_SLEW_LIMITED, flag::TORQUE_SLEW),
    (Flags::BAD_INPUT, flag::BAD_INPUT),
    (Flags::NON_FINITE, flag::NON_FINITE),
    (Flags::SOFTENED, flag::SOFTENED),
];

/// The force law's flags as the wire's bits.
pub fn flags_to_wire(flags: Flags) -> u16 {
    let mut wire = 0;
    for (ours, theirs) in FLAGS_ON_WIRE {
        if flags.intersects(ours) {
            wire |= theirs;
        }
    }
    wire
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every flag of the force law maps to one bit that no other flag sets.
    #[test]
    fn each_flag_has_a_bit_of_its_own() {
        let mut taken = 0u16;
        for (flag, name) in Flags::NAMES {
            let bit = flags_to_wire(flag);
            assert_eq!(bit.count_ones(), 1, "{name}");
            assert_eq!(taken & bit, 0, "{name} shares its bit");
            assert!(flag::ALL.iter().any(|(known, ..)| *known == bit), "{name}");
            taken |= bit;
        }
        assert_eq!(flags_to_wire(Flags::empty()), 0);
        // The one bit that the board sets and the force law does not.
        let all = flag::ALL.iter().fold(0, |all, (bit, ..)| all | bit);
        assert_eq!(all & !taken, flag::PAIRS);
    }
}
