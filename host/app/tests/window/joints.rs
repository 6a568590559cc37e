//! Joints of the selected part in the running window: what it touches, its faces marked under the pointer, and its freedoms shown by motion; and the part
//! under the pointer, marked in the view and in the list alike.

use std::path::Path;

use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use glam::DAffine3;
use mortise::session::joints::JointIntent;
use mortise::session::{Intent, Session, obstacle};
use mortise::ui::Window;
use mortise::viewport::compose::{Look, compose};
use mortise::viewport::picture::Item;

use crate::common::{arm, click, connect, harness, picture, poses, until};

/// A link with two pins in the holes of a plate, selected, its joints found.
fn pinned() -> (Harness<'static, Window>, usize) {
    let mut harness = harness();
    harness.step();
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../mating/tests/data/two_pin_exact.step");
    harness.state_mut().session.act(Intent::Open(file));
    until(&mut harness, "it is baked", |s| {
        s.document.as_ref().is_some_and(|d| d.baked.is_some())
    });
    let link = named(&harness.state().session, "link");
    harness.state_mut().session.act(Intent::Select(Some(link)));
    harness.run_steps(2);
    click(&mut harness, "Joints");
    harness.run_steps(20);
    click(&mut harness, "Find the joints");
    until(&mut harness, "the joints", |s| {
        let document = s.document.as_ref().expect("open");
        s.joints.of(document, link).is_some()
    });
    harness.run_steps(20);
    (harness, link)
}

fn named(session: &Session, name: &str) -> usize {
    let parts = &session.document.as_ref().expect("open").model.parts;
    parts
        .iter()
        .position(|part| part.name.contains(name))
        .expect("a part of this name")
}

fn marked(item: &Item) -> bool {
    !item.mates.is_empty()
}

#[test]
fn joints_of_a_part_are_listed_and_the_pointer_on_one_marks_its_faces() {
    let (mut harness, link) = pinned();
    let words: Vec<String> = {
        let session = &harness.state().session;
        let found = session.joints.of(session.document.as_ref().expect("open"), link);
        let found = found.expect("found");
        assert!(found.joints.iter().all(|joint| joint.other == 1 - link));
        found.joints.iter().map(|joint| joint.words.clone()).collect()
    };
    let cylinders = words
        .iter()
        .filter(|words| words.starts_with("Cylinder on"))
        .count();
    assert!(
        cylinders == 2 && words.iter().any(|words| words.starts_with("Plane on")),
        "{words:?}"
    );
    assert!(!picture(&harness).iter().any(marked), "none is marked");
    let at = harness
        .get_all_by_label(&words[0])
        .next()
        .expect("listed")
        .rect()
        .center();
    harness.hover_at(at);
    harness.run_steps(4);
    assert_eq!(harness.state().session.joints.marked(), Some(0));
    let both: Vec<Item> = picture(&harness).into_iter().filter(marked).collect();
    assert_eq!(both.len(), 2, "the faces of both parts");
    assert!(both.iter().all(|item| item.opacity == 1.0));
    harness.hover_at(egui::pos2(2.0, 2.0));
    harness.run_steps(4);
    assert!(!picture(&harness).iter().any(marked), "the pointer has left");
}

#[test]
fn a_freedom_is_shown_by_a_motion_that_ends_where_it_began() {
    let (mut harness, link) = pinned();
    let slide = {
        let session = &harness.state().session;
        let found = session.joints.of(session.document.as_ref().expect("open"), link);
        let freedoms = &found.expect("found").freedoms;
        // The pins leave one direction: out of the plate.
        assert_eq!(freedoms.len(), 1, "{freedoms:?}");
        freedoms[0].words.clone()
    };
    assert!(
        slide.starts_with("Slides along") && slide.ends_with("out"),
        "{slide}"
    );
    let before = poses(&harness);
    let place = |harness: &Harness<'_, Window>| -> DAffine3 { picture(harness)[link].pose };
    click(&mut harness, &slide);
    let mut farthest = 0f64;
    until_shown(&mut harness, |harness| {
        farthest = farthest.max(place(harness).translation.distance(before[link].translation));
        assert_eq!(poses(harness), before, "the parts stay where they are");
    });
    assert!(farthest > 1.0, "{farthest} mm");
    assert_eq!(place(&harness), before[link]);
    // A part that was moved has other joints.
    let session = &mut harness.state_mut().session;
    let document = session.document.as_mut().expect("open");
    document.poses[link].translation.z += 5.0;
    harness.run_steps(2);
    harness.get_by_label("Find the joints");
    let show = Intent::Joint(JointIntent::Show(0));
    assert!(obstacle(&harness.state().session, &show).is_some());
}

/// Draws frames until the motion has ended.
fn until_shown(harness: &mut Harness<'_, Window>, mut each: impl FnMut(&Harness<'_, Window>)) {
    for _ in 0..1000 {
        if harness.state().session.joints.shown().is_none() {
            return;
        }
        each(harness);
        harness.step();
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    panic!("the motion does not end");
}

#[test]
fn nothing_is_shown_elsewhere_while_the_motors_are_on() {
    let (mut harness, link) = pinned();
    connect(&mut harness);
    arm(&mut harness);
    harness.state_mut().session.act(Intent::Select(Some(link)));
    let show = Intent::Joint(JointIntent::Show(0));
    assert_eq!(
        obstacle(&harness.state().session, &show).as_deref(),
        Some("The rig is armed: disarm it first")
    );
}

#[test]
fn the_part_under_the_pointer_is_marked_in_view_and_list() {
    let (mut harness, link) = pinned();
    harness.state_mut().session.act(Intent::Select(None));
    harness.run_steps(2);
    let outlined = |harness: &Harness<'_, Window>| -> Vec<bool> {
        let window = harness.state();
        let look = Look {
            camera: window.view.camera,
            over: window.view.over.now,
            ..Look::default()
        };
        let document = window.session.document.as_ref().expect("open");
        let items = compose(&window.session, document, &look).items;
        items.iter().map(|item| item.tint[3] > 0.0).collect()
    };
    // In the list.
    let name = harness
        .state()
        .session
        .document
        .as_ref()
        .expect("open")
        .model
        .parts[link]
        .name
        .clone();
    let line = harness.get_by_label(&name).rect().center();
    harness.hover_at(line);
    harness.run_steps(3);
    assert_eq!(harness.state().view.over.now, Some(link));
    assert!(outlined(&harness)[link] && !outlined(&harness)[1 - link]);
    // In the view: wherever the pointer finds a part, that one.
    let view = harness.get_by_label("3D view").rect();
    let mut seen = [false; 2];
    for i in 1..12 {
        for j in 1..12 {
            let at = view.min + view.size() * egui::vec2(i as f32, j as f32) / 12.0;
            harness.hover_at(at);
            harness.run_steps(2);
            let over = harness.state().view.over.now;
            let outlined = outlined(&harness);
            for part in 0..2 {
                assert_eq!(outlined[part], over == Some(part));
                seen[part] |= outlined[part];
            }
        }
    }
    assert_eq!(seen, [true; 2]);
    harness.hover_at(egui::pos2(2.0, 2.0));
    harness.run_steps(3);
    assert_eq!(harness.state().view.over.now, None);
}
