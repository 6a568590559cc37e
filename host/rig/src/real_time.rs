//! Real-time priority for the thread of the in-process rig and for the heartbeat, which reduces delays of ticks and heartbeats by other
//! programs.
//!
//! The lowest real-time priority: above every normal thread, below all other real-time threads. Linux and macOS: round robin by
//! `pthread_setschedparam`; Windows: time critical. Most systems grant it to some users only; a refusal is reported once per program run.

use std::sync::{Mutex, PoisonError};

/// A refusal not yet reported, and whether one was ever recorded.
static REFUSAL: Mutex<(Option<String>, bool)> = Mutex::new((None, false));

/// Requests it for the calling thread and records a refusal.
pub(crate) fn ask() {
    if let Err(error) = set() {
        let mut refusal = REFUSAL.lock().unwrap_or_else(PoisonError::into_inner);
        if !refusal.1 {
            let why = match error {
                thread_priority::Error::OS(code) => std::io::Error::from_raw_os_error(code).to_string(),
                other => other.to_string(),
            };
            *refusal = (Some(words(&why)), true);
        }
    }
}

/// The refusal as a sentence; `None` when there was none or it was reported before.
pub(crate) fn take_refusal() -> Option<String> {
    REFUSAL.lock().unwrap_or_else(PoisonError::into_inner).0.take()
}

fn words(why: &str) -> String {
    let how = if cfg!(target_os = "linux") {
        "; to allow it: `@realtime - rtprio 10` in /etc/security/limits.conf, your user in that group, log in again"
    } else {
        ""
    };
    format!(
        "this system grants no real-time priority to the simulated rig ({why}): while the computer is busy its ticks may be late{how}"
    )
}

#[cfg(unix)]
fn set() -> Result<(), thread_priority::Error> {
    use thread_priority::{
        RealtimeThreadSchedulePolicy, ThreadPriority, ThreadSchedulePolicy, set_thread_priority_and_policy,
        thread_native_id,
    };
    set_thread_priority_and_policy(
        thread_native_id(),
        ThreadPriority::Min,
        ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::RoundRobin),
    )
}

#[cfg(not(unix))]
fn set() -> Result<(), thread_priority::Error> {
    thread_priority::ThreadPriority::Max.set_for_current()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refusal_says_what_why_and_what_to_do() {
        let said = words("operation not permitted");
        assert!(
            said.contains("real-time priority") && said.contains("operation not permitted"),
            "{said}"
        );
        assert_eq!(said.contains("limits.conf"), cfg!(target_os = "linux"));
    }
}
