//! The board's messages in words for the operator: what happened, and what to do.

use mortise_protocol::message::{DeviceState, Fault, Flags, Refusal, ResetReason, ToDevice};

/// An item of the protocol that can be expressed in words.
pub trait Words {
    /// One sentence without a full stop: what it is and, where the operator can act, what to do.
    fn words(&self) -> String;
}

/// The words of a refusal, fault or state; see [`Words`].
pub fn describe<W: Words>(what: W) -> String {
    what.words()
}

impl<W: Words> Words for &W {
    fn words(&self) -> String {
        (**self).words()
    }
}

/// The words of a telemetry sample's flags, most important first.
pub fn describe_flags(flags: u16) -> impl Iterator<Item = &'static str> {
    Flags::from_bits_retain(flags).rows().map(|row| row.words)
}

impl Words for DeviceState {
    fn words(&self) -> String {
        match self {
            Self::Boot => "starting, motors off".into(),
            Self::Homing => {
                "waiting for its reference, motors off: bring the handle to its marked pose, then set the reference".into()
            }
            Self::Idle => "idle, motors off".into(),
            Self::Armed => "armed, nothing grabbed".into(),
            Self::Active => "active, a part is grabbed".into(),
            Self::SoftStop => "stopping softly".into(),
            Self::Stopped => "stopped, motors off until cleared".into(),
            Self::Fault(fault) => format!("fault: {}", fault.words()),
            Self::Testing => "testing a motor".into(),
        }
    }
}

impl Words for Fault {
    fn words(&self) -> String {
        match self {
            Self::StopInput => "the stop input is open: release the stop button or check its wire, then clear the fault".into(),
            Self::HostSilent { silent_ms } => {
                format!("the board received nothing from this computer for {silent_ms} ms: check the cable and the load of this computer, then clear the fault")
            }
            Self::EncoderJump { axis } => {
                format!("the encoder of axis {axis} jumped further than the mechanism can move: check its plug and cable, then clear the fault")
            }
            Self::EncoderStuck { axis } => {
                format!("the encoder of axis {axis} does not follow its motor: check its plug and look for a jam, then clear the fault")
            }
            Self::OverSpeed => "the handle moved faster than allowed: hold it still, then clear the fault".into(),
            Self::Workspace => "the handle left the workspace: bring it back, then clear the fault".into(),
            Self::Driver { axis } => {
                format!("the motor driver of axis {axis} reports too much current or heat: let it cool and look for a jam, then clear the fault")
            }
            Self::OverCurrent { axis } => {
                format!("the motor driver of axis {axis} reports too much current: look for a jam or a short circuit, then clear the fault")
            }
            Self::OverTemperature { axis } => {
                format!("the motor driver of axis {axis} is too hot: let it cool, then clear the fault")
            }
            Self::SupplyLow => "the supply of the board is too low: check the power supply and its cable, then clear the fault".into(),
            Self::TickOverrun => {
                "a tick took longer than its millisecond: use a smaller point budget or a coarser collision model, then clear the fault".into()
            }
            Self::SceneDamaged => "the collision model in the board's flash no longer passes its checks: upload it again".into(),
            Self::NonFinite => "the computed force is not finite: reset the parts, then clear the fault".into(),
            Self::AngularOverSpeed => "the handle turned faster than allowed: hold it still, then clear the fault".into(),
            Self::ReferenceLost => {
                "the encoders have lost their reference: clear the fault, bring the handle to its marked pose, then set the reference".into()
            }
            Self::ImpossiblePosture => {
                "the encoders report an impossible posture of the links: check their plugs and the reference, then clear the fault".into()
            }
            Self::BadReading => {
                "a sensor reading is not a number or out of range: check the sensors' cables, then clear the fault".into()
            }
        }
    }
}

impl Words for ResetReason {
    fn words(&self) -> String {
        match self {
            Self::PowerOn => "the board started with its power or reset button".into(),
            Self::Requested => "the board restarted on request".into(),
            Self::Watchdog => "the board restarted: its watchdog found the force loop stalled".into(),
            Self::Panic { line } => format!("the board restarted after a panic in line {line}"),
            Self::HardFault { pc } => format!("the board restarted after a processor fault at {pc:#010x}"),
            Self::BrownOut => {
                "the board restarted because its supply fell too low: check the power supply".into()
            }
            Self::Unknown => "the board does not know why it started".into(),
        }
    }
}

impl Words for Refusal {
    fn words(&self) -> String {
        match self {
            Self::NotGreeted => "the board has not been greeted by a program of its own version: connect again".into(),
            Self::State(state) => format!("not possible while the board is {}{}", state.words(), hint(state)),
            Self::NoScene => "there is no collision model on the board: upload one".into(),
            Self::NoSuchPart { parts: 0 } => "the collision model on the board has no parts: upload another".into(),
            Self::NoSuchPart { parts } => format!("the collision model has no such part, only 0 to {}", parts - 1),
            Self::NotGrabbable => "this part is fixed: bake the collision model with it grabbable, or choose another".into(),
            Self::OutOfRange { id, min, max } => {
                let row = id.row();
                format!("{} must be a number from {min} to {max} {}", row.name, row.unit)
            }
            Self::ChunkOrder { expected } => {
                format!("a chunk of the collision model is out of order, byte {expected} was expected: upload it again")
            }
            Self::NoUpload => "no upload is under way (a restart may have ended it): upload the collision model again".into(),
            Self::SceneTooLarge { capacity } => {
                format!("the collision model is larger than the {capacity} bytes the board can hold: bake it coarser or with fewer parts")
            }
            Self::TooManyParts { capacity } => {
                format!("the collision model has more parts than the {capacity} the board can hold: bake fewer parts")
            }
            Self::SceneIncomplete { received } => {
                format!("only {received} bytes of the collision model have arrived: upload it again")
            }
            Self::SceneCrc { expected, found } => format!(
                "the collision model arrived damaged (checksum {found:08x} instead of {expected:08x}): check the cable and upload it again"
            ),
            Self::SceneImage(error) => error.to_string(),
            Self::Flash => "the board's flash could not be erased or written: upload the collision model again; if it repeats, the flash is worn out".into(),
            Self::NotSimulated => "only a simulated mechanism can do this, and this one is real".into(),
            Self::Lockstep => "the board is not in lockstep, or still has ticks to run: switch lockstep on and wait for the last run".into(),
            Self::BadNumber => "a number is not finite or not possible".into(),
            Self::Busy => "the board's queue is full: try again".into(),
            Self::Rig(fault) => fault.words(),
            Self::RigFixed => "this board's mechanism is compiled into its firmware: change it there, or use a board that takes a description".into(),
            Self::RigDamaged => "the board has no sound description of its rig in use (none was sent, it is damaged, or it is of another release): send it (`mortise rig send`), which restarts the board".into(),
            Self::Outdated => {
                "the command came late, twice, or from before the board's last stop, fault or greeting, and was not executed: check the rig, then repeat the command; if this recurs, connect again".into()
            }
            Self::NoSuchMotor { motors: 0 } => "without a description of its rig the board cannot test single motors: send one (`mortise rig send`)".into(),
            Self::NoSuchMotor { motors } => format!("the mechanism has no such joint, only 1 to {motors}"),
            Self::Undecodable => "the board did not understand the message: flash the firmware of this release".into(),
        }
    }
}

fn hint(state: &DeviceState) -> &'static str {
    match state {
        DeviceState::Armed | DeviceState::Active | DeviceState::SoftStop => " (disarm first)",
        DeviceState::Stopped => " (clear the stop first)",
        DeviceState::Idle => " (arm first)",
        DeviceState::Boot | DeviceState::Testing => " (wait a moment)",
        DeviceState::Homing => "",
        DeviceState::Fault(_) => "",
    }
}

impl Words for ToDevice {
    fn words(&self) -> String {
        match self {
            Self::Hello(_) => "the greeting".into(),
            Self::GetCapabilities => "reading the board's capabilities".into(),
            Self::Arm => "arming".into(),
            Self::Disarm => "disarming".into(),
            Self::Stop => "stopping".into(),
            Self::ClearFault => "clearing the stop or fault".into(),
            Self::Home => "setting the reference".into(),
            Self::Heartbeat => "the heartbeat".into(),
            Self::SetParameter { id, value } => {
                format!("setting {} to {value} {}", id.row().name, id.row().unit)
            }
            Self::GetParameter(id) => format!("reading {}", id.row().name),
            Self::Grab { part } => format!("grabbing part {part}"),
            Self::Release => "releasing the part".into(),
            Self::ResetScene => "resetting the parts".into(),
            Self::SceneBegin { length, .. } => format!("uploading a collision model of {length} bytes"),
            Self::SceneChunk { offset, .. } => format!("uploading the collision model from byte {offset}"),
            Self::SceneCommit => "activating the new collision model".into(),
            Self::SceneAbort => "cancelling the upload".into(),
            Self::SetTarget(target) => format!("setting constraint target {}", target.id),
            Self::ClearTarget { id } => format!("clearing constraint target {id}"),
            Self::SetTelemetry { every_ticks } => format!("requesting telemetry every {every_ticks} ticks"),
            Self::GetStatistics { .. } => "reading the counters".into(),
            Self::SimulatedHand(_) => "sending the simulated hand its script".into(),
            Self::SimulatedInputs(_) => "sending the simulated inputs their faults".into(),
            Self::Lockstep(true) => "switching lockstep on".into(),
            Self::Lockstep(false) => "switching lockstep off".into(),
            Self::Run { ticks } => format!("running {ticks} ticks"),
            Self::Restart => "restarting the board".into(),
            Self::SetRig(rig) => format!("sending the description of `{}`", rig.name),
            Self::GetRig => "reading the description of the rig".into(),
            Self::RecordInputs(true) => "recording the inputs of every tick".into(),
            Self::RecordInputs(false) => "ending the recording of inputs".into(),
            Self::GetReadings => "reading encoders and inputs".into(),
            Self::Place { part, .. } => format!("placing part {part}"),
            Self::TestMotor { joint, .. } => format!("testing the motor of joint {}", joint + 1),
        }
    }
}

#[cfg(test)]
mod tests {
    use mortise_protocol::image::ImageError;
    use mortise_protocol::parameter::ParameterId;

    use super::*;

    /// The number in the words of a fault, in place of an axis or a time.
    const NUMBER: u16 = 77;

    /// Checks for a single line without a full stop, long enough to carry a meaning: it is inserted into messages.
    fn is_a_sentence(words: &str) {
        assert!(words.len() > 12, "{words}");
        assert!(!words.contains('\n') && !words.ends_with('.'), "{words}");
        assert!(words.is_ascii() || words.contains('·'), "{words}");
    }

    #[test]
    fn every_fault_says_what_to_do() {
        for fault in Fault::every(NUMBER) {
            let words = describe(fault);
            is_a_sentence(&words);
            assert!(words.contains(": "), "what, then what to do: {words}");
        }
    }

    /// The safety page's operator messages and the protocol page's flags must equal those of the code.
    #[test]
    fn the_pages_have_the_same_words() {
        let read = |name: &str| {
            let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/").to_owned() + name;
            std::fs::read_to_string(path).expect("the page is there")
        };
        let safety = read("safety.md");
        for fault in Fault::every(NUMBER) {
            // In safety.md an axis is written n, and a time n ms.
            let words = describe(fault).replace(&format!(" {NUMBER}"), " n");
            assert!(safety.contains(&format!("\"{words}\"")), "{words}");
        }
        let protocol = read("protocol.md");
        for row in Flags::ROWS {
            let row = format!(
                "| {} | `{}` | {} | {} |",
                row.flag.bits().trailing_zeros(),
                row.name,
                row.meaning,
                row.words
            );
            assert!(protocol.contains(&row), "{row}");
        }
    }

    #[test]
    fn every_refusal_is_a_sentence() {
        for refusal in [
            Refusal::NotGreeted,
            Refusal::State(DeviceState::Active),
            Refusal::State(DeviceState::Fault(Fault::OverSpeed)),
            Refusal::NoScene,
            Refusal::NoSuchPart { parts: 0 },
            Refusal::NoSuchPart { parts: 3 },
            Refusal::NotGrabbable,
            Refusal::OutOfRange {
                id: ParameterId::ForceLimit,
                min: 0.0,
                max: 20.0,
            },
            Refusal::ChunkOrder { expected: 512 },
            Refusal::NoUpload,
            Refusal::SceneTooLarge { capacity: 1000 },
            Refusal::TooManyParts { capacity: 256 },
            Refusal::SceneIncomplete { received: 10 },
            Refusal::SceneCrc {
                expected: 1,
                found: 2,
            },
            Refusal::SceneImage(ImageError::BadMagic),
            Refusal::Flash,
            Refusal::NotSimulated,
            Refusal::Lockstep,
            Refusal::BadNumber,
            Refusal::Busy,
            Refusal::Rig(mortise_protocol::rig::RigFault::Linkage),
            Refusal::RigFixed,
            Refusal::RigDamaged,
            Refusal::Undecodable,
            Refusal::Outdated,
            Refusal::NoSuchMotor { motors: 0 },
            Refusal::NoSuchMotor { motors: 3 },
        ] {
            is_a_sentence(&describe(refusal));
        }
    }
}
