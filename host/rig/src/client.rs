//! The client: the operations of a program on any rig.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use mortise_protocol::message::{
    Capabilities, DeviceState, FromDevice, MotorTest, Readings, Statistics, ToDevice, Version,
};
use mortise_protocol::parameter::ParameterId;
use mortise_protocol::rig::Rig;

use crate::error::RigError;
use crate::event::{Event, Events};
use crate::exchange::{Patience, greet, no_answer, obtain, patience_for, started_anew};
use crate::faults::FaultLine;
use crate::heartbeat::{HEARTBEAT, HEARTBEAT_COUNTED, Heartbeat};
use crate::link::{Answer, Link, Reader};
use crate::observer::Observer;
use crate::preload::Preload;
use crate::spec::{EmulatedMode, RigSpec};
use crate::transport::Transport;
use crate::{emulator, real_time, serial, simulated};

/// Answer to [`ToDevice::Run`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ran {
    /// Ticks since start.
    pub tick: u32,
    /// See [`Statistics::state_hash`].
    pub state_hash: u64,
}

/// Counts at this end of the link.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LinkCounts {
    /// Valid frames from the board.
    pub frames: u64,
    /// Frames dropped: damaged, too long, undecodable.
    pub bad_frames: u64,
    /// Telemetry dropped because this program did not take it in time.
    pub dropped_events: u64,
}

/// A connected rig. `Send` and `Sync`: one thread may upload while another stops.
///
/// Dropping it while the motors may be on sends [`ToDevice::Stop`] first.
pub struct Client {
    link: Arc<Link>,
    name: String,
    patience: Patience,
    capabilities: Capabilities,
    lockstep: Arc<AtomicBool>,
    /// Serialises messages whose answers carry no sequence number: at most one may be under way.
    asking: Mutex<()>,
    heartbeat: Option<Heartbeat>,
    reader: Option<Reader>,
    fault_line: Option<FaultLine>,
}

impl Client {
    /// Connects: opens the rig, greets it until it answers, and reads its capabilities. Rigs whose ticks are released by the host are
    /// switched to lockstep.
    ///
    /// # Errors
    /// All of [`RigError`] up to and including `VersionMismatch`.
    pub fn connect(spec: &RigSpec) -> Result<Self, RigError> {
        Self::connect_through(spec, None, Ok)
    }

    /// As [`Self::connect`]; an emulated board starts with the scene `image` in its flash, where it fits. Other rigs take it by [`Self::upload`].
    ///
    /// # Errors
    /// As [`Self::connect`].
    pub fn connect_with_scene(spec: &RigSpec, image: &[u8]) -> Result<Self, RigError> {
        Self::connect_through(spec, Some(image), Ok)
    }

    /// Like [`Self::connect`], through a line with faults that begin on request: [`Client::fault_line`].
    ///
    /// # Errors
    /// As [`Self::connect`].
    pub fn connect_with_faults(spec: &RigSpec) -> Result<Self, RigError> {
        let line = FaultLine::default();
        let mut client = Self::connect_through(spec, None, |stream| line.into_stream(stream))?;
        client.fault_line = Some(line);
        Ok(client)
    }

    fn connect_through(
        spec: &RigSpec,
        scene: Option<&[u8]>,
        through: impl FnOnce(Transport) -> Result<Transport, RigError>,
    ) -> Result<Self, RigError> {
        let name = spec.to_string();
        match spec {
            RigSpec::Simulated { realtime } => {
                let transport = through(simulated::simulate(&simulated::Flash::default(), *realtime)?)?;
                let client = Self::over(transport, &name, Patience::long(), None)?;
                if let Some(refusal) = real_time::take_refusal() {
                    client.link.events.push(Event::Log(refusal));
                }
                client.in_lockstep(!realtime)
            }
            RigSpec::Emulated { mode, firmware } => {
                let elf = emulator::firmware_path(firmware.as_deref())?;
                // Without the temporary file the scene is sent, as to any board.
                let scene = scene.and_then(|image| Preload::new(image).ok().flatten());
                let transport = through(emulator::start(*mode, &elf, scene)?)?;
                let client = Self::over_paced(transport, &name, Patience::long(), Some(elf), *mode)?;
                client.in_lockstep(*mode == EmulatedMode::Lockstep)
            }
            RigSpec::Serial { port } => {
                let transport = through(serial::open(port)?)?;
                Self::over(transport, &name, Patience::default(), None)
            }
        }
    }

    fn in_lockstep(self, wanted: bool) -> Result<Self, RigError> {
        if wanted {
            self.set_lockstep(true)?;
        }
        Ok(self)
    }

    /// Connects over a transport of the caller's. `name` is used in messages; `elf` is the firmware where known, for its log.
    pub fn over(
        transport: Transport,
        name: &str,
        patience: Patience,
        elf: Option<PathBuf>,
    ) -> Result<Self, RigError> {
        Self::over_paced(transport, name, patience, elf, EmulatedMode::Interactive)
    }

    fn over_paced(
        transport: Transport,
        name: &str,
        patience: Patience,
        elf: Option<PathBuf>,
        mode: EmulatedMode,
    ) -> Result<Self, RigError> {
        let (link, reader) = Link::start(transport, elf)?;
        // From here on an early return must end the reader, which this guard does.
        let guard = Ending {
            link: link.clone(),
            reader: Some(reader),
        };
        let capabilities = greet(&link, name, &patience)?;
        let lockstep = Arc::new(AtomicBool::new(false));
        let period = match mode {
            EmulatedMode::Interactive => HEARTBEAT,
            EmulatedMode::Counted | EmulatedMode::Lockstep => HEARTBEAT_COUNTED,
        };
        let heartbeat = Heartbeat::start(link.clone(), name, lockstep.clone(), period, patience.silence)?;
        Ok(Self {
            link,
            name: name.to_owned(),
            patience,
            capabilities,
            lockstep,
            asking: Mutex::new(()),
            heartbeat: Some(heartbeat),
            reader: guard.disarm(),
            fault_line: None,
        })
    }

    /// The board's capabilities, as reported at connection.
    pub fn capabilities(&self) -> &Capabilities {
        &self.capabilities
    }

    /// Name of the connected rig, as written in its specification.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The faults in this link, if it was made with any.
    pub fn fault_line(&self) -> Option<&FaultLine> {
        self.fault_line.as_ref()
    }

    /// Unsolicited messages of the board.
    pub fn events(&self) -> &Events {
        &self.link.events
    }

    /// The last state that the board reported.
    pub fn state(&self) -> DeviceState {
        self.link.state().unwrap_or(self.capabilities.state)
    }

    /// Counts at this end.
    pub fn link_counts(&self) -> LinkCounts {
        LinkCounts {
            frames: self.link.frames.load(Ordering::Relaxed),
            bad_frames: self.link.bad_frames.load(Ordering::Relaxed),
            dropped_events: self.link.events.dropped(),
        }
    }

    /// Passes every message from now on to `observer`; `None`: to nobody.
    pub fn observe(&self, observer: Option<Arc<dyn Observer>>) {
        self.link.observe(observer);
    }

    /// Sends without waiting for the answer; returns the sequence number.
    ///
    /// # Errors
    /// `LinkLost`, `TooLarge`.
    pub fn send(&self, message: ToDevice) -> Result<u16, RigError> {
        self.link.send(&message)
    }

    /// Sends a message and waits until the board has executed or refused it.
    ///
    /// # Errors
    /// `Refused`, `Timeout`, `LinkLost`, `TooLarge`.
    pub fn request(&self, message: ToDevice) -> Result<(), RigError> {
        match &message {
            // A greeting sent explicitly begins another session, unless its version differs from the board's.
            ToDevice::Hello(version) => {
                let own = *version == Version::own();
                self.ask(&message)?;
                if own {
                    self.link.begin_session(self.refresh_capabilities()?.session);
                }
                Ok(())
            }
            ToDevice::GetCapabilities
            | ToDevice::GetParameter(_)
            | ToDevice::GetStatistics { .. }
            | ToDevice::GetRig
            | ToDevice::GetReadings
            | ToDevice::TestMotor { .. }
            | ToDevice::Run { .. } => self.ask(&message).map(|_| ()),
            ToDevice::Lockstep(on) => {
                let on = *on;
                self.obtain(&message)?;
                self.lockstep.store(on, Ordering::Relaxed);
                self.link.forgive_silence();
                Ok(())
            }
            _ => self.obtain(&message).map(|_| ()),
        }
    }

    /// A parameter's value, in the unit of its row.
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn parameter(&self, id: ParameterId) -> Result<f32, RigError> {
        match *self.ask(&ToDevice::GetParameter(id))? {
            FromDevice::Parameter { value, .. } => Ok(value),
            _ => Err(self.no_answer(&ToDevice::GetParameter(id), self.patience.answer)),
        }
    }

    /// The board's counters; with `reset` it restarts them after answering.
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn statistics(&self, reset: bool) -> Result<Statistics, RigError> {
        let message = ToDevice::GetStatistics { reset };
        match *self.ask(&message)? {
            FromDevice::Statistics(statistics) => Ok(statistics),
            _ => Err(self.no_answer(&message, self.patience.answer)),
        }
    }

    /// The description of the rig stored on the board, and whether it is in use.
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn rig(&self) -> Result<(Option<Rig>, bool), RigError> {
        match *self.ask(&ToDevice::GetRig)? {
            FromDevice::Rig { rig, in_use } => Ok((rig, in_use)),
            _ => Err(self.no_answer(&ToDevice::GetRig, self.patience.answer)),
        }
    }

    /// Readings of encoders and safety inputs.
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn readings(&self) -> Result<Readings, RigError> {
        match *self.ask(&ToDevice::GetReadings)? {
            FromDevice::Readings(readings) => Ok(readings),
            _ => Err(self.no_answer(&ToDevice::GetReadings, self.patience.answer)),
        }
    }

    /// Pushes with the motor of one joint for a moment (see [`ToDevice::TestMotor`]); returns when the motors are off again.
    ///
    /// # Errors
    /// As [`Client::request`]; `Refused(State)` with the state that ended the test.
    pub fn test_motor(&self, joint: u8, force: f32) -> Result<MotorTest, RigError> {
        let message = ToDevice::TestMotor { joint, force };
        match *self.ask(&message)? {
            FromDevice::MotorTested(test) => Ok(test),
            _ => Err(self.no_answer(&message, self.patience.answer)),
        }
    }

    /// Reads the board's capabilities again, which include the scene in use and the state.
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn refresh_capabilities(&self) -> Result<Capabilities, RigError> {
        match *self.ask(&ToDevice::GetCapabilities)? {
            FromDevice::Capabilities(capabilities) => Ok(capabilities),
            _ => Err(self.no_answer(&ToDevice::GetCapabilities, self.patience.answer)),
        }
    }

    /// Switches lockstep on or off (simulated mechanisms only).
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn set_lockstep(&self, on: bool) -> Result<(), RigError> {
        self.request(ToDevice::Lockstep(on))
    }

    /// Runs `ticks` ticks in lockstep and waits until they are done.
    ///
    /// # Errors
    /// As [`Client::request`]; `Refused(Lockstep)` when not in lockstep.
    pub fn run(&self, ticks: u32) -> Result<Ran, RigError> {
        let message = ToDevice::Run { ticks };
        match *self.ask(&message)? {
            FromDevice::Ran { tick, state_hash } => Ok(Ran { tick, state_hash }),
            _ => Err(self.no_answer(&message, self.patience.answer)),
        }
    }

    /// Motors off, at once. Returns when the message has been written; the effect is reported as [`crate::Event::State`].
    ///
    /// # Errors
    /// `LinkLost`: the board then stops by itself.
    pub fn stop(&self) -> Result<(), RigError> {
        self.link.send(&ToDevice::Stop).map(|_| ())
    }

    /// Ends the link from this side: a thread that waits for the board (such as an upload) gets `LinkLost` at once. No event reports it.
    /// Where motors may be on, call [`Client::stop`] first.
    pub fn hang_up(&self) {
        self.link.close();
        self.link.lose("this program ended it");
    }

    /// Writes bytes that are no frame, and a delimiter: for tests that garbage does no harm.
    ///
    /// # Errors
    /// `LinkLost`.
    pub fn send_garbage(&self, bytes: &[u8]) -> Result<(), RigError> {
        self.link.write_raw(bytes)
    }

    /// Restarts the board and greets it again over the same link.
    ///
    /// # Errors
    /// As [`Client::request`] and [`Client::connect`].
    pub fn restart(mut self) -> Result<Self, RigError> {
        self.capabilities = self.restart_board()?;
        Ok(self)
    }

    /// As [`Self::restart`], for a client that others use too; [`Self::capabilities`] stay those of the start before, and the new ones are returned.
    ///
    /// # Errors
    /// As [`Self::restart`].
    pub fn restart_board(&self) -> Result<Capabilities, RigError> {
        // Heartbeats sent meanwhile are refused, which is expected.
        self.link.forget_greeting();
        self.request(ToDevice::Restart)?;
        let lockstep = self.lockstep.swap(false, Ordering::Relaxed);
        self.link.forgive_silence();
        let capabilities = greet(&self.link, &self.name, &self.patience)?;
        self.link.set_state(capabilities.state);
        if lockstep {
            self.set_lockstep(true)?;
        }
        Ok(capabilities)
    }

    pub(crate) fn link(&self) -> &Link {
        &self.link
    }

    pub(crate) fn patience_for(&self, message: &ToDevice) -> Duration {
        patience_for(message, &self.patience)
    }

    fn ask(&self, message: &ToDevice) -> Result<Box<FromDevice>, RigError> {
        let _one = self.asking.lock().unwrap_or_else(PoisonError::into_inner);
        match self.obtain(message)? {
            Answer::Value(value) => Ok(value),
            _ => Err(self.no_answer(message, self.patience.answer)),
        }
    }

    fn obtain(&self, message: &ToDevice) -> Result<Answer, RigError> {
        if matches!(message, ToDevice::Hello(_)) {
            // An explicit greeting may be that of another version.
            self.link.forget_greeting();
        }
        match obtain(&self.link, message, &self.patience) {
            Err(RigError::Refused { .. }) if self.link.has_started_anew() => {
                Err(started_anew(&self.link, &self.name))
            }
            result => result,
        }
    }

    pub(crate) fn no_answer(&self, message: &ToDevice, after: Duration) -> RigError {
        no_answer(message, after)
    }
}

/// Ends the reader if connecting fails.
struct Ending {
    link: Arc<Link>,
    reader: Option<Reader>,
}

impl Ending {
    fn disarm(mut self) -> Option<Reader> {
        self.reader.take()
    }
}

impl Drop for Ending {
    fn drop(&mut self) {
        if let Some(mut reader) = self.reader.take() {
            self.link.close();
            reader.join();
        }
    }
}

impl Drop for Client {
    fn drop(&mut self) {
        let motors_may_be_on = !matches!(
            self.state(),
            DeviceState::Idle
                | DeviceState::Homing
                | DeviceState::Stopped
                | DeviceState::Fault(_)
                | DeviceState::Boot
        );
        if motors_may_be_on {
            // A lost link cannot carry it; the board then stops by itself.
            let _ = self.link.send(&ToDevice::Stop);
        }
        drop(self.heartbeat.take());
        self.link.close();
        if let Some(mut reader) = self.reader.take() {
            reader.join();
        }
        self.link.events.close();
    }
}
