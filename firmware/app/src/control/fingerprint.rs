//! Fingerprint of the control plane's state, for the enumeration of message orders.

use core::hash::{Hash, Hasher};
use core::mem::discriminant;

use super::ControlPlane;
use crate::board::{Clock, Mechanism};
use crate::channel::{Command, CommandKind};
use crate::safety::{AfterSoftStop, Motors, Safety};

/// Counters of ticks that decide when a state ends by itself. A counter that decides nothing in the present state is 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timers {
    /// Ticks since the soft stop began.
    pub fade: u32,
    /// Ticks since the one in which a frame from the host was noticed, that one included.
    pub silent: u32,
    /// The largest `silent` that is no fault.
    pub timeout: u32,
}

impl<M: Mechanism, C: Clock> ControlPlane<'_, '_, M, C> {
    /// Adds to `hasher` the state that decides when motors are driven, and the queued commands: without [`Timers`], the force law's state, what is
    /// only reported, and event counters. Takes the commands out of the queue, so the planes must be dropped or restored afterwards.
    pub fn fingerprint(&mut self, hasher: &mut impl Hasher) {
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
        while let Some(command) = self.ends.commands.dequeue() {
            self.command_fingerprint(&command, hasher);
        }
    }

    /// Adds the effect that a queued command can have.
    fn command_fingerprint(&self, command: &Command<'_>, hasher: &mut impl Hasher) {
        let shared = self.ends.shared;
        let in_session = command.session == shared.sessions();
        // A stop, a halt and a greeting outdate a command for good.
        let current = in_session && command.epoch == shared.epoch();
        discriminant(&command.kind).hash(hasher);
        match &command.kind {
            CommandKind::Arm(number) => (current, number.wrapping_sub(self.scene_number)).hash(hasher),
            CommandKind::Grab(part) => (current, part).hash(hasher),
            CommandKind::ClearFault | CommandKind::Home => current.hash(hasher),
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
            fade: if fading { self.rendered.fade.0.into() } else { 0 },
            silent: if fading || !self.safety.live() || heard {
                0
            } else {
                self.late.silent_ticks + 1
            },
            timeout: self.settings.safety.host_timeout.0 + 1,
        }
    }

    /// Number of the scene in use, see [`CommandKind::Arm`].
    pub fn scene_number(&self) -> u32 {
        self.scene_number
    }
}
