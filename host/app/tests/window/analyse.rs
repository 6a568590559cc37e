//! The workspace for recorded runs: several beside each other, their figures, and what computing them again gives.

use std::path::{Path, PathBuf};
use std::time::Instant;

use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use glam::{DAffine3, DVec3, Vec3};
use mortise::session::history::Quantity;
use mortise::session::insertion::hold;
use mortise::session::link::Link;
use mortise::session::runs::{MOST_RUNS, Playback, RunIntent};
use mortise::session::workspace::Workspace;
use mortise::session::{Intent, Session, obstacle};
use mortise::ui::Window;
use mortise_protocol::parameter::ParameterId;

use crate::common::{arm, begin_recording, click, connect, harness, open_sample, poses, until};

/// Records while the hand presses the peg of the sample beside its hole, after so long; returns the file.
fn record_touch(harness: &mut Harness<'_, Window>, wait_s: f64) -> PathBuf {
    let path = begin_recording(harness);
    click(harness, "Reset parts");
    arm(harness);
    harness.state_mut().session.act(Intent::Grab(1));
    until(harness, "the peg is held", |s| s.grabbed() == Some(1));
    pass(harness, wait_s);
    let handle = harness.state().session.handle().expect("a handle");
    let down = DAffine3::from_translation(DVec3::new(3.0, 0.0, -40.0));
    harness.state_mut().session.move_hand(hold(&(down * handle)));
    until(harness, "it presses", |s| {
        let force = s
            .telemetry
            .as_ref()
            .map(|sample| Vec3::from(sample.contact.force));
        force.is_some_and(|force| force.length() > 1.0)
    });
    pass(harness, 0.3);
    harness.state_mut().session.act(Intent::EndRecording);
    until(harness, "the end", |s| s.recording.is_none());
    path
}

/// Lets time pass.
fn pass(harness: &mut Harness<'_, Window>, seconds: f64) {
    let begun = Instant::now();
    until(harness, "time has passed", move |_| {
        begun.elapsed().as_secs_f64() > seconds
    });
}

/// The sample with two recorded runs, shown beside each other; the second touches later.
fn analysed(folder: &Path) -> (Harness<'static, Window>, [PathBuf; 2]) {
    let mut harness = harness();
    harness.state_mut().session.recordings = Some(folder.to_owned());
    open_sample(&mut harness);
    let paths = [0.1, 0.6].map(|wait_s| {
        connect(&mut harness);
        let path = record_touch(&mut harness, wait_s);
        harness.state_mut().session.act(Intent::Select(None));
        click(&mut harness, "Disconnect");
        until(&mut harness, "disconnected", |s| matches!(s.link, Link::None));
        path
    });
    assert_ne!(paths[0], paths[1]);
    click(&mut harness, "Analyse");
    assert_eq!(harness.state().session.workspace, Workspace::Analyse);
    act(&mut harness, RunIntent::Open(paths[0].clone()));
    until(&mut harness, "the run is read", |s| s.playback.is_some());
    act(&mut harness, RunIntent::Compare(paths[1].clone()));
    until(&mut harness, "the other run", |s| shown(s).runs().len() == 2);
    harness.run_steps(3);
    (harness, paths)
}

fn act(harness: &mut Harness<'_, Window>, intent: RunIntent) {
    harness.state_mut().session.act(Intent::Run(intent));
    harness.run_steps(2);
}

fn shown(session: &Session) -> &Playback {
    session.playback.as_ref().expect("runs are shown")
}

/// Whether a run is being computed again.
fn is_computing(session: &Session) -> bool {
    shown(session)
        .runs()
        .iter()
        .any(|shown| shown.recomputation.is_some())
}

#[test]
fn runs_stand_beside_each_other_with_their_figures_and_one_of_them_moves_the_parts() {
    let data = tempfile::tempdir().expect("a folder");
    let (mut harness, paths) = analysed(data.path());
    // The same figures as those of the runs themselves.
    for (index, run) in shown(&harness.state().session).runs().iter().enumerate() {
        let contact = format!(
            "Largest contact force, N, run {}: {:.2}",
            index + 1,
            run.run.figures.contact_n
        );
        assert!(run.run.figures.contact_n > 0.5, "it touches");
        assert_eq!(harness.query_all_by_label(&contact).count(), 1, "{contact}");
    }
    // The other run's first touch is where the chosen one's is.
    let playback = shown(&harness.state().session);
    let (_, other, shift) = playback.others().next().expect("the other is drawn");
    let touches = [playback.run(), other].map(|run| run.touch_s.expect("it touches"));
    assert!((touches[1] + shift - touches[0]).abs() < 1e-9);
    // At its end the peg is where the second run has put it.
    let name = shown(&harness.state().session).runs()[1].run.name();
    click(&mut harness, &format!("Choose run 2: {name}"));
    assert_eq!(shown(&harness.state().session).chosen(), 1);
    act(&mut harness, RunIntent::GoTo(1e9));
    let run = shown(&harness.state().session).run();
    let (_, last) = run
        .poses(1e9)
        .find(|(part, _)| *part == 1)
        .expect("the peg was held");
    let peg = poses(&harness)[1].translation.z;
    assert!(
        (peg - 1e3 * f64::from(last.position[2])).abs() < 1e-3,
        "{peg} {last:?}"
    );
    // What is not drawn is not beside it any more.
    click(&mut harness, "Draw run 1");
    assert_eq!(shown(&harness.state().session).others().count(), 0);
    // More runs than can be distinguished are refused.
    for count in 3..=MOST_RUNS {
        act(&mut harness, RunIntent::Compare(paths[0].clone()));
        until(&mut harness, "one more", |s| shown(s).runs().len() == count);
    }
    let more = obstacle(&harness.state().session, &Intent::Run(RunIntent::BrowseOther));
    assert_eq!(more, Some(format!("{MOST_RUNS} runs are shown: close one first")));
    for count in (1..MOST_RUNS).rev() {
        click(&mut harness, "Close run 1");
        assert_eq!(shown(&harness.state().session).runs().len(), count);
    }
    click(&mut harness, "Close run 1");
    assert!(harness.state().session.playback.is_none());
}

#[test]
fn figures_go_to_a_table_and_traces_to_a_picture() {
    let data = tempfile::tempdir().expect("a folder");
    let (mut harness, paths) = analysed(data.path());
    let table = data.path().join("runs.csv");
    act(
        &mut harness,
        RunIntent::WriteTable {
            path: table.clone(),
            replace: false,
        },
    );
    until(&mut harness, "the table", |_| table.exists());
    let text = std::fs::read_to_string(&table).expect("written");
    assert_eq!(text.lines().count(), 3, "{text}");
    for (line, path) in text.lines().skip(1).zip(&paths) {
        assert!(line.contains(&*path.to_string_lossy()), "{line}");
    }
    let picture = data.path().join("traces.SVG");
    let session = &mut harness.state_mut().session;
    let traces = mortise::session::intent::Traces {
        range_s: [0.0, 5.0],
        keys: vec!["contact_force_n", "insertion_mm"],
    };
    session.act(Intent::ExportTraces(traces));
    session.act(Intent::SaveTraces {
        path: picture.clone(),
        replace: false,
    });
    until(&mut harness, "the picture", |_| picture.exists());
    let svg = std::fs::read_to_string(&picture).expect("written");
    assert!(
        svg.starts_with("<svg") && svg.contains(Quantity::Force.name()) && svg.contains("stroke-dasharray")
    );
}

#[test]
fn a_run_is_computed_again_to_the_same_bits_and_another_parameter_changes_a_tick() {
    let data = tempfile::tempdir().expect("a folder");
    let (mut harness, _) = analysed(data.path());
    click(&mut harness, "Compute run 1 again");
    assert!(is_computing(&harness.state().session));
    let second = Intent::Run(RunIntent::Recompute(1, None));
    assert!(
        obstacle(&harness.state().session, &second).is_some(),
        "one at a time"
    );
    until(&mut harness, "it was computed again", |s| !is_computing(s));
    let result = shown(&harness.state().session)
        .shown()
        .recomputed
        .clone()
        .expect("a result");
    assert!(
        result.differs.is_none() && 10 * result.ticks > 9 * result.recorded,
        "{result:?}"
    );
    harness.run_steps(2);
    assert_eq!(harness.get_all_by_label_contains("every bit the same").count(), 1);
    // Another stiffness of contact is felt first where the parts touch.
    let change = Some((ParameterId::ContactStiffness, 5e4));
    act(&mut harness, RunIntent::Recompute(0, change));
    until(&mut harness, "it was computed again", |s| !is_computing(s));
    let playback = shown(&harness.state().session);
    let (result, touch_s) = (playback.shown().recomputed.clone(), playback.run().touch_s);
    let differs = result.and_then(|result| result.differs).expect("it differs");
    let (at_s, touch_s) = (differs.at_s.expect("in the run"), touch_s.expect("it touches"));
    assert!(
        (at_s - touch_s).abs() < 0.1,
        "{at_s} s, first touch at {touch_s} s"
    );
    click(&mut harness, "Go to the difference");
    assert_eq!(shown(&harness.state().session).at_s, at_s);
    // A computation ends when it is cancelled, and when its run is closed.
    act(&mut harness, RunIntent::Recompute(1, None));
    click(&mut harness, "Cancel computing again");
    assert!(!is_computing(&harness.state().session));
    assert_eq!(shown(&harness.state().session).runs()[1].recomputed, None);
    act(&mut harness, RunIntent::Recompute(1, None));
    act(&mut harness, RunIntent::Close);
    assert!(harness.state().session.playback.is_none());
    // A file that is gone is stated.
    let (mut harness, paths) = analysed(&data.path().join("other"));
    std::fs::remove_file(&paths[0]).expect("removed");
    act(&mut harness, RunIntent::Recompute(0, None));
    until(&mut harness, "it is stated", |s| {
        s.notes.iter().any(|note| note.text.contains("could not be read"))
    });
    assert!(!is_computing(&harness.state().session));
}

/// Once the run that moved the parts is closed they are the operator's, also while another run is shown.
#[test]
fn parts_that_no_run_moves_any_more_stay_where_they_are_put() {
    let data = tempfile::tempdir().expect("a folder");
    let mut harness = harness();
    harness.state_mut().session.recordings = Some(data.path().to_owned());
    open_sample(&mut harness);
    let paths = [0, 1].map(|number| {
        if number == 1 {
            // Another collision model of the same file.
            harness.state_mut().session.act(Intent::Lock(0, false));
            until(&mut harness, "it is baked again", |s| {
                s.document
                    .as_ref()
                    .is_some_and(|document| document.baked.is_some())
            });
        }
        connect(&mut harness);
        let path = record_touch(&mut harness, 0.1);
        harness.state_mut().session.act(Intent::Select(None));
        click(&mut harness, "Disconnect");
        until(&mut harness, "disconnected", |s| matches!(s.link, Link::None));
        path
    });
    act(&mut harness, RunIntent::Open(paths[0].clone()));
    until(&mut harness, "the run is read", |s| s.playback.is_some());
    assert!(!harness.state().session.replays(), "it has another model");
    act(&mut harness, RunIntent::Compare(paths[1].clone()));
    until(&mut harness, "the other run", |s| shown(s).runs().len() == 2);
    assert!(harness.state().session.replays());
    act(&mut harness, RunIntent::Remove(1));
    assert!(!harness.state().session.replays());
    harness.state_mut().session.act(Intent::Select(Some(1)));
    harness.run_steps(2);
    let before = poses(&harness);
    harness.key_press(egui::Key::PageUp);
    harness.run_steps(2);
    let moved = poses(&harness);
    assert_ne!(moved, before);
    act(&mut harness, RunIntent::GoTo(0.2));
    assert_eq!(poses(&harness), moved);
    act(&mut harness, RunIntent::Close);
    assert_eq!(poses(&harness), moved);
}
