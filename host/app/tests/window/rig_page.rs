//! The workspace for the rig in the running window: a description from an example to the board, and its commissioning on simulated mechanisms, sound
//! ones and ones with a fault in their wiring.

use std::time::{Duration, Instant};

use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT as _, Queryable as _};
use mortise::session::rig_page::RigIntent;
use mortise::session::workspace::Workspace;
use mortise::session::{Intent, Session, obstacle};
use mortise::ui::Window;
use mortise_protocol::message::DeviceState;
use mortise_rig::commissioning::{Commissioning, Outcome, Step};
use mortise_rig::{EXAMPLES, RigSpec};

use crate::common::{click, harness, until};

/// A window in the workspace for the rig, connected to a simulation that uses an example.
pub fn described(example: &str) -> Harness<'static, Window> {
    let mut harness = harness();
    until(&mut harness, "rigs are listed", |s| !s.rigs.is_empty());
    let simulation = RigSpec::Simulated { realtime: true };
    assert_eq!(harness.state().session.chosen, simulation);
    click(&mut harness, "Set up rig");
    assert_eq!(harness.state().session.workspace, Workspace::Rig);
    let none = Intent::Rig(RigIntent::Send);
    assert_eq!(
        obstacle(&harness.state().session, &none).as_deref(),
        Some("No rig is connected")
    );
    click(&mut harness, "Connect");
    until(&mut harness, "the description was read", |s| {
        s.rig_page.on_board.is_some()
    });
    let _ = harness.get_by_label("The board keeps no description.");
    assert!(harness.get_by_label("Begin").accesskit_node().is_disabled());
    click(&mut harness, "Examples of descriptions");
    click(&mut harness, example);
    click(&mut harness, "Send to board");
    until(&mut harness, "the board uses it", |s| s.rig_page.is_in_use());
    harness.run_steps(3);
    until(&mut harness, "loops were sampled", |s| s.history.len() > 20);
    harness.run_steps(2);
    let _ = harness.get_by_label("Histogram of the loop time");
    harness
}

fn steps(session: &Session) -> &Commissioning {
    session.rig_page.steps.as_ref().expect("commissioning")
}

fn outcome(session: &Session, step: Step) -> Outcome {
    let found = steps(session).steps().find(|(known, _)| *known == step);
    found
        .map(|(_, outcome)| outcome.clone())
        .expect("a step of this rig")
}

fn choose_wiring(harness: &mut Harness<'_, Window>, name: &str) {
    click(harness, "Wiring");
    click(harness, name);
    pause(harness, 100);
}

/// Draws frames for some time.
fn pause(harness: &mut Harness<'_, Window>, ms: u64) {
    let begun = Instant::now();
    while begun.elapsed() < Duration::from_millis(ms) {
        harness.step();
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Has the simulated hand turn the joint of the present step, and says so.
fn turn(harness: &mut Harness<'_, Window>) {
    click(harness, "Let the simulated hand do it");
    // It goes to the reference pose first.
    pause(harness, 1_800);
    click(harness, "I have turned it");
    harness.run_steps(2);
}

/// Takes every step up to `last`, as an operator would.
fn take_until(harness: &mut Harness<'_, Window>, last: impl Fn(Option<Step>) -> bool) {
    let begun = Instant::now();
    loop {
        assert!(begun.elapsed() < Duration::from_secs(120), "never there");
        let step = steps(&harness.state().session).step();
        if last(step) {
            return;
        }
        let at = steps(&harness.state().session).at();
        match step {
            None => return,
            Some(Step::Encoder(_)) => turn(harness),
            Some(Step::Send) => {
                pause(harness, 100);
                if steps(&harness.state().session).at() == at {
                    click(harness, "Send them now");
                    until(harness, "corrections are sent", |s| steps(s).at() > at);
                }
            }
            Some(Step::Reference) => {
                click(harness, "Set reference");
                until(harness, "the reference is set", |s| s.rig_page.busy.is_none());
            }
            Some(Step::StopInput) => {
                pause(harness, 100);
                click(harness, "Let the simulated hand do it");
                until(harness, "the button was released", |s| steps(s).at() > at);
                until(harness, "stopped", |s| {
                    matches!(s.device(), Some(DeviceState::Fault(_)))
                });
                click(harness, "Clear stop");
                until(harness, "cleared", |s| s.device() == Some(DeviceState::Idle));
            }
            Some(Step::Motor(_)) => {
                click(harness, "Test motor");
                until(harness, "the motor was tested", |s| s.rig_page.busy.is_none());
            }
            Some(Step::Workspace) => {
                pause(harness, 100);
                click(harness, "Let the simulated hand do it");
                pause(harness, 5_000);
                click(harness, "I have been everywhere");
                harness.run_steps(2);
            }
        }
        let session = &harness.state().session;
        if steps(session).at() == at {
            panic!("{step:?}: {:?}", steps(session).outcome());
        }
    }
}

#[test]
fn a_rig_is_described_and_commissioned_from_first_to_last_step() {
    let mut harness = described("hapkit");
    assert_eq!(
        harness
            .state()
            .session
            .connection()
            .expect("connected")
            .capabilities
            .force_axes,
        1
    );
    click(&mut harness, "Begin");
    take_until(&mut harness, |step| step.is_none());
    let session = &harness.state().session;
    for (step, outcome) in steps(session).steps() {
        assert!(matches!(outcome, Outcome::Passed(_)), "{step:?}: {outcome:?}");
    }
    let _ = harness.get_by_label("Every step is done: the rig is as described.");
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("report.md");
    harness
        .state_mut()
        .session
        .act(Intent::Rig(RigIntent::WriteReport {
            path: path.clone(),
            replace: false,
        }));
    until(&mut harness, "written", |_| path.exists());
    let report = std::fs::read_to_string(&path).expect("a report");
    assert!(
        report.contains("| 5. Motor 1 | passed | motor 1 pushes forward |"),
        "{report}"
    );
    assert!(
        report.contains("radius_mm") && report.contains("1000 Hz"),
        "{report}"
    );
    click(&mut harness, "End commissioning");
    assert!(harness.state().session.rig_page.steps.is_none());
    click(&mut harness, "Assemble");
    assert_eq!(harness.state().session.workspace, Workspace::Assemble);
}

#[test]
fn wrong_senses_are_corrected_and_sent_and_can_be_taken_back() {
    let mut harness = described("hapkit");
    choose_wiring(&mut harness, "encoder 1 reversed");
    click(&mut harness, "Begin");
    turn(&mut harness);
    let session = &harness.state().session;
    assert!(matches!(
        outcome(session, Step::Encoder(0)),
        Outcome::Corrected(_)
    ));
    let _ = harness.get_by_label("joint 1: encoder_reversed = true");
    click(&mut harness, "Back");
    assert_eq!(steps(&harness.state().session).at(), 0);
    assert!(steps(&harness.state().session).changes().is_empty());
    turn(&mut harness);
    take_until(&mut harness, |step| step == Some(Step::Reference));
    let session = &harness.state().session;
    let (kept, in_use) = session.rig_page.on_board.as_ref().expect("read");
    assert!(kept.as_ref().expect("a description").joints[0].encoder_reversed && *in_use);
    assert!(session.rig_page.text().contains("encoder_reversed = true"));
    // The corrected description is right: what is turned forward counts forward.
    click(&mut harness, "End commissioning");
    click(&mut harness, "Begin");
    turn(&mut harness);
    assert!(matches!(
        outcome(&harness.state().session, Step::Encoder(0)),
        Outcome::Passed(_)
    ));
}

#[test]
fn a_motor_that_pushes_backward_is_corrected() {
    let mut harness = described("hapkit");
    choose_wiring(&mut harness, "motor 1 reversed");
    click(&mut harness, "Begin");
    take_until(&mut harness, |step| step == Some(Step::Workspace));
    let session = &harness.state().session;
    assert!(matches!(outcome(session, Step::Motor(0)), Outcome::Corrected(_)));
    let (kept, in_use) = session.rig_page.on_board.as_ref().expect("read");
    assert!(kept.as_ref().expect("a description").joints[0].motor_reversed && *in_use);
}

/// Nothing is driven while a step before the motors fails, and its words name the fault.
#[test]
fn a_dead_encoder_a_dead_motor_and_a_broken_stop_wire_are_named() {
    let mut harness = described("haply_2diy");
    choose_wiring(&mut harness, "encoder 1 unplugged");
    click(&mut harness, "Begin");
    turn(&mut harness);
    let words = outcome(&harness.state().session, Step::Encoder(0))
        .words()
        .to_owned();
    assert!(words.contains("encoder 1 does not count"), "{words}");
    let _ = harness.get_all_by_label(&words).count();
    assert_eq!(steps(&harness.state().session).at(), 0);
    let intent = Intent::Rig(RigIntent::TestMotor);
    assert!(obstacle(&harness.state().session, &intent).is_some());
    choose_wiring(&mut harness, "as described");
    take_until(&mut harness, |step| step == Some(Step::StopInput));
    pause(&mut harness, 300);
    choose_wiring(&mut harness, "wire of the stop button broken");
    until(&mut harness, "the open input is seen", |s| {
        matches!(steps(s).outcome(), Outcome::Failed(_)) || s.device() != Some(DeviceState::Idle)
    });
    pause(&mut harness, 200);
    // From here on as for a button that stays open.
    click(&mut harness, "Nothing happens");
    let words = steps(&harness.state().session).outcome().words().to_owned();
    assert!(words.contains("wire is broken"), "{words}");
    choose_wiring(&mut harness, "motor 1 unplugged");
    pause(&mut harness, 300);
    if steps(&harness.state().session).step() == Some(Step::StopInput) {
        // The first reading of the step came after the wire had broken.
        take_until(&mut harness, |step| step != Some(Step::StopInput));
    } else {
        click(&mut harness, "Clear stop");
        until(&mut harness, "cleared", |s| s.device() == Some(DeviceState::Idle));
    }
    assert_eq!(steps(&harness.state().session).step(), Some(Step::Motor(0)));
    click(&mut harness, "Test motor");
    until(&mut harness, "tested", |s| s.rig_page.busy.is_none());
    let words = steps(&harness.state().session).outcome().words().to_owned();
    assert!(words.contains("motor 1 moves nothing"), "{words}");
    assert_eq!(
        steps(&harness.state().session).step(),
        Some(Step::Motor(0)),
        "the next is not driven"
    );
}

#[test]
fn a_description_is_checked_while_it_is_written_and_a_damaged_one_is_not_sent() {
    let mut harness = harness();
    harness.step();
    click(&mut harness, "Set up rig");
    let (_, text) = EXAMPLES[2];
    let session = &mut harness.state_mut().session;
    session.act(Intent::Rig(RigIntent::Edit(
        text.replace("gear = 16", "gear = 0"),
    )));
    harness.run_steps(2);
    let page = &harness.state().session.rig_page;
    let why = page.checked().expect("text").expect_err("no gear").to_owned();
    assert!(why.contains("gear") && why.contains("1000"), "{why}");
    let _ = harness.get_by_label(&why);
    let save = Intent::Rig(RigIntent::Save);
    assert!(obstacle(&harness.state().session, &save).is_some());
    // A backup comes back as it was written.
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("rig.toml");
    let session = &mut harness.state_mut().session;
    session.act(Intent::Rig(RigIntent::Example(0)));
    let before = session.rig_page.text().to_owned();
    session.act(Intent::Rig(RigIntent::Write {
        path: path.clone(),
        replace: false,
    }));
    until(&mut harness, "written", |_| path.exists());
    let session = &mut harness.state_mut().session;
    session.act(Intent::Rig(RigIntent::Edit(String::new())));
    session.act(Intent::Rig(RigIntent::Load(path)));
    assert_eq!(session.rig_page.text(), before);
    session.act(Intent::Rig(RigIntent::Load(folder.path().join("none.toml"))));
    assert!(session.notes.iter().any(|note| note.text.contains("none.toml")));
    assert_eq!(
        session.rig_page.text(),
        before,
        "a file that cannot be read changes nothing"
    );
}

#[test]
fn another_description_that_is_sent_ends_commissioning_and_keeps_its_text() {
    let mut harness = described("hapkit");
    click(&mut harness, "Begin");
    assert!(harness.state().session.rig_page.steps.is_some());
    let (_, text) = EXAMPLES[2];
    let session = &mut harness.state_mut().session;
    session.act(Intent::Rig(RigIntent::Edit(text.to_owned())));
    harness.run_steps(2);
    click(&mut harness, "Send to board");
    until(&mut harness, "the board uses it", |s| s.rig_page.is_in_use());
    let page = &harness.state().session.rig_page;
    assert!(page.steps.is_none(), "the steps were those of another mechanism");
    assert_eq!(page.text(), text, "with its comments");
}
