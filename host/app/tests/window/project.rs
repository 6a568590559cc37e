//! Projects: what is done with a model comes back when it is opened again, also after the program was killed, and from a file of the user.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use crate::common::{arm, click, connect, harness_on, until, worst};
use egui_kittest::Harness;
use glam::{DAffine3, DQuat, DVec3};
use mortise::kept::StateFolder;
use mortise::kept::project::{KeptPart, PartName, Placement, Project};
use mortise::session::fits::FitChoice;
use mortise::session::notes::Severity;
use mortise::session::{Intent, Session};
use mortise::ui::Window;
use mortise_guide::{Standing, When};
use mortise_mating::recognise::TargetId;
use mortise_protocol::message::{ConstraintKind, DeviceState};
use mortise_protocol::parameter::ParameterId;
use mortise_rig::RigSpec;

/// Names the folder of the program that is killed.
const PLACE: &str = "MORTISE_TEST_PLACE";

/// The sample as a file of the user.
fn model(folder: &Path) -> PathBuf {
    let path = folder.join("assembly.step");
    std::fs::write(&path, mortise_scenario::sample::STEP).expect("written");
    path
}

fn open(harness: &mut Harness<'_, Window>, path: &Path) {
    let before = harness.state().session.document.as_ref().map(|d| d.generation);
    harness.state_mut().session.act(Intent::Open(path.to_owned()));
    until(harness, "the file is baked", move |s| {
        let document = s.document.as_ref();
        document.is_some_and(|d| Some(d.generation) != before && d.baked.is_some())
    });
    harness.run_steps(2);
}

/// A window on the state in `place`, with the model there open.
fn opened(place: &Path) -> Harness<'static, Window> {
    let mut harness = harness_on(&place.join("state"));
    open(&mut harness, &place.join("assembly.step"));
    harness
}

/// The projects that saved themselves.
fn saved(place: &Path) -> Vec<Project> {
    let files = std::fs::read_dir(place.join("state/projects"))
        .into_iter()
        .flatten();
    let files = files.map(|file| file.expect("file").path());
    let projects = files.filter(|path| path.extension().is_some_and(|e| e == "mortise"));
    projects
        .map(|path| Project::from_json(&std::fs::read(path).expect("there")).expect("sound"))
        .collect()
}

/// Whether a message has these words.
fn said(session: &Session, words: &str) -> bool {
    session.notes.iter().any(|note| note.text.contains(words))
}

fn place_of(session: &Session, part: usize) -> DAffine3 {
    session.document.as_ref().expect("open").poses[part]
}

fn hidden(session: &Session) -> &[bool] {
    &session.document.as_ref().expect("open").hidden
}

/// Changes everything that a project keeps without a rig.
fn change(session: &mut Session) {
    session.act(Intent::Hide(0, true));
    session.act(Intent::GuideWhen(When::Near));
    session.act(Intent::GuideCap(1.5));
    let rig = RigSpec::Simulated { realtime: false };
    session.act(Intent::ChooseRig(rig));
}

fn check(session: &Session) {
    assert_eq!(hidden(session), [true, false]);
    assert_eq!((session.guide.when, session.guide.force_cap_n), (When::Near, 1.5));
    assert_eq!(session.chosen, RigSpec::Simulated { realtime: false });
}

#[test]
fn what_was_done_with_a_model_comes_back() {
    let place = tempfile::tempdir().expect("folder");
    model(place.path());
    let mut harness = opened(place.path());
    change(&mut harness.state_mut().session);
    harness.state_mut().plots.choose(["points"]);
    harness.key_press(egui::Key::X);
    harness.run_steps(2);
    let view = &mut harness.state_mut().view;
    assert!(view.section.on);
    view.section.setting.offset_mm = -3.25;
    view.section.setting.flipped = true;
    view.see_through = true;
    view.camera.yaw = 0.123;
    view.camera.distance *= 0.5;
    view.switch_projection();
    let (camera, setting) = (view.camera, view.section.setting);
    harness.run_steps(2);
    // The end of the program saves too.
    drop(harness);
    let mut harness = opened(place.path());
    let session = &harness.state().session;
    check(session);
    assert!(
        said(session, "Restored from the last time"),
        "{:?}",
        session.notes
    );
    assert_eq!(worst(session), Severity::Good);
    assert_eq!(harness.state().plots.keys(), ["points"]);
    let view = &harness.state().view;
    assert!(view.section.on && view.see_through);
    assert_eq!(view.section.setting, setting);
    assert!(
        camera.eye().abs_diff_eq(view.camera.eye(), 1e-5),
        "{:?}",
        view.camera
    );
    assert!(camera.target.abs_diff_eq(view.camera.target, 1e-5));
    assert_eq!(camera.projection, view.camera.projection);

    // Another model is not touched by it.
    let other = place.path().join("other.step");
    let mut text = mortise_scenario::sample::STEP.to_vec();
    text.extend(b"\n");
    std::fs::write(&other, text).expect("written");
    open(&mut harness, &other);
    assert_eq!(hidden(&harness.state().session), [false, false]);
    let picture = &harness.state().view;
    assert!(!picture.section.on && picture.camera.yaw != 0.123);

    // What was done a moment before another file is opened, and before there was time to save it.
    harness.state_mut().session.act(Intent::Hide(1, true));
    open(&mut harness, &place.path().join("assembly.step"));
    check(&harness.state().session);
    open(&mut harness, &other);
    assert_eq!(hidden(&harness.state().session), [false, true]);
    drop(harness);
    let kept = saved(place.path());
    assert_eq!(kept.iter().filter(|project| !project.parts.is_empty()).count(), 2);
}

/// The file of the model is written anew, as by a CAD program: what was done with it is found by its path.
#[test]
fn what_was_done_comes_back_when_the_model_s_file_has_changed() {
    let place = tempfile::tempdir().expect("folder");
    let path = model(place.path());
    let mut harness = opened(place.path());
    change(&mut harness.state_mut().session);
    let fit = TargetId {
        moving_part: 1,
        fixed_part: 0,
        surfaces: Some([0, 0]),
    };
    let off = FitChoice {
        pinned: false,
        off: true,
    };
    harness.state_mut().session.fits.insert(fit, off);
    drop(harness);
    let before = saved(place.path());
    let mut text = mortise_scenario::sample::STEP.to_vec();
    text.extend(b"\n");
    std::fs::write(&path, text).expect("written");
    let harness = opened(place.path());
    let session = &harness.state().session;
    check(session);
    assert!(session.fits.is_empty());
    assert!(
        said(session, "has changed") && said(session, "left out"),
        "{:?}",
        session.notes
    );
    drop(harness);
    // That of the earlier contents is still there.
    assert!(saved(place.path()).contains(&before[0]));
    std::fs::write(&path, mortise_scenario::sample::STEP).expect("written");
    let harness = opened(place.path());
    assert_eq!(harness.state().session.fits.get(&fit), Some(&off));
}

/// The program that is killed: changes things until then.
#[test]
#[ignore = "started and killed by the test of recovery"]
fn program_to_be_killed() {
    let Some(place) = std::env::var_os(PLACE) else {
        return;
    };
    let mut harness = opened(Path::new(&place));
    change(&mut harness.state_mut().session);
    for step in 0.. {
        // The settings stay; the hidden part changes with every picture, so that a saving is under way most of the time.
        let session = &mut harness.state_mut().session;
        session.act(Intent::Hide(1, step % 2 == 0));
        harness.step();
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn a_killed_program_loses_nothing_but_the_last_moments() {
    let place = tempfile::tempdir().expect("folder");
    model(place.path());
    for more_ms in [0, 1_400, 1_650] {
        let program = std::env::current_exe().expect("this program");
        let mut child = Command::new(program)
            .args(["--exact", "project::program_to_be_killed", "--ignored"])
            .env(PLACE, place.path())
            .stdout(std::process::Stdio::null())
            .spawn()
            .expect("started");
        let begun = Instant::now();
        let is_saved = || {
            saved(place.path())
                .iter()
                .any(|project| !project.parts.is_empty())
        };
        while !is_saved() {
            assert!(begun.elapsed() < Duration::from_secs(300), "nothing is saved");
            assert_eq!(child.try_wait().expect("a child"), None, "it ended by itself");
            std::thread::sleep(Duration::from_millis(10));
        }
        std::thread::sleep(Duration::from_millis(more_ms));
        // SIGKILL on Unix.
        child.kill().expect("killed");
        child.wait().expect("ended");
        // Every file is whole.
        assert_eq!(saved(place.path()).len(), 1);
        let mut harness = harness_on(&place.path().join("state"));
        until(&mut harness, "the next start says it", |s| {
            said(s, "assembly.step was open when the program was ended by force")
        });
        let recent = harness.state().session.preferences.recent.iter().next().cloned();
        open(&mut harness, &recent.expect("the model"));
        let session = &harness.state().session;
        assert!(hidden(session)[0]);
        assert_eq!(session.guide.force_cap_n, 1.5);
        assert_eq!(session.chosen, RigSpec::Simulated { realtime: false });
        drop(harness);
        // Once only, and not after an end as usual.
        let mut harness = opened(place.path());
        harness.run_steps(5);
        assert!(!said(&harness.state().session, "ended by force"));
        drop(harness);
        std::fs::remove_dir_all(place.path().join("state")).expect("removed");
    }
}

/// Parts and parameters as they were on one board are so on the next.
#[test]
fn placements_and_parameters_are_on_the_next_board_and_go_back_to_the_file() {
    let place = tempfile::tempdir().expect("folder");
    model(place.path());
    let mut harness = opened(place.path());
    let file = place_of(&harness.state().session, 1);
    connect(&mut harness);
    let act = |harness: &mut Harness<'_, Window>, intent| harness.state_mut().session.act(intent);
    act(
        &mut harness,
        Intent::SetParameter(ParameterId::ContactStiffness, 150_000.0),
    );
    arm(&mut harness);
    act(&mut harness, Intent::Grab(1));
    until(&mut harness, "held", |s| s.grabbed() == Some(1));
    let up = DAffine3::from_translation(DVec3::new(4.0, -6.0, 9.0));
    let handle = harness.state().session.handle().expect("a handle");
    let script = mortise::session::insertion::hold(&(up * handle));
    harness.state_mut().session.move_hand(script);
    until(&mut harness, "moved", move |s| {
        (place_of(s, 1).translation - file.translation).length() > 8.0
    });
    act(&mut harness, Intent::Disarm);
    until(&mut harness, "idle", |s| s.device() == Some(DeviceState::Idle));
    let moved = place_of(&harness.state().session, 1);
    drop(harness);

    let mut harness = opened(place.path());
    let near = move |s: &Session| place_of(s, 1).abs_diff_eq(moved, 1e-9);
    assert!(near(&harness.state().session), "restored");
    connect(&mut harness);
    assert!(near(&harness.state().session), "and not put back by the upload");
    let set = |s: &Session| s.parameters[ParameterId::ContactStiffness as usize];
    assert_eq!(set(&harness.state().session), 150_000.0);
    // The board has it there too.
    arm(&mut harness);
    act(&mut harness, Intent::Grab(1));
    until(&mut harness, "held where it was", move |s| s.grabbed() == Some(1));
    assert!(place_of(&harness.state().session, 1).abs_diff_eq(moved, 0.05));
    act(&mut harness, Intent::Disarm);
    until(&mut harness, "idle", |s| s.device() == Some(DeviceState::Idle));
    act(&mut harness, Intent::ResetScene);
    until(&mut harness, "back, on the board too", move |s| {
        s.scene_is_on_board() && place_of(s, 1) == file
    });
    arm(&mut harness);
    act(&mut harness, Intent::Grab(1));
    until(&mut harness, "held", |s| s.grabbed() == Some(1));
    assert!(place_of(&harness.state().session, 1).abs_diff_eq(file, 0.05));
    click(&mut harness, "STOP");
}

/// A fit that was switched off stays so at the next start, although its target appears only on contact.
#[test]
fn choices_of_fits_come_back() {
    let place = tempfile::tempdir().expect("folder");
    model(place.path());
    let mut harness = opened(place.path());
    let play = |harness: &mut Harness<'_, Window>, standing: Standing| {
        connect(harness);
        click(harness, "Play insertion");
        until(harness, "the fit stands so", move |s| {
            let mut rows = s.guidance.rows.iter();
            rows.any(|row| row.target.kind == ConstraintKind::Concentric && row.standing == standing)
        });
    };
    play(&mut harness, Standing::Sent);
    let session = &mut harness.state_mut().session;
    let mut rows = session.guidance.rows.iter();
    let fit = rows.find(|row| row.target.kind == ConstraintKind::Concentric);
    let id: TargetId = fit.expect("sent").target.id;
    session.act(Intent::SwitchTargetOff(id, true));
    click(&mut harness, "STOP");
    drop(harness);
    let mut harness = opened(place.path());
    let off = FitChoice {
        pinned: false,
        off: true,
    };
    assert_eq!(harness.state().session.fits.get(&id), Some(&off));
    play(&mut harness, Standing::Off);
    click(&mut harness, "STOP");
}

fn save_as(harness: &mut Harness<'_, Window>, path: &Path) {
    let path = path.to_owned();
    let write = Intent::WriteProject { path, replace: false };
    harness.state_mut().session.act(write);
    until(harness, "written", |s| {
        s.notes
            .newest()
            .is_some_and(|note| note.text.starts_with("Written: "))
    });
}

/// A window in which the project of a changed model was just written to a file.
fn written() -> (tempfile::TempDir, Harness<'static, Window>, PathBuf) {
    let place = tempfile::tempdir().expect("folder");
    model(place.path());
    let mut harness = opened(place.path());
    change(&mut harness.state_mut().session);
    let file = place.path().join("mine.mortise");
    save_as(&mut harness, &file);
    (place, harness, file)
}

#[test]
fn a_project_file_opens_its_model_also_where_both_were_moved() {
    let (place, harness, _) = written();
    drop(harness);
    let elsewhere = tempfile::tempdir().expect("folder");
    for name in ["mine.mortise", "assembly.step"] {
        std::fs::rename(place.path().join(name), elsewhere.path().join(name)).expect("moved");
    }
    let file = elsewhere.path().join("mine.mortise");
    let mut harness = harness_on(&elsewhere.path().join("state"));
    open(&mut harness, &file);
    check(&harness.state().session);
    let recent = harness.state().session.preferences.recent.iter().next();
    assert_eq!(recent.cloned(), Some(file));
}

/// A project whose parts are partly gone, of a model that has changed: what there is comes back, the rest is named.
#[test]
fn parts_that_are_gone_are_named() {
    let (_place, mut harness, file) = written();
    let mut project = Project::from_json(&std::fs::read(&file).expect("there")).expect("sound");
    let pose = DAffine3::from_rotation_translation(DQuat::from_rotation_x(0.3), DVec3::X);
    project.parts.push(KeptPart {
        part: PartName {
            within: vec!["gone".into()],
            name: "washer".into(),
            number: 3,
        },
        placement: Placement::of(&pose),
        hidden: true,
    });
    project.model.sha256 = "0".repeat(64);
    std::fs::write(&file, project.to_json()).expect("written");
    open(&mut harness, &file);
    let session = &harness.state().session;
    check(session);
    assert!(
        said(session, "has changed") && said(session, "no longer exist: washer"),
        "{:?}",
        session.notes
    );
}

#[test]
fn a_file_that_is_no_project_changes_nothing() {
    let place = tempfile::tempdir().expect("folder");
    model(place.path());
    let mut harness = opened(place.path());
    let generation = harness.state().session.document.as_ref().map(|d| d.generation);
    change(&mut harness.state_mut().session);
    let whole = place.path().join("whole.mortise");
    save_as(&mut harness, &whole);
    let whole = std::fs::read_to_string(whole).expect("there");
    let project = r#"{"mortise-project": 1, "model": {"path": "/nowhere/x.step", "sha256": ""}}"#;
    let newer = project.replace("1", "9");
    for (name, text, words) in [
        ("step", "ISO-10303-21;", "not a project"),
        ("empty", "", "not a project"),
        ("cut", &whole[..whole.len() / 2], "damaged"),
        ("lost", project, "its model /nowhere/x.step is not there"),
        ("newer", &newer, "newer version"),
    ] {
        let path = place.path().join(name).with_extension("mortise");
        std::fs::write(&path, text).expect("written");
        harness.state_mut().session.act(Intent::Open(path.clone()));
        until(&mut harness, "said", |s| worst(s) == Severity::Error);
        let note = harness.state().session.notes.newest().expect("one").text.clone();
        assert!(
            note.contains(words) && note.contains(path.to_str().expect("text")),
            "{note}"
        );
        assert_eq!(
            std::fs::read_to_string(path).expect("there"),
            text,
            "left as it was"
        );
        check(&harness.state().session);
        harness.state_mut().session.notes.clear();
    }
    // Nor is one replaced that exists, unless the user says so.
    let path = place.path().join("cut.mortise");
    let write = Intent::WriteProject {
        path: path.clone(),
        replace: false,
    };
    harness.state_mut().session.act(write);
    until(&mut harness, "said", |s| worst(s) == Severity::Error);
    assert_eq!(
        std::fs::read_to_string(path).expect("there"),
        whole[..whole.len() / 2]
    );
    let now = harness.state().session.document.as_ref().map(|d| d.generation);
    assert_eq!(now, generation);
    // What saved itself and was damaged since is set aside.
    let sha256 = harness
        .state()
        .session
        .document
        .as_ref()
        .expect("open")
        .sha256
        .clone();
    drop(harness);
    let path = StateFolder::at(place.path().join("state")).project(&sha256);
    std::fs::write(&path, "{").expect("written");
    let harness = opened(place.path());
    let session = &harness.state().session;
    assert!(said(session, "nothing is restored"), "{:?}", session.notes);
    let aside = path.with_extension("mortise.damaged");
    assert_eq!(std::fs::read_to_string(aside).expect("kept"), "{");
}
