//! The connection to a rig, outside the window's thread.
//!
//! One thread connects and then executes commands one after another; another forwards the board's events. STOP bypasses both: the caller of
//! [`Connection::stop`] writes it, even during an upload.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use glam::DAffine3;
use mortise_bake::Baked;
use mortise_guide::GuideSettings;
use mortise_mating::recognise::{Target, TargetId};
use mortise_protocol::message::{Capabilities, DeviceState, HandScript, Statistics, ToDevice};
use mortise_protocol::parameter::ParameterId;
use mortise_protocol::rig::Rig;
use mortise_rig::commissioning::both_ways;
use mortise_rig::{Client, Event, RigError, RigSpec, UploadProgress};

use super::document::Document;
use super::fits::FitChoice;
use super::flashed::Flashed;
use super::forwarding::pass_on;
use super::guidance;
use super::introduction::{introduce, send_rig};
use super::outbox::{LinkUpdate, Outbox, Update};
use super::readings::ReadingsWatch;
use super::recording::Recorded;
use super::tap::Tap;
use super::threads::{Cancel, spawn};

/// Time after the first missing answer within which a silent link is noticed.
const NOTICED: Duration = Duration::from_secs(1);

/// Longest wait for connections to close at the program's end: longer than the greeting of a rig, so that an emulator that has just been
/// started is ended as well. The window is closed by then.
const CLOSING: Duration = Duration::from_secs(40);

/// A command for the link's thread.
pub enum Command {
    /// Send a message and wait for the answer.
    Request(Box<ToDevice>),
    /// Upload a scene.
    Upload {
        /// The image.
        baked: Arc<Baked>,
        /// The scene's document.
        generation: u64,
        /// Cancels the upload.
        cancel: Cancel,
    },
    /// Put parts elsewhere in the scene that is on the board.
    Place {
        /// What to ask of the board, in this order.
        messages: Vec<ToDevice>,
        /// The scene's document.
        generation: u64,
    },
    /// Query the counters.
    Statistics,
    /// Record everything from now on.
    Record {
        /// Folder of the new file.
        folder: PathBuf,
        /// The collision model on the board, if it is the document's.
        scene: Option<Arc<Baked>>,
    },
    /// End the recording.
    EndRecording,
    /// Read the description that the board keeps.
    ReadRig,
    /// Send a description, restart the board, and read back what it uses.
    SendRig(Box<Rig>),
    /// The mechanism is in its reference pose.
    Reference,
    /// Test a motor both ways.
    TestMotor {
        /// Joint, from 0.
        joint: u8,
        /// Force at the handle, N.
        force: f32,
    },
}

/// State of the connection.
pub enum Link {
    /// Not connected.
    None,
    /// Connecting.
    Connecting {
        /// Id of the connection.
        id: u64,
        /// The rig.
        spec: RigSpec,
        /// Sends commands to the thread that connects.
        commands: Sender<Command>,
        /// That thread.
        thread: Option<JoinHandle<()>>,
    },
    /// Connected.
    Connected(Box<Connection>),
}

/// A connection to a rig that answers.
pub struct Connection {
    /// Id of the connection.
    pub id: u64,
    /// The rig.
    pub spec: RigSpec,
    /// Capabilities of the board.
    pub capabilities: Capabilities,
    /// The last state that the board reported.
    pub state: DeviceState,
    /// Document whose scene is on the board.
    pub scene_of: Option<u64>,
    /// Document whose scene the board refused.
    pub refused_scene_of: Option<u64>,
    /// The scene in the board's flash, once it was uploaded.
    flashed: Option<Flashed>,
    /// The scene that is being uploaded.
    sending: Option<Flashed>,
    /// Progress of the upload under way.
    pub upload: Option<UploadProgress>,
    /// Start of the upload.
    pub upload_since: Instant,
    /// Counters, queried at intervals.
    pub statistics: Option<Statistics>,
    /// Input of the guidance thread.
    pub tap: Tap,
    upload_cancel: Cancel,
    client: Arc<Client>,
    commands: Sender<Command>,
    thread: Option<JoinHandle<()>>,
    /// The newest script for the simulated hand, waiting while an older one is under way.
    hand_next: Option<HandScript>,
    hand_under_way: bool,
    /// The newest value of each parameter, waiting likewise.
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
            spawn("mortise-report", move || {
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

/// Connects, then executes commands until the sender is dropped.
fn run(outbox: &Outbox, id: u64, spec: &RigSpec, todo: &Receiver<Command>) {
    let say = |update: LinkUpdate| match update {
        // These need no redraw of their own.
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
    let mut recorded = Recorded::default();
    while let Ok(command) = todo.recv() {
        if !say(carry_out(&client, &mut recorded, command, &say)) {
            return;
        }
    }
}

fn carry_out(
    client: &Client,
    recorded: &mut Recorded,
    command: Command,
    say: &dyn Fn(LinkUpdate) -> bool,
) -> LinkUpdate {
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
                // At most a hundred progress reports.
                if now.sent.saturating_sub(last) * 100 >= now.total || now.sent == now.total {
                    last = now.sent;
                    say(LinkUpdate::Uploading(now));
                }
                match cancel.is_set() {
                    true => ControlFlow::Break(()),
                    false => ControlFlow::Continue(()),
                }
            };
            recorded.scene(&baked);
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
        Command::Place { messages, generation } => {
            let mut placed = messages.into_iter().map(|message| client.request(message));
            match placed.find_map(Result::err) {
                Some(error) if is_the_links(client, &error) => LinkUpdate::Unanswered,
                error => LinkUpdate::Uploaded {
                    generation,
                    result: error.map_or(Ok(true), |error| Err(error.to_string())),
                },
            }
        }
        Command::Statistics => match client.statistics(false) {
            Ok(statistics) => LinkUpdate::Statistics(statistics),
            Err(_) => LinkUpdate::Unanswered,
        },
        Command::Record { folder, scene } => {
            LinkUpdate::Recording(recorded.begin(client, &folder, scene.as_deref()))
        }
        Command::ReadRig => LinkUpdate::Rig(Box::new(client.rig().map_err(|error| error.to_string()))),
        Command::SendRig(rig) => LinkUpdate::RigSent(send_rig(client, *rig).map(Box::new)),
        Command::Reference => {
            LinkUpdate::Referenced(client.request(ToDevice::Home).map_err(|error| error.to_string()))
        }
        Command::TestMotor { joint, force } => {
            LinkUpdate::MotorTested(both_ways(client, joint, force).map_err(|error| error.to_string()))
        }
        Command::EndRecording => (recorded.end(client)).map_or(LinkUpdate::Unanswered, LinkUpdate::Recording),
    }
}

/// Whether the link is lost or about to be: when the board is entirely silent, a late answer is followed by the loss of the link.
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

impl Connection {
    /// The connection of a [`LinkUpdate::Connected`].
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
            flashed: None,
            sending: None,
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

    /// Queues a command.
    pub fn command(&self, command: Command) {
        // The receiver lives as long as this sender; a lost link answers every command with an error.
        let _ = self.commands.send(command);
    }

    /// Queues a message whose answer is waited for.
    pub fn request(&self, message: ToDevice) {
        self.command(Command::Request(Box::new(message)));
    }

    /// Brings a scene onto the board with its parts at `placements`, in the image's order, mm: an image that is there already gets its parts placed, which
    /// writes no flash; any other is uploaded, and with `whole` this one, too.
    pub fn send_scene(&mut self, baked: Arc<Baked>, placements: Vec<DAffine3>, generation: u64, whole: bool) {
        let there = (self.flashed.as_ref()).filter(|flashed| !whole && flashed.has(&baked));
        if let Some(flashed) = there {
            let messages = flashed.moved_to(&placements);
            // Nothing else is placed or uploaded meanwhile.
            self.upload = Some(UploadProgress { sent: 0, total: 1 });
            self.command(Command::Place { messages, generation });
            return;
        }
        let sent = Flashed::new(baked, placements);
        let Some(image) = sent.image() else {
            return;
        };
        self.upload = Some(UploadProgress {
            sent: 0,
            total: image.image.len(),
        });
        self.upload_since = Instant::now();
        self.upload_cancel = Cancel::default();
        self.sending = Some(sent);
        self.command(Command::Upload {
            baked: image,
            generation,
            cancel: self.upload_cancel.clone(),
        });
    }

    /// Takes the scene for one that is not on the board: it is uploaded anew.
    pub fn forget_scene(&mut self) {
        self.flashed = None;
        self.scene_of = None;
    }

    /// Whether a reset of the scene on the board puts its parts, in the image's order, at `placements`.
    pub fn resets_to(&self, placements: &[DAffine3]) -> bool {
        (self.flashed.as_ref()).is_some_and(|flashed| flashed.resets_to(placements))
    }

    /// Records the end of an upload, or of a change of places; `true` after an upload.
    pub fn sent_scene(&mut self, done: bool) -> bool {
        self.upload = None;
        let sent = self.sending.take();
        let uploaded = sent.is_some();
        match (sent, done) {
            (Some(sent), true) => self.flashed = Some(sent),
            // Where its parts are is no longer known.
            (None, false) => self.flashed = None,
            // An upload that did not end leaves the scene that was there.
            (None, true) | (Some(_), false) => {}
        }
        uploaded
    }

    /// Cancels the upload under way; the scene in use stays.
    pub fn cancel_upload(&self) {
        self.upload_cancel.set();
    }

    /// Starts guidance in the scene that is now on the board.
    pub fn guide(
        &self,
        document: &Document,
        settings: GuideSettings,
        fits: &BTreeMap<TargetId, FitChoice>,
        followed: Vec<Target>,
        outbox: &Outbox,
    ) {
        let Some(baked) = &document.baked else { return };
        let parts = baked.report.parts.iter().map(|part| part.model_part).collect();
        guidance::start(
            &self.tap,
            guidance::Start {
                model: Arc::clone(&document.grouped.model),
                placed: document.is_placed().then(|| document.placed.clone()),
                parts,
                fits: fits.clone(),
                followed,
                settings,
            },
            Arc::downgrade(&self.client),
            outbox.clone(),
            self.id,
        );
    }

    /// Motors off, now: written from a separate thread, ahead of everything queued.
    pub fn stop(&self, outbox: &Outbox) {
        let (client, outbox, id) = (Arc::clone(&self.client), outbox.clone(), self.id);
        spawn("mortise-stop", move || {
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

    /// Reads encoders and inputs until the result is dropped.
    pub fn watch_readings(&self, outbox: Outbox) -> ReadingsWatch {
        ReadingsWatch::begin(Arc::downgrade(&self.client), outbox, self.id)
    }

    /// Moves the simulated hand. Only the newest script waits.
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

    /// Must be called for every answer, so that the next waiting message is sent.
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

    /// Counts of frames dropped on this side, and of telemetry that came too fast.
    pub fn link_counts(&self) -> mortise_rig::LinkCounts {
        self.client.link_counts()
    }
}

/// Connections of this program that are closing.
static CLOSINGS: AtomicUsize = AtomicUsize::new(0);
/// Longest wait for closing connections before the next connection.
const CLOSING_WAIT: Duration = Duration::from_secs(5);

/// One closing connection. Until it is closed, its thread may read from the port and would take the answers to the next connection's
/// greeting.
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
    /// Ends the connection: motors off, threads and emulator ended. With `wait` it waits for them, at most 40 s; without, they end on their
    /// own.
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
                // Sent independently of the other thread's work; a lost link stops the board by itself.
                let _ = client.stop();
                // Aborts an upload under way instead of waiting for it.
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
            spawn("mortise-disconnect", end);
        }
    }
}
