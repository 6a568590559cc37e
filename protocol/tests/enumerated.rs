//! The frame decoder over complete classes of input: every string of up to three bytes, and for a frame of every message every one and two flipped
//! bits, every byte lost, doubled or replaced, every truncation and every swap of neighbours.
//!
//! Properties of the checksum that are checked here: CRC-32/ISO-HDLC finds every one, two and three flipped bits in blocks of this length (its
//! Hamming distance is 4 up to 11 kB), and every burst of up to 32 bits. A replaced byte is a burst. A byte lost, doubled or swapped shifts bits,
//! which no Hamming distance covers; all cases are tried here.

use crate::common::{FROM_DEVICE, Random, TO_DEVICE, from_device, to_device};
use mortise_protocol::frame::{Decoder, FrameError, encode};
use mortise_protocol::limits::MAX_FRAME;
use mortise_protocol::message::{FromDevice, ToDevice};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Longest frame of which every pair of bits is flipped, bytes: 320 bits, 51,040 pairs.
const PAIRS_UP_TO: usize = 40;

fn frame<M: Serialize>(sequence: u16, message: &M) -> Vec<u8> {
    let mut wire = [0; MAX_FRAME];
    encode(sequence, message, &mut wire)
        .expect("every message fits")
        .to_vec()
}

/// A decoder under test, and the valid frame that must be read after damaged input.
struct Trial<M> {
    decoder: Decoder,
    sentinel: Vec<u8>,
    expected: (u16, M),
    inputs: u64,
}

impl<M: Serialize + DeserializeOwned + PartialEq + Clone + core::fmt::Debug> Trial<M> {
    fn new(sentinel: M) -> Self {
        Self {
            decoder: Decoder::new(),
            sentinel: frame(0x5a5a, &sentinel),
            expected: (0x5a5a, sentinel),
            inputs: 0,
        }
    }

    /// Pushes `bytes` and a delimiter: no message other than `allowed` may be decoded, and the next frame must be read.
    fn damaged(&mut self, bytes: &[u8], allowed: Option<&(u16, M)>) {
        self.inputs += 1;
        for &byte in bytes.iter().chain(&[0]) {
            if let Some(Ok(message)) = self.decoder.push::<M>(byte) {
                assert_eq!(Some(&message), allowed, "{bytes:02x?}");
            }
        }
        let mut read = None;
        for &byte in &self.sentinel {
            read = read.or(self.decoder.push::<M>(byte));
        }
        assert_eq!(read, Some(Ok(self.expected.clone())), "behind {bytes:02x?}");
    }

    /// Applies every damage of the classes above to the frame of one message.
    fn every_damage(&mut self, sequence: u16, message: &M) {
        let sound = frame(sequence, message);
        let original = Some((sequence, message.clone()));
        let bits = sound.len() * 8;
        let flipped = |bit: usize, other: Option<usize>| {
            let mut bytes = sound.clone();
            for bit in [Some(bit), other].into_iter().flatten() {
                bytes[bit / 8] ^= 1 << (bit % 8);
            }
            bytes
        };
        for bit in 0..bits {
            self.damaged(&flipped(bit, None), None);
            if sound.len() <= PAIRS_UP_TO {
                for other in bit + 1..bits {
                    self.damaged(&flipped(bit, Some(other)), None);
                }
            }
        }
        for at in 0..sound.len() {
            // The last byte is the delimiter, and another one is always pushed after it.
            let whole = original.as_ref().filter(|_| at == sound.len() - 1);
            self.damaged(&sound[..at], whole);
            for value in 0..=u8::MAX {
                let mut bytes = sound.clone();
                bytes[at] = value;
                self.damaged(&bytes, original.as_ref().filter(|_| bytes == sound));
            }
            let mut lost = sound.clone();
            lost.remove(at);
            self.damaged(&lost, whole);
            let mut doubled = sound.clone();
            doubled.insert(at, sound[at]);
            self.damaged(&doubled, whole);
            if at + 1 < sound.len() && sound[at] != sound[at + 1] {
                let mut swapped = sound.clone();
                swapped.swap(at, at + 1);
                self.damaged(&swapped, None);
            }
        }
    }
}

#[test]
fn every_damage_to_every_message_is_found() {
    let mut random = Random(0xe0e0);
    let mut to = Trial::new(ToDevice::Heartbeat);
    for kind in 0..TO_DEVICE {
        to.every_damage(kind as u16, &to_device(kind, &mut random));
    }
    let mut from = Trial::new(FromDevice::Ack { seq: 1 });
    for kind in 0..FROM_DEVICE {
        from.every_damage(kind as u16, &from_device(kind, &mut random));
    }
    println!("{} damaged frames, none taken", to.inputs + from.inputs);
    assert!(to.inputs + from.inputs > 500_000, "too few to say anything");
}

/// 16,843,009 strings. The shortest message is 8 bytes on the wire, so none of these is one.
#[test]
fn no_string_of_up_to_three_bytes_is_a_message() {
    let mut decoder = Decoder::new();
    let mut push = |bytes: &[u8]| {
        for &byte in bytes.iter().chain(&[0]) {
            match decoder.push::<ToDevice>(byte) {
                None | Some(Err(FrameError::Malformed)) => {}
                other => panic!("{bytes:02x?}: {other:?}"),
            }
        }
    };
    push(&[]);
    for a in 0..=u8::MAX {
        push(&[a]);
        for b in 0..=u8::MAX {
            push(&[a, b]);
            for c in 0..=u8::MAX {
                push(&[a, b, c]);
            }
        }
    }
}
