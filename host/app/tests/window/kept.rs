//! What the window keeps from one start to the next: preferences and recent files.

use std::path::{Path, PathBuf};

use crate::common::{click, harness_on, until, worst};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use mortise::kept::{Preferences, StateFolder};
use mortise::session::Intent;
use mortise::session::notes::Severity;
use mortise::session::purpose::Purpose;
use mortise::ui::Window;

/// The sample as a file of the user.
fn model(folder: &Path, name: &str) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, mortise_scenario::sample::STEP).expect("written");
    path
}

fn open(harness: &mut Harness<'_, Window>, path: &Path) {
    harness.state_mut().session.act(Intent::Open(path.to_owned()));
    let path = path.to_owned();
    until(harness, "the file is open", move |s| {
        s.document
            .as_ref()
            .is_some_and(|d| d.path.as_ref() == Some(&path))
    });
}

fn preferences(folder: &Path) -> Option<Preferences> {
    Preferences::of(&StateFolder::at(folder.to_owned()))
}

#[test]
fn signals_come_back() {
    let place = tempfile::tempdir().expect("folder");
    let mut harness = harness_on(place.path());
    harness.run_steps(3);
    harness.state_mut().plots.choose(["points", "loop_cost"]);
    // The first change is saved without the end of the program.
    until(&mut harness, "saved by itself", {
        let folder = place.path().to_owned();
        move |_| preferences(&folder).is_some_and(|kept| kept.signals.is_some())
    });
    drop(harness);
    let mut harness = harness_on(place.path());
    harness.run_steps(3);
    assert_eq!(harness.state().plots.keys(), ["loop_cost", "points"]);
}

#[test]
fn recent_files_open_from_the_empty_page_and_missing_ones_are_marked() {
    let place = tempfile::tempdir().expect("folder");
    let [first, second] = ["first.step", "second.step"].map(|name| model(place.path(), name));
    let mut harness = harness_on(place.path());
    open(&mut harness, &first);
    open(&mut harness, &second);
    click(&mut harness, "File menu");
    // In the menu; the bar has the name as a text.
    harness.get_by_role_and_label(egui::Role::Button, "second.step");
    drop(harness);

    std::fs::remove_file(&first).expect("removed");
    let mut harness = harness_on(place.path());
    until(&mut harness, "looked for", |s| !s.missing.is_empty());
    harness.run_steps(2);
    harness.get_by_label("first.step, missing");
    click(&mut harness, "Forget first.step");
    assert!(harness.query_by_label("first.step, missing").is_none());
    click(&mut harness, "second.step");
    until(&mut harness, "open", |s| s.document.is_some());
    drop(harness);
    let kept = preferences(place.path()).expect("kept");
    let paths: Vec<&Path> = kept.recent.iter().map(PathBuf::as_path).collect();
    assert_eq!(paths, [second.as_path()]);
}

#[test]
fn damaged_preferences_are_set_aside_and_said() {
    let place = tempfile::tempdir().expect("folder");
    let path = StateFolder::at(place.path().to_owned()).preferences();
    std::fs::write(&path, "{ damaged").expect("written");
    let mut harness = harness_on(place.path());
    harness.run_steps(2);
    assert_eq!(worst(&harness.state().session), Severity::Warning);
    let note = harness.state().session.notes.newest().expect("one").text.clone();
    assert!(
        note.contains("cannot be used") && note.contains(".damaged"),
        "{note}"
    );
    let aside = path.with_extension("json.damaged");
    assert_eq!(std::fs::read(aside).expect("kept"), b"{ damaged");
}

#[test]
fn a_folder_that_cannot_be_written_is_said_once_and_the_window_goes_on() {
    let place = tempfile::tempdir().expect("folder");
    let file = place.path().join("a file");
    std::fs::write(&file, "").expect("written");
    let mut harness = harness_on(&file.join("state"));
    for keys in [["points"], ["loop_cost"]] {
        harness.state_mut().plots.choose(keys);
        std::thread::sleep(std::time::Duration::from_millis(1_600));
        harness.run_steps(3);
        std::thread::sleep(std::time::Duration::from_millis(100));
        harness.run_steps(3);
    }
    let session = &harness.state().session;
    let said = session.notes.iter().filter(|note| note.text.contains("not kept"));
    assert_eq!(said.map(|note| note.times).sum::<u32>(), 1);
}

/// A desktop without a file dialog.
#[test]
fn a_path_is_entered_where_no_dialog_is() {
    let place = tempfile::tempdir().expect("folder");
    let path = model(place.path(), "a part with spaces.step");
    let mut harness = harness_on(place.path());
    harness.state_mut().session.wants_path = Some(Purpose::OpenModel);
    harness.run_steps(3);
    let field = harness.get_by_role(egui::Role::TextInput);
    field.focus();
    field.type_text(path.to_str().expect("text"));
    harness.run_steps(2);
    harness.key_press(egui::Key::Enter);
    harness.run_steps(2);
    until(&mut harness, "open", |s| s.document.is_some());
}
