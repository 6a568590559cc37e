//! Both planes over their own memory, separated for two threads and joined again. Nothing is leaked: a model runs many thousand times.

use std::cell::UnsafeCell as Plain;

use loom::cell::UnsafeCell;
use loom::sync::Arc;
use mortise_firmware::board::{
    Clock, Drive, ERASED, Flash, FlashError, FlashWord, Identity, Mechanism, Outbound, SLOTS, Sensed,
    Simulation, WRITE_SIZE,
};
use mortise_firmware::channel::Channels;
use mortise_firmware::control::ControlPlane;
use mortise_firmware::device::start;
use mortise_firmware::link::LinkPlane;
use mortise_firmware::store::{IMAGE_OFFSET, commit_record};
use mortise_mechanism::hardware_limits::HardwareLimits;
use mortise_protocol::frame::{Stamp, encode_stamped};
use mortise_protocol::image::{CRC, LAYOUT_VERSION};
use mortise_protocol::limits::MAX_FRAME;
use mortise_protocol::message::{CostUnit, ResetReason, ToDevice, Version};

#[path = "../../../../firmware/app/tests/support/image.rs"]
#[allow(dead_code, reason = "this package needs one image")]
mod image;

const SECTOR: usize = 2048;
const SLOT: usize = 2 * SECTOR;
const WORDS: usize = SLOTS * SLOT / WRITE_SIZE;

const IDENTITY: Identity = Identity {
    board: "model",
    force_axes: 3,
    torque_axes: 3,
    cost_unit: CostUnit::Cycles,
    cost_budget: 0,
    reset: ResetReason::PowerOn,
    overrun_ticks: 0,
    hardware_limits: HardwareLimits::LARGEST,
    entropy: 1,
};

/// A cell that both a driven motor and a flash operation write: loom reports two writes that are not ordered by the synchronisation of the planes.
struct Exclusive(UnsafeCell<u32>);

// SAFETY: loom reports accesses that are not ordered; this is the property under test.
unsafe impl Sync for Exclusive {}
// SAFETY: contains only a number.
unsafe impl Send for Exclusive {}

impl Exclusive {
    fn touch(&self) {
        // SAFETY: ordered, or loom reports it.
        self.0.with_mut(|place| unsafe { *place += 1 });
    }
}

struct ModelFlash {
    memory: *mut FlashWord,
    exclusive: Arc<Exclusive>,
}

// SAFETY: owns its words exclusively while the planes live.
unsafe impl Send for ModelFlash {}

impl ModelFlash {
    fn word(&self, slot: usize, offset: usize) -> *mut FlashWord {
        assert!(slot < SLOTS && offset < SLOT);
        // SAFETY: inside the memory, which outlives the planes.
        unsafe { self.memory.add((slot * SLOT + offset) / WRITE_SIZE) }
    }
}

// SAFETY: aligned words, alive until the board is dropped; `erase` and `write` stay in their slot.
unsafe impl Flash<'static> for ModelFlash {
    fn capacity(&self) -> usize {
        SLOT
    }

    fn erase_size(&self) -> usize {
        SECTOR
    }

    // SAFETY: the trait's contract is passed to the caller: the slot is not written while the slice lives.
    unsafe fn slot(&self, slot: usize) -> &'static [u8] {
        if slot >= SLOTS {
            return &[];
        }
        // SAFETY: a whole slot of the memory.
        unsafe { std::slice::from_raw_parts(self.word(slot, 0).cast::<u8>(), SLOT) }
    }

    fn erase(&mut self, slot: usize, offset: usize) -> Result<(), FlashError> {
        self.exclusive.touch();
        for at in (offset..offset + SECTOR).step_by(WRITE_SIZE) {
            // SAFETY: inside the slot.
            unsafe { self.word(slot, at).write(ERASED) };
        }
        Ok(())
    }

    fn write(&mut self, slot: usize, offset: usize, word: &[u8; WRITE_SIZE]) -> Result<(), FlashError> {
        self.exclusive.touch();
        // SAFETY: inside the slot.
        unsafe { self.word(slot, offset).write(FlashWord(*word)) };
        Ok(())
    }
}

/// A mechanism at rest that records when its motors are driven.
struct Motors(Arc<Exclusive>);

impl Mechanism for Motors {
    fn sense(&mut self) -> Sensed {
        Sensed::AT_REST
    }

    fn drive(&mut self, drive: Drive) {
        if drive != Drive::Off {
            self.0.touch();
        }
    }

    fn simulation(&mut self) -> Option<&mut dyn Simulation> {
        Some(self)
    }
}

impl Simulation for Motors {}

struct NoClock;

impl Clock for NoClock {
    fn begin(&mut self) -> u32 {
        0
    }

    fn cost(&mut self) -> u32 {
        0
    }
}

/// A host that reads everything and stores nothing.
struct Sink;

impl Outbound for Sink {
    fn room(&self) -> usize {
        64 * MAX_FRAME
    }

    fn write(&mut self, _frame: &[u8]) {}
}

/// The link plane on its thread.
pub struct Link(LinkPlane<'static, 'static, ModelFlash>);

impl Link {
    /// Receives bytes from the host.
    pub fn receive(&mut self, bytes: &[u8]) {
        self.0.receive(bytes, &mut Sink);
        self.0.poll(&mut Sink);
    }
}

/// The control plane on its thread.
pub struct Control(ControlPlane<'static, 'static, Motors, NoClock>);

impl Control {
    /// Runs one millisecond.
    pub fn tick(&mut self) {
        self.0.tick();
    }

    /// True if the motors are driven.
    pub fn is_live(&self) -> bool {
        self.0.safety().live()
    }
}

/// Both planes.
pub struct Halves {
    /// For the first thread.
    pub link: Link,
    /// For the second thread.
    pub control: Control,
}

/// A board in memory.
pub struct Board {
    halves: Option<Halves>,
    channels: *mut Channels<'static>,
    memory: *mut Plain<[FlashWord; WORDS]>,
    count: u32,
}

impl Board {
    /// A board started with a scene in flash, greeted, motors off.
    pub fn with_scene() -> Self {
        let scene = image::two_parts(1);
        let mut content = [ERASED; WORDS];
        let stored = commit_record(1, &scene).into_iter().chain(scene);
        for (at, byte) in stored.enumerate() {
            content[at / WRITE_SIZE].0[at % WRITE_SIZE] = byte;
        }
        const { assert!(IMAGE_OFFSET == WRITE_SIZE) };
        let memory = Box::into_raw(Box::new(Plain::new(content)));
        let channels = Box::into_raw(Box::new(Channels::new()));
        let exclusive = Arc::new(Exclusive(UnsafeCell::new(0)));
        let flash = ModelFlash {
            // SAFETY: just made.
            memory: unsafe { &*memory }.get().cast(),
            exclusive: Arc::clone(&exclusive),
        };
        // SAFETY: alive until `drop`, which ends the planes first.
        let (link, control) = start(
            unsafe { &mut *channels },
            flash,
            Motors(exclusive),
            NoClock,
            IDENTITY,
        );
        let mut board = Self {
            halves: Some(Halves {
                link: Link(link),
                control: Control(control),
            }),
            channels,
            memory,
            count: 0,
        };
        let hello = board.frame(&ToDevice::Hello(Version::own()));
        board.halves().link.receive(&hello);
        // Also reads every shared word once, so that the model has registered it before there are two threads.
        for _ in 0..3 {
            board.round();
        }
        board
    }

    fn halves(&mut self) -> &mut Halves {
        self.halves.as_mut().expect("put back after each use")
    }

    /// Takes both planes, for two threads.
    pub fn take(&mut self) -> Halves {
        self.halves.take().expect("put back after each use")
    }

    /// Puts the planes back after the threads.
    pub fn put_back(&mut self, halves: Halves) {
        self.halves = Some(halves);
    }

    /// A tick, then a run of the link plane.
    pub fn round(&mut self) {
        let halves = self.halves();
        halves.control.tick();
        halves.link.receive(&[]);
    }

    /// True if the motors are driven.
    pub fn is_live(&mut self) -> bool {
        self.halves().control.is_live()
    }

    /// A new message in the form that the host sends.
    pub fn frame(&mut self, message: &ToDevice) -> Vec<u8> {
        self.count += 1;
        let stamp = Stamp {
            session: self.halves().link.0.session(),
            count: self.count,
        };
        let mut frame = [0; MAX_FRAME];
        encode_stamped(self.count as u16, Some(stamp), message, &mut frame)
            .expect("fits")
            .to_vec()
    }

    /// The first message of an upload.
    pub fn begin(&self) -> ToDevice {
        let scene = image::two_parts(2);
        ToDevice::SceneBegin {
            length: scene.len() as u32,
            crc: CRC.checksum(&scene),
            layout: LAYOUT_VERSION,
        }
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        self.halves = None;
        // SAFETY: made by `Box`, and the planes that used them are gone.
        unsafe {
            drop(Box::from_raw(self.channels));
            drop(Box::from_raw(self.memory));
        }
    }
}
