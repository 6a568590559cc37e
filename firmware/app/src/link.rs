//! The link plane: receives bytes, sends frames, and checks everything before the control plane receives it.
//!
//! Runs at low priority, never waits for the control plane and uses bounded memory: input is always read, and a command that does not fit into the
//! board's queue is refused as [`Refusal::Busy`]. A command is acknowledged when the control plane has carried it out. `Stop` is not queued and needs
//! no space for its answer: it is counted in [`crate::channel::Shared`] and read by the next tick before anything else.
//!
//! Work between two reads of the input is bounded while motors may be driven: the checksum of a scene is computed, and flash erased, only when they
//! are off and no command is pending that could drive them.

mod answers;
mod fingerprint;
mod freshness;
mod inputs;

use heapless::String;
use mortise_mechanism::kinematics::Model;
use mortise_protocol::frame::{Decoder, FrameError, Received, encode};
use mortise_protocol::image::LAYOUT_VERSION;
use mortise_protocol::limits::{MAX_FRAME, MAX_LOG, MAX_NAME, MAX_TARGETS, MAX_TICKS, MOTOR_TEST_FORCE};
use mortise_protocol::message::{
    Capabilities, DeviceState, Fault, FromDevice, Refusal, Statistics, ToDevice, Version,
};

use crate::board::{Flash, Identity, Outbound, TICK_HZ};
use crate::channel::{Command, CommandKind, EVENTS, Epoch, Event, LinkEnds, Reply, SAMPLES};
use crate::parameters::Parameters;
use crate::scripts::{check_input_faults, check_script};
use crate::store::Store;
use crate::store::rig::Kept;
use crate::wire::pose_from_wire;

use answers::{Answer, Answers};
use freshness::Freshness;

/// Space an empty [`Outbound`] must have: telemetry leaves space for one frame of answers.
pub const OUTBOUND_MIN: usize = 2 * MAX_FRAME;

/// Everything the low-priority task owns, about 2 kB. Many fields, because nothing of it lives elsewhere.
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
    freshness: Freshness,
    answers: Answers,
    /// [`Shared::epoch`] when the message being handled arrived.
    epoch: Epoch,
    /// Commands that can drive the motors, passed to the control plane.
    arms: u32,
    state: DeviceState,
    /// Sequence number of the commit that awaits the control plane, and the session it belongs to.
    commit: Option<(u16, u32)>,
    restarting: bool,
    frames: u32,
    bad_frames: u32,
    unanswered: u32,
    dropped_before: u32,
    stack_max: u32,
}

impl<'c, 's, F: Flash<'s>> LinkPlane<'c, 's, F> {
    /// A link plane with the scene found in flash, which is passed to the control plane.
    pub fn new(
        ends: LinkEnds<'c, 's>,
        flash: F,
        identity: Identity,
        simulated: bool,
        described: bool,
    ) -> Self {
        let store = Store::open(flash);
        let rig = if described { store.rig() } else { Kept::Nothing };
        let parameters = Parameters::within(identity.hardware_limits);
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
            freshness: Freshness::new(identity.entropy),
            answers: Answers::new(),
            epoch: Epoch::default(),
            arms: 0,
            state: DeviceState::Boot,
            commit: None,
            restarting: false,
            frames: 0,
            bad_frames: 0,
            unanswered: 0,
            dropped_before: 0,
            stack_max: 0,
        };
        if let Some(stored) = plane.store.current() {
            let (image, number) = (stored.image, stored.sequence);
            // The queue is new and empty.
            let _ = plane.enqueue(0, CommandKind::UseScene { image, number });
        }
        plane
    }

    /// Consumes all of `bytes`; answers are written to `out` as far as there is space, the rest wait in a bounded queue.
    pub fn receive(&mut self, bytes: &[u8], out: &mut impl Outbound) {
        for &byte in bytes {
            match self.decoder.push_stamped(byte) {
                None => continue,
                Some(Ok(frame)) => {
                    self.frames = self.frames.saturating_add(1);
                    self.ends.shared.hear();
                    self.handle(frame);
                }
                Some(Err(error)) => {
                    self.bad_frames = self.bad_frames.saturating_add(1);
                    if let FrameError::Undecodable(seq) = error {
                        self.ends.shared.hear();
                        let reason = Refusal::Undecodable;
                        self.answers.push(Answer::Refused { seq, reason });
                    }
                }
            }
            self.answer(out);
        }
    }

    /// Sends waiting answers as far as there is space; returns how many.
    fn answer(&mut self, out: &mut impl Outbound) -> usize {
        let mut sent = 0;
        while out.room() >= MAX_FRAME
            && let Some(answer) = self.answers.pop()
        {
            sent += 1;
            let message = match answer {
                Answer::Hello => FromDevice::Hello(Version::own()),
                Answer::Capabilities => FromDevice::Capabilities(self.capabilities()),
                Answer::Rig => {
                    let kept = self.store.rig();
                    FromDevice::Rig {
                        in_use: kept == self.rig,
                        rig: kept.rig().cloned(),
                    }
                }
                Answer::Ack { seq } => FromDevice::Ack { seq },
                Answer::Refused { seq, reason } => FromDevice::Refused { seq, reason },
            };
            self.send(&message, out);
        }
        sent
    }

    /// Forwards events and telemetry of the control plane as far as there is space; returns how many.
    pub fn poll(&mut self, out: &mut impl Outbound) -> usize {
        let mut passed = self.answer(out);
        for _ in 0..EVENTS {
            if out.room() < MAX_FRAME {
                return passed;
            }
            // Ahead of an answer, the inputs of all ticks before it.
            if self.ends.events.ready() && self.send_inputs(1, out) > 0 {
                passed += 1;
                continue;
            }
            let Some(event) = self.ends.events.dequeue() else {
                break;
            };
            passed += 1;
            if let Some(message) = self.pass_on(event) {
                self.send(&message, out);
            }
        }
        while out.room() >= OUTBOUND_MIN && self.send_inputs(MAX_TICKS, out) > 0 {
            passed += 1;
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

    /// Sends log bytes when a session is open and there is space; returns how many were taken.
    pub fn log(&mut self, bytes: &[u8], out: &mut impl Outbound) -> usize {
        if bytes.is_empty() || !self.greeted || out.room() < OUTBOUND_MIN {
            return 0;
        }
        let piece = &bytes[..bytes.len().min(MAX_LOG)];
        // The piece never exceeds the vector's capacity.
        if let Ok(piece) = heapless::Vec::from_slice(piece) {
            self.send(&FromDevice::Log(piece), out);
        }
        piece.len()
    }

    /// Whether a restart was granted and acknowledged: the board then restarts once its output is empty.
    pub fn restart_requested(&self) -> bool {
        self.restarting
    }

    /// Records the largest stack use that the board has measured, bytes.
    pub fn note_stack(&mut self, bytes: u32) {
        self.stack_max = self.stack_max.max(bytes);
    }

    /// The session begun by the last `Hello`, as its commands' stamps carry it.
    pub fn session(&self) -> u32 {
        self.freshness.session()
    }

    /// The scene store.
    pub fn store(&self) -> &Store<'s, F> {
        &self.store
    }

    /// The flash in its current state, as a power cut would leave it.
    pub fn into_flash(self) -> F {
        self.store.into_flash()
    }

    fn send(&mut self, message: &FromDevice, out: &mut impl Outbound) {
        let mut frame = [0u8; MAX_FRAME];
        // Every message of the table fits (tested); a missing one would leave a gap in the sequence, which the host detects.
        if let Ok(frame) = encode(self.sequence, message, &mut frame) {
            out.write(frame);
        }
        self.sequence = self.sequence.wrapping_add(1);
    }

    fn handle(&mut self, frame: Received<ToDevice>) {
        let Received {
            sequence: seq,
            stamp,
            message,
        } = frame;
        // STOP is accepted from any host, with or without a session, and whether or not its answer can be queued.
        if message == ToDevice::Stop {
            self.ends.shared.stop();
            self.answers.push(Answer::Ack { seq });
            return;
        }
        if let ToDevice::Hello(version) = message {
            self.greet(version);
            return;
        }
        if !self.answers.has_place() {
            self.unanswered = self.unanswered.saturating_add(1);
            return;
        }
        self.epoch = self.ends.shared.epoch();
        let fresh = if message.must_be_fresh() {
            self.freshness.take(stamp)
        } else {
            Ok(())
        };
        let done = if self.greeted {
            fresh.and_then(|()| self.carry_out(seq, message))
        } else {
            Err(Refusal::NotGreeted)
        };
        if !self.store.busy() {
            self.ends.shared.release_flash();
        }
        let answer = done.unwrap_or_else(|reason| Some(Answer::Refused { seq, reason }));
        if let Some(answer) = answer {
            // Space was checked above.
            self.answers.push(answer);
        }
    }

    /// Begins a session: nothing an earlier one started continues.
    fn greet(&mut self, version: Version) {
        self.greeted = version.schema == Version::own().schema;
        self.store.abort();
        if !self.store.busy() {
            self.ends.shared.release_flash();
        }
        self.ends.shared.begin_session();
        // Commands in the queue belong to the old session and will be dropped.
        self.session = self.ends.shared.sessions();
        self.freshness.begin(self.session);
        // Their sequence numbers could match messages of the new host.
        self.answers.clear();
        self.answers.push(Answer::Hello);
    }

    /// Carries out one message. `Ok(None)`: the control plane will reply.
    fn carry_out(&mut self, seq: u16, message: ToDevice) -> Result<Option<Answer>, Refusal> {
        let ack = Ok(Some(Answer::Ack { seq }));
        let kind = match message {
            // Handled by the caller.
            ToDevice::Hello(_) | ToDevice::Stop | ToDevice::Heartbeat => return ack,
            ToDevice::GetCapabilities => return Ok(Some(Answer::Capabilities)),
            ToDevice::GetRig => return Ok(Some(Answer::Rig)),
            ToDevice::SetRig(rig) => {
                if !self.described {
                    return Err(Refusal::RigFixed);
                }
                self.claim_flash()?;
                Model::new(&rig).map_err(Refusal::Rig)?;
                self.store.keep_rig(&rig)?;
                return ack;
            }
            ToDevice::SceneBegin { length, crc, layout } => {
                self.claim_flash()?;
                self.store.begin(length, crc, layout)?;
                return ack;
            }
            ToDevice::SceneChunk { offset, data } => {
                self.store.chunk(offset, &data)?;
                return ack;
            }
            ToDevice::SceneCommit => {
                self.claim_flash()?;
                let stored = self.store.commit()?;
                let (image, number) = (stored.image, stored.sequence);
                if let Err(reason) = self.enqueue(seq, CommandKind::UseScene { image, number }) {
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
                let scene = self.checked_scene()?;
                self.enqueue(seq, CommandKind::Arm(scene))?;
                self.arms = self.arms.wrapping_add(1);
                return Ok(None);
            }
            ToDevice::TestMotor { joint, force } => {
                self.may_drive()?;
                if !(MOTOR_TEST_FORCE[0]..=MOTOR_TEST_FORCE[1]).contains(&force.abs()) {
                    return Err(Refusal::BadNumber);
                }
                self.enqueue(seq, CommandKind::TestMotor { joint, force })?;
                self.arms = self.arms.wrapping_add(1);
                return Ok(None);
            }
            ToDevice::SetParameter { id, value } => {
                let parameters = self.parameters.with(id, value)?;
                let settings = parameters.settings()?;
                self.enqueue(seq, CommandKind::Settings(settings))?;
                // These will be in force: the command is valid in every session.
                self.parameters = parameters;
                return Ok(None);
            }
            // The control plane holds the values in force.
            ToDevice::GetParameter(id) => CommandKind::Parameter(id),
            ToDevice::SetTarget(target) => CommandKind::SetTarget(target),
            ToDevice::ClearTarget { id } => CommandKind::ClearTarget(id),
            ToDevice::Disarm => CommandKind::Disarm,
            ToDevice::ClearFault => CommandKind::ClearFault,
            ToDevice::Home => CommandKind::Home,
            ToDevice::Grab { part } => CommandKind::Grab(part),
            ToDevice::Release => CommandKind::Release,
            ToDevice::ResetScene => CommandKind::ResetScene,
            ToDevice::SetTelemetry { every_ticks } => CommandKind::Telemetry(every_ticks),
            ToDevice::GetStatistics { reset } => CommandKind::Statistics { reset },
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
            ToDevice::Restart => CommandKind::Restart,
            ToDevice::RecordInputs(on) => CommandKind::RecordInputs(on),
            ToDevice::GetReadings => CommandKind::Readings,
            ToDevice::Place { part, pose } => CommandKind::Place {
                part,
                pose: pose_from_wire(&pose).ok_or(Refusal::BadNumber)?,
            },
        };
        self.enqueue(seq, kind)?;
        Ok(None)
    }

    /// Keeps the motors off while flash is written, which may stall the processor, until the store has finished. Refused when they are driven, or a
    /// pending command could drive them.
    fn claim_flash(&self) -> Result<(), Refusal> {
        if self.arms == self.ends.shared.arms() && self.ends.shared.claim_flash() {
            Ok(())
        } else {
            Err(self.refused_by_motors())
        }
    }

    /// The refusal for a message that requires the motors off.
    fn refused_by_motors(&self) -> Refusal {
        match self.state {
            DeviceState::Armed | DeviceState::Active | DeviceState::SoftStop | DeviceState::Testing => {
                Refusal::State(self.state)
            }
            // The change of state has not arrived here yet.
            _ => Refusal::Busy,
        }
    }

    /// Whether a command may be passed on that drives the motors of a known mechanism: no motor is driven, and none can be before this returns.
    fn may_drive(&self) -> Result<(), Refusal> {
        if self.store.busy() || self.restarting || self.arms != self.ends.shared.arms() {
            return Err(Refusal::Busy);
        }
        if self.ends.shared.live() {
            return Err(self.refused_by_motors());
        }
        // A simulated mechanism without a description is a free handle; a real one without a description is unknown.
        let known = match self.rig {
            Kept::Rig(_) => true,
            Kept::Nothing => self.simulated || !self.described,
            Kept::Damaged => false,
        };
        if known { Ok(()) } else { Err(Refusal::RigDamaged) }
    }

    /// Number of the scene in use, after verifying its checksum. Reads all of it, about 10 instructions per byte, only while no motor is driven.
    fn checked_scene(&mut self) -> Result<u32, Refusal> {
        self.may_drive()?;
        let number = self.store.current().ok_or(Refusal::NoScene)?.sequence;
        if !self.store.is_sound() {
            self.enqueue(0, CommandKind::SceneDamaged)?;
            return Err(Refusal::State(DeviceState::Fault(Fault::SceneDamaged)));
        }
        Ok(number)
    }

    fn enqueue(&mut self, seq: u16, kind: CommandKind<'s>) -> Result<(), Refusal> {
        let command = Command {
            seq,
            epoch: self.epoch,
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
                if !self.store.busy() {
                    self.ends.shared.release_flash();
                }
                let (seq, _) = self
                    .commit
                    .take()
                    .filter(|&(_, session)| session == self.session)?;
                Some(match result {
                    Ok(()) => FromDevice::Ack { seq },
                    Err(reason) => FromDevice::Refused { seq, reason },
                })
            }
            // Answer to an earlier host.
            Event::Reply { session, .. } if session != self.session => None,
            Event::Reply { seq, reply, .. } => Some(self.translate(seq, reply)),
        }
    }

    fn translate(&mut self, seq: u16, reply: Reply) -> FromDevice {
        match reply {
            Reply::Done => FromDevice::Ack { seq },
            Reply::MayRestart => {
                self.restarting = true;
                FromDevice::Ack { seq }
            }
            Reply::Refused(reason) => FromDevice::Refused { seq, reason },
            Reply::Readings(readings) => FromDevice::Readings(readings),
            Reply::Tested(test) => FromDevice::MotorTested(test),
            Reply::Ran { tick, state_hash } => FromDevice::Ran { tick, state_hash },
            Reply::Parameter { id, value } => FromDevice::Parameter { id, value },
            Reply::Statistics { statistics, reset } => {
                let statistics = self.complete(statistics);
                if reset {
                    self.frames = 0;
                    self.bad_frames = 0;
                    self.unanswered = 0;
                    self.dropped_before = self.ends.shared.dropped();
                }
                FromDevice::Statistics(statistics)
            }
        }
    }

    /// `statistics` with the link's own counters added.
    fn complete(&self, statistics: Statistics) -> Statistics {
        Statistics {
            frames: self.frames,
            bad_frames: self.bad_frames,
            unanswered: self.unanswered,
            dropped: self.ends.shared.dropped().wrapping_sub(self.dropped_before),
            stack_max: self.stack_max,
            ..statistics
        }
    }

    fn capabilities(&self) -> Capabilities {
        let mut board: String<MAX_NAME> = String::new();
        for character in self.identity.board.chars() {
            // A name that is too long is truncated.
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
            session: self.freshness.session(),
        }
    }
}
