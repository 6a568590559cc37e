//! Unsolicited messages of a board, in a bounded queue that never blocks the reader.

use std::collections::VecDeque;
use std::sync::mpsc::{RecvTimeoutError, TryRecvError};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use mortise_protocol::message::{DeviceState, Fault, Telemetry};

/// Capacity of the queue; at 1 kHz telemetry about four seconds.
pub const MAX_EVENTS: usize = 4096;

/// An unsolicited message.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// One sample of the loop.
    Telemetry(Box<Telemetry>),
    /// The board's state changed.
    State {
        /// Tick of the change.
        tick: u32,
        /// The new state.
        state: DeviceState,
    },
    /// A fault occurred; motors are off or going off. [`crate::describe`] has the words.
    Fault {
        /// Tick in which it was detected.
        tick: u32,
        /// The fault.
        fault: Fault,
    },
    /// A line of the board's log.
    Log(String),
    /// The link is lost, and why. The last event.
    LinkLost(String),
}

#[derive(Debug, Default)]
struct Queue {
    waiting: VecDeque<Event>,
    dropped: u64,
    closed: bool,
}

/// The receiving end. Cheap to clone; each event goes to one receiver.
#[derive(Clone, Debug, Default)]
pub struct Events {
    shared: Arc<(Mutex<Queue>, Condvar)>,
}

impl Events {
    fn queue(&self) -> MutexGuard<'_, Queue> {
        self.shared.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The oldest queued event, if any.
    pub fn try_recv(&self) -> Result<Event, TryRecvError> {
        let mut queue = self.queue();
        match queue.waiting.pop_front() {
            Some(event) => Ok(event),
            None if queue.closed => Err(TryRecvError::Disconnected),
            None => Err(TryRecvError::Empty),
        }
    }

    /// The oldest event; waits for one at most `timeout`.
    pub fn recv_timeout(&self, timeout: Duration) -> Result<Event, RecvTimeoutError> {
        let deadline = Instant::now() + timeout;
        let mut queue = self.queue();
        loop {
            if let Some(event) = queue.waiting.pop_front() {
                return Ok(event);
            }
            if queue.closed {
                return Err(RecvTimeoutError::Disconnected);
            }
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Err(RecvTimeoutError::Timeout);
            }
            queue = self
                .shared
                .1
                .wait_timeout(queue, left)
                .map(|(queue, _)| queue)
                .unwrap_or_else(|poisoned| poisoned.into_inner().0);
        }
    }

    /// All events queued now, oldest first.
    pub fn try_iter(&self) -> impl Iterator<Item = Event> + '_ {
        std::iter::from_fn(|| self.try_recv().ok())
    }

    /// Number of telemetry samples dropped because they were not taken in time.
    pub fn dropped(&self) -> u64 {
        self.queue().dropped
    }

    /// Adds an event. When full, drops the oldest telemetry, or the oldest event when there is none: a fault must not be lost to samples.
    pub(crate) fn push(&self, event: Event) {
        let mut queue = self.queue();
        if queue.closed {
            return;
        }
        if queue.waiting.len() >= MAX_EVENTS {
            let oldest = queue
                .waiting
                .iter()
                .position(|waiting| matches!(waiting, Event::Telemetry(_)))
                .unwrap_or(0);
            queue.waiting.remove(oldest);
            queue.dropped += 1;
        }
        queue.waiting.push_back(event);
        self.shared.1.notify_one();
    }

    /// Marks the end: no event will be added; queued ones can still be taken.
    pub(crate) fn close(&self) {
        self.queue().closed = true;
        self.shared.1.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use mortise_protocol::message::{WirePose, WireWrench};

    use super::*;

    fn sample(tick: u32) -> Event {
        let pose = WirePose {
            position: [0.0; 3],
            orientation: [0.0, 0.0, 0.0, 1.0],
        };
        Event::Telemetry(Box::new(Telemetry {
            tick,
            handle: pose,
            object: None,
            wrench: WireWrench::default(),
            contact: WireWrench::default(),
            hand: None,
            cost: 0,
            points: 0,
            flags: 0,
            missed: 0,
            dropped: 0,
            guidance: Default::default(),
            pairs: Default::default(),
        }))
    }

    #[test]
    fn telemetry_gives_way_to_faults() {
        let events = Events::default();
        let fault = Event::Fault {
            tick: 1,
            fault: Fault::OverSpeed,
        };
        events.push(fault.clone());
        for tick in 0..2 * MAX_EVENTS as u32 {
            events.push(sample(tick));
        }
        assert_eq!(events.dropped(), MAX_EVENTS as u64 + 1);
        let all: Vec<Event> = events.try_iter().collect();
        assert_eq!(all.len(), MAX_EVENTS);
        assert_eq!(all[0], fault);
        assert_eq!(all[MAX_EVENTS - 1], sample(2 * MAX_EVENTS as u32 - 1));
    }

    #[test]
    fn closing_ends_the_wait() {
        let events = Events::default();
        events.push(Event::LinkLost("cut".into()));
        events.close();
        assert_eq!(events.try_recv(), Ok(Event::LinkLost("cut".into())));
        assert_eq!(
            events.recv_timeout(Duration::from_secs(5)),
            Err(RecvTimeoutError::Disconnected)
        );
    }
}
