//! The control plane: effect of each fault on the motors and its latency, the ramp, the soft stop, lockstep.

use crate::support::flash::TestFlash;
use crate::support::image::two_parts;
use crate::support::{Bench, IDENTITY};
use glam::{Quat, Vec3};
use mortise_firmware::board::{Drive, DriverFault, DriverFaultKind, Sensed};
use mortise_firmware::control::{FADE_TICKS, RAMP_TICKS, SOFT_STOP_TICKS, Ticked};
use mortise_haptics::Wrench;
use mortise_protocol::message::*;
use mortise_protocol::parameter::ParameterId;

fn active() -> Bench {
    let mut bench = Bench::ready();
    bench.request(&ToDevice::Arm).unwrap();
    bench.request(&ToDevice::Grab { part: 1 }).unwrap();
    assert_eq!(bench.state(), DeviceState::Active);
    bench.forget();
    bench
}

fn armed() -> Bench {
    let mut bench = Bench::ready();
    bench.request(&ToDevice::Arm).unwrap();
    bench.forget();
    bench
}

fn wrench(drive: Drive) -> Wrench {
    match drive {
        Drive::Wrench(wrench) => wrench,
        other => panic!("no wrench: {other:?}"),
    }
}

/// Moves the handle away from the part and waits until the coupling pulls with its largest force.
fn pulled() -> Bench {
    let mut bench = active();
    // Before the ramp ends the part would slip in the handle instead.
    bench.ticks(u32::from(RAMP_TICKS));
    bench.strings.pull(|s| s.handle.position.x = 0.004);
    bench.ticks(20);
    bench
}

fn report(sensed: &mut Sensed, axis: u8, kind: DriverFaultKind) {
    sensed.driver_fault = Some(DriverFault { axis, kind });
}

#[test]
fn motors_are_off_from_the_start_until_armed() {
    let mut bench = Bench::ready();
    bench.ticks(100);
    let pulled = bench.strings.0.borrow();
    assert!(pulled.drives.iter().all(|d| *d == Drive::Off));
    assert!(pulled.drives.len() > 100);
}

#[test]
fn faults_of_the_sensors_turn_the_motors_off_in_the_same_tick() {
    for make in [armed, active] {
        for (name, fault) in [
            ("stop input", Fault::StopInput),
            ("supply", Fault::SupplyLow),
            ("driver", Fault::Driver { axis: 2 }),
            ("current", Fault::OverCurrent { axis: 0 }),
            ("heat", Fault::OverTemperature { axis: 1 }),
            ("encoder", Fault::EncoderJump { axis: 1 }),
            ("stuck", Fault::EncoderStuck { axis: 2 }),
            ("speed", Fault::OverSpeed),
            ("nan", Fault::BadReading),
            ("rotation", Fault::AngularOverSpeed),
            ("posture", Fault::ImpossiblePosture),
        ] {
            let mut bench = make();
            bench.strings.pull(|s| match fault {
                Fault::StopInput => s.stop_open = true,
                Fault::SupplyLow => s.supply_low = true,
                Fault::Driver { axis } => report(s, axis, DriverFaultKind::Any),
                Fault::OverCurrent { axis } => report(s, axis, DriverFaultKind::OverCurrent),
                Fault::OverTemperature { axis } => report(s, axis, DriverFaultKind::OverTemperature),
                Fault::EncoderJump { axis } => s.encoder_jump = Some(axis),
                Fault::EncoderStuck { axis } => s.encoder_stuck = Some(axis),
                Fault::OverSpeed => s.twist.linear = Vec3::new(0.0, 2.1, 0.0),
                Fault::AngularOverSpeed => s.twist.angular = Vec3::new(0.0, 40.1, 0.0),
                Fault::ImpossiblePosture => s.impossible_posture = true,
                _ => s.handle.position.z = f32::NAN,
            });
            bench.tick();
            assert_eq!(bench.strings.last(), Drive::Off, "{name}");
            assert_eq!(bench.state(), DeviceState::Fault(fault), "{name}");
            assert_eq!(bench.fault_heard(), Some(fault), "{name}");
            // Arming is refused with the reason; so is clearing while the sensors still show the cause.
            let state = Refusal::State(DeviceState::Fault(fault));
            assert_eq!(bench.request(&ToDevice::Arm), Err(state), "{name}");
            let lasts = !matches!(
                fault,
                Fault::EncoderJump { .. }
                    | Fault::EncoderStuck { .. }
                    | Fault::OverSpeed
                    | Fault::AngularOverSpeed
                    | Fault::ImpossiblePosture
            );
            if lasts {
                assert_eq!(bench.request(&ToDevice::ClearFault), Err(state), "{name}");
            }
            bench.strings.pull(|s| {
                s.stop_open = false;
                s.supply_low = false;
                s.driver_fault = None;
                s.encoder_jump = None;
                s.encoder_stuck = None;
                s.impossible_posture = false;
                s.twist.angular = Vec3::ZERO;
                s.twist.linear = Vec3::ZERO;
                s.handle.position.z = 0.0;
            });
            bench.tick();
            bench.request(&ToDevice::ClearFault).unwrap();
            assert_eq!(bench.state(), DeviceState::Idle, "{name}");
            bench.request(&ToDevice::Arm).unwrap();
        }
    }
}

/// Without a jump no axis is faulty, and none is named.
#[test]
fn a_lost_reference_is_reported_as_itself() {
    let mut bench = active();
    bench.strings.pull(|s| s.referenced = false);
    bench.tick();
    assert_eq!(bench.strings.last(), Drive::Off);
    assert_eq!(bench.state(), DeviceState::Fault(Fault::ReferenceLost));
    assert_eq!(bench.fault_heard(), Some(Fault::ReferenceLost));
    bench.request(&ToDevice::ClearFault).unwrap();
    assert_eq!(bench.state(), DeviceState::Homing);
}

#[test]
fn a_lost_reference_ends_in_homing_and_is_found_by_the_operator_alone() {
    let mut bench = active();
    let homed = |bench: &Bench| bench.strings.0.borrow().homed;
    let homing = Refusal::State(DeviceState::Homing);
    assert_eq!(
        bench.request(&ToDevice::Home),
        Err(Refusal::State(DeviceState::Active)),
        "not with motors on"
    );
    bench.strings.pull(|s| {
        s.encoder_jump = Some(1);
        s.referenced = false;
    });
    bench.tick();
    assert_eq!(bench.state(), DeviceState::Fault(Fault::EncoderJump { axis: 1 }));
    bench.strings.pull(|s| s.encoder_jump = None);
    bench.tick();
    // Cleared in one tick, without an opportunity to arm in between.
    let clear = bench.send(&ToDevice::ClearFault);
    let arm = bench.send(&ToDevice::Arm);
    bench.ticks(3);
    assert!(bench.heard.contains(&FromDevice::Ack { seq: clear }));
    assert!(bench.heard.contains(&FromDevice::Refused {
        seq: arm,
        reason: homing
    }));
    bench.ticks(1000);
    assert_eq!(bench.state(), DeviceState::Homing);
    assert_eq!(homed(&bench), 0);
    bench.request(&ToDevice::Home).unwrap();
    bench.tick();
    assert_eq!((homed(&bench), bench.state()), (1, DeviceState::Idle));
    bench.request(&ToDevice::Arm).unwrap();
}

#[test]
fn a_board_without_a_reference_starts_in_homing() {
    let mut bench = Bench::<true>::new(TestFlash::leaked());
    bench.strings.pull(|s| s.referenced = false);
    bench.ticks(2);
    assert_eq!(bench.state(), DeviceState::Homing);
    assert_eq!(bench.strings.last(), Drive::Off);
    bench.greet();
    bench.upload(&two_parts(1)).unwrap();
    assert_eq!(
        bench.request(&ToDevice::Arm),
        Err(Refusal::State(DeviceState::Homing))
    );
    bench.request(&ToDevice::Home).unwrap();
    bench.tick();
    assert_eq!(bench.state(), DeviceState::Idle);
}

#[test]
fn beyond_the_workspace_the_handle_is_braked_and_never_pushed_out() {
    let mut bench = active();
    let set = |bench: &mut Bench, id, value| bench.request(&ToDevice::SetParameter { id, value }).unwrap();
    set(&mut bench, ParameterId::WorkspaceRadius, 0.1);
    // Coupled at the origin, carried 2 mm beyond the edge in one go: the coupling pulls it back.
    bench
        .strings
        .pull(|s| s.handle.position = Vec3::new(0.0, 0.102, 0.0));
    for tick in 0..u32::from(SOFT_STOP_TICKS) + 2 {
        bench.tick();
        assert_ne!(bench.state(), DeviceState::Active, "tick {tick}");
        if let Drive::Wrench(wrench) = bench.strings.last() {
            assert!(wrench.force.y <= 0.0, "tick {tick}: {wrench:?}");
        }
    }
    assert_eq!(bench.state(), DeviceState::Fault(Fault::Workspace));
    assert_eq!(bench.fault_heard(), Some(Fault::Workspace));
    // Braking an inward-moving handle would push it outwards, which is not allowed beyond the edge.
    bench.request(&ToDevice::ClearFault).unwrap();
    bench.strings.pull(|s| s.handle.position = Vec3::ZERO);
    bench.tick();
    bench.request(&ToDevice::Arm).unwrap();
    bench.strings.pull(|s| {
        s.handle.position = Vec3::new(0.0, 0.102, 0.0);
        s.twist.linear = Vec3::new(0.5, -1.0, 0.0);
    });
    bench.tick();
    bench.tick();
    let force = wrench(bench.strings.last()).force;
    assert!(force.y <= 0.0 && force.x < -0.5, "{force}");
}

#[test]
fn the_motors_never_give_more_power_than_the_limit() {
    let mut bench = active();
    bench
        .request(&ToDevice::SetParameter {
            id: ParameterId::PowerLimit,
            value: 0.1,
        })
        .unwrap();
    bench.ticks(u32::from(RAMP_TICKS));
    // The part lies 30 mm behind: the coupling pulls towards -x, where the handle moves at 0.1 m/s.
    let velocity = Vec3::new(-0.1, 0.0, 0.0);
    let mut largest = 0.0f32;
    bench.strings.pull(|s| {
        s.handle.position = Vec3::new(0.03, 0.0, 0.0);
        s.twist.linear = velocity;
    });
    for tick in 0..20 {
        bench.tick();
        let power = wrench(bench.strings.last()).force.dot(velocity);
        assert!(power <= 0.1 + 1e-6, "tick {tick}: {power} W");
        largest = largest.max(power);
    }
    assert!(largest > 0.0999, "never met: {largest} W");
}

#[test]
fn what_only_matters_with_motors_on_is_no_fault_without() {
    let mut bench = Bench::ready();
    bench.strings.pull(|s| {
        s.encoder_jump = Some(0);
        s.twist.linear = Vec3::new(9.0, 0.0, 0.0);
    });
    bench.clock.0.set((100, 0));
    bench.ticks(2000);
    assert_eq!(bench.state(), DeviceState::Idle);
    bench.strings.pull(|s| s.stop_open = true);
    bench.tick();
    assert_eq!(bench.state(), DeviceState::Fault(Fault::StopInput));
}

#[test]
fn stop_turns_the_motors_off_in_the_next_tick_and_stays_until_cleared() {
    let mut bench = pulled();
    assert_ne!(wrench(bench.strings.last()), Wrench::ZERO);
    bench.send(&ToDevice::Stop);
    bench.tick();
    assert_eq!(bench.strings.last(), Drive::Off);
    assert_eq!(bench.state(), DeviceState::Stopped);
    assert_eq!(
        bench.request(&ToDevice::Arm),
        Err(Refusal::State(DeviceState::Stopped))
    );
    bench.request(&ToDevice::ClearFault).unwrap();
    assert_eq!(bench.state(), DeviceState::Idle);
}

#[test]
fn commands_older_than_a_stop_do_not_undo_it() {
    let mut bench = armed();
    bench.request(&ToDevice::Stop).unwrap();
    bench.tick();
    // In flight when the second stop arrives.
    bench.send(&ToDevice::ClearFault);
    bench.send(&ToDevice::Arm);
    bench.send(&ToDevice::Stop);
    bench.ticks(3);
    assert_eq!(bench.state(), DeviceState::Stopped);
    assert_eq!(bench.strings.last(), Drive::Off);
}

#[test]
fn a_silent_host_ends_in_a_soft_stop_and_a_fault() {
    let mut bench = pulled();
    bench
        .request(&ToDevice::SetParameter {
            id: ParameterId::HostTimeout,
            value: 0.1,
        })
        .unwrap();
    let mut ticks = 0;
    while bench.state() == DeviceState::Active {
        bench.tick();
        ticks += 1;
        assert!(ticks < 200);
    }
    // A timeout of 100 ticks, counted from the last message.
    assert!((99..=102).contains(&ticks), "{ticks}");
    assert_eq!(bench.state(), DeviceState::SoftStop);
    assert!(matches!(bench.fault_heard(), Some(Fault::HostSilent { silent_ms }) if silent_ms > 99));
    bench.ticks(u32::from(SOFT_STOP_TICKS) + 2);
    assert!(matches!(
        bench.state(),
        DeviceState::Fault(Fault::HostSilent { .. })
    ));
    assert_eq!(bench.strings.last(), Drive::Off);
    bench.request(&ToDevice::ClearFault).unwrap();
    bench.request(&ToDevice::Arm).unwrap();
}

#[test]
fn any_frame_keeps_the_link_alive() {
    let mut bench = active();
    for _ in 0..20 {
        bench.ticks(400);
        bench.send(&ToDevice::Heartbeat);
    }
    assert_eq!(bench.state(), DeviceState::Active);
}

#[test]
fn a_soft_stop_fades_within_its_time_and_never_grows() {
    let mut bench = pulled();
    let before = wrench(bench.strings.last()).force.length();
    assert!(before > 0.02, "nothing to fade: {before}");
    bench.request(&ToDevice::Disarm).unwrap();
    assert_eq!(bench.state(), DeviceState::SoftStop);
    let mut last = before;
    for tick in 1..SOFT_STOP_TICKS {
        let now = wrench(bench.strings.last()).force.length();
        // At rest there is no damping, only the fade.
        assert!(now <= last, "tick {tick}: {now} after {last}");
        if tick >= FADE_TICKS {
            assert_eq!(now, 0.0, "tick {tick}");
        }
        last = now;
        bench.tick();
    }
    assert_eq!(bench.state(), DeviceState::Idle);
    assert_eq!(bench.strings.last(), Drive::Off);
}

#[test]
fn a_soft_stop_brakes_and_stays_below_its_limits() {
    let mut bench = active();
    bench.strings.pull(|s| s.twist.linear = Vec3::new(0.5, 0.0, 0.0));
    bench.request(&ToDevice::Disarm).unwrap();
    bench.ticks(u32::from(FADE_TICKS));
    assert_eq!(wrench(bench.strings.last()).force, Vec3::new(-1.0, 0.0, 0.0));
    bench.strings.pull(|s| s.twist.linear = Vec3::new(0.0, 1.9, 0.0));
    bench.tick();
    let force = wrench(bench.strings.last()).force.length();
    // Two roundings.
    assert!((force - 2.0).abs() < 1e-6, "{force}");
}

#[test]
fn the_wrench_ramps_up_from_zero() {
    let mut bench = active();
    // The hand moves at 0.8 m/s from the start: the part, 0.1 kg, is accelerated to that speed by a coupling whose limit still rises, ∫F dt = m·v.
    let (speed, limit) = (0.8, ParameterId::CouplingForce.row().default);
    let mut forces = Vec::new();
    for i in 0..RAMP_TICKS {
        bench.strings.pull(|s| {
            s.twist.linear = Vec3::new(speed, 0.0, 0.0);
            s.handle.position = 1e-3 * f32::from(i + 1) * s.twist.linear;
        });
        bench.tick();
        forces.push(wrench(bench.strings.last()).force.length());
    }
    let below = |(i, &force): (usize, &f32)| force <= limit * (i + 2) as f32 / f32::from(RAMP_TICKS) + 1e-3;
    assert!(forces.iter().enumerate().all(below), "{forces:?}");
    // F rises by 50 N/s: 0.08 N s are reached after 57 ms, at 2.8 N.
    let peak = forces.iter().copied().fold(0.0, f32::max);
    assert!((2.5..3.1).contains(&peak), "{peak}");
    // The slip is permanent: nothing pulls the part after the hand once both have the same speed.
    assert!(forces[120..].iter().all(|&force| force < 0.05), "{forces:?}");
}

#[test]
fn too_many_late_ticks_in_a_row_are_a_fault() {
    let mut bench = active();
    for _ in 0..2 {
        bench.clock.0.set((1, 0));
        bench.tick();
    }
    bench.tick();
    assert_eq!(bench.state(), DeviceState::Active, "not in a row");
    for _ in 0..u32::from(IDENTITY.overrun_ticks) {
        bench.clock.0.set((1, 0));
        bench.tick();
    }
    assert_eq!(bench.state(), DeviceState::Fault(Fault::TickOverrun));
    assert_eq!(bench.strings.last(), Drive::Off);
    let statistics = bench.statistics(true);
    assert_eq!(statistics.missed_ticks, 5);
    assert_eq!(bench.statistics(false).missed_ticks, 0);
}

#[test]
fn lockstep_runs_what_is_released_and_nothing_else() {
    let mut bench = Bench::ready();
    bench.request(&ToDevice::Lockstep(true)).unwrap();
    let before = bench.control.ticks();
    for _ in 0..10 {
        assert_eq!(bench.tick(), Ticked::Waiting);
    }
    bench.send(&ToDevice::Run { ticks: 7 });
    bench.send(&ToDevice::Arm);
    let ran = (0..20).filter(|_| bench.tick() == Ticked::Ran).count();
    assert_eq!(ran, 7);
    assert_eq!(bench.control.ticks(), before + 7);
    assert_eq!(
        bench.state(),
        DeviceState::Armed,
        "what came behind Run waited for it"
    );
    let order: Vec<_> = bench
        .heard
        .iter()
        .filter(|m| {
            matches!(
                m,
                FromDevice::Ran { .. }
                    | FromDevice::State {
                        state: DeviceState::Armed,
                        ..
                    }
            )
        })
        .collect();
    assert!(
        matches!(order[..], [FromDevice::Ran { .. }, FromDevice::State { .. }]),
        "{order:?}"
    );
    // The host timeout is suspended while time stands still.
    bench.send(&ToDevice::Run { ticks: 5000 });
    bench.ticks(5000);
    assert_eq!(bench.state(), DeviceState::Armed);
    // A stop needs no tick.
    bench.send(&ToDevice::Stop);
    assert_eq!(bench.tick(), Ticked::Waiting);
    assert_eq!(bench.strings.last(), Drive::Off);
    // A new session ends lockstep, even in the middle of a run.
    bench.send(&ToDevice::Run { ticks: u32::MAX });
    bench.ticks(3);
    bench.forget();
    bench.greet();
    assert_eq!(bench.tick(), Ticked::Ran);
}

#[test]
fn lockstep_waits_for_telemetry_instead_of_dropping_it() {
    let mut bench = Bench::ready();
    bench.request(&ToDevice::Lockstep(true)).unwrap();
    bench.request(&ToDevice::SetTelemetry { every_ticks: 1 }).unwrap();
    bench.forget();
    bench.send(&ToDevice::Run { ticks: 100 });
    let mut waited = 0;
    for _ in 0..200 {
        // The link plane runs only every twentieth time.
        for _ in 0..20 {
            if bench.control.tick() == Ticked::Waiting {
                waited += 1;
            }
        }
        bench.link.poll(&mut bench.wire);
        bench.listen();
    }
    let samples = bench
        .heard
        .iter()
        .filter(|m| matches!(m, FromDevice::Telemetry(_)))
        .count();
    assert_eq!(samples, 100);
    assert!(waited > 0);
    bench.forget();
    assert_eq!(bench.statistics(false).dropped, 0);
}

#[test]
fn resetting_is_refused_while_live_and_puts_everything_back() {
    let mut bench = active();
    assert_eq!(
        bench.request(&ToDevice::ResetScene),
        Err(Refusal::State(DeviceState::Active))
    );
    bench.request(&ToDevice::Stop).unwrap();
    bench.tick();
    bench.request(&ToDevice::ResetScene).unwrap();
}

/// A reading that is no number is replaced before the force law sees it, a rotation that is none is refused by the law. Either is reported as a bad reading,
/// by the fault and by the sample's flag, and not as a force that could not be computed.
#[test]
fn a_bad_reading_is_reported_as_itself() {
    let bad: [fn(&mut Sensed); 2] = [
        |s| s.handle.position.z = f32::NAN,
        |s| s.handle.orientation = Quat::from_xyzw(0.0, 0.0, 0.0, 2.0),
    ];
    for spoil in bad {
        let mut bench = active();
        bench.request(&ToDevice::SetTelemetry { every_ticks: 1 }).unwrap();
        bench.forget();
        bench.strings.pull(spoil);
        bench.tick();
        assert_eq!(bench.strings.last(), Drive::Off);
        assert_eq!(bench.fault_heard(), Some(Fault::BadReading));
        let flags = bench.heard.iter().find_map(|m| match m {
            FromDevice::Telemetry(sample) => Some(Flags::from_bits_retain(sample.flags)),
            _ => None,
        });
        assert_eq!(flags, Some(Flags::BAD_INPUT));
    }
}
