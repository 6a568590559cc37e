//! The possible events, one at a time.

use std::fmt;

/// A program at the other end of the line. A is connected at the start; B connects when it greets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Host {
    /// The first.
    A,
    /// The second.
    B,
}

/// A message that must be fresh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Order {
    /// Leave a stop or a fault.
    Clear,
    /// Drive the motors.
    Arm,
    /// Couple the part.
    Grab,
    /// The handle is in its reference pose.
    Home,
    /// Change a parameter.
    Set,
    /// Begin an upload of a scene, with all of its bytes.
    Upload,
    /// Put the scene in use.
    Commit,
    /// Restart the board.
    Restart,
    /// Test a motor.
    Test,
}

/// Number of orders, as [`Order`] numbers them.
pub(crate) const ORDERS: usize = 9;

/// One step of the environment of the two planes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Event {
    /// A host greets and learns the session identifier.
    Hello(Host),
    /// A host sends an order, and it arrives.
    Send(Host, Order),
    /// Host A sends an order that does not arrive: it is lost, or delayed until [`Event::Deliver`].
    Hold(Order),
    /// The newest frame of this order that A ever sent arrives: late, or again.
    Deliver(Order),
    /// Host A queries the parameter.
    Read,
    /// STOP arrives.
    Stop,
    /// A host disarms. Like the next two it needs no stamp: one that comes late or again is one more.
    Disarm,
    /// A host lets the part go.
    Release,
    /// A host sends a constraint target.
    Target,
    /// A byte of the scenes in flash changes.
    Damage,
    /// The encoders lose their reference.
    Lose,
    /// The stop input opens, or closes again.
    StopInput,
    /// The line to the host fills, or empties again.
    Full,
    /// One millisecond: the control plane runs.
    Tick,
    /// The link plane forwards the output of the control plane.
    Poll,
    /// Long enough for a soft stop to end.
    Wait,
}

impl Event {
    /// Whether the event itself can break a promise: it runs the control plane, forwards a parameter that was read, or writes flash. The others change
    /// inputs or put a command in the queue. [`Event::Wait`] begins with a tick.
    pub const fn can_break(self) -> bool {
        matches!(
            self,
            Self::Wait
                | Self::Poll
                | Self::Send(_, Order::Upload | Order::Commit)
                | Self::Deliver(Order::Upload | Order::Commit)
        )
    }
}

/// Every event, except that a restart or a test is ordered: either adds more than half as many states again, and has a topic.
pub const ALPHABET: [Event; 32] = [
    Event::Hello(Host::A),
    Event::Hello(Host::B),
    Event::Send(Host::A, Order::Clear),
    Event::Send(Host::A, Order::Arm),
    Event::Send(Host::A, Order::Grab),
    Event::Send(Host::A, Order::Home),
    Event::Send(Host::A, Order::Set),
    Event::Send(Host::A, Order::Upload),
    Event::Send(Host::A, Order::Commit),
    Event::Send(Host::B, Order::Clear),
    Event::Send(Host::B, Order::Arm),
    Event::Hold(Order::Clear),
    Event::Hold(Order::Arm),
    Event::Deliver(Order::Clear),
    Event::Deliver(Order::Arm),
    Event::Deliver(Order::Grab),
    Event::Deliver(Order::Home),
    Event::Deliver(Order::Set),
    Event::Deliver(Order::Upload),
    Event::Deliver(Order::Commit),
    Event::Read,
    Event::Stop,
    Event::Disarm,
    Event::Release,
    Event::Target,
    Event::Damage,
    Event::Lose,
    Event::StopInput,
    Event::Full,
    Event::Tick,
    Event::Poll,
    Event::Wait,
];

/// Events that concern one promise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Topic {
    /// Name of the possible failure.
    pub name: &'static str,
    /// The events that could cause the failure, and those that propagate them.
    pub events: &'static [Event],
}

/// The topics, each with so few events that sequences of ten can be enumerated.
pub const TOPICS: [Topic; 7] = [
    Topic {
        name: "checksum",
        events: &[
            Event::Send(Host::A, Order::Clear),
            Event::Send(Host::A, Order::Arm),
            Event::Stop,
            Event::Damage,
            Event::Tick,
            Event::Poll,
        ],
    },
    Topic {
        name: "freshness",
        events: &[
            Event::Hello(Host::B),
            Event::Send(Host::A, Order::Arm),
            Event::Deliver(Order::Clear),
            Event::Deliver(Order::Arm),
            Event::Stop,
            Event::Tick,
            Event::Poll,
        ],
    },
    Topic {
        name: "reference",
        events: &[
            Event::Send(Host::A, Order::Arm),
            Event::Send(Host::A, Order::Home),
            Event::Deliver(Order::Home),
            Event::Lose,
            Event::Tick,
            Event::Wait,
        ],
    },
    Topic {
        name: "read back",
        events: &[
            Event::Hello(Host::A),
            Event::Send(Host::A, Order::Set),
            Event::Deliver(Order::Set),
            Event::Read,
            Event::Full,
            Event::Tick,
            Event::Poll,
        ],
    },
    Topic {
        name: "disarming",
        events: &[
            Event::Send(Host::A, Order::Arm),
            Event::Send(Host::A, Order::Grab),
            Event::Deliver(Order::Grab),
            Event::Disarm,
            Event::Release,
            Event::Tick,
            Event::Wait,
        ],
    },
    Topic {
        name: "test",
        events: &[
            Event::Hello(Host::B),
            Event::Send(Host::A, Order::Arm),
            Event::Send(Host::A, Order::Test),
            Event::Deliver(Order::Test),
            Event::Disarm,
            Event::Tick,
            Event::Wait,
        ],
    },
    Topic {
        name: "restart",
        events: &[
            Event::Hello(Host::A),
            Event::Send(Host::A, Order::Arm),
            Event::Send(Host::A, Order::Restart),
            Event::Deliver(Order::Restart),
            Event::Disarm,
            Event::Tick,
            Event::Poll,
        ],
    },
];

/// Initial sequences of events: idle, stopped, and with a part grabbed. Not counted in the depth.
pub(crate) const STARTS: [&[Event]; 3] = [
    &[],
    &[Event::Stop, Event::Tick, Event::Poll],
    &[
        Event::Send(Host::A, Order::Arm),
        Event::Tick,
        Event::Send(Host::A, Order::Grab),
        Event::Tick,
        Event::Poll,
    ],
];

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Hello(host) => write!(f, "{host:?} greets"),
            Self::Send(host, order) => write!(f, "{host:?} sends {order:?}"),
            Self::Hold(order) => write!(f, "A's {order:?} is held up"),
            Self::Deliver(order) => write!(f, "A's {order:?} comes late or again"),
            other => write!(f, "{other:?}"),
        }
    }
}
