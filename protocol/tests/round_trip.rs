//! Every message is unchanged after a round trip, and the largest of each kind fits.

use crate::common::{FROM_DEVICE, Random, TO_DEVICE, from_device, to_device};
use mortise_protocol::frame::{Decoder, encode};
use mortise_protocol::limits::MAX_FRAME;
use mortise_protocol::message::{FromDevice, ToDevice};
use postcard_schema::Schema;
use postcard_schema::schema::DataModelType;
use proptest::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;

fn passes<M: Serialize + DeserializeOwned + PartialEq + core::fmt::Debug>(sequence: u16, message: &M) {
    let mut wire = [0; MAX_FRAME];
    let bytes = encode(sequence, message, &mut wire).expect("every message fits into a frame");
    let (delimiter, body) = bytes.split_last().expect("a frame is never empty");
    assert_eq!(*delimiter, 0);
    assert!(!body.contains(&0), "the delimiter must not occur inside a frame");
    let mut decoder = Decoder::new();
    for &byte in body {
        assert!(decoder.push::<M>(byte).is_none());
    }
    let (found_sequence, found) = decoder
        .push::<M>(0)
        .expect("a frame ends here")
        .expect("it is sound");
    assert_eq!(found_sequence, sequence);
    assert_eq!(found, *message);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2_000))]

    #[test]
    fn host_messages_survive(kind in 0..TO_DEVICE, seed: u64, sequence: u16) {
        passes(sequence, &to_device(kind, &mut Random(seed)));
    }

    #[test]
    fn board_messages_survive(kind in 0..FROM_DEVICE, seed: u64, sequence: u16) {
        passes(sequence, &from_device(kind, &mut Random(seed)));
    }
}

fn variants<M: Schema>() -> Vec<&'static str> {
    match M::SCHEMA.ty {
        DataModelType::Enum(variants) => variants.iter().map(|variant| variant.name).collect(),
        _ => panic!("a message table is an enum"),
    }
}

/// `{:?}` of an enum value starts with its variant's name.
fn name_of(message: &impl core::fmt::Debug) -> String {
    format!("{message:?}")
        .chars()
        .take_while(|c| c.is_alphanumeric())
        .collect()
}

/// Fails when a message of the table is missing here and would not be tested.
#[test]
fn the_generator_makes_every_message() {
    let mut random = Random(1);
    let made: Vec<String> = (0..TO_DEVICE)
        .map(|kind| name_of(&to_device(kind, &mut random)))
        .collect();
    assert_eq!(made, variants::<ToDevice>());
    let made: Vec<String> = (0..FROM_DEVICE)
        .map(|kind| name_of(&from_device(kind, &mut random)))
        .collect();
    assert_eq!(made, variants::<FromDevice>());
}
