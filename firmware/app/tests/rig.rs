//! The rig's description on its way into flash and back: complete or absent, checked, and reported when damaged.

use crate::support::Bench;
use crate::support::flash::TestFlash;
use crate::support::image::two_parts;
use crate::support::rigs::{arm, paddle, pantograph};
use mortise_firmware::board::{RIG_SLOTS, WRITE_SIZE};
use mortise_firmware::store::Store;
use mortise_firmware::store::rig::{Kept, keep, kept};
use mortise_protocol::message::{FromDevice, Refusal, ToDevice};
use mortise_protocol::rig::{Rig, RigFault, RigKey};

#[test]
fn what_is_kept_is_found_again_and_the_newest_counts() {
    let mut flash = TestFlash::leaked();
    assert_eq!(kept(&flash), Kept::Nothing);
    for rig in [arm(), pantograph(), paddle(), arm()] {
        keep(&mut flash, &rig).unwrap();
        assert_eq!(kept(&flash.clone()), Kept::Rig(rig));
    }
}

#[test]
fn power_lost_at_any_operation_leaves_the_old_description_or_the_whole_new_one() {
    let prepared = || {
        let mut flash = TestFlash::leaked();
        for rig in [paddle(), pantograph()] {
            keep(&mut flash, &rig).unwrap();
        }
        flash
    };
    let mut flash = prepared();
    let before = flash.operations.get();
    keep(&mut flash, &arm()).unwrap();
    let operations = flash.operations.get() - before;
    // Erase, description, record.
    assert!(operations > 8, "{operations} operations cover nothing");
    for cut in 1..=operations {
        let mut flash = prepared();
        flash.fuse.set(Some(cut));
        assert_eq!(keep(&mut flash, &arm()), Err(Refusal::Flash), "cut {cut}");
        flash.fuse.set(None);
        assert_eq!(kept(&flash), Kept::Rig(pantograph()), "cut {cut}");
        keep(&mut flash, &arm()).unwrap();
        assert_eq!(kept(&flash), Kept::Rig(arm()));
    }
}

#[test]
fn a_cell_that_fails_is_found_wherever_it_is() {
    let mut flash = TestFlash::leaked();
    keep(&mut flash, &arm()).unwrap();
    // SAFETY: read here only.
    let memory = unsafe { mortise_firmware::board::Flash::slot(&flash, RIG_SLOTS[0]) };
    let length = u32::from_le_bytes(memory[12..16].try_into().unwrap()) as usize;
    for offset in 0..WRITE_SIZE + length {
        flash.damage(RIG_SLOTS[0], offset);
        let found = kept(&flash);
        // In the record: as if never sent. Behind it: reported as damaged.
        let expected = if offset < WRITE_SIZE {
            Kept::Nothing
        } else {
            Kept::Damaged
        };
        assert_eq!(found, expected, "byte {offset}");
        flash.damage(RIG_SLOTS[0], offset);
    }
    assert_eq!(kept(&flash), Kept::Rig(arm()));
}

fn reported(bench: &mut Bench) -> (Option<Rig>, bool) {
    match bench.ask(&ToDevice::GetRig) {
        FromDevice::Rig { rig, in_use } => (rig, in_use),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_description_is_in_use_from_the_next_start_on_and_scenes_stay() {
    let flash = TestFlash::leaked();
    let mut bench: Bench = Bench::new(flash.clone());
    bench.greet();
    bench.upload(&two_parts(1)).unwrap();
    assert_eq!(reported(&mut bench), (None, true));
    bench.request(&ToDevice::SetRig(arm())).unwrap();
    assert_eq!(reported(&mut bench), (Some(arm()), false));
    bench.request(&ToDevice::Arm).unwrap();
    let refused = bench.request(&ToDevice::SetRig(paddle()));
    assert!(matches!(refused, Err(Refusal::State(_))), "{refused:?}");
    let mut bench: Bench = Bench::new(flash.clone());
    bench.greet();
    assert_eq!(reported(&mut bench), (Some(arm()), true));
    assert!(bench.capabilities().scene.is_some());
    assert_eq!(Store::open(flash).rig(), Kept::Rig(arm()));
}

#[test]
fn what_cannot_be_a_rig_is_refused_with_the_reason_and_the_one_before_stays() {
    let mut bench = Bench::ready();
    bench.request(&ToDevice::SetRig(paddle())).unwrap();
    let mut refused = |change: &dyn Fn(&mut Rig)| {
        let mut rig = arm();
        change(&mut rig);
        let answer = bench.request(&ToDevice::SetRig(rig));
        assert_eq!(reported(&mut bench).0, Some(paddle()));
        match answer {
            Err(Refusal::Rig(fault)) => fault,
            other => panic!("{other:?}"),
        }
    };
    let range = |key, joint| move |fault: RigFault| matches!(fault, RigFault::OutOfRange { key: k, joint: j, .. } if (k, j) == (key, joint));
    assert!(range(RigKey::CurrentLimit, 1)(refused(&|rig| rig.joints[1]
        .current_limit =
        31.0)));
    assert!(range(RigKey::Gear, 2)(refused(
        &|rig| rig.joints[2].gear = f32::NAN
    )));
    assert!(range(RigKey::CeilingForce, 0)(refused(&|rig| rig
        .ceilings
        .force =
        f32::INFINITY)));
    assert!(range(RigKey::WristHome, 2)(refused(&|rig| rig
        .wrist
        .as_mut()
        .unwrap()
        .home[2] = -8.0)));
    assert_eq!(
        refused(&|rig| _ = rig.joints.pop()),
        RigFault::Joints { needed: 3 }
    );
    assert_eq!(
        refused(&|rig| rig.joints[0].range = [0.5, 0.5]),
        RigFault::Range { joint: 0 }
    );
    assert_eq!(
        refused(&|rig| rig.joints[1].home = 1.5),
        RigFault::Home { joint: 1 }
    );
    assert_eq!(
        refused(&|rig| rig.joints[0].counts_per_turn = 9e6),
        RigFault::Counts { joint: 0 }
    );
    assert_eq!(
        refused(&|rig| rig.wrist.as_mut().unwrap().axes[1] = [1.0, 0.0, 0.0]),
        RigFault::WristAxes
    );
    assert_eq!(refused(&|rig| rig.ceilings.workspace = 0.02), RigFault::Workspace);
}

#[test]
fn a_real_board_arms_only_with_a_description_in_use() {
    type Real = Bench<false, true>;
    let flash = TestFlash::leaked();
    let mut bench = Real::new(flash.clone());
    bench.greet();
    bench.upload(&two_parts(1)).unwrap();
    assert_eq!(bench.request(&ToDevice::Arm), Err(Refusal::RigDamaged));
    bench.request(&ToDevice::SetRig(arm())).unwrap();
    // It takes effect at the next start: until then nothing is driven.
    assert_eq!(bench.request(&ToDevice::Arm), Err(Refusal::RigDamaged));
    let mut bench = Real::new(flash.clone());
    bench.greet();
    bench.request(&ToDevice::Arm).unwrap();
    // Erased and written only while the motors are off.
    let operations = flash.operations.get();
    let refused = bench.request(&ToDevice::SetRig(paddle()));
    assert!(matches!(refused, Err(Refusal::State(_))), "{refused:?}");
    assert_eq!(flash.operations.get(), operations);
    bench.request(&ToDevice::Stop).unwrap();
    bench.tick();
    bench.request(&ToDevice::SetRig(paddle())).unwrap();
    // A simulated mechanism does not need a description.
    let mut bench: Bench = Bench::ready();
    bench.request(&ToDevice::Arm).unwrap();
}
