//! The test of a single motor: its pulse, its ends, and what refuses it.

use crate::support::Bench;
use crate::support::flash::TestFlash;
use mortise_firmware::board::Drive;
use mortise_firmware::control::testing::{BACK, PUSH_TICKS, TEST_TICKS, TRAVEL_M};
use mortise_protocol::message::*;

const TEST: ToDevice = ToDevice::TestMotor {
    joint: 1,
    force: -0.8,
};

/// Idle, without a scene.
fn idle() -> Bench {
    let mut bench: Bench = Bench::new(TestFlash::leaked());
    bench.greet();
    bench
}

fn testing() -> Bench {
    let mut bench = idle();
    bench.send(&TEST);
    bench.tick();
    assert_eq!(bench.state(), DeviceState::Testing);
    bench.forget();
    bench
}

/// Force at the joint's motor; `None` with the motors off.
fn force(bench: &Bench) -> Option<f32> {
    match bench.strings.last() {
        Drive::Off => None,
        Drive::Joint { joint: 1, force } => Some(force),
        other => panic!("{other:?}"),
    }
}

fn answer(bench: &mut Bench) -> Option<FromDevice> {
    bench
        .heard
        .iter()
        .find(|m| matches!(m, FromDevice::MotorTested(_) | FromDevice::Refused { .. }))
        .cloned()
}

#[test]
fn a_test_pushes_with_the_force_asked_for_and_tells_what_moved_until_it_turns_back() {
    let mut bench = testing();
    let mut forces = vec![force(&bench).unwrap()];
    for tick in 1..TEST_TICKS {
        bench.strings.0.borrow_mut().counts = [7, i32::from(tick), 0, 0, 0, -2];
        bench.tick();
        forces.extend(force(&bench));
    }
    // The tick that ends the test still drives; then the motors are off.
    assert_eq!(force(&bench), None);
    assert_eq!(bench.state(), DeviceState::Idle);
    let (push, rest) = forces.split_at(usize::from(PUSH_TICKS));
    let (back, rest) = rest.split_at(usize::from(PUSH_TICKS));
    assert!(push.iter().all(|&force| (-0.8..=0.0).contains(&force)) && push.contains(&-0.8));
    assert!(back.iter().all(|&force| (0.0..=0.8 * BACK).contains(&force)));
    assert!(rest.iter().all(|&force| force == 0.0));
    let impulse = |forces: &[f32]| forces.iter().sum::<f32>();
    assert!((impulse(back) + BACK * impulse(push)).abs() < 1e-5);
    let expected = MotorTest {
        moved: [7, i32::from(PUSH_TICKS), 0, 0, 0, -2],
        far: false,
    };
    assert_eq!(answer(&mut bench), Some(FromDevice::MotorTested(expected)));
}

#[test]
fn a_handle_that_moves_too_far_turns_the_push_back_in_the_same_tick() {
    let mut bench = testing();
    bench.ticks(10);
    assert!(force(&bench).unwrap() < -0.4);
    bench.strings.pull(|s| s.handle.position.y += 1.01 * TRAVEL_M);
    bench.tick();
    assert!(force(&bench).unwrap() > 0.0);
    // Back where it was: the push does not go on.
    bench.strings.pull(|s| s.handle.position.y = 0.0);
    for _ in 0..12 {
        bench.tick();
        assert!(force(&bench).unwrap() >= 0.0);
    }
    assert_eq!(force(&bench), Some(0.0));
    bench.ticks(u32::from(TEST_TICKS));
    assert!(matches!(
        answer(&mut bench),
        Some(FromDevice::MotorTested(MotorTest { far: true, .. }))
    ));
}

#[test]
fn whatever_turns_motors_off_ends_a_test_at_once_and_answers_it() {
    type End = fn(&mut Bench);
    let ends: [(DeviceState, End); 5] = [
        (DeviceState::Stopped, |bench| _ = bench.send(&ToDevice::Stop)),
        (DeviceState::Idle, |bench| _ = bench.send(&ToDevice::Disarm)),
        (DeviceState::Fault(Fault::StopInput), |bench| {
            bench.strings.pull(|s| s.stop_open = true);
        }),
        (DeviceState::Fault(Fault::OverSpeed), |bench| {
            bench.strings.pull(|s| s.twist.linear.x = 5.0);
        }),
        (DeviceState::Fault(Fault::EncoderJump { axis: 2 }), |bench| {
            bench.strings.pull(|s| s.encoder_jump = Some(2));
        }),
    ];
    for (state, end) in ends {
        let mut bench = testing();
        bench.ticks(10);
        bench.forget();
        end(&mut bench);
        bench.tick();
        assert_eq!(bench.state(), state);
        assert_eq!(bench.strings.last(), Drive::Off, "{state:?}");
        bench.tick();
        match answer(&mut bench) {
            Some(FromDevice::Refused {
                reason: Refusal::State(found),
                ..
            }) => assert_eq!(found, state),
            other => panic!("{state:?}: {other:?}"),
        }
    }
}

#[test]
fn another_program_that_greets_ends_a_test_and_gets_no_answer_to_it() {
    let mut bench = testing();
    bench.ticks(10);
    bench.forget();
    bench.greet();
    assert_eq!(bench.strings.last(), Drive::Off);
    bench.ticks(u32::from(TEST_TICKS));
    assert_eq!(answer(&mut bench), None);
    assert_eq!(bench.state(), DeviceState::Idle);
}

#[test]
fn a_test_is_refused_unless_idle_and_referenced_and_with_a_force_of_its_range() {
    let mut bench = Bench::ready();
    bench.request(&ToDevice::Arm).unwrap();
    assert_eq!(bench.request(&TEST), Err(Refusal::State(DeviceState::Armed)));
    let mut bench = idle();
    for force in [0.0, 0.05, 2.1, -3.0, f32::NAN, f32::INFINITY] {
        let message = ToDevice::TestMotor { joint: 0, force };
        assert_eq!(bench.request(&message), Err(Refusal::BadNumber), "{force}");
    }
    bench.strings.pull(|s| s.referenced = false);
    bench.tick();
    assert_eq!(bench.request(&TEST), Err(Refusal::State(DeviceState::Homing)));
    assert!(bench.strings.0.borrow().drives.iter().all(|d| *d == Drive::Off));
    // A real board without a description does not know its mechanism.
    let mut real = Bench::<false, true>::new(TestFlash::leaked());
    real.greet();
    assert_eq!(real.request(&TEST), Err(Refusal::RigDamaged));
    // It must be fresh.
    let mut bench = Bench::ready();
    bench.count -= 1;
    assert_eq!(bench.request(&TEST), Err(Refusal::Outdated));
}

#[test]
fn flash_is_not_written_during_a_test() {
    let mut bench = testing();
    assert_eq!(bench.begin(&[0; 600]), Err(Refusal::State(DeviceState::Testing)));
}

#[test]
fn readings_are_those_of_the_last_tick() {
    let mut bench = idle();
    bench.strings.0.borrow_mut().counts = [1, -2, 3, 0, 0, 9];
    bench.strings.pull(|s| s.stop_open = true);
    bench.tick();
    bench.forget();
    bench.send(&ToDevice::GetReadings);
    bench.tick();
    let found = bench.heard.iter().find_map(|m| match m {
        FromDevice::Readings(readings) => Some(*readings),
        _ => None,
    });
    let found = found.expect("an answer");
    assert_eq!(found.counts, [1, -2, 3, 0, 0, 9]);
    assert!(found.stop_open && found.referenced && !found.supply_low);
}
