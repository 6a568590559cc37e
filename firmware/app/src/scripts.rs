//! Checks whether a simulated mechanism can follow a script; made by the link plane before the control plane takes one.

use mortise_protocol::message::{HandScript, InputFault, InputFaultKind, Refusal};

use crate::board::TICK_HZ;
use crate::wire::pose_from_wire;

/// Encoder axes: position x, y, z, rotation about x, y, z.
pub const AXES: usize = 6;

/// Largest stiffness of the operator model, N/m and N·m/rad: beyond it an f32 no longer resolves the spring's work.
pub const STIFFNESS_MAX: f32 = 1e6;
/// Largest push accepted, N.
pub const PUSH_MAX: f32 = 1e3;
/// Largest tremor accepted, m.
pub const TREMOR_MAX: f32 = 0.1;

/// Checks that a script can be followed: numbers finite and in range, at least one keyframe, ascending times.
pub fn check_script(script: &HandScript) -> Result<(), Refusal> {
    let in_range = |value: f32, max: f32| (0.0..=max).contains(&value);
    let springs = [
        script.stiffness,
        script.damping,
        script.angular_stiffness,
        script.angular_damping,
    ];
    let numbers = springs.iter().all(|&v| in_range(v, STIFFNESS_MAX))
        && in_range(script.tremor, TREMOR_MAX)
        && in_range(script.tremor_hz, 0.5 * f32::from(TICK_HZ));
    let frames = script.keyframes.iter().all(|frame| {
        pose_from_wire(&frame.pose).is_some() && frame.push.iter().all(|&p| in_range(p.abs(), PUSH_MAX))
    });
    let ascending = script.keyframes.windows(2).all(|w| w[0].tick < w[1].tick);
    if numbers && frames && ascending && !script.keyframes.is_empty() {
        Ok(())
    } else {
        Err(Refusal::BadNumber)
    }
}

/// Checks that a list of faults can be injected: their axes exist in this mechanism.
pub fn check_input_faults(faults: &[InputFault]) -> Result<(), Refusal> {
    let possible = |fault: &InputFault| match fault.kind {
        InputFaultKind::EncoderGlitch { axis, .. }
        | InputFaultKind::EncoderStuck { axis }
        | InputFaultKind::Driver { axis }
        | InputFaultKind::OverCurrent { axis }
        | InputFaultKind::OverTemperature { axis }
        | InputFaultKind::EncoderSense { axis, .. }
        | InputFaultKind::MotorSense { axis, .. }
        | InputFaultKind::MotorDead { axis } => usize::from(axis) < AXES,
        InputFaultKind::EncodersSwapped { axis, with } => usize::from(axis.max(with)) < AXES,
        InputFaultKind::NotANumber | InputFaultKind::StopOpen | InputFaultKind::SupplyLow => true,
    };
    if faults.iter().all(possible) {
        Ok(())
    } else {
        Err(Refusal::BadNumber)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_axis_that_is_none_is_refused() {
        let fault = |axis| InputFault {
            tick: 0,
            ticks: 1,
            kind: InputFaultKind::EncoderStuck { axis },
        };
        assert_eq!(check_input_faults(&[fault(5)]), Ok(()));
        assert_eq!(check_input_faults(&[fault(5), fault(6)]), Err(Refusal::BadNumber));
    }
}
