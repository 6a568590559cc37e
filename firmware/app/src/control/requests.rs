//! What each command does.

use mortise_haptics::{GrabError, PlaceError, Pose, TargetError, Twist, Wrench};
use mortise_protocol::image::SceneImage;
use mortise_protocol::message::{ConstraintTarget, Fault, Refusal};
use mortise_protocol::parameter::ParameterId;

use super::ControlPlane;
use crate::board::{Clock, Mechanism};
use crate::channel::{CommandKind, Event, Reply};
use crate::safety::{Action, Event as SafetyEvent};
use crate::statistics::StateHash;

impl<'s, M: Mechanism, C: Clock> ControlPlane<'_, 's, M, C> {
    /// Executes a command. `None`: it has its own answer, now or later.
    pub(super) fn execute(
        &mut self,
        seq: u16,
        session: u32,
        kind: CommandKind<'s>,
    ) -> Option<Result<(), Refusal>> {
        Some(match kind {
            CommandKind::Arm(number) => self.arm(number),
            CommandKind::Disarm => self.request(SafetyEvent::Disarm),
            CommandKind::ClearFault => {
                let cause_gone = self.persistent_cause().is_none();
                self.request(SafetyEvent::Clear { cause_gone })
            }
            CommandKind::Settings(settings) => {
                let in_use = self.settings.law.passivity.position_scale;
                self.settings = settings;
                self.adopt_scale(in_use);
                Ok(())
            }
            CommandKind::Grab(part) => self.grab(part),
            CommandKind::Release => self.request(SafetyEvent::Release),
            CommandKind::ResetScene => self.reset_scene(),
            CommandKind::Place { part, pose } => self.place(part, &pose),
            CommandKind::SetTarget(target) => self.set_target(&target),
            CommandKind::ClearTarget(id) => {
                self.ends.law.clear_target(id);
                Ok(())
            }
            CommandKind::Parameter(id) => {
                let value = self.settings.parameters.get(id);
                self.reply(seq, session, Reply::Parameter { id, value });
                return None;
            }
            CommandKind::UseScene { image, number } => {
                let taken = self.use_scene(image, number);
                self.send(Event::SceneTaken(taken));
                return None;
            }
            CommandKind::SceneDamaged => {
                self.apply(SafetyEvent::Fault(Fault::SceneDamaged));
                return None;
            }
            CommandKind::Telemetry(every) => {
                (self.telemetry.every, self.telemetry.left) = (every, every);
                Ok(())
            }
            CommandKind::Statistics { reset } => {
                self.send_statistics(seq, reset);
                return None;
            }
            CommandKind::RecordInputs(on) => self.set_recording(on),
            CommandKind::Readings => {
                let readings = self.readings();
                self.reply(seq, session, Reply::Readings(readings));
                return None;
            }
            CommandKind::TestMotor { joint, force } => match self.test_motor(seq, joint, force) {
                Ok(()) => return None,
                refused => refused,
            },
            CommandKind::Home => self.home(),
            CommandKind::Hand(script) => self.set_hand(&script),
            CommandKind::InputFaults(faults) => self.set_input_faults(&faults),
            CommandKind::Lockstep(on) => self.set_lockstep(on),
            CommandKind::Run(_) if !self.lockstep.on => Err(Refusal::Lockstep),
            CommandKind::Run(ticks) => {
                self.release_ticks(seq, ticks);
                return None;
            }
            CommandKind::Restart if self.safety.live() => Err(Refusal::State(self.safety.reported())),
            CommandKind::Restart => {
                self.host.restarting = true;
                self.reply(seq, session, Reply::MayRestart);
                return None;
            }
        })
    }

    /// Lets ticks run in lockstep; the end is reported in answer to `seq`.
    fn release_ticks(&mut self, seq: u16, ticks: u32) {
        self.lockstep.run_seq = seq;
        self.lockstep.credit = ticks;
        if ticks == 0 {
            self.ran();
        }
    }

    /// Drives the motors if all conditions hold now; `number` identifies the scene whose checksum was verified.
    fn arm(&mut self, number: u32) -> Result<(), Refusal> {
        if self.host.restarting {
            return Err(Refusal::Busy);
        }
        if self.scene.is_some() && number != self.scene_number {
            return Err(Refusal::Outdated);
        }
        let event = SafetyEvent::Arm {
            scene: self.scene.is_some(),
            referenced: self.sensed.referenced,
        };
        if let (_, Action::Refuse(reason)) = self.safety.step(event) {
            return Err(reason);
        }
        if !self.ends.shared.claim_motors() {
            return Err(Refusal::Busy);
        }
        self.request(event)
    }

    fn grab(&mut self, part: u16) -> Result<(), Refusal> {
        self.adopt_scale(self.settings.law.passivity.position_scale);
        let Some(scene) = &self.scene else {
            return Err(Refusal::NoScene);
        };
        if let (_, Action::Refuse(reason)) = self.safety.step(SafetyEvent::Grab) {
            return Err(reason);
        }
        let (handle, _) = self.scale().handle(&self.sensed);
        self.ends
            .law
            .grab(scene, part, &handle)
            .map_err(|error| match error {
                GrabError::NoSuchPart { parts, .. } => Refusal::NoSuchPart { parts },
                GrabError::Fixed { .. } => Refusal::NotGrabbable,
                GrabError::Busy { .. } => Refusal::State(self.safety.reported()),
                GrabError::BadHandle => Refusal::BadNumber,
            })?;
        self.request(SafetyEvent::Grab)
    }

    /// Takes over the position scale of the parameters, unless a part is held: that would jump. Then the one `in_use` stays. What is left of the last part's
    /// force ends with another one.
    fn adopt_scale(&mut self, in_use: f32) {
        let scale = if self.ends.law.grabbed().is_none() {
            self.settings.parameters.get(ParameterId::PositionScale)
        } else {
            in_use
        };
        if scale != in_use {
            self.ends.law.restart_slew();
        }
        self.settings.law.passivity.position_scale = scale;
    }

    fn set_target(&mut self, target: &ConstraintTarget) -> Result<(), Refusal> {
        let Some(scene) = &self.scene else {
            return Err(Refusal::NoScene);
        };
        self.ends.law.set_target(target).map_err(|error| match error {
            TargetError::BadNumber => Refusal::BadNumber,
            TargetError::NoSuchPart => Refusal::NoSuchPart {
                parts: scene.parts().len() as u16,
            },
            TargetError::Full => Refusal::Busy,
        })
    }

    fn reset_scene(&mut self) -> Result<(), Refusal> {
        if self.safety.live() {
            return Err(Refusal::State(self.safety.reported()));
        }
        if let Some(scene) = &self.scene {
            self.ends.law.load_scene(scene);
        }
        self.start_anew();
        Ok(())
    }

    /// Only with the motors off: a part put into the held one would push it at once.
    fn place(&mut self, part: u16, pose: &Pose) -> Result<(), Refusal> {
        if self.safety.live() {
            return Err(Refusal::State(self.safety.reported()));
        }
        if self.scene.is_none() {
            return Err(Refusal::NoScene);
        }
        self.ends.law.place(part, pose).map_err(|error| match error {
            PlaceError::NoSuchPart { parts } => Refusal::NoSuchPart { parts },
            PlaceError::Held => Refusal::State(self.safety.reported()),
            PlaceError::BadPose => Refusal::BadNumber,
        })
    }

    fn use_scene(&mut self, scene: SceneImage<'s>, number: u32) -> Result<(), Refusal> {
        if self.safety.live() {
            return Err(Refusal::State(self.safety.reported()));
        }
        self.ends.law.load_scene(&scene);
        self.scene = Some(scene);
        self.scene_number = number;
        self.start_anew();
        Ok(())
    }

    fn start_anew(&mut self) {
        self.ends.law.restart_slew();
        if let Some(handle) = self
            .mechanism
            .simulation()
            .and_then(|simulation| simulation.reset())
        {
            self.sensed.handle = handle;
            self.sensed.twist = Twist::ZERO;
        }
        self.rendered.output = None;
        self.rendered.commanded = Wrench::ZERO;
        self.reports.hash = StateHash::new();
    }

    fn home(&mut self) -> Result<(), Refusal> {
        if self.safety.live() {
            return Err(Refusal::State(self.safety.reported()));
        }
        self.mechanism.home();
        Ok(())
    }
}
