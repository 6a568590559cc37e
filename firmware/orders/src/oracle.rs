//! The properties that must hold, independent of the planes: which host sent which message when, and what may therefore drive motors.

/// A promise that a sequence of events broke.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Broken {
    /// Motors live for a scene whose bytes in flash were not those uploaded when the order to arm arrived.
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
    /// Motors driven, other than to fade out, after a `Disarm` or a greeting that no fresh order to arm followed.
    AfterDisarm,
    /// Motors live longer than a soft stop or a test may take.
    FadeLate,
    /// A part rendered after a `Release`, or through an order to grab that was late, repeated, or of another session.
    NotGrabbed,
    /// A restart while motors are live, or through an order that was late, repeated, or of another session.
    Restart,
}

/// Every promise.
pub const PROMISES: [Broken; 12] = [
    Broken::NoChecksum,
    Broken::NoReference,
    Broken::NotFresh,
    Broken::AfterStop,
    Broken::StopLate,
    Broken::ReadBack,
    Broken::FlashWhileLive,
    Broken::StateDiffers,
    Broken::AfterDisarm,
    Broken::FadeLate,
    Broken::NotGrabbed,
    Broken::Restart,
];

/// What the messages since the last tick, in their order, leave of what was or was not in that tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
enum Course {
    #[default]
    Same,
    Begins,
    Ends,
}

impl Course {
    /// After a message that ends it.
    fn ended(before: bool) -> Self {
        if before { Self::Ends } else { Self::Same }
    }

    /// Whether it may be now; `before`: it was in the last tick.
    fn allows(self, before: bool) -> bool {
        match self {
            Self::Same => before,
            Self::Begins => true,
            Self::Ends => false,
        }
    }
}

/// The board after a tick.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Seen {
    /// Motors may be driven.
    pub live: bool,
    /// Motors may be driven, not only to fade out.
    pub held: bool,
    /// A part is rendered.
    pub active: bool,
    /// A motor is tested.
    pub tested: bool,
    /// Stopped or in a fault.
    pub halted: bool,
    /// The encoders have a reference.
    pub referenced: bool,
    /// The scene is another than before the tick.
    pub other_scene: bool,
}

/// Independent record of the events.
#[derive(Clone, Copy, Debug, Default, Hash)]
pub(crate) struct Oracle {
    /// There was a stop or a fault that is not cleared yet.
    pub must_clear: bool,
    /// A fresh `Arm` arrived since the last tick.
    fresh: bool,
    /// For one of them the scene in use was intact.
    sound: bool,
    /// A fresh order to test a motor arrived since the last tick.
    test: bool,
    /// A STOP arrived since the last tick.
    stopping: bool,
    /// Orders to arm, against `Disarm`, STOP and greetings.
    arming: Course,
    /// Orders to grab, against these and `Release`.
    grabbing: Course,
    /// A fresh `Restart` arrived in this session.
    restart: bool,
    /// In the last tick, as in [`Seen`].
    live: bool,
    held: bool,
    active: bool,
}

impl Oracle {
    pub fn stop(&mut self) {
        self.must_clear = true;
        self.stopping = true;
        (self.fresh, self.sound, self.test) = (false, false, false);
        self.disarm();
    }

    pub fn greeted(&mut self) {
        (self.fresh, self.sound, self.restart) = (false, false, false);
        self.test = false;
        self.disarm();
    }

    pub fn disarm(&mut self) {
        self.arming = Course::ended(self.held);
        self.release();
    }

    pub fn release(&mut self) {
        self.grabbing = Course::ended(self.active);
    }

    /// A fresh order to arm, refused while motors are live; `sound`: the scene in use is intact.
    pub fn arm(&mut self, sound: bool) {
        if !self.live {
            self.fresh = true;
            self.sound |= sound;
            self.arming = Course::Begins;
        }
    }

    /// A fresh order to test a motor, refused while motors are live. It needs no scene.
    pub fn test(&mut self) {
        if !self.live {
            self.test = true;
            self.arming = Course::Begins;
        }
    }

    /// A fresh order to clear.
    pub fn clear(&mut self) {
        self.must_clear = false;
    }

    /// A fresh order to grab, refused unless armed and without a part.
    pub fn grab(&mut self) {
        if self.arming.allows(self.held) && !self.grabbing.allows(self.active) {
            self.grabbing = Course::Begins;
        }
    }

    /// A fresh order to restart.
    pub fn restart(&mut self) {
        self.restart = true;
    }

    /// Whether an order allows the board to restart.
    pub fn may_restart(&self) -> bool {
        self.restart
    }

    /// Updates the record after a tick.
    pub fn tick(&mut self, seen: &Seen) -> Option<Broken> {
        let began = seen.live && !self.live;
        // If fresh orders cleared and armed after the STOP, the motors were off in between.
        let fresh = if seen.tested { self.test } else { self.fresh };
        let anew = began && fresh && !self.must_clear;
        let broken = if seen.live && self.stopping && !anew {
            Some(Broken::StopLate)
        } else if seen.live && !seen.referenced {
            Some(Broken::NoReference)
        } else if began && self.must_clear {
            Some(Broken::AfterStop)
        } else if began && !fresh {
            Some(Broken::NotFresh)
        } else if began && !seen.tested && (!self.sound || seen.other_scene) {
            Some(Broken::NoChecksum)
        } else if seen.held && !self.arming.allows(self.held) {
            Some(Broken::AfterDisarm)
        } else if seen.active && !self.grabbing.allows(self.active) {
            Some(Broken::NotGrabbed)
        } else {
            None
        };
        *self = Self {
            must_clear: self.must_clear || seen.halted,
            // Refused then.
            restart: self.restart && !seen.live,
            live: seen.live,
            held: seen.held,
            active: seen.active,
            ..Self::default()
        };
        broken
    }
}
