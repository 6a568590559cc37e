//! All reachable states of the scene store: every order of its operations, power loss at any flash operation, and a restart at any moment.
//!
//! A state is the flash's content with the store's own state. From each new one every operation is tried, until no new state appears, for up to
//! `COMMITS` commits (their sequence numbers make the number of states infinite otherwise), with one loss of power on the way to a state and a second
//! one tried in each. A model of a few lines runs beside the store: the scene in use, and the scenes a restart may find. The flash itself checks that
//! no word is written twice without erasing.

use std::collections::{HashSet, VecDeque};
use std::hash::{DefaultHasher, Hash, Hasher};

use crate::support::flash::{SECTOR, SLOT, TestFlash};
use crate::support::image::two_parts;
use mortise_firmware::store::Store;
use mortise_protocol::image::{CRC, LAYOUT_VERSION};

/// Scenes committed one after another.
const COMMITS: u8 = 2;
/// Flash operations after which power may fail during one operation of the store; no operation has more.
const FUSES: u32 = 20;
/// Size of a chunk, so that an image of 1.3 kB takes three.
const CHUNK: usize = 512;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Operation {
    Begin,
    /// Begin with a checksum that is not the image's.
    BeginWrong,
    Chunk,
    Commit,
    Abort,
    TakenOver,
    NotTakenOver,
    Restart,
}

const OPERATIONS: [Operation; 8] = [
    Operation::Begin,
    Operation::BeginWrong,
    Operation::Chunk,
    Operation::Commit,
    Operation::Abort,
    Operation::TakenOver,
    Operation::NotTakenOver,
    Operation::Restart,
];

/// One step on the way to a state: an operation, and the flash operation at which power fails, followed by a restart.
type Step = (Operation, Option<u32>);

/// The store, and the model of its expected state.
struct Run {
    store: Store<'static, TestFlash>,
    flash: TestFlash,
    /// Tag of the image that is uploaded next; each commit makes a new one.
    tag: u8,
    sent: usize,
    wrong: bool,
    /// CRC of the scene in use.
    in_use: Option<u32>,
    /// CRC of the committed scene that the control plane has not taken over.
    waiting: Option<u32>,
    /// Scenes that a restart now may find.
    kept: HashSet<Option<u32>>,
}

impl Run {
    /// On an erased chip.
    fn new(flash: &TestFlash) -> Self {
        let flash = flash.clone();
        flash.erase_all();
        Self {
            store: Store::open(flash.clone()),
            flash,
            tag: 1,
            sent: 0,
            wrong: false,
            in_use: None,
            waiting: None,
            kept: HashSet::from([None]),
        }
    }

    fn crc(&self) -> u32 {
        CRC.checksum(&two_parts(self.tag))
    }

    /// Performs one step; returns whether the power held.
    fn perform(&mut self, (operation, fuse): Step) -> bool {
        self.flash.fuse.set(fuse);
        let image = two_parts(self.tag);
        match operation {
            Operation::Begin | Operation::BeginWrong => {
                let wrong = operation == Operation::BeginWrong;
                let crc = CRC.checksum(&image) ^ u32::from(wrong);
                if self.store.begin(image.len() as u32, crc, LAYOUT_VERSION).is_ok() {
                    (self.sent, self.wrong) = (0, wrong);
                    // The image waiting in the free slot is erased.
                    self.kept = HashSet::from([self.in_use]);
                }
            }
            Operation::Chunk => {
                let end = image.len().min(self.sent + CHUNK);
                if self.store.chunk(self.sent as u32, &image[self.sent..end]).is_ok() {
                    self.sent = end;
                }
            }
            Operation::Commit => {
                if self.store.commit().is_ok() {
                    assert!(!self.wrong, "a scene with a wrong checksum was committed");
                    assert_eq!(self.sent, image.len(), "a scene was committed in part");
                    self.waiting = Some(self.crc());
                    self.kept = HashSet::from([self.waiting]);
                    self.tag += 1;
                }
            }
            Operation::Abort => {
                self.store.abort();
            }
            Operation::TakenOver => {
                self.store.taken_over();
                if let Some(waiting) = self.waiting.take() {
                    self.in_use = Some(waiting);
                }
            }
            Operation::NotTakenOver => {
                let erased = self.store.not_taken_over().is_ok();
                if self.waiting.take().is_some() {
                    self.kept.insert(self.in_use);
                    if erased {
                        self.kept = HashSet::from([self.in_use]);
                    }
                }
            }
            Operation::Restart => self.restart(),
        }
        let powered = self.flash.fuse.get() != Some(0);
        if !powered {
            self.flash.fuse.set(None);
            // An interrupted operation has taken effect or not.
            if matches!(operation, Operation::Begin | Operation::BeginWrong) {
                self.kept.insert(self.in_use);
            }
            self.restart();
        }
        self.flash.fuse.set(None);
        powered
    }

    fn restart(&mut self) {
        self.store = Store::open(self.flash.clone());
        let found = self.store.current().map(|scene| scene.crc);
        assert!(
            self.kept.contains(&found),
            "found {found:?}, not of {:?}",
            self.kept
        );
        self.in_use = found;
        self.waiting = None;
        self.kept = HashSet::from([found]);
        self.sent = 0;
    }

    /// Checks the invariants of every state.
    fn check(&self) {
        assert_eq!(self.store.current().map(|scene| scene.crc), self.in_use);
        assert_eq!(self.store.is_sound(), self.in_use.is_some());
        let restarted = Store::open(self.flash.clone()).current().map(|scene| scene.crc);
        assert!(
            self.kept.contains(&restarted),
            "a restart would find {restarted:?}, not of {:?}",
            self.kept
        );
    }

    /// Identifies the state. Equal numbers stand for equal states except for a chance of 2⁻⁶⁴ per pair.
    fn fingerprint(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        for slot in 0..2 {
            self.flash.content(slot).hash(&mut hasher);
        }
        let mut kept: Vec<_> = self.kept.iter().collect();
        kept.sort();
        (
            self.store.busy(),
            self.tag,
            self.sent,
            self.wrong,
            self.in_use,
            self.waiting,
            kept,
        )
            .hash(&mut hasher);
        hasher.finish()
    }
}

fn replay(flash: &TestFlash, path: &[Step]) -> Run {
    let mut run = Run::new(flash);
    for &step in path {
        run.perform(step);
    }
    run
}

#[test]
fn every_reachable_state_keeps_a_whole_scene() {
    const { assert!(SLOT / SECTOR == 16, "the fuses cover an operation") };
    // One chip for all runs, one run at a time: memory of a test's flash is never freed.
    let flash = TestFlash::leaked();
    let mut known = HashSet::from([Run::new(&flash).fingerprint()]);
    let mut open: VecDeque<Vec<Step>> = VecDeque::from([Vec::new()]);
    let mut transitions = 0_u64;
    let mut longest = 0;
    while let Some(path) = open.pop_front() {
        let cut = path.iter().any(|(_, fuse)| fuse.is_some());
        longest = longest.max(path.len());
        for operation in OPERATIONS {
            for fuse in std::iter::once(None).chain((1..=FUSES).map(Some)) {
                let mut run = replay(&flash, &path);
                let powered = run.perform((operation, fuse));
                transitions += 1;
                run.check();
                let goes_on = run.tag <= COMMITS && (powered || !cut);
                if goes_on && known.insert(run.fingerprint()) {
                    let mut path = path.clone();
                    // A fuse that outlasted the operation has no effect.
                    path.push((operation, fuse.filter(|_| !powered)));
                    open.push_back(path);
                }
                if powered && fuse.is_some() {
                    // The operation ended before the fuse, as it would with every longer one.
                    break;
                }
            }
        }
    }
    println!(
        "{} states, {transitions} transitions, longest way {longest}",
        known.len()
    );
    assert!(known.len() > 100, "{} states say nothing", known.len());
}
