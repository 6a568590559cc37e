//! Firmware written from the running window, through a simulated debug probe, with faults.
#![cfg(unix)]

use std::path::PathBuf;

use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT as _, Queryable as _};
use mortise::session::flashing::FlashIntent;
use mortise::session::notes::Severity;
use mortise::session::{Intent, obstacle};
use mortise::ui::Window;
use mortise_flash::simulated::{self, Fault, SimulatedProbe};
use mortise_protocol::label::Label;

use crate::common::{arm, click, connect, harness, open_sample, until};

/// The page on the rig with a simulated probe, and firmware in its folder.
fn page(
    fault: Fault,
) -> (
    Harness<'static, Window>,
    SimulatedProbe,
    tempfile::TempDir,
    PathBuf,
) {
    let folder = tempfile::tempdir().expect("a folder");
    let probe = SimulatedProbe::new(folder.path(), fault).expect("a probe");
    let file = folder.path().join("firmware");
    std::fs::write(
        &file,
        simulated::firmware(&Label::new("some-board", "STM32H743ZITx")),
    )
    .expect("written");
    let mut harness = harness();
    click(&mut harness, "Set up rig");
    harness.state_mut().session.flashing.prober = Some(probe.prober());
    (harness, probe, folder, file)
}

fn choose(harness: &mut Harness<'_, Window>, file: PathBuf) {
    harness
        .state_mut()
        .session
        .act(Intent::Flash(FlashIntent::Choose(file)));
    harness.run_steps(2);
}

#[test]
fn firmware_is_chosen_written_and_started() {
    let (mut harness, probe, folder, file) = page(Fault::None);
    let write = harness.get_by_label("Write firmware");
    assert!(write.accesskit_node().is_disabled());
    let none = obstacle(&harness.state().session, &Intent::Flash(FlashIntent::Write));
    assert_eq!(none.as_deref(), Some("Choose the file of the firmware first"));
    let text = folder.path().join("part.step");
    std::fs::write(&text, "ISO-10303-21;").expect("written");
    choose(&mut harness, text);
    harness.get_by_label_contains("is no firmware for a board");
    choose(&mut harness, file);
    harness.get_by_label("some-board, release 0.1.0");
    assert_eq!(probe.flash(), None, "choosing writes nothing");
    click(&mut harness, "Write firmware");
    until(&mut harness, "written", |s| {
        (s.notes.iter()).any(|note| note.text.contains("some-board has its firmware"))
    });
    assert_eq!(
        probe.flash(),
        Some(simulated::firmware(&Label::new("some-board", "STM32H743ZITx")))
    );
}

#[test]
fn each_fault_is_stated_and_the_window_can_try_again() {
    for (fault, words) in [
        (Fault::Unplugged, "no debug probe is found"),
        (Fault::Forbidden, "udev"),
        (Fault::Two, "several debug probes"),
        (Fault::Unpowered, "check the board's power"),
        (Fault::Pulled, "USB Communication Error"),
        (Fault::Worn, "verification failed"),
        (Fault::Unlisted, "nothing was written"),
        (Fault::NotReset, "press its reset button"),
    ] {
        let (mut harness, _probe, _folder, file) = page(fault);
        choose(&mut harness, file);
        click(&mut harness, "Write firmware");
        until(&mut harness, "it ended", |s| s.flashing.writing().is_none());
        let session = &harness.state().session;
        let stated = |severity| {
            (session.notes.iter()).any(|note| note.severity == severity && note.text.contains(words))
        };
        assert!(stated(Severity::Error), "{fault:?}");
        assert_eq!(obstacle(session, &Intent::Flash(FlashIntent::Write)), None);
    }
}

#[test]
fn a_silent_probe_is_given_up_by_the_operator() {
    let (mut harness, _probe, _folder, file) = page(Fault::Silent);
    choose(&mut harness, file);
    click(&mut harness, "Write firmware");
    until(&mut harness, "it says something", |s| {
        s.flashing.writing() == Some("Erasing")
    });
    harness.run_steps(2);
    harness.get_by_label("Erasing…");
    let again = obstacle(&harness.state().session, &Intent::Flash(FlashIntent::Write));
    assert_eq!(again.as_deref(), Some("Firmware is being written"));
    click(&mut harness, "End writing");
    until(&mut harness, "it ended", |s| s.flashing.writing().is_none());
}

#[test]
fn an_armed_rig_is_not_written_to() {
    let (mut harness, _probe, _folder, file) = page(Fault::None);
    click(&mut harness, "Assemble");
    open_sample(&mut harness);
    connect(&mut harness);
    arm(&mut harness);
    choose(&mut harness, file);
    let armed = obstacle(&harness.state().session, &Intent::Flash(FlashIntent::Write));
    assert_eq!(armed.as_deref(), Some("The rig is armed: disarm it first"));
}
