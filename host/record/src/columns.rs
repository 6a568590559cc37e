//! Inputs of consecutive ticks in columns, which compress to a third of their rows.
//!
//! A number of a tick resembles that of the tick before. Where an encoder's count explains all bits of a column (`x = n·count`) the column holds
//! the changes of `n`; elsewhere the bits that differ from the previous value, the bytes of equal weight side by side. All that changes rarely
//! is written when it changes. Every bit is kept, that of NaN and −0 included.

use mortise_protocol::message::{DriverReport, TickInput, WirePose, WireTwist};
use serde::{Deserialize, Serialize};

/// Columns of floating-point numbers: position, orientation, linear and angular velocity.
const FLOATS: usize = 13;

/// Inputs of consecutive ticks.
#[derive(Clone, Debug, PartialEq)]
pub struct Ticks {
    /// Number of the first tick, counted as in telemetry.
    pub first_tick: u32,
    /// Encoder count at the handle, m and rad.
    pub count: [f32; 2],
    /// Ticks lost since the recording began.
    pub lost: u32,
    /// One for each tick.
    pub inputs: Vec<TickInput>,
}

#[derive(Serialize, Deserialize)]
struct Packed {
    first_tick: u32,
    count: [f32; 2],
    lost: u32,
    ticks: u32,
    floats: Vec<Column>,
    marks: Vec<Mark>,
    hashes: Vec<u8>,
}

#[derive(Serialize, Deserialize)]
enum Column {
    /// Changes of the count.
    Counts(Vec<i32>),
    /// Bits that differ from the previous number, in four planes of bytes.
    Bits(Vec<u8>),
}

/// What changes rarely, and the tick from which it holds.
#[derive(Serialize, Deserialize)]
struct Mark {
    from: u32,
    rare: Rare,
}

#[derive(Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Rare {
    bad_reading: bool,
    stop_open: bool,
    supply_low: bool,
    impossible_posture: bool,
    referenced: bool,
    driver: Option<DriverReport>,
    encoder_jump: Option<u8>,
    encoder_stuck: Option<u8>,
    carried_out: u16,
    stops: u8,
}

/// The bytes of `ticks`.
pub fn encode(ticks: &Ticks) -> Vec<u8> {
    let inputs = &ticks.inputs;
    let floats = (0..FLOATS)
        .map(|at| {
            let numbers: Vec<f32> = inputs.iter().map(|input| floats(input)[at]).collect();
            // The first three are positions; orientations and velocities are no multiples of a count.
            let counted = (at < 3).then(|| counts(&numbers, ticks.count[0])).flatten();
            counted.map_or_else(|| Column::Bits(bits(&numbers)), Column::Counts)
        })
        .collect();
    let mut marks: Vec<Mark> = Vec::new();
    for (from, input) in inputs.iter().enumerate() {
        let rare = rare(input);
        if marks.last().is_none_or(|last| last.rare != rare) {
            let from = from as u32;
            marks.push(Mark { from, rare });
        }
    }
    let packed = Packed {
        first_tick: ticks.first_tick,
        count: ticks.count,
        lost: ticks.lost,
        ticks: inputs.len() as u32,
        floats,
        marks,
        hashes: planes(inputs.iter().map(|input| input.hash)),
    };
    // Into a vector, of types that all can be written: no error is possible.
    postcard::to_stdvec(&packed).unwrap_or_default()
}

/// The ticks in `bytes`; `None` when they were not made by [`encode`].
pub fn decode(bytes: &[u8]) -> Option<Ticks> {
    let packed: Packed = postcard::from_bytes(bytes).ok()?;
    let length = packed.ticks as usize;
    let hashes = from_planes(&packed.hashes, length)?;
    if packed.floats.len() != FLOATS || (length > 0 && packed.marks.first()?.from != 0) {
        return None;
    }
    let mut columns = Vec::with_capacity(FLOATS);
    for column in &packed.floats {
        columns.push(match column {
            Column::Counts(changes) if changes.len() == length => numbers(changes, packed.count[0]),
            Column::Counts(_) => return None,
            Column::Bits(bytes) => from_bits(bytes, length)?,
        });
    }
    let mut marks = packed.marks.iter().peekable();
    let mut current = None;
    let mut inputs = Vec::with_capacity(length);
    for (at, hash) in hashes.into_iter().enumerate() {
        while let Some(mark) = marks.next_if(|mark| mark.from as usize <= at) {
            current = Some(mark.rare);
        }
        let row = core::array::from_fn(|column| columns[column][at]);
        inputs.push(input(&row, current?, hash));
    }
    Some(Ticks {
        first_tick: packed.first_tick,
        count: packed.count,
        lost: packed.lost,
        inputs,
    })
}

fn floats(input: &TickInput) -> [f32; FLOATS] {
    let [x, y, z] = input.handle.position;
    let [i, j, k, w] = input.handle.orientation;
    let [vx, vy, vz] = input.twist.linear;
    let [wx, wy, wz] = input.twist.angular;
    [x, y, z, i, j, k, w, vx, vy, vz, wx, wy, wz]
}

fn rare(input: &TickInput) -> Rare {
    Rare {
        bad_reading: input.bad_reading,
        stop_open: input.stop_open,
        supply_low: input.supply_low,
        impossible_posture: input.impossible_posture,
        referenced: input.referenced,
        driver: input.driver,
        encoder_jump: input.encoder_jump,
        encoder_stuck: input.encoder_stuck,
        carried_out: input.carried_out,
        stops: input.stops,
    }
}

fn input(row: &[f32; FLOATS], rare: Rare, hash: u32) -> TickInput {
    let [x, y, z, i, j, k, w, vx, vy, vz, wx, wy, wz] = *row;
    TickInput {
        handle: WirePose {
            position: [x, y, z],
            orientation: [i, j, k, w],
        },
        twist: WireTwist {
            linear: [vx, vy, vz],
            angular: [wx, wy, wz],
        },
        bad_reading: rare.bad_reading,
        stop_open: rare.stop_open,
        supply_low: rare.supply_low,
        impossible_posture: rare.impossible_posture,
        referenced: rare.referenced,
        driver: rare.driver,
        encoder_jump: rare.encoder_jump,
        encoder_stuck: rare.encoder_stuck,
        carried_out: rare.carried_out,
        stops: rare.stops,
        hash,
    }
}

/// Changes of `n` where every number is exactly `n·count`; else `None`.
fn counts(numbers: &[f32], count: f32) -> Option<Vec<i32>> {
    let mut before = 0i32;
    numbers
        .iter()
        .map(|&x| {
            let n = (x / count).round();
            let exact = n.abs() < 1e7 && (n as i32 as f32 * count).to_bits() == x.to_bits();
            exact.then(|| {
                let n = n as i32;
                n - core::mem::replace(&mut before, n)
            })
        })
        .collect()
}

fn numbers(changes: &[i32], count: f32) -> Vec<f32> {
    let mut n = 0i32;
    changes
        .iter()
        .map(|&change| {
            n = n.wrapping_add(change);
            n as f32 * count
        })
        .collect()
}

fn bits(numbers: &[f32]) -> Vec<u8> {
    let before = [0.0].iter().chain(numbers);
    planes((numbers.iter().zip(before)).map(|(x, before)| x.to_bits() ^ before.to_bits()))
}

fn from_bits(bytes: &[u8], length: usize) -> Option<Vec<f32>> {
    let mut before = 0;
    let words = from_planes(bytes, length)?;
    Some(
        words
            .into_iter()
            .map(|changed| {
                before ^= changed;
                f32::from_bits(before)
            })
            .collect(),
    )
}

/// The words' bytes, all highest ones first.
fn planes(words: impl Iterator<Item = u32> + Clone) -> Vec<u8> {
    (0..4)
        .flat_map(|plane| words.clone().map(move |word| word.to_be_bytes()[plane]))
        .collect()
}

fn from_planes(bytes: &[u8], length: usize) -> Option<Vec<u32>> {
    (bytes.len() == length.checked_mul(4)?).then(|| {
        (0..length)
            .map(|at| u32::from_be_bytes(core::array::from_fn(|plane| bytes[plane * length + at])))
            .collect()
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Any bits, with multiples of the count among them.
    fn number(count: f32) -> impl Strategy<Value = f32> {
        prop_oneof![
            any::<u32>().prop_map(f32::from_bits),
            (-100_000i32..100_000).prop_map(move |n| n as f32 * count),
            Just(-0.0f32),
        ]
    }

    fn tick(count: f32) -> impl Strategy<Value = TickInput> {
        let driver = prop_oneof![
            Just(None),
            any::<u8>().prop_map(|axis| Some(DriverReport::OverCurrent(axis)))
        ];
        let rare = (
            any::<[bool; 5]>(),
            driver,
            any::<Option<u8>>(),
            any::<Option<u8>>(),
            any::<u16>(),
        );
        (
            proptest::collection::vec(number(count), FLOATS),
            rare,
            any::<u8>(),
            any::<u32>(),
        )
            .prop_map(
                |(row, (flags, driver, encoder_jump, encoder_stuck, carried_out), stops, hash)| {
                    let [bad_reading, stop_open, supply_low, impossible_posture, referenced] = flags;
                    let row = core::array::from_fn(|at| row[at]);
                    let rare = Rare {
                        bad_reading,
                        stop_open,
                        supply_low,
                        impossible_posture,
                        referenced,
                        driver,
                        encoder_jump,
                        encoder_stuck,
                        carried_out,
                        stops,
                    };
                    input(&row, rare, hash)
                },
            )
    }

    fn same_bits(a: &TickInput, b: &TickInput) -> bool {
        let words = |input| floats(input).map(f32::to_bits);
        words(a) == words(b) && rare(a) == rare(b) && a.hash == b.hash
    }

    proptest! {
        #[test]
        fn every_bit_is_kept(inputs in proptest::collection::vec(tick(5e-6), 0..40), first_tick: u32, lost: u32) {
            let ticks = Ticks { first_tick, count: [5e-6, 1e-4], lost, inputs };
            let back = decode(&encode(&ticks)).expect("what was written is read");
            prop_assert_eq!((back.first_tick, back.count, back.lost), (first_tick, ticks.count, lost));
            prop_assert_eq!(back.inputs.len(), ticks.inputs.len());
            for (a, b) in back.inputs.iter().zip(&ticks.inputs) {
                prop_assert!(same_bits(a, b), "{:?} {:?}", a, b);
            }
        }

        #[test]
        fn any_bytes_are_read_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
            let _ = decode(&bytes);
        }
    }
}
