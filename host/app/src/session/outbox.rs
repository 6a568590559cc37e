//! The window's queue: what other threads report to the session.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};

use mortise_bake::Baked;
use mortise_guide::List;
use mortise_protocol::message::{MotorTest, Readings, Statistics, ToDevice};
use mortise_protocol::parameter::ParameterId;
use mortise_protocol::rig::Rig;
use mortise_rig::{Client, Event, RigEntry, UploadProgress};

use super::connections::ConnectionsFound;
use super::document::Document;
use super::energies::EnergyMade;
use super::fitting::FitsFound;
use super::flashing::FlashUpdate;
use super::grouped::Grouped;
use super::introduction::RigSent;
use super::joints::JointsFound;
use super::purpose::Purpose;
use super::recomputed::RecomputeUpdate;
use super::recording::RecordingUpdate;
use super::runs::RunRead;
use super::saved::Saved;
use super::sequencing::SequenceFound;
use super::tap::Tap;
use super::threads::Cancel;
use super::ways::WaysFound;
use crate::kept::Mark;
use crate::kept::project::Project;

/// Capacity of the window's queue, more than the samples of a minute without a redraw; a sender blocks when it is full.
const MAX_WAITING: usize = 4096;

/// A report of another thread.
pub enum Update {
    /// Reading a file ended.
    Imported {
        /// Id of the file.
        generation: u64,
        /// The document, or one line with the reason of the failure.
        result: Result<Box<Imported>, String>,
    },
    /// Progress of reading or baking.
    Working {
        /// Id of the file or document.
        generation: u64,
        /// Description of the current stage, where the job has several.
        doing: Option<String>,
        /// Progress of the whole job, 0 to 1.
        fraction: f32,
    },
    /// A bake ended.
    Baked {
        /// Id of the document.
        generation: u64,
        /// What was baked.
        of: Arc<Grouped>,
        /// The collision model, or one line with the reason of the failure.
        result: Result<CollisionModel, String>,
    },
    /// The available rigs.
    Rigs(Vec<RigEntry>),
    /// A report of the link.
    Link {
        /// Id of the connection.
        id: u64,
        /// The report.
        update: LinkUpdate,
    },
    /// Targets that guidance recognised.
    Guidance {
        /// Id of the connection.
        link: u64,
        /// The targets.
        list: List,
    },
    /// Fits with one part were searched.
    Fits(FitsFound),
    /// The steps of the assembly were searched.
    Sequence(SequenceFound),
    /// The ways of a part in the assembly were searched.
    Ways(WaysFound),
    /// Making the energy of a fit ended.
    Energy(Box<EnergyMade>),
    /// A file was chosen in a dialog.
    Chosen(Purpose, PathBuf),
    /// No file dialog is available: the window must ask for a path.
    NoDialog(Purpose),
    /// Recent files that are missing.
    Missing(Vec<PathBuf>),
    /// Looking for the marks of other windows ended.
    Marked {
        /// Models that were open in programs that were ended by force.
        models: Vec<PathBuf>,
        /// The mark of this window.
        mark: Option<Mark>,
    },
    /// Reading a project file ended.
    ProjectRead {
        /// The file.
        path: PathBuf,
        /// The project, or one line with the reason of the failure.
        result: Result<ProjectFile, String>,
    },
    /// The joints of a part were searched.
    Joints(JointsFound),
    /// The connections of the parts were searched.
    Connections(ConnectionsFound),
    /// Firmware is being written to a board.
    Flashing(FlashUpdate),
    /// Reading a recorded run ended.
    Run(RunRead),
    /// A run is being computed again, by the computation that this flag ends.
    Recompute(Cancel, RecomputeUpdate),
    /// A file was written, or one line with the reason why not.
    Written(Result<String, String>),
}

/// A project that was read.
pub struct ProjectFile {
    /// Its contents.
    pub project: Box<Project>,
    /// STEP file of its model; `None`: the sample.
    pub model: Option<PathBuf>,
}

/// A file that was read.
pub struct Imported {
    /// The document.
    pub document: Document,
    /// What saved itself for it.
    pub saved: Saved,
}

/// A baked model.
pub struct CollisionModel {
    /// The image and its report.
    pub baked: Arc<Baked>,
    /// What a plan reached and what limits it, in one line.
    pub reached: Option<String>,
}

/// A report of the link.
pub enum LinkUpdate {
    /// Connected.
    Connected {
        /// Sends messages.
        client: Arc<Client>,
        /// The board's parameters.
        parameters: Vec<(ParameterId, f32)>,
        /// Input of the guidance thread for samples.
        tap: Tap,
    },
    /// The connection failed, and why.
    Failed(String),
    /// An unsolicited event of the board.
    Event(Event),
    /// A request was executed or refused.
    Answered {
        /// The request.
        message: Box<ToDevice>,
        /// One line with the reason of a refusal.
        result: Result<(), String>,
    },
    /// No answer because the link is lost, which [`Event::LinkLost`] reports once; or the answer to a query of the window itself that
    /// nothing waits for.
    Unanswered,
    /// Progress of an upload.
    Uploading(UploadProgress),
    /// An upload ended.
    Uploaded {
        /// The scene's document.
        generation: u64,
        /// `false`: the operator cancelled it. An error is one line with the reason.
        result: Result<bool, String>,
    },
    /// The counters.
    Statistics(Statistics),
    /// What became of a recording.
    Recording(RecordingUpdate),
    /// The description that the board keeps, and whether it uses it; or one line with the reason why it was not read.
    Rig(Box<Result<(Option<Rig>, bool), String>>),
    /// A description was sent, and the board has started again; or one line with the reason why not.
    RigSent(Result<Box<RigSent>, String>),
    /// Readings of encoders and inputs.
    Readings(Readings),
    /// The reference was set, or one line with the reason why not.
    Referenced(Result<(), String>),
    /// A motor was tested both ways; `None`: the mechanism does not come to rest. Or one line with the reason why not.
    MotorTested(Result<Option<[MotorTest; 2]>, String>),
}

/// Sending end of the window's queue. Wakes the window after each message.
#[derive(Clone)]
pub struct Outbox {
    sender: SyncSender<Update>,
    wake: Arc<dyn Fn() + Send + Sync>,
}

impl Outbox {
    /// Both ends of a new queue.
    pub fn new(wake: Arc<dyn Fn() + Send + Sync>) -> (Self, Receiver<Update>) {
        let (sender, receiver) = sync_channel(MAX_WAITING);
        (Self { sender, wake }, receiver)
    }

    /// Sends a message; `false` when the receiver is gone.
    pub fn send(&self, update: Update) -> bool {
        let sent = self.sender.send(update).is_ok();
        (self.wake)();
        sent
    }

    /// Wakes the window.
    pub fn waker(&self) -> Arc<dyn Fn() + Send + Sync> {
        Arc::clone(&self.wake)
    }

    /// Sends a message without waking the window, which takes it in at its next wake-up. `false` when the receiver is gone.
    pub fn send_quietly(&self, update: Update) -> bool {
        match self.sender.try_send(update) {
            Ok(()) => true,
            // If the queue is full, the window is woken and waited for.
            Err(TrySendError::Full(update)) => self.send(update),
            Err(TrySendError::Disconnected(_)) => false,
        }
    }

    /// Sends a message unless the queue is full; returns whether it did.
    pub fn offer(&self, update: Update) -> bool {
        let sent = self.sender.try_send(update).is_ok();
        if sent {
            (self.wake)();
        }
        sent
    }
}
