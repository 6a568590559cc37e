//! What the page on the rig does with the connected board: descriptions, readings, and the steps of commissioning.

use mortise_protocol::message::{
    DeviceState, HandScript, InputFault, InputFaultKind, MotorTest, Readings, ToDevice,
};
use mortise_protocol::rig::Rig;
use mortise_rig::commissioning::{Commissioning, Step, operator};
use mortise_rig::{EXAMPLES, load_rig, write_rig};

use super::ask::write;
use super::introduction::RigSent;
use super::link::Command;
use super::notes::Severity;
use super::purpose::Purpose;
use super::rig_page::{DrawIntent, RigIntent};
use super::state::Session;
use super::workspace::Workspace;

/// Force of a motor's test at the handle, N.
const TEST_N: f32 = 1.0;
/// Time for which the simulated operator presses the stop button, ticks.
const PRESSED: u32 = 300;

impl Session {
    /// Why an action of the page is not possible now, as a sentence.
    pub(super) fn no_rig_action(&self, intent: &RigIntent) -> Option<String> {
        let reason = match intent {
            RigIntent::Example(_) | RigIntent::Edit(_) => return None,
            RigIntent::Browse | RigIntent::Load(_) | RigIntent::End => return None,
            RigIntent::Draw(intent) => self.no_drawing(*intent)?,
            RigIntent::SaveReport | RigIntent::WriteReport { .. } => match self.rig_page.steps {
                Some(_) => return None,
                None => "Begin commissioning first",
            },
            RigIntent::Save | RigIntent::Write { .. } => match self.rig_page.checked() {
                Some(Ok(_)) => return None,
                Some(Err(_)) => "Correct the description first",
                None => "There is no description: open one, or choose an example",
            },
            _ => self.no_board_action(intent)?,
        };
        Some(reason.to_owned())
    }

    fn no_drawing(&self, intent: DrawIntent) -> Option<&'static str> {
        let page = &self.rig_page;
        match page.checked() {
            None => Some("There is no description: open one, or choose an example"),
            Some(Err(_)) => Some("Correct the description first"),
            Some(Ok(_)) if intent != DrawIntent::Follow(true) || page.live().is_some() => None,
            Some(Ok(_)) if self.connection().is_none() => Some("No rig is connected"),
            Some(Ok(_)) if !page.is_in_use() => Some("The board does not use this description"),
            Some(Ok(_)) => Some("The board has not read its encoders yet"),
        }
    }

    fn no_board_action(&self, intent: &RigIntent) -> Option<&'static str> {
        let page = &self.rig_page;
        let Some(connection) = self.connection() else {
            return Some("No rig is connected");
        };
        if let Some(busy) = page.busy {
            return Some(busy);
        }
        let at_rest = matches!(connection.state, DeviceState::Idle | DeviceState::Homing);
        match intent {
            RigIntent::Send | RigIntent::SendCorrections if !at_rest => {
                Some("Only while the motors are off: disarm, or clear the stop or fault first")
            }
            RigIntent::Send => match page.checked() {
                Some(Ok(_)) if page.is_in_use() => Some("The board uses this description"),
                Some(Ok(_)) => None,
                Some(Err(_)) => Some("Correct the description first"),
                None => Some("There is no description: open one, or choose an example"),
            },
            RigIntent::Begin => match &page.on_board {
                Some((Some(_), true)) if page.steps.is_some() => Some("Commissioning is under way"),
                Some((Some(_), true)) => None,
                _ => Some("The board uses no description: send one first"),
            },
            RigIntent::Read => None,
            RigIntent::Wire(_) | RigIntent::Simulate if !connection.capabilities.simulated => {
                Some("This mechanism is real")
            }
            RigIntent::Wire(_) => None,
            _ => self.no_step(intent),
        }
    }

    fn no_step(&self, intent: &RigIntent) -> Option<&'static str> {
        let Some(steps) = &self.rig_page.steps else {
            return Some("Begin commissioning first");
        };
        let state = self.device();
        match (intent, steps.step()) {
            (RigIntent::Back, _) if steps.at() == 0 => Some("This is the first step"),
            (RigIntent::Back, _) => None,
            (_, None) => Some("Every step is done"),
            (RigIntent::TestMotor | RigIntent::SetReference, _)
                if matches!(state, Some(DeviceState::Stopped | DeviceState::Fault(_))) =>
            {
                Some("Stopped: clear the stop first")
            }
            (RigIntent::TestMotor, Some(Step::Motor(_))) if state == Some(DeviceState::Homing) => {
                Some("The encoders have no reference: go back to its step")
            }
            (RigIntent::TestMotor, Some(Step::Motor(_)))
            | (RigIntent::SetReference, Some(Step::Reference))
            | (RigIntent::SendCorrections, Some(Step::Send)) => None,
            (
                RigIntent::Done | RigIntent::Again | RigIntent::Simulate,
                Some(Step::Encoder(_) | Step::StopInput | Step::Workspace),
            ) => None,
            _ => Some("The present step asks for something else"),
        }
    }

    pub(super) fn perform_on_rig(&mut self, intent: RigIntent) {
        match intent {
            RigIntent::Read => self.read_rig(),
            RigIntent::Example(number) => {
                if let Some((_, text)) = EXAMPLES.get(number) {
                    self.rig_page.edit((*text).to_owned());
                }
            }
            RigIntent::Browse => self.ask_for_path(Purpose::OpenRig),
            RigIntent::Load(path) => match std::fs::read_to_string(&path) {
                Ok(text) => self.rig_page.edit(text),
                // The same words as on the command line.
                Err(_) => {
                    if let Err(error) = load_rig(&path) {
                        self.notes.add(Severity::Error, error.to_string());
                    }
                }
            },
            RigIntent::Save => self.ask_for_path(Purpose::SaveRig),
            RigIntent::Write { path, replace } => {
                write(&self.outbox, path, replace, self.rig_page.text().to_owned());
            }
            RigIntent::SaveReport => self.ask_for_path(Purpose::SaveRigReport),
            RigIntent::WriteReport { path, replace } => {
                if let Some(report) = self.rig_page.report(&self.board_in_words()) {
                    write(&self.outbox, path, replace, report);
                }
            }
            RigIntent::Edit(text) => self.rig_page.edit(text),
            RigIntent::Draw(intent) => self.rig_page.draw(intent),
            RigIntent::Send => {
                if let Some(Ok(checked)) = self.rig_page.checked() {
                    let rig = checked.rig.clone();
                    self.send_rig(rig);
                }
            }
            RigIntent::SendCorrections => {
                if let Some(steps) = &self.rig_page.steps {
                    self.send_rig(steps.rig().clone());
                }
            }
            RigIntent::Begin => self.rig_page.begin(),
            RigIntent::End => self.rig_page.steps = None,
            RigIntent::Done => self.with_steps(Commissioning::done),
            RigIntent::Again => self.with_steps(Commissioning::again),
            RigIntent::Back => self.with_steps(Commissioning::back),
            RigIntent::SetReference => {
                self.rig_page.busy = Some("The reference is being set");
                self.command(Command::Reference);
            }
            RigIntent::TestMotor => self.test_motor(),
            RigIntent::Simulate => self.simulate_step(),
            RigIntent::Wire(wiring) => {
                let rig = self.rig_page.on_board.as_ref().and_then(|(rig, _)| rig.as_ref());
                let fault = rig.and_then(|rig| wiring.fault(rig));
                self.rig_page.wiring = (wiring, fault);
                self.wire(&[]);
            }
        }
    }

    /// Board and firmware, for a report.
    fn board_in_words(&self) -> String {
        let release = env!("CARGO_PKG_VERSION");
        self.connection().map_or_else(
            || format!("Not connected; Mortise {release}."),
            |connection| {
                let can = &connection.capabilities;
                // Program and firmware of a session are of one release.
                format!(
                    "Board {} at {}, {} Hz, release {release}; longest loop time {}.",
                    can.board,
                    connection.spec,
                    can.tick_hz,
                    connection.statistics.map_or_else(
                        || "not measured".to_owned(),
                        |counters| format!(
                            "{} of {} {:?}",
                            counters.cost_max, can.cost_budget, can.cost_unit
                        )
                    )
                )
            },
        )
    }

    fn with_steps(&mut self, act: impl FnOnce(&mut Commissioning)) {
        if let Some(steps) = &mut self.rig_page.steps {
            act(steps);
        }
    }

    fn command(&self, command: Command) {
        if let Some(connection) = self.connection() {
            connection.command(command);
        }
    }

    /// Shows a workspace; that of the rig reads what the board has.
    pub(super) fn show_workspace(&mut self, workspace: Workspace) {
        self.workspace = workspace;
        self.watch_readings();
        self.show_board_rig();
    }

    /// Reads the description that the board keeps where the page shows it.
    pub(super) fn show_board_rig(&mut self) {
        let is_shown = self.workspace == Workspace::Rig;
        if is_shown && self.rig_page.on_board.is_none() && self.connection().is_some() {
            self.read_rig();
        }
    }

    /// Asks for the description that the board keeps.
    fn read_rig(&mut self) {
        self.rig_page.busy = Some("The description is being read");
        self.command(Command::ReadRig);
    }

    fn send_rig(&mut self, rig: Rig) {
        self.rig_page.busy = Some("The description is being sent");
        self.command(Command::SendRig(Box::new(rig)));
    }

    fn test_motor(&mut self) {
        let step = self.rig_page.steps.as_ref().and_then(Commissioning::step);
        let Some(Step::Motor(joint)) = step else { return };
        if let Some(connection) = self.connection_mut()
            && connection.capabilities.simulated
        {
            connection.set_hand(operator::loose());
        }
        self.rig_page.busy = Some("The motor is being tested");
        self.command(Command::TestMotor { joint, force: TEST_N });
    }

    /// Reads encoders and inputs while the page shows them, and no longer.
    fn watch_readings(&mut self) {
        let page = &self.rig_page;
        let is_described = page
            .on_board
            .as_ref()
            .is_some_and(|(rig, in_use)| rig.is_some() && *in_use);
        let watched = self.workspace == Workspace::Rig && is_described;
        if !watched {
            self.rig_page.watch = None;
        } else if self.rig_page.watch.is_none() {
            let outbox = self.outbox.clone();
            self.rig_page.watch = self
                .connection()
                .map(|connection| connection.watch_readings(outbox));
        }
    }

    pub(super) fn readings(&mut self, readings: &Readings) {
        if let Some(connection) = self.connection() {
            let hz = connection.capabilities.tick_hz;
            self.rig_page.see(readings, hz);
        }
    }

    /// The board's description was read.
    pub(super) fn rig_read(&mut self, result: Result<(Option<Rig>, bool), String>) {
        self.rig_page.busy = None;
        match result {
            Ok((rig, in_use)) => {
                if let Some(rig) = &rig {
                    self.rig_page.edit(write_rig(rig));
                }
                self.rig_page.found(rig, in_use);
                self.watch_readings();
            }
            Err(why) => self.notes.add(Severity::Error, why),
        }
    }

    /// A description was sent, and the board has started again.
    pub(super) fn rig_sent(&mut self, result: Result<RigSent, String>) {
        self.rig_page.busy = None;
        let sent = match result {
            Ok(sent) => sent,
            Err(why) => {
                self.notes.add(Severity::Error, why.clone());
                return self.with_steps(|steps| steps.sent(Err(why)));
            }
        };
        if let Some(connection) = self.connection_mut() {
            connection.state = sent.capabilities.state;
            connection.capabilities = sent.capabilities;
        }
        for (id, value) in sent.parameters {
            if let Some(known) = self.parameters.get_mut(id as usize) {
                *known = value;
            }
        }
        self.send_own_parameters();
        self.history.interrupt();
        self.notes.add(
            Severity::Good,
            format!(
                "The board has started again with the description of {}",
                sent.rig.name
            ),
        );
        let text = write_rig(&sent.rig);
        self.rig_page.found(Some(sent.rig), true);
        // What was written keeps its comments.
        if !self.rig_page.is_in_use() {
            self.rig_page.edit(text);
        }
        self.watch_readings();
        self.wire(&[]);
    }

    pub(super) fn reference_set(&mut self, result: Result<(), String>) {
        self.rig_page.busy = None;
        self.with_steps(|steps| steps.referenced(result));
    }

    pub(super) fn motor_tested(&mut self, result: Result<Option<[MotorTest; 2]>, String>) {
        self.rig_page.busy = None;
        let result = result.and_then(|tests| {
            tests.ok_or_else(|| {
                "the mechanism does not come to rest: let go of it, support it where it falls by itself, and test again"
                    .to_owned()
            })
        });
        self.with_steps(|steps| steps.tested(result));
    }

    /// Sends the wiring of a simulated mechanism, with further faults.
    fn wire(&mut self, more: &[InputFault]) {
        let Some(connection) = self.connection().filter(|c| c.capabilities.simulated) else {
            return;
        };
        let (_, lasting) = self.rig_page.wiring;
        let lasting = lasting.map(|kind| InputFault {
            tick: 0,
            ticks: u32::MAX,
            kind,
        });
        let all = lasting.into_iter().chain(more.iter().copied());
        connection.request(ToDevice::SimulatedInputs(all.collect()));
    }

    /// Leads the handle of a simulated mechanism.
    fn lead(&mut self, hand: Option<HandScript>) {
        if let (Some(hand), Some(connection)) = (hand, self.connection_mut()) {
            connection.set_hand(hand);
        }
    }

    /// The simulated operator does what the present step asks for.
    fn simulate_step(&mut self) {
        let Some(steps) = &self.rig_page.steps else { return };
        match steps.step() {
            Some(Step::StopInput) => self.wire(&[InputFault {
                tick: 0,
                ticks: PRESSED,
                kind: InputFaultKind::StopOpen,
            }]),
            Some(Step::Encoder(joint)) => {
                let hand = operator::turn(steps.in_use(), joint);
                self.rig_page.hand_since = self.rig_page.newest().map(|readings| readings.tick);
                self.lead(hand);
            }
            Some(Step::Workspace) => {
                let hand = operator::reach(steps.in_use());
                self.lead(hand);
            }
            _ => {}
        }
    }
}
