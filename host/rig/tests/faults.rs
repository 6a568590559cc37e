//! A link with deliberate faults: equal seeds give equal runs, each fault has its effect, and none remains afterwards.

use mortise_protocol::message::{FromDevice, ToDevice};
use mortise_protocol::parameter::ParameterId;
use mortise_rig::{Client, Event, FaultCounts, Faults, RigSpec, Window};

const FAST: RigSpec = RigSpec::Simulated { realtime: false };

/// Runs half a second with a parameter change every 10 ms and telemetry every 5 ms. Returns the ticks of the samples that the client
/// received, the number of samples overheard, and the counts.
fn played(faults: &Faults) -> (Vec<u32>, usize, FaultCounts) {
    let client = Client::connect_with_faults(&FAST).expect("in-process");
    let line = client.fault_line().expect("made with one");
    (client.request(ToDevice::SetTelemetry { every_ticks: 5 })).expect("sound so far");
    let start = client.run(0).expect("sound so far").tick;
    line.begin(faults);
    for round in 0..50u32 {
        let value = 10.0 + (round % 2) as f32;
        let id = ParameterId::ForceLimit;
        client.send(ToDevice::SetParameter { id, value }).expect("sent");
        client.run(10).expect("time is not harmed");
    }
    // A sample may arrive after the answer to the run, but not after this one.
    client.run(0).expect("time is not harmed");
    let overheard = line.overheard();
    let telemetry = |reported: &&FromDevice| matches!(reported, FromDevice::Telemetry(_));
    let overheard = overheard.iter().filter(telemetry).count();
    line.end();
    // The link works again at once.
    for value in [3.0, 4.0] {
        let id = ParameterId::ForceLimit;
        (client.request(ToDevice::SetParameter { id, value })).expect("sound");
        assert_eq!(client.parameter(id).expect("sound"), value);
    }
    let heard = client.events().try_iter().filter_map(|event| match event {
        Event::Telemetry(sample) => Some(sample.tick - start),
        _ => None,
    });
    (heard.collect(), overheard, line.counts())
}

#[test]
fn equal_seeds_give_equal_runs() {
    let faults = |seed| Faults {
        seed,
        drop: 0.2,
        corrupt: 0.1,
        repeat: 0.1,
        reorder: 0.2,
        delay_ms: [0, 40],
        flood_per_s: 500,
        ..Faults::default()
    };
    let first = played(&faults(7));
    assert_eq!(played(&faults(7)), first);
    assert_ne!(played(&faults(8)).0, first.0);
    let counts = first.2;
    for (name, count) in [
        ("lost", counts.lost),
        ("corrupted", counts.corrupted),
        ("repeated", counts.repeated),
        ("reordered", counts.reordered),
        ("late", counts.late),
        ("flooded", counts.flooded),
    ] {
        assert!(count > 5 && count < counts.frames.max(600), "{name}: {counts:?}");
    }
}

#[test]
fn each_fault_is_the_one_asked_for() {
    let (sound, overheard, counts) = played(&Faults::default());
    assert_eq!((overheard, sound.len()), (100, 100));
    assert_eq!((counts.lost, counts.late, counts.flooded), (0, 0, 0));
    let window = |at_ms, for_ms| vec![Window { at_ms, for_ms }];

    let all_lost = Faults {
        drop: 1.0,
        ..Faults::default()
    };
    let (heard, overheard, _) = played(&all_lost);
    assert_eq!((heard.len(), overheard), (0, 100));

    // Frames arrive in the order sent, each twice.
    let twice = Faults {
        repeat: 1.0,
        ..Faults::default()
    };
    let (heard, ..) = played(&twice);
    let doubled: Vec<u32> = sound.iter().flat_map(|&tick| [tick, tick]).collect();
    assert_eq!(heard, doubled);

    let swapped = Faults {
        reorder: 1.0,
        ..Faults::default()
    };
    let (mut heard, ..) = played(&swapped);
    assert_ne!(heard, sound);
    heard.sort_unstable();
    assert_eq!(heard, sound);

    // A pause loses nothing and keeps the order; a cut loses the frames under way.
    let stalled = Faults {
        stall: window(100, 200),
        ..Faults::default()
    };
    let (heard, _, counts) = played(&stalled);
    assert_eq!(heard, sound);
    assert!((40..140).contains(&counts.late), "{counts:?}");
    let cut = Faults {
        disconnect: window(100, 200),
        ..Faults::default()
    };
    let (heard, ..) = played(&cut);
    assert_eq!(heard.len(), 60);

    let noisy = Faults {
        flood_per_s: 1000,
        ..Faults::default()
    };
    let (heard, _, counts) = played(&noisy);
    assert_eq!(heard, sound);
    assert!((800..=1000).contains(&counts.flooded), "{counts:?}");
}

/// By the wall clock, a pause shorter than the board's host timeout has no lasting effect.
#[test]
fn a_pause_by_the_wall_clock_passes() {
    let client = Client::connect_with_faults(&RigSpec::Simulated { realtime: true }).expect("in-process");
    let line = client.fault_line().expect("made with one");
    line.begin(&Faults {
        stall: vec![Window {
            at_ms: 0,
            for_ms: 200,
        }],
        ..Faults::default()
    });
    let begun = std::time::Instant::now();
    client.request(ToDevice::Heartbeat).expect("late, but not lost");
    assert!(begun.elapsed().as_millis() >= 195, "{:?}", begun.elapsed());
}

#[test]
fn shares_are_shares() {
    for (faults, part) in [
        (
            Faults {
                drop: 1.5,
                ..Faults::default()
            },
            "drop",
        ),
        (
            Faults {
                corrupt: f64::NAN,
                ..Faults::default()
            },
            "corrupt",
        ),
        (
            Faults {
                delay_ms: [5, 1],
                ..Faults::default()
            },
            "delay_ms",
        ),
    ] {
        assert!(faults.check().expect_err("wrong").contains(part));
    }
}
