//! What can happen, one at a time.

use std::fmt;

/// A program at the other end of the line. A begins connected; B begins when it greets.
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
    /// The handle stands in its reference pose.
    Home,
    /// Another value for a parameter.
    Set,
    /// Begin sending a scene, and all of its bytes.
    Upload,
    /// Put it in use.
    Commit,
}

/// Orders, as [`Order`] numbers them.
pub(crate) const ORDERS: usize = 7;

/// One step of the world around the two planes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Event {
    /// A host greets and learns the session's name.
    Hello(Host),
    /// A host sends an order, and it arrives.
    Send(Host, Order),
    /// Host A sends an order that does not arrive: lost, or held up for [`Event::Deliver`].
    Hold(Order),
    /// The newest frame of this order that A ever sent arrives: late, or once more.
    Deliver(Order),
    /// Host A asks for the parameter.
    Read,
    /// STOP arrives.
    Stop,
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
    /// The link plane passes on what the control plane said.
    Poll,
    /// Long enough for a soft stop to end.
    Wait,
}

/// Every event.
pub const ALPHABET: [Event; 29] = [
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
    Event::Damage,
    Event::Lose,
    Event::StopInput,
    Event::Full,
    Event::Tick,
    Event::Poll,
    Event::Wait,
];

/// Events that bear on one promise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Topic {
    /// What may go wrong.
    pub name: &'static str,
    /// The kinds of events that could make it go wrong, and those that carry them on.
    pub events: &'static [Event],
}

/// The topics, each with so few kinds of events that orders of eight can be enumerated.
pub const TOPICS: [Topic; 4] = [
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
];

/// Orders of events that the enumeration starts behind: idle, stopped, and with a part grabbed. Not counted in its depth.
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
