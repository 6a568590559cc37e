//! One message and its answer, and the greeting: number of attempts and waiting times of a client.

use std::time::{Duration, Instant};

use mortise_protocol::message::{Capabilities, FromDevice, Refusal, ToDevice, Version};

use crate::error::RigError;
use crate::link::{Answer, Link};
use crate::words::Words;

/// Waiting times of a client.
#[derive(Clone, Debug)]
pub struct Patience {
    /// Limit for the whole handshake.
    pub greeting: Duration,
    /// Limit for one answer. A message that may be repeated without harm is sent [`ATTEMPTS`] times.
    pub answer: Duration,
    /// Time without a valid frame, despite requests, after which the link is lost.
    pub silence: Duration,
}

impl Default for Patience {
    /// For a real board: a pseudo-terminal may hold its first bytes for a second, so the greeting waits well over two.
    fn default() -> Self {
        Self {
            greeting: Duration::from_secs(4),
            answer: Duration::from_secs(1),
            silence: Duration::from_secs(3),
        }
    }
}

impl Patience {
    /// For rigs on this computer: no data is lost, but a loaded computer makes them slow.
    pub fn long() -> Self {
        Self {
            greeting: Duration::from_secs(30),
            answer: Duration::from_secs(20),
            silence: Duration::from_secs(20),
        }
    }
}

/// Number of times a repeatable message is sent.
pub const ATTEMPTS: u32 = 3;
/// Number of times a message is sent after "the queue is full", which changes nothing on the board.
const BUSY_ATTEMPTS: u32 = 200;
const BUSY_PAUSE: Duration = Duration::from_millis(5);
/// Pause between two greetings.
const GREETING_PAUSE: Duration = Duration::from_millis(250);
/// Wait for the reason of a restart: a board that has just refused a message is able to answer.
const WHY_WAIT: Duration = Duration::from_secs(1);
/// Wait for flash: erasing a slot takes seconds on a real board; checking one takes less than an answer may.
const FLASH_WAIT: Duration = Duration::from_secs(15);
/// Wall time allowed per lockstep tick: an emulated board under load on a slow machine.
const TICK_WAIT: Duration = Duration::from_millis(20);

/// Whether sending the message twice has the same effect as sending it once.
fn repeatable(message: &ToDevice) -> bool {
    match message {
        ToDevice::Hello(_)
        | ToDevice::GetCapabilities
        | ToDevice::Disarm
        | ToDevice::Stop
        | ToDevice::Heartbeat
        | ToDevice::SetParameter { .. }
        | ToDevice::GetParameter(_)
        | ToDevice::Release
        | ToDevice::ResetScene
        | ToDevice::SceneBegin { .. }
        | ToDevice::SceneChunk { .. }
        | ToDevice::SceneAbort
        | ToDevice::SetRig(_)
        | ToDevice::GetRig
        | ToDevice::SetTarget(_)
        | ToDevice::ClearTarget { .. }
        | ToDevice::SetTelemetry { .. }
        | ToDevice::RecordInputs(_)
        | ToDevice::GetReadings
        | ToDevice::GetStatistics { reset: false }
        | ToDevice::Lockstep(_)
        | ToDevice::Place { .. } => true,
        ToDevice::Arm
        | ToDevice::ClearFault
        // The handle may have left its reference pose between the two.
        | ToDevice::Home
        | ToDevice::Grab { .. }
        | ToDevice::SceneCommit
        | ToDevice::GetStatistics { reset: true }
        | ToDevice::SimulatedHand(_)
        | ToDevice::SimulatedInputs(_)
        | ToDevice::Run { .. }
        | ToDevice::Restart
        | ToDevice::TestMotor { .. } => false,
    }
}

/// Whether the message brings the motors closer to being driven, so that it must not outlive the state on which the operator decided.
fn rearms(message: &ToDevice) -> bool {
    matches!(
        message,
        ToDevice::Arm
            | ToDevice::ClearFault
            | ToDevice::Home
            | ToDevice::Grab { .. }
            | ToDevice::TestMotor { .. }
    )
}

pub(crate) fn patience_for(message: &ToDevice, patience: &Patience) -> Duration {
    match message {
        ToDevice::SceneBegin { .. } | ToDevice::SetRig(_) => patience.answer.max(FLASH_WAIT),
        ToDevice::Run { ticks } => patience.answer + TICK_WAIT.saturating_mul(*ticks),
        _ => patience.answer,
    }
}

pub(crate) fn no_answer(message: &ToDevice, after: Duration) -> RigError {
    RigError::Timeout {
        what: message.words(),
        after_ms: after.as_millis() as u64,
    }
}

/// Sends until answered, as often as the message allows.
pub(crate) fn obtain(link: &Link, message: &ToDevice, patience: &Patience) -> Result<Answer, RigError> {
    let wait = patience_for(message, patience);
    let attempts = if repeatable(message) { ATTEMPTS } else { 1 };
    let mut busy = 0;
    let mut outdated = 0;
    let decided = link.halts();
    'anew: loop {
        let ticket = link.post(message)?;
        for attempt in 0..attempts {
            if attempt > 0 {
                ticket.resend(message)?;
            }
            match ticket.wait(wait)? {
                Some(Answer::Refused(Refusal::Busy)) if busy < BUSY_ATTEMPTS => {
                    busy += 1;
                    std::thread::sleep(BUSY_PAUSE);
                    // After a stop or a fault the operator must decide again.
                    if rearms(message) && link.halts() != decided {
                        return Err(RigError::Refused {
                            what: message.words(),
                            reason: Refusal::Outdated,
                        });
                    }
                    continue 'anew;
                }
                // Another thread's message overtook it on the way; nothing was changed.
                Some(Answer::Refused(Refusal::Outdated)) if outdated + 1 < attempts => {
                    outdated += 1;
                    continue 'anew;
                }
                Some(Answer::Refused(reason)) => {
                    return Err(RigError::Refused {
                        what: message.words(),
                        reason,
                    });
                }
                Some(answer) => return Ok(answer),
                None => {}
            }
        }
        return Err(no_answer(message, wait * attempts));
    }
}

/// Greets the board until it answers, then reads its capabilities.
pub(crate) fn greet(link: &Link, name: &str, patience: &Patience) -> Result<Capabilities, RigError> {
    let begun = Instant::now();
    let hello = ToDevice::Hello(Version::own());
    let silent = || {
        RigError::NoAnswer {
        rig: name.to_owned(),
        waited_s: begun.elapsed().as_secs_f64(),
        hint: "check that the board runs Mortise's firmware, that its cable carries data, and that this is the right port".into(),
    }
    };
    loop {
        // Terminates any incomplete frame on the wire.
        link.write_raw(&[])?;
        let ticket = link.post(&hello)?;
        if let Some(Answer::Value(value)) = ticket.wait(GREETING_PAUSE)?
            && let FromDevice::Hello(device) = *value
        {
            let host = Version::own();
            if device.schema != host.schema {
                return Err(RigError::VersionMismatch { host, device });
            }
            let seq = ticket.seq();
            drop(ticket);
            match obtain(link, &ToDevice::GetCapabilities, patience) {
                Ok(Answer::Value(value)) => {
                    if let FromDevice::Capabilities(capabilities) = *value {
                        link.begin_session(capabilities.session);
                        link.set_greeted(seq);
                        return Ok(capabilities);
                    }
                }
                // The answer came from before a restart: greet once more.
                Err(RigError::Refused {
                    reason: Refusal::NotGreeted,
                    ..
                }) => {}
                Err(error) => return Err(error),
                Ok(_) => {}
            }
        }
        if begun.elapsed() > patience.greeting {
            return Err(silent());
        }
    }
}

/// Ends the link to a board that has restarted, with the board's reason: it has lost parameters, targets and the held part, so this program's
/// assumptions about it are invalid.
pub(crate) fn started_anew(link: &Link, name: &str) -> RigError {
    let patience = Patience {
        greeting: WHY_WAIT,
        answer: WHY_WAIT,
        silence: WHY_WAIT,
    };
    let why = match greet(link, name, &patience) {
        Ok(capabilities) => capabilities.reset.words(),
        Err(error) => error.to_string(),
    };
    let why = format!("the board has restarted: {why}");
    link.lose(&why);
    // Another thread may have reported a loss before, or the cable may be unplugged: the first reason stays.
    link.check().err().unwrap_or(RigError::LinkLost { why })
}
