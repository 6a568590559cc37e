//! The properties that must hold, independent of the planes: which host sent which message when, and what may therefore drive motors.

use std::hash::{Hash, Hasher};

/// A promise that a sequence of events broke.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Broken {
    /// Motors live for a scene whose checksum was not verified right after the order to arm.
    NoChecksum,
    /// Motors live without a reference.
    NoReference,
    /// Motors live through an order that was late, repeated, or of another session.
    NotFresh,
    /// Motors live after a stop or a fault that no fresh order cleared.
    AfterStop,
    /// Motors live in the tick after a STOP.
    StopLate,
    /// A value read back that was not in effect.
    ReadBack,
    /// Flash changed while motors were driven.
    FlashWhileLive,
    /// Motors driven in a state without motors, or vice versa.
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

/// Independent record of the events.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Oracle {
    /// There was a stop or a fault that is not cleared yet.
    pub must_clear: bool,
    /// A fresh `Arm` arrived since the last tick.
    fresh: bool,
    /// For one of them the checksum was right.
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

    /// Updates the record after a tick. `live`: motors may be driven; `halted`: stopped or in a fault.
    pub fn tick(&mut self, live: bool, halted: bool, referenced: bool) -> Option<Broken> {
        let began = live && !self.live;
        // If fresh orders cleared and armed after the STOP, the motors were off in between.
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
