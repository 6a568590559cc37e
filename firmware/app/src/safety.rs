//! The safety state machine as a pure function of state and event.
//!
//! Whether the motors may be driven follows from the state alone ([`Safety::motors`]); nothing else in the firmware enables them.
//! `docs/safety.md` has the diagram; the tests below try every event in every state.

use mortise_protocol::message::{DeviceState, Fault, Refusal};

/// The state. [`DeviceState`] is what the host sees of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Safety {
    /// Starting: sensors not read yet.
    Boot,
    /// Motors off, waiting.
    Idle,
    /// Motors on, nothing grabbed: zero wrench.
    Armed,
    /// A part is grabbed and felt.
    Active,
    /// Wrench fading out under damping.
    SoftStop(AfterSoftStop),
    /// Motors off until cleared.
    Stopped,
    /// Motors off until the cause is gone and cleared.
    Fault(Fault),
}

/// Where a soft stop ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AfterSoftStop {
    /// Disarmed by the host.
    Idle,
    /// The host fell silent, or the scene is damaged.
    Fault(Fault),
}

/// What the motors may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motors {
    /// Enable output inactive.
    Off,
    /// Driven with zero wrench.
    Zero,
    /// Driven with the force law's wrench.
    Rendered,
    /// Driven with the last wrench fading out, and damping.
    Fading,
}

/// What happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// The first sensor readings are in.
    Ready,
    /// The host asks to arm; whether there is a scene to feel.
    Arm {
        /// A scene is loaded.
        scene: bool,
    },
    /// The host asks to disarm.
    Disarm,
    /// The host asks to stop.
    Stop,
    /// The host asks to leave Stopped or Fault; whether what the sensors showed has gone.
    Clear {
        /// No cause of a fault is present in this tick.
        cause_gone: bool,
    },
    /// The host asks to grab a part that can be grabbed.
    Grab,
    /// The host asks to let go.
    Release,
    /// Something is wrong.
    Fault(Fault),
    /// The fade is over.
    SoftStopOver,
}

/// What a plane must do on entering the new state.
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
    /// The request is not possible here.
    Refuse(Refusal),
}

/// Whether the motors still know where they are when this fault is seen: then a damped fade is kinder than letting go at once.
pub const fn fades(fault: Fault) -> bool {
    matches!(fault, Fault::HostSilent { .. } | Fault::SceneDamaged)
}

impl Safety {
    /// What the host is told.
    pub const fn reported(self) -> DeviceState {
        match self {
            Self::Boot => DeviceState::Boot,
            Self::Idle => DeviceState::Idle,
            Self::Armed => DeviceState::Armed,
            Self::Active => DeviceState::Active,
            Self::SoftStop(_) => DeviceState::SoftStop,
            Self::Stopped => DeviceState::Stopped,
            Self::Fault(fault) => DeviceState::Fault(fault),
        }
    }

    /// What the motors may do.
    pub const fn motors(self) -> Motors {
        match self {
            Self::Boot | Self::Idle | Self::Stopped | Self::Fault(_) => Motors::Off,
            Self::Armed => Motors::Zero,
            Self::Active => Motors::Rendered,
            Self::SoftStop(_) => Motors::Fading,
        }
    }

    /// Whether the motors are driven.
    pub const fn live(self) -> bool {
        !matches!(self.motors(), Motors::Off)
    }

    /// The next state and what to do on the way. Total: every event has a meaning in every state.
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

            // A fault stays a fault under STOP: its cause still has to be looked at.
            (Fault(_), Event::Stop) => (self, Action::Off),
            (SoftStop(AfterSoftStop::Fault(fault)), Event::Stop) => (Fault(fault), Action::Off),
            (_, Event::Stop) => (Stopped, Action::Off),

            (Boot, Event::Ready) => (Idle, Action::None),
            (_, Event::Ready) => (self, Action::None),

            (Idle, Event::Arm { scene: true }) => (Armed, Action::Enable),
            (Idle, Event::Arm { scene: false }) => (self, Action::Refuse(Refusal::NoScene)),
            (Armed, Event::Grab) => (Active, Action::Couple),
            (Active, Event::Release) => (Armed, Action::Uncouple),
            (Armed, Event::Release) => (self, Action::None),

            (Armed | Active, Event::Disarm) => (SoftStop(AfterSoftStop::Idle), Action::Fade),
            (_, Event::Disarm) => (self, Action::None),

            (Stopped, Event::Clear { cause_gone: true }) => (Idle, Action::None),
            (Fault(_), Event::Clear { cause_gone: true }) => (Idle, Action::None),
            (Idle, Event::Clear { .. }) => (self, Action::None),

            (SoftStop(AfterSoftStop::Idle), Event::SoftStopOver) => (Idle, Action::Off),
            (SoftStop(AfterSoftStop::Fault(fault)), Event::SoftStopOver) => (Fault(fault), Action::Off),
            (_, Event::SoftStopOver) => (self, Action::None),

            (_, Event::Arm { .. } | Event::Grab | Event::Release | Event::Clear { .. }) => {
                (self, Action::Refuse(Refusal::State(self.reported())))
            }
        }
    }
}
