//! Guidance outside the window's thread: a thread that receives every sample, runs the recogniser, and sends targets to the board.
//!
//! The thread takes the board's samples directly from the link, so that the window's frame rate causes no delay. When it is behind, it
//! skips all samples but the newest.

use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError, Weak};

use mortise_brep::CadModel;
use mortise_guide::{Guide, GuideSettings, List};
use mortise_mating::recognise::TargetId;
use mortise_protocol::message::{Telemetry, ToDevice};
use mortise_rig::Client;

use super::work::{Outbox, Update};

/// Largest number of queued samples and commands; further samples are dropped because newer ones follow.
const MAX_WAITING: usize = 64;

/// An item of the thread's queue.
enum Item {
    Sample(Box<Telemetry>),
    Command(GuidanceCommand),
}

/// A command of the operator to the guidance thread.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GuidanceCommand {
    /// Pins a target, which keeps it in the list and gives it priority, or unpins it.
    Pin(TargetId, bool),
    /// Switches a target off, or on again.
    SwitchOff(TargetId, bool),
    /// Sets how targets are found and sent.
    Set(GuideSettings),
    /// Every part is back at its position in the file.
    PutBack,
}

/// Input of the guidance thread: the sending end of its queue while the thread exists.
#[derive(Clone, Default)]
pub struct Tap(Arc<Mutex<Option<SyncSender<Item>>>>);

impl Tap {
    /// Queues a sample if there is a thread and its queue is not full.
    pub fn offer(&self, sample: &Telemetry) {
        let mut sender = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(there) = &*sender {
            let sent = there.try_send(Item::Sample(Box::new(sample.clone())));
            if matches!(sent, Err(TrySendError::Disconnected(_))) {
                *sender = None;
            }
        }
    }

    /// Queues a command to be executed before the next sample. `false`: the queue is full or there is no thread.
    pub fn command(&self, command: GuidanceCommand) -> bool {
        let sender = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        (sender.as_ref()).is_some_and(|there| there.try_send(Item::Command(command)).is_ok())
    }

    /// Ends the thread after its current step.
    pub fn end(&self) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }

    /// Starts a thread for the scene that is now on the board; the previous thread ends. `parts` maps each part of the scene to a part of
    /// the model. The thread does not keep the connection open: once `client` is gone, its messages are dropped.
    pub fn start(
        &self,
        model: Arc<CadModel>,
        parts: Vec<usize>,
        settings: GuideSettings,
        client: Weak<Client>,
        outbox: Outbox,
        link: u64,
    ) {
        let (sender, receiver) = sync_channel(MAX_WAITING);
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(sender);
        super::work::spawn("mortise-guide", move || {
            let guide = Guide::new(&model, parts, settings);
            run(guide, &receiver, &client, &outbox, link);
        });
    }
}

/// Runs until the sender or the window's receiver is dropped.
fn run(mut guide: Guide<'_>, items: &Receiver<Item>, client: &Weak<Client>, outbox: &Outbox, link: u64) {
    let mut last = List::default();
    while let Ok(first) = items.recv() {
        let mut newest = None;
        for item in std::iter::once(first).chain(items.try_iter()) {
            match item {
                Item::Sample(sample) => newest = Some(sample),
                Item::Command(command) => apply(&mut guide, command),
            }
        }
        let Some(sample) = newest else { continue };
        for message in guide.hear(&sample) {
            send(&mut guide, client, message);
        }
        let list = guide.list();
        let changed = (&list.held, &list.rows, &list.freedom) != (&last.held, &last.rows, &last.freedom);
        // If the window's queue is full, the window receives the next change instead.
        if changed
            && outbox.offer(Update::Guidance {
                link,
                list: list.clone(),
            })
        {
            last = list;
        }
    }
}

fn apply(guide: &mut Guide<'_>, command: GuidanceCommand) {
    match command {
        // A target that no longer exists needs no choice.
        GuidanceCommand::Pin(id, pinned) => _ = guide.recogniser().pin(id, pinned),
        GuidanceCommand::SwitchOff(id, off) => _ = guide.recogniser().switch_off(id, off),
        GuidanceCommand::Set(settings) => guide.set(settings),
        GuidanceCommand::PutBack => guide.put_back(),
    }
}

/// Sends a message and records the answer. A lost link reports itself elsewhere.
fn send(guide: &mut Guide<'_>, client: &Weak<Client>, message: ToDevice) {
    let Some(client) = client.upgrade() else { return };
    let id = match &message {
        ToDevice::SetTarget(target) => Some(target.id),
        _ => None,
    };
    let result = client.request(message).map_err(|error| error.to_string());
    if let Some(id) = id {
        guide.answered(id, result);
    }
}
