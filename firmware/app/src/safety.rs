//! The safety state machine as a pure function of state and event.
//!
//! Whether the motors may be driven follows from the state alone ([`Safety::motors`]); nothing else in the firmware enables them.
//! `docs/safety.md` has the diagram; the tests below try every event in every state.

use mortise_protocol::message::{DeviceState, Fault, Refusal};

/// The safety state. The host sees it as [`DeviceState`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Safety {
    /// Starting: sensors not yet read.
    Boot,
    /// Motors off; the encoders have no reference.
    Homing,
    /// Motors off, ready to arm.
    Idle,
    /// Motors on, nothing grabbed: zero wrench.
    Armed,
    /// A part is grabbed and rendered.
    Active,
    /// Wrench fading out under damping.
    SoftStop(AfterSoftStop),
    /// Motors off until cleared.
    Stopped,
    /// Motors off until the cause is gone and the fault is cleared.
    Fault(Fault),
    /// A single motor pushes for a moment, with nothing grabbed.
    Testing,
}

/// State that follows a soft stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AfterSoftStop {
    /// Disarmed by the host.
    Idle,
    /// The host fell silent, or the scene is damaged.
    Fault(Fault),
}

/// What the motors may render.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motors {
    /// Enable output inactive.
    Off,
    /// Driven with zero wrench.
    Zero,
    /// Driven with the force law's wrench.
    Rendered,
    /// Driven with the fading last wrench and damping.
    Fading,
    /// One motor driven with the push of its test, the others with zero current.
    Tested,
}

/// Input of the state machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// The first sensor readings are in.
    Ready,
    /// The encoders have a reference.
    Referenced,
    /// The encoders have lost their reference.
    ReferenceLost,
    /// The host requests arming.
    Arm {
        /// There is a scene, and its checksum was verified.
        scene: bool,
        /// The encoders have a reference.
        referenced: bool,
    },
    /// The host requests disarming.
    Disarm,
    /// The host requests a stop.
    Stop,
    /// The host requests to leave Stopped or Fault.
    Clear {
        /// No cause of a fault is present in this tick.
        cause_gone: bool,
    },
    /// The host requests to grab a part that can be grabbed.
    Grab,
    /// The host requests release of the part.
    Release,
    /// A fault was detected.
    Fault(Fault),
    /// The fade has ended.
    SoftStopOver,
    /// The host requests the test of a motor.
    Test {
        /// The encoders have a reference.
        referenced: bool,
    },
    /// The test has ended.
    TestOver,
}

/// Action of a plane on entering the new state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Action {
    /// Nothing.
    None,
    /// Motors on with zero wrench, ramp from zero.
    Enable,
    /// Couple the part, ramp from zero.
    Couple,
    /// Uncouple the part; zero wrench from here on.
    Uncouple,
    /// Uncouple the part; fade the wrench out.
    Fade,
    /// Motors off now; uncouple the part.
    Off,
    /// The request is not allowed in this state.
    Refuse(Refusal),
}

/// Whether the motors' position is still known under this fault: a damped fade is then gentler than switching off at once.
pub const fn fades(fault: Fault) -> bool {
    matches!(
        fault,
        Fault::HostSilent { .. } | Fault::SceneDamaged | Fault::Workspace
    )
}

impl Safety {
    /// The state as reported to the host.
    pub const fn reported(self) -> DeviceState {
        match self {
            Self::Boot => DeviceState::Boot,
            Self::Homing => DeviceState::Homing,
            Self::Idle => DeviceState::Idle,
            Self::Armed => DeviceState::Armed,
            Self::Active => DeviceState::Active,
            Self::SoftStop(_) => DeviceState::SoftStop,
            Self::Stopped => DeviceState::Stopped,
            Self::Fault(fault) => DeviceState::Fault(fault),
            Self::Testing => DeviceState::Testing,
        }
    }

    /// What the motors may do.
    pub const fn motors(self) -> Motors {
        match self {
            Self::Boot | Self::Homing | Self::Idle | Self::Stopped | Self::Fault(_) => Motors::Off,
            Self::Armed => Motors::Zero,
            Self::Active => Motors::Rendered,
            Self::SoftStop(_) => Motors::Fading,
            Self::Testing => Motors::Tested,
        }
    }

    /// Whether the motors are driven.
    pub const fn live(self) -> bool {
        !matches!(self.motors(), Motors::Off)
    }

    /// The next state and the action on the way. Total: defined for every event in every state.
    pub const fn step(self, event: Event) -> (Self, Action) {
        use Safety::*;
        match (self, event) {
            // The first fault is kept: it is the cause, later ones may be its effects.
            (Fault(_), Event::Fault(_)) => (self, Action::None),
            (Armed | Active, Event::Fault(fault)) if fades(fault) => {
                (SoftStop(AfterSoftStop::Fault(fault)), Action::Fade)
            }
            (SoftStop(AfterSoftStop::Idle), Event::Fault(fault)) if fades(fault) => {
                (SoftStop(AfterSoftStop::Fault(fault)), Action::None)
            }
            (SoftStop(AfterSoftStop::Fault(_)), Event::Fault(fault)) if fades(fault) => (self, Action::None),
            (_, Event::Fault(fault)) => (Fault(fault), Action::Off),

            // A fault stays a fault under STOP: its cause must still be inspected.
            (Fault(_), Event::Stop) => (self, Action::Off),
            (SoftStop(AfterSoftStop::Fault(fault)), Event::Stop) => (Fault(fault), Action::Off),
            (_, Event::Stop) => (Stopped, Action::Off),

            (Boot, Event::Ready) => (Idle, Action::None),
            (_, Event::Ready) => (self, Action::None),

            (Homing, Event::Referenced) => (Idle, Action::None),
            (_, Event::Referenced) => (self, Action::None),
            // While motors are driven a lost reference comes with a fault, and is checked again on the way to Idle.
            (Idle, Event::ReferenceLost) => (Homing, Action::None),
            (_, Event::ReferenceLost) => (self, Action::None),

            (
                Idle,
                Event::Arm {
                    scene: true,
                    referenced: true,
                },
            ) => (Armed, Action::Enable),
            (Idle, Event::Arm { scene: false, .. }) => (self, Action::Refuse(Refusal::NoScene)),
            (Idle, Event::Arm { .. }) => (self, Action::Refuse(Refusal::State(DeviceState::Homing))),
            (Armed, Event::Grab) => (Active, Action::Couple),
            (Active, Event::Release) => (Armed, Action::Uncouple),
            (Armed, Event::Release) => (self, Action::None),

            (Idle, Event::Test { referenced: true }) => (Testing, Action::Enable),
            (Idle, Event::Test { .. }) => (self, Action::Refuse(Refusal::State(DeviceState::Homing))),
            // Its force is small and it moves slowly: off at once.
            (Testing, Event::TestOver | Event::Disarm) => (Idle, Action::Off),
            (_, Event::TestOver) => (self, Action::None),

            (Armed | Active, Event::Disarm) => (SoftStop(AfterSoftStop::Idle), Action::Fade),
            (_, Event::Disarm) => (self, Action::None),

            (Stopped, Event::Clear { cause_gone: true }) => (Idle, Action::None),
            (Fault(_), Event::Clear { cause_gone: true }) => (Idle, Action::None),
            (Idle | Homing, Event::Clear { .. }) => (self, Action::None),

            (SoftStop(AfterSoftStop::Idle), Event::SoftStopOver) => (Idle, Action::Off),
            (SoftStop(AfterSoftStop::Fault(fault)), Event::SoftStopOver) => (Fault(fault), Action::Off),
            (_, Event::SoftStopOver) => (self, Action::None),

            (
                _,
                Event::Arm { .. } | Event::Grab | Event::Release | Event::Clear { .. } | Event::Test { .. },
            ) => (self, Action::Refuse(Refusal::State(self.reported()))),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::format;
    use std::string::{String, ToString};
    use std::vec::Vec;

    use super::*;

    /// One fault that fades and one that does not; together they represent all, see `every_fault_is_of_one_kind`.
    const FADING: Fault = Fault::HostSilent { silent_ms: 500 };
    const SUDDEN: Fault = Fault::StopInput;

    const STATES: [(&str, Safety); 10] = [
        ("Boot", Safety::Boot),
        ("Homing", Safety::Homing),
        ("Idle", Safety::Idle),
        ("Armed", Safety::Armed),
        ("Active", Safety::Active),
        ("SoftStop (disarming)", Safety::SoftStop(AfterSoftStop::Idle)),
        (
            "SoftStop (fault)",
            Safety::SoftStop(AfterSoftStop::Fault(Fault::SceneDamaged)),
        ),
        ("Stopped", Safety::Stopped),
        ("Fault", Safety::Fault(Fault::OverSpeed)),
        ("Testing", Safety::Testing),
    ];

    const ARM: Event = Event::Arm {
        scene: true,
        referenced: true,
    };

    const TEST: Event = Event::Test { referenced: true };

    const EVENTS: [(&str, Event); 18] = [
        ("ready", Event::Ready),
        ("reference known", Event::Referenced),
        ("reference lost", Event::ReferenceLost),
        ("arm", ARM),
        (
            "arm, no sound scene",
            Event::Arm {
                scene: false,
                referenced: true,
            },
        ),
        (
            "arm, no reference",
            Event::Arm {
                scene: true,
                referenced: false,
            },
        ),
        ("disarm", Event::Disarm),
        ("STOP", Event::Stop),
        ("clear", Event::Clear { cause_gone: true }),
        ("clear, cause there", Event::Clear { cause_gone: false }),
        ("grab", Event::Grab),
        ("release", Event::Release),
        ("fading fault", Event::Fault(FADING)),
        ("sudden fault", Event::Fault(SUDDEN)),
        ("fade over", Event::SoftStopOver),
        ("test a motor", TEST),
        ("test a motor, no reference", Event::Test { referenced: false }),
        ("test over", Event::TestOver),
    ];

    fn name(state: Safety) -> &'static str {
        match state {
            Safety::Boot => "Boot",
            Safety::Homing => "Homing",
            Safety::Idle => "Idle",
            Safety::Armed => "Armed",
            Safety::Active => "Active",
            Safety::SoftStop(_) => "SoftStop",
            Safety::Stopped => "Stopped",
            Safety::Fault(_) => "Fault",
            Safety::Testing => "Testing",
        }
    }

    /// One cell of the table: the next state, a refusal, or no effect.
    fn cell(state: Safety, event: Event) -> String {
        match state.step(event) {
            (_, Action::Refuse(_)) => "refused".to_string(),
            (next, _) if next == state => "–".to_string(),
            (next, _) => format!("**{}**", name(next)),
        }
    }

    fn table() -> String {
        let mut rows = Vec::new();
        let states: Vec<&str> = STATES.iter().map(|(name, _)| *name).collect();
        rows.push(format!("| event | {} |", states.join(" | ")));
        rows.push(format!("|---|{}", "---|".repeat(STATES.len())));
        for (event_name, event) in EVENTS {
            let cells: Vec<String> = STATES.iter().map(|&(_, state)| cell(state, event)).collect();
            rows.push(format!("| {event_name} | {} |", cells.join(" | ")));
        }
        rows.join("\n")
    }

    #[test]
    fn the_table_in_the_documentation_is_this_one() {
        let documented = include_str!("../../../docs/safety.md");
        assert!(
            documented.replace('\r', "").contains(&table()),
            "docs/safety.md must hold this table:\n{}",
            table()
        );
    }

    #[test]
    fn motors_come_alive_only_from_idle_with_a_reference_by_arming_with_a_scene_or_for_a_test() {
        for (_, state) in STATES {
            for (what, event) in EVENTS {
                let (next, action) = state.step(event);
                if !state.live() && next.live() {
                    assert_eq!(state, Safety::Idle, "{what}");
                    let expected = match event {
                        ARM => Safety::Armed,
                        TEST => Safety::Testing,
                        _ => panic!("{what} drives the motors"),
                    };
                    assert_eq!((next, action), (expected, Action::Enable));
                }
            }
        }
    }

    #[test]
    fn leaving_a_live_state_always_turns_the_motors_off() {
        for (_, state) in STATES {
            for (what, event) in EVENTS {
                let (next, action) = state.step(event);
                if state.live() && !next.live() {
                    assert_eq!(action, Action::Off, "{state:?}, {what}");
                }
                // Rendering never ends without an action: uncouple, fade or off.
                if state == Safety::Active && next != state {
                    assert!(
                        matches!(action, Action::Uncouple | Action::Fade | Action::Off),
                        "{what}"
                    );
                }
            }
        }
    }

    #[test]
    fn stop_means_off_in_every_state() {
        for (_, state) in STATES {
            let (next, action) = state.step(Event::Stop);
            assert_eq!(action, Action::Off, "{state:?}");
            assert!(matches!(next, Safety::Stopped | Safety::Fault(_)), "{state:?}");
        }
    }

    #[test]
    fn every_fault_is_of_one_kind() {
        for fault in Fault::every(1) {
            // Exhaustive, so that a new fault requires a decision here.
            let fading = match fault {
                Fault::HostSilent { .. } | Fault::SceneDamaged | Fault::Workspace => true,
                Fault::StopInput
                | Fault::EncoderJump { .. }
                | Fault::EncoderStuck { .. }
                | Fault::OverSpeed
                | Fault::Driver { .. }
                | Fault::OverCurrent { .. }
                | Fault::OverTemperature { .. }
                | Fault::SupplyLow
                | Fault::TickOverrun
                | Fault::NonFinite
                | Fault::AngularOverSpeed
                | Fault::ReferenceLost
                | Fault::ImpossiblePosture
                | Fault::BadReading => false,
            };
            assert_eq!(fades(fault), fading, "{fault:?}");
            for (_, state) in STATES {
                let (next, _) = state.step(Event::Fault(fault));
                let expected = match state {
                    Safety::Fault(first) => Safety::Fault(first),
                    Safety::SoftStop(AfterSoftStop::Fault(first)) if fading => {
                        Safety::SoftStop(AfterSoftStop::Fault(first))
                    }
                    Safety::Testing => Safety::Fault(fault),
                    _ if fading && state.live() => Safety::SoftStop(AfterSoftStop::Fault(fault)),
                    _ => Safety::Fault(fault),
                };
                assert_eq!(next, expected, "{fault:?} in {state:?}");
            }
        }
    }

    #[test]
    fn a_fault_and_a_stop_are_left_only_by_clearing_when_the_cause_is_gone() {
        for (_, state) in STATES {
            if !matches!(state, Safety::Fault(_) | Safety::Stopped) {
                continue;
            }
            for (what, event) in EVENTS {
                let (next, _) = state.step(event);
                if next == Safety::Idle {
                    assert_eq!(event, Event::Clear { cause_gone: true }, "{what}");
                } else {
                    assert!(matches!(next, Safety::Fault(_) | Safety::Stopped), "{what}");
                }
            }
        }
    }

    #[test]
    fn a_refusal_changes_nothing() {
        for (_, state) in STATES {
            for (what, event) in EVENTS {
                if let (next, Action::Refuse(_)) = state.step(event) {
                    assert_eq!(next, state, "{what}");
                }
            }
        }
    }
}
