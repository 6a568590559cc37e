//! Scenes over the link: interrupted, committed, while motors are live, damaged in flash.

use crate::support::Bench;
use crate::support::flash::TestFlash;
use crate::support::image::two_parts;
use mortise_firmware::board::WRITE_SIZE;
use mortise_firmware::store::IMAGE_OFFSET;
use mortise_protocol::image::{CRC, LAYOUT_VERSION};
use mortise_protocol::message::*;

#[test]
fn an_upload_cut_at_any_chunk_leaves_the_old_scene_after_a_restart() {
    let (old, new) = (two_parts(1), two_parts(2));
    let chunks = new.len().div_ceil(512);
    for sent in 0..=chunks {
        let flash = TestFlash::leaked();
        let mut bench: Bench = Bench::new(flash.clone());
        bench.greet();
        bench.upload(&old).unwrap();
        bench.begin(&new).unwrap();
        for i in 0..sent {
            bench.chunk(&new, i * 512).unwrap();
        }
        // The cable is unplugged; another board starts with this flash.
        let mut bench: Bench = Bench::new(flash);
        bench.greet();
        assert_eq!(
            bench.capabilities().scene,
            Some(CRC.checksum(&old)),
            "after {sent} chunks"
        );
        assert_eq!(bench.request(&ToDevice::Arm), Ok(()));
    }
    assert!(chunks > 2);
}

#[test]
fn a_committed_scene_is_in_use_at_once_and_after_a_restart() {
    let flash = TestFlash::leaked();
    let mut bench: Bench = Bench::new(flash.clone());
    bench.greet();
    assert_eq!(bench.capabilities().scene, None);
    for tag in 1..5 {
        let image = two_parts(tag);
        bench.upload(&image).unwrap();
        assert_eq!(bench.capabilities().scene, Some(CRC.checksum(&image)));
        let mut other: Bench = Bench::new(flash.clone());
        other.greet();
        assert_eq!(other.capabilities().scene, Some(CRC.checksum(&image)));
    }
}

#[test]
fn no_flash_while_motors_are_live_and_no_motors_while_flash_is_written() {
    let mut bench = Bench::ready();
    bench.request(&ToDevice::Arm).unwrap();
    assert_eq!(
        bench.begin(&two_parts(2)),
        Err(Refusal::State(DeviceState::Armed))
    );
    bench.request(&ToDevice::Disarm).unwrap();
    assert_eq!(
        bench.begin(&two_parts(2)),
        Err(Refusal::State(DeviceState::SoftStop))
    );
    bench.ticks(200);
    bench.begin(&two_parts(2)).unwrap();
    assert_eq!(bench.request(&ToDevice::Arm), Err(Refusal::Busy));
    bench.request(&ToDevice::SceneAbort).unwrap();
    bench.request(&ToDevice::Arm).unwrap();

    // Live, but the link plane has not received the state change yet.
    let mut bench = Bench::ready();
    bench.send(&ToDevice::Arm);
    bench.control.tick();
    bench.send(&ToDevice::Hello(Version::own()));
    bench.forget();
    bench.send(&ToDevice::SceneBegin {
        length: 1000,
        crc: 0,
        layout: LAYOUT_VERSION,
    });
    assert!(matches!(
        bench.heard.pop_front(),
        Some(FromDevice::Refused {
            reason: Refusal::Busy,
            ..
        })
    ));

    // Pending requests for statistics and parameters do not count.
    let mut bench = Bench::ready();
    bench.send(&ToDevice::GetStatistics { reset: false });
    let image = two_parts(3);
    let seq = bench.send(&ToDevice::SceneBegin {
        length: image.len() as u32,
        crc: 0,
        layout: LAYOUT_VERSION,
    });
    assert!(bench.heard.contains(&FromDevice::Ack { seq }));

    // An Arm that the control plane has not processed yet counts as live.
    let mut bench = Bench::ready();
    bench.send(&ToDevice::Arm);
    bench.send(&ToDevice::SceneBegin {
        length: 1000,
        crc: 0,
        layout: LAYOUT_VERSION,
    });
    assert!(bench.heard.iter().any(|m| matches!(
        m,
        FromDevice::Refused {
            reason: Refusal::Busy,
            ..
        }
    )));
}

#[test]
fn a_scene_that_changed_in_flash_is_a_fault_when_arming() {
    let flash = TestFlash::leaked();
    let mut bench: Bench = Bench::new(flash.clone());
    bench.greet();
    bench.upload(&two_parts(1)).unwrap();
    flash.damage_in_use(0, IMAGE_OFFSET + 40 * WRITE_SIZE);
    let fault = DeviceState::Fault(Fault::SceneDamaged);
    assert_eq!(bench.request(&ToDevice::Arm), Err(Refusal::State(fault)));
    bench.tick();
    assert_eq!(bench.state(), fault);
    assert_eq!(bench.fault_heard(), Some(Fault::SceneDamaged));
    // Upload again, clear, arm.
    bench.upload(&two_parts(2)).unwrap();
    bench.request(&ToDevice::ClearFault).unwrap();
    bench.request(&ToDevice::Arm).unwrap();
}
