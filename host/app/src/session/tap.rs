//! The queue of the guidance thread: the board's samples, and the operator's commands.

use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};

use mortise_guide::GuideSettings;
use mortise_mating::recognise::{Target, TargetId};
use mortise_protocol::message::Telemetry;

/// Largest number of queued samples and commands; further samples are dropped because newer ones follow.
const MAX_WAITING: usize = 64;

/// An item of the thread's queue.
pub(super) enum Item {
    Sample(Box<Telemetry>),
    Command(GuidanceCommand),
}

/// A command of the operator to the guidance thread.
#[derive(Clone, Debug, PartialEq)]
pub enum GuidanceCommand {
    /// Pins a target, which keeps it in the list and gives it priority, or unpins it.
    Pin(TargetId, bool),
    /// Switches a target off, or on again.
    SwitchOff(TargetId, bool),
    /// Sets how targets are found and sent.
    Set(GuideSettings),
    /// Follows these fits of whole shapes, and no others.
    Follow(Vec<Target>),
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

    /// A new queue in place of the previous one, whose thread ends.
    pub(super) fn open(&self) -> Receiver<Item> {
        let (sender, receiver) = sync_channel(MAX_WAITING);
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(sender);
        receiver
    }
}
