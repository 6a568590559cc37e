//! Inputs of every tick for a recording: complete, in order, of this session only; what is lost is counted.

use crate::support::Bench;
use mortise_firmware::channel::RECORDED;
use mortise_protocol::message::*;

/// Ticks of the inputs received, and those counted as lost.
fn recorded(bench: &Bench) -> (Vec<u32>, u32) {
    let mut lost = 0;
    let mut ticks = Vec::new();
    for message in &bench.heard {
        if let FromDevice::Inputs(inputs) = message {
            lost = inputs.lost;
            ticks.extend((0..inputs.ticks.len() as u32).map(|at| inputs.first_tick + at));
        }
    }
    (ticks, lost)
}

#[test]
fn the_inputs_of_every_tick_are_reported_and_what_does_not_fit_is_counted() {
    let mut bench = Bench::ready();
    bench.request(&ToDevice::RecordInputs(true)).unwrap();
    bench.forget();
    let begun = bench.control.ticks();
    bench.ticks(100);
    let (ticks, lost) = recorded(&bench);
    assert_eq!(lost, 0);
    // A message waits for ten ticks.
    assert!((90..=100).contains(&ticks.len()), "{}", ticks.len());
    let first = begun + 1;
    assert!(
        ticks.iter().copied().eq(first..first + ticks.len() as u32),
        "{ticks:?}"
    );
    // An answer brings along the rest: the host has all ticks before it.
    bench.request(&ToDevice::ClearTarget { id: 9 }).unwrap();
    let (ticks, _) = recorded(&bench);
    assert!(ticks.len() >= 100, "{}", ticks.len());
    // Without a reader the queue fills, and the next message that has space says how many ticks are missing.
    bench.forget();
    let begun = bench.control.ticks();
    for _ in 0..200 {
        bench.control.tick();
    }
    bench.ticks(50);
    let (ticks, lost) = recorded(&bench);
    let span = ticks.last().unwrap() - begun;
    assert_eq!(ticks.len() as u32 + lost, span, "{ticks:?}");
    assert!((200 - 2 * RECORDED as u32..200).contains(&lost), "{lost}");
    bench.request(&ToDevice::RecordInputs(false)).unwrap();
    bench.ticks(5);
    bench.forget();
    bench.ticks(50);
    assert_eq!(recorded(&bench).0, []);
}

#[test]
fn inputs_of_an_earlier_session_are_not_sent() {
    let mut bench = Bench::ready();
    bench.request(&ToDevice::RecordInputs(true)).unwrap();
    for _ in 0..20 {
        bench.control.tick();
    }
    bench.send(&ToDevice::Hello(Version::own()));
    bench.forget();
    bench.ticks(50);
    assert_eq!(recorded(&bench).0, []);
}
