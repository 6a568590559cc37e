//! The program's state without its presentation: the open document, the connected rig, the board's reports. Needs no window.
//!
//! The window draws a [`Session`] and passes [`Intent`]s to it; threads beside it ([`work`], [`link`]) send messages that [`Session::poll`]
//! takes in. [`intent::obstacle`] alone decides which intents are possible.

pub mod document;
pub mod guidance;
pub mod history;
pub mod insertion;
pub mod intent;
pub mod link;
pub mod notes;
mod place;
pub mod pose;
pub mod remaining;
pub mod touch;
mod tour;
pub mod tree;
mod update;
pub mod verdict;
pub mod work;

use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

use glam::DAffine3;
use mortise_bake::{BakeOptions, Method, Request};
use mortise_guide::{GuideSettings, List};
use mortise_protocol::message::{DeviceState, HandScript, Telemetry, ToDevice};
use mortise_protocol::parameter::{PARAMETERS, ParameterId};
use mortise_rig::{EmulatedMode, RigEntry, RigSpec};

use self::document::Document;
use self::guidance::GuidanceCommand;
use self::history::History;
pub use self::intent::{Intent, obstacle};
use self::link::{Connection, Link};
use self::notes::{Notes, Severity};
use self::tour::Tour;
use self::verdict::Verdict;
use self::work::{Cancel, Outbox, Update, Wanted};
use crate::folder_cache::FolderCache;

/// Range of the guidance force limit, N: from barely perceptible to well below the coupling's limit.
pub const GUIDE_CAP_N: RangeInclusive<f32> = 0.2..=8.0;

/// Reading or baking under way.
#[derive(Clone, Debug)]
pub struct Job {
    /// Description of the job.
    pub doing: String,
    /// Progress from 0 to 1, where known.
    pub fraction: Option<f32>,
    /// Start of the job.
    pub since: Instant,
    /// Longest time that it may take, where it is limited.
    pub limit: Option<Duration>,
    generation: u64,
    cancel: Cancel,
}

/// A link that was lost.
#[derive(Clone, Debug, PartialEq)]
pub struct Lost {
    /// The rig.
    pub spec: RigSpec,
    /// The reason, as a sentence.
    pub why: String,
}

/// Everything the window shows.
pub struct Session {
    /// The open document.
    pub document: Option<Document>,
    /// Reading or baking under way.
    pub job: Option<Job>,
    /// Rigs that can be chosen.
    pub rigs: Vec<RigEntry>,
    /// The chosen rig.
    pub chosen: RigSpec,
    /// The connection.
    pub link: Link,
    /// Set while the link is lost and not yet replaced.
    pub lost: Option<Lost>,
    /// Outcome of the last insertion, until the next one.
    pub verdict: Option<Verdict>,
    /// Selected part.
    pub selected: Option<usize>,
    /// The last sample of the loop.
    pub telemetry: Option<Box<Telemetry>>,
    /// The samples of the last seconds.
    pub history: History,
    /// The board's parameters, in the order of [`PARAMETERS`].
    pub parameters: Vec<f32>,
    /// How targets are found and sent.
    pub guide: GuideSettings,
    /// Candidate and active targets.
    pub guidance: List,
    /// Messages.
    pub notes: Notes,
    /// Contact method of the next bake.
    pub method: Method,
    /// Set when this desktop offers no file dialog: the window asks for a path instead.
    pub wants_path: bool,
    /// Where results of bakes are kept.
    cache: Option<Arc<FolderCache>>,
    tour: Option<Tour>,
    /// Held part, and its pose in the handle's frame when it was grabbed.
    held: Option<(usize, DAffine3)>,
    outbox: Outbox,
    inbox: Receiver<Update>,
    generation: u64,
    link_id: u64,
    samples_since_statistics: u32,
}

impl Session {
    /// A session without document or connection. `wake` is called from other threads whenever [`Self::poll`] has messages to take in.
    pub fn new(wake: Arc<dyn Fn() + Send + Sync>) -> Self {
        let (outbox, inbox) = Outbox::new(wake);
        work::list_rigs(&outbox);
        Self {
            document: None,
            job: None,
            rigs: Vec::new(),
            chosen: RigSpec::Simulated { realtime: true },
            link: Link::None,
            lost: None,
            verdict: None,
            selected: None,
            telemetry: None,
            history: History::default(),
            parameters: PARAMETERS.iter().map(|row| row.default).collect(),
            guide: GuideSettings::default(),
            guidance: List::default(),
            notes: Notes::default(),
            method: Method::default(),
            wants_path: false,
            cache: None,
            tour: None,
            held: None,
            outbox,
            inbox,
            generation: 0,
            link_id: 0,
            samples_since_statistics: 0,
        }
    }

    /// The session with a store for results of bakes.
    pub fn with_cache(mut self, cache: Option<FolderCache>) -> Self {
        self.cache = cache.map(Arc::new);
        self
    }

    /// Executes an intent, or reports why it is not possible.
    pub fn act(&mut self, intent: Intent) {
        if let Some(reason) = obstacle(self, &intent) {
            self.notes.add(Severity::Warning, reason);
            return;
        }
        if !intent.is_passive() {
            self.tour = None;
        }
        self.perform(intent);
        self.follow();
    }

    /// Takes in the messages of other threads. Call it before each frame.
    pub fn poll(&mut self) {
        while let Ok(update) = self.inbox.try_recv() {
            update::take(self, update);
        }
        self.follow();
    }

    fn perform(&mut self, intent: Intent) {
        match intent {
            Intent::Browse => work::choose_file(&self.outbox, self.folder()),
            Intent::Open(path) => self.open(Some(path)),
            Intent::OpenSample => self.open(None),
            Intent::Bake => self.bake(),
            Intent::ChooseMethod(method) => {
                let changed = std::mem::replace(&mut self.method, method) != method;
                if changed {
                    self.bake();
                }
            }
            Intent::CancelWork => {
                if let Some(job) = self.job.take() {
                    job.cancel.set();
                    self.notes.add(Severity::Info, "Cancelled");
                }
            }
            Intent::RefreshRigs => work::list_rigs(&self.outbox),
            Intent::ChooseRig(spec) => self.chosen = spec,
            Intent::Connect => self.connect(),
            Intent::Reconnect => {
                if let Some(lost) = &self.lost {
                    self.chosen = lost.spec.clone();
                    self.connect();
                }
            }
            Intent::Disconnect => self.disconnect(),
            Intent::Upload => self.upload(),
            Intent::CancelUpload => {
                if let Some(connection) = self.connection() {
                    connection.cancel_upload();
                }
            }
            Intent::Arm => self.request(ToDevice::Arm),
            Intent::Disarm => self.request(ToDevice::Disarm),
            Intent::Stop => self.stop(),
            Intent::ClearFault => self.request(ToDevice::ClearFault),
            Intent::Home => self.request(ToDevice::Home),
            Intent::Select(part) => self.selected = part,
            Intent::Grab(part) => self.grab(part),
            Intent::Release => self.request(ToDevice::Release),
            Intent::ResetScene => self.request(ToDevice::ResetScene),
            Intent::SetParameter(id, value) => self.set_parameter(id, value),
            Intent::ResetParameters => {
                for row in PARAMETERS {
                    if self.parameters[row.id as usize] != row.default {
                        self.set_parameter(row.id, row.default);
                    }
                }
            }
            Intent::PinTarget(id, pinned) => self.command_guidance(GuidanceCommand::Pin(id, pinned)),
            Intent::SwitchTargetOff(id, off) => self.command_guidance(GuidanceCommand::SwitchOff(id, off)),
            Intent::GuideWhen(when) => {
                self.guide.when = when;
                self.command_guidance(GuidanceCommand::Set(self.guide));
            }
            Intent::GuideCap(newton) => {
                if newton.is_finite() {
                    self.guide.force_cap_n = newton.clamp(*GUIDE_CAP_N.start(), *GUIDE_CAP_N.end());
                    self.command_guidance(GuidanceCommand::Set(self.guide));
                }
            }
            Intent::PlayInsertion => self.tour = Some(Tour::from_the_rig()),
            Intent::Demo(rig) => self.demo(rig),
        }
    }

    /// Actions that follow from the state: upload once document and board are present; next step of a demonstration.
    fn follow(&mut self) {
        let ready = (self.document.as_ref()).is_some_and(|d| d.baked.is_some());
        if ready
            && !self.scene_is_on_board()
            && !self.scene_was_refused()
            && self.device() == Some(DeviceState::Idle)
            && obstacle(self, &Intent::Upload).is_none()
        {
            self.upload();
        }
        tour::advance(self);
    }

    fn open(&mut self, path: Option<PathBuf>) {
        self.generation += 1;
        let name = path
            .as_ref()
            .and_then(|p| p.file_name())
            .map_or_else(|| "the sample".to_owned(), |n| n.to_string_lossy().into_owned());
        let limit = Duration::from_secs(mortise_brep::LoadOptions::default().time_limit_s);
        let cancel = self.start_job(format!("Reading {name}"), self.generation, Some(limit));
        work::import(&self.outbox, path, self.generation, cancel);
    }

    fn bake(&mut self) {
        let Some(document) = &mut self.document else {
            return;
        };
        document.baked = None;
        let (model, generation) = (Arc::clone(&document.model), document.generation);
        let mut slot = mortise_bake::SLOT_BYTES;
        if let Some(connection) = self.connection_mut() {
            slot = u64::from(connection.capabilities.scene_capacity);
            connection.scene_of = None;
            connection.refused_scene_of = None;
        }
        let cancel = self.start_job("Baking the collision model".to_owned(), generation, None);
        let wanted = match self.method {
            Method::DistanceField => Wanted::Planned(Request {
                flash_bytes: slot,
                ..Request::default()
            }),
            method => Wanted::Described(BakeOptions {
                method,
                image_limit_bytes: slot,
                ..BakeOptions::default()
            }),
        };
        work::bake(
            &self.outbox,
            model,
            generation,
            wanted,
            self.cache.clone(),
            cancel,
        );
    }

    fn start_job(&mut self, doing: String, generation: u64, limit: Option<Duration>) -> Cancel {
        if let Some(job) = self.job.take() {
            job.cancel.set();
        }
        let cancel = Cancel::default();
        self.job = Some(Job {
            doing,
            fraction: None,
            since: Instant::now(),
            limit,
            generation,
            cancel: cancel.clone(),
        });
        cancel
    }

    fn connect(&mut self) {
        self.link_id += 1;
        self.link = link::connect(&self.outbox, self.link_id, self.chosen.clone());
    }

    fn disconnect(&mut self) {
        let link = std::mem::replace(&mut self.link, Link::None);
        let name = match &link {
            Link::Connected(connection) => Some(connection.capabilities.board.to_string()),
            _ => None,
        };
        link.close(false);
        self.clear_board();
        if let Some(name) = name {
            self.notes
                .add(Severity::Info, format!("Disconnected from {name}"));
        }
    }

    /// Clears the state that only a connection provides; parts stay at their last known poses.
    fn clear_board(&mut self) {
        self.telemetry = None;
        self.let_go();
        self.history.clear();
        self.guidance = List::default();
    }

    /// Clears the held part.
    fn let_go(&mut self) {
        self.held = None;
        let verdict = self.document.as_mut().and_then(|d| d.watch.let_go());
        self.report(verdict);
    }

    /// Reports the outcome of an insertion as a message, and as a card until the next one.
    fn report(&mut self, verdict: Option<Verdict>) {
        if let Some(verdict) = verdict {
            self.notes.add(verdict.severity(), verdict.to_string());
            self.verdict = Some(verdict);
        }
    }

    /// Starts guidance in the scene that is now on the board.
    fn start_guidance(&mut self) {
        self.guidance = List::default();
        self.guide.sending = self.guides();
        if let (Some(connection), Some(document)) = (self.connection(), &self.document) {
            connection.guide(document, self.guide, &self.outbox);
        }
    }

    /// Whether the board guides, by either method.
    pub fn guides(&self) -> bool {
        self.parameters[ParameterId::Guidance as usize] >= 0.5
    }

    fn command_guidance(&mut self, command: GuidanceCommand) {
        let taken = self.connection().is_none_or(|c| c.tap.command(command));
        if !taken && self.scene_is_on_board() {
            self.notes.add(Severity::Warning, "Guidance is busy: try again");
        }
    }

    fn upload(&mut self) {
        let Some(document) = &self.document else { return };
        let (Some(baked), generation) = (document.baked.clone(), document.generation) else {
            return;
        };
        if let Some(connection) = self.connection_mut() {
            connection.send_scene(baked, generation);
        }
    }

    fn stop(&mut self) {
        match self.connection() {
            Some(connection) => {
                connection.stop(&self.outbox);
                self.notes.add(Severity::Error, "STOP: motors off");
            }
            None => self
                .notes
                .add(Severity::Info, "STOP: no rig is connected, nothing moves"),
        }
    }

    fn grab(&mut self, part: usize) {
        self.selected = Some(part);
        let Some(scene_part) = self.document.as_ref().and_then(|d| d.scene_part(part)) else {
            return;
        };
        if self.device() == Some(DeviceState::Active) {
            self.request(ToDevice::Release);
        }
        self.request(ToDevice::Grab { part: scene_part });
    }

    fn set_parameter(&mut self, id: ParameterId, value: f32) {
        let row = id.row();
        let value = if value.is_finite() {
            value.clamp(row.min, row.max)
        } else {
            row.default
        };
        if let Some(known) = self.parameters.get_mut(id as usize) {
            *known = value;
        }
        if let Some(connection) = self.connection_mut() {
            connection.set_parameter(id, value);
        }
        if id == ParameterId::Guidance {
            self.guide.sending = self.guides();
            self.command_guidance(GuidanceCommand::Set(self.guide));
        }
    }

    fn demo(&mut self, rig: Option<RigSpec>) {
        let rig = rig.unwrap_or_else(|| self.demo_rig());
        self.tour = Some(Tour::from_the_start(rig));
        if self.document.is_none() && self.job.is_none() {
            self.open(None);
        }
    }

    /// The emulated board if it is available, else the in-process simulation, with a message.
    fn demo_rig(&mut self) -> RigSpec {
        let emulated = RigSpec::Emulated {
            mode: EmulatedMode::Interactive,
            firmware: None,
        };
        let rigs = mortise_rig::list();
        match rigs.iter().find(|entry| entry.spec == emulated) {
            Some(entry) if entry.available.is_ok() => emulated,
            other => {
                let why = other.and_then(|entry| entry.available.clone().err());
                self.notes.add(
                    Severity::Warning,
                    format!(
                        "The emulated board is not available, so the simulation in this program is used: {}",
                        why.unwrap_or_else(|| "run `cargo xtask demo`".to_owned())
                    ),
                );
                RigSpec::Simulated { realtime: true }
            }
        }
    }

    fn request(&self, message: ToDevice) {
        if let Some(connection) = self.connection() {
            connection.request(message);
        }
    }

    fn folder(&self) -> Option<PathBuf> {
        let path = self.document.as_ref()?.path.as_ref()?;
        path.parent().map(PathBuf::from)
    }

    /// Moves the simulated hand; no effect on a rig with a real one.
    pub fn move_hand(&mut self, script: HandScript) {
        self.tour = None;
        if let Some(connection) = self.connection_mut()
            && connection.capabilities.simulated
        {
            connection.set_hand(script);
        }
    }

    /// The connection, once established.
    pub fn connection(&self) -> Option<&Connection> {
        match &self.link {
            Link::Connected(connection) => Some(connection),
            _ => None,
        }
    }

    fn connection_mut(&mut self) -> Option<&mut Connection> {
        match &mut self.link {
            Link::Connected(connection) => Some(connection),
            _ => None,
        }
    }

    /// The board's state, once connected.
    pub fn device(&self) -> Option<DeviceState> {
        self.connection().map(|c| c.state)
    }

    /// Whether the motors may exert force.
    pub fn is_armed(&self) -> bool {
        matches!(
            self.device(),
            Some(DeviceState::Armed | DeviceState::Active | DeviceState::SoftStop)
        )
    }

    /// Whether reading or baking is under way.
    pub fn is_busy(&self) -> bool {
        self.job.is_some()
    }

    /// Whether a demonstration is under way.
    pub fn is_touring(&self) -> bool {
        self.tour.is_some()
    }

    /// Whether the open document's scene is the one on the board.
    pub fn scene_is_on_board(&self) -> bool {
        match (&self.document, self.connection()) {
            (Some(document), Some(connection)) => {
                document.baked.is_some() && connection.scene_of == Some(document.generation)
            }
            _ => false,
        }
    }

    /// Whether the board refused the scene: it is uploaded again only on the operator's request.
    fn scene_was_refused(&self) -> bool {
        match (&self.document, self.connection()) {
            (Some(document), Some(connection)) => connection.refused_scene_of == Some(document.generation),
            _ => false,
        }
    }

    /// Index of the held part.
    pub fn grabbed(&self) -> Option<usize> {
        if self.device() != Some(DeviceState::Active) {
            return None;
        }
        let (part, _) = self.telemetry.as_ref()?.object.as_ref()?;
        self.document.as_ref()?.model_part(*part)
    }

    /// Held part and the pose that the handle commands, mm: it differs from the part's own pose by the coupling's deflection under contact.
    pub fn ghost(&self) -> Option<(usize, DAffine3)> {
        let part = self.grabbed()?;
        let (held, offset) = self.held.as_ref()?;
        let handle = pose::from_wire(&self.telemetry.as_ref()?.handle);
        (*held == part).then(|| (part, handle * *offset))
    }

    /// Pose of the handle, mm.
    pub fn handle(&self) -> Option<DAffine3> {
        self.telemetry.as_ref().map(|t| pose::from_wire(&t.handle))
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        if let Some(job) = &self.job {
            job.cancel.set();
        }
        // Closes the queue: threads blocked on it must not delay the end.
        self.inbox = std::sync::mpsc::sync_channel(1).1;
        // Motors off and emulator ended before the program ends.
        std::mem::replace(&mut self.link, Link::None).close(true);
    }
}
