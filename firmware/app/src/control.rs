//! The control plane: one call each millisecond, and the only code that drives the motors.
//!
//! Contract of [`ControlPlane::tick`]: bounded work (commands, field queries, contacts all have limits), no waiting, no panics. The order in a tick
//! is stop, session, commands, sensors, safety, force law, limits, motors, bookkeeping. Late ticks are counted; [`Identity::overrun_ticks`] of them
//! in a row are a fault.
//!
//! In **lockstep** (simulated mechanisms only) a tick runs only when released by `Run`, and commands behind a `Run` wait until its ticks are done:
//! all messages before `Run` in the stream have taken effect before its first tick, independent of the timing of bytes and interrupts. The in-process
//! rig and the emulated board therefore compute the same bits. The host timeout is not applied there, since time waits for the host.

pub mod fingerprint;
mod parts;
mod position_scale;
mod recording;
mod report;
mod requests;
mod simulation;
pub mod testing;
#[cfg(test)]
mod tests;
mod watch;

use mortise_haptics::{self as haptics, Input, Wrench};
use mortise_mechanism::hardware_limits::{HardwareLimits, restrain};
use mortise_protocol::image::SceneImage;
use mortise_protocol::message::{Fault, Refusal};

use self::parts::{Host, Lateness, Lockstep, Recording, Rendered, Reports, Sampling, Testing};
use self::position_scale::PositionScale;
use crate::board::{Clock, Drive, Identity, Mechanism, Sensed};
use crate::channel::{Command, CommandKind, ControlEnds, EVENTS_AT_ONCE, Epoch, Reply};
use crate::parameters::ControlSettings;
use crate::safety::{Action, AfterSoftStop, Event as SafetyEvent, Motors, Safety};
use crate::statistics::count_tick;

/// Ticks in which the coupling's force limit rises from zero to its setting after arming or grabbing; beyond the limit the part slips in the handle.
///
/// The ramp limits the coupling itself rather than scaling the wrench on its way to the motors, so that all work done on the object comes from the
/// operator. Scaled behind the coupling, an object set in motion during the ramp returned kinetic energy that was unaccounted for, all of ½·m·v².
pub const RAMP_TICKS: u16 = 200;
/// Ticks in which a soft stop fades the last wrench to zero.
pub const FADE_TICKS: u16 = 50;
/// Ticks of a soft stop: the fade, then damping alone, then motors off.
pub const SOFT_STOP_TICKS: u16 = 100;
/// Damping of a soft stop, N·s/m. On a handle of 0.15 kg a tick takes b·h/m = 1.3 % of the speed, far below the 200 % at which it would oscillate.
const SOFT_STOP_DAMPING: f32 = 2.0;
/// Damping of a soft stop, N·m·s/rad; for a handle of 10⁻⁴ kg·m² 2 % a tick.
const SOFT_STOP_ANGULAR_DAMPING: f32 = 0.002;
/// Largest damping force of a soft stop, N.
const SOFT_STOP_FORCE: f32 = 2.0;
/// Largest damping torque of a soft stop, N·m.
const SOFT_STOP_TORQUE: f32 = 0.02;

/// What a call of [`ControlPlane::tick`] did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ticked {
    /// A tick ran.
    Ran,
    /// Lockstep: commands were taken, no time passed.
    Waiting,
}

/// Everything the 1 kHz task owns. Many fields, because nothing of it lives elsewhere; what belongs together is grouped in their types.
pub struct ControlPlane<'c, 's, M, C> {
    ends: ControlEnds<'c, 's>,
    mechanism: M,
    clock: C,
    overrun_ticks: u8,
    hardware_limits: HardwareLimits,
    safety: Safety,
    settings: ControlSettings,
    scene: Option<SceneImage<'s>>,
    /// Identifies the scene, see [`CommandKind::Arm`].
    scene_number: u32,
    sensed: Sensed,
    /// A reading of this tick was not finite and was replaced by the last valid one.
    replaced: bool,
    rendered: Rendered,
    tick: u32,
    lockstep: Lockstep,
    telemetry: Sampling,
    recording: Recording,
    testing: Testing,
    late: Lateness,
    host: Host,
    reports: Reports,
}

impl<'c, 's, M: Mechanism, C: Clock> ControlPlane<'c, 's, M, C> {
    /// A booting plane, motors off. The scene arrives as the link plane's first command.
    pub fn new(
        ends: ControlEnds<'c, 's>,
        mut mechanism: M,
        clock: C,
        identity: &Identity,
        settings: ControlSettings,
    ) -> Self {
        mechanism.drive(Drive::Off);
        Self {
            ends,
            mechanism,
            clock,
            overrun_ticks: identity.overrun_ticks,
            hardware_limits: identity.hardware_limits,
            safety: Safety::Boot,
            settings,
            scene: None,
            scene_number: 0,
            sensed: Sensed::AT_REST,
            replaced: false,
            rendered: Rendered::NOTHING,
            tick: 0,
            lockstep: Lockstep::default(),
            telemetry: Sampling::default(),
            recording: Recording::default(),
            testing: Testing::default(),
            late: Lateness::default(),
            host: Host::default(),
            reports: Reports::new(),
        }
    }

    /// The safety state.
    pub fn safety(&self) -> Safety {
        self.safety
    }

    /// The settings in force.
    pub fn settings(&self) -> &ControlSettings {
        &self.settings
    }

    /// Ticks run since start.
    pub fn ticks(&self) -> u32 {
        self.tick
    }

    /// Hash of the state, as the statistics report it.
    pub fn state_hash(&self) -> u64 {
        self.reports.hash.value()
    }

    /// Work of the force law in the last tick; `None` when it did not run. For measurement.
    pub fn work(&self) -> Option<haptics::Work> {
        self.rendered.output.as_ref().map(|output| output.work)
    }

    /// The mechanism, so that a test can press its stop input.
    pub fn mechanism_mut(&mut self) -> &mut M {
        &mut self.mechanism
    }

    /// Runs one tick (1 ms). Called from the timer at the highest priority.
    pub fn tick(&mut self) -> Ticked {
        let missed = self.clock.begin();
        self.take_stop_and_session();
        // The first tick reads the sensors and belongs to no session.
        if self.safety != Safety::Boot {
            self.take_commands();
            if self.lockstep.on && (self.lockstep.credit == 0 || !self.lockstep_has_room()) {
                self.report();
                return Ticked::Waiting;
            }
        }
        self.run(missed);
        Ticked::Ran
    }

    fn run(&mut self, missed: u32) {
        self.simulate();
        self.sense();
        self.watch(missed);
        self.render();
        self.reports.hash.tick(
            &self.sensed.handle,
            self.ends.law.object().as_ref(),
            &self.rendered.commanded,
        );
        self.tick = self.tick.wrapping_add(1);
        self.report();
        self.record();
        self.sample();
        let points = self.rendered.output.as_ref().map_or(0, |o| o.work.points);
        let cost = self.cost();
        count_tick(
            &mut self.reports.statistics,
            cost,
            points,
            &self.rendered.commanded,
        );
        if self.lockstep.credit > 0 {
            self.lockstep.credit -= 1;
            if self.lockstep.credit == 0 {
                self.ran();
            }
        }
    }

    /// Moves a simulated mechanism. A real one moves by itself: what this takes is no part of the tick's cost.
    fn simulate(&mut self) {
        if let Some(simulation) = self.mechanism.simulation() {
            let before = self.clock.cost();
            simulation.advance();
            self.reports.simulated = self.clock.cost().wrapping_sub(before);
        }
    }

    /// Cost of the tick so far.
    fn cost(&mut self) -> u32 {
        self.clock.cost().saturating_sub(self.reports.simulated)
    }

    fn take_stop_and_session(&mut self) {
        let stops = self.ends.shared.stops();
        if stops != self.host.stops {
            self.host.stops = stops;
            self.apply(SafetyEvent::Stop);
        }
        let session = self.ends.shared.sessions();
        if session != self.host.session {
            self.host.session = session;
            self.telemetry.every = 0;
            self.recording = Recording::default();
            self.lockstep.on = false;
            self.lockstep.credit = 0;
            self.host.restarting = false;
            self.apply(SafetyEvent::Disarm);
        }
    }

    fn take_commands(&mut self) {
        // Takes at most the commands that were queued when the tick began.
        for _ in 0..self.ends.commands.len() {
            let full = self.ends.events.capacity() - self.ends.events.len() < EVENTS_AT_ONCE;
            if self.lockstep.credit > 0 || full {
                return;
            }
            let Some(command) = self.ends.commands.dequeue() else {
                return;
            };
            let arm = matches!(command.kind, CommandKind::Arm(_) | CommandKind::TestMotor { .. });
            let every_session = matches!(
                command.kind,
                CommandKind::UseScene { .. } | CommandKind::SceneDamaged | CommandKind::Settings(_)
            );
            if every_session || command.session == self.host.session {
                self.carry_out(command);
            }
            if arm {
                self.ends.shared.count_arm();
            }
        }
    }

    fn carry_out(&mut self, command: Command<'s>) {
        let Command {
            seq,
            epoch,
            session,
            kind,
        } = command;
        if session == self.host.session {
            self.recording.carried_out = seq;
        }
        let now = Epoch {
            stops: self.host.stops,
            halts: self.ends.shared.halts(),
        };
        let enabling = matches!(
            kind,
            CommandKind::Arm(_)
                | CommandKind::ClearFault
                | CommandKind::Grab(_)
                | CommandKind::Home
                | CommandKind::TestMotor { .. }
        );
        let result = if enabling && epoch != now {
            Err(Refusal::Outdated)
        } else if let Some(result) = self.execute(seq, session, kind) {
            result
        } else {
            return;
        };
        self.report();
        self.reply(
            seq,
            session,
            match result {
                Ok(()) => Reply::Done,
                Err(reason) => Reply::Refused(reason),
            },
        );
    }

    /// The position scale in use.
    fn scale(&self) -> PositionScale {
        PositionScale(self.settings.law.passivity.position_scale)
    }

    /// Computes this tick's wrench and applies it to the motors.
    fn render(&mut self) {
        self.rendered.output = None;
        let motors = self.safety.motors();
        if let (Motors::Zero | Motors::Rendered, Some(scene)) = (motors, &self.scene) {
            let scale = self.scale();
            let (handle, handle_twist) = scale.handle(&self.sensed);
            let input = Input {
                handle,
                handle_twist,
                enabled: true,
            };
            self.rendered.ramp = self.rendered.ramp.saturating_add(1).min(RAMP_TICKS);
            let ramping = self.rendered.ramp < RAMP_TICKS;
            let [position, angle] = self.mechanism.count();
            let passivity = &mut self.settings.law.passivity;
            (passivity.position_count_m, passivity.angle_count_rad) = (position, angle);
            self.ends.law.set_slipping(ramping);
            let adapted;
            let law = if ramping || scale != PositionScale::ONE {
                let share = f32::from(self.rendered.ramp) / f32::from(RAMP_TICKS);
                adapted = scale.law(&loosened(&self.settings.law, share));
                &adapted
            } else {
                &self.settings.law
            };
            let output = haptics::tick(self.ends.law, scene, law, &input);
            if output.work.flags.intersects(haptics::Flags::BAD_INPUT) {
                self.apply(SafetyEvent::Fault(Fault::BadReading));
            }
            if output.work.flags.intersects(haptics::Flags::NON_FINITE) || !output.handle.is_finite() {
                self.apply(SafetyEvent::Fault(Fault::NonFinite));
            }
            self.rendered.output = Some(output);
        }
        // The state may have changed earlier in this tick.
        let wanted = match (self.safety.motors(), &self.rendered.output) {
            (Motors::Off | Motors::Tested, _) => None,
            (Motors::Fading, _) => Some(self.fading()),
            (Motors::Zero | Motors::Rendered, Some(output)) => Some(self.scale().felt(output.handle)),
            (Motors::Zero | Motors::Rendered, None) => Some(Wrench::ZERO),
        };
        let allowed = wanted.map(|wrench| self.restrained(wrench));
        self.rendered.commanded = allowed.unwrap_or(Wrench::ZERO);
        self.mechanism
            .watch_encoders(self.safety.motors() == Motors::Rendered);
        let drive = match self.safety.motors() {
            Motors::Tested => self.pulse(),
            _ => allowed.map_or(Drive::Off, Drive::Wrench),
        };
        self.mechanism.drive(drive);
        self.end_test();
        if self.safety.motors() == Motors::Fading && self.rendered.fade.0 >= SOFT_STOP_TICKS {
            self.apply(SafetyEvent::SoftStopOver);
        }
    }

    fn fading(&mut self) -> Wrench {
        let (ticks, start) = &mut self.rendered.fade;
        *ticks = ticks.saturating_add(1);
        let left = FADE_TICKS.saturating_sub(*ticks);
        let fade = scaled(*start, f32::from(left) / f32::from(FADE_TICKS));
        let damping = Wrench {
            force: (self.sensed.twist.linear * -SOFT_STOP_DAMPING).clamp_length_max(SOFT_STOP_FORCE),
            torque: (self.sensed.twist.angular * -SOFT_STOP_ANGULAR_DAMPING)
                .clamp_length_max(SOFT_STOP_TORQUE),
        };
        fade + damping
    }

    /// The wrench after the last limit before the motors.
    fn restrained(&self, wrench: Wrench) -> Wrench {
        let bounds = self
            .hardware_limits
            .with(self.settings.safety.power_w, self.settings.safety.workspace_m);
        restrain(wrench, self.sensed.handle.position, &self.sensed.twist, &bounds)
    }

    /// Passes a request to the state machine; a refused one changes nothing.
    fn request(&mut self, event: SafetyEvent) -> Result<(), Refusal> {
        match self.safety.step(event) {
            (_, Action::Refuse(reason)) => Err(reason),
            _ => {
                self.apply(event);
                Ok(())
            }
        }
    }

    fn apply(&mut self, event: SafetyEvent) {
        let (next, action) = self.safety.step(event);
        if let SafetyEvent::Fault(fault) = event
            && next != self.safety
            && self.reports.fault.is_none()
        {
            self.reports.fault = Some((self.tick, fault));
        }
        let halted = matches!(
            next,
            Safety::Stopped | Safety::Fault(_) | Safety::SoftStop(AfterSoftStop::Fault(_))
        );
        if halted && next != self.safety {
            self.ends.shared.halt();
        }
        self.safety = next;
        if next != Safety::Testing {
            self.testing.interrupt(next.reported());
        }
        match action {
            Action::None | Action::Refuse(_) => {}
            Action::Enable => {
                self.ends.law.restart_slew();
                self.rendered.ramp = 0;
                self.late.silent_ticks = 0;
                self.late.missed_in_row = 0;
            }
            Action::Couple => self.rendered.ramp = 0,
            Action::Uncouple => self.ends.law.release(),
            Action::Fade => {
                self.ends.law.release();
                self.rendered.fade = (0, self.rendered.commanded);
            }
            Action::Off => {
                // Off at once, not at the next tick: in lockstep that may be far away.
                self.mechanism.drive(Drive::Off);
                self.rendered.commanded = Wrench::ZERO;
                self.ends.law.release();
                self.ends.law.restart_slew();
            }
        }
        // After the motors are switched: work that requires them off waits for this flag.
        self.ends.shared.set_live(next.live());
        // Home now, so that arming is impossible in the tick that clears an encoder fault.
        if self.safety == Safety::Idle && !self.sensed.referenced {
            self.apply(SafetyEvent::ReferenceLost);
        }
    }
}

/// `law` with the coupling's force and torque limits scaled by `share`.
fn loosened(law: &haptics::Settings, share: f32) -> haptics::Settings {
    let mut law = *law;
    law.coupling.force_max_n *= share;
    law.coupling.torque_max_nm *= share;
    law
}

fn scaled(wrench: Wrench, factor: f32) -> Wrench {
    Wrench {
        force: wrench.force * factor,
        torque: wrench.torque * factor,
    }
}
