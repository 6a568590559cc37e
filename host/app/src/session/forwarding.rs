//! The board's events on their way to the window, and which of them wake it.

use std::sync::mpsc::RecvTimeoutError;
use std::time::Duration;

use mortise_protocol::message::DeviceState;
use mortise_rig::{Event, Events};

use super::outbox::{LinkUpdate, Outbox, Update};
use super::tap::Tap;

/// Motion of the handle that is redrawn at once, m: one digit of the displayed position.
const MOVED_M: f32 = 1e-4;

/// Whether the handle has moved from where it was drawn last, which is then where it is now.
fn moves(drawn: &mut [f32; 3], position: [f32; 3]) -> bool {
    let moved = (position.iter().zip(*drawn)).any(|(now, then)| (now - then).abs() >= MOVED_M);
    if moved {
        *drawn = position;
    }
    moved
}

/// Whether the motors may exert force, in which case every sample is redrawn.
fn is_live(state: DeviceState) -> bool {
    matches!(
        state,
        DeviceState::Armed | DeviceState::Active | DeviceState::SoftStop | DeviceState::Testing
    )
}

/// Forwards events until there are no more.
///
/// While the motors are off and the handle rests, samples change little on screen, so that none wakes the window: drawing each would keep a core busy on a
/// computer without a graphics card. It takes them in when it draws next. Loop overruns do not wake it either: there each picture causes some.
pub(super) fn pass_on(outbox: &Outbox, id: u64, events: &Events, tap: &Tap, state: DeviceState) {
    let mut live = is_live(state);
    let mut drawn = [0.0; 3];
    loop {
        match events.recv_timeout(Duration::from_secs(1)) {
            Ok(event) => {
                let wakes = match &event {
                    Event::Telemetry(sample) => {
                        tap.offer(sample);
                        moves(&mut drawn, sample.handle.position) || live
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_handle_has_moved_once_it_is_a_digit_from_where_it_was_drawn() {
        let mut drawn = [0.0; 3];
        assert!(!moves(&mut drawn, [0.0, 0.5 * MOVED_M, 0.0]));
        assert!(!moves(&mut drawn, [0.0, 0.9 * MOVED_M, 0.0]));
        assert!(moves(&mut drawn, [0.0, 1.5 * MOVED_M, 0.0]));
        assert!(!moves(&mut drawn, [0.0, 1.5 * MOVED_M, 0.0]));
        assert!(moves(&mut drawn, [0.0, 0.0, 0.0]));
    }
}
