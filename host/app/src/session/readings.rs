//! Reading encoders and inputs of a board at intervals, beside the window's thread.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Weak};
use std::time::Duration;

use mortise_protocol::message::Readings;
use mortise_rig::{Client, RigError};

use super::outbox::{LinkUpdate, Outbox, Update};
use super::threads::spawn;

/// Time between two readings.
const INTERVAL: Duration = Duration::from_millis(40);

/// Reads until it is dropped, or the link is lost.
pub struct ReadingsWatch(Arc<AtomicBool>);

impl ReadingsWatch {
    /// Starts reading from the client of connection `id`. Only readings that differ from those before wake the window.
    pub(super) fn begin(client: Weak<Client>, outbox: Outbox, id: u64) -> Self {
        let ended = Arc::new(AtomicBool::new(false));
        let watch = Self(Arc::clone(&ended));
        spawn("mortise-readings", move || {
            let mut last = None;
            while !ended.load(Ordering::Relaxed) {
                let Some(found) = client.upgrade().map(|client| client.readings()) else {
                    return;
                };
                match found {
                    Ok(readings) => {
                        let update = Update::Link {
                            id,
                            update: LinkUpdate::Readings(readings),
                        };
                        let seen = Some(at_any_time(readings));
                        let heard = match seen == last {
                            true => outbox.send_quietly(update),
                            false => outbox.send(update),
                        };
                        last = seen;
                        if !heard {
                            return;
                        }
                    }
                    Err(RigError::LinkLost { .. }) => return,
                    // As while the board starts again.
                    Err(_) => {}
                }
                std::thread::sleep(INTERVAL);
            }
        });
        watch
    }
}

impl Drop for ReadingsWatch {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// Readings without their time.
fn at_any_time(readings: Readings) -> Readings {
    Readings { tick: 0, ..readings }
}
