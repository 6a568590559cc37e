//! Parts put elsewhere while the motors are off.

use crate::support::Bench;
use crate::support::flash::TestFlash;
use mortise_protocol::message::*;
use proptest::prelude::*;

fn place(part: u16, position: [f32; 3], orientation: [f32; 4]) -> ToDevice {
    ToDevice::Place {
        part,
        pose: WirePose {
            position,
            orientation,
        },
    }
}

const UPRIGHT: [f32; 4] = [0.0, 0.0, 0.0, 1.0];

/// Grabs part 1 and returns where the telemetry has it; the motors are off again afterwards.
fn held_at(bench: &mut Bench) -> WirePose {
    bench.request(&ToDevice::Arm).unwrap();
    bench.request(&ToDevice::Grab { part: 1 }).unwrap();
    bench.request(&ToDevice::SetTelemetry { every_ticks: 1 }).unwrap();
    bench.forget();
    bench.tick();
    let sample = bench.heard.iter().find_map(|message| match message {
        FromDevice::Telemetry(sample) => Some(sample.clone()),
        _ => None,
    });
    bench.request(&ToDevice::Disarm).unwrap();
    bench.ticks(200);
    assert_eq!(bench.state(), DeviceState::Idle);
    let (part, pose) = sample.unwrap().object.unwrap();
    assert_eq!(part, 1);
    pose
}

#[test]
fn a_part_is_where_it_was_placed_until_the_scene_is_reset() {
    let mut bench = Bench::ready();
    let first = held_at(&mut bench);
    let there = [0.02, -0.03, 0.5];
    bench.request(&place(1, there, [0.0, 0.6, 0.0, 0.8])).unwrap();
    // A fixed part too, and the other one is not affected.
    bench.request(&place(0, [1.0, 0.0, 0.0], UPRIGHT)).unwrap();
    let pose = held_at(&mut bench);
    assert_eq!(pose.position, there);
    for (a, b) in pose.orientation.iter().zip([0.0, 0.6, 0.0, 0.8]) {
        assert!((a - b).abs() < 1e-6, "{pose:?}");
    }
    bench.request(&ToDevice::ResetScene).unwrap();
    assert_eq!(held_at(&mut bench), first);
}

#[test]
fn nothing_is_placed_while_the_motors_may_push() {
    let mut bench = Bench::ready();
    let message = place(1, [0.0; 3], UPRIGHT);
    bench.request(&ToDevice::Arm).unwrap();
    assert_eq!(bench.request(&message), Err(Refusal::State(DeviceState::Armed)));
    bench.request(&ToDevice::Grab { part: 1 }).unwrap();
    assert_eq!(bench.request(&message), Err(Refusal::State(DeviceState::Active)));
    bench.request(&ToDevice::Disarm).unwrap();
    assert_eq!(
        bench.request(&message),
        Err(Refusal::State(DeviceState::SoftStop))
    );
    bench.ticks(200);
    bench.request(&message).unwrap();
}

#[test]
fn what_cannot_be_placed_is_refused_and_nothing_moves() {
    let mut empty: Bench = Bench::new(TestFlash::leaked());
    empty.greet();
    assert_eq!(empty.request(&place(0, [0.0; 3], UPRIGHT)), Err(Refusal::NoScene));
    let mut bench = Bench::ready();
    let first = held_at(&mut bench);
    assert_eq!(
        bench.request(&place(2, [0.0; 3], UPRIGHT)),
        Err(Refusal::NoSuchPart { parts: 2 })
    );
    for (position, orientation) in [
        ([f32::NAN, 0.0, 0.0], UPRIGHT),
        ([0.0, f32::INFINITY, 0.0], UPRIGHT),
        // Beyond 100 m.
        ([0.0, 0.0, 101.0], UPRIGHT),
        ([0.0; 3], [0.0; 4]),
        ([0.0; 3], [0.0, 0.0, 0.0, 1.1]),
        ([0.0; 3], [f32::NAN; 4]),
    ] {
        assert_eq!(
            bench.request(&place(1, position, orientation)),
            Err(Refusal::BadNumber),
            "{position:?} {orientation:?}"
        );
    }
    assert_eq!(held_at(&mut bench), first);
}

/// A frame that comes again after others does not move the part back.
#[test]
fn a_late_copy_is_refused() {
    let mut bench = Bench::ready();
    let old = bench.frame(&place(1, [0.3, 0.0, 0.0], UPRIGHT));
    bench.feed(&old);
    bench.tick();
    bench.request(&place(1, [0.1, 0.0, 0.0], UPRIGHT)).unwrap();
    bench.forget();
    bench.feed(&old);
    bench.tick();
    let refused = |message: &FromDevice| {
        matches!(
            message,
            FromDevice::Refused {
                reason: Refusal::Outdated,
                ..
            }
        )
    };
    assert!(bench.heard.iter().any(refused), "{:?}", bench.heard);
    assert_eq!(held_at(&mut bench).position, [0.1, 0.0, 0.0]);
}

proptest! {
    /// Any bits as a pose: refused, or the part is exactly there.
    #[test]
    fn any_bits_are_refused_or_taken(bits in prop::array::uniform7(any::<u32>()), small in any::<bool>()) {
        let mut numbers = bits.map(f32::from_bits);
        if small {
            numbers = bits.map(|bits| (bits as f32 / u32::MAX as f32) * 2.0 - 1.0);
            let norm = numbers[3..].iter().map(|x| x * x).sum::<f32>().sqrt();
            numbers[3..].iter_mut().for_each(|x| *x /= norm);
        }
        let [x, y, z, i, j, k, w] = numbers;
        let mut bench = Bench::ready();
        match bench.request(&place(1, [x, y, z], [i, j, k, w])) {
            Ok(()) => prop_assert_eq!(held_at(&mut bench).position, [x, y, z]),
            Err(reason) => {
                prop_assert!(!small);
                prop_assert_eq!(reason, Refusal::BadNumber);
            }
        }
    }
}
