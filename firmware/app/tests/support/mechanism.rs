//! A scripted mechanism: the test sets its readings and inspects its commands.

use std::cell::RefCell;
use std::rc::Rc;

use mortise_firmware::board::{Drive, Mechanism, Sensed, Simulation};
use mortise_protocol::limits::MAX_ENCODERS;

/// Shared between the test and the mechanism.
#[derive(Clone)]
pub struct Strings(pub Rc<RefCell<Pulled>>);

pub struct Pulled {
    pub sensed: Sensed,
    /// Every drive command so far.
    pub drives: Vec<Drive>,
    /// Number of calls of `home`.
    pub homed: u32,
    /// Counts of the encoders.
    pub counts: [i32; MAX_ENCODERS],
}

impl Default for Strings {
    fn default() -> Self {
        Self(Rc::new(RefCell::new(Pulled {
            sensed: Sensed::AT_REST,
            homed: 0,
            counts: [0; MAX_ENCODERS],
            drives: Vec::new(),
        })))
    }
}

impl Strings {
    pub fn pull(&self, change: impl FnOnce(&mut Sensed)) {
        change(&mut self.0.borrow_mut().sensed);
    }

    pub fn last(&self) -> Drive {
        *self.0.borrow().drives.last().expect("driven at start")
    }
}

pub struct Puppet<const SIMULATED: bool, const DESCRIBED: bool>(Strings);

impl<const SIMULATED: bool, const DESCRIBED: bool> Puppet<SIMULATED, DESCRIBED> {
    pub fn new(strings: Strings) -> Self {
        Self(strings)
    }
}

impl<const SIMULATED: bool, const DESCRIBED: bool> Mechanism for Puppet<SIMULATED, DESCRIBED> {
    const DESCRIBED: bool = DESCRIBED;

    fn sense(&mut self) -> Sensed {
        self.0.0.borrow().sensed
    }

    fn home(&mut self) {
        let mut pulled = self.0.0.borrow_mut();
        pulled.homed += 1;
        pulled.sensed.referenced = true;
    }

    fn motors(&self) -> u8 {
        3
    }

    fn counts(&self) -> [i32; MAX_ENCODERS] {
        self.0.0.borrow().counts
    }

    fn drive(&mut self, drive: Drive) {
        self.0.0.borrow_mut().drives.push(drive);
    }

    fn simulation(&mut self) -> Option<&mut dyn Simulation> {
        SIMULATED.then_some(self)
    }
}

impl<const SIMULATED: bool, const DESCRIBED: bool> Simulation for Puppet<SIMULATED, DESCRIBED> {}
