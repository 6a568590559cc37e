//! The complete operation through the window without a display: open, choose a rig, connect, arm, grab, play, STOP. Controls are found by
//! their accessible names, as a screen reader finds them.

use std::cell::Cell;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use crate::common::{arm, click, connect, harness, holding, open_sample, until, worst};
use egui::Role;
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT as _, Queryable as _};
use glam::{DAffine3, DVec3};
use mortise::session::history::Sample;
use mortise::session::insertion::hold;
use mortise::session::link::Link;
use mortise::session::notes::Severity;
use mortise::session::{Intent, Session, obstacle};
use mortise::ui::Window;
use mortise::viewport::gesture::on_screen;
use mortise_bake::Method;
use mortise_protocol::message::DeviceState;
use mortise_protocol::parameter::ParameterId;
use mortise_rig::{RigSpec, UploadProgress};

#[test]
fn from_an_empty_window_to_a_felt_insertion_and_stop() {
    let mut harness = harness();
    open_sample(&mut harness);
    let names: Vec<_> = {
        let document = harness.state().session.document.as_ref().expect("open");
        document.model.parts.iter().map(|p| p.name.clone()).collect()
    };
    assert_eq!(names, ["block", "peg"]);

    connect(&mut harness);
    assert_eq!(harness.state().session.device(), Some(DeviceState::Idle));
    arm(&mut harness);

    click(&mut harness, "peg");
    click(&mut harness, "Grab");
    until(&mut harness, "the peg is held", |s| s.grabbed() == Some(1));

    click(&mut harness, "Play insertion");
    // 60 mm of travel; the peg's lower end is 20 mm above the hole.
    until(&mut harness, "the peg is in to the full depth", |s| {
        s.document
            .as_ref()
            .is_some_and(|d| d.poses[1].translation.z < 20.0 + 0.1)
    });
    let session = &harness.state().session;
    assert!(
        session.history.len() > 10 && session.history.iter().any(|s| s.handle_n > 0.0),
        "the plots have something to show"
    );
    assert!(worst(session) < Severity::Warning, "nothing to complain about");
    until(&mut harness, "the verdict", |s| s.verdict.is_some());
    let said = harness.state().session.verdict.as_ref().map(ToString::to_string);
    let said = said.expect("just seen");
    assert!(
        said.starts_with("Goes in: 40.0 mm, clearance 1.000 mm, peak ") && said.ends_with(" N"),
        "{said}"
    );
    harness.get_all_by_label(&said).next().expect("on screen");
    let reports = |s: &Session| s.notes.iter().filter(|n| n.text.starts_with("Goes in")).count();
    assert_eq!(reports(&harness.state().session), 1);

    click(&mut harness, "STOP");
    until(&mut harness, "stopped", |s| {
        s.device() == Some(DeviceState::Stopped)
    });
    assert_eq!(harness.state().session.grabbed(), None);
    click(&mut harness, "Clear stop");
    until(&mut harness, "idle again", |s| {
        s.device() == Some(DeviceState::Idle)
    });
}

#[test]
fn the_demonstration_goes_from_nothing_to_an_inserted_peg_and_plays_again() {
    let mut harness = harness();
    let demo = Intent::Demo(Some(RigSpec::Simulated { realtime: true }));
    harness.state_mut().session.act(demo);
    let lowest = |s: &Session| {
        s.document
            .as_ref()
            .map_or(f64::INFINITY, |d| d.poses[1].translation.z)
    };
    until(&mut harness, "the peg is in", |s| lowest(s) < 20.0 + 0.1);
    click(&mut harness, "Play insertion");
    until(&mut harness, "the peg is back", |s| lowest(s) > 79.0);
    until(&mut harness, "the peg is in again", |s| lowest(s) < 20.0 + 0.1);
    assert!(worst(&harness.state().session) < Severity::Warning);
}

/// Pushed down beside the hole, the peg stops on the plate or on the rim.
#[test]
fn a_part_that_does_not_go_in_is_stuck_and_on_what() {
    for aside_mm in [0.9, 6.0] {
        let mut harness = harness();
        open_sample(&mut harness);
        let handle = take_unguided(&mut harness);
        // 20 mm down to the block, and 4 mm further: 1.6 N at the hand's 400 N/m.
        let beside = DVec3::new(aside_mm, 0.0, -10.0);
        go(&mut harness, &handle, DVec3::ZERO, beside);
        go(&mut harness, &handle, beside, beside - 14.0 * DVec3::Z);
        until(&mut harness, "the verdict", |s| s.verdict.is_some());
        let said = harness.state().session.verdict.as_ref().map(ToString::to_string);
        let said = said.expect("just seen");
        // On the rim a tilted peg dips into the mouth by a little; either the rim or the face beside it may bear more.
        let dips = ["0.0", "0.1", "0.2"].map(|mm| format!("Stuck at {mm} mm: "));
        let at_the_mouth = dips.iter().any(|dip| said.starts_with(dip));
        assert!(at_the_mouth && said.ends_with(" of block"), "{said}");
    }
}

/// Connects the simulation, turns guidance off and takes part 1 in hand: the pose of the handle.
fn take_unguided(harness: &mut Harness<'_, Window>) -> DAffine3 {
    connect(harness);
    let off = Intent::SetParameter(ParameterId::Guidance, 0.0);
    harness.state_mut().session.act(off);
    arm(harness);
    harness.state_mut().session.act(Intent::Grab(1));
    until(harness, "the part is held", |s| s.grabbed() == Some(1));
    harness.state().session.handle().expect("reported")
}

/// Moves the simulated hand from one displacement of `handle` to another by single millimetres, mm: a hand that jumps loses its grip.
fn go(harness: &mut Harness<'_, Window>, handle: &DAffine3, from: DVec3, to: DVec3) {
    let steps = (to - from).length().ceil();
    for step in 1..=steps as u32 {
        let mut pose = *handle;
        pose.translation += from.lerp(to, f64::from(step) / steps);
        harness.state_mut().session.move_hand(hold(&pose));
        for _ in 0..5 {
            harness.step();
            std::thread::sleep(Duration::from_millis(10));
        }
    }
}

/// A tapered plug is no shaft in a bore: its outcome is stated by its place in the file.
#[test]
fn a_part_of_another_shape_is_in_its_place_or_stuck_on_the_way() {
    let mut harness = harness();
    let file = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../mating/tests/data/cone_in_cone.step"
    );
    harness.state_mut().session.act(Intent::Open(file.into()));
    until(&mut harness, "the file is baked", |s| {
        s.document.as_ref().is_some_and(|d| d.baked.is_some())
    });
    let handle = take_unguided(&mut harness);
    let (home, up) = (DVec3::ZERO, 32.0 * DVec3::Z);
    let aside = 6.0 * DVec3::X;
    go(&mut harness, &handle, home, up);
    assert_eq!(harness.state().session.verdict, None, "taken apart");
    for (to, end) in [(home, "In place: 0."), (aside, "Stuck ")] {
        let above = to + up;
        go(&mut harness, &handle, up, above);
        // Beside its place the plug stands on the socket, and the hand goes on.
        go(&mut harness, &handle, above, to);
        until(&mut harness, "the verdict", |s| s.verdict.is_some());
        let said = harness.state().session.verdict.as_ref().map(ToString::to_string);
        let said = said.expect("just seen");
        assert!(said.starts_with(end), "{said}");
        harness.state_mut().session.verdict = None;
        go(&mut harness, &handle, to, above);
        go(&mut harness, &handle, above, up);
    }
}

#[test]
fn sending_the_scene_can_be_cancelled_and_begun_again() {
    let mut harness = harness();
    open_sample(&mut harness);
    // A voxmap is as large as fits, so that a repeated upload takes long enough to be cancelled.
    (harness.state_mut().session).act(Intent::ChooseMethod(Method::Occupancy));
    until(&mut harness, "baked again", |s| !s.is_busy());
    connect(&mut harness);
    let session = &mut harness.state_mut().session;
    session.act(Intent::Upload);
    assert_eq!(obstacle(session, &Intent::CancelUpload), None);
    session.act(Intent::CancelUpload);
    until(&mut harness, "the upload has ended", |s| {
        s.connection().is_some_and(|c| c.upload.is_none())
    });
    let session = &harness.state().session;
    let newest = session.notes.newest().expect("a message");
    assert!(newest.text.starts_with("Upload cancelled"), "{}", newest.text);
    assert!(
        session.scene_is_on_board(),
        "the previous collision model stays in use"
    );
    assert!(worst(session) < Severity::Warning);
    // Its parts can still be put back.
    harness.state_mut().session.act(Intent::ResetScene);
    assert!(harness.state().session.scene_is_on_board());
    harness.state_mut().session.act(Intent::Upload);
    until(&mut harness, "uploaded completely", |s| {
        s.notes
            .newest()
            .is_some_and(|n| n.text == "The collision model is on the board")
    });
}

/// Percentage and text of every progress bar.
fn bars(harness: &Harness<'_, Window>) -> Vec<(f64, String)> {
    harness
        .get_all_by_role(Role::ProgressIndicator)
        .map(|shown| shown.accesskit_node())
        .filter_map(|bar| Some((bar.numeric_value()?, bar.label().unwrap_or_default())))
        .collect()
}

/// A reading, a bake and an upload show their progress and the time left, each with its *Cancel*; a reading its time limit as long as that is unknown.
#[test]
fn progress_and_the_time_left_are_shown() {
    let ten_seconds_ago = || Instant::now() - Duration::from_secs(10);
    let mut harness = harness();
    click(&mut harness, "Open the sample");
    let mut job = (harness.state().session.job.clone()).expect("reading");
    until(&mut harness, "the sample is baked", |s| !s.is_busy());
    assert!(harness.query_by_label("Cancel").is_none());

    // The work is over and reports no more: what is shown is this job.
    job.since = ten_seconds_ago();
    for fraction in [None, Some(0.01)] {
        job.fraction = fraction;
        harness.state_mut().session.job = Some(job.clone());
        harness.run_steps(2);
        harness.get_by_label("Cancel");
        harness.get_by_label_contains(" s, at most 60 s");
    }
    job.fraction = Some(0.25);
    harness.state_mut().session.job = Some(job);
    harness.run_steps(2);
    harness.get_by_label("Cancel");
    let drawn = bars(&harness);
    assert!(drawn.iter().any(|bar| bar.0 == 25.0), "{drawn:?}");
    // 10 s for a quarter; the clock runs on.
    harness.get_by_label_contains("5 s left");
    harness.state_mut().session.job = None;
    // A bake that takes a second.
    (harness.state_mut().session).act(Intent::ChooseMethod(Method::Occupancy));
    let reached = Cell::new(0.0f32);
    until(&mut harness, "baked again", |s| {
        let fraction = s.job.as_ref().and_then(|job| job.fraction);
        reached.set(fraction.unwrap_or(0.0).max(reached.get()));
        !s.is_busy()
    });
    assert!(reached.get() > 0.0, "no progress of the bake was seen");

    connect(&mut harness);
    let Link::Connected(connection) = &mut harness.state_mut().session.link else {
        panic!("connected");
    };
    connection.upload = Some(UploadProgress {
        sent: 64 << 10,
        total: 256 << 10,
    });
    connection.upload_since = ten_seconds_ago();
    harness.run_steps(2);
    harness.get_by_label("Cancel upload");
    let drawn = bars(&harness);
    let is_the_uploads = |(percent, said): &(f64, String)| {
        *percent == 25.0 && said.starts_with("64 of 256 KiB, ") && said.ends_with("5 s left")
    };
    assert!(drawn.iter().any(is_the_uploads), "{drawn:?}");
}

/// Overruns of long ago are not shown: a sum since the start would only grow.
#[test]
fn loop_overruns_are_those_of_the_last_ten_seconds() {
    let mut harness = harness();
    // In lockstep no tick runs by itself, so every sample is the test's.
    let session = &mut harness.state_mut().session;
    session.act(Intent::ChooseRig(RigSpec::Simulated { realtime: false }));
    session.act(Intent::Connect);
    until(&mut harness, "connected", |s| s.connection().is_some());
    for time_s in [0.0, 1.0] {
        harness.state_mut().session.history.add(Sample {
            time_s,
            late: 31,
            ..Sample::default()
        });
    }
    harness.run_steps(2);
    harness.get_by_label("Loop overruns, last 10 s");
    assert!(harness.query_by_label("31").is_none());
    harness.get_by_label("none");
}

/// With the motors off and no motion no sample wakes the window, which draws every minute by itself: with software rendering each frame costs up to
/// 0.7 s of a core.
#[test]
fn an_idle_rig_does_not_wake_the_window() {
    let woken = Arc::new(AtomicU32::new(0));
    let count = Arc::clone(&woken);
    let mut session = Session::new(Arc::new(move || {
        count.fetch_add(1, Ordering::Relaxed);
    }));
    session.act(Intent::Connect);
    let wait = |session: &mut Session, seconds: f64| {
        let begun = Instant::now();
        while begun.elapsed().as_secs_f64() < seconds {
            session.poll();
            std::thread::sleep(Duration::from_millis(5));
        }
    };
    while session.device() != Some(DeviceState::Idle) {
        wait(&mut session, 0.05);
    }
    wait(&mut session, 0.5);
    let (samples, wakes) = (session.history.len(), woken.load(Ordering::Relaxed));
    wait(&mut session, 12.0);
    let samples = session.history.len() - samples;
    let wakes = woken.load(Ordering::Relaxed) - wakes;
    // 62.5 samples per second.
    assert!(samples > 360, "{samples} samples arrive nevertheless");
    // A change of state may be among them.
    assert!(wakes <= 1, "woken {wakes} times in 12 s by {samples} samples");
}

/// What a resting rig sends is drawn every minute: with a rig connected the window asks for its next frame itself, without one it does not.
#[test]
fn a_connected_window_draws_every_minute() {
    let mut harness = harness();
    let next = |harness: &mut Harness<'_, Window>| {
        // Frames in which something moves ask for the next one at once.
        for _ in 0..200 {
            harness.step();
            let delay = (harness.output().viewport_output.values())
                .map(|output| output.repaint_delay)
                .min();
            match delay {
                Some(delay) if delay > Duration::from_secs(1) => return delay,
                _ => {}
            }
        }
        panic!("the window never rests");
    };
    open_sample(&mut harness);
    assert_eq!(next(&mut harness), Duration::MAX);
    connect(&mut harness);
    assert_eq!(next(&mut harness), Duration::from_secs(60));
}

#[test]
fn space_and_escape_stop() {
    for key in [egui::Key::Space, egui::Key::Escape] {
        let mut harness = harness();
        open_sample(&mut harness);
        connect(&mut harness);
        arm(&mut harness);
        harness.key_press(key);
        until(&mut harness, "stopped", |s| {
            s.device() == Some(DeviceState::Stopped)
        });
    }
}

#[test]
fn the_part_in_hand_follows_the_pointer() {
    let mut harness = holding();

    let view = harness.get_by_label("3D view").rect();
    let camera = harness.state().view.camera;
    let middle = harness.state().session.document.as_ref().expect("open").poses[1].translation;
    // The peg's frame is at its upper end; its middle is certain to be under the pointer.
    let from = on_screen(&camera, view, middle - 30.0 * DVec3::Z).expect("in front");
    let to = from + egui::vec2(60.0, -40.0);
    harness.drag_at(from);
    harness.step();
    for part in 1..=10 {
        harness.hover_at(from.lerp(to, 0.1 * part as f32));
        harness.step();
    }
    harness.drop_at(to);
    let aimed = |s: &Session| {
        let now = s.document.as_ref().expect("open").poses[1].translation;
        let expected = on_screen(&camera, view, now - 30.0 * DVec3::Z).expect("in front");
        expected.distance(to) < 5.0
    };
    until(&mut harness, "the peg is where the pointer went", aimed);
    assert_eq!(harness.state().view.camera, camera, "the view did not turn");
}

#[test]
fn a_press_that_is_over_within_one_picture_stops() {
    let mut harness = harness();
    open_sample(&mut harness);
    connect(&mut harness);
    arm(&mut harness);
    let pos = harness.get_by_label("STOP").rect().center();
    for pressed in [true, false] {
        harness.input_mut().events.push(egui::Event::PointerButton {
            pos,
            button: egui::PointerButton::Primary,
            pressed,
            modifiers: egui::Modifiers::NONE,
        });
    }
    until(&mut harness, "stopped", |s| {
        s.device() == Some(DeviceState::Stopped)
    });
}

#[test]
fn stop_is_there_before_anything_else_and_does_no_harm() {
    let mut harness = harness();
    harness.step();
    click(&mut harness, "STOP");
    let session = &harness.state().session;
    assert!(session.connection().is_none());
    assert_eq!(session.notes.newest().map(|n| n.severity), Some(Severity::Info));
}

#[test]
fn what_is_not_possible_says_why() {
    let session = Session::new(Arc::new(|| {}));
    for intent in [
        Intent::Arm,
        Intent::Disarm,
        Intent::Upload,
        Intent::CancelUpload,
        Intent::Reconnect,
        Intent::Grab(0),
        Intent::Release,
        Intent::ResetScene,
        Intent::ClearFault,
        Intent::Disconnect,
        Intent::PlayInsertion,
        Intent::Bake,
        Intent::SetParameter(ParameterId::ForceLimit, 1.0),
    ] {
        let reason = obstacle(&session, &intent);
        assert!(reason.is_some_and(|r| r.len() > 5), "{intent:?}");
    }
    assert_eq!(obstacle(&session, &Intent::Stop), None);
    assert_eq!(obstacle(&session, &Intent::OpenSample), None);
}

#[test]
fn a_file_that_is_none_is_refused_in_one_line_and_the_old_one_stays() {
    let mut harness = harness();
    open_sample(&mut harness);
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = folder.path().join("notes.step");
    std::fs::write(&path, "shopping list").expect("written");
    harness.state_mut().session.act(Intent::Open(path));
    until(&mut harness, "the file is refused", |s| {
        !s.is_busy() && s.notes.newest().is_some_and(|n| n.severity == Severity::Error)
    });
    let session = &harness.state().session;
    let text = &session.notes.newest().expect("one").text;
    assert!(!text.contains('\n') && text.contains("notes.step"), "{text}");
    assert!(session.document.as_ref().is_some_and(|d| d.baked.is_some()));
}

#[test]
fn another_method_bakes_the_scene_again() {
    let mut harness = harness();
    open_sample(&mut harness);
    let voxmap = |s: &Session| {
        let baked = s.document.as_ref().and_then(|d| d.baked.as_ref())?;
        Some(
            baked
                .report
                .shapes
                .iter()
                .all(|shape| shape.method == Method::Occupancy),
        )
    };
    assert_eq!(voxmap(&harness.state().session), Some(false));
    harness
        .state_mut()
        .session
        .act(Intent::ChooseMethod(Method::Occupancy));
    until(&mut harness, "baked again", |s| !s.is_busy());
    assert_eq!(voxmap(&harness.state().session), Some(true));
    // Choosing the same method again changes nothing, so nothing is baked.
    harness
        .state_mut()
        .session
        .act(Intent::ChooseMethod(Method::Occupancy));
    assert!(!harness.state().session.is_busy());
}

#[test]
fn parameters_reach_the_board_and_stay_in_range() {
    let mut harness = harness();
    connect_only(&mut harness);
    let session = &mut harness.state_mut().session;
    session.act(Intent::SetParameter(ParameterId::ForceLimit, 1e9));
    session.act(Intent::SetParameter(ParameterId::ForceLimit, 3.0));
    session.act(Intent::SetParameter(ParameterId::ForceLimit, 4.0));
    session.act(Intent::SetParameter(ParameterId::ObjectMass, f32::NAN));
    let row = ParameterId::ObjectMass.row();
    assert_eq!(session.parameters[ParameterId::ObjectMass as usize], row.default);
    // A new connection reads back the board's values.
    for _ in 0..200 {
        harness.step();
        std::thread::sleep(Duration::from_millis(5));
    }
    let session = &harness.state().session;
    assert_eq!(session.parameters[ParameterId::ForceLimit as usize], 4.0);
    assert!(worst(session) < Severity::Warning, "no value was refused");
}

fn connect_only(harness: &mut Harness<'_, Window>) {
    harness.step();
    until(harness, "rigs are listed", |s| !s.rigs.is_empty());
    click(harness, "Connect");
    until(harness, "connected", |s| s.connection().is_some());
}
