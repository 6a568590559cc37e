//! The link under damage: frames that are no frames, uploads that are cut off.

use mortise_protocol::frame::{Decoder, encode};
use mortise_protocol::image::CRC;
use mortise_protocol::limits::{MAX_CHUNK, MAX_FRAME};
use mortise_protocol::message::ToDevice;
use mortise_protocol::parameter::ParameterId;
use mortise_rig::{Client, RigSpec, begin_message, chunk_message};

use super::{Plan, Row};
use crate::LabError;
use crate::scenario::{PreparedScene, Scenario};

/// Frames of each kind.
const FRAMES: u32 = 500_000;

/// xorshift64* (Vigna 2016): the same frames in every run.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_f491_4f6c_dd1d)
    }

    fn below(&mut self, n: usize) -> usize {
        ((self.next() >> 32) as usize) % n
    }
}

/// Half a million random frames and as many sound ones with one to four bits flipped; a sound frame follows each.
pub(super) fn damage(out: &mut dyn FnMut(Row)) {
    let mut random = Random(0x4d6f_7274_6973_6521);
    let mut decoder = Decoder::new();
    let mut wire = [0u8; MAX_FRAME];
    let (mut accepted, mut lost) = (0u32, 0u32);
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
            let length = random.below(64);
            bytes.extend((0..length).map(|_| random.next() as u8));
            bytes.push(0);
        } else {
            bytes.extend_from_slice(frame);
            // The delimiter stays: without it the next frame is joined to this one, which is the loss of one frame and allowed.
            let bits = 8 * (bytes.len() - 1);
            let first = random.below(bits);
            bytes[first / 8] ^= 1 << (first % 8);
            for _ in 0..random.below(4) {
                let other = random.below(bits);
                if other != first {
                    bytes[other / 8] ^= 1 << (other % 8);
                }
            }
        }
        let intact = bytes == frame;
        let taken = bytes
            .iter()
            .filter(|&&byte| matches!(decoder.push::<ToDevice>(byte), Some(Ok(_))))
            .count();
        accepted += u32::from(taken > 0 && !intact);
        let read = frame
            .iter()
            .filter_map(|&byte| decoder.push::<ToDevice>(byte))
            .last();
        lost += u32::from(read != Some(Ok((sequence, sound))));
    }
    let what = |what: &str| format!("{} random frames and flipped bits: {what}", 2 * FRAMES);
    out(Row::exactly(
        what("damaged frames accepted"),
        f64::from(accepted),
        "frames",
        0.0,
    ));
    out(Row::exactly(
        what("sound frames behind them lost"),
        f64::from(lost),
        "frames",
        0.0,
    ));
}

/// An upload of a real scene cut off by a restart behind each chunk: the old scene must still be there.
pub(super) fn cuts(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    // Coarse cells make it short, so that cutting behind every chunk stays affordable.
    let coarse = |cell_mm: f64| -> Result<Vec<u8>, LabError> {
        let mut scenario = Scenario::insertion(plan.pair)?;
        scenario.scene.cell_mm = Some(cell_mm);
        Ok(PreparedScene::of(&scenario)?.image)
    };
    let (old, new) = (coarse(8.0)?, coarse(4.0)?);
    let in_use = Some(CRC.checksum(&old));
    let mut client = Client::connect(&RigSpec::Simulated { realtime: false })?;
    client.upload(&old, &mut |_| {})?;
    let chunks = new.len().div_ceil(MAX_CHUNK);
    let mut kept = 0;
    for cut in 0..=chunks {
        client.request(begin_message(&new)?)?;
        for chunk in 0..cut {
            client.request(chunk_message(&new, chunk * MAX_CHUNK))?;
        }
        client = client.restart()?;
        kept += u32::from(client.capabilities().scene == in_use);
    }
    let what = "upload cut behind each chunk by a restart, in-process: old scene intact";
    out(Row::exactly(
        what,
        f64::from(kept),
        &format!("of {} cuts", chunks + 1),
        (chunks + 1) as f64,
    ));
    client.upload(&new, &mut |_| {})?;
    client = client.restart()?;
    let taken = client.capabilities().scene == Some(CRC.checksum(&new));
    out(Row::exactly(
        "upload not cut, then a restart: new scene in use",
        f64::from(u8::from(taken)),
        "of 1",
        1.0,
    ));
    Ok(())
}
