//! Position scaling in the running window: a handle of little reach moves a part across the scene, and what that does to stiffness is said.

use egui_kittest::Harness;
use mortise::session::notes::Severity;
use mortise::session::{Intent, Session};
use mortise::ui::Window;
use mortise_protocol::message::DeviceState;
use mortise_protocol::parameter::ParameterId;
use mortise_record::{Recording, replay};

use crate::common::{arm, begin_recording, click, connect, harness, open_sample, poses, texts, until, worst};

fn scale(harness: &mut Harness<'_, Window>, value: f32) {
    let set = Intent::SetParameter(ParameterId::PositionScale, value);
    harness.state_mut().session.act(set);
    harness.run_steps(2);
}

fn grab(harness: &mut Harness<'_, Window>) {
    click(harness, "Grab");
    until(harness, "the peg is held", |s| s.grabbed() == Some(1));
    harness.run_steps(2);
}

#[test]
fn a_part_moves_so_many_times_as_far_as_the_handle_and_the_window_says_how_stiff_that_feels() {
    let data = tempfile::tempdir().expect("a folder");
    let mut harness = harness();
    harness.state_mut().session.recordings = Some(data.path().join("recordings"));
    open_sample(&mut harness);
    connect(&mut harness);
    assert!(texts(&harness, "The part moves").is_empty(), "nothing is scaled");
    let margin = texts(&harness, "Stiffness may rise by 3.14 times");
    assert_eq!(margin.len(), 1);
    scale(&mut harness, 4.0);
    let effect = "The part moves 4 times as far as the handle; the coupling's 1000 N/m are felt as 16000 N/m";
    assert_eq!(texts(&harness, effect).len(), 1);
    assert_eq!(texts(&harness, "Seen through a position scale of 4").len(), 1);
    assert!(
        texts(&harness, "Stiffness may rise by 3.14 times").is_empty(),
        "the margin is that of the scaled handle"
    );
    let path = begin_recording(&mut harness);
    arm(&mut harness);
    click(&mut harness, "peg");
    grab(&mut harness);
    let at = |harness: &Harness<'_, Window>| {
        let handle = harness.state().session.handle().expect("reported");
        (handle.translation, poses(harness)[1].translation)
    };
    let (handle_before, peg_before) = at(&harness);
    click(&mut harness, "Play insertion");
    let is_in = |s: &Session| {
        s.document
            .as_ref()
            .is_some_and(|d| d.poses[1].translation.z < 20.1)
    };
    until(&mut harness, "the peg is in", is_in);
    let (handle, peg) = at(&harness);
    let off = 4.0 * (handle - handle_before) - (peg - peg_before);
    assert!((peg - peg_before).length() > 59.0, "{peg}");
    // Beside what the coupling gives way, and what both move between two reports.
    assert!(off.length() < 2.0, "{off}");
    let ghost = harness.state().session.ghost().expect("held").1.translation;
    assert!((ghost - peg).length() < 2.0, "{ghost} {peg}");
    assert!(worst(&harness.state().session) < Severity::Warning);

    // The part in hand keeps its scale.
    scale(&mut harness, 2.0);
    assert_eq!(
        texts(&harness, "From the next grab on the part moves 2 times").len(),
        1
    );
    let ghost = harness.state().session.ghost().expect("held").1.translation;
    assert!((ghost - peg).length() < 2.0, "{ghost} {peg}");
    click(&mut harness, "Release");
    until(&mut harness, "let go of", |s| {
        s.device() == Some(DeviceState::Armed)
    });
    grab(&mut harness);
    assert_eq!(texts(&harness, "The part moves 2 times").len(), 1);

    harness.state_mut().session.act(Intent::EndRecording);
    until(&mut harness, "the recording ends", |s| s.recording.is_none());
    let recording = Recording::open(&path).expect("a recording");
    let replayed = replay(&recording, &[]).expect("it can be replayed");
    assert_eq!(replayed.difference, None, "{replayed:?}");
    assert!(replayed.compared > 1000, "{replayed:?}");
}
