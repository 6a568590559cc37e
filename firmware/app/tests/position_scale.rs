//! Position scaling: the handle moved by p with the scale s is the handle moved by s·p without, felt s times as strongly.

use crate::support::Bench;
use glam::{Quat, Vec3};
use mortise_firmware::board::Drive;
use mortise_firmware::control::RAMP_TICKS;
use mortise_haptics::Wrench;
use mortise_protocol::message::{FromDevice, ToDevice};
use mortise_protocol::parameter::ParameterId;
use proptest::prelude::*;

/// Armed, nothing held, every tick reported.
fn armed() -> Bench {
    let mut bench = Bench::ready();
    bench.request(&ToDevice::Arm).unwrap();
    bench.request(&ToDevice::SetTelemetry { every_ticks: 1 }).unwrap();
    bench
}

fn set(bench: &mut Bench, id: ParameterId, value: f32) {
    bench.request(&ToDevice::SetParameter { id, value }).unwrap();
}

/// Part 1 held, the ramp of the coupling over.
fn grab(bench: &mut Bench) {
    bench.request(&ToDevice::Grab { part: 1 }).unwrap();
    bench.ticks(u32::from(RAMP_TICKS));
}

/// Moves the handle for a tick; returns the wrench on it and the position of the part.
fn tick(bench: &mut Bench, position: Vec3, velocity: Vec3, turn: f32) -> (Wrench, Vec3) {
    bench.strings.pull(|s| {
        s.handle.position = position;
        s.handle.orientation = Quat::from_rotation_z(turn);
        s.twist.linear = velocity;
    });
    bench.heard.clear();
    bench.tick();
    let part = bench.heard.iter().find_map(|message| match message {
        FromDevice::Telemetry(sample) => sample.object.map(|(_, pose)| Vec3::from_array(pose.position)),
        _ => None,
    });
    match bench.strings.last() {
        Drive::Wrench(wrench) => (wrench, part.unwrap_or_else(|| panic!("{:?}", bench.heard))),
        other => panic!("no wrench: {other:?}, {:?}", bench.state()),
    }
}

/// A hand that swings, m, m/s and rad, at tick `k`.
fn hand(k: u32, swing: Vec3) -> (Vec3, Vec3, f32) {
    let phase = 0.03 * k as f32;
    let position = swing * (1.0 - phase.cos());
    (position, swing * (30.0 * phase.sin()), 0.02 * phase.sin())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    /// The oracle is the board without scaling: nothing but the force law knows what a scale of s has to do.
    #[test]
    fn a_scaled_handle_is_a_larger_motion_felt_as_strongly(
        scale in 0.1f32..10.0,
        swing in prop::array::uniform3(-0.002f32..0.002),
    ) {
        let (mut scaled, mut plain) = (armed(), armed());
        set(&mut scaled, ParameterId::PositionScale, scale);
        for bench in [&mut scaled, &mut plain] {
            // Limits are in force at the real handle, which is another one in each.
            set(bench, ParameterId::ForceLimit, 20.0);
            set(bench, ParameterId::ForceSlew, 20_000.0);
            set(bench, ParameterId::PowerLimit, 100.0);
            grab(bench);
        }
        // So weak that none is reached.
        let swing = Vec3::from_array(swing) / (scale.max(1.0) * scale.max(1.0));
        for k in 0..300 {
            let (position, velocity, turn) = hand(k, swing);
            let (felt, part) = tick(&mut scaled, position, velocity, turn);
            let (of_law, same_part) = tick(&mut plain, scale * position, scale * velocity, turn);
            let force_error = (felt.force - scale * of_law.force).length();
            prop_assert!(force_error < 1e-4 * scale, "tick {}: {:?} {:?}", k, felt, of_law);
            prop_assert!((felt.torque - of_law.torque).length() < 1e-5);
            prop_assert!((part - same_part).length() < 1e-7, "tick {}: {} {}", k, part, same_part);
        }
    }

    #[test]
    fn limits_of_force_hold_at_the_real_handle(scale in 0.1f32..10.0, limit in 0.3f32..3.0) {
        let mut bench = armed();
        set(&mut bench, ParameterId::PositionScale, scale);
        set(&mut bench, ParameterId::ForceLimit, limit);
        set(&mut bench, ParameterId::ForceSlew, 1_000.0);
        // So heavy that it hardly follows.
        set(&mut bench, ParameterId::ObjectMass, 5.0);
        grab(&mut bench);
        let mut last = Vec3::ZERO;
        let mut largest = 0.0f32;
        for k in 0..300 {
            let position = Vec3::new(0.001 * k as f32, 0.0, 0.0);
            let (wrench, _) = tick(&mut bench, position, Vec3::X, 0.0);
            prop_assert!(wrench.force.length() <= limit * 1.00001, "tick {}: {}", k, wrench.force);
            prop_assert!((wrench.force - last).length() <= 1.0001, "tick {}: {}", k, wrench.force);
            last = wrench.force;
            largest = largest.max(last.length());
        }
        // With a small scale the handle is too slow in the law for the coupling to pull so much.
        prop_assert!(scale < 0.5 || largest > 0.99 * limit, "{}", largest);
    }
}

/// A change while a part is held would move the part; it holds from the next grab on.
#[test]
fn a_change_waits_for_the_next_grab() {
    let (mut changed, mut plain) = (armed(), armed());
    for bench in [&mut changed, &mut plain] {
        grab(bench);
    }
    for k in 0..200 {
        if k == 50 {
            set(&mut changed, ParameterId::PositionScale, 4.0);
            // As many ticks as the request took.
            set(&mut plain, ParameterId::ContactDamping, 0.0005);
        }
        let (position, velocity, turn) = hand(k, Vec3::new(0.001, 0.0, 0.0));
        let of_changed = tick(&mut changed, position, velocity, turn);
        assert_eq!(of_changed, tick(&mut plain, position, velocity, turn), "tick {k}");
    }
    changed.request(&ToDevice::Release).unwrap();
    grab(&mut changed);
    let (from, _, turn) = hand(199, Vec3::new(0.001, 0.0, 0.0));
    let mut rests_at = |position| {
        let ticks = (0..120).map(|_| tick(&mut changed, position, Vec3::ZERO, turn).1);
        ticks.last().expect("some")
    };
    let step = Vec3::new(0.0, 0.0005, 0.0);
    let (before, after) = (rests_at(from), rests_at(from + step));
    assert!(
        (after - before - 4.0 * step).length() < 1e-5,
        "{}",
        after - before
    );
}
