//! What runs beside the window: reading, baking, listing rigs. Each job has a thread of its own and reports by message.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread;

use mortise_bake::{BakeError, BakeOptions, Baked, Progress, Stage};
use mortise_brep::CadModel;
use mortise_guide::List;
use mortise_rig::RigEntry;

use super::document::Document;
use super::link::LinkUpdate;

/// Most messages that wait for the window; a sender waits when they are this many.
const MAX_WAITING: usize = 1024;

/// What a job says.
pub enum Update {
    /// A file was read, or not.
    Imported {
        /// Which file.
        generation: u64,
        /// The document, or one line why not.
        result: Result<Box<Document>, String>,
    },
    /// How far a bake is.
    Baking {
        /// Of which document.
        generation: u64,
        /// What it is doing.
        doing: String,
        /// 0 to 1 of all.
        fraction: f32,
    },
    /// A bake ended.
    Baked {
        /// Of which document.
        generation: u64,
        /// The image, or one line why not.
        result: Result<Arc<Baked>, String>,
    },
    /// The rigs there are.
    Rigs(Vec<RigEntry>),
    /// From the link.
    Link {
        /// Which connection.
        id: u64,
        /// What.
        update: LinkUpdate,
    },
    /// What guidance recognised.
    Guidance {
        /// Over which connection.
        link: u64,
        /// What.
        list: List,
    },
    /// A file was chosen in a dialog.
    Chosen(PathBuf),
    /// There is no file dialog on this computer: ask for a path instead.
    NoDialog,
}

/// Where jobs send to. Wakes the window after each message.
#[derive(Clone)]
pub struct Outbox {
    sender: SyncSender<Update>,
    wake: Arc<dyn Fn() + Send + Sync>,
}

impl Outbox {
    /// The two ends.
    pub fn new(wake: Arc<dyn Fn() + Send + Sync>) -> (Self, Receiver<Update>) {
        let (sender, receiver) = sync_channel(MAX_WAITING);
        (Self { sender, wake }, receiver)
    }

    /// Sends; `false` when nobody listens any more.
    pub fn send(&self, update: Update) -> bool {
        let sent = self.sender.send(update).is_ok();
        (self.wake)();
        sent
    }

    /// Sends without waking the window: it is taken in with whatever wakes it next. `false` when nobody listens any more.
    pub fn send_quietly(&self, update: Update) -> bool {
        match self.sender.try_send(update) {
            Ok(()) => true,
            // A window that takes nothing in is woken, and waited for.
            Err(TrySendError::Full(update)) => self.send(update),
            Err(TrySendError::Disconnected(_)) => false,
        }
    }

    /// Sends, unless too much waits already; says whether it did.
    pub fn offer(&self, update: Update) -> bool {
        let sent = self.sender.try_send(update).is_ok();
        if sent {
            (self.wake)();
        }
        sent
    }
}

/// A flag that asks a job to end early.
#[derive(Clone, Debug, Default)]
pub struct Cancel(Arc<AtomicBool>);

impl Cancel {
    /// Asks.
    pub fn set(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// For what looks at a flag by itself.
    pub fn flag(&self) -> &AtomicBool {
        &self.0
    }

    /// Whether it was asked.
    pub fn is_set(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Reads a file (`None`: the sample). When cancelled the reading process ends and nothing is said.
pub fn import(outbox: &Outbox, path: Option<PathBuf>, generation: u64, cancel: Cancel) {
    let outbox = outbox.clone();
    spawn("mortise-import", move || {
        let read = match &path {
            Some(path) => Document::read(path, generation, cancel.flag()),
            None => Document::sample(generation, cancel.flag()),
        };
        if cancel.is_set() {
            return;
        }
        let result = read.map(Box::new).map_err(|error| format!("{error:#}"));
        outbox.send(Update::Imported { generation, result });
    });
}

/// Bakes a model.
pub fn bake(outbox: &Outbox, model: Arc<CadModel>, generation: u64, options: BakeOptions, cancel: Cancel) {
    let outbox = outbox.clone();
    spawn("mortise-bake", move || {
        let throttle = std::sync::Mutex::new((std::time::Instant::now(), 0.0f32));
        let progress = |progress: Progress| {
            if cancel.is_set() {
                return ControlFlow::Break(());
            }
            // At most some thirty a second: a bake may report thousands.
            if let Ok(mut last) = throttle.try_lock() {
                let fraction = overall(&progress).max(last.1);
                if last.0.elapsed().as_millis() > 30 {
                    *last = (std::time::Instant::now(), fraction);
                    let doing = doing(&progress);
                    outbox.send(Update::Baking {
                        generation,
                        doing,
                        fraction,
                    });
                }
            }
            ControlFlow::Continue(())
        };
        let result = match mortise_bake::bake(&model, &options, &progress) {
            Err(BakeError::Cancelled) => return,
            other => other.map(Arc::new).map_err(|error| error.to_string()),
        };
        outbox.send(Update::Baked { generation, result });
    });
}

/// 0 to 1 over all stages: the pointshell takes a small share, the field nearly all of the rest.
fn overall(progress: &Progress<'_>) -> f32 {
    let (index, count) = progress.shape;
    let share = (index as f64 + progress.fraction) / count.max(1) as f64;
    let all = match progress.stage {
        Stage::Pointshell => 0.15 * share,
        Stage::Field => 0.15 + 0.83 * share,
        Stage::Image => 1.0,
    };
    all.clamp(0.0, 1.0) as f32
}

fn doing(progress: &Progress<'_>) -> String {
    match progress.stage {
        Stage::Pointshell => format!("Sampling the surface of {}", progress.part),
        Stage::Field => format!("Measuring distances around {}", progress.part),
        Stage::Image => "Putting the scene together".to_owned(),
    }
}

/// Looks which rigs there are.
pub fn list_rigs(outbox: &Outbox) {
    let outbox = outbox.clone();
    spawn("mortise-rigs", move || {
        outbox.send(Update::Rigs(mortise_rig::list()));
    });
}

/// Asks for a STEP file with the desktop's own dialog, where it has one.
pub fn choose_file(outbox: &Outbox, folder: Option<PathBuf>) {
    let dialog = move || {
        let dialog = rfd::FileDialog::new()
            .set_title("Open STEP file")
            .add_filter("STEP", &["step", "stp", "STEP", "STP", "p21"])
            .add_filter("All files", &["*"]);
        match folder {
            Some(folder) => dialog.set_directory(folder),
            None => dialog,
        }
    };
    let outbox = outbox.clone();
    let ask = move || {
        let asked = std::time::Instant::now();
        match dialog().pick_file() {
            Some(path) => outbox.send(Update::Chosen(path)),
            // Nobody closes a dialog this fast: there is none.
            None if asked.elapsed().as_millis() < 500 => outbox.send(Update::NoDialog),
            None => true,
        };
    };
    if cfg!(target_os = "macos") {
        // There dialogs belong to the main thread.
        ask();
    } else {
        spawn("mortise-dialog", ask);
    }
}

/// Starts a thread. A computer that cannot even do that gets the work done here, late rather than never.
pub fn spawn(name: &str, work: impl FnOnce() + Send + 'static) {
    let work = Arc::new(std::sync::Mutex::new(Some(work)));
    let take = |work: &Arc<std::sync::Mutex<Option<_>>>| work.lock().ok().and_then(|mut w| w.take());
    let theirs = Arc::clone(&work);
    let spawned = thread::Builder::new().name(name.to_owned()).spawn(move || {
        if let Some(work) = take(&theirs) {
            work();
        }
    });
    if spawned.is_err()
        && let Some(work) = take(&work)
    {
        work();
    }
}
