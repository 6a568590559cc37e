//! A million damaged frames: no panic, no damaged frame is accepted, and the next frame is read again.

use crate::common::{FROM_DEVICE, Random, TO_DEVICE, from_device, to_device};
use mortise_protocol::frame::{Decoder, FrameError, encode};
use mortise_protocol::limits::MAX_FRAME;
use mortise_protocol::message::{FromDevice, ToDevice};
use serde::Serialize;
use serde::de::DeserializeOwned;

const FRAMES: usize = 1_000_000;

struct Sound<M> {
    bytes: Vec<u8>,
    message: (u16, M),
}

fn sound<M: Serialize>(sequence: u16, message: M) -> Sound<M> {
    let mut wire = [0; MAX_FRAME];
    let bytes = encode(sequence, &message, &mut wire).expect("fits").to_vec();
    Sound {
        bytes,
        message: (sequence, message),
    }
}

fn push_all<M: DeserializeOwned>(
    decoder: &mut Decoder,
    bytes: &[u8],
    out: &mut Vec<Result<(u16, M), FrameError>>,
) {
    out.extend(bytes.iter().filter_map(|&byte| decoder.push(byte)));
}

/// Random bytes, ended by a delimiter, are never a message; the valid frame after them is always read.
#[test]
fn random_bytes_are_never_a_message() {
    let mut random = Random(0x5eed);
    let sentinels: Vec<_> = (0..TO_DEVICE)
        .map(|kind| sound(kind as u16, to_device(kind, &mut random)))
        .filter(|s| s.bytes.len() < 64)
        .collect();
    let mut decoder = Decoder::new();
    let mut out = Vec::new();
    let mut garbage = Vec::new();
    for _ in 0..FRAMES {
        // Mostly as short as real frames, occasionally longer than any.
        let length = if random.below(1000) == 0 {
            random.below(2 * MAX_FRAME)
        } else {
            random.below(48)
        };
        garbage.clear();
        while garbage.len() < length {
            garbage.extend_from_slice(&random.u64().to_le_bytes());
        }
        garbage.truncate(length);
        garbage.push(0);
        out.clear();
        push_all::<ToDevice>(&mut decoder, &garbage, &mut out);
        assert!(
            out.iter().all(Result::is_err),
            "random bytes were taken for {out:?}"
        );
        let next = &sentinels[random.below(sentinels.len())];
        out.clear();
        push_all(&mut decoder, &next.bytes, &mut out);
        assert_eq!(out, [Ok(next.message.clone())]);
    }
}

/// One to four flipped bits in a valid frame: the result is nothing, an error, or (when the flip hit a delimiter and joined two frames) nothing that
/// was not sent. The frame after the next is always read.
fn flips<M: Serialize + DeserializeOwned + PartialEq + Clone + core::fmt::Debug>(
    seed: u64,
    kinds: usize,
    make: fn(usize, &mut Random) -> M,
) {
    let mut random = Random(seed);
    // Few long frames, so that a million take seconds.
    let frames: Vec<Sound<M>> = (0..40 * kinds)
        .map(|i| sound(i as u16, make(i % kinds, &mut random)))
        .filter(|s| s.bytes.len() < 200)
        .collect();
    let mut decoder = Decoder::new();
    let mut out = Vec::new();
    for _ in 0..FRAMES / 2 {
        let victim = &frames[random.below(frames.len())];
        let mut damaged = victim.bytes.clone();
        let mut bits = [0; 4];
        let count = 1 + random.below(4);
        for bit in &mut bits[..count] {
            *bit = random.below(damaged.len() * 8);
            damaged[*bit / 8] ^= 1 << (*bit % 8);
        }
        if damaged == victim.bytes {
            // The flips cancelled each other.
            continue;
        }
        let delimiter_hit = damaged.last() != Some(&0);
        let (next, after) = (
            &frames[random.below(frames.len())],
            &frames[random.below(frames.len())],
        );
        out.clear();
        push_all::<M>(&mut decoder, &damaged, &mut out);
        assert!(
            out.iter().all(Result::is_err),
            "a damaged frame was taken for {out:?}"
        );
        out.clear();
        push_all(&mut decoder, &next.bytes, &mut out);
        if delimiter_hit {
            assert!(
                out.iter().all(Result::is_err),
                "joined frames were taken for {out:?}"
            );
        } else {
            assert_eq!(out, [Ok(next.message.clone())]);
        }
        out.clear();
        push_all(&mut decoder, &after.bytes, &mut out);
        assert_eq!(out, [Ok(after.message.clone())]);
    }
}

#[test]
fn damaged_host_frames_are_refused_and_the_next_is_read() {
    flips::<ToDevice>(1, TO_DEVICE, to_device);
}

#[test]
fn damaged_board_frames_are_refused_and_the_next_is_read() {
    flips::<FromDevice>(2, FROM_DEVICE, from_device);
}

/// A frame truncated anywhere is lost, and no other frame.
#[test]
fn a_frame_cut_anywhere_costs_only_itself() {
    let mut random = Random(3);
    for kind in 0..TO_DEVICE {
        let whole = sound(7, to_device(kind, &mut random));
        let next = sound(8, ToDevice::Stop);
        for cut in 1..whole.bytes.len() - 1 {
            let mut decoder = Decoder::new();
            let mut out = Vec::new();
            push_all::<ToDevice>(&mut decoder, &whole.bytes[..cut], &mut out);
            push_all(&mut decoder, &[0], &mut out);
            assert!(out.iter().all(Result::is_err));
            out.clear();
            push_all(&mut decoder, &next.bytes, &mut out);
            assert_eq!(out, [Ok(next.message.clone())]);
        }
    }
}

/// A message of another version with a valid checksum is reported with its sequence number, so that it can be refused.
#[test]
fn a_sound_frame_of_an_unknown_message_keeps_its_number() {
    let mut wire = [0; MAX_FRAME];
    let bytes = encode(0x1234, &(250u8, 1u8, 2u8), &mut wire).expect("fits");
    let mut decoder = Decoder::new();
    let mut out = Vec::new();
    push_all::<ToDevice>(&mut decoder, bytes, &mut out);
    assert_eq!(out, [Err(FrameError::Undecodable(0x1234))]);
}

/// A known message with trailing bytes is also of another version.
#[test]
fn left_over_bytes_make_a_message_undecodable() {
    let mut wire = [0; MAX_FRAME];
    // `Stop` is variant 4 and has no fields.
    let bytes = encode(9, &(4u8, 0u8), &mut wire).expect("fits");
    let mut decoder = Decoder::new();
    let mut out = Vec::new();
    push_all::<ToDevice>(&mut decoder, bytes, &mut out);
    assert_eq!(out, [Err(FrameError::Undecodable(9))]);
}
