//! The board's events on their way to the window, and which of them wake it.

use std::sync::mpsc::RecvTimeoutError;
use std::time::{Duration, Instant};

use mortise_protocol::message::DeviceState;
use mortise_rig::{Event, Events};

use super::history::OVERRUN_SPAN_S;
use super::outbox::{LinkUpdate, Outbox, Update};
use super::tap::Tap;

/// Motion of the handle that is redrawn at once, m: one digit of the displayed position.
const MOVED_M: f32 = 1e-4;

/// Whether the motors may exert force, in which case every sample is redrawn.
fn is_live(state: DeviceState) -> bool {
    matches!(
        state,
        DeviceState::Armed | DeviceState::Active | DeviceState::SoftStop | DeviceState::Testing
    )
}

/// Forwards events until there are no more.
///
/// While the motors are off and the handle rests, samples change little on screen, so that most do not wake the window: drawing each would keep a core
/// busy on a computer without a graphics card. It takes them in when it draws next.
pub(super) fn pass_on(outbox: &Outbox, id: u64, events: &Events, tap: &Tap, state: DeviceState) {
    let mut live = is_live(state);
    let mut seen = Seen::default();
    loop {
        match events.recv_timeout(Duration::from_secs(1)) {
            Ok(event) => {
                let wakes = match &event {
                    Event::Telemetry(sample) => {
                        tap.offer(sample);
                        seen.differs(sample.handle.position, sample.missed, live, Instant::now())
                    }
                    Event::State { state, .. } => {
                        live = is_live(*state);
                        true
                    }
                    _ => true,
                };
                let update = LinkUpdate::Event(event);
                let update = Update::Link { id, update };
                let heard = if wakes {
                    outbox.send(update)
                } else {
                    outbox.send_quietly(update)
                };
                if !heard {
                    return;
                }
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return,
        }
    }
}

/// What the window knows of a resting rig: the newest sample that woke it.
#[derive(Default)]
struct Seen {
    position: [f32; 3],
    missed: u32,
    at: Option<Instant>,
}

impl Seen {
    /// Whether a sample wakes the window: always while the motors are `live`; else if the handle moved, or loops overran and the window was not woken
    /// within the span in which they are counted: on a busy computer each redraw causes overruns.
    fn differs(&mut self, position: [f32; 3], missed: u32, live: bool, now: Instant) -> bool {
        let moved = (position.iter().zip(self.position)).any(|(now, then)| (now - then).abs() >= MOVED_M);
        let span = Duration::from_secs_f64(OVERRUN_SPAN_S);
        let rested = self.at.is_none_or(|at| now.duration_since(at) >= span);
        let wakes = live || moved || (missed != self.missed && rested);
        if wakes {
            *self = Self {
                position,
                missed,
                at: Some(now),
            };
        }
        wakes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_resting_rig_wakes_the_window_by_motion_and_by_overruns_at_intervals() {
        let begun = Instant::now();
        let at = |seconds: f64| begun + Duration::from_secs_f64(seconds);
        let mut seen = Seen::default();
        let mut differs =
            |x: f32, missed, live, seconds| seen.differs([x, 0.0, 0.0], missed, live, at(seconds));
        assert!(!differs(0.0, 0, false, 0.0));
        assert!(!differs(0.5 * MOVED_M, 0, false, 1.0));
        assert!(differs(1.5 * MOVED_M, 0, false, 2.0));
        assert!(!differs(1.5 * MOVED_M, 1, false, 3.0));
        assert!(differs(1.5 * MOVED_M, 2, false, 2.1 + OVERRUN_SPAN_S));
        assert!(!differs(1.5 * MOVED_M, 2, false, 60.0));
        assert!(differs(1.5 * MOVED_M, 2, true, 60.0));
    }
}
