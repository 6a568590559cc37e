//! Recording from the window: a button, a file in the user's folder, and the same bits when it is computed again.

use std::path::PathBuf;

use crate::common::{
    arm, begin_recording, click, connect, harness, open_sample, poses, record_insertion, until,
};
use glam::{DAffine3, DVec3};
use mortise::session::insertion::hold;
use mortise::session::link::Link;
use mortise::session::{Intent, Session};
use mortise_record::{Recording, replay};

/// Files of the folder for recordings.
fn files(data: &std::path::Path) -> Vec<PathBuf> {
    std::fs::read_dir(data)
        .into_iter()
        .flatten()
        .flatten()
        .map(|file| file.path())
        .collect()
}

#[test]
fn a_session_is_recorded_and_replays_and_a_lost_link_ends_the_file() {
    let data = tempfile::tempdir().expect("a folder");
    let mut harness = harness();
    harness.state_mut().session.recordings = Some(data.path().join("recordings"));
    open_sample(&mut harness);
    connect(&mut harness);
    let path = record_insertion(&mut harness);
    assert_eq!(files(&data.path().join("recordings")), [path.as_path()]);
    let first = Recording::open(&path).expect("a recording");
    assert!(first.complete());
    let replayed = replay(&first, &[]).expect("it can be replayed");
    assert_eq!(replayed.difference, None, "{replayed:?}");
    assert!(replayed.compared > 1000, "{replayed:?}");

    click(&mut harness, "Record");
    until(&mut harness, "another recording", |s| s.recording.is_some());
    click(&mut harness, "Disconnect");
    until(&mut harness, "the rig is gone", |s| matches!(s.link, Link::None));
    assert!(harness.state().session.recording.is_none());
    // The file ends on the link's thread.
    let begun = std::time::Instant::now();
    let second = loop {
        let found = files(&data.path().join("recordings"));
        let second = found.into_iter().find(|file| *file != path);
        let ended = second
            .and_then(|file| Recording::open(&file).ok())
            .filter(Recording::complete);
        if let Some(ended) = ended {
            break ended;
        }
        assert!(begun.elapsed().as_secs() < 20, "the second file was not ended");
        std::thread::sleep(std::time::Duration::from_millis(20));
    };
    assert!(second.entries().count() > 0);
}

/// Where parts were placed on the board since the upload, the recording begins with an upload, without which it could not be computed again.
#[test]
fn a_recording_of_moved_parts_replays() {
    let data = tempfile::tempdir().expect("a folder");
    let mut harness = harness();
    harness.state_mut().session.recordings = Some(data.path().join("recordings"));
    open_sample(&mut harness);
    harness.run_steps(3);
    click(&mut harness, "peg");
    connect(&mut harness);
    harness.run_steps(2);
    let before = poses(&harness);
    harness.key_press(egui::Key::PageUp);
    harness.run_steps(2);
    until(&mut harness, "the part is placed", Session::scene_is_on_board);
    assert_ne!(poses(&harness), before);
    let there = poses(&harness)[1];
    let path = begin_recording(&mut harness);
    arm(&mut harness);
    harness.state_mut().session.act(Intent::Grab(1));
    until(&mut harness, "the peg is held", |s| s.grabbed() == Some(1));
    assert!(poses(&harness)[1].abs_diff_eq(there, 0.05));
    let handle = harness.state().session.handle().expect("a handle");
    let down = DAffine3::from_translation(DVec3::new(3.0, 0.0, -40.0));
    harness.state_mut().session.move_hand(hold(&(down * handle)));
    let begun = std::time::Instant::now();
    until(&mut harness, "a second has passed", move |_| {
        begun.elapsed().as_secs_f64() > 1.0
    });
    harness.state_mut().session.act(Intent::EndRecording);
    until(&mut harness, "the end", |s| s.recording.is_none());
    let recording = Recording::open(&path).expect("a recording");
    let replayed = replay(&recording, &[]).expect("it can be replayed");
    assert_eq!(replayed.difference, None, "{replayed:?}");
    assert!(replayed.compared > 1000, "{replayed:?}");
}
