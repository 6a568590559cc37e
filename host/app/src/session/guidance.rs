//! Guidance outside the window's thread: a thread that receives every sample, runs the recogniser, and sends targets to the board.
//!
//! The thread takes the board's samples directly from the link, so that the window's frame rate causes no delay. When it is behind, it
//! skips all samples but the newest.

use std::collections::BTreeMap;
use std::sync::mpsc::Receiver;
use std::sync::{Arc, Weak};

use glam::DAffine3;
use mortise_brep::CadModel;
use mortise_guide::{Guide, GuideSettings, List};
use mortise_mating::recognise::{Target, TargetId};
use mortise_protocol::message::ToDevice;
use mortise_rig::Client;

use super::fits::FitChoice;
use super::outbox::{Outbox, Update};
use super::tap::{GuidanceCommand, Item, Tap};
use super::threads::spawn;

/// What guidance starts with.
pub struct Start {
    /// The model, each group as one part.
    pub model: Arc<CadModel>,
    /// Pose of each part of the model in the scene, mm, if one is not the file's.
    pub placed: Option<Vec<DAffine3>>,
    /// For each part of the scene, the part of the model.
    pub parts: Vec<usize>,
    /// The user's choices so far.
    pub fits: BTreeMap<TargetId, FitChoice>,
    /// Fits of whole shapes that are followed.
    pub followed: Vec<Target>,
    /// How targets are found and sent.
    pub settings: GuideSettings,
}

impl Start {
    /// The model with its parts where the scene has them.
    fn model(&self) -> Arc<CadModel> {
        let mut model = Arc::clone(&self.model);
        if let Some(placed) = &self.placed {
            let parts = Arc::make_mut(&mut model).parts.iter_mut();
            for (part, pose) in parts.zip(placed) {
                part.placement = *pose;
            }
        }
        model
    }
}

/// Starts a thread for the scene that is now on the board, with `tap` as its input; the previous thread ends. The thread does not keep the connection open: once `client` is gone, its messages are dropped.
pub fn start(tap: &Tap, start: Start, client: Weak<Client>, outbox: Outbox, link: u64) {
    let items = tap.open();
    spawn("mortise-guide", move || {
        let model = start.model();
        let mut guide = Guide::new(&model, start.parts, start.settings);
        guide.follow(start.followed);
        run(guide, start.fits, &items, &client, &outbox, link);
    });
}

/// Runs until the sender or the window's receiver is dropped.
fn run(
    mut guide: Guide<'_>,
    mut fits: BTreeMap<TargetId, FitChoice>,
    items: &Receiver<Item>,
    client: &Weak<Client>,
    outbox: &Outbox,
    link: u64,
) {
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
        let messages = guide.hear(&sample);
        // An earlier choice applies as soon as its target is in the list; from then on the guide knows it.
        fits.retain(|id, choice| !choose(&mut guide, *id, *choice));
        for message in messages {
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

/// Applies a choice; `false` while there is no such target.
fn choose(guide: &mut Guide<'_>, id: TargetId, choice: FitChoice) -> bool {
    let recogniser = guide.recogniser();
    recogniser.pin(id, choice.pinned) && recogniser.switch_off(id, choice.off)
}

fn apply(guide: &mut Guide<'_>, command: GuidanceCommand) {
    match command {
        // A target that no longer exists needs no choice.
        GuidanceCommand::Pin(id, pinned) => _ = guide.recogniser().pin(id, pinned),
        GuidanceCommand::SwitchOff(id, off) => _ = guide.recogniser().switch_off(id, off),
        GuidanceCommand::Set(settings) => guide.set(settings),
        GuidanceCommand::Follow(fits) => guide.follow(fits),
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
