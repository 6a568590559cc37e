//! Guidance beside the window: a thread that hears every sample, asks the recogniser, and sends targets to the board.
//!
//! It hears the board's samples straight from the link, so that how often the window is drawn delays nothing. When it is behind, it passes over
//! all samples but the newest.

use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError, Weak};

use mortise_brep::CadModel;
use mortise_guide::{Guide, GuideSettings, List};
use mortise_mating::recognise::TargetId;
use mortise_protocol::message::{Telemetry, ToDevice};
use mortise_rig::Client;

use super::work::{Outbox, Update};

/// Most samples and wishes that wait; samples beyond are dropped, for newer ones come.
const MAX_WAITING: usize = 64;

/// To the thread.
enum Told {
    Sample(Box<Telemetry>),
    Wish(Wish),
}

/// What the operator may want of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Wish {
    /// Keeps a target in the list and before others, or no longer.
    Pin(TargetId, bool),
    /// Switches a target off, or on again.
    SwitchOff(TargetId, bool),
    /// How targets are found and sent.
    Set(GuideSettings),
    /// Every part is back where the file has it.
    PutBack,
}

/// Where samples and wishes go in: the thread's end, while there is one.
#[derive(Clone, Default)]
pub struct Tap(Arc<Mutex<Option<SyncSender<Told>>>>);

impl Tap {
    /// Lets the thread hear a sample, when there is one and it is not far behind.
    pub fn offer(&self, sample: &Telemetry) {
        let mut sender = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(there) = &*sender {
            let told = there.try_send(Told::Sample(Box::new(sample.clone())));
            if matches!(told, Err(TrySendError::Disconnected(_))) {
                *sender = None;
            }
        }
    }

    /// Has a wish carried out before the next sample. `false`: it could not be taken now.
    pub fn wish(&self, wish: Wish) -> bool {
        let sender = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        (sender.as_ref()).is_some_and(|there| there.try_send(Told::Wish(wish)).is_ok())
    }

    /// Ends the thread once it has done what it is doing.
    pub fn end(&self) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }

    /// Starts a thread for the scene that is on the board now; the one before ends. `parts` names the model part of each part of the scene.
    /// It holds no connection open: when `client` is gone, so is what it would send.
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

/// Until the other end is dropped or nobody listens.
fn run(mut guide: Guide<'_>, told: &Receiver<Told>, client: &Weak<Client>, outbox: &Outbox, link: u64) {
    let mut last = List::default();
    while let Ok(first) = told.recv() {
        let mut newest = None;
        for told in std::iter::once(first).chain(told.try_iter()) {
            match told {
                Told::Sample(sample) => newest = Some(sample),
                Told::Wish(wish) => grant(&mut guide, wish),
            }
        }
        let Some(sample) = newest else { continue };
        for message in guide.hear(&sample) {
            send(&mut guide, client, message);
        }
        let list = guide.list();
        let changed = (&list.held, &list.rows, &list.freedom) != (&last.held, &last.rows, &last.freedom);
        // A window that is behind hears of the next one instead.
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

fn grant(guide: &mut Guide<'_>, wish: Wish) {
    match wish {
        // A target that is no longer there needs no choice.
        Wish::Pin(id, pinned) => _ = guide.recogniser().pin(id, pinned),
        Wish::SwitchOff(id, off) => _ = guide.recogniser().switch_off(id, off),
        Wish::Set(settings) => guide.set(settings),
        Wish::PutBack => guide.put_back(),
    }
}

/// Sends and hears the answer. A link that is lost ends itself, and says so elsewhere.
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
