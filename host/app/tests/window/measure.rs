//! The measuring tool in the window: what clicks pick, what is said of it, and that it follows the parts.

use crate::common::{click, harness, open_sample, press};
use egui::{Key, OutputCommand, Pos2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use glam::DVec3;
use mortise::session::document::Document;
use mortise::ui::Window;
use mortise::viewport::screen::on_screen;
use mortise_inspect::measure::Feature;

/// The sample from the front, with the tool on. The block is 50 mm wide and 40 mm high, its upper face is z = 0; the peg stands 20 mm above it.
fn measuring() -> Harness<'static, Window> {
    let mut harness = harness();
    open_sample(&mut harness);
    press(&mut harness, Key::Num1);
    press(&mut harness, Key::D);
    assert!(harness.state().view.measure.on);
    harness
}

fn document<'a>(harness: &'a Harness<'_, Window>) -> &'a Document {
    harness.state().session.document.as_ref().expect("open")
}

fn place(harness: &Harness<'_, Window>, point: DVec3) -> Pos2 {
    let view = harness.get_by_label("3D view").rect();
    on_screen(&harness.state().view.camera, view, point).expect("in front")
}

fn click_on(harness: &mut Harness<'_, Window>, point: DVec3) {
    let at = place(harness, point);
    harness.drag_at(at);
    harness.step();
    harness.drop_at(at);
    harness.run_steps(3);
}

fn picked(harness: &Harness<'_, Window>) -> Vec<(usize, Feature)> {
    let picked = harness.state().view.measure.picked().iter();
    picked.map(|picked| (picked.part, picked.feature)).collect()
}

const FRONT: DVec3 = DVec3::new(10.0, -25.0, -20.0);
const UPPER_EDGE: DVec3 = DVec3::new(-18.0, -25.0, 0.0);
const CORNER: DVec3 = DVec3::new(25.0, -25.0, 0.0);
const PEG: DVec3 = DVec3::new(1.0, -8.8, 50.0);

#[test]
fn clicks_pick_what_is_near_and_say_what_it_is() {
    for orthographic in [false, true] {
        let mut harness = measuring();
        if orthographic {
            press(&mut harness, Key::Num5);
        }
        harness.get_by_label("Click a vertex, edge, axis or face");
        click_on(&mut harness, FRONT);
        harness.get_by_label("Flat face of block");
        harness.get_by_label("2000 mm²");
        press(&mut harness, Key::Backspace);
        click_on(&mut harness, UPPER_EDGE);
        harness.get_by_label("Straight edge of block");
        harness.get_by_label("50 mm");
        press(&mut harness, Key::Backspace);
        click_on(&mut harness, CORNER);
        harness.get_by_label("Point of block");
        harness.get_by_label("25, -25, 0 mm");
        press(&mut harness, Key::Backspace);
        click_on(&mut harness, PEG);
        harness.get_by_label("Cylinder of peg");
        harness.get_by_label("17.75 mm");
        // The part is neither selected nor held by it.
        assert_eq!(harness.state().session.selected, None);
        // A second click on the same takes it back.
        click_on(&mut harness, PEG);
        assert!(picked(&harness).is_empty());
    }
}

#[test]
fn a_kind_is_chosen_and_only_that_is_picked() {
    let mut harness = measuring();
    click(&mut harness, "Pick face");
    click_on(&mut harness, UPPER_EDGE - DVec3::Z);
    assert!(matches!(picked(&harness)[..], [(0, Feature::Face(_))]));
    click(&mut harness, "Clear measurement");
    click(&mut harness, "Pick axis");
    click_on(&mut harness, PEG);
    assert!(matches!(picked(&harness)[..], [(1, Feature::Axis(_))]));
    click(&mut harness, "Pick edge");
    click_on(&mut harness, CORNER - 8.0 * DVec3::Z);
    assert!(matches!(picked(&harness)[..], [_, (0, Feature::Edge(_))]));
    // The peg's axis is 25 mm beside and 25 mm behind that edge.
    harness.get_by_label("Axis of peg");
    harness.get_by_label("35.3553 mm");
    harness.get_by_label("0°");
}

/// The bore's wall, seen through a section, and the peg: coaxial, then moved aside.
#[test]
fn two_cylinders_have_a_clearance_that_follows_the_parts() {
    let mut harness = measuring();
    press(&mut harness, Key::X);
    for _ in 0..400 {
        harness.step();
        let window = harness.state();
        let shown = window.view.section.shown(document(&harness));
        if shown.is_some_and(|shown| shown.cut.is_some()) {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    click(&mut harness, "Pick face");
    click_on(&mut harness, DVec3::new(1.0, 9.3, -20.0));
    harness.get_by_label("Cylindrical hole of block");
    click_on(&mut harness, DVec3::new(5.0, 7.9, -30.0));
    assert_eq!(picked(&harness).len(), 0, "the wall again, so not any more");
    click_on(&mut harness, DVec3::new(1.0, 9.3, -20.0));
    press(&mut harness, Key::X);
    click_on(&mut harness, PEG);
    harness.get_by_label("Cylinder of peg");
    harness.get_by_label("Radial clearance");
    assert!(harness.get_all_by_label("0.5 mm").count() >= 1);
    let window = harness.state_mut();
    window.session.document.as_mut().expect("open").poses[1]
        .translation
        .x += 0.75;
    for _ in 0..2000 {
        harness.step();
        if harness.query_by_label("Radial clearance").is_none() {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    assert!(harness.query_by_label("Radial clearance").is_none());
    harness.get_by_label("Between the axes");
    // Also along x, for the ends lie on the walls' nearest lines.
    assert!(harness.get_all_by_label("0.75 mm").count() >= 1);

    // The whole parts: the peg's rim over the bore's.
    harness.state_mut().session.document.as_mut().expect("open").poses[1]
        .translation
        .x -= 0.75;
    click(&mut harness, "Gap of parts");
    for _ in 0..4000 {
        harness.step();
        if harness.query_all_by_label("20.0062 mm").count() == 2 {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    harness.get_by_label("Least gap");
    // The walls that were picked end at these rims; their distance follows the parts at intervals.
    assert_eq!(harness.query_all_by_label("20.0062 mm").count(), 2);
}

#[test]
fn a_measurement_is_copied_as_text() {
    let mut harness = measuring();
    click_on(&mut harness, UPPER_EDGE);
    click_on(&mut harness, FRONT);
    harness.get_by_label("Copy measurement").click();
    let mut copied = None;
    for _ in 0..3 {
        harness.step();
        for command in &harness.output().platform_output.commands {
            if let OutputCommand::CopyText(text) = command {
                copied = Some(text.clone());
            }
        }
    }
    let text = copied.expect("copied");
    assert!(
        text.starts_with("Straight edge of block\nLength\t50 mm\n"),
        "{text}"
    );
    assert!(
        text.contains("\nBetween them\nDistance\t0 mm\nAngle to the plane\t0°\n"),
        "{text}"
    );
}

#[test]
fn it_is_cleared_and_left_by_keys() {
    let mut harness = measuring();
    click_on(&mut harness, FRONT);
    press(&mut harness, Key::Escape);
    assert!(picked(&harness).is_empty() && harness.state().view.measure.on);
    press(&mut harness, Key::Escape);
    assert!(!harness.state().view.measure.on);
    assert!(harness.query_by_label("Pick face").is_none());
    // Off, a click selects as ever.
    click_on(&mut harness, PEG);
    assert_eq!(harness.state().session.selected, Some(1));
    // The button is the key's.
    click(&mut harness, "Measure");
    assert!(harness.state().view.measure.on);
    click(&mut harness, "Measure");
    assert!(!harness.state().view.measure.on);
}

#[test]
fn what_is_hidden_or_behind_is_not_picked() {
    let mut harness = measuring();
    // The block's back corner is behind its front face.
    click(&mut harness, "Pick point");
    click_on(&mut harness, DVec3::new(0.0, 25.0, -20.0));
    assert!(picked(&harness).is_empty());
    let behind = DVec3::new(25.0, 25.0, -40.0);
    press(&mut harness, Key::Num5);
    let (front, back) = (
        place(&harness, DVec3::new(25.0, -25.0, -40.0)),
        place(&harness, behind),
    );
    assert!(front.distance(back) < 0.01, "one behind the other");
    click_on(&mut harness, behind);
    harness.get_by_label("25, -25, -40 mm");
    harness
        .state_mut()
        .session
        .document
        .as_mut()
        .expect("open")
        .hidden[0] = true;
    press(&mut harness, Key::Backspace);
    click_on(&mut harness, behind);
    assert!(picked(&harness).is_empty());
}
