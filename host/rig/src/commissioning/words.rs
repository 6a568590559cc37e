//! Commissioning in words for the operator.

use mortise_protocol::rig::{Kinematics, Rig};

use super::step::Step;
use super::verdict::{Reached, TURN};

/// What the operator does in a step; `None`: all are done.
pub(super) fn instruction(step: Option<Step>, rig: &Rig) -> String {
    match step {
            None => "Every step is done: the rig is as described.".into(),
            Some(Step::Encoder(joint)) => format!(
                "Motors stay off. {} by {:.0}° or more, and hold the other joints still.",
                forward(&rig.kinematics, joint),
                TURN.to_degrees()
            ),
            Some(Step::Send) => "The description differs from the one on the board. Sending it restarts the board.".into(),
            Some(Step::Reference) => format!(
                "Hold the mechanism in its reference pose ({}), then set the reference.",
                home(rig)
            ),
            Some(Step::StopInput) => "Press the stop button, then release it.".into(),
            Some(Step::Motor(joint)) => format!(
                "Keep clear of the mechanism and have the stop button within reach. Motor {} pushes for 30 ms, forward and then backward, with about 1 N at the handle.",
                joint + 1
            ),
            Some(Step::Workspace) => {
                "Motors stay off. Move the handle along the limits of its workspace, so that every joint reaches both of its ends.".into()
            }
        }
}

/// How the operator turns a joint forward.
fn forward(kinematics: &Kinematics, joint: u8) -> &'static str {
    match (kinematics, joint) {
        (Kinematics::Paddle { .. }, _) => {
            "Turn the paddle counter-clockwise, seen against the z axis of its description,"
        }
        (Kinematics::Pantograph { .. }, 0) => {
            "Turn the left motor's link counter-clockwise, seen from above,"
        }
        (Kinematics::Pantograph { .. }, _) => {
            "Turn the right motor's link counter-clockwise, seen from above,"
        }
        (Kinematics::SerialArm { .. }, 0) => "Turn the arm counter-clockwise, seen from above,",
        (Kinematics::SerialArm { .. }, 1) => "Tilt the upper link forward",
        (Kinematics::SerialArm { .. }, _) => "Swing the lower link forward and up",
    }
}

/// The joint angles of the reference pose.
fn home(rig: &Rig) -> String {
    let angles = rig.joints.iter().enumerate();
    let angles =
        angles.map(|(number, joint)| format!("joint {} at {:.0}°", number + 1, joint.home.to_degrees()));
    angles.collect::<Vec<_>>().join(", ")
}

pub(super) fn nothing_to_send() -> String {
    "nothing to correct".into()
}

pub(super) fn sent() -> String {
    "the board uses the corrected description".into()
}

pub(super) fn referenced() -> String {
    "set".into()
}

pub(super) fn encoder_counts(joint: u8) -> String {
    format!("encoder {} counts forward", joint + 1)
}

pub(super) fn encoder_corrected(joint: u8, reversed: bool) -> String {
    format!(
        "encoder {} counts backward: encoder_reversed is now {reversed}",
        joint + 1
    )
}

pub(super) fn encoder_still(joint: u8) -> String {
    format!(
        "encoder {} does not count: check its plug, its supply and both of its channels, then turn the joint again",
        joint + 1
    )
}

pub(super) fn turn_farther(joint: u8, turned: f32) -> String {
    format!(
        "joint {} was turned by {:.1}°: turn it farther; if it did turn farther, counts_per_turn or gear is wrong",
        joint + 1,
        turned.to_degrees()
    )
}

pub(super) fn encoder_elsewhere(joint: u8, other: u8) -> String {
    format!(
        "encoder {} counts when joint {} is turned: the plugs of the two encoders are swapped, or another joint was turned",
        other + 1,
        joint + 1
    )
}

pub(super) fn stop_works() -> String {
    "opens when pressed, closes when released".into()
}

pub(super) fn stop_is_open() -> String {
    "the stop input is open although nobody has pressed yet: release the button; if it is released, its wire is broken or unplugged".into()
}

pub(super) fn stop_never_opened() -> String {
    "the stop input did not open: the button does not interrupt its wire, or the input is bridged; do not arm this rig".into()
}

pub(super) fn stop_stays_open() -> String {
    "the stop input is still open: release the button; if it is released, it is stuck or its wire is broken"
        .into()
}

pub(super) fn motor_pushes(joint: u8) -> String {
    format!("motor {} pushes forward", joint + 1)
}

pub(super) fn motor_corrected(joint: u8, reversed: bool) -> String {
    format!(
        "motor {} pushes backward: motor_reversed is now {reversed}",
        joint + 1
    )
}

pub(super) fn motor_still(joint: u8) -> String {
    format!(
        "motor {} moves nothing: check its wires, the supply of its driver and the driver's enable line, and that the joint moves freely",
        joint + 1
    )
}

pub(super) fn motor_elsewhere(joint: u8, other: u8) -> String {
    format!(
        "motor {} moves joint {}: the wires of the two motors are swapped",
        joint + 1,
        other + 1
    )
}

pub(super) fn motor_unclear(joint: u8) -> String {
    format!(
        "joint {} moves the same way under both pushes: gravity or a hand moves it; support the mechanism without holding it, and test again",
        joint + 1
    )
}

pub(super) fn range(joint: u8, reached: [f32; 2], found: Reached) -> String {
    let [from, to] = reached.map(f32::to_degrees);
    let span = format!("joint {} from {from:.0}° to {to:.0}°", joint + 1);
    match found {
        Reached::Whole => span,
        Reached::Part(share) => format!("{span}, {:.0} % of its range", 100.0 * share),
        Reached::Beyond => format!("{span}, beyond its range, which is now wider"),
    }
}

pub(super) fn changes(from: &Rig, to: &Rig) -> Vec<String> {
    let mut words = Vec::new();
    for (number, (before, after)) in from.joints.iter().zip(&to.joints).enumerate() {
        let number = number + 1;
        if before.encoder_reversed != after.encoder_reversed {
            words.push(format!(
                "joint {number}: encoder_reversed = {}",
                after.encoder_reversed
            ));
        }
        if before.motor_reversed != after.motor_reversed {
            words.push(format!(
                "joint {number}: motor_reversed = {}",
                after.motor_reversed
            ));
        }
        if before.range != after.range {
            let [low, high] = after.range.map(f32::to_degrees);
            words.push(format!("joint {number}: range_deg = [{low:.0}, {high:.0}]"));
        }
    }
    words
}
