//! Parts grouped in the window: grabbed, moved, undone and kept as one.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::common::{arm, begin_recording, click, connect, harness, harness_on, picture, poses, until};
use egui::{Key, Modifiers};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use glam::{DAffine3, DQuat, DVec3};
use mortise::session::document::Document;
use mortise::session::grouping::GroupIntent;
use mortise::session::insertion::hold;
use mortise::session::link::Link;
use mortise::session::moves::Motion;
use mortise::session::runs::RunIntent;
use mortise::session::{Intent, Session};
use mortise::ui::Window;
use mortise_protocol::message::DeviceState;

/// Products of poses of a tenth of a metre, rounded to 2⁻⁵³, mm and as components of unit vectors.
const ROUNDING: f64 = 1e-11;
/// A plate with three pins in its holes, and one beside it.
pub const ROW: &str = "lab/data/fixture_row.step";
/// Two of the pins.
pub const PINS: [usize; 2] = [1, 2];
pub const NAME: &str = "pin-in-hole-3, pin-in-hole-4";

pub fn of_repository(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(file)
}

fn open(harness: &mut Harness<'_, Window>, path: &Path) {
    harness.step();
    harness.state_mut().session.act(Intent::Open(path.to_owned()));
    let path = path.to_owned();
    until(harness, "it is baked", move |s| {
        let document = s.document.as_ref();
        document.is_some_and(|d| d.path.as_ref() == Some(&path) && d.baked.is_some())
    });
    harness.run_steps(3);
}

pub fn opened() -> Harness<'static, Window> {
    let mut harness = harness();
    open(&mut harness, &of_repository(ROW));
    harness
}

pub fn document(session: &Session) -> &Document {
    session.document.as_ref().expect("open")
}

pub fn is_baked(session: &Session) -> bool {
    document(session).baked.is_some()
}

/// A line of the list of parts.
pub fn line<'a>(harness: &'a Harness<'_, Window>, label: &'a str) -> egui_kittest::Node<'a> {
    harness.get_by_role_and_label(egui::Role::ListBoxOption, label)
}

/// Clicks a line of the list with modifiers.
pub fn click_with(harness: &mut Harness<'_, Window>, modifiers: Modifiers, label: &str) {
    line(harness, label).click_modifiers(modifiers);
    harness.run_steps(2);
}

pub fn press(harness: &mut Harness<'_, Window>, modifiers: Modifiers, key: Key) {
    harness.key_press_modifiers(modifiers, key);
    harness.run_steps(2);
}

/// A window with two of the pins grouped by clicks, and baked.
pub fn grouped() -> Harness<'static, Window> {
    let mut harness = opened();
    click(&mut harness, "pin-in-hole-3");
    click_with(&mut harness, Modifiers::CTRL, "pin-in-hole-4");
    assert_eq!(harness.state().session.selection(), PINS);
    let _ = harness.get_by_label("2 parts selected");
    click(&mut harness, "Group");
    until(&mut harness, "it is baked as a group", is_baked);
    harness.run_steps(3);
    harness
}

/// The second pin seen from the first one.
fn relative(poses: &[DAffine3]) -> DAffine3 {
    poses[PINS[0]].inverse() * poses[PINS[1]]
}

fn parts_of_scene(session: &Session) -> Vec<usize> {
    let baked = document(session).baked.as_ref().expect("baked");
    baked.report.parts.iter().map(|part| part.model_part).collect()
}

fn said(session: &Session, words: &str) -> bool {
    session.notes.iter().any(|note| note.text.contains(words))
}

#[test]
fn two_parts_are_grouped_held_and_moved_rigidly_on_the_rig() {
    let mut harness = grouped();
    let before = poses(&harness);
    assert_eq!(parts_of_scene(&harness.state().session), [0, 1, 3, 4], "one part");
    connect(&mut harness);
    arm(&mut harness);
    click_with(&mut harness, Modifiers::NONE, NAME);
    assert_eq!(harness.state().session.selection(), PINS);
    click(&mut harness, "Grab");
    until(&mut harness, "the group is held", |s| s.is_held(PINS[1]));
    harness.run_steps(2);
    let session = &harness.state().session;
    assert!(session.is_held(PINS[0]) && !session.is_held(3));
    let _ = harness.get_by_label(&format!("Holding: {NAME}"));
    // Out of both holes, aside and turned.
    let handle = harness.state().session.handle().expect("a handle");
    let up = DAffine3::from_translation(25.0 * DVec3::Z) * handle;
    harness.state_mut().session.move_hand(hold(&up));
    until(&mut harness, "it is out", |s| {
        document(s).poses[1].translation.z > before[1].translation.z + 22.0
    });
    let aside = DAffine3::from_translation(DVec3::new(3.0, 4.0, 2.0)) * up * DAffine3::from_rotation_y(0.2);
    harness.state_mut().session.move_hand(hold(&aside));
    let begun = std::time::Instant::now();
    let mut seen = Vec::new();
    while begun.elapsed().as_secs_f64() < 1.5 {
        harness.step();
        seen.push(poses(&harness));
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    for now in &seen {
        assert!(relative(now).abs_diff_eq(relative(&before), ROUNDING));
        assert_eq!([now[0], now[3], now[4]], [before[0], before[3], before[4]]);
    }
    let last = seen.last().expect("some");
    assert!(
        (last[1].matrix3.x_axis - before[1].matrix3.x_axis).length() > 0.1,
        "turned"
    );
    // Both are drawn as what is in hand.
    let items = picture(&harness);
    assert!(items[1].tint[3] > 0.0 && items[1].tint == items[2].tint && items[3].tint[3] == 0.0);
    click(&mut harness, "STOP");
    until(&mut harness, "stopped", |s| {
        s.device() == Some(DeviceState::Stopped)
    });
    harness.run_steps(3);
    let name = format!("motion of {NAME} on the board");
    assert_eq!(harness.state().session.moves.to_undo(), Some(name.as_str()));
    harness.state_mut().session.act(Intent::Undo);
    assert_eq!(poses(&harness), before);
}

/// Both pins of the group fit their holes, and are recognised there by their own names.
#[test]
fn faces_of_each_part_of_a_held_group_are_recognised_against_the_others() {
    let mut harness = grouped();
    connect(&mut harness);
    arm(&mut harness);
    harness.state_mut().session.act(Intent::Grab(PINS[1]));
    until(&mut harness, "the group is held", |s| s.is_held(PINS[0]));
    // Against the sides of the holes.
    let handle = harness.state().session.handle().expect("a handle");
    let aside = DAffine3::from_translation(DVec3::new(4.0, 0.0, 3.0)) * handle;
    harness.state_mut().session.move_hand(hold(&aside));
    let owners = |s: &Session| {
        let owner = |row: &mortise_guide::Row| {
            let (owner, _) = document(s).owner(row.target.id.moving_part, &row.target.moving_faces);
            owner
        };
        let mut owners: Vec<usize> = s.guidance.rows.iter().filter_map(owner).collect();
        owners.sort_unstable();
        owners.dedup();
        owners
    };
    until(&mut harness, "both are recognised", |s| owners(s) == PINS);
    // Contact is with the plate alone: the pins are one body.
    let session = &harness.state().session;
    let telemetry = session.telemetry.as_ref().expect("a sample");
    for pair in &telemetry.pairs {
        assert_eq!(document(session).model_part(pair.static_part), Some(0));
    }
    for row in &session.guidance.rows {
        assert_eq!((row.target.id.moving_part, row.target.id.fixed_part), (1, 0));
    }
    harness.run_steps(2);
    for pin in ["pin-in-hole-3", "pin-in-hole-4"] {
        let title = format!("Concentric: {pin} in fixture-plate");
        assert!(harness.query_all_by_label_contains(&title).count() > 0, "{title}");
    }
    click(&mut harness, "STOP");
}

#[test]
fn a_group_is_moved_undone_redone_and_taken_apart_by_keys() {
    let mut harness = grouped();
    let before = poses(&harness);
    let undo = |harness: &Harness<'_, Window>| harness.state().session.moves.to_undo().map(str::to_owned);
    assert_eq!(undo(&harness), Some(format!("group {NAME}")));
    // By a key with one of them selected, by numbers and by a handle.
    click(&mut harness, "pin-in-hole-4");
    press(&mut harness, Modifiers::CTRL, Key::PageUp);
    press(&mut harness, Modifiers::ALT, Key::ArrowRight);
    let moved = poses(&harness);
    assert!(!moved[1].abs_diff_eq(before[1], 1.0) && !moved[2].abs_diff_eq(before[2], 1.0));
    assert!(relative(&moved).abs_diff_eq(relative(&before), ROUNDING));
    assert_eq!(undo(&harness), Some(format!("turn {NAME}")));
    let session = &mut harness.state_mut().session;
    assert!(session.begin_drag(PINS[1], false));
    let mut pose = session.dragged_from().expect("dragged");
    pose.translation.z += 7.0;
    session.drag_to(pose);
    session.let_go_of_dragged("move");
    let dragged = poses(&harness);
    assert!(relative(&dragged).abs_diff_eq(relative(&before), ROUNDING));
    let by = |part: usize| dragged[part].translation - moved[part].translation;
    assert!(by(1).abs_diff_eq(7.0 * DVec3::Z, 1e-9) && by(2).abs_diff_eq(7.0 * DVec3::Z, 1e-9));
    assert_eq!(
        [dragged[0], dragged[3], dragged[4]],
        [before[0], before[3], before[4]]
    );
    // Taken apart, each moves by itself.
    press(&mut harness, Modifiers::COMMAND | Modifiers::SHIFT, Key::G);
    assert!(harness.query_all_by_label(NAME).next().is_none());
    assert_eq!(poses(&harness), dragged);
    press(&mut harness, Modifiers::NONE, Key::ArrowUp);
    assert_eq!(poses(&harness)[1], dragged[1]);
    assert_ne!(poses(&harness)[2], dragged[2]);
    // Back through all of it, and on again.
    for wanted in [&dragged, &dragged, &moved] {
        press(&mut harness, Modifiers::COMMAND, Key::Z);
        assert_eq!(poses(&harness), *wanted);
    }
    let _ = line(&harness, NAME);
    for _ in 0..3 {
        press(&mut harness, Modifiers::COMMAND, Key::Z);
    }
    assert_eq!(poses(&harness), before);
    assert!(document(&harness.state().session).groups().is_empty());
    assert_eq!(undo(&harness), None);
    press(&mut harness, Modifiers::COMMAND, Key::Y);
    let _ = line(&harness, NAME);
    until(&mut harness, "the group is baked again", is_baked);
    assert_eq!(parts_of_scene(&harness.state().session), [0, 1, 3, 4]);
}

/// How far the first pin comes from the left, where it stands beside the plate, towards its hole, mm.
fn comes_from_the_left(harness: &mut Harness<'_, Window>) -> f64 {
    let place = poses(harness)[1];
    let session = &mut harness.state_mut().session;
    session.act(Intent::Move(Motion {
        part: 1,
        shift_mm: -400.0 * DVec3::X,
        turn: DQuat::IDENTITY,
        goes_on: false,
    }));
    assert!(session.begin_drag(1, true));
    session.drag_to(place);
    session.let_go_of_dragged("move");
    until(harness, "let go of", |s| s.moves.dragged().is_none());
    let end = poses(harness)[1];
    end.translation.x - place.translation.x + 400.0
}

/// The second pin is on the right of the first one, and comes to the plate before it.
#[test]
fn a_group_dragged_without_overlap_stops_where_any_of_its_parts_meets_another() {
    let mut harness = grouped();
    let before = poses(&harness);
    let ahead = before[2].translation.x - before[1].translation.x;
    assert!(ahead > 10.0, "{ahead}");
    let as_one = comes_from_the_left(&mut harness);
    assert!(relative(&poses(&harness)).abs_diff_eq(relative(&before), ROUNDING));
    let session = &mut harness.state_mut().session;
    session.act(Intent::Undo);
    session.act(Intent::Undo);
    session.act(Intent::Group(GroupIntent::Ungroup(1)));
    assert_eq!(poses(&harness), before);
    let alone = comes_from_the_left(&mut harness);
    // The end of a stretch of 400 mm is known to 1/64 mm.
    assert!(
        (alone - as_one - ahead).abs() < 1.0 / 32.0,
        "{alone} {as_one} {ahead}"
    );
}

#[test]
fn a_group_comes_back_at_the_next_start_and_a_damaged_one_is_named() {
    let place = tempfile::tempdir().expect("folder");
    let path = place.path().join("row.step");
    std::fs::copy(of_repository(ROW), &path).expect("copied");
    let state = place.path().join("state");
    let mut harness = harness_on(&state);
    open(&mut harness, &path);
    let session = &mut harness.state_mut().session;
    session.act(Intent::SelectThese(PINS.to_vec()));
    session.act(Intent::Group(GroupIntent::Group(PINS.to_vec())));
    press(&mut harness, Modifiers::CTRL, Key::PageUp);
    let before = poses(&harness);
    drop(harness);

    let mut harness = harness_on(&state);
    open(&mut harness, &path);
    let session = &harness.state().session;
    assert!(
        said(session, "Restored from the last time: 2 parts moved, 1 group"),
        "{:?}",
        session.notes
    );
    assert_eq!(document(session).groups().together(2), PINS);
    assert_eq!(parts_of_scene(session), [0, 1, 3, 4], "baked as a group");
    for (now, before) in poses(&harness).iter().zip(&before) {
        assert!(now.abs_diff_eq(*before, 1e-8));
    }
    assert!(relative(&poses(&harness)).abs_diff_eq(relative(&before), 1e-8));
    assert_eq!(session.moves.to_undo(), None, "restoring is no step");
    let _ = line(&harness, NAME);
    drop(harness);

    // One of its parts has another name in the file.
    let folder = std::fs::read_dir(state.join("projects")).expect("projects");
    let project = folder
        .map(|file| file.expect("a file").path())
        .next()
        .expect("one");
    let text = std::fs::read_to_string(&project).expect("readable");
    let at = text.find("\"groups\"").expect("it has groups");
    let (head, tail) = text.split_at(at);
    std::fs::write(
        &project,
        format!(
            "{head}{}",
            tail.replacen("pin-in-hole-4", "pin-in-hole-40", 1).replacen(
                "pin-in-hole-4\"",
                "pin-in-hole-40\"",
                1
            )
        ),
    )
    .expect("written");
    let mut harness = harness_on(&state);
    open(&mut harness, &path);
    let session = &harness.state().session;
    assert!(
        said(session, "is left out: its part pin-in-hole-40 does not exist"),
        "{:?}",
        session.notes
    );
    assert!(document(session).groups().is_empty());
    assert!(
        poses(&harness)[1].abs_diff_eq(before[1], 1e-8),
        "the rest comes back"
    );
}

/// The fits of both pins at once, and steps in which they go in together.
#[test]
fn fits_and_steps_take_a_group_as_one_part() {
    let mut harness = grouped();
    let before = poses(&harness);
    let session = &mut harness.state_mut().session;
    session.act(Intent::Select(Some(PINS[1])));
    session.act(Intent::FitWith(Some(0)));
    session.act(Intent::FindFits);
    until(&mut harness, "the fits are found", |s| {
        let fitting = s.fitting.as_ref();
        fitting.is_some_and(|fitting| fitting.search.is_none() && !fitting.offers.is_empty())
    });
    harness.run_steps(2);
    let fitting = harness.state().session.fitting.as_ref().expect("found");
    assert_eq!((fitting.moving, fitting.offers[0].against), (1, 0));
    // Other pairs of holes have the distance of these, too.
    let wanted = |s: &Session| {
        let offers = &s.fitting.as_ref().expect("found").offers;
        offers.iter().position(|offer| {
            !offer
                .pose(document(s))
                .expect("rigid")
                .abs_diff_eq(before[1], 1.0)
        })
    };
    let number = wanted(&harness.state().session).expect("a fit elsewhere");
    harness.state_mut().session.act(Intent::ChooseFit(number));
    harness.run_steps(2);
    // Both are shown there, beside the five parts.
    assert_eq!(picture(&harness).len(), 7);
    harness.state_mut().session.act(Intent::PlaceFit);
    let placed = poses(&harness);
    assert!(relative(&placed).abs_diff_eq(relative(&before), ROUNDING));
    assert!(!placed[2].abs_diff_eq(before[2], 1.0));
    press(&mut harness, Modifiers::COMMAND, Key::Z);
    assert_eq!(poses(&harness), before);

    harness.state_mut().session.act(Intent::FindSequence);
    until(&mut harness, "the steps are found", |s| {
        s.sequencing.found(document(s)).is_some()
    });
    let session = &harness.state().session;
    let found = session.sequencing.found(document(session)).expect("found");
    assert!(found.steps.iter().any(|step| step.parts == PINS), "{found:?}");
    harness.state_mut().session.act(Intent::GoToStep {
        done: 0.0,
        goes_on: false,
    });
    let apart = poses(&harness);
    assert!(apart[1].translation.distance(before[1].translation) > 5.0);
    assert!(relative(&apart).abs_diff_eq(relative(&before), ROUNDING));
    // What was found is of these groups alone.
    harness
        .state_mut()
        .session
        .act(Intent::Group(GroupIntent::Ungroup(1)));
    let session = &harness.state().session;
    assert!(session.sequencing.found(document(session)).is_none());
}

/// A recording of a group is shown with all of its parts where they were.
#[test]
fn a_recorded_group_is_played_as_one() {
    let data = tempfile::tempdir().expect("a folder");
    let mut harness = grouped();
    harness.state_mut().session.recordings = Some(data.path().to_owned());
    let before = poses(&harness);
    connect(&mut harness);
    let path = begin_recording(&mut harness);
    arm(&mut harness);
    harness.state_mut().session.act(Intent::Grab(1));
    until(&mut harness, "the group is held", |s| s.is_held(2));
    let handle = harness.state().session.handle().expect("a handle");
    let up = DAffine3::from_translation(25.0 * DVec3::Z) * handle;
    harness.state_mut().session.move_hand(hold(&up));
    until(&mut harness, "it is out", |s| {
        document(s).poses[2].translation.z > before[2].translation.z + 22.0
    });
    harness.state_mut().session.act(Intent::EndRecording);
    until(&mut harness, "the end", |s| s.recording.is_none());
    click(&mut harness, "Disconnect");
    until(&mut harness, "disconnected", |s| matches!(s.link, Link::None));
    harness
        .state_mut()
        .session
        .act(Intent::Run(RunIntent::Open(path)));
    until(&mut harness, "the run is read", |s| s.playback.is_some());
    let length = harness
        .state()
        .session
        .playback
        .as_ref()
        .map(|p| p.run().duration_s());
    let mut heights = Vec::new();
    for share in [0.0, 0.4, 0.8, 1.0] {
        let time = share * length.expect("shown");
        harness
            .state_mut()
            .session
            .act(Intent::Run(RunIntent::GoTo(time)));
        let now = poses(&harness);
        assert!(relative(&now).abs_diff_eq(relative(&before), ROUNDING));
        heights.push(now[2].translation.z - before[2].translation.z);
    }
    assert!(heights[0].abs() < 1.0 && heights[3] > 20.0, "{heights:?}");
    // Grouped otherwise, the run is of another scene.
    click(&mut harness, "Close the run");
    assert!(harness.state().session.playback.is_none());
    let model = Arc::clone(&document(&harness.state().session).model);
    harness
        .state_mut()
        .session
        .act(Intent::Group(GroupIntent::Ungroup(1)));
    assert!(Arc::ptr_eq(
        &document(&harness.state().session).grouped.model,
        &model
    ));
}
