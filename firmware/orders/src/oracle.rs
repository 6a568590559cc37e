//! What must be true, kept apart from the planes: who sent what when, and what may therefore drive motors.

use std::hash::{Hash, Hasher};

/// A promise that an order broke.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Broken {
    /// Motors live for a scene whose checksum was not found right after the order to arm.
    NoChecksum,
    /// Motors live without a reference.
    NoReference,
    /// Motors live by an order that was late, came twice, or is of another session.
    NotFresh,
    /// Motors live behind a stop or a fault that no fresh order cleared.
    AfterStop,
    /// Motors live in the tick behind a STOP.
    StopLate,
    /// A value read back that was not in force.
    ReadBack,
    /// Flash changed while motors were driven.
    FlashWhileLive,
    /// Motors driven in a state without motors, or the other way round.
    StateDiffers,
}

/// Every promise.
pub const PROMISES: [Broken; 8] = [
    Broken::NoChecksum,
    Broken::NoReference,
    Broken::NotFresh,
    Broken::AfterStop,
    Broken::StopLate,
    Broken::ReadBack,
    Broken::FlashWhileLive,
    Broken::StateDiffers,
];

/// The world's own account.
#[derive(Clone, Debug, Default)]
pub(crate) struct Oracle {
    /// Behind a stop or a fault, and not cleared.
    pub must_clear: bool,
    /// An `Arm` that was fresh arrived since the last tick.
    fresh: bool,
    /// One of them found the checksum right.
    sound: bool,
    /// A STOP arrived since the last tick.
    stopping: bool,
    live: bool,
}

impl Oracle {
    pub fn stop(&mut self) {
        self.must_clear = true;
        self.stopping = true;
        (self.fresh, self.sound) = (false, false);
    }

    pub fn greeted(&mut self) {
        (self.fresh, self.sound) = (false, false);
    }

    pub fn arm(&mut self, fresh: bool, sound: bool) {
        self.fresh |= fresh;
        self.sound |= fresh && sound;
    }

    pub fn clear(&mut self, fresh: bool) {
        if fresh {
            self.must_clear = false;
        }
    }

    /// After a tick. `live`: motors may be driven; `halted`: stopped or in a fault.
    pub fn tick(&mut self, live: bool, halted: bool, referenced: bool) -> Option<Broken> {
        let began = live && !self.live;
        // Cleared and armed by orders that followed the STOP, the motors were off in between.
        let anew = began && self.fresh && !self.must_clear;
        let broken = if live && self.stopping && !anew {
            Some(Broken::StopLate)
        } else if live && !referenced {
            Some(Broken::NoReference)
        } else if began && self.must_clear {
            Some(Broken::AfterStop)
        } else if began && !self.fresh {
            Some(Broken::NotFresh)
        } else if began && !self.sound {
            Some(Broken::NoChecksum)
        } else {
            None
        };
        *self = Self {
            must_clear: self.must_clear || halted,
            live,
            ..Self::default()
        };
        broken
    }
}

impl Hash for Oracle {
    fn hash<H: Hasher>(&self, state: &mut H) {
        let flags = [self.must_clear, self.fresh, self.sound, self.stopping, self.live];
        flags.hash(state);
    }
}
