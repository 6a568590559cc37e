//! The heartbeat: keeps the link alive, and detects a dead link or a restarted board.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use mortise_protocol::message::ToDevice;

use crate::error::RigError;
use crate::exchange::started_anew;
use crate::link::Link;
use crate::real_time;

/// Interval of heartbeats: a fifth of the default host timeout of an armed board.
pub(crate) const HEARTBEAT: Duration = Duration::from_millis(100);
/// The interval for a counted board, whose virtual time runs ahead of the wall clock.
pub(crate) const HEARTBEAT_COUNTED: Duration = Duration::from_millis(5);

/// See the module's documentation.
pub(crate) struct Heartbeat {
    ending: Arc<(Mutex<bool>, Condvar)>,
    thread: Option<JoinHandle<()>>,
}

impl Heartbeat {
    pub(crate) fn start(
        link: Arc<Link>,
        name: &str,
        lockstep: Arc<AtomicBool>,
        period: Duration,
        silence: Duration,
    ) -> Result<Self, RigError> {
        let ending = Arc::new((Mutex::new(false), Condvar::new()));
        let thread = std::thread::Builder::new()
            .name("mortise-heartbeat".into())
            .spawn({
                let (ending, name) = (ending.clone(), name.to_owned());
                move || {
                    // While this thread waits for a busy computer, a board whose clock continues would stop its motors.
                    real_time::ask();
                    loop {
                        let ended = ending.0.lock().unwrap_or_else(PoisonError::into_inner);
                        let (ended, _) = ending
                            .1
                            .wait_timeout_while(ended, period, |ended| !*ended)
                            .unwrap_or_else(PoisonError::into_inner);
                        if *ended {
                            return;
                        }
                        drop(ended);
                        if link.has_started_anew() {
                            started_anew(&link, &name);
                            return;
                        }
                        // In lockstep the board waits for the host without limit.
                        if lockstep.load(Ordering::Relaxed) {
                            link.forgive_silence();
                            continue;
                        }
                        if link.silent_for() >= period && link.send(&ToDevice::Heartbeat).is_err() {
                            return;
                        }
                        let unheard = link.unheard_for();
                        if unheard > silence {
                            link.lose(&format!(
                                "nothing was received for {:.1} s",
                                unheard.as_secs_f64()
                            ));
                            return;
                        }
                    }
                }
            })
            .map_err(RigError::Thread)?;
        Ok(Self {
            ending,
            thread: Some(thread),
        })
    }
}

impl Drop for Heartbeat {
    fn drop(&mut self) {
        *self.ending.0.lock().unwrap_or_else(PoisonError::into_inner) = true;
        self.ending.1.notify_all();
        if let Some(thread) = self.thread.take() {
            // A panic there has no further information.
            let _ = thread.join();
        }
    }
}
