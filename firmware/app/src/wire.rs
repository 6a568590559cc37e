//! Conversions between the types of the force law and the mechanism and those of the message table.

use glam::{Quat, Vec3};
use heapless::Vec;
use mortise_haptics::{FacePair, GuidanceState, Pose, Wrench};
use mortise_mechanism::interface::{DriverFault, DriverFaultKind};
use mortise_protocol::limits::MAX_PAIRS;
use mortise_protocol::message::{DriverReport, Guidance, TouchingPair, WirePose, WireWrench};

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

/// A motor driver's fault, for the wire.
pub fn driver_to_wire(fault: DriverFault) -> DriverReport {
    match fault.kind {
        DriverFaultKind::Any => DriverReport::Any(fault.axis),
        DriverFaultKind::OverCurrent => DriverReport::OverCurrent(fault.axis),
        DriverFaultKind::OverTemperature => DriverReport::OverTemperature(fault.axis),
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
