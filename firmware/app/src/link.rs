//! The link plane: bytes in, frames out, everything checked before the control plane hears of it.
//!
//! Runs at low priority, never waits for the control plane and holds bounded memory: input is taken only while there is room for the answer,
//! and what the board's queue cannot hold is refused as [`Refusal::Busy`]. A command is acknowledged when the control plane has carried it
//! out. `Stop` does not queue: it is counted in [`crate::channel::Shared`] and seen by the next tick before anything else.

use heapless::String;
use mortise_protocol::frame::{Decoder, FrameError, encode};
use mortise_protocol::image::LAYOUT_VERSION;
use mortise_protocol::limits::{MAX_FRAME, MAX_LOG, MAX_NAME, MAX_TARGETS};
use mortise_protocol::message::{
    Capabilities, DeviceState, Fault, FromDevice, Refusal, Statistics, ToDevice, Version,
};

use crate::board::{Flash, Identity, Outbound, TICK_HZ};
use crate::channel::{Command, CommandKind, EVENTS, Event, LinkEnds, Reply, SAMPLES};
use crate::hand::check_script;
use crate::input_faults::check_input_faults;
use crate::kinematics::Model;
use crate::parameters::Parameters;
use crate::store::Store;
use crate::store::rig::Kept;

/// Room an [`Outbound`] must have when empty: telemetry leaves one frame's room for answers.
pub const OUTBOUND_MIN: usize = 2 * MAX_FRAME;

/// Everything the low-priority task owns. About 2 kB.
pub struct LinkPlane<'c, 's, F> {
    ends: LinkEnds<'c, 's>,
    store: Store<'s, F>,
    identity: Identity,
    simulated: bool,
    described: bool,
    /// The description the board started with.
    rig: Kept,
    parameters: Parameters,
    decoder: Decoder,
    sequence: u16,
    greeted: bool,
    session: u32,
    /// An `Arm` that the control plane has not replied to.
    arming: Option<u16>,
    state: DeviceState,
    /// Sequence number of the commit that waits for the control plane, and the session it belongs to.
    commit: Option<(u16, u32)>,
    restart: Option<u16>,
    restarting: bool,
    frames: u32,
    bad_frames: u32,
    dropped_before: u32,
    /// Sequence number of the question after whose answer the link's counters start anew.
    count_anew: Option<u16>,
    stack_max: u32,
}

impl<'c, 's, F: Flash<'s>> LinkPlane<'c, 's, F> {
    /// Looks for a scene in flash and hands it to the control plane.
    pub fn new(
        ends: LinkEnds<'c, 's>,
        flash: F,
        identity: Identity,
        simulated: bool,
        described: bool,
    ) -> Self {
        let store = Store::open(flash);
        let rig = if described { store.rig() } else { Kept::Nothing };
        let parameters = Parameters::within(identity.ceilings);
        let mut plane = Self {
            ends,
            store,
            identity,
            simulated,
            described,
            rig,
            parameters,
            decoder: Decoder::new(),
            sequence: 0,
            greeted: false,
            session: 0,
            arming: None,
            state: DeviceState::Boot,
            commit: None,
            restart: None,
            restarting: false,
            frames: 0,
            bad_frames: 0,
            dropped_before: 0,
            count_anew: None,
            stack_max: 0,
        };
        if let Some(stored) = plane.store.current() {
            let scene = stored.image;
            // The queue is new and empty.
            let _ = plane.enqueue(0, CommandKind::UseScene(scene));
        }
        plane
    }

    /// Takes received bytes, answers into `out`; returns how many were taken. The rest is to be offered again when `out` has emptied.
    pub fn receive(&mut self, bytes: &[u8], out: &mut impl Outbound) -> usize {
        for (taken, &byte) in bytes.iter().enumerate() {
            // Only the end of a frame can cause an answer.
            if byte == 0 && out.room() < MAX_FRAME {
                return taken;
            }
            match self.decoder.push::<ToDevice>(byte) {
                None => {}
                Some(Ok((seq, message))) => {
                    self.frames = self.frames.saturating_add(1);
                    self.ends.shared.hear();
                    if let Some(answer) = self.handle(seq, message) {
                        self.send(&answer, out);
                    }
                }
                Some(Err(error)) => {
                    self.bad_frames = self.bad_frames.saturating_add(1);
                    if let FrameError::Undecodable(seq) = error {
                        self.ends.shared.hear();
                        let reason = Refusal::Undecodable;
                        self.send(&FromDevice::Refused { seq, reason }, out);
                    }
                }
            }
        }
        bytes.len()
    }

    /// Passes on what the control plane has to say, as far as there is room; returns how much that was.
    pub fn poll(&mut self, out: &mut impl Outbound) -> usize {
        let mut passed = 0;
        for _ in 0..EVENTS {
            if out.room() < MAX_FRAME {
                return passed;
            }
            let Some(event) = self.ends.events.dequeue() else {
                break;
            };
            passed += 1;
            if let Some(message) = self.pass_on(event) {
                self.send(&message, out);
            }
        }
        for _ in 0..SAMPLES {
            if out.room() < OUTBOUND_MIN {
                return passed;
            }
            let Some(sample) = self.ends.samples.dequeue() else {
                return passed;
            };
            passed += 1;
            self.send(&FromDevice::Telemetry(sample), out);
        }
        passed
    }

    /// Sends bytes of log when a host listens and there is room; returns how many were taken.
    pub fn log(&mut self, bytes: &[u8], out: &mut impl Outbound) -> usize {
        if bytes.is_empty() || !self.greeted || out.room() < OUTBOUND_MIN {
            return 0;
        }
        let piece = &bytes[..bytes.len().min(MAX_LOG)];
        // Never longer than the vector.
        if let Ok(piece) = heapless::Vec::from_slice(piece) {
            self.send(&FromDevice::Log(piece), out);
        }
        piece.len()
    }

    /// A restart was granted and acknowledged: the board restarts once its output is empty.
    pub fn restart_requested(&self) -> bool {
        self.restarting
    }

    /// Notes the deepest stack the board has seen, bytes.
    pub fn note_stack(&mut self, bytes: u32) {
        self.stack_max = self.stack_max.max(bytes);
    }

    /// The scene store.
    pub fn store(&self) -> &Store<'s, F> {
        &self.store
    }

    /// The flash, as it is: what a power cut leaves.
    pub fn into_flash(self) -> F {
        self.store.into_flash()
    }

    fn send(&mut self, message: &FromDevice, out: &mut impl Outbound) {
        let mut frame = [0u8; MAX_FRAME];
        // Every message of the table fits (tested); one that did not would be missing from the sequence, which the host notices.
        if let Ok(frame) = encode(self.sequence, message, &mut frame) {
            out.write(frame);
        }
        self.sequence = self.sequence.wrapping_add(1);
    }

    fn handle(&mut self, seq: u16, message: ToDevice) -> Option<FromDevice> {
        // STOP is for everyone, greeted or not.
        if message == ToDevice::Stop {
            self.ends.shared.stop();
            return Some(FromDevice::Ack { seq });
        }
        if let ToDevice::Hello(version) = message {
            self.greet(version);
            return Some(FromDevice::Hello(Version::own()));
        }
        if !self.greeted {
            let reason = Refusal::NotGreeted;
            return Some(FromDevice::Refused { seq, reason });
        }
        match self.carry_out(seq, message) {
            Ok(answer) => answer,
            Err(reason) => Some(FromDevice::Refused { seq, reason }),
        }
    }

    /// A new host: nothing an earlier one left under way goes on.
    fn greet(&mut self, version: Version) {
        self.greeted = version.schema == Version::own().schema;
        self.store.abort();
        self.ends.shared.begin_session();
        self.session = self.ends.shared.sessions();
        // What waits in the queue belongs to the old session and will be dropped.
        self.arming = None;
        self.restart = None;
    }

    /// `Ok(None)`: the control plane will reply.
    fn carry_out(&mut self, seq: u16, message: ToDevice) -> Result<Option<FromDevice>, Refusal> {
        let ack = Ok(Some(FromDevice::Ack { seq }));
        let kind = match message {
            // Handled before.
            ToDevice::Hello(_) | ToDevice::Stop | ToDevice::Heartbeat => return ack,
            ToDevice::GetCapabilities => return Ok(Some(FromDevice::Capabilities(self.capabilities()))),
            ToDevice::GetParameter(id) => {
                let value = self.parameters.get(id);
                return Ok(Some(FromDevice::Parameter { id, value }));
            }
            ToDevice::GetRig => {
                let kept = self.store.rig();
                let in_use = kept == self.rig;
                let rig = kept.rig().cloned();
                return Ok(Some(FromDevice::Rig { rig, in_use }));
            }
            ToDevice::SetRig(rig) => {
                if !self.described {
                    return Err(Refusal::RigFixed);
                }
                self.may_store()?;
                Model::new(&rig).map_err(Refusal::Rig)?;
                self.store.keep_rig(&rig)?;
                return ack;
            }
            ToDevice::SceneBegin { length, crc, layout } => {
                self.may_store()?;
                self.store.begin(length, crc, layout)?;
                return ack;
            }
            ToDevice::SceneChunk { offset, data } => {
                self.store.chunk(offset, &data)?;
                return ack;
            }
            ToDevice::SceneCommit => {
                self.may_store()?;
                let stored = self.store.commit()?;
                if let Err(reason) = self.enqueue(seq, CommandKind::UseScene(stored.image)) {
                    self.store.not_taken_over()?;
                    return Err(reason);
                }
                self.commit = Some((seq, self.session));
                return Ok(None);
            }
            ToDevice::SceneAbort if self.store.abort() => return ack,
            ToDevice::SceneAbort => return Err(Refusal::NoUpload),
            ToDevice::SimulatedHand(_)
            | ToDevice::SimulatedInputs(_)
            | ToDevice::Lockstep(_)
            | ToDevice::Run { .. }
                if !self.simulated =>
            {
                return Err(Refusal::NotSimulated);
            }

            ToDevice::Arm => {
                self.may_arm()?;
                self.enqueue(seq, CommandKind::Arm)?;
                self.arming = Some(seq);
                return Ok(None);
            }
            ToDevice::SetParameter { id, value } => {
                let parameters = self.parameters.with(id, value)?;
                let settings = parameters.settings()?;
                self.enqueue(seq, CommandKind::Settings(settings))?;
                self.parameters = parameters;
                return Ok(None);
            }
            ToDevice::SetTarget(target) => CommandKind::SetTarget(target),
            ToDevice::ClearTarget { id } => CommandKind::ClearTarget(id),
            ToDevice::Disarm => CommandKind::Disarm,
            ToDevice::ClearFault => CommandKind::ClearFault,
            ToDevice::Home => CommandKind::Home,
            ToDevice::Grab { part } => CommandKind::Grab(part),
            ToDevice::Release => CommandKind::Release,
            ToDevice::ResetScene => CommandKind::ResetScene,
            ToDevice::SetTelemetry { every_ticks } => CommandKind::Telemetry(every_ticks),
            ToDevice::GetStatistics { reset } => {
                self.enqueue(seq, CommandKind::Statistics { reset })?;
                if reset {
                    self.count_anew = Some(seq);
                }
                return Ok(None);
            }
            ToDevice::SimulatedHand(script) => {
                check_script(&script)?;
                CommandKind::Hand(script)
            }
            ToDevice::SimulatedInputs(faults) => {
                check_input_faults(&faults)?;
                CommandKind::InputFaults(faults)
            }
            ToDevice::Lockstep(on) => CommandKind::Lockstep(on),
            ToDevice::Run { ticks } => CommandKind::Run(ticks),
            ToDevice::Restart => {
                self.enqueue(seq, CommandKind::Restart)?;
                self.restart = Some(seq);
                return Ok(None);
            }
        };
        self.enqueue(seq, kind)?;
        Ok(None)
    }

    /// Scenes are stored only while the motors are off and nothing is on its way that could switch them on: flash may stall the processor.
    fn may_store(&self) -> Result<(), Refusal> {
        match self.state {
            DeviceState::Armed | DeviceState::Active | DeviceState::SoftStop => {
                Err(Refusal::State(self.state))
            }
            // The change of state is on its way here.
            _ if self.ends.shared.live() || self.arming.is_some() => Err(Refusal::Busy),
            DeviceState::Boot
            | DeviceState::Homing
            | DeviceState::Idle
            | DeviceState::Stopped
            | DeviceState::Fault(_) => Ok(()),
        }
    }

    /// No motors while flash is written, and none for a scene that has changed in flash. Reads the whole scene: about 10 instructions a byte.
    fn may_arm(&mut self) -> Result<(), Refusal> {
        if self.store.busy() || self.arming.is_some() {
            return Err(Refusal::Busy);
        }
        if self.rig == Kept::Damaged {
            return Err(Refusal::RigDamaged);
        }
        if self.store.current().is_none() {
            return Err(Refusal::NoScene);
        }
        if self.state == DeviceState::Idle && !self.store.is_sound() {
            self.enqueue(0, CommandKind::SceneDamaged)?;
            return Err(Refusal::State(DeviceState::Fault(Fault::SceneDamaged)));
        }
        Ok(())
    }

    fn enqueue(&mut self, seq: u16, kind: CommandKind<'s>) -> Result<(), Refusal> {
        let command = Command {
            seq,
            stops: self.ends.shared.stops(),
            session: self.session,
            kind,
        };
        self.ends.commands.enqueue(command).map_err(|_| Refusal::Busy)
    }

    fn pass_on(&mut self, event: Event) -> Option<FromDevice> {
        match event {
            Event::State { tick, state } => {
                self.state = state;
                self.greeted.then_some(FromDevice::State { tick, state })
            }
            Event::Fault { tick, fault } => self.greeted.then_some(FromDevice::Fault { tick, fault }),
            Event::SceneTaken(result) => {
                let result = match result {
                    Ok(()) => {
                        self.store.taken_over();
                        Ok(())
                    }
                    Err(reason) => self.store.not_taken_over().and(Err(reason)),
                };
                let (seq, _) = self
                    .commit
                    .take()
                    .filter(|&(_, session)| session == self.session)?;
                Some(match result {
                    Ok(()) => FromDevice::Ack { seq },
                    Err(reason) => FromDevice::Refused { seq, reason },
                })
            }
            // What an earlier host asked for.
            Event::Reply { session, .. } if session != self.session => None,
            Event::Reply { seq, reply, .. } => {
                if self.arming == Some(seq) {
                    self.arming = None;
                }
                Some(self.translate(seq, reply))
            }
        }
    }

    fn translate(&mut self, seq: u16, reply: Reply) -> FromDevice {
        match reply {
            Reply::Done => {
                if self.restart == Some(seq) {
                    self.restarting = true;
                }
                FromDevice::Ack { seq }
            }
            Reply::Refused(reason) => {
                if self.restart == Some(seq) {
                    self.restart = None;
                }
                FromDevice::Refused { seq, reason }
            }
            Reply::Ran { tick, state_hash } => FromDevice::Ran { tick, state_hash },
            Reply::Statistics(statistics) => {
                let statistics = self.complete(statistics);
                if self.count_anew == Some(seq) {
                    self.count_anew = None;
                    self.frames = 0;
                    self.bad_frames = 0;
                    self.dropped_before = self.ends.shared.dropped();
                }
                FromDevice::Statistics(statistics)
            }
        }
    }

    /// Adds the link's own counters.
    fn complete(&self, statistics: Statistics) -> Statistics {
        Statistics {
            frames: self.frames,
            bad_frames: self.bad_frames,
            dropped: self.ends.shared.dropped().wrapping_sub(self.dropped_before),
            stack_max: self.stack_max,
            ..statistics
        }
    }

    fn capabilities(&self) -> Capabilities {
        let mut board: String<MAX_NAME> = String::new();
        for character in self.identity.board.chars() {
            // A name that is too long is cut.
            if board.push(character).is_err() {
                break;
            }
        }
        Capabilities {
            board,
            scene_capacity: self.store.capacity(),
            scene_layout: LAYOUT_VERSION,
            scene: self.store.current().map(|s| s.crc),
            tick_hz: TICK_HZ,
            force_axes: self.identity.force_axes,
            torque_axes: self.identity.torque_axes,
            simulated: self.simulated,
            cost_unit: self.identity.cost_unit,
            cost_budget: self.identity.cost_budget,
            max_targets: MAX_TARGETS as u8,
            reset: self.identity.reset,
            state: self.state,
        }
    }
}
