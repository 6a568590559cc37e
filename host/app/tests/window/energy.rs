//! Guidance by geometric energy in the window: made for the fit that is shown, brought to the board, felt by the held part, and seen.

use std::sync::Arc;

use crate::common::{
    arm, click, connect, harness, harness_with_cache, open_sample, poses, press, texts, until, worst,
};
use egui::Key;
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use glam::{DQuat, DVec3};
use mortise::session::energies::EnergyIntent;
use mortise::session::moves::Motion;
use mortise::session::notes::Severity;
use mortise::session::{Intent, Session, obstacle};
use mortise::ui::Window;
use mortise::viewport::compose::{Look, compose};
use mortise::viewport::picture::Glow;
use mortise_protocol::message::DeviceState;
use mortise_protocol::parameter::ParameterId;

/// Chooses the method from the list.
fn guide_by_energy(harness: &mut Harness<'_, Window>) {
    click(harness, "Guidance");
    click(harness, "geometric energy");
    assert!(harness.state().session.guides_by_energy());
}

/// The connected sample with the peg selected, and guidance by energy, which is made anew.
fn begun() -> Harness<'static, Window> {
    begun_in(harness())
}

fn begun_in(mut harness: Harness<'static, Window>) -> Harness<'static, Window> {
    open_sample(&mut harness);
    connect(&mut harness);
    click(&mut harness, "peg");
    guide_by_energy(&mut harness);
    harness
}

/// Whether the board's scene has an energy of the peg, and it is that of the fit that is shown.
fn is_there(session: &Session) -> bool {
    session.scene_is_on_board() && !session.scene_energies().is_empty() && session.why_not_drawn().is_none()
}

/// As [`begun`], with the energy on the board, read from the cache where another test has made it.
fn made() -> Harness<'static, Window> {
    let mut harness = begun_in(harness_with_cache());
    until(&mut harness, "the energy is on the board", is_there);
    harness.run_steps(2);
    harness
}

fn glow(harness: &Harness<'_, Window>) -> Option<Glow> {
    let window = harness.state();
    let document = window.session.document.as_ref().expect("open");
    compose(&window.session, document, &Look::default()).glow
}

/// Force of guidance on the held part, N.
fn force(session: &Session) -> DVec3 {
    let guidance = session.telemetry.as_ref().map(|telemetry| telemetry.guidance);
    guidance.map_or(DVec3::ZERO, |guidance| {
        DVec3::from(guidance.wrench.force.map(f64::from))
    })
}

fn set(harness: &mut Harness<'_, Window>, id: ParameterId, value: f32) {
    harness.state_mut().session.act(Intent::SetParameter(id, value));
}

#[test]
fn choosing_the_method_makes_an_energy_that_draws_the_held_part_from_the_open_into_its_fit() {
    let mut harness = begun();
    harness.run_steps(2);
    until(&mut harness, "it is being made", |s| {
        s.energy_under_way().is_some()
    });
    harness.run_steps(2);
    assert_eq!(texts(&harness, "Making the energy").len(), 1);
    let before = poses(&harness);
    assert!(glow(&harness).is_none(), "nothing is seen of what is not there");
    until(&mut harness, "the energy is on the board", is_there);
    harness.run_steps(2);
    assert_eq!(poses(&harness), before, "nothing has moved");
    let lines = texts(&harness, "Energy: ");
    let [line] = &lines[..] else { panic!("{lines:?}") };
    assert!(
        line.starts_with("Energy: peg into block, 3") && line.ends_with(" KiB"),
        "{line}"
    );
    assert!(texts(&harness, "Making the energy").is_empty());
    assert!(
        harness.query_by_label("Max guidance force").is_none(),
        "of targets"
    );

    arm(&mut harness);
    click(&mut harness, "Grab");
    until(&mut harness, "held", |s| s.grabbed() == Some(1));
    // Above the block the energy has not begun; it is engaged all the same, over a quarter of a second.
    until(&mut harness, "engaged", |s| {
        s.telemetry.as_ref().is_some_and(|t| t.guidance.engagement > 0.99)
    });
    click(&mut harness, "Play insertion");
    until(&mut harness, "drawn inwards", |s| force(s).z < -0.3);
    assert!(
        force(&harness.state().session).length() < 3.5,
        "no more than the largest force"
    );
    set(&mut harness, ParameterId::GeometricForce, 0.0);
    until(&mut harness, "no force is left", |s| force(s).length() < 1e-6);
    harness.run_steps(2);
    assert_eq!(texts(&harness, "The force of the energy is 0 N").len(), 1);
    assert!(glow(&harness).is_none(), "what does not draw is not seen");
    assert!(worst(&harness.state().session) < Severity::Warning);
}

/// A hand that lets the part hang beside the way feels it drawn there.
#[test]
fn a_part_beside_the_way_is_drawn_to_it() {
    let mut harness = made();
    // Before the mouth at which the way of the fit begins, which is under the block, 3 mm aside: nothing touches.
    let aside = Motion {
        part: 1,
        shift_mm: DVec3::new(3.0, 0.0, -122.0),
        turn: DQuat::IDENTITY,
        goes_on: false,
    };
    harness.state_mut().session.act(Intent::Move(aside));
    until(
        &mut harness,
        "it is there on the board",
        Session::scene_is_on_board,
    );
    assert!(
        is_there(&harness.state().session),
        "placed elsewhere, the scene has its energy"
    );
    arm(&mut harness);
    click(&mut harness, "Grab");
    until(&mut harness, "held", |s| s.grabbed() == Some(1));
    let begun = poses(&harness)[1].translation;
    until(&mut harness, "drawn aside", |s| force(s).x < -0.05);
    let now = poses(&harness)[1].translation;
    until(&mut harness, "it has gone there", move |s| {
        s.document
            .as_ref()
            .is_some_and(|d| d.poses[1].translation.x < begun.x - 0.05)
    });
    assert!((now - begun).length() < 1.0, "softly");
}

const CANCELLED: &str = "The energy of the fit that is shown was cancelled";

/// Cancels an energy while it is being made. A busy computer may have made it before it draws the next frame: then the one of the other fit is cancelled.
fn cancel(harness: &mut Harness<'_, Window>) {
    let under_way = |session: &Session| session.energy_under_way().is_some();
    for _ in 0..2 {
        until(harness, "it is being made", |s| under_way(s) || is_there(s));
        while under_way(&harness.state().session) {
            if let Some(button) = harness.query_by_label("Cancel energy") {
                button.click();
            }
            harness.step();
        }
        harness.run_steps(2);
        if !texts(harness, CANCELLED).is_empty() {
            return;
        }
        press(harness, Key::N);
    }
    panic!("both were made before they could be cancelled");
}

#[test]
fn a_cancelled_energy_is_made_only_on_request() {
    let mut harness = begun();
    cancel(&mut harness);
    assert_eq!(texts(&harness, CANCELLED).len(), 1);
    let session = &harness.state().session;
    assert!(obstacle(session, &Intent::Energy(EnergyIntent::Cancel)).is_some());
    assert!(session.why_not_drawn().is_some());
    std::thread::sleep(std::time::Duration::from_millis(1_500));
    harness.run_steps(2);
    assert_eq!(texts(&harness, CANCELLED).len(), 1, "it stays so");
    click(&mut harness, "Make energy");
    until(&mut harness, "the energy is on the board", is_there);
}

/// While a part is held nothing is uploaded; the other candidate's energy replaces the first one's, and what was made is made once.
#[test]
fn the_energy_follows_the_fit_that_is_shown_and_waits_until_the_motors_are_off() {
    let mut harness = made();
    let drawing =
        |harness: &Harness<'_, Window>| Arc::clone(harness.state().session.drawing_energy().expect("there"));
    let first = drawing(&harness);
    arm(&mut harness);
    click(&mut harness, "Grab");
    until(&mut harness, "held", |s| s.grabbed() == Some(1));
    press(&mut harness, Key::N);
    until(&mut harness, "the other is made", |s| {
        s.why_not_drawn().is_some_and(|why| why.contains("disarm"))
    });
    let session = &harness.state().session;
    assert!(session.scene_is_on_board() && session.grabbed() == Some(1));
    assert!(
        Arc::ptr_eq(&drawing(&harness), &first),
        "what the board has draws"
    );
    harness.state_mut().session.act(Intent::Disarm);
    until(&mut harness, "idle", |s| s.device() == Some(DeviceState::Idle));
    let left = poses(&harness)[1];
    until(&mut harness, "the other is on the board", is_there);
    assert!(
        poses(&harness)[1].abs_diff_eq(left, 1e-3),
        "the part stays where the hand left it"
    );
    let other = drawing(&harness);
    assert!(other.of != first.of && harness.state().session.scene_energies().len() == 1);
    press(&mut harness, Key::N);
    harness.run_steps(2);
    assert!(
        harness.state().session.energy_under_way().is_none(),
        "it was made before"
    );
    until(&mut harness, "the first again", is_there);
    assert!(Arc::ptr_eq(&drawing(&harness), &first));
}

#[test]
fn where_nothing_can_draw_one_line_says_why() {
    let mut harness = harness();
    open_sample(&mut harness);
    connect(&mut harness);
    guide_by_energy(&mut harness);
    let why = |harness: &mut Harness<'_, Window>, start: &str| {
        harness.run_steps(2);
        assert_eq!(texts(harness, start).len(), 1, "{start}");
    };
    why(&mut harness, "Select a part");
    click(&mut harness, "block");
    why(&mut harness, "block is locked to the ground");
    // With the block as the only partner that has no closed surface nothing can be found.
    let session = &mut harness.state_mut().session;
    session.act(Intent::FitWith(Some(1)));
    session.act(Intent::Select(Some(1)));
    why(&mut harness, "A part does not fit itself");
    harness.state_mut().session.act(Intent::FitWith(None));
    until(&mut harness, "searched", |s| s.fitting.is_some());
    harness.state_mut().session.act(Intent::DropFits);
    why(&mut harness, "Find the fits of peg first (M)");
}

/// A scene that leaves no room keeps as it is, and says what to do; baked again it leaves room.
#[test]
fn an_energy_without_room_says_so_and_another_bake_leaves_room() {
    let mut harness = made();
    let session = &mut harness.state_mut().session;
    let capacity = session
        .connection()
        .expect("connected")
        .capabilities
        .scene_capacity as usize;
    let document = session.document.as_mut().expect("open");
    let baked = document.baked.as_ref().expect("baked");
    let with = baked.image.len();
    // The same scene, padded up to the slot.
    let mut full = mortise_bake::Baked::clone(baked);
    full.image.resize(capacity - 1024, 0);
    document.baked = Some(Arc::new(full));
    until(&mut harness, "said", |s| {
        s.why_not_drawn()
            .is_some_and(|why| why.contains("bake again, which leaves room"))
    });
    assert_eq!(worst(&harness.state().session), Severity::Warning);
    harness.state_mut().session.act(Intent::Bake);
    until(&mut harness, "the energy is on the board", is_there);
    let document = harness.state().session.document.as_ref().expect("open");
    let now = document.baked.as_ref().expect("baked").image.len();
    assert!(now <= capacity && now.abs_diff(with) < with / 2, "{now}");
}

#[test]
fn the_basin_is_a_glow_about_the_way_in_the_fixed_part() {
    let mut harness = made();
    let seen = glow(&harness).expect("a glow");
    let document = harness.state().session.document.as_ref().expect("open");
    assert_eq!(seen.pose, document.poses[0]);
    let places = seen.shells.0.vertices.iter().map(|vertex| {
        let place = DVec3::from(vertex.position.map(f64::from));
        seen.pose.transform_point3(place)
    });
    let places: Vec<DVec3> = places.collect();
    assert!(!seen.shells.0.indices.is_empty());
    assert!(
        places.iter().all(|place| place.truncate().length() < 6.5),
        "about the hole's axis"
    );
    let (low, high) = places
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), place| {
            (low.min(place.z), high.max(place.z))
        });
    assert!(high - low > 30.0, "along the way: {low} to {high}");
    assert!(seen.color[3] > 0.0 && seen.color[3] < 0.2, "it hides nothing");
    set(&mut harness, ParameterId::GeometricForce, 10.0);
    assert!(glow(&harness).expect("a glow").color[3] > seen.color[3]);
    set(&mut harness, ParameterId::Guidance, 1.0);
    assert!(glow(&harness).is_none(), "of guidance by energy alone");
}
