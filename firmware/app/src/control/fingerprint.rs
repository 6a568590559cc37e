//! Fingerprint of the control plane's state, for the enumeration of message orders.

use core::hash::{Hash, Hasher};
use core::mem::discriminant;

use heapless::Vec;
use mortise_protocol::image::SceneImage;
use mortise_protocol::message::Fault;

use super::ControlPlane;
use crate::board::{Clock, Mechanism};
use crate::channel::{COMMANDS, Command, CommandKind};
use crate::safety::{AfterSoftStop, Event as SafetyEvent, Motors, Safety};

/// The states that the queued commands so far can lead to.
struct Possible {
    states: Vec<Safety, 8>,
    /// There are more.
    all: bool,
}

impl Possible {
    fn new(state: Safety) -> Self {
        let states = [state].into_iter().collect();
        Self { states, all: false }
    }

    /// Adds the states that the event leads to; whether it can change the state.
    fn step(&mut self, event: SafetyEvent) -> bool {
        let mut changes = self.all;
        for at in 0..self.states.len() {
            let (next, _) = self.states[at].step(event);
            changes |= next != self.states[at];
            if !self.states.contains(&next) {
                self.all |= self.states.push(next).is_err();
            }
        }
        changes
    }
}

/// Counters of ticks that decide when a state ends by itself. A counter that decides nothing in the present state is 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timers {
    /// Ticks since the soft stop or the test of a motor began.
    pub fade: u32,
    /// Ticks since the one in which a frame from the host was noticed, that one included.
    pub silent: u32,
    /// The largest `silent` that is no fault.
    pub timeout: u32,
}

impl<M: Mechanism, C: Clock> ControlPlane<'_, '_, M, C> {
    /// Adds to `hasher` the state that decides when motors are driven, and the queued commands: without [`Timers`], the force law's state, what is
    /// only reported, and event counters. Takes the commands out of the queue, so the planes must be dropped or restored afterwards.
    ///
    /// `counted`: every queued command counts, also one that does nothing.
    pub fn fingerprint(&mut self, counted: bool, hasher: &mut impl Hasher) {
        discriminant(&self.safety).hash(hasher);
        if let Safety::Fault(fault) | Safety::SoftStop(AfterSoftStop::Fault(fault)) = &self.safety {
            discriminant(fault).hash(hasher);
        }
        let shared = self.ends.shared;
        let flags = [
            self.host.restarting,
            self.scene.is_some(),
            self.sensed.referenced,
            self.host.stops == shared.stops(),
            self.host.session == shared.sessions(),
            self.persistent_cause().is_some(),
            self.lockstep.on,
        ];
        (flags, self.lockstep.credit).hash(hasher);
        self.settings.parameters.fingerprint(hasher);
        let mut possible = Possible::new(self.safety);
        let mut settings: Vec<Command<'_>, COMMANDS> = Vec::new();
        while let Some(command) = self.ends.commands.dequeue() {
            if counted {
                0u8.hash(hasher);
            }
            // Settings take effect behind all commands of their tick: only their order among themselves and with queries counts.
            if matches!(command.kind, CommandKind::Settings(_) | CommandKind::Parameter(_)) {
                // No longer than the queue.
                let _ = settings.push(command);
            } else {
                self.command_fingerprint(&command, &mut possible, hasher);
            }
        }
        for command in &settings {
            self.command_fingerprint(command, &mut possible, hasher);
        }
    }

    /// Adds the effect that a queued command can have, and to `possible` the states that it can lead to. A command that could bring the motors nearer to
    /// being driven counts even when it will be dropped or refused: whether it is must be checked, not assumed.
    fn command_fingerprint(&self, command: &Command<'_>, possible: &mut Possible, hasher: &mut impl Hasher) {
        let shared = self.ends.shared;
        let in_session = command.session == shared.sessions();
        // A stop, a halt and a greeting outdate a command for good.
        let current = in_session && command.epoch == shared.epoch();
        let event = match &command.kind {
            CommandKind::Arm(_) => SafetyEvent::Arm {
                scene: true,
                referenced: true,
            },
            CommandKind::ClearFault => SafetyEvent::Clear { cause_gone: true },
            CommandKind::Grab(_) => SafetyEvent::Grab,
            CommandKind::TestMotor { .. } => SafetyEvent::Test { referenced: true },
            CommandKind::Disarm => SafetyEvent::Disarm,
            CommandKind::Release => SafetyEvent::Release,
            CommandKind::SceneDamaged => SafetyEvent::Fault(Fault::SceneDamaged),
            _ => SafetyEvent::Ready,
        };
        let changes = possible.step(event);
        let idle = match &command.kind {
            CommandKind::Disarm | CommandKind::Release => !changes,
            // Changes the force law only.
            CommandKind::SetTarget(_) => true,
            _ => false,
        };
        if idle {
            return;
        }
        discriminant(&command.kind).hash(hasher);
        match &command.kind {
            CommandKind::Arm(number) => (current, number.wrapping_sub(self.scene_number)).hash(hasher),
            CommandKind::Grab(part) => (current, part).hash(hasher),
            CommandKind::ClearFault | CommandKind::Home | CommandKind::TestMotor { .. } => {
                current.hash(hasher)
            }
            CommandKind::Disarm | CommandKind::Release | CommandKind::Restart => in_session.hash(hasher),
            CommandKind::Settings(settings) => settings.parameters.fingerprint(hasher),
            CommandKind::Parameter(id) => (in_session, id).hash(hasher),
            CommandKind::UseScene { number, .. } => number.wrapping_sub(self.scene_number).hash(hasher),
            CommandKind::SceneDamaged => {}
            // Equal to no other: the enumeration sends none of these.
            _ => (command.seq, command.session).hash(hasher),
        }
    }

    /// The counters of ticks in their present state.
    pub fn timers(&self) -> Timers {
        let fading = self.safety.motors() == Motors::Fading;
        let heard = self.late.heard != self.ends.shared.heard();
        Timers {
            fade: if fading {
                self.rendered.fade.0.into()
            } else {
                self.testing.ticks().into()
            },
            silent: if fading || !self.safety.live() || heard {
                0
            } else {
                self.late.silent_ticks + 1
            },
            timeout: self.settings.safety.host_timeout.0 + 1,
        }
    }

    /// The scene in use.
    pub fn scene(&self) -> Option<&SceneImage<'_>> {
        self.scene.as_ref()
    }

    /// Number of the scene in use, see [`CommandKind::Arm`].
    pub fn scene_number(&self) -> u32 {
        self.scene_number
    }
}
