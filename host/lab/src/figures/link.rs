//! The link under damage: invalid frames, interrupted uploads.

use fastrand::Rng;
use mortise_protocol::frame::{Decoder, encode};
use mortise_protocol::image::CRC;
use mortise_protocol::limits::{MAX_CHUNK, MAX_FRAME};
use mortise_protocol::message::ToDevice;
use mortise_protocol::parameter::ParameterId;
use mortise_rig::{Client, EmulatedMode, Flash, Patience, RigSpec, begin_message, chunk_message, simulate};
use mortise_scenario::{PreparedScene, Scenario};

use super::{Plan, Row};
use crate::LabError;

/// Frames of each kind.
const FRAMES: u32 = 500_000;

/// Half a million random frames and as many valid ones with one to four bits flipped, delimiters included. Two valid frames follow each: the first is
/// lost only when a delimiter was hit and joined it to the damaged one, the second never.
pub(super) fn damage(out: &mut dyn FnMut(Row)) {
    // The same frames in every run.
    let mut random = Rng::with_seed(0x4d6f_7274_6973_6521);
    let mut decoder = Decoder::new();
    let mut wire = [0u8; MAX_FRAME];
    let (mut damaged, mut accepted, mut lost) = (0u32, 0u32, 0u32);
    let mut bytes = Vec::with_capacity(MAX_FRAME);
    for number in 0..2 * FRAMES {
        let sequence = number as u16;
        let sound = ToDevice::SetParameter {
            id: ParameterId::ForceLimit,
            value: number as f32,
        };
        let Ok(frame) = encode(sequence, &sound, &mut wire) else {
            lost += 1;
            continue;
        };
        bytes.clear();
        if number < FRAMES {
            let length = random.usize(..64);
            bytes.extend((0..length).map(|_| random.u8(..)));
            bytes.push(0);
        } else {
            bytes.extend_from_slice(frame);
            for _ in 0..=random.usize(..4) {
                let bit = random.usize(..8 * bytes.len());
                bytes[bit / 8] ^= 1 << (bit % 8);
            }
        }
        // Flips may cancel each other.
        if bytes == frame {
            continue;
        }
        damaged += 1;
        let mut taken = |bytes: &[u8]| -> Vec<_> {
            let read = bytes.iter().filter_map(|&byte| decoder.push::<ToDevice>(byte));
            read.filter_map(Result::ok).collect()
        };
        accepted += u32::from(!taken(&bytes).is_empty());
        let joined = bytes.last() != Some(&0);
        let expected = [(sequence, sound)];
        let first = taken(frame);
        accepted += u32::from(!first.is_empty() && first != expected);
        lost += u32::from(first != expected && !joined);
        lost += u32::from(taken(frame) != expected);
    }
    let what = |what: &str| format!("{} random frames and flipped bits: {what}", 2 * FRAMES);
    out(Row::within(
        what("read to the end without a panic"),
        f64::from(damaged),
        "frames",
        // Frames whose flips cancelled are not counted: about one in a thousand.
        1.99 * f64::from(FRAMES),
        2.0 * f64::from(FRAMES),
    ));
    out(Row::exactly(
        what("damaged frames accepted"),
        f64::from(accepted),
        "frames",
        0.0,
    ));
    out(Row::exactly(
        what("frames behind them lost, beyond the one joined to a damaged delimiter"),
        f64::from(lost),
        "frames",
        0.0,
    ));
}

/// Ways to interrupt an upload.
#[derive(Clone, Copy)]
enum Cut {
    /// The board loses power; its flash keeps its contents. Only the in-process rig's flash outlives it.
    Power,
    /// The board restarts.
    Restart,
}

/// Chunks of the upload that is interrupted on the emulated board, where each restart takes a third of a second.
const CHUNKS_EMULATED: usize = 16;

/// Uploads interrupted after every chunk: the old scene must be in use again each time, and the new one once it is committed.
pub(super) fn cuts(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    // Coarse cells keep the upload short, so that interrupting after every chunk stays affordable.
    let coarse = |cell_mm: f64| -> Result<Vec<u8>, LabError> {
        let mut scenario = Scenario::insertion(plan.pair)?;
        scenario.scene.cell_mm = Some(cell_mm);
        Ok(PreparedScene::of(&scenario)?.image)
    };
    let (old, new) = (coarse(8.0)?, coarse(4.0)?);
    let all = new.len().div_ceil(MAX_CHUNK);

    let flash = Flash::default();
    let power_on = || {
        let transport = simulate(&flash, false)?;
        Client::over(transport, "sim-fast", Patience::long(), None)
    };
    let again = |client: Client, cut: Cut| match cut {
        Cut::Power => {
            drop(client);
            power_on()
        }
        Cut::Restart => client.restart(),
    };
    let emulated = RigSpec::Emulated {
        mode: EmulatedMode::Lockstep,
        firmware: None,
    };
    for (what, client, cut, chunks) in [
        ("by a power cut, in-process", power_on()?, Cut::Power, all),
        (
            "by a restart, emulated board",
            Client::connect(&emulated)?,
            Cut::Restart,
            all.min(CHUNKS_EMULATED),
        ),
    ] {
        let mut client = client;
        client.upload(&old, &mut |_| {})?;
        let mut kept = 0;
        for sent in 0..=chunks {
            client.request(begin_message(&new)?)?;
            for chunk in 0..sent {
                client.request(chunk_message(&new, chunk * MAX_CHUNK))?;
            }
            client = again(client, cut)?;
            kept += u32::from(client.capabilities().scene == Some(CRC.checksum(&old)));
        }
        let what = format!("upload cut behind each of {chunks} chunks and before the first, {what}");
        out(Row::exactly(
            format!("{what}: times the old scene was intact"),
            f64::from(kept),
            "",
            (chunks + 1) as f64,
        ));
        client.upload(&new, &mut |_| {})?;
        client = again(client, cut)?;
        let taken = client.capabilities().scene == Some(CRC.checksum(&new));
        let in_use = if taken { "new scene" } else { "another" };
        out(Row::same(
            format!("{what}: in use after a whole upload"),
            in_use,
            "new scene",
        ));
    }
    Ok(())
}
