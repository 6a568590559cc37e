//! A rig's description, as bytes from the link or from flash and as a file's text: for any input, an accepted description can be driven.
//!
//! From an accepted description the board builds kinematics and drives motors. So it must give finite positions and currents within its own limits,
//! and must be unchanged after a round trip through bytes; one read from a file must be unchanged after it is written and read again. An even first
//! byte is not part of the description and marks the rest as bytes; `#` and `[`, with which a file begins, are odd.
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

/// Reads it like the board.
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

/// Reads it like the host.
fn from_text(text: &str) {
    let Ok(rig) = parse_rig(text, "rig.toml") else {
        return;
    };
    drive(&rig);
    let written = write_rig(&rig);
    // Six digits: a number at the end of its range may round out of it.
    if let Ok(again) = parse_rig(&written, "rig.toml") {
        assert_eq!(again.joints.len(), rig.joints.len());
        assert_eq!(write_rig(&again), written);
    }
}

/// Forces in postures over the joints' ranges, and beyond them: the commands to the motors stay within their limits.
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
                // Tolerance of two roundings.
                assert!(current.abs() <= joint.current_limit * (1.0 + 1e-6), "{current} A");
            }
        }
    }
}
