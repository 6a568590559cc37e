//! Recorded runs in the running window: parts move as they moved, two runs beside each other, and nothing is left of them when they are closed.

use std::path::PathBuf;

use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use mortise::session::link::Link;
use mortise::session::runs::{Playback, RunIntent};
use mortise::session::{Intent, Session, obstacle};
use mortise::ui::Window;

use crate::common::{click, connect, harness, open_sample, poses, record_insertion, until};

/// The sample with an insertion recorded in a file of `folder`, and the rig disconnected.
fn recorded(folder: &std::path::Path) -> (Harness<'static, Window>, PathBuf) {
    let mut harness = harness();
    harness.state_mut().session.recordings = Some(folder.to_owned());
    open_sample(&mut harness);
    connect(&mut harness);
    let path = record_insertion(&mut harness);
    let open = Intent::Run(RunIntent::Open(path.clone()));
    assert!(
        obstacle(&harness.state().session, &open).is_some(),
        "the rig moves the parts"
    );
    click(&mut harness, "Disconnect");
    until(&mut harness, "disconnected", |s| matches!(s.link, Link::None));
    (harness, path)
}

fn act(harness: &mut Harness<'_, Window>, intent: RunIntent) {
    harness.state_mut().session.act(Intent::Run(intent));
    harness.run_steps(2);
}

fn shown(session: &Session) -> &Playback {
    session.playback.as_ref().expect("a run is shown")
}

#[test]
fn a_run_is_shown_scrubbed_played_compared_and_closed() {
    let data = tempfile::tempdir().expect("a folder");
    let (mut harness, path) = recorded(data.path());
    let before = poses(&harness);
    let undo = harness.state().session.moves.to_undo().map(str::to_owned);
    act(&mut harness, RunIntent::Open(path.clone()));
    until(&mut harness, "the run is read", |s| s.playback.is_some());
    harness.run_steps(3);
    let playback = shown(&harness.state().session);
    assert!(playback.shown().moves_parts, "the file that was recorded is open");
    let length = playback.run().duration_s();
    assert!(length > 2.0, "{length} s");
    // The slider moves the peg as it moved, and no part but that.
    let seen: Vec<f64> = [0.0, 0.5, 1.0]
        .map(|share| {
            act(&mut harness, RunIntent::GoTo(share * length));
            let now = poses(&harness);
            assert_eq!(now[0], before[0], "the block is fixed");
            now[1].translation.z
        })
        .to_vec();
    assert!(
        seen[1] > seen[2] + 5.0,
        "the peg goes up and comes down: {seen:?}"
    );
    // Where it was held to the end, it is where it was when the rig was disconnected.
    assert!(
        (seen[2] - before[1].translation.z).abs() < 0.5,
        "{seen:?} {before:?}"
    );
    let reset = obstacle(&harness.state().session, &Intent::ResetScene);
    assert_eq!(reset.as_deref(), Some("A recorded run is shown: close it first"));
    // It plays by itself, at the chosen speed, to the end.
    act(&mut harness, RunIntent::Speed(5.0));
    click(&mut harness, "Play the run");
    until(&mut harness, "the end of the run", |s| !shown(s).plays);
    assert!((shown(&harness.state().session).at_s - length).abs() < 1e-9);
    // Beside itself it touches at the same time.
    act(&mut harness, RunIntent::Compare(path));
    until(&mut harness, "the other run", |s| shown(s).runs().len() == 2);
    harness.run_steps(3);
    assert_eq!(
        shown(&harness.state().session)
            .others()
            .next()
            .map(|(.., shift)| shift),
        Some(0.0)
    );
    let name = shown(&harness.state().session).run().name();
    let figures = harness.get_all_by_label_contains(&format!("{name}: ")).count();
    assert!(figures >= 2, "figures of both: {figures}");
    // Figures and traces of both go to a page.
    let report = data.path().join("report.html");
    act(
        &mut harness,
        RunIntent::WriteReport {
            path: report.clone(),
            replace: false,
        },
    );
    until(&mut harness, "the report", |_| report.exists());
    let page = std::fs::read_to_string(&report).expect("written");
    assert!(page.matches(&format!("<th>{name}</th>")).count() == 2 && page.contains("<polyline"));
    click(&mut harness, "Close the run");
    assert!(harness.state().session.playback.is_none());
    assert_eq!(
        harness.state().session.moves.to_undo().map(str::to_owned),
        undo,
        "a run is no step of the history"
    );
    assert_eq!(poses(&harness), before, "parts are back");
}

#[test]
fn a_run_of_another_model_moves_no_part_and_what_is_no_run_is_refused() {
    let data = tempfile::tempdir().expect("a folder");
    let (mut harness, path) = recorded(data.path());
    let damaged = data.path().join("damaged.mcap");
    std::fs::write(&damaged, b"no recording").expect("written");
    for wrong in [damaged, data.path().join("none.mcap")] {
        act(&mut harness, RunIntent::Open(wrong.clone()));
        let name = wrong.file_name().expect("a name").to_string_lossy().into_owned();
        until(&mut harness, "it is refused", |s| {
            s.notes.iter().any(|note| note.text.contains(&name))
        });
        assert!(harness.state().session.playback.is_none());
    }
    // With another model open its traces are shown alone.
    harness.state_mut().session.document = None;
    act(&mut harness, RunIntent::Open(path));
    until(&mut harness, "the run is read", |s| s.playback.is_some());
    assert!(!shown(&harness.state().session).shown().moves_parts);
    act(&mut harness, RunIntent::GoTo(1.0));
    // Connecting ends it.
    harness.state_mut().session.act(Intent::Connect);
    assert!(harness.state().session.playback.is_none());
}
