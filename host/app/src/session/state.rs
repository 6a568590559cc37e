//! The window's state, and what follows from it without a change.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

use glam::DAffine3;
use mortise_bake::Method;
use mortise_guide::{GuideSettings, List};
use mortise_mating::recognise::TargetId;
use mortise_protocol::message::{DeviceState, Telemetry};
use mortise_protocol::parameter::{PARAMETERS, ParameterId};
use mortise_rig::{RigEntry, RigSpec};

use super::chart::TracesFile;
use super::connections::Connections;
use super::document::Document;
use super::energies::Energies;
use super::fits::FitChoice;
use super::fitting::Fitting;
use super::flashing::Flashing;
use super::held::Held;
use super::history::History;
use super::instructions::Instructions;
use super::joints::Joints;
use super::keeper::Keeper;
use super::link::{Connection, Link};
use super::margin;
use super::moves::Moves;
use super::notes::Notes;
use super::outbox::{Outbox, Update};
use super::purpose::Purpose;
use super::recording::Recording;
use super::rig_page::RigPage;
use super::runs::Playback;
use super::sequencing::Sequencing;
use super::threads::Cancel;
use super::tour::Tour;
use super::verdict::Verdict;
use super::ways::Ways;
use super::workspace::Workspace;
use super::{pose, work};
use crate::folder_cache::FolderCache;
use crate::kept::Preferences;
use crate::kept::project::Project;
use crate::kept::view::KeptView;

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
    pub(super) generation: u64,
    pub(super) cancel: Cancel,
}

/// What a project has the window show.
#[derive(Clone, Debug, PartialEq)]
pub struct Looks {
    /// Keys of the signals in the plots; `None`: as they are.
    pub signals: Option<Vec<String>>,
    /// Camera and section; `None`: as after opening.
    pub view: Option<KeptView>,
}

/// A link that was lost.
#[derive(Clone, Debug, PartialEq)]
pub struct Lost {
    /// The rig.
    pub spec: RigSpec,
    /// The reason, as a sentence.
    pub why: String,
}

/// Parameters that the user has set on a rig, by their place in [`PARAMETERS`].
pub type OwnParameters = BTreeMap<usize, f32>;

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
    /// The selected part that keys, handles and panels act on.
    pub selected: Option<usize>,
    /// Parts that are selected beside it.
    pub also_selected: BTreeSet<usize>,
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
    /// Fits of a part, found on request.
    pub fitting: Option<Fitting>,
    /// Geometric energies that draw parts to their fits.
    pub energies: Energies,
    /// The steps in which the assembly goes together, found on request.
    pub sequencing: Sequencing,
    /// The part with which fits are found; `None`: the nearest ones.
    pub partner: Option<usize>,
    /// Recorded runs that are shown.
    pub playback: Option<Playback>,
    /// Poses of the parts before it was shown, and when it was last let go on.
    pub(super) before_run: Option<Vec<DAffine3>>,
    pub(super) played: Option<Instant>,
    /// What the window shows in its middle.
    pub workspace: Workspace,
    /// The page on the rig.
    pub rig_page: RigPage,
    /// Limits of stiffness and damping, of the rig for which they were computed last.
    pub limits: margin::Kept,
    /// Firmware for a board.
    pub flashing: Flashing,
    /// Joints of a part.
    pub joints: Joints,
    /// Connections of the parts.
    pub connections: Connections,
    /// Messages.
    pub notes: Notes,
    /// Contact method of the next bake.
    pub method: Method,
    /// The recording under way.
    pub recording: Option<Recording>,
    /// Where recordings go; `None`: a folder of the user's data.
    pub recordings: Option<PathBuf>,
    /// Set when this desktop offers no file dialog: the window asks for a path instead.
    pub wants_path: Option<Purpose>,
    /// The traces that wait for the path of their file.
    pub(super) table: Option<TracesFile>,
    /// Where results of bakes are kept.
    pub(super) cache: Option<Arc<FolderCache>>,
    /// What the user prefers.
    pub preferences: Preferences,
    /// Recent files that are missing.
    pub missing: Vec<PathBuf>,
    /// How the window shows the open document; the window writes it.
    pub view: Option<KeptView>,
    /// What the window is to show, by a project that was applied; the window takes it.
    pub looks: Option<Looks>,
    /// The user's choices of fits.
    pub fits: BTreeMap<TargetId, FitChoice>,
    /// Parameters that the user has set, for each rig ([`Self::rig_of_parameters`]): a board gets those that were set on it.
    pub(super) own_parameters: BTreeMap<String, OwnParameters>,
    /// Ways in that guidance follows.
    pub(super) ways: Ways,
    /// Instructions in plain words.
    pub instructions: Instructions,
    /// What was moved, which can be undone.
    pub moves: Moves,
    pub(super) keeper: Keeper,
    /// The project that the user opened, and its file: for the document of this number.
    pub(super) pending_project: Option<(u64, Box<Project>, PathBuf)>,
    pub(super) tour: Option<Tour>,
    /// Held part.
    pub(super) held: Option<Held>,
    /// The part that is held again when the clutch closes.
    pub(super) clutched: Option<usize>,
    pub(super) outbox: Outbox,
    pub(super) inbox: Receiver<Update>,
    pub(super) generation: u64,
    pub(super) fit_searches: u64,
    pub(super) link_id: u64,
    pub(super) samples_since_statistics: u32,
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
            also_selected: BTreeSet::new(),
            telemetry: None,
            history: History::default(),
            parameters: PARAMETERS.iter().map(|row| row.default).collect(),
            guide: GuideSettings::default(),
            guidance: List::default(),
            fitting: None,
            energies: Energies::default(),
            sequencing: Sequencing::default(),
            partner: None,
            ways: Ways::default(),
            workspace: Workspace::default(),
            rig_page: RigPage::default(),
            limits: margin::Kept::default(),
            flashing: Flashing::default(),
            joints: Joints::default(),
            connections: Connections::default(),
            playback: None,
            before_run: None,
            played: None,
            notes: Notes::default(),
            method: Method::default(),
            recording: None,
            recordings: None,
            wants_path: None,
            table: None,
            cache: None,
            preferences: Preferences::default(),
            missing: Vec::new(),
            view: None,
            looks: None,
            fits: BTreeMap::new(),
            own_parameters: BTreeMap::new(),
            instructions: Instructions::default(),
            moves: Moves::default(),
            keeper: Keeper::default(),
            pending_project: None,
            tour: None,
            held: None,
            clutched: None,
            outbox,
            inbox,
            generation: 0,
            fit_searches: 0,
            link_id: 0,
            samples_since_statistics: 0,
        }
    }

    /// The session with a store for results of bakes.
    pub fn with_cache(mut self, cache: Option<FolderCache>) -> Self {
        self.cache = cache.map(Arc::new);
        self
    }

    /// The connection, once established.
    pub fn connection(&self) -> Option<&Connection> {
        match &self.link {
            Link::Connected(connection) => Some(connection),
            _ => None,
        }
    }

    pub(super) fn connection_mut(&mut self) -> Option<&mut Connection> {
        match &mut self.link {
            Link::Connected(connection) => Some(connection),
            _ => None,
        }
    }

    /// The board's state, once connected.
    pub fn device(&self) -> Option<DeviceState> {
        self.connection().map(|c| c.state)
    }

    /// The samples that the plots show: of a recorded run, or of the connected rig.
    pub fn shown_history(&self) -> &History {
        (self.playback.as_ref()).map_or(&self.history, |playback| &playback.run().history)
    }

    /// Whether recorded runs have the parts where they are.
    pub fn replays(&self) -> bool {
        self.playback
            .as_ref()
            .is_some_and(|playback| playback.runs().iter().any(|shown| shown.moves_parts))
    }

    /// Whether the motors may exert force.
    pub fn is_armed(&self) -> bool {
        matches!(
            self.device(),
            Some(DeviceState::Armed | DeviceState::Active | DeviceState::SoftStop | DeviceState::Testing)
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

    /// Whether the board guides, by either method.
    pub fn guides(&self) -> bool {
        self.parameters[ParameterId::Guidance as usize] >= 0.5
    }

    /// Whether the board refused the scene: it is uploaded again only on the operator's request.
    pub(super) fn scene_was_refused(&self) -> bool {
        match (&self.document, self.connection()) {
            (Some(document), Some(connection)) => connection.refused_scene_of == Some(document.generation),
            _ => false,
        }
    }

    /// Index of the held part; of a held group that of its first part.
    pub fn grabbed(&self) -> Option<usize> {
        if self.device() != Some(DeviceState::Active) {
            return None;
        }
        let (part, _) = self.telemetry.as_ref()?.object.as_ref()?;
        self.document.as_ref()?.model_part(*part)
    }

    /// Whether a part is held, by itself or with its group.
    pub fn is_held(&self, part: usize) -> bool {
        let document = self.document.as_ref();
        self.grabbed()
            .is_some_and(|held| document.is_some_and(|document| document.groups().first(part) == held))
    }

    /// Held part and the pose that the handle commands, mm: it differs from the part's own pose by the coupling's deflection under contact.
    pub fn ghost(&self) -> Option<(usize, DAffine3)> {
        let part = self.grabbed()?;
        let held = self.held.filter(|held| held.part == part)?;
        Some((part, held.commanded(&self.telemetry.as_ref()?.handle)))
    }

    /// Pose of the handle, mm.
    pub fn handle(&self) -> Option<DAffine3> {
        self.telemetry.as_ref().map(|t| pose::from_wire(&t.handle))
    }

    /// Folder of the open file.
    pub(super) fn folder(&self) -> Option<PathBuf> {
        let path = self.document.as_ref()?.path.as_ref()?;
        path.parent().map(PathBuf::from)
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        if let Some(job) = &self.job {
            job.cancel.set();
        }
        self.drop_fits();
        // Closes the queue: threads blocked on it must not delay the end.
        self.inbox = std::sync::mpsc::sync_channel(1).1;
        // Motors off and emulator ended before the program ends.
        std::mem::replace(&mut self.link, Link::None).close(true);
        self.keep_now();
    }
}
