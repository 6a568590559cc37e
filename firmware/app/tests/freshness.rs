//! Motors are driven by fresh commands alone, for a scene whose checksum is right, and STOP needs no space in any queue.

use crate::support::Bench;
use crate::support::flash::TestFlash;
use crate::support::image::two_parts;
use mortise_firmware::board::Drive;
use mortise_firmware::store::IMAGE_OFFSET;
use mortise_protocol::message::*;
use mortise_protocol::parameter::ParameterId;

/// A host that writes and never reads: 200 commands fill the answers, the queue and the line, and STOP behind them acts in the next tick.
#[test]
fn stop_behind_200_commands_with_the_output_full_acts_in_one_tick() {
    let mut bench = Bench::ready();
    bench.request(&ToDevice::Arm).unwrap();
    bench.request(&ToDevice::Grab { part: 1 }).unwrap();
    bench.wire.capacity = 0;
    let messages = [
        ToDevice::Release,
        ToDevice::GetRig,
        ToDevice::Arm,
        ToDevice::GetCapabilities,
    ];
    for index in 0..200 {
        let frame = bench.frame(&messages[index % messages.len()]);
        bench.link.receive(&frame, &mut bench.wire);
    }
    let stop = bench.frame(&ToDevice::Stop);
    bench.link.receive(&stop, &mut bench.wire);
    bench.control.tick();
    assert_eq!(bench.strings.last(), Drive::Off);
    assert_eq!(bench.state(), DeviceState::Stopped);
}

/// Clear and arm in one write reach the board before the link plane receives the stop.
#[test]
fn a_damaged_scene_is_not_armed_by_clear_and_arm_in_one_write() {
    let flash = TestFlash::leaked();
    let mut bench: Bench = Bench::new(flash.clone());
    bench.greet();
    bench.upload(&two_parts(1)).unwrap();
    bench.send(&ToDevice::Stop);
    bench.tick();
    flash.damage_in_use(0, IMAGE_OFFSET + 100);
    let both = [ToDevice::ClearFault, ToDevice::Arm].map(|message| bench.frame(&message));
    bench.feed(&both.concat());
    bench.ticks(3);
    assert_eq!(bench.state(), DeviceState::Fault(Fault::SceneDamaged));
    assert_eq!(bench.strings.last(), Drive::Off);
}

/// A parameter set just before another host's `Hello` is in force, and that host reads it.
#[test]
fn what_is_read_behind_a_greeting_is_in_force() {
    let mut bench = Bench::ready();
    let id = ParameterId::WorkspaceRadius;
    bench.send(&ToDevice::SetParameter { id, value: 0.05 });
    bench.send(&ToDevice::Hello(Version::own()));
    bench.forget();
    let FromDevice::Parameter { value, .. } = bench.ask(&ToDevice::GetParameter(id)) else {
        panic!("no value");
    };
    assert_eq!(value, 0.05);
    assert_eq!(bench.control.settings().safety.workspace_m, value);
}

/// Frames that armed once do not arm again behind a STOP, nor in another session.
#[test]
fn replayed_frames_do_not_arm() {
    let mut bench = Bench::ready();
    let frames = [ToDevice::ClearFault, ToDevice::Arm, ToDevice::Grab { part: 1 }].map(|m| bench.frame(&m));
    bench.feed(&frames.concat());
    bench.ticks(2);
    assert_eq!(bench.state(), DeviceState::Active);
    bench.send(&ToDevice::Stop);
    bench.tick();
    for another_session in [false, true] {
        if another_session {
            bench.send(&ToDevice::Hello(Version::own()));
        }
        bench.forget();
        for frame in &frames {
            bench.feed(frame);
            bench.ticks(2);
        }
        assert_eq!(bench.state(), DeviceState::Stopped);
        let outdated = bench.heard.iter().filter(|m| {
            matches!(
                m,
                FromDevice::Refused {
                    reason: Refusal::Outdated,
                    ..
                }
            )
        });
        assert_eq!(outdated.count(), 3);
    }
}
