//! The connection to a rig, beside the window.
//!
//! One thread connects and then carries out commands one after another; another passes on what the board says unasked.
//! STOP goes past both: it is written by whoever calls [`Connection::stop`], even while a scene is being sent.

use std::sync::Arc;
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
use super::work::{Outbox, Update};

/// Ticks between telemetry messages: some 60 a second, half of what an emulated UART carries.
pub const TELEMETRY_TICKS: u16 = 16;

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
    /// How much of the scene is there.
    Uploading(UploadProgress),
    /// The scene was sent, or why not.
    Uploaded {
        /// Of which document.
        generation: u64,
        /// One line why not.
        result: Result<(), String>,
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
    /// Counters, asked for now and then.
    pub statistics: Option<Statistics>,
    /// To the thread that guides.
    pub tap: Tap,
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
    let say = |update: LinkUpdate| outbox.send(Update::Link { id, update });
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
        let outbox = outbox.clone();
        std::thread::Builder::new()
            .name("mortise-events".into())
            .spawn(move || pass_on(&outbox, id, &events, &tap))
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
        Command::Request(message) => {
            let result = client.request((*message).clone()).map_err(|e| e.to_string());
            LinkUpdate::Answered { message, result }
        }
        Command::Upload { baked, generation } => {
            let mut last = 0;
            let mut progress = |now: UploadProgress| {
                // A hundred steps are enough to look at.
                if now.sent.saturating_sub(last) * 100 >= now.total || now.sent == now.total {
                    last = now.sent;
                    say(LinkUpdate::Uploading(now));
                }
            };
            let result = client
                .upload(&baked.image, &mut progress)
                .map_err(|e| e.to_string());
            LinkUpdate::Uploaded { generation, result }
        }
        Command::Statistics => match client.statistics(false) {
            Ok(statistics) => LinkUpdate::Statistics(statistics),
            Err(error) => LinkUpdate::Answered {
                message: Box::new(ToDevice::GetStatistics { reset: false }),
                result: Err(error.to_string()),
            },
        },
    }
}

/// Passes events on until there are no more.
fn pass_on(outbox: &Outbox, id: u64, events: &mortise_rig::Events, tap: &Tap) {
    loop {
        match events.recv_timeout(Duration::from_secs(1)) {
            Ok(event) => {
                if let Event::Telemetry(sample) = &event {
                    tap.offer(sample);
                }
                let update = LinkUpdate::Event(event);
                if !outbox.send(Update::Link { id, update }) {
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
            let result = client.stop().map_err(|error| error.to_string());
            let update = LinkUpdate::Answered {
                message: Box::new(ToDevice::Stop),
                result,
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
        let end = move || {
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
