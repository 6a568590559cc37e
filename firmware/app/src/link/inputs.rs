//! Sends the inputs of ticks that the control plane has queued for a recording.

use heapless::Vec;
use mortise_protocol::limits::MAX_TICKS;
use mortise_protocol::message::{FromDevice, Inputs, TickInput};

use super::LinkPlane;
use crate::board::{Flash, Outbound};
use crate::channel::Recorded;

impl<'s, F: Flash<'s>> LinkPlane<'_, 's, F> {
    /// Sends the inputs of up to [`MAX_TICKS`] consecutive ticks in one message if at least `least` are queued; returns how many. The caller has checked
    /// that there is space for a frame.
    pub(super) fn send_inputs(&mut self, least: usize, out: &mut impl Outbound) -> usize {
        if self.ends.recorded.len() < least {
            return 0;
        }
        let Some(first) = self.next_recorded() else {
            return 0;
        };
        let mut ticks: Vec<TickInput, MAX_TICKS> = [first.input].into_iter().collect();
        while !ticks.is_full()
            && let Some(next) = self.ends.recorded.peek().copied()
            && follows(&first, ticks.len(), &next)
        {
            let _ = self.ends.recorded.dequeue();
            // Space was checked above.
            let _ = ticks.push(next.input);
        }
        let sent = ticks.len();
        let inputs = Inputs {
            first_tick: first.tick,
            count: first.count,
            lost: first.lost,
            ticks,
        };
        self.send(&FromDevice::Inputs(inputs), out);
        sent
    }

    /// The next queued tick of this session; those of an earlier one are dropped.
    fn next_recorded(&mut self) -> Option<Recorded> {
        while let Some(recorded) = self.ends.recorded.dequeue() {
            if self.greeted && recorded.session == self.session {
                return Some(recorded);
            }
        }
        None
    }
}

/// Whether `next` belongs in the message that begins with `first` and already has `length` ticks.
fn follows(first: &Recorded, length: usize, next: &Recorded) -> bool {
    next.session == first.session
        && next.tick == first.tick.wrapping_add(length as u32)
        && next.lost == first.lost
        && next.count == first.count
}
