//! Replay by simulation: the recorded readings and messages pass through the board's own control plane again, tick by tick, and every tick's hash is
//! compared with the recorded one.
//!
//! A replay begins where the state is known: at the first reset of the scene, or upload, in the recording. It is interrupted where ticks were lost on
//! the link, and at a fault that follows from time rather than from readings (a silent host, an overrun tick), and begins again at the next reset.
//! Cost: about 20 µs a tick.

use std::collections::{HashSet, VecDeque};
use std::ops::ControlFlow;
use std::sync::{Arc, Mutex, PoisonError};

use mortise_protocol::message::{Fault, FromDevice, TickInput, ToDevice};
use mortise_protocol::parameter::ParameterId;
use mortise_protocol::rig::Rig;
use mortise_rig::{Client, Observer, Patience, Readings, RigError, Words as _, simulate_readings};

use crate::error::RecordError;
use crate::reading::{EntryKind, Recording};

/// Ticks that run without a pause to look at the results.
const AT_ONCE: usize = 1000;

/// Result of a replay.
#[derive(Clone, Debug, PartialEq)]
pub struct Replayed {
    /// Ticks in the recording.
    pub recorded: u64,
    /// Ticks computed again and compared.
    pub compared: u64,
    /// The first tick with another result, which ends the comparison; `None`: all bits are the same.
    pub difference: Option<Difference>,
    /// Reasons why ticks were left out, with the tick from which.
    pub left_out: Vec<(u32, String)>,
}

/// The first tick whose result differs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Difference {
    /// The tick, as the board counted it.
    pub tick: u32,
    /// Ticks since the scene was reset or loaded.
    pub since_reset: u64,
    /// Its hash in the recording and in the replay.
    pub hashes: [u32; 2],
    /// The last message that took effect before it, in words.
    pub after: String,
}

/// A recorded tick.
struct Tick {
    number: u32,
    count: [f32; 2],
    lost: u32,
    input: TickInput,
}

/// A message that the board may have carried out.
struct Order {
    sequence: u16,
    message: ToDevice,
    /// It was acknowledged; `None`: no answer is recorded.
    done: Option<bool>,
}

/// The ticks and messages of a recording, each in their order, and what the board said of itself.
#[derive(Default)]
struct Session {
    ticks: Vec<Tick>,
    orders: VecDeque<Order>,
    parameters: Vec<(ParameterId, f32)>,
    rig: Option<Rig>,
    simulated: bool,
    /// Numbers of the ticks in which a fault occurred that follows from time.
    timed_out: HashSet<u32>,
    /// Checksum of the scene in use when the recording began.
    scene: Option<u32>,
}

/// Computes the recording again. `changes`: parameters that have other values than in the recording, to see what they would have changed; empty for a
/// check.
///
/// # Errors
/// `NothingToReplay` when it holds no inputs, or no reset or upload of a scene whose image is attached; `Rig` when the simulation ends.
pub fn replay(recording: &Recording, changes: &[(ParameterId, f32)]) -> Result<Replayed, RecordError> {
    replay_with(recording, changes, &|_| ControlFlow::Continue(()))
}

/// As [`replay()`]. `progress` is given the share that is done, 0 to 1, after each thousand ticks, and may end the replay.
///
/// # Errors
/// As [`replay()`]; `Cancelled` when `progress` ends it.
pub fn replay_with(
    recording: &Recording,
    changes: &[(ParameterId, f32)],
    progress: &dyn Fn(f64) -> ControlFlow<()>,
) -> Result<Replayed, RecordError> {
    let nothing = |why: &str| RecordError::NothingToReplay {
        path: recording.path().to_owned(),
        why: why.to_owned(),
    };
    let session = Session::of(recording);
    if session.ticks.is_empty() {
        return Err(nothing("it holds no inputs of ticks"));
    }
    let mut player = Player::new(recording, &session, changes)?;
    let recorded = session.ticks.len() as u64;
    player.play(session, progress)?;
    let result = player.result;
    if result.compared == 0 {
        return Err(nothing(
            "the scene was never reset or uploaded while it was recorded, or its image is not attached, so that its state is unknown",
        ));
    }
    Ok(Replayed { recorded, ..result })
}

impl Session {
    fn of(recording: &Recording) -> Self {
        let mut session = Self::default();
        for entry in recording.entries() {
            match entry.kind {
                EntryKind::Inputs(ticks) => {
                    for (at, input) in ticks.inputs.into_iter().enumerate() {
                        session.ticks.push(Tick {
                            number: ticks.first_tick.wrapping_add(at as u32),
                            count: ticks.count,
                            lost: ticks.lost,
                            input,
                        });
                    }
                }
                EntryKind::Sent(sequence, message) => {
                    let done = None;
                    session.orders.push_back(Order {
                        sequence,
                        message,
                        done,
                    });
                }
                EntryKind::Received(message) => session.received(message),
                EntryKind::Telemetry(_) => {}
            }
        }
        session
    }

    fn received(&mut self, message: FromDevice) {
        match message {
            FromDevice::Ack { seq } => self.answered(seq, true),
            FromDevice::Refused { seq, .. } => self.answered(seq, false),
            FromDevice::Parameter { id, value } => self.parameters.push((id, value)),
            FromDevice::Rig { rig, in_use } => self.rig = rig.filter(|_| in_use),
            FromDevice::Capabilities(capabilities) => {
                self.simulated = capabilities.simulated;
                // Uploads that follow are among the messages.
                if self.ticks.is_empty() {
                    self.scene = capabilities.scene;
                }
            }
            FromDevice::Fault {
                tick,
                fault: Fault::HostSilent { .. } | Fault::TickOverrun | Fault::SceneDamaged,
            } => {
                // The report counts the ticks before the one that failed.
                self.timed_out.insert(tick.wrapping_add(1));
            }
            _ => {}
        }
    }

    fn answered(&mut self, seq: u16, done: bool) {
        if let Some(order) = self.orders.iter_mut().rev().find(|order| order.sequence == seq) {
            order.done = order.done.or(Some(done));
        }
    }
}

/// Collects the hashes of the simulation's ticks.
#[derive(Default)]
struct Hashes(Mutex<VecDeque<u32>>);

impl Observer for Hashes {
    fn sent(&self, _sequence: u16, _message: &ToDevice) {}

    fn received(&self, _sequence: u16, message: &FromDevice) {
        if let FromDevice::Inputs(inputs) = message {
            let mut hashes = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            hashes.extend(inputs.ticks.iter().map(|tick| tick.hash));
        }
    }
}

/// The simulation, and how far it is.
struct Player<'r> {
    recording: &'r Recording,
    client: Client,
    readings: Readings,
    hashes: Arc<Hashes>,
    /// Parameters that keep their changed values.
    changed: Vec<ParameterId>,
    /// Ticks given to the simulation but not run yet: number, hash, and ticks since the reset.
    waiting: Vec<(u32, u32, u64)>,
    /// The state is that of the recording: since a reset, without a gap.
    known: bool,
    since_reset: u64,
    /// The simulation has the scene that the board had.
    has_scene: bool,
    uploading: Option<u32>,
    last: String,
    result: Replayed,
}

impl<'r> Player<'r> {
    fn new(
        recording: &'r Recording,
        session: &Session,
        changes: &[(ParameterId, f32)],
    ) -> Result<Self, RigError> {
        let readings = Readings::new(session.rig.clone(), session.simulated);
        let transport = simulate_readings(&readings)?;
        let client = Client::over(transport, "replay", Patience::long(), None)?;
        client.set_lockstep(true)?;
        let hashes = Arc::new(Hashes::default());
        client.observe(Some(hashes.clone()));
        client.request(ToDevice::RecordInputs(true))?;
        set_all(&client, &session.parameters)?;
        set_all(&client, changes)?;
        let image = session.scene.and_then(|crc| recording.scene(crc));
        if let Some(image) = image {
            client.upload(image, &mut |_| {})?;
        }
        Ok(Self {
            recording,
            client,
            readings,
            hashes,
            changed: changes.iter().map(|&(id, _)| id).collect(),
            waiting: Vec::new(),
            known: false,
            since_reset: 0,
            has_scene: image.is_some(),
            uploading: None,
            last: "the beginning".into(),
            result: Replayed {
                recorded: 0,
                compared: 0,
                difference: None,
                left_out: Vec::new(),
            },
        })
    }

    fn play(
        &mut self,
        mut session: Session,
        progress: &dyn Fn(f64) -> ControlFlow<()>,
    ) -> Result<(), RecordError> {
        let mut before: Option<Tick> = None;
        let count = session.ticks.len();
        for (index, tick) in session.ticks.into_iter().enumerate() {
            if index % AT_ONCE == 0 && progress(index as f64 / count as f64).is_break() {
                return Err(RecordError::Cancelled);
            }
            let timed_out = session.timed_out.contains(&tick.number);
            self.interrupt(before.as_ref(), &tick, timed_out)?;
            let stopped = before
                .as_ref()
                .is_some_and(|before| before.input.stops != tick.input.stops);
            if stopped && self.known {
                self.run()?;
                self.perform(&ToDevice::Stop)?;
            }
            while let Some(order) = due(&mut session.orders, tick.input.carried_out) {
                self.order(&order, before.as_ref(), tick.number)?;
            }
            if self.known {
                self.readings.push(&tick.input, tick.count);
                self.since_reset += 1;
                self.waiting
                    .push((tick.number, tick.input.hash, self.since_reset));
                if self.waiting.len() >= AT_ONCE {
                    self.run()?;
                }
            }
            if self.result.difference.is_some() {
                return Ok(());
            }
            before = Some(tick);
        }
        Ok(self.run()?)
    }

    /// Ends the comparison where the recording does not determine the next tick.
    fn interrupt(&mut self, before: Option<&Tick>, tick: &Tick, timed_out: bool) -> Result<(), RigError> {
        let gap = before
            .is_some_and(|before| before.number.wrapping_add(1) != tick.number || before.lost != tick.lost);
        if timed_out {
            self.leave_out(tick.number, "a fault that follows from time")
        } else if gap {
            self.leave_out(tick.number, "ticks before it were lost on the link")
        } else {
            Ok(())
        }
    }

    /// Compares what is known so far, and no more until the next reset.
    fn leave_out(&mut self, tick: u32, why: &str) -> Result<(), RigError> {
        if self.known {
            self.run()?;
            self.known = false;
            self.result.left_out.push((tick, why.to_owned()));
        }
        Ok(())
    }

    /// Carries out a message that the board has carried out before `tick`; `before`: the tick before that.
    fn order(&mut self, order: &Order, before: Option<&Tick>, tick: u32) -> Result<(), RigError> {
        if let ToDevice::SceneBegin { crc, .. } = order.message {
            self.uploading = Some(crc);
        }
        if order.done != Some(true) {
            return Ok(());
        }
        if order.message == ToDevice::SceneCommit {
            let recording = self.recording;
            let Some(image) = self.uploading.take().and_then(|crc| recording.scene(crc)) else {
                self.has_scene = false;
                return self.leave_out(
                    tick,
                    "a collision model was uploaded that the recording does not hold",
                );
            };
            self.reset(before)?;
            self.has_scene = true;
            self.last = order.message.words();
            return self.client.upload(image, &mut |_| {});
        }
        if order.message == ToDevice::ResetScene && self.has_scene {
            self.reset(before)?;
        }
        if self.known || matches!(order.message, ToDevice::SetParameter { .. }) {
            self.run()?;
            self.perform(&order.message)?;
        }
        Ok(())
    }

    /// Prepares for a reset of the scene, after which the state is known.
    fn reset(&mut self, before: Option<&Tick>) -> Result<(), RigError> {
        self.run()?;
        if !self.known {
            self.begin(before)?;
        }
        self.since_reset = 0;
        Ok(())
    }

    /// Motors off, and the readings of the tick before a reset.
    fn begin(&mut self, before: Option<&Tick>) -> Result<(), RigError> {
        self.client.request(ToDevice::Stop)?;
        if let Some(before) = before {
            self.readings.push(&before.input, before.count);
        }
        self.client.run(1)?;
        self.lock().clear();
        // Refused while the recorded readings forbid it, as it was on the board.
        let _ = self.client.request(ToDevice::ClearFault);
        self.known = true;
        Ok(())
    }

    /// Sends a message that changes what a tick computes; all others change nothing.
    fn perform(&mut self, message: &ToDevice) -> Result<(), RigError> {
        let result = match message {
            ToDevice::SetParameter { id, .. } if self.changed.contains(id) => return Ok(()),
            ToDevice::Stop
            | ToDevice::Arm
            | ToDevice::Disarm
            | ToDevice::ClearFault
            | ToDevice::Home
            | ToDevice::SetParameter { .. }
            | ToDevice::Grab { .. }
            | ToDevice::Release
            | ToDevice::ResetScene
            | ToDevice::Place { .. }
            | ToDevice::SetTarget(_)
            | ToDevice::ClearTarget { .. } => self.client.request(message.clone()),
            _ => return Ok(()),
        };
        self.last = message.words();
        match result {
            // The board did carry it out: the difference shows in the next tick.
            Err(RigError::Refused { .. }) => Ok(()),
            result => result,
        }
    }

    /// Runs the ticks that wait, and compares.
    fn run(&mut self) -> Result<(), RigError> {
        if self.waiting.is_empty() || self.result.difference.is_some() {
            return Ok(());
        }
        self.client.run(self.waiting.len() as u32)?;
        let computed: Vec<u32> = self.lock().drain(..).collect();
        for (&(tick, recorded, since_reset), &found) in self.waiting.iter().zip(&computed) {
            self.result.compared += 1;
            if recorded != found {
                self.result.difference = Some(Difference {
                    tick,
                    since_reset,
                    hashes: [recorded, found],
                    after: self.after(),
                });
                break;
            }
        }
        if let Some(&(tick, ..)) = self.waiting.get(computed.len()) {
            self.known = false;
            let why = "the simulation did not report every tick".to_owned();
            self.result.left_out.push((tick, why));
        }
        self.waiting.clear();
        Ok(())
    }

    /// The last message in words, and what may be missing after it.
    fn after(&self) -> String {
        match self.recording.lost_messages() {
            0 => self.last.clone(),
            lost => format!(
                "{} (of the board's messages the recording lacks {lost})",
                self.last
            ),
        }
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, VecDeque<u32>> {
        self.hashes.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The next message that took effect before a tick by which the board had carried out message `carried_out`.
fn due(orders: &mut VecDeque<Order>, carried_out: u16) -> Option<Order> {
    let ahead = carried_out.wrapping_sub(orders.front()?.sequence);
    // Sequence numbers are compared in a circle.
    if carried_out == 0 || ahead >= 1 << 15 {
        return None;
    }
    let mut order = orders.pop_front()?;
    // Its answer was lost, or not yet recorded, but the tick says that it was carried out.
    if ahead == 0 && order.done.is_none() {
        order.done = Some(true);
    }
    Some(order)
}

/// Sets all parameters. One may be refused until another is set, so it is tried again as long as that helps.
fn set_all(client: &Client, parameters: &[(ParameterId, f32)]) -> Result<(), RigError> {
    let mut left: Vec<_> = parameters.to_vec();
    loop {
        let before = left.len();
        let mut refused = Vec::new();
        for (id, value) in left {
            match client.request(ToDevice::SetParameter { id, value }) {
                Ok(()) => {}
                Err(RigError::Refused { .. }) => refused.push((id, value)),
                Err(error) => return Err(error),
            }
        }
        if refused.is_empty() || refused.len() == before {
            return Ok(());
        }
        left = refused;
    }
}
