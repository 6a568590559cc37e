//! A rig's description, as bytes from the link or from flash and as a file's text: whatever they are, what is taken can be driven.
//!
//! From what passes the checks the board builds kinematics and drives motors. So a description that is taken must give finite places, currents within
//! its own limits, and must come back the same from bytes; one that is read from a file must come back from what is written of it. An even first byte
//! is not part of it and says that the rest is bytes; `#` and `[`, with which a file begins, are odd.
#![no_main]

use glam::Vec3;
use libfuzzer_sys::fuzz_target;
use mortise_mechanism::joints::{ENCODERS, Joints};
use mortise_mechanism::kinematics::Model;
use mortise_protocol::limits::MAX_MESSAGE;
use mortise_protocol::rig::Rig;
use mortise_rig::{abilities, parse_rig, write_rig};

fuzz_target!(|data: &[u8]| {
    match data.split_first() {
        Some((way, bytes)) if way & 1 == 0 => from_bytes(bytes),
        _ => {
            if let Ok(text) = std::str::from_utf8(data) {
                from_text(text);
            }
        }
    }
});

/// As the board reads it.
fn from_bytes(bytes: &[u8]) {
    let Ok(rig) = postcard::from_bytes::<Rig>(bytes) else {
        return;
    };
    if rig.check().is_err() {
        assert!(Model::new(&rig).is_err(), "the model asks no less than the check");
        return;
    }
    if Model::new(&rig).is_ok() {
        drive(&rig);
    }
    let mut buffer = [0; MAX_MESSAGE];
    let written = postcard::to_slice(&rig, &mut buffer).expect("it fits a message");
    assert_eq!(postcard::from_bytes::<Rig>(written).as_ref(), Ok(&rig));
}

/// As the host reads it.
fn from_text(text: &str) {
    let Ok(rig) = parse_rig(text, "rig.toml") else {
        return;
    };
    drive(&rig);
    let written = write_rig(&rig);
    // Six digits: a number at the very end of its range may round out of it.
    if let Ok(again) = parse_rig(&written, "rig.toml") {
        assert_eq!(again.joints.len(), rig.joints.len());
        assert_eq!(write_rig(&again), written);
    }
}

/// Forces in postures all over the joints' ranges, and beyond them: what motors are told stays within their limits.
fn drive(rig: &Rig) {
    let found = abilities(rig).expect("what was taken has a home");
    assert!(found.home_mm.iter().all(|mm| mm.is_finite()));
    let mut joints = Joints::new(rig).expect("as before");
    joints.start();
    let mut counts = [0; ENCODERS];
    for step in 0..64u32 {
        for (place, (count, joint)) in counts.iter_mut().zip(&rig.joints).enumerate() {
            let share = (step >> (2 * place) & 3) as f32 / 2.0;
            let angle = joint.range[0] + share * (joint.range[1] - joint.range[0]);
            *count = joints.count(place, angle);
        }
        let reading = joints.read(&counts);
        assert!(reading.handle.is_finite(), "{:?}", reading.handle);
        for force in [Vec3::X, Vec3::Y, Vec3::Z, Vec3::splat(f32::MAX), Vec3::NAN] {
            let currents = joints.currents(force);
            for (current, joint) in currents.iter().zip(&rig.joints) {
                // Two roundings.
                assert!(current.abs() <= joint.current_limit * (1.0 + 1e-6), "{current} A");
            }
        }
    }
}
