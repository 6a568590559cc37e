//! The greeting is frozen: two programs of any two versions must be able to identify each other.

use mortise_protocol::frame::{Decoder, encode};
use mortise_protocol::limits::MAX_FRAME;
use mortise_protocol::message::{FromDevice, SCHEMA_HASH, ToDevice, Version};

/// Sequence number 0x0102, variant 0, schema 0x0123456789abcdef, release 1.2.300; made with a separate program (Python: zlib.crc32, COBS and varints
/// by hand), not with this crate. NEVER change these bytes: boards in the field use them.
const GOLDEN: [u8; 22] = [
    0x03, 0x02, 0x01, 0x12, 0xef, 0x9b, 0xaf, 0xcd, 0xf8, 0xac, 0xd1, 0x91, 0x01, 0x01, 0x02, 0xac, 0x02,
    0x0b, 0x24, 0x26, 0xc8, 0x00,
];
const VERSION: Version = Version {
    schema: 0x0123_4567_89ab_cdef,
    release: [1, 2, 300],
};

#[test]
fn greetings_have_their_frozen_bytes_both_ways() {
    let mut wire = [0; MAX_FRAME];
    assert_eq!(
        encode(0x0102, &ToDevice::Hello(VERSION), &mut wire),
        Ok(&GOLDEN[..])
    );
    let mut wire = [0; MAX_FRAME];
    assert_eq!(
        encode(0x0102, &FromDevice::Hello(VERSION), &mut wire),
        Ok(&GOLDEN[..])
    );
}

#[test]
fn greetings_are_read_from_their_frozen_bytes() {
    let (mut host, mut board) = (Decoder::new(), Decoder::new());
    let (mut to, mut from) = (None, None);
    for byte in GOLDEN {
        to = to.or(board.push::<ToDevice>(byte));
        from = from.or(host.push::<FromDevice>(byte));
    }
    assert_eq!(to, Some(Ok((0x0102, ToDevice::Hello(VERSION)))));
    assert_eq!(from, Some(Ok((0x0102, FromDevice::Hello(VERSION)))));
}

#[test]
fn own_version_carries_this_release_and_schema() {
    let own = Version::own();
    let [major, minor, patch] = own.release;
    assert_eq!(format!("{major}.{minor}.{patch}"), env!("CARGO_PKG_VERSION"));
    assert_eq!(own.schema, SCHEMA_HASH);
    assert_ne!(own.schema, 0);
}
