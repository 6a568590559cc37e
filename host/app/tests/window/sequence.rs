//! The steps in which an assembly goes together, in the running window.

use std::path::Path;

use crate::common::{arm, click, connect, harness, open_sample, picture, poses, until};
use egui::accesskit::Toggled;
use egui::epaint::ColorMode;
use egui::{Key, Modifiers};
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT as _, Queryable as _};
use mortise::session::sequence::Sequence;
use mortise::session::{Intent, Session, obstacle};
use mortise::ui::{Window, theme};

/// The sample, with its steps found.
fn found() -> Harness<'static, Window> {
    let mut harness = harness();
    open_sample(&mut harness);
    let session = &harness.state().session;
    let none = Intent::GoToStep {
        done: 0.0,
        goes_on: false,
    };
    assert_eq!(obstacle(session, &none).as_deref(), Some("Find the steps first"));
    click(&mut harness, "Sequence");
    harness.run_steps(10);
    click(&mut harness, "Find the steps");
    until(&mut harness, "the steps are found", |session| {
        (session.document.as_ref()).is_some_and(|document| session.sequencing.found(document).is_some())
    });
    harness.run_steps(5);
    harness
}

#[test]
fn the_assembly_is_taken_apart_and_put_together_by_steps() {
    let mut harness = found();
    let _ = harness.get_by_label("Goes together in 1 step");
    let _ = harness.get_by_label("All parts are in place");
    let before = poses(&harness);
    click(&mut harness, "Apart");
    harness.run_steps(3);
    let apart = poses(&harness);
    let moved: Vec<usize> = (0..2).filter(|i| apart[*i] != before[*i]).collect();
    let [moving] = moved[..] else { panic!("{moved:?}") };
    assert!(apart[moving].translation.distance(before[moving].translation) > 5.0);
    let _ = harness.get_by_label("0 of 1 steps done");
    harness.run_steps(40);
    let window = harness.state();
    let extent = window.session.document.as_ref().expect("open").extent;
    let off = window.view.camera.target.distance(extent.center);
    assert!(off < 0.01 * extent.radius, "all of it is seen: {off}");
    assert_eq!(
        harness.state().session.selected,
        Some(moving),
        "what is put on next"
    );
    // All of a drag of the slider is undone at once, and no more than that.
    let slider = harness.get_by_label("Steps done").rect();
    let at = |share: f32| {
        egui::pos2(
            slider.left() + 8.0 + share * (slider.width() - 16.0),
            slider.center().y,
        )
    };
    harness.hover_at(at(0.0));
    harness.step();
    harness.drag_at(at(0.0));
    harness.step();
    for part in 1..=5 {
        harness.hover_at(at(0.1 * part as f32));
        harness.step();
    }
    harness.drop_at(at(0.5));
    harness.run_steps(3);
    let between = poses(&harness);
    assert_ne!(between, apart);
    assert_ne!(between, before);
    harness.key_press_modifiers(Modifiers::COMMAND, Key::Z);
    harness.run_steps(3);
    assert_eq!(poses(&harness), apart);
    click(&mut harness, "Step on");
    harness.run_steps(3);
    assert_eq!(poses(&harness), before, "exactly in place");
    let session = &harness.state().session;
    let document = session.document.as_ref().expect("open");
    let steps = session.sequencing.found(document).map(|found| &found.steps);
    let line = format!("1. {}", steps.expect("found")[0].words);
    harness.get_by_label(&line).click();
    harness.run_steps(3);
    assert_eq!(poses(&harness), apart, "a step begins with its parts apart");
    harness.key_press_modifiers(Modifiers::COMMAND, Key::Z);
    harness.run_steps(3);
    assert_eq!(poses(&harness), before);
    let _ = harness.get_by_label("All parts are in place");
}

#[test]
fn a_hand_takes_a_part_from_where_a_step_has_it_and_no_step_moves_what_it_holds() {
    let mut harness = found();
    click(&mut harness, "Apart");
    let apart = poses(&harness);
    connect(&mut harness);
    harness.run_steps(20);
    let _ = harness.get_by_label("0 of 1 steps done");
    arm(&mut harness);
    let document = harness.state().session.document.as_ref().expect("open");
    let off = |a: &[glam::DAffine3], b: &[glam::DAffine3]| {
        let each = a
            .iter()
            .zip(b)
            .map(|(a, b)| a.translation.distance(b.translation));
        each.fold(0.0, f64::max)
    };
    assert!(off(&document.poses, &apart) < 1e-3, "where the board has them");
    assert!(harness.get_by_label("Together").accesskit_node().is_disabled());
    assert!(harness.get_by_label("Steps done").accesskit_node().is_disabled());
}

/// A row of pins in a plate, with its steps found.
fn found_row() -> Harness<'static, Window> {
    let mut harness = harness();
    harness.step();
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../lab/data/fixture_row.step");
    harness.state_mut().session.act(Intent::Open(file));
    until(&mut harness, "it is baked", |session| {
        (session.document.as_ref()).is_some_and(|document| document.baked.is_some())
    });
    click(&mut harness, "Sequence");
    harness.state_mut().session.act(Intent::FindSequence);
    until(&mut harness, "the steps are found", |session| {
        steps(session).is_some()
    });
    harness.run_steps(20);
    harness
}

fn steps(session: &Session) -> Option<&Sequence> {
    session.sequencing.found(session.document.as_ref()?)
}

/// Number of pictures of steps on the graphics card.
fn pictures(harness: &Harness<'_, Window>) -> usize {
    let textures = harness.ctx.tex_manager();
    let textures = textures.read();
    let of_steps = textures
        .allocated()
        .filter(|(_, meta)| meta.name.starts_with("step "));
    of_steps.count()
}

#[test]
fn each_step_is_a_picture_and_a_click_goes_to_where_it_begins() {
    let mut harness = found_row();
    let found = steps(&harness.state().session).expect("found").clone();
    assert!(found.steps.len() >= 3);
    assert!(found.steps.iter().all(|step| step.picture.is_some()));
    // They are sent to the graphics card when they are seen, and once.
    let seen = pictures(&harness);
    assert!(seen >= 2, "{seen}");
    for _ in 0..5 {
        harness.step();
        let sent = &harness.output().textures_delta.set;
        let mut sent = sent.values().flatten();
        assert!(sent.all(|delta| delta.image.size() != [190, 140]));
    }
    assert_eq!(pictures(&harness), seen);
    // Whichever is clicked, its parts are apart, those before it in place, and it is marked as the next one.
    for number in [1, 0, found.steps.len() - 1] {
        let row = |number: usize| format!("{}. {}", number + 1, found.steps[number].words);
        // Also one that is scrolled out of sight.
        harness.get_by_label(&row(number)).click_accesskit();
        harness.run_steps(10);
        assert_eq!(poses(&harness), found.poses(number as f64));
        for other in 0..found.steps.len() {
            let name = row(other);
            let row = harness.get_by_label(&name);
            assert_eq!(
                row.accesskit_node().toggled() == Some(Toggled::True),
                other == number
            );
        }
    }
    // The next step is kept in sight.
    let list = harness.get_by_label("Steps done").rect().bottom();
    let last = format!(
        "{}. {}",
        found.steps.len(),
        found.steps[found.steps.len() - 1].words
    );
    let row = harness.get_by_label(&last).rect();
    assert!(
        row.top() > list && row.bottom() < list + 260.0,
        "{row:?} below {list}"
    );
    // Another search has other pictures, and those before are given back.
    harness.state_mut().session.act(Intent::FindSequence);
    harness.run_steps(3);
    until(&mut harness, "the steps are found", |session| {
        steps(session).is_some()
    });
    harness.run_steps(5);
    assert!(pictures(&harness) <= found.steps.len());
}

/// Points of the line of a way over the view, which ends where the panel of the rig begins: its plane of stability has lines of the same colour.
fn ways(harness: &Harness<'_, Window>) -> Vec<usize> {
    let panel = harness.get_by_label("Connect").rect().left();
    let accent = theme::palette(egui::Theme::Dark).accent;
    let shapes = harness.output().shapes.iter();
    shapes
        .filter_map(|clipped| match &clipped.shape {
            egui::Shape::Path(path) if path.stroke.color == ColorMode::Solid(accent) && !path.closed => {
                let is_in_view = path.points.iter().all(|point| point.x < panel);
                is_in_view.then_some(path.points.len())
            }
            _ => None,
        })
        .filter(|points| *points > 10)
        .collect()
}

#[test]
fn the_way_of_the_next_step_and_its_place_are_drawn_in_the_view() {
    let mut harness = found_row();
    let count = poses(&harness).len();
    assert!(ways(&harness).is_empty(), "all parts are in place");
    assert_eq!(picture(&harness).len(), count);
    let found = steps(&harness.state().session).expect("found").clone();
    for number in 0..found.steps.len() {
        harness.state_mut().session.act(Intent::GoToStep {
            done: number as f64,
            goes_on: false,
        });
        harness.run_steps(3);
        assert_eq!(ways(&harness).len(), 1, "step {number}");
        let moving = &found.steps[number].parts;
        let after = found.poses(number as f64 + 1.0);
        let drawn = picture(&harness);
        let ghosts: Vec<_> = drawn[count..].iter().map(|item| item.pose).collect();
        let places: Vec<_> = moving.iter().map(|part| after[*part]).collect();
        assert_eq!(ghosts, places);
    }
    click(&mut harness, "Together");
    harness.run_steps(3);
    assert!(ways(&harness).is_empty());
}

/// *Report…* asks for a file and writes the order with a picture of each step; before the steps are found it says what is missing.
#[test]
fn the_steps_are_written_to_a_page() {
    let mut harness = harness();
    open_sample(&mut harness);
    let why = obstacle(&harness.state().session, &Intent::SaveSteps);
    assert_eq!(why.as_deref(), Some("Find the steps first"));
    let mut harness = found();
    let folder = tempfile::tempdir().expect("a folder");
    let page = folder.path().join("sample.html");
    let intent = Intent::WriteSteps {
        path: page.clone(),
        replace: false,
    };
    harness.get_by_label("Report of the steps");
    assert_eq!(obstacle(&harness.state().session, &intent), None);
    harness.state_mut().session.act(intent.clone());
    until(&mut harness, "the page", |_| page.exists());
    let text = std::fs::read_to_string(&page).expect("written");
    assert_eq!(
        text.matches("data:image/png;base64,").count(),
        1,
        "the sample has one step"
    );
    assert!(text.contains("2 parts, together in 1 step<"), "{text}");
    // An existing file is not replaced without being asked.
    std::fs::write(&page, "mine").expect("a file");
    harness.state_mut().session.act(intent);
    until(&mut harness, "the refusal", |session| {
        session
            .notes
            .iter()
            .any(|note| note.text.contains("exists already"))
    });
    assert_eq!(std::fs::read_to_string(&page).expect("kept"), "mine");
}
