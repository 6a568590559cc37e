//! The frame decoder, in both directions: raw bytes, and messages in frames with a valid checksum.
//!
//! A decoded message must encode, and decode again to the same bytes: otherwise the two sides would interpret it differently.
#![no_main]

use libfuzzer_sys::fuzz_target;
use mortise_protocol::frame::{Decoder, encode};
use mortise_protocol::image::CRC;
use mortise_protocol::limits::MAX_FRAME;
use mortise_protocol::message::{FromDevice, ToDevice};
use serde::Serialize;
use serde::de::DeserializeOwned;

fuzz_target!(|data: &[u8]| {
    let Some((&kind, bytes)) = data.split_first() else {
        return;
    };
    let framed;
    let wire = if kind & 1 == 0 {
        bytes
    } else {
        framed = frame_around(bytes);
        framed.as_slice()
    };
    if kind & 2 == 0 {
        read::<ToDevice>(wire);
    } else {
        read::<FromDevice>(wire);
    }
});

/// Sequence number and message from the fuzzer, with valid checksum and COBS: random input never has a valid checksum.
fn frame_around(bytes: &[u8]) -> Vec<u8> {
    let mut raw = bytes.to_vec();
    raw.extend(CRC.checksum(bytes).to_le_bytes());
    // With the delimiter after it, which is 0.
    let mut wire = vec![0; cobs::max_encoding_length(raw.len()) + 1];
    let used = cobs::encode(&raw, &mut wire);
    wire.truncate(used + 1);
    wire[used] = 0;
    wire
}

fn read<M: Serialize + DeserializeOwned>(wire: &[u8]) {
    let mut decoder = Decoder::new();
    for &byte in wire {
        if let Some(Ok((sequence, message))) = decoder.push::<M>(byte) {
            let mut first = [0; MAX_FRAME];
            // A number may be encoded longer than necessary; after reading and writing it again it is not.
            let first = encode(sequence, &message, &mut first).expect("what was read fits");
            let mut again = Decoder::new();
            let (number, message) = first
                .iter()
                .find_map(|&byte| again.push::<M>(byte))
                .expect("a frame ends")
                .expect("what was written reads");
            let mut second = [0; MAX_FRAME];
            let second = encode(number, &message, &mut second).expect("as before");
            assert_eq!(first, second);
        }
    }
}
