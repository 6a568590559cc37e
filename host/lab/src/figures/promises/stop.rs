//! STOP behind everything else: the output full, the host not reading, and commands queued ahead of it.
//!
//! Uses the in-process rig and the emulated board's serial line, both in lockstep through raw bytes, so that ticks are counted. The host reads nothing
//! while telemetry nearly fills the line; then one write releases more ticks, sends 200 requests whose answers have no space, and ends in STOP. Only
//! then does the host read. The emulated board takes a byte at a time and would run those ticks while the requests arrive: there they are released after
//! STOP, when the host reads.

use std::io::{self, Read as _, Write as _};
use std::time::{Duration, Instant};

use mortise_protocol::frame::{Decoder, Stamp, encode_stamped};
use mortise_protocol::limits::MAX_FRAME;
use mortise_protocol::message::{
    FromDevice, HandScript, Keyframe, Statistics, Telemetry, ToDevice, Version, WirePose,
};
use mortise_rig::{
    Client, Flash, PIPE_CAPACITY, Patience, RigError, Transport, emulate, emulator_available, simulate,
};
use mortise_scenario::{PreparedScene, Scenario};

use crate::LabError;
use crate::figures::{Plan, Row};

/// Commands ahead of STOP.
const COMMANDS: usize = 200;
/// Ticks released before STOP and not yet run.
const RELEASED: u32 = 50;
/// Share of the line that telemetry fills before.
const FILLED: f64 = 0.95;
/// Bytes that the emulated board's line holds while nobody reads: 8,192 in the board, and in a pseudo-terminal of Linux 4,096 or 16 times as many. The
/// first with which the ticks before STOP ran and the output was full is the line's.
const SERIAL_CAPACITIES: [usize; 3] = [12_288, 24_576, 73_728];
/// Time limit of actions that take milliseconds: only a hang reaches it.
const PATIENCE: Duration = Duration::from_secs(20);
/// Time for the board to run all released ticks and to read everything written.
const PAUSE: Duration = Duration::from_millis(500);

/// Measures the row.
///
/// # Errors
/// Anything that prevents the scene from being baked or the board from answering.
pub fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let ticks = ticks_until_off(plan, true)?;
    out(Row::exactly(
        format!(
            "STOP to motors off, output full, host not reading, {COMMANDS} commands and {RELEASED} released ticks before it, in-process in lockstep (infinite: never)"
        ),
        ticks,
        "ticks",
        1.0,
    ));
    let emulated = format!(
        "STOP to motors off, output full, host not reading, {COMMANDS} commands before it, through the emulated board's serial line in lockstep (infinite: never)"
    );
    out(match emulator_available(None) {
        Ok(()) => Row::exactly(emulated, emulated_ticks_until_off(plan, true)?, "ticks", 1.0),
        Err(why) => Row::skipped(emulated, &why),
    });
    Ok(())
}

/// Ticks from the one in which the board has read STOP to the first without a wrench; without `stop`, the same sequence with no STOP at the end. NaN
/// when the output was not full, or the motors were not driven before.
///
/// # Errors
/// As [`measure`].
pub fn ticks_until_off(plan: &Plan<'_>, stop: bool) -> Result<f64, LabError> {
    let scenario = Scenario::insertion(plan.pair)?;
    let scene = PreparedScene::of(&scenario)?;
    let flash = Flash::default();
    let client = Client::over(simulate(&flash, false)?, "sim-fast", Patience::long(), None)?;
    client.upload(&scene.image, &mut |_| {})?;
    drop(client);
    run(
        simulate(&flash, false)?,
        PIPE_CAPACITY,
        Released::First,
        scene.part,
        stop,
    )
    .map_err(lost)
}

/// As [`ticks_until_off`], through the emulated board's serial line.
///
/// # Errors
/// As [`measure`].
pub fn emulated_ticks_until_off(plan: &Plan<'_>, stop: bool) -> Result<f64, LabError> {
    let scenario = Scenario::insertion(plan.pair)?;
    let scene = PreparedScene::of(&scenario)?;
    let mut ticks = f64::NAN;
    for capacity in SERIAL_CAPACITIES {
        ticks = run(emulate(&scene.image)?, capacity, Released::Last, scene.part, stop).map_err(lost)?;
        if !ticks.is_nan() {
            break;
        }
    }
    Ok(ticks)
}

fn lost(error: io::Error) -> LabError {
    let why = error.to_string();
    RigError::LinkLost { why }.into()
}

/// When ticks are released: before the commands, or after STOP.
#[derive(Clone, Copy, PartialEq)]
enum Released {
    First,
    Last,
}

/// Plays the sequence on a board whose line holds `capacity` bytes.
fn run(board: Transport, capacity: usize, released: Released, part: u16, stop: bool) -> io::Result<f64> {
    let mut host = Host::greeted(board)?;
    for message in [
        ToDevice::Lockstep(true),
        ToDevice::SetTelemetry { every_ticks: 1 },
    ] {
        host.done(&message)?;
    }
    let seen = host.ticks(1)?;
    let Some(handle) = seen.telemetry.last().map(|sample| sample.handle) else {
        return Ok(f64::NAN);
    };
    for message in [
        ToDevice::Arm,
        ToDevice::Grab { part },
        ToDevice::SimulatedHand(trembling(handle)),
    ] {
        host.done(&message)?;
    }
    // After the ramp that follows arming.
    let seen = host.ticks(1_000)?;
    let bytes_a_tick = seen.bytes as f64 / 1_000.0;
    let filling = (FILLED * capacity as f64 / bytes_a_tick) as u32;
    host.send(&ToDevice::Run { ticks: filling })?;
    std::thread::sleep(PAUSE);

    let mut burst = match released {
        Released::First => host.frame(&ToDevice::Run { ticks: RELEASED })?,
        Released::Last => Vec::new(),
    };
    // Most of them have long answers, so that the output is full before the last.
    let messages = [
        match released {
            // Waits for the ticks.
            Released::First => ToDevice::Release,
            Released::Last => ToDevice::GetCapabilities,
        },
        ToDevice::GetCapabilities,
        ToDevice::GetCapabilities,
        ToDevice::Arm,
        ToDevice::GetCapabilities,
        ToDevice::GetCapabilities,
        ToDevice::GetRig,
        ToDevice::GetCapabilities,
    ];
    for index in 0..COMMANDS {
        burst.extend(host.frame(&messages[index % messages.len()])?);
    }
    if stop {
        burst.extend(host.frame(&ToDevice::Stop)?);
    }
    host.writer.write_all(&burst)?;
    std::thread::sleep(PAUSE);

    let all = (filling + RELEASED) as usize;
    let seen = match released {
        Released::First => host.until(|seen| seen.ran.len() == 2 && seen.telemetry.len() >= all)?,
        Released::Last => {
            let mut seen = host.ticks_seen(filling)?;
            // While answers wait on the board, it would drop the next message.
            host.until_quiet()?;
            let after = host.ticks(RELEASED)?;
            seen.ran.extend(after.ran);
            seen.telemetry.extend(after.telemetry);
            seen
        }
    };
    let Statistics { unanswered, .. } = host.statistics()?;
    let before = seen.ran[0];
    let driven = |sample: &&Telemetry| {
        let wrench = &sample.wrench;
        wrench.force.iter().chain(&wrench.torque).any(|part| *part != 0.0)
    };
    let mut earlier = seen.telemetry.iter().filter(|sample| sample.tick <= before);
    let facts = [
        ("commands found the output full", unanswered > 0),
        (
            "motors were driven until then",
            earlier.all(|sample| driven(&sample)),
        ),
        ("every tick was reported", seen.telemetry.len() == all),
        ("the released ticks ran", seen.ran[1] == before + RELEASED),
    ];
    let missing: Vec<&str> = facts
        .iter()
        .filter(|(_, so)| !so)
        .map(|(fact, _)| *fact)
        .collect();
    if !missing.is_empty() {
        eprintln!(
            "STOP behind a line of {capacity} bytes: not so: {}",
            missing.join(", ")
        );
    }
    let sound = missing.is_empty();
    let last_driven = seen
        .telemetry
        .iter()
        .filter(driven)
        .map(|sample| sample.tick)
        .max();
    Ok(match last_driven {
        // A tick of the first run without a wrench: it had not ended when STOP was read.
        Some(last) if sound && last < before => f64::NAN,
        Some(last) if sound && last < before + RELEASED => f64::from(last - before + 1),
        Some(_) if sound => f64::INFINITY,
        _ => f64::NAN,
    })
}

/// A hand that pushes and trembles all the time, so that the motors are driven in every tick.
fn trembling(pose: WirePose) -> HandScript {
    HandScript {
        stiffness: 400.0,
        damping: 4.0,
        angular_stiffness: 2.0,
        angular_damping: 0.02,
        tremor: 2e-4,
        tremor_hz: 9.0,
        keyframes: [Keyframe {
            tick: 0,
            pose,
            push: [0.0, 0.0, -1.0],
        }]
        .into_iter()
        .collect(),
    }
}

/// A host that reads and writes raw bytes.
struct Host {
    reader: Box<dyn io::Read + Send>,
    writer: Box<dyn io::Write + Send>,
    /// Dropped after both.
    _keep: Option<Box<dyn Send + Sync>>,
    decoder: Decoder,
    sequence: u16,
    session: Option<u32>,
}

/// Messages received from the board.
#[derive(Default)]
struct Seen {
    bytes: usize,
    telemetry: Vec<Telemetry>,
    /// Ticks since start, as reported at the end of each run.
    ran: Vec<u32>,
    /// All other messages.
    others: Vec<FromDevice>,
}

impl Host {
    fn greeted(board: Transport) -> io::Result<Self> {
        let Transport { reader, writer, keep } = board;
        let mut host = Self {
            reader,
            writer,
            _keep: keep,
            decoder: Decoder::new(),
            sequence: 0,
            session: None,
        };
        host.send(&ToDevice::Hello(Version::own()))?;
        host.send(&ToDevice::GetCapabilities)?;
        let session = |seen: &Seen| {
            seen.others.iter().find_map(|message| match message {
                FromDevice::Capabilities(capabilities) => Some(capabilities.session),
                _ => None,
            })
        };
        host.session = session(&host.until(|seen| session(seen).is_some())?);
        Ok(host)
    }

    fn frame(&mut self, message: &ToDevice) -> io::Result<Vec<u8>> {
        self.sequence = self.sequence.wrapping_add(1);
        let stamp = self.session.map(|session| Stamp {
            session,
            count: u32::from(self.sequence),
        });
        let mut frame = [0; MAX_FRAME];
        let bytes = encode_stamped(self.sequence, stamp, message, &mut frame);
        Ok(bytes
            .map_err(|_| io::Error::other("a message is too large"))?
            .to_vec())
    }

    fn send(&mut self, message: &ToDevice) -> io::Result<()> {
        let frame = self.frame(message)?;
        self.writer.write_all(&frame)
    }

    /// Sends the message and waits until it is done.
    fn done(&mut self, message: &ToDevice) -> io::Result<()> {
        self.send(message)?;
        let asked = self.sequence;
        let answer = |said: &FromDevice| match said {
            FromDevice::Ack { seq } if *seq == asked => Some(Ok(())),
            FromDevice::Refused { seq, reason } if *seq == asked => {
                Some(Err(io::Error::other(format!("refused: {reason:?}"))))
            }
            _ => None,
        };
        let seen = self.until(|seen| seen.others.iter().any(|said| answer(said).is_some()))?;
        seen.others.iter().find_map(answer).unwrap_or(Ok(()))
    }

    /// Lets this many ticks run, and reads all of their telemetry.
    fn ticks(&mut self, ticks: u32) -> io::Result<Seen> {
        self.send(&ToDevice::Run { ticks })?;
        self.ticks_seen(ticks)
    }

    /// Reads until this many ticks have run.
    fn ticks_seen(&mut self, ticks: u32) -> io::Result<Seen> {
        // The last sample may follow the answer to the run.
        self.until(|seen| !seen.ran.is_empty() && seen.telemetry.len() >= ticks as usize)
    }

    /// Reads until nothing arrives for [`PAUSE`].
    fn until_quiet(&mut self) -> io::Result<()> {
        let begun = Instant::now();
        let mut last = begun;
        while last.elapsed() < PAUSE && begun.elapsed() < PATIENCE {
            let seen = self.until(|seen| seen.bytes > 0 || last.elapsed() >= PAUSE)?;
            if seen.bytes > 0 {
                last = Instant::now();
            }
        }
        Ok(())
    }

    fn statistics(&mut self) -> io::Result<Statistics> {
        self.send(&ToDevice::GetStatistics { reset: false })?;
        let reported = |seen: &Seen| {
            seen.others.iter().find_map(|message| match message {
                FromDevice::Statistics(statistics) => Some(*statistics),
                _ => None,
            })
        };
        let seen = self.until(|seen| reported(seen).is_some())?;
        Ok(reported(&seen).unwrap_or_default())
    }

    fn until(&mut self, done: impl Fn(&Seen) -> bool) -> io::Result<Seen> {
        let begun = Instant::now();
        let (mut seen, mut bytes) = (Seen::default(), [0; 4096]);
        while !done(&seen) {
            if begun.elapsed() > PATIENCE {
                return Err(io::ErrorKind::TimedOut.into());
            }
            let count = match self.reader.read(&mut bytes) {
                Ok(0) => return Err(io::ErrorKind::BrokenPipe.into()),
                Ok(count) => count,
                Err(error) if matches!(error.kind(), io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock) => {
                    0
                }
                Err(error) => return Err(error),
            };
            seen.bytes += count;
            for &byte in &bytes[..count] {
                match self.decoder.push::<FromDevice>(byte) {
                    Some(Ok((_, FromDevice::Telemetry(sample)))) => seen.telemetry.push(sample),
                    Some(Ok((_, FromDevice::Ran { tick, .. }))) => seen.ran.push(tick),
                    Some(Ok((_, other))) => seen.others.push(other),
                    Some(Err(_)) => return Err(io::ErrorKind::InvalidData.into()),
                    None => {}
                }
            }
        }
        Ok(seen)
    }
}
