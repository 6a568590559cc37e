//! The picture of the described mechanism in the running window: its reach in words, sliders that turn the drawing, what a damaged description shows, and
//! the joints of a connected mechanism.

use egui::{Key, Role};
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT as _, Queryable as _};
use mortise::session::rig_page::{DrawIntent, RigIntent};
use mortise::session::{Intent, obstacle};
use mortise::ui::Window;
use mortise_rig::EXAMPLES;

use crate::common::{click, harness, press, texts, until};
use crate::rig_page::described;

/// The reach of the example with one joint.
const REACH: &str = "The handle reaches x from −42.2 to 42.2 mm, y from −15.4 to 0 mm, z at 0 mm";
const HOME: &str = "Handle at x 0, y 0, z 0 mm";

fn degrees(harness: &Harness<'_, Window>) -> f64 {
    harness.state().session.rig_page.drawn().0[0].to_degrees()
}

fn has(harness: &Harness<'_, Window>, start: &str) -> bool {
    !texts(harness, start).is_empty()
}

#[test]
fn the_described_mechanism_is_drawn_in_its_reach_and_a_slider_turns_it() {
    let mut harness = harness();
    harness.step();
    click(&mut harness, "Set up rig");
    assert!(has(&harness, "No picture: there is no description."));
    let draw = |intent| Intent::Rig(RigIntent::Draw(intent));
    assert!(obstacle(&harness.state().session, &draw(DrawIntent::Home)).is_some());
    click(&mut harness, "Examples of descriptions");
    click(&mut harness, "hapkit");
    harness.run_steps(2);
    let picture = format!("Picture of the mechanism. {REACH}");
    let _ = harness.get_by_role_and_label(Role::Image, &picture);
    let _ = harness.get_by_label(REACH);
    let _ = harness.get_by_label(HOME);
    harness.get_by_role_and_label(Role::Slider, "Joint 1").focus();
    harness.step();
    press(&mut harness, Key::ArrowRight);
    assert!(degrees(&harness) > 90.0, "{}", degrees(&harness));
    assert!(!has(&harness, HOME) && has(&harness, "Handle at x −"));
    // No slider goes beyond its joint's range.
    harness.state_mut().session.act(draw(DrawIntent::Joint(0, 9.0)));
    harness.run_steps(2);
    assert!((degrees(&harness) - 130.0).abs() < 1e-3);
    let _ = harness.get_by_label("Handle at x −42.2, y −15.4, z 0 mm");
    click(&mut harness, "Home pose");
    let _ = harness.get_by_label(HOME);
    // Every kind of mechanism has its picture.
    for (name, text) in EXAMPLES {
        harness
            .state_mut()
            .session
            .act(Intent::Rig(RigIntent::Edit(text.to_owned())));
        harness.run_steps(2);
        assert!(
            has(&harness, "Picture of the mechanism. The handle reaches x from"),
            "{name}"
        );
    }
}

#[test]
fn a_damaged_description_shows_no_picture_and_says_what_is_missing() {
    let mut harness = harness();
    harness.step();
    click(&mut harness, "Set up rig");
    let (_, text) = EXAMPLES[1];
    let edit = |harness: &mut Harness<'_, Window>, text: String| {
        harness
            .state_mut()
            .session
            .act(Intent::Rig(RigIntent::Edit(text)));
        harness.run_steps(2);
    };
    edit(&mut harness, text.to_owned());
    assert!(has(&harness, "Picture of the mechanism."));
    edit(&mut harness, text.replace("distal_mm = [90, 90]", ""));
    assert!(!has(&harness, "Picture of the mechanism.") && !has(&harness, "Handle at"));
    let page = &harness.state().session.rig_page;
    let why = page.checked().expect("text").expect_err("no links").to_owned();
    assert!(why.contains("distal_mm"), "{why}");
    let _ = harness.get_by_label(&format!("No picture: {why}"));
    // Links that do not reach each other.
    edit(
        &mut harness,
        text.replace("distal_mm = [90, 90]", "distal_mm = [10, 10]"),
    );
    assert!(!has(&harness, "Picture of the mechanism.") && has(&harness, "No picture: "));
    edit(&mut harness, text.to_owned());
    assert!(has(&harness, "Picture of the mechanism."));
}

#[test]
fn the_joints_of_the_connected_mechanism_are_drawn_where_they_are() {
    let mut harness = described("hapkit");
    until(&mut harness, "the encoders are read", |s| {
        s.rig_page.live().is_some()
    });
    harness
        .state_mut()
        .session
        .act(Intent::Rig(RigIntent::Draw(DrawIntent::Joint(0, 0.0))));
    harness.run_steps(2);
    assert!((degrees(&harness) - 50.0).abs() < 1e-3);
    harness.get_by_label("Live joints").click_accesskit();
    harness.run_steps(2);
    let (angles, live) = harness.state().session.rig_page.drawn();
    assert!(live && angles[0].to_degrees() > 60.0, "{angles:?}");
    let slider = harness.get_by_role_and_label(Role::Slider, "Joint 1");
    assert!(slider.accesskit_node().is_disabled());
    // The simulated hand leads the handle along its limits, and the drawing goes along.
    click(&mut harness, "Begin");
    click(&mut harness, "Let the simulated hand do it");
    until(&mut harness, "the drawing has moved", |s| {
        let moved = s.rig_page.drawn().0[0] - angles[0];
        moved.abs().to_degrees() > 5.0
    });
    // Another description than the board's is not drawn where the board's joints are.
    let (_, other) = EXAMPLES[1];
    harness
        .state_mut()
        .session
        .act(Intent::Rig(RigIntent::Edit(other.to_owned())));
    harness.run_steps(2);
    assert!(!harness.state().session.rig_page.drawn().1);
    let follow = Intent::Rig(RigIntent::Draw(DrawIntent::Follow(true)));
    assert_eq!(
        obstacle(&harness.state().session, &follow).as_deref(),
        Some("The board does not use this description")
    );
}
