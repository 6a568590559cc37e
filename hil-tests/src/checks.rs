//! Checks that hold for every rig and scene. Each takes a connection and leaves the board idle.
//!
//! A check returns a one-line observation, or what is wrong.

use std::time::{Duration, Instant};

use mortise_protocol::image::CRC;
use mortise_protocol::limits::MAX_CHUNK;
use mortise_protocol::message::{CostUnit, DeviceState, Refusal, ToDevice, Version, WirePose};
use mortise_protocol::parameter::PARAMETERS;
use mortise_rig::{Client, Event, RigError, begin_message, chunk_message};

use crate::described::descriptions_are_kept_and_driven;
use crate::image;
use crate::motors::motors_are_tested_one_by_one;
use crate::verdict::Verdict;

/// A check with its name.
pub type Check = (&'static str, fn(Client) -> Verdict);

/// All checks.
pub const CHECKS: &[Check] = &[
    ("parameters_keep_their_ranges", parameters_keep_their_ranges),
    ("bad_scenes_are_refused", bad_scenes_are_refused),
    ("cut_uploads_leave_the_old_scene", cut_uploads_leave_the_old_scene),
    ("garbage_does_no_harm", garbage_does_no_harm),
    ("another_version_is_shut_out", another_version_is_shut_out),
    ("stop_stops", stop_stops),
    ("placing_is_refused_in_its_order", placing_is_refused_in_its_order),
    ("idle_ticks_are_on_time", idle_ticks_are_on_time),
    ("the_log_is_readable", the_log_is_readable),
    (
        "descriptions_are_kept_and_driven",
        descriptions_are_kept_and_driven,
    ),
    ("motors_are_tested_one_by_one", motors_are_tested_one_by_one),
];

fn fine<T>(result: Result<T, RigError>) -> Result<T, String> {
    result.map_err(|error| error.to_string())
}

fn refused(result: Result<(), RigError>, what: &str) -> Result<Refusal, String> {
    match result {
        Ok(()) => Err(format!("{what} was accepted")),
        Err(RigError::Refused { reason, .. }) => Ok(reason),
        Err(other) => Err(format!("{what}: {other}")),
    }
}

fn ensure(holds: bool, otherwise: impl FnOnce() -> String) -> Result<(), String> {
    if holds { Ok(()) } else { Err(otherwise()) }
}

/// Every parameter has its default, accepts its bounds, and refuses values beyond them, stating the range.
pub fn parameters_keep_their_ranges(client: Client) -> Verdict {
    for row in PARAMETERS {
        let id = row.id;
        let before = fine(client.parameter(id))?;
        for value in [row.min, row.max, before] {
            fine(client.request(ToDevice::SetParameter { id, value }))?;
            let found = fine(client.parameter(id))?;
            ensure(found == value, || {
                format!("{} is {found} after setting {value}", row.name)
            })?;
        }
        for value in [
            row.max * 1.01 + 1.0,
            row.min - 1.0,
            f32::NAN,
            f32::INFINITY,
            f32::NEG_INFINITY,
        ] {
            let reason = refused(
                client.request(ToDevice::SetParameter { id, value }),
                &format!("{} = {value}", row.name),
            )?;
            let expected = Refusal::OutOfRange {
                id,
                min: row.min,
                max: row.max,
            };
            ensure(reason == expected, || {
                format!("{} = {value}: {reason:?}", row.name)
            })?;
        }
        let found = fine(client.parameter(id))?;
        ensure(found == before, || {
            format!("{} is {found}, not {before}", row.name)
        })?;
    }
    Ok(format!("{} parameters", PARAMETERS.len()))
}

fn scene(client: &Client) -> Result<Option<u32>, String> {
    Ok(fine(client.refresh_capabilities())?.scene)
}

/// Scenes of another layout, damaged, too large, or incomplete: each is refused with its reason, and the scene in use stays.
pub fn bad_scenes_are_refused(client: Client) -> Verdict {
    let good = image(3000, 1);
    fine(client.upload(&good, &mut |_| {}))?;
    let in_use = Some(CRC.checksum(&good));
    let mut damaged = image(3000, 2);
    damaged[1500] ^= 4;
    let mut layout = image(3000, 3);
    layout[8] = layout[8].wrapping_add(1);
    let reason = refused(client.upload(&damaged, &mut |_| {}), "a damaged scene")?;
    ensure(matches!(reason, Refusal::SceneImage(_)), || {
        format!("damaged: {reason:?}")
    })?;
    let reason = refused(client.upload(&layout, &mut |_| {}), "a scene of another layout")?;
    ensure(matches!(reason, Refusal::SceneImage(_)), || {
        format!("layout: {reason:?}")
    })?;
    let capacity = client.capabilities().scene_capacity;
    let begin = |length, crc, layout| client.request(ToDevice::SceneBegin { length, crc, layout });
    let own = client.capabilities().scene_layout;
    let reason = refused(begin(capacity + 1, 0, own), "a scene too large")?;
    ensure(reason == Refusal::SceneTooLarge { capacity }, || {
        format!("too large: {reason:?}")
    })?;
    fine(begin(1000, 7, own))?;
    fine(client.request(chunk_message(&good, 0)))?;
    let reason = refused(client.request(ToDevice::SceneCommit), "an incomplete scene")?;
    ensure(matches!(reason, Refusal::SceneIncomplete { .. }), || {
        format!("incomplete: {reason:?}")
    })?;
    // Discard the incomplete upload, if there is one.
    let _ = client.request(ToDevice::SceneAbort);
    let found = scene(&client)?;
    ensure(found == in_use, || {
        format!("the scene in use is {found:x?}, not {in_use:x?}")
    })?;
    Ok("layout, damaged, too large, incomplete".into())
}

/// An upload interrupted by a restart after some chunks: the old scene is still in use. (Power loss at every boundary: `host/rig` tests.)
pub fn cut_uploads_leave_the_old_scene(client: Client) -> Verdict {
    let (old, new) = (image(4 * MAX_CHUNK + 12, 4), image(6 * MAX_CHUNK + 100, 5));
    fine(client.upload(&old, &mut |_| {}))?;
    let in_use = Some(CRC.checksum(&old));
    let chunks = new.len().div_ceil(MAX_CHUNK);
    let mut client = client;
    for cut in 0..=chunks {
        fine(client.request(fine(begin_message(&new))?))?;
        for chunk in 0..cut {
            fine(client.request(chunk_message(&new, chunk * MAX_CHUNK)))?;
        }
        client = fine(client.restart())?;
        let found = client.capabilities().scene;
        ensure(found == in_use, || {
            format!("cut after {cut} chunks: scene {found:x?}, not {in_use:x?}")
        })?;
    }
    fine(client.upload(&new, &mut |_| {}))?;
    client = fine(client.restart())?;
    let found = client.capabilities().scene;
    ensure(found == Some(CRC.checksum(&new)), || {
        format!("committed, but scene {found:x?}")
    })?;
    Ok(format!("{} cuts", chunks + 1))
}

/// Invalid bytes, and frames with flipped bits, change nothing; the next message is answered.
pub fn garbage_does_no_harm(client: Client) -> Verdict {
    const PIECES: u64 = 200;
    let before = fine(client.statistics(false))?.bad_frames;
    let mut seed = 0x9e37_79b9_7f4a_7c15u64;
    for piece in 0..PIECES {
        let bytes: Vec<u8> = (0..(piece % 40) + 1)
            .map(|_| {
                seed ^= seed << 13;
                seed ^= seed >> 7;
                seed ^= seed << 17;
                // No delimiters inside: one bad frame per piece.
                (seed as u8).max(1)
            })
            .collect();
        fine(client.send_garbage(&bytes))?;
    }
    fine(client.request(ToDevice::Heartbeat))?;
    let bad = fine(client.statistics(false))?.bad_frames - before;
    ensure(u64::from(bad) == PIECES, || {
        format!("{bad} of {PIECES} pieces counted as bad frames")
    })?;
    Ok(format!("{bad} pieces thrown away"))
}

/// A host of another version receives the board's version; after that no command of its is carried out but STOP.
pub fn another_version_is_shut_out(client: Client) -> Verdict {
    let own = Version::own();
    let other = Version {
        schema: own.schema ^ 1,
        ..own
    };
    fine(client.request(ToDevice::Hello(other)))?;
    for message in [
        ToDevice::Arm,
        ToDevice::SetTelemetry { every_ticks: 1 },
        ToDevice::SceneCommit,
    ] {
        let reason = refused(client.request(message.clone()), &format!("{message:?}"))?;
        ensure(reason == Refusal::NotGreeted, || {
            format!("{message:?}: {reason:?}")
        })?;
    }
    fine(client.request(ToDevice::Hello(own)))?;
    fine(client.request(ToDevice::Heartbeat))?;
    Ok("refused until greeted by its own version".into())
}

/// Armed, then STOP: stopped, and stays so until cleared. The same in lockstep, where no tick runs meanwhile: STOP waits for no tick.
pub fn stop_stops(client: Client) -> Verdict {
    fine(client.upload(&image(500, 6), &mut |_| {}))?;
    if matches!(client.state(), DeviceState::Stopped | DeviceState::Fault(_)) {
        fine(client.request(ToDevice::ClearFault))?;
    }
    fine(client.request(ToDevice::Arm))?;
    let begun = Instant::now();
    fine(client.stop())?;
    loop {
        let left = Duration::from_secs(20).saturating_sub(begun.elapsed());
        match client.events().recv_timeout(left) {
            Ok(Event::State {
                state: DeviceState::Stopped,
                ..
            }) => break,
            Ok(_) => {}
            Err(_) => return Err(format!("not stopped, but {:?}", client.state())),
        }
    }
    let reason = refused(client.request(ToDevice::Arm), "arming a stopped board")?;
    ensure(reason == Refusal::State(DeviceState::Stopped), || {
        format!("arming: {reason:?}")
    })?;
    fine(client.request(ToDevice::ClearFault))?;
    Ok("stopped until cleared".into())
}

/// A pose that is none is refused, then a part that is none; and any while the motors are on.
pub fn placing_is_refused_in_its_order(client: Client) -> Verdict {
    fine(client.upload(&image(500, 7), &mut |_| {}))?;
    if matches!(client.state(), DeviceState::Stopped | DeviceState::Fault(_)) {
        fine(client.request(ToDevice::ClearFault))?;
    }
    let place = |w: f32| ToDevice::Place {
        part: 0,
        pose: WirePose {
            position: [0.0; 3],
            orientation: [0.0, 0.0, 0.0, w],
        },
    };
    let expect = |w: f32, reason: Refusal| {
        let found = refused(client.request(place(w)), "a pose of no part")?;
        ensure(found == reason, || format!("{found:?} instead of {reason:?}"))
    };
    expect(0.0, Refusal::BadNumber)?;
    expect(1.0, Refusal::NoSuchPart { parts: 0 })?;
    fine(client.request(ToDevice::Arm))?;
    expect(1.0, Refusal::State(DeviceState::Armed))?;
    fine(client.request(ToDevice::Disarm))?;
    Ok("refused: no pose, no part, motors on".into())
}

/// One second of idle ticks: none is missed. Only on rigs with a real deadline, not on a PC's clock.
pub fn idle_ticks_are_on_time(client: Client) -> Verdict {
    const TICKS: u32 = 1000;
    fine(client.statistics(true))?;
    if client.capabilities().simulated {
        fine(client.run(TICKS))?;
    } else {
        std::thread::sleep(Duration::from_millis(u64::from(TICKS)));
    }
    let statistics = fine(client.statistics(false))?;
    ensure(statistics.ticks >= TICKS / 2, || {
        format!("only {} ticks", statistics.ticks)
    })?;
    ensure(statistics.missed_ticks == 0, || {
        format!("{} ticks missed", statistics.missed_ticks)
    })?;
    Ok(format!("{} ticks, 0 missed", statistics.ticks))
}

/// A restarted board writes so to its log, in words: the log's frames match the firmware's ELF. The simulation has no log, and a real board's ELF is
/// not known.
pub fn the_log_is_readable(client: Client) -> Verdict {
    if client.capabilities().cost_unit != CostUnit::Instructions {
        return Ok("no log here whose words are known".into());
    }
    let client = fine(client.restart())?;
    // Log frames have the lowest priority on the link and arrive when it is otherwise idle.
    for _ in 0..50 {
        fine(client.run(1))?;
        let found = client.events().try_iter().find_map(|event| match event {
            Event::Log(line) if line.contains("started: as requested") => Some(line),
            _ => None,
        });
        if let Some(line) = found {
            return Ok(line);
        }
    }
    Err("no line of the log reports the restart".into())
}
