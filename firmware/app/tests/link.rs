//! The link plane: which messages are accepted when, every refusal, and robustness against any input.

use crate::support::Bench;
use crate::support::flash::{SLOT, TestFlash};
use crate::support::image::two_parts;
use crate::support::rigs::arm;
use mortise_firmware::board::{Drive, RIG_SLOTS};
use mortise_firmware::store::IMAGE_OFFSET;
use mortise_protocol::frame::encode;
use mortise_protocol::image::{CRC, ImageError, LAYOUT_VERSION};
use mortise_protocol::limits::{MAX_FRAME, MAX_MESSAGE};
use mortise_protocol::message::*;
use mortise_protocol::parameter::{PARAMETERS, ParameterId};
use mortise_protocol::rig::RigFault;
use proptest::prelude::*;

fn hand() -> HandScript {
    HandScript {
        stiffness: 400.0,
        damping: 5.0,
        angular_stiffness: 1.0,
        angular_damping: 0.01,
        tremor: 0.0,
        tremor_hz: 0.0,
        keyframes: heapless::Vec::from_slice(&[Keyframe {
            tick: 0,
            pose: WirePose {
                position: [0.0; 3],
                orientation: [0.0, 0.0, 0.0, 1.0],
            },
            push: [0.0; 3],
        }])
        .unwrap(),
    }
}

fn target() -> ConstraintTarget {
    let feature = Feature {
        point: [0.0; 3],
        direction: [0.0, 0.0, 1.0],
    };
    ConstraintTarget {
        id: 1,
        sequence: 1,
        kind: ConstraintKind::Concentric,
        moving: feature,
        static_part: 0,
        fixed: feature,
        stiffness: 1000.0,
        force_cap: 3.0,
        torque_cap: 0.1,
        expiry_ticks: 100,
        path: None,
        faces: heapless::Vec::new(),
    }
}

#[test]
fn nothing_but_hello_and_stop_before_hello() {
    let mut bench: Bench = Bench::new(TestFlash::leaked());
    bench.ticks(1);
    for message in [
        ToDevice::GetCapabilities,
        ToDevice::Arm,
        ToDevice::Heartbeat,
        ToDevice::GetParameter(ParameterId::ForceLimit),
        ToDevice::GetStatistics { reset: true },
        ToDevice::SceneCommit,
        ToDevice::Restart,
    ] {
        assert_eq!(bench.request(&message), Err(Refusal::NotGreeted), "{message:?}");
    }
    assert_eq!(bench.request(&ToDevice::Stop), Ok(()));
    bench.tick();
    assert_eq!(bench.state(), DeviceState::Stopped);
    let mut other = Version::own();
    other.schema ^= 1;
    assert_eq!(
        bench.ask(&ToDevice::Hello(other)),
        FromDevice::Hello(Version::own()),
        "a host of another schema receives this version"
    );
    assert_eq!(bench.request(&ToDevice::Arm), Err(Refusal::NotGreeted));
    bench.greet();
    assert_eq!(bench.request(&ToDevice::Heartbeat), Ok(()));
}

/// The refusal of each kind in the table: the match below makes a new reason a compile error here.
#[test]
fn every_reason_of_the_table_is_given_where_it_belongs() {
    let reasons = [
        Refusal::NotGreeted,
        Refusal::State(DeviceState::Idle),
        Refusal::NoScene,
        Refusal::NoSuchPart { parts: 2 },
        Refusal::NotGrabbable,
        Refusal::OutOfRange {
            id: ParameterId::ForceLimit,
            min: 0.0,
            max: 20.0,
        },
        Refusal::ChunkOrder { expected: 0 },
        Refusal::NoUpload,
        Refusal::SceneTooLarge {
            capacity: (SLOT - IMAGE_OFFSET) as u32,
        },
        Refusal::TooManyParts { capacity: 256 },
        Refusal::SceneIncomplete { received: 0 },
        Refusal::SceneCrc {
            expected: 1,
            found: CRC.checksum(&two_parts(9)),
        },
        Refusal::SceneImage(ImageError::BadMagic),
        Refusal::Flash,
        Refusal::NotSimulated,
        Refusal::Lockstep,
        Refusal::BadNumber,
        Refusal::Busy,
        Refusal::Rig(RigFault::Joints { needed: 3 }),
        Refusal::RigFixed,
        Refusal::RigDamaged,
        Refusal::Undecodable,
        Refusal::Outdated,
        Refusal::NoSuchMotor { motors: 3 },
    ];
    for reason in reasons {
        let got = match reason {
            Refusal::NotGreeted => {
                let mut bench: Bench = Bench::new(TestFlash::leaked());
                bench.request(&ToDevice::Arm)
            }
            Refusal::State(_) => Bench::ready().request(&ToDevice::Grab { part: 1 }),
            Refusal::NoScene => {
                let mut bench: Bench = Bench::new(TestFlash::leaked());
                bench.greet();
                assert_eq!(bench.request(&ToDevice::Grab { part: 0 }), Err(Refusal::NoScene));
                bench.request(&ToDevice::Arm)
            }
            Refusal::NoSuchPart { .. } => {
                let mut bench = Bench::ready();
                bench.request(&ToDevice::Arm).unwrap();
                bench.request(&ToDevice::Grab { part: 2 })
            }
            Refusal::NotGrabbable => {
                let mut bench = Bench::ready();
                bench.request(&ToDevice::Arm).unwrap();
                bench.request(&ToDevice::Grab { part: 0 })
            }
            Refusal::OutOfRange { id, .. } => {
                Bench::ready().request(&ToDevice::SetParameter { id, value: f32::NAN })
            }
            Refusal::ChunkOrder { .. } => {
                let mut bench = Bench::ready();
                bench.begin(&two_parts(9)).unwrap();
                bench.chunk(&two_parts(9), 512)
            }
            Refusal::NoUpload => {
                let mut bench = Bench::ready();
                assert_eq!(bench.request(&ToDevice::SceneAbort), Err(Refusal::NoUpload));
                assert_eq!(bench.chunk(&two_parts(9), 0), Err(Refusal::NoUpload));
                bench.request(&ToDevice::SceneCommit)
            }
            Refusal::SceneTooLarge { capacity } => Bench::ready().request(&ToDevice::SceneBegin {
                length: capacity + 1,
                crc: 0,
                layout: LAYOUT_VERSION,
            }),
            // Needs more flash than the bench has: tested in `store.rs`.
            Refusal::TooManyParts { .. } => Err(reason),
            Refusal::SceneIncomplete { .. } => {
                let mut bench = Bench::ready();
                bench.begin(&two_parts(9)).unwrap();
                bench.request(&ToDevice::SceneCommit)
            }
            Refusal::SceneCrc { expected, .. } => {
                let mut bench = Bench::ready();
                let image = two_parts(9);
                let begin = ToDevice::SceneBegin {
                    length: image.len() as u32,
                    crc: expected,
                    layout: LAYOUT_VERSION,
                };
                bench.request(&begin).unwrap();
                for offset in (0..image.len()).step_by(512) {
                    bench.chunk(&image, offset).unwrap();
                }
                bench.request(&ToDevice::SceneCommit)
            }
            Refusal::SceneImage(_) => Bench::ready().upload(&[0x55; 2000]),
            Refusal::Flash => {
                let flash = TestFlash::leaked();
                let mut bench: Bench = Bench::new(flash.clone());
                bench.greet();
                flash.fuse.set(Some(0));
                bench.begin(&two_parts(1))
            }
            Refusal::NotSimulated => {
                let mut bench = Bench::<false, false>::new(TestFlash::leaked());
                bench.greet();
                assert_eq!(bench.request(&ToDevice::Lockstep(true)), Err(reason));
                assert_eq!(bench.request(&ToDevice::Run { ticks: 1 }), Err(reason));
                bench.request(&ToDevice::SimulatedHand(hand()))
            }
            Refusal::Lockstep => Bench::ready().request(&ToDevice::Run { ticks: 1 }),
            Refusal::BadNumber => {
                let mut script = hand();
                script.stiffness = f32::NAN;
                Bench::ready().request(&ToDevice::SimulatedHand(script))
            }
            Refusal::Busy => {
                let mut bench = Bench::ready();
                bench.begin(&two_parts(9)).unwrap();
                bench.request(&ToDevice::Arm)
            }
            Refusal::Rig(_) => {
                let mut rig = arm();
                rig.joints.pop();
                Bench::ready().request(&ToDevice::SetRig(rig))
            }
            Refusal::RigFixed => {
                let mut bench = Bench::<false, false>::new(TestFlash::leaked());
                bench.greet();
                bench.request(&ToDevice::SetRig(arm()))
            }
            Refusal::RigDamaged => {
                let flash = TestFlash::leaked();
                let mut bench: Bench = Bench::new(flash.clone());
                bench.greet();
                bench.upload(&two_parts(1)).unwrap();
                bench.request(&ToDevice::SetRig(arm())).unwrap();
                flash.damage(RIG_SLOTS[0], 100);
                let mut bench: Bench = Bench::new(flash);
                bench.greet();
                bench.request(&ToDevice::Arm)
            }
            Refusal::Outdated => {
                let mut bench = Bench::ready();
                bench.count -= 1;
                bench.request(&ToDevice::Arm)
            }
            Refusal::NoSuchMotor { motors } => Bench::ready().request(&ToDevice::TestMotor {
                joint: motors,
                force: 1.0,
            }),
            Refusal::Undecodable => {
                let mut bench = Bench::ready();
                // A valid frame without a message: variant 255.
                let mut frame = [0; MAX_FRAME];
                let bytes = encode(77, &(255u8, 1u8), &mut frame).unwrap().to_vec();
                bench.forget();
                bench.feed(&bytes);
                match bench.heard.pop_front() {
                    Some(FromDevice::Refused { seq: 77, reason }) => Err(reason),
                    other => panic!("{other:?}"),
                }
            }
        };
        assert_eq!(got, Err(reason));
    }
}

#[test]
fn parameters_keep_what_was_accepted_and_refuse_the_rest() {
    let mut bench = Bench::ready();
    for row in PARAMETERS {
        let id = row.id;
        let answer = bench.ask(&ToDevice::GetParameter(id));
        assert_eq!(
            answer,
            FromDevice::Parameter {
                id,
                value: row.default
            }
        );
        let value = 0.5 * (row.default + row.max);
        bench.request(&ToDevice::SetParameter { id, value }).unwrap();
        for bad in [f32::NAN, f32::INFINITY, row.max * 1.01, -1.0] {
            let refused = Refusal::OutOfRange {
                id,
                min: row.min,
                max: row.max,
            };
            assert_eq!(
                bench.request(&ToDevice::SetParameter { id, value: bad }),
                Err(refused),
                "{}",
                row.name
            );
        }
        assert_eq!(
            bench.ask(&ToDevice::GetParameter(id)),
            FromDevice::Parameter { id, value }
        );
    }
}

#[test]
fn a_full_queue_refuses_and_a_stop_gets_through() {
    let mut bench = Bench::ready();
    bench.request(&ToDevice::Arm).unwrap();
    bench.request(&ToDevice::Grab { part: 1 }).unwrap();
    bench.forget();
    for _ in 0..20 {
        bench.send(&ToDevice::Release);
    }
    let busy = |bench: &Bench| {
        let is = |m: &&FromDevice| {
            matches!(
                m,
                FromDevice::Refused {
                    reason: Refusal::Busy,
                    ..
                }
            )
        };
        bench.heard.iter().filter(is).count()
    };
    assert_eq!(busy(&bench), 12, "eight fit");
    let seq = bench.send(&ToDevice::Stop);
    assert!(bench.heard.contains(&FromDevice::Ack { seq }));
    bench.tick();
    assert_eq!(bench.state(), DeviceState::Stopped);
    assert_eq!(bench.strings.last(), Drive::Off);
}

/// A host that does not read loses answers, and cannot block the board.
#[test]
fn a_full_wire_is_read_from_all_the_same() {
    let mut bench = Bench::ready();
    bench.forget();
    bench.statistics(true);
    bench.wire.capacity = 2 * MAX_FRAME;
    let input: Vec<u8> = (0..500)
        .flat_map(|_| bench.frame(&ToDevice::GetCapabilities))
        .collect();
    bench.link.receive(&input, &mut bench.wire);
    let count = |bench: &Bench| {
        let answers = bench.heard.iter();
        answers
            .filter(|m| matches!(m, FromDevice::Capabilities(_)))
            .count()
    };
    bench.listen();
    let sent = count(&bench);
    assert!(sent > 1, "as long as there was room");
    for _ in 0..20 {
        bench.link.poll(&mut bench.wire);
        bench.listen();
    }
    assert_eq!(count(&bench), sent + 16, "sixteen waited");
    bench.forget();
    assert_eq!(bench.statistics(false).unanswered as usize, 500 - sent - 16);
}

#[test]
fn a_new_session_ends_what_the_old_one_left_running() {
    let mut bench = Bench::ready();
    bench.request(&ToDevice::Arm).unwrap();
    bench.request(&ToDevice::SetTelemetry { every_ticks: 1 }).unwrap();
    bench.send(&ToDevice::Grab { part: 1 });
    // The host has disconnected; another one greets before the grab is processed.
    bench.send(&ToDevice::Hello(Version::own()));
    bench.tick();
    assert_eq!(bench.state(), DeviceState::SoftStop);
    bench.ticks(150);
    assert_eq!(bench.state(), DeviceState::Idle);
    assert_eq!(bench.strings.last(), Drive::Off);
    bench.forget();
    bench.ticks(10);
    assert_eq!(bench.heard.len(), 0, "{:?}", bench.heard);
}

#[test]
fn restart_only_with_motors_off() {
    let mut bench = Bench::ready();
    bench.request(&ToDevice::Arm).unwrap();
    assert_eq!(
        bench.request(&ToDevice::Restart),
        Err(Refusal::State(DeviceState::Armed))
    );
    assert!(!bench.link.restart_requested());
    bench.request(&ToDevice::Stop).unwrap();
    bench.tick();
    assert_eq!(bench.request(&ToDevice::Restart), Ok(()));
    assert!(bench.link.restart_requested());
}

#[test]
fn telemetry_comes_at_the_rate_asked_for_and_what_does_not_fit_is_counted() {
    let mut bench = Bench::ready();
    bench.request(&ToDevice::SetTelemetry { every_ticks: 5 }).unwrap();
    bench.forget();
    bench.ticks(100);
    let count = |bench: &Bench| {
        let is = |m: &&FromDevice| matches!(m, FromDevice::Telemetry(_));
        bench.heard.iter().filter(is).count()
    };
    assert!((19..=20).contains(&count(&bench)), "{}", count(&bench));
    bench.forget();
    // Without a reader for 200 ticks eight samples wait, and the others are counted.
    for _ in 0..200 {
        bench.control.tick();
    }
    bench.ticks(1);
    assert_eq!(count(&bench), 8);
    let dropped = bench.statistics(true).dropped;
    assert!((31..=33).contains(&dropped), "{dropped}");
    assert_eq!(bench.statistics(false).dropped, 0, "reset");
}

#[test]
fn statistics_count_frames_good_and_bad() {
    let mut bench = Bench::ready();
    bench.statistics(true);
    bench.feed(&[1, 2, 3, 0, 0, 0, 9, 0]);
    bench.feed(&[7; 2 * MAX_FRAME]);
    bench.feed(&[0]);
    bench.request(&ToDevice::Heartbeat).unwrap();
    let statistics = bench.statistics(false);
    assert_eq!((statistics.frames, statistics.bad_frames), (2, 3));
}

#[test]
fn logs_are_sent_in_pieces_that_fit() {
    let mut bench = Bench::ready();
    bench.forget();
    let text = [0x5a; 600];
    let mut sent = 0;
    while sent < text.len() {
        sent += bench.link.log(&text[sent..], &mut bench.wire);
        bench.listen();
    }
    let pieces: Vec<usize> = bench
        .heard
        .iter()
        .map(|m| match m {
            FromDevice::Log(bytes) => bytes.len(),
            other => panic!("{other:?}"),
        })
        .collect();
    assert_eq!(pieces, [256, 256, 88]);
    bench.wire.capacity = MAX_FRAME;
    assert_eq!(
        bench.link.log(&text, &mut bench.wire),
        0,
        "room is kept for answers"
    );
}

#[test]
fn targets_are_accepted_and_reported() {
    let mut bench: Bench = Bench::new(TestFlash::leaked());
    bench.ticks(1);
    bench.greet();
    assert_eq!(
        bench.request(&ToDevice::SetTarget(target())),
        Err(Refusal::NoScene)
    );
    let mut bench = Bench::ready();
    assert!(bench.capabilities().max_targets > 0);
    bench.request(&ToDevice::Arm).unwrap();
    bench.request(&ToDevice::Grab { part: 1 }).unwrap();
    bench.request(&ToDevice::SetTarget(target())).unwrap();
    let with = |change: fn(&mut ConstraintTarget)| {
        let mut target = target();
        change(&mut target);
        ToDevice::SetTarget(target)
    };
    let nan = with(|t| t.stiffness = f32::NAN);
    assert_eq!(bench.request(&nan), Err(Refusal::BadNumber));
    for part in [1, 9] {
        let mut target = target();
        target.static_part = part;
        let refused = bench.request(&ToDevice::SetTarget(target));
        assert_eq!(refused, Err(Refusal::NoSuchPart { parts: 2 }));
    }
    bench.request(&ToDevice::SetTelemetry { every_ticks: 1 }).unwrap();
    bench.forget();
    bench.ticks(20);
    let guided = |bench: &Bench| {
        let active = bench.heard.iter().filter_map(|m| match m {
            FromDevice::Telemetry(t) => Some(t.guidance.active),
            _ => None,
        });
        active.fold(None, |_, active| Some(active))
    };
    assert_eq!(guided(&bench), Some(1));
    bench.request(&ToDevice::ClearTarget { id: 1 }).unwrap();
    bench.request(&ToDevice::ClearTarget { id: 1 }).unwrap();
    bench.forget();
    bench.ticks(20);
    assert_eq!(guided(&bench), Some(0));
}

#[test]
fn the_largest_messages_fit() {
    let mut telemetry = Telemetry {
        tick: u32::MAX,
        handle: hand().keyframes[0].pose,
        object: Some((u16::MAX, hand().keyframes[0].pose)),
        wrench: WireWrench::default(),
        contact: WireWrench::default(),
        hand: Some(WireWrench::default()),
        cost: u32::MAX,
        points: u16::MAX,
        flags: u16::MAX,
        missed: u32::MAX,
        dropped: u32::MAX,
        guidance: Guidance {
            active: u8::MAX,
            joints: u8::MAX,
            ..Guidance::default()
        },
        pairs: heapless::Vec::new(),
    };
    while telemetry
        .pairs
        .push(TouchingPair {
            moving_face: u16::MAX,
            static_part: u16::MAX,
            static_face: u16::MAX,
            moving_edge_face: u16::MAX,
            static_edge_face: u16::MAX,
            count: u16::MAX,
            depth: f32::MAX,
            point: [f32::MAX; 3],
            insertion: f32::MAX,
        })
        .is_ok()
    {}
    let mut frame = [0; MAX_FRAME];
    let used = encode(u16::MAX, &FromDevice::Telemetry(telemetry), &mut frame)
        .unwrap()
        .len();
    println!("largest telemetry frame: {used} of {MAX_FRAME} bytes, messages up to {MAX_MESSAGE}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    /// Arbitrary garbage drives no motor and does not block the next valid frame.
    #[test]
    fn garbage_does_nothing(pieces in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..400), 1..20)) {
        let mut bench = Bench::ready();
        for piece in &pieces {
            bench.feed(piece);
            bench.tick();
            prop_assert_eq!(bench.state(), DeviceState::Idle);
        }
        bench.feed(&[0]);
        prop_assert_eq!(bench.request(&ToDevice::Heartbeat), Ok(()));
        prop_assert_eq!(bench.strings.last(), Drive::Off);
    }

    /// Any order of valid messages satisfies the rule: motors driven only in a live state.
    #[test]
    fn any_order_of_messages_keeps_motors_and_state_together(choices in prop::collection::vec((0u8..18, 0u32..150), 1..40)) {
        let mut bench = Bench::ready();
        for (choice, wait) in choices {
            let message = match choice {
                0 | 1 => ToDevice::Arm,
                2 => ToDevice::Disarm,
                3 => ToDevice::Stop,
                4 => ToDevice::ClearFault,
                5 | 6 => ToDevice::Grab { part: u16::from(choice) - 4 },
                7 => ToDevice::Release,
                8 => ToDevice::ResetScene,
                9 => ToDevice::SceneBegin { length: 1000, crc: 0, layout: LAYOUT_VERSION },
                10 => ToDevice::SceneAbort,
                11 => ToDevice::Hello(Version::own()),
                12 => ToDevice::SetParameter { id: ParameterId::ForceLimit, value: 5.0 },
                13 => ToDevice::SetTelemetry { every_ticks: 3 },
                14 => ToDevice::Restart,
                15 => ToDevice::TestMotor { joint: 1, force: -0.5 },
                16 => ToDevice::Place { part: 1, pose: WirePose { position: [0.0, 0.0, 0.05], orientation: [0.0, 0.0, 0.0, 1.0] } },
                _ => ToDevice::Heartbeat,
            };
            bench.send(&message);
            for _ in 0..=wait {
                bench.tick();
                let live = matches!(
                    bench.state(),
                    DeviceState::Armed | DeviceState::Active | DeviceState::SoftStop | DeviceState::Testing
                );
                prop_assert_eq!(bench.strings.last() != Drive::Off, live);
            }
        }
    }
}
