//! The connection to a rig, beside the window.
//!
//! One thread connects and then carries out commands one after another; another passes on what the board says unasked.
//! STOP goes past both: it is written by whoever calls [`Connection::stop`], even while a scene is being sent.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use mortise_bake::Baked;
use mortise_guide::GuideSettings;
use mortise_protocol::message::{Capabilities, DeviceState, HandScript, Statistics, ToDevice};
use mortise_protocol::parameter::{PARAMETERS, ParameterId};
use mortise_rig::{Client, Event, RigError, RigSpec, UploadProgress};

use super::document::Document;
use super::guidance::Tap;
use super::work::{Cancel, Outbox, Update};

/// Ticks between telemetry messages: some 60 a second, half of what an emulated UART carries.
pub const TELEMETRY_TICKS: u16 = 16;

/// Between two pictures for samples while the motors are off and the handle rests, as long as what the readout of late ticks covers. With software
/// rendering a picture of 1600 × 1000 pixels costs up to 0.45 s of a core. Motion and changes of state are drawn at once.
const CALM: Duration = Duration::from_secs(10);

/// A silent link is noticed within this after the first answer that is missing.
const NOTICED: Duration = Duration::from_secs(1);

/// Motion of the handle that is worth a picture at once, m: a digit of what is shown.
const MOVED_M: f32 = 1e-4;

/// Longest wait for a connection to end when the program does: longer than a rig is greeted, so that an emulator that has just been
/// started is ended as well. The window is gone by then.
const CLOSING: Duration = Duration::from_secs(40);

/// Something to do over the link.
pub enum Command {
    /// Send and wait for the answer.
    Request(Box<ToDevice>),
    /// Send a scene.
    Upload {
        /// The image.
        baked: Arc<Baked>,
        /// Of which document.
        generation: u64,
        /// Ends it early.
        cancel: Cancel,
    },
    /// Ask for the counters.
    Statistics,
}

/// What the link says.
pub enum LinkUpdate {
    /// Connected.
    Connected {
        /// To send with.
        client: Arc<Client>,
        /// The board's parameters.
        parameters: Vec<(ParameterId, f32)>,
        /// Where guidance hears samples from.
        tap: Tap,
    },
    /// Not connected, and why.
    Failed(String),
    /// Said unasked.
    Event(Event),
    /// A request was carried out, or why not.
    Answered {
        /// What was asked.
        message: Box<ToDevice>,
        /// One line why not.
        result: Result<(), String>,
    },
    /// Not answered because the link is gone, which [`Event::LinkLost`] tells once; or a question of the window's own that nobody waits for.
    Unanswered,
    /// How much of the scene is there.
    Uploading(UploadProgress),
    /// The scene was sent, or why not.
    Uploaded {
        /// Of which document.
        generation: u64,
        /// `false`: the operator ended it. An error is one line why not.
        result: Result<bool, String>,
    },
    /// The counters.
    Statistics(Statistics),
}

/// Whether there is a connection.
pub enum Link {
    /// None.
    None,
    /// On the way.
    Connecting {
        /// Which.
        id: u64,
        /// To where.
        spec: RigSpec,
        /// To the thread that connects.
        commands: Sender<Command>,
        /// That thread.
        thread: Option<JoinHandle<()>>,
    },
    /// There.
    Connected(Box<Connection>),
}

/// A rig that answers.
pub struct Connection {
    /// Which.
    pub id: u64,
    /// To where.
    pub spec: RigSpec,
    /// What the board can do.
    pub capabilities: Capabilities,
    /// The state it last told.
    pub state: DeviceState,
    /// Document whose scene is on the board.
    pub scene_of: Option<u64>,
    /// Document whose scene it would not take.
    pub refused_scene_of: Option<u64>,
    /// The scene being sent.
    pub upload: Option<UploadProgress>,
    /// Since when.
    pub upload_since: Instant,
    /// Counters, asked for now and then.
    pub statistics: Option<Statistics>,
    /// To the thread that guides.
    pub tap: Tap,
    upload_cancel: Cancel,
    client: Arc<Client>,
    commands: Sender<Command>,
    thread: Option<JoinHandle<()>>,
    /// The newest wish for the hand, while an older one is under way.
    hand_next: Option<HandScript>,
    hand_under_way: bool,
    /// Likewise for parameters, one a parameter.
    parameters_next: Vec<(ParameterId, f32)>,
    parameter_under_way: bool,
}

/// Starts connecting.
pub fn connect(outbox: &Outbox, id: u64, spec: RigSpec) -> Link {
    let (commands, todo) = channel();
    let outbox = outbox.clone();
    let there = spec.clone();
    let report = outbox.clone();
    let thread = std::thread::Builder::new()
        .name("mortise-link".into())
        .spawn(move || run(&outbox, id, &there, &todo));
    match thread {
        Ok(thread) => Link::Connecting {
            id,
            spec,
            commands,
            thread: Some(thread),
        },
        Err(error) => {
            let update = LinkUpdate::Failed(RigError::Thread(error).to_string());
            super::work::spawn("mortise-report", move || {
                report.send(Update::Link { id, update });
            });
            Link::Connecting {
                id,
                spec,
                commands,
                thread: None,
            }
        }
    }
}

/// Connects, then does what it is told until the other end is dropped.
fn run(outbox: &Outbox, id: u64, spec: &RigSpec, todo: &Receiver<Command>) {
    let say = |update: LinkUpdate| match update {
        // Worth no picture of its own.
        LinkUpdate::Statistics(_) | LinkUpdate::Unanswered => {
            outbox.send_quietly(Update::Link { id, update })
        }
        update => outbox.send(Update::Link { id, update }),
    };
    Closing::wait();
    let client = match Client::connect(spec) {
        Ok(client) => Arc::new(client),
        Err(error) => {
            say(LinkUpdate::Failed(error.to_string()));
            return;
        }
    };
    let parameters = match introduce(&client) {
        Ok(parameters) => parameters,
        Err(error) => {
            say(LinkUpdate::Failed(error.to_string()));
            return;
        }
    };
    let events = client.events().clone();
    let tap = Tap::default();
    if !say(LinkUpdate::Connected {
        client: Arc::clone(&client),
        parameters,
        tap: tap.clone(),
    }) {
        return;
    }
    let passing_on = {
        let (outbox, state) = (outbox.clone(), client.state());
        std::thread::Builder::new()
            .name("mortise-events".into())
            .spawn(move || pass_on(&outbox, id, &events, &tap, state))
    };
    if let Err(error) = passing_on {
        say(LinkUpdate::Event(Event::LinkLost(
            RigError::Thread(error).to_string(),
        )));
        return;
    }
    while let Ok(command) = todo.recv() {
        if !say(carry_out(&client, command, &say)) {
            return;
        }
    }
}

/// Asks for telemetry and every parameter.
fn introduce(client: &Client) -> Result<Vec<(ParameterId, f32)>, RigError> {
    client.request(ToDevice::SetTelemetry {
        every_ticks: TELEMETRY_TICKS,
    })?;
    (PARAMETERS.iter())
        .map(|row| Ok((row.id, client.parameter(row.id)?)))
        .collect()
}

fn carry_out(client: &Client, command: Command, say: &dyn Fn(LinkUpdate) -> bool) -> LinkUpdate {
    match command {
        Command::Request(message) => match client.request((*message).clone()) {
            Err(error) if is_the_links(client, &error) => LinkUpdate::Unanswered,
            result => LinkUpdate::Answered {
                message,
                result: result.map_err(|error| error.to_string()),
            },
        },
        Command::Upload {
            baked,
            generation,
            cancel,
        } => {
            let mut last = 0;
            let mut progress = |now: UploadProgress| {
                // A hundred steps are enough to look at.
                if now.sent.saturating_sub(last) * 100 >= now.total || now.sent == now.total {
                    last = now.sent;
                    say(LinkUpdate::Uploading(now));
                }
                match cancel.is_set() {
                    true => ControlFlow::Break(()),
                    false => ControlFlow::Continue(()),
                }
            };
            match client.upload_while(&baked.image, &mut progress) {
                Err(error) if is_the_links(client, &error) => LinkUpdate::Unanswered,
                result => LinkUpdate::Uploaded {
                    generation,
                    result: result
                        .map(|end| end.is_continue())
                        .map_err(|error| error.to_string()),
                },
            }
        }
        Command::Statistics => match client.statistics(false) {
            Ok(statistics) => LinkUpdate::Statistics(statistics),
            Err(_) => LinkUpdate::Unanswered,
        },
    }
}

/// The link is gone, or going: an answer that does not come in time is followed by the link's end when the board is silent altogether.
fn is_the_links(client: &Client, error: &RigError) -> bool {
    match error {
        RigError::LinkLost { .. } => true,
        RigError::Timeout { .. } => {
            std::thread::sleep(NOTICED);
            matches!(client.send(ToDevice::Heartbeat), Err(RigError::LinkLost { .. }))
        }
        _ => false,
    }
}

/// Motors may push: every sample is worth a picture.
fn is_live(state: DeviceState) -> bool {
    matches!(
        state,
        DeviceState::Armed | DeviceState::Active | DeviceState::SoftStop
    )
}

/// Passes events on until there are no more.
///
/// While the motors are off and the handle rests nothing in a sample moves on screen but the traces, so the window is woken for one of many:
/// drawing each would keep a core busy where there is no graphics card.
fn pass_on(outbox: &Outbox, id: u64, events: &mortise_rig::Events, tap: &Tap, state: DeviceState) {
    let mut live = is_live(state);
    let mut woken = Instant::now();
    let mut seen = [0.0; 3];
    loop {
        match events.recv_timeout(Duration::from_secs(1)) {
            Ok(event) => {
                if let Event::Telemetry(sample) = &event {
                    tap.offer(sample);
                }
                if let Event::State { state, .. } = &event {
                    live = is_live(*state);
                }
                let quiet = match &event {
                    Event::Telemetry(sample) if !live && woken.elapsed() < CALM => {
                        let at = sample.handle.position;
                        at.iter()
                            .zip(seen)
                            .all(|(now, then)| (now - then).abs() < MOVED_M)
                    }
                    _ => false,
                };
                if let (Event::Telemetry(sample), false) = (&event, quiet) {
                    seen = sample.handle.position;
                }
                let update = LinkUpdate::Event(event);
                let update = Update::Link { id, update };
                let heard = if quiet {
                    outbox.send_quietly(update)
                } else {
                    woken = Instant::now();
                    outbox.send(update)
                };
                if !heard {
                    return;
                }
            }
            Err(std::sync::mpsc::RecvTimeoutError::Timeout) => {}
            Err(std::sync::mpsc::RecvTimeoutError::Disconnected) => return,
        }
    }
}

impl Connection {
    /// From what [`LinkUpdate::Connected`] brought.
    pub fn new(
        id: u64,
        spec: RigSpec,
        client: Arc<Client>,
        tap: Tap,
        commands: Sender<Command>,
        thread: Option<JoinHandle<()>>,
    ) -> Self {
        Self {
            id,
            spec,
            capabilities: client.capabilities().clone(),
            state: client.state(),
            scene_of: None,
            refused_scene_of: None,
            upload: None,
            upload_since: Instant::now(),
            upload_cancel: Cancel::default(),
            statistics: None,
            tap,
            client,
            commands,
            thread,
            hand_next: None,
            hand_under_way: false,
            parameters_next: Vec::new(),
            parameter_under_way: false,
        }
    }

    /// Has a command carried out after those before it.
    pub fn command(&self, command: Command) {
        // The other end lives as long as this one; a lost link answers every command with an error.
        let _ = self.commands.send(command);
    }

    /// Has a message sent and its answer waited for.
    pub fn request(&self, message: ToDevice) {
        self.command(Command::Request(Box::new(message)));
    }

    /// Starts sending a scene.
    pub fn send_scene(&mut self, baked: Arc<Baked>, generation: u64) {
        let total = baked.image.len();
        self.upload = Some(UploadProgress { sent: 0, total });
        self.upload_since = Instant::now();
        self.upload_cancel = Cancel::default();
        self.command(Command::Upload {
            baked,
            generation,
            cancel: self.upload_cancel.clone(),
        });
    }

    /// Ends the sending under way; the scene in use stays.
    pub fn cancel_upload(&self) {
        self.upload_cancel.set();
    }

    /// Starts to guide in the scene that is on the board now.
    pub fn guide(&self, document: &Document, settings: GuideSettings, outbox: &Outbox) {
        let Some(baked) = &document.baked else { return };
        let parts = baked.report.parts.iter().map(|part| part.model_part).collect();
        self.tap.start(
            Arc::clone(&document.model),
            parts,
            settings,
            Arc::downgrade(&self.client),
            outbox.clone(),
            self.id,
        );
    }

    /// Motors off, now: written from a thread of its own, past everything that waits.
    pub fn stop(&self, outbox: &Outbox) {
        let (client, outbox, id) = (Arc::clone(&self.client), outbox.clone(), self.id);
        super::work::spawn("mortise-stop", move || {
            let update = match client.stop() {
                Err(RigError::LinkLost { .. }) => LinkUpdate::Unanswered,
                result => LinkUpdate::Answered {
                    message: Box::new(ToDevice::Stop),
                    result: result.map_err(|error| error.to_string()),
                },
            };
            outbox.send(Update::Link { id, update });
        });
    }

    /// Moves the simulated hand. Only the newest wish waits.
    pub fn set_hand(&mut self, script: HandScript) {
        if self.hand_under_way {
            self.hand_next = Some(script);
        } else {
            self.hand_under_way = true;
            self.request(ToDevice::SimulatedHand(script));
        }
    }

    /// Changes a parameter. Only the newest value of each waits.
    pub fn set_parameter(&mut self, id: ParameterId, value: f32) {
        if !self.parameter_under_way {
            self.parameter_under_way = true;
            self.request(ToDevice::SetParameter { id, value });
            return;
        }
        match self
            .parameters_next
            .iter_mut()
            .find(|(waiting, _)| *waiting == id)
        {
            Some(waiting) => waiting.1 = value,
            None => self.parameters_next.push((id, value)),
        }
    }

    /// To be told of every answer, so that what waits can go next.
    pub fn answered(&mut self, message: &ToDevice) {
        match message {
            ToDevice::SimulatedHand(_) => {
                self.hand_under_way = false;
                if let Some(next) = self.hand_next.take() {
                    self.set_hand(next);
                }
            }
            ToDevice::SetParameter { .. } => {
                self.parameter_under_way = false;
                if !self.parameters_next.is_empty() {
                    let (id, value) = self.parameters_next.remove(0);
                    self.set_parameter(id, value);
                }
            }
            _ => {}
        }
    }

    /// Frames thrown away on this side, and telemetry that came too fast.
    pub fn link_counts(&self) -> mortise_rig::LinkCounts {
        self.client.link_counts()
    }
}

/// Connections of this program that are being closed.
static CLOSINGS: AtomicUsize = AtomicUsize::new(0);
/// Longest wait for them before the next connection.
const CLOSING_WAIT: Duration = Duration::from_secs(5);

/// One connection that is being closed. Until it is, its thread may read from the port, and would take the answers to the next connection's greeting.
struct Closing;

impl Closing {
    fn begin() -> Self {
        CLOSINGS.fetch_add(1, Ordering::AcqRel);
        Self
    }

    fn wait() {
        let begun = Instant::now();
        while CLOSINGS.load(Ordering::Acquire) > 0 && begun.elapsed() < CLOSING_WAIT {
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

impl Drop for Closing {
    fn drop(&mut self) {
        CLOSINGS.fetch_sub(1, Ordering::AcqRel);
    }
}

impl Link {
    /// Ends the connection: motors off, threads and emulator ended. Waits for them when `wait` is set, but no longer
    /// than 40 s, else lets them end by themselves.
    pub fn close(self, wait: bool) {
        let (client, commands, thread) = match self {
            Self::None => return,
            Self::Connecting { commands, thread, .. } => (None, commands, thread),
            Self::Connected(connection) => {
                connection.tap.end();
                (Some(connection.client), connection.commands, connection.thread)
            }
        };
        let closing = Closing::begin();
        let end = move || {
            let _closing = closing;
            if let Some(client) = &client {
                // Past whatever the other thread is doing; a lost link stops the board by itself.
                let _ = client.stop();
                // An upload under way must not be waited for.
                client.hang_up();
            }
            drop(commands);
            drop(client);
            let begun = Instant::now();
            while thread.as_ref().is_some_and(|t| !t.is_finished()) && begun.elapsed() < CLOSING {
                std::thread::sleep(Duration::from_millis(5));
            }
        };
        if wait {
            end();
        } else {
            super::work::spawn("mortise-disconnect", end);
        }
    }
}
