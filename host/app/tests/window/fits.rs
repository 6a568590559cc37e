//! Fits found in the window: shown before anything moves, looked through by keys, and accepted while the motors are off.

use std::sync::Arc;

use crate::common::{arm, click, connect, harness, holding, open_sample, picture, poses, press, until};
use egui::Key;
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT as _, Queryable as _};
use glam::{DAffine3, DVec3};
use mortise::session::grouped::Grouped;
use mortise::session::{Intent, Session, obstacle};
use mortise::ui::Window;
use mortise::viewport::picture::Item;
use mortise_protocol::message::DeviceState;

/// What is drawn beside the parts.
fn ghosts(harness: &Harness<'_, Window>) -> Vec<Item> {
    picture(harness).split_off(poses(harness).len())
}

/// Where the fit that is shown puts the part.
fn shown(harness: &Harness<'_, Window>) -> DAffine3 {
    let session = &harness.state().session;
    let offer = session.fitting.as_ref().and_then(|fitting| fitting.offer());
    let document = session.document.as_ref().expect("open");
    offer.expect("a fit").pose(document).expect("rigid")
}

fn chosen(harness: &Harness<'_, Window>) -> usize {
    harness.state().session.fitting.as_ref().expect("fits").chosen
}

fn searched(session: &Session) -> bool {
    (session.fitting.as_ref()).is_some_and(|fitting| fitting.search.is_none() && !fitting.offers.is_empty())
}

/// The peg selected and its fits found.
fn found() -> Harness<'static, Window> {
    let mut harness = harness();
    open_sample(&mut harness);
    click(&mut harness, "peg");
    click(&mut harness, "Find fits");
    until(&mut harness, "searched", searched);
    harness.run_steps(2);
    harness
}

#[test]
fn fits_are_shown_before_anything_moves_and_one_key_goes_on() {
    let mut harness = harness();
    open_sample(&mut harness);
    let before = poses(&harness);
    harness.run_steps(2);
    assert!(harness.get_by_label("Find fits").accesskit_node().is_disabled());
    click(&mut harness, "peg");
    press(&mut harness, Key::M);
    until(&mut harness, "searched", searched);
    harness.run_steps(2);
    harness.get_by_label("2 fits of peg, the best first");
    harness.get_by_label_contains("Fit 1 of 2: peg with block");
    assert_eq!(poses(&harness), before, "nothing moves");
    let [ghost] = &ghosts(&harness)[..] else {
        panic!("one ghost")
    };
    assert_eq!(ghost.pose, shown(&harness));
    assert!(ghost.opacity < 0.5 && !ghost.mates.is_empty());
    let middle = ghost.pose.transform_point3(DVec3::new(0.0, 0.0, -30.0));
    assert!(
        middle.x.abs() < 1e-3 && middle.y.abs() < 1e-3,
        "in the hole: {middle}"
    );

    let before_see = harness.state().view.camera;
    click(&mut harness, "See fit");
    harness.run_steps(3);
    assert_ne!(harness.state().view.camera, before_see);
    press(&mut harness, Key::N);
    assert_eq!(chosen(&harness), 1);
    click(&mut harness, "Next fit");
    assert_eq!(chosen(&harness), 0);
    click(&mut harness, "Fit 2. with block");
    assert_eq!(chosen(&harness), 1);
    let up = |harness: &Harness<'_, Window>| shown(harness).transform_vector3(DVec3::Z).z;
    let way_round = up(&harness);
    press(&mut harness, Key::T);
    assert!(up(&harness) * way_round < -0.99);
    click(&mut harness, "Turn part over");
    assert!(up(&harness) * way_round > 0.99);
    assert_eq!(poses(&harness), before, "nothing moves");
    click(&mut harness, "Close fits");
    assert!(harness.state().session.fitting.is_none() && ghosts(&harness).is_empty());
    assert_eq!(poses(&harness), before, "nothing moves");
}

#[test]
fn an_accepted_fit_is_where_the_next_board_has_the_part() {
    let mut harness = found();
    let pose = shown(&harness);
    click(&mut harness, "Place part in fit");
    assert!(poses(&harness)[1].abs_diff_eq(pose, 1e-12));
    assert!(harness.state().session.fitting.is_none());
    connect(&mut harness);
    arm(&mut harness);
    click(&mut harness, "Grab");
    until(&mut harness, "held", |s| s.grabbed() == Some(1));
    assert!(poses(&harness)[1].abs_diff_eq(pose, 0.05));
    click(&mut harness, "STOP");
    until(&mut harness, "stopped", |s| {
        s.device() == Some(DeviceState::Stopped)
    });
}

/// While a board holds a part the fits are shown, and no key moves it.
#[test]
fn a_held_part_is_placed_only_once_the_motors_are_off() {
    let mut harness = holding();
    press(&mut harness, Key::M);
    until(&mut harness, "searched", searched);
    let pose = shown(&harness);
    assert!(ghosts(&harness).iter().any(|ghost| ghost.pose == pose));
    press(&mut harness, Key::P);
    until(&mut harness, "refused", |s| {
        s.notes
            .newest()
            .is_some_and(|note| note.text.contains("disarm first"))
    });
    let session = &harness.state().session;
    assert!(session.fitting.is_some() && session.grabbed() == Some(1));
    assert!(
        !poses(&harness)[1].abs_diff_eq(pose, 1.0),
        "it is where the hand holds it"
    );

    harness.state_mut().session.act(Intent::Disarm);
    until(&mut harness, "idle", |s| s.device() == Some(DeviceState::Idle));
    harness.run_steps(2);
    press(&mut harness, Key::P);
    assert!(harness.state().session.fitting.is_none(), "accepted");
    until(&mut harness, "on the board there", Session::scene_is_on_board);
    assert!(poses(&harness)[1].abs_diff_eq(pose, 1e-12));
    arm(&mut harness);
    click(&mut harness, "Grab");
    until(&mut harness, "held", |s| s.grabbed() == Some(1));
    let now = poses(&harness)[1];
    assert!(now.abs_diff_eq(pose, 0.05), "{now} instead of {pose}");
    click(&mut harness, "STOP");
}

/// The shown fit is followed and no longer; what guides is listed with what recognised surfaces hold.
#[test]
fn a_held_part_is_guided_along_the_way_into_a_fit_that_is_chosen() {
    let mut harness = holding();
    press(&mut harness, Key::M);
    until(&mut harness, "searched", searched);
    harness.run_steps(2);
    assert!(!harness.state().session.follows_shown_fit());
    press(&mut harness, Key::G);
    assert!(harness.state().session.follows_shown_fit());
    press(&mut harness, Key::N);
    assert!(!harness.state().session.follows_shown_fit(), "another one is");
    press(&mut harness, Key::N);
    assert!(harness.state().session.follows_shown_fit());
    harness.run_steps(2);
    harness.get_by_label("Guide along the way in");
    press(&mut harness, Key::G);
    assert!(!harness.state().session.follows_shown_fit());
    assert_eq!(harness.state().session.grabbed(), Some(1), "nothing else happens");
}

#[test]
fn a_cancelled_search_reports_nothing_more() {
    let mut harness = harness();
    open_sample(&mut harness);
    let session = &mut harness.state_mut().session;
    session.act(Intent::Select(Some(1)));
    session.act(Intent::FindFits);
    assert!(obstacle(session, &Intent::CancelFits).is_none());
    harness.run_steps(1);
    click(&mut harness, "Cancel search for fits");
    assert!(harness.state().session.fitting.is_none());
    // A new search is not mixed up with the cancelled one, which ends later.
    harness.state_mut().session.act(Intent::FindFits);
    until(&mut harness, "searched", searched);
    std::thread::sleep(std::time::Duration::from_millis(1_500));
    harness.run_steps(2);
    let fitting = harness.state().session.fitting.as_ref().expect("fits");
    assert_eq!(fitting.offers.len(), 2);
    // Nor does it outlive its document.
    click_sample_again(&mut harness);
    let session = &harness.state().session;
    assert!(session.fitting.is_none() && session.partner.is_none());
}

fn click_sample_again(harness: &mut Harness<'_, Window>) {
    let before = harness.state().session.document.as_ref().map(|d| d.generation);
    harness.state_mut().session.act(Intent::OpenSample);
    until(harness, "opened again", move |s| {
        s.document.as_ref().map(|d| d.generation) != before
    });
}

/// Whether the block and the peg have closed shells.
fn close(session: &mut Session, closed: [bool; 2]) {
    let document = session.document.as_mut().expect("open");
    let model = Arc::make_mut(&mut document.model);
    for (shape, closed) in model.shapes.iter_mut().zip(closed) {
        shape.closed = closed;
    }
    document.grouped = Arc::new(Grouped::none(
        Arc::clone(&document.model),
        document.extents.clone(),
    ));
}

#[test]
fn what_cannot_be_searched_is_said() {
    let mut harness = harness();
    open_sample(&mut harness);
    let session = &mut harness.state_mut().session;
    let why = |session: &Session| obstacle(session, &Intent::FindFits).unwrap_or_default();
    assert_eq!(why(session), "Select a part first");
    session.act(Intent::Select(Some(1)));
    assert_eq!(why(session), "");
    session.act(Intent::FitWith(Some(1)));
    assert!(why(session).contains("does not fit itself"));
    session.act(Intent::FitWith(Some(0)));
    assert_eq!(why(session), "");
    close(session, [true, false]);
    assert!(why(session).contains("peg has no closed surface"));
    for intent in [Intent::NextFit, Intent::TurnOver, Intent::PlaceFit] {
        assert!(obstacle(session, &intent).is_some_and(|why| why.contains("find fits first")));
    }
    // The other part has an open shell.
    close(session, [false, true]);
    session.act(Intent::FindFits);
    until(&mut harness, "said", |s| {
        s.fitting.as_ref().is_some_and(|fitting| fitting.search.is_none())
    });
    harness.run_steps(2);
    harness.get_by_label_contains("`block` has no closed surface");
    harness.get_by_label("No fit of peg was found");
}
