//! What the window says of rigs before they are connected, when they cannot be, and when they report a fault.

use egui_kittest::kittest::Queryable as _;
use mortise::session::notes::Severity;
use mortise::session::{Intent, Session};
use mortise_protocol::message::{DeviceState, InputFault, InputFaultKind, ToDevice};
use mortise_rig::RigSpec;

use crate::common::{arm, click, connect, harness, open_sample, until};

#[test]
fn rigs_are_listed_by_themselves_and_the_simulation_is_among_them() {
    let mut harness = harness();
    until(&mut harness, "rigs are listed", |s| !s.rigs.is_empty());
    let simulation = RigSpec::Simulated { realtime: true };
    let session = &harness.state().session;
    let entry = session.rigs.iter().find(|rig| rig.spec == simulation);
    assert!(
        entry.is_some_and(|rig| rig.label.contains("Simulation")),
        "{:?}",
        session.rigs
    );
    assert_eq!(session.chosen, simulation, "it needs nothing that may be missing");
    click(&mut harness, "Rescan");
    until(&mut harness, "they are listed again", |s| !s.rigs.is_empty());
}

#[test]
fn a_fault_is_stated_with_its_cause_and_motors_stay_off() {
    let mut harness = harness();
    open_sample(&mut harness);
    connect(&mut harness);
    arm(&mut harness);
    let connection = harness.state().session.connection().expect("connected");
    let open = InputFault {
        tick: 0,
        ticks: 200,
        kind: InputFaultKind::StopOpen,
    };
    connection.request(ToDevice::SimulatedInputs([open].into_iter().collect()));
    until(&mut harness, "the fault", |s| {
        matches!(s.device(), Some(DeviceState::Fault(_)))
    });
    harness.run_steps(2);
    assert!(harness.get_all_by_label_contains("stop input").count() > 0);
    assert!(!harness.state().session.is_armed());
}

fn failed(session: &Session, words: &str) -> bool {
    (session.notes.iter()).any(|note| note.severity == Severity::Error && note.text.contains(words))
}

/// A port that the operator may not open, as the group of serial ports is on most systems.
#[cfg(target_os = "linux")]
#[test]
fn a_port_without_permission_says_how_to_get_it() {
    use std::os::unix::fs::PermissionsExt;

    let folder = tempfile::tempdir().expect("a folder");
    let port = folder.path().join("ttyACM0");
    std::fs::write(&port, "").expect("written");
    std::fs::set_permissions(&port, std::fs::Permissions::from_mode(0o000)).expect("no permission");
    std::fs::set_permissions(folder.path(), std::fs::Permissions::from_mode(0o755)).expect("readable");
    let mut harness = harness();
    harness.step();
    let spec: RigSpec = port.to_str().expect("text").parse().expect("a port");
    harness.state_mut().session.act(Intent::ChooseRig(spec));
    // The administrator may open every file; threads that this one starts have the identity that it has then.
    // SAFETY: changes which user this thread is to the file system, and nothing else.
    let before = unsafe { libc::setfsuid(65_534) };
    harness.state_mut().session.act(Intent::Connect);
    // SAFETY: as above.
    unsafe { libc::setfsuid(before as libc::uid_t) };
    until(&mut harness, "it is refused", |s| {
        s.notes.iter().any(|n| n.severity == Severity::Error)
    });
    let session = &harness.state().session;
    assert!(failed(session, "ttyACM0"), "{:?}", session.notes);
    assert!(
        failed(session, "group") || failed(session, "permission"),
        "{:?}",
        session.notes
    );
}

/// Firmware of another release: both are named, with what to do.
#[cfg(unix)]
#[test]
fn firmware_of_another_version_is_named_before_anything_is_sent() {
    use std::io::{Read as _, Write as _};
    use std::time::Duration;

    use mortise_protocol::frame::{Decoder, encode};
    use mortise_protocol::message::{FromDevice, Version};

    use crate::common::terminal;

    let (mut master, port, held) = terminal();
    let other = Version {
        schema: 0xdead_beef,
        release: [9, 8, 7],
    };
    let board = std::thread::spawn(move || {
        let (mut decoder, mut greetings) = (Decoder::new(), 0);
        let mut bytes = [0; 256];
        let begun = std::time::Instant::now();
        // The window hangs up by itself; the thread ends then at the latest.
        while begun.elapsed() < Duration::from_secs(10) && greetings == 0 {
            let count = master.read(&mut bytes).unwrap_or(0);
            for byte in &bytes[..count] {
                if let Some(Ok((sequence, ToDevice::Hello(_)))) = decoder.push::<ToDevice>(*byte) {
                    let mut out = [0; 512];
                    let frame = encode(sequence, &FromDevice::Hello(other), &mut out).expect("it fits");
                    master.write_all(frame).expect("written");
                    greetings += 1;
                }
            }
        }
        // Until the window has read the answer.
        std::thread::sleep(Duration::from_secs(1));
        greetings
    });
    let mut harness = harness();
    harness.step();
    harness
        .state_mut()
        .session
        .act(Intent::ChooseRig(port.parse().expect("a port")));
    click(&mut harness, "Connect");
    until(&mut harness, "it is refused", |s| {
        s.notes.iter().any(|n| n.severity == Severity::Error)
    });
    let session = &harness.state().session;
    assert!(
        failed(session, "9.8.7") && failed(session, env!("CARGO_PKG_VERSION")),
        "{:?}",
        session.notes
    );
    assert!(
        failed(session, "flash the firmware of this release"),
        "{:?}",
        session.notes
    );
    assert_eq!(session.device(), None);
    assert_eq!(board.join().expect("it ends"), 1);
    drop(held);
}
