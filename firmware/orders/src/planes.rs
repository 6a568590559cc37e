//! Both planes at a fixed place in memory, whose whole state can be saved and put back.
//!
//! The planes refer to the queues between them and to the flash, so a copy would refer to the original's. Putting the bytes back at the same place
//! keeps every reference valid. Nothing in them owns memory: the firmware allocates none.

use std::mem::MaybeUninit;
use std::ptr;

use mortise_firmware::channel::Channels;
use mortise_firmware::control::ControlPlane;
use mortise_firmware::device::start;
use mortise_firmware::link::LinkPlane;

use crate::board::{Chip, ChipFlash, IDENTITY, NoClock, Puppet, Rig};

type Control = ControlPlane<'static, 'static, Puppet<'static>, NoClock>;
type Link = LinkPlane<'static, 'static, ChipFlash<'static>>;

/// The board: both planes, their queues, the flash and the mechanism.
pub(crate) struct Planes {
    pub link: Link,
    pub control: Control,
    pub chip: &'static Chip,
    pub rig: &'static Rig,
    channels: *mut Channels<'static>,
    /// Names the force law's state: a new number with every tick, the old one when a state is put back.
    law: u64,
    ticks: u64,
}

impl Planes {
    /// A board just started, with this scene in its first slot. Its memory is never freed: one is made for each thread of the enumeration.
    pub fn start(scene: &[u8]) -> Self {
        let chip: &'static Chip = Box::leak(Box::new(Chip::with(scene)));
        let rig: &'static Rig = Box::leak(Box::new(Rig::at_rest()));
        let channels = Box::into_raw(Box::new(Channels::new()));
        // SAFETY: just allocated, never freed; the planes are its only users while they run.
        let ends = unsafe { &mut *channels };
        let (link, control) = start(ends, ChipFlash { chip, rig }, Puppet(rig), NoClock, IDENTITY);
        Self {
            link,
            control,
            chip,
            rig,
            channels,
            law: 0,
            ticks: 0,
        }
    }

    /// Runs one tick of the control plane.
    pub fn tick(&mut self) {
        self.ticks += 1;
        self.law = self.ticks;
        self.control.tick();
    }
}

/// The state of the planes at one moment.
pub(crate) struct Saved {
    link: MaybeUninit<Link>,
    control: MaybeUninit<Control>,
    channels: Box<MaybeUninit<Channels<'static>>>,
    /// See [`Planes::law`].
    law: Option<u64>,
    chip: Chip,
    rig: Rig,
}

impl Saved {
    /// The state of `planes`.
    pub fn of(planes: &Planes) -> Self {
        let mut saved = Self {
            link: MaybeUninit::uninit(),
            control: MaybeUninit::uninit(),
            channels: Box::new_uninit(),
            law: None,
            chip: planes.chip.clone(),
            rig: planes.rig.clone(),
        };
        saved.take(planes);
        saved
    }

    /// Takes the present state of `planes` in place of the earlier one of the same planes.
    pub fn take(&mut self, planes: &Planes) {
        self.chip.set(planes.chip);
        self.rig.set(planes.rig);
        let (from, to) = (
            planes.channels.cast::<u8>(),
            self.channels.as_mut_ptr().cast::<u8>(),
        );
        // SAFETY: `channels` lives as long as the planes, and none of them is running.
        unsafe { copy_channels(from, to, self.law != Some(planes.law)) };
        self.law = Some(planes.law);
        // SAFETY: each is copied as a whole into a place of its own type; the copies are only ever copied back, never used or dropped.
        unsafe {
            ptr::copy_nonoverlapping(&raw const planes.link, self.link.as_mut_ptr(), 1);
            ptr::copy_nonoverlapping(&raw const planes.control, self.control.as_mut_ptr(), 1);
        }
    }

    /// Puts the state back into the planes it was taken from.
    pub fn put_back(&self, planes: &mut Planes) {
        planes.chip.set(&self.chip);
        planes.rig.set(&self.rig);
        let (from, to) = (self.channels.as_ptr().cast::<u8>(), planes.channels.cast::<u8>());
        // SAFETY: as in `take`.
        unsafe { copy_channels(from, to, self.law != Some(planes.law)) };
        planes.law = self.law.unwrap_or_default();
        // SAFETY: copied as a whole from a state of these very planes, whose references are to places that still exist; no plane is running, and
        // neither has anything to drop.
        unsafe {
            ptr::copy_nonoverlapping(self.link.as_ptr(), &raw mut planes.link, 1);
            ptr::copy_nonoverlapping(self.control.as_ptr(), &raw mut planes.control, 1);
        }
    }
}

/// Copies the memory between the planes; the force law's state, which is nine tenths of it, only when it differs.
///
/// # Safety
/// Both are addresses of different `Channels`, and nobody uses them meanwhile.
unsafe fn copy_channels(from: *const u8, to: *mut u8, law: bool) {
    let at = Channels::LAW;
    for (part, wanted) in [
        (0..at.start, true),
        (at.clone(), law),
        (at.end..size_of::<Channels<'_>>(), true),
    ] {
        if wanted {
            // SAFETY: inside both.
            unsafe { ptr::copy_nonoverlapping(from.add(part.start), to.add(part.start), part.len()) };
        }
    }
}
