//! Parts locked to the ground, and let free: which may be grabbed, and that it is kept.

use crate::common::{arm, click, connect, harness, harness_on, open_sample, poses, until};
use mortise::session::grouping::GroupIntent;
use mortise::session::{Intent, Session, obstacle};

use crate::groups::{PINS, opened};

fn is_baked(session: &Session) -> bool {
    session
        .document
        .as_ref()
        .is_some_and(|document| document.baked.is_some())
}

/// Which parts may be grabbed.
fn grabbable(session: &Session) -> [bool; 2] {
    let document = session.document.as_ref().expect("open");
    [0, 1].map(|part| document.is_grabbable(part))
}

#[test]
fn a_part_is_locked_and_another_one_let_free_and_held() {
    let mut harness = harness();
    open_sample(&mut harness);
    assert_eq!(
        grabbable(&harness.state().session),
        [false, true],
        "the largest is fixed"
    );
    let all = obstacle(&harness.state().session, &Intent::Lock(1, true));
    assert_eq!(all.as_deref(), Some("One part at the least must be free"));
    click(&mut harness, "block");
    click(&mut harness, "Unlock");
    until(&mut harness, "it is baked again", is_baked);
    assert_eq!(grabbable(&harness.state().session), [true, true]);
    harness.run_steps(2);
    harness.state_mut().session.act(Intent::Lock(1, true));
    until(&mut harness, "it is baked again", is_baked);
    assert_eq!(grabbable(&harness.state().session), [true, false]);
    let again = obstacle(&harness.state().session, &Intent::Lock(1, true)).expect("a reason");
    assert!(again.contains("locked already"), "{again}");
    // The block is held, and the peg stays.
    connect(&mut harness);
    arm(&mut harness);
    let peg = obstacle(&harness.state().session, &Intent::Grab(1)).expect("a reason");
    assert!(peg.contains("locked to the ground"), "{peg}");
    let locking = obstacle(&harness.state().session, &Intent::Lock(1, false));
    assert!(locking.is_some(), "not while the motors are on");
    let before = poses(&harness);
    harness.state_mut().session.act(Intent::Grab(0));
    until(&mut harness, "the block is held", |s| s.grabbed() == Some(0));
    assert_eq!(poses(&harness)[1], before[1]);
    click(&mut harness, "STOP");
}

#[test]
fn what_is_locked_comes_back_at_the_next_start() {
    let folder = tempfile::tempdir().expect("a folder");
    {
        let mut harness = harness_on(folder.path());
        open_sample(&mut harness);
        harness.state_mut().session.act(Intent::Lock(0, false));
        until(&mut harness, "it is baked again", is_baked);
        harness.state_mut().session.act(Intent::Lock(1, true));
        until(&mut harness, "it is baked again", is_baked);
    }
    let mut harness = harness_on(folder.path());
    open_sample(&mut harness);
    assert_eq!(grabbable(&harness.state().session), [true, false]);
}

/// Grouped with a locked part, the last free ones would be locked as well.
#[test]
fn a_group_that_leaves_nothing_to_grab_is_refused() {
    let mut harness = opened();
    let group = Intent::Group(GroupIntent::Group(PINS.to_vec()));
    for part in (0..poses(&harness).len()).filter(|part| *part != PINS[1]) {
        assert_eq!(obstacle(&harness.state().session, &group), None);
        let lock = Intent::Lock(part, true);
        if obstacle(&harness.state().session, &lock).is_none() {
            harness.state_mut().session.act(lock);
            until(&mut harness, "it is baked again", is_baked);
        }
    }
    let reason = obstacle(&harness.state().session, &group).expect("a reason");
    assert!(reason.contains("Nothing would be left to grab"), "{reason}");
}
