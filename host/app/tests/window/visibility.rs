//! Parts hidden, shown alone and searched for in the window.

use crate::common::{click, harness, holding, open_sample, picture};
use egui::{Key, Modifiers, Pos2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use glam::DVec3;
use mortise::ui::Window;
use mortise::viewport::gesture::on_screen;

fn sample() -> Harness<'static, Window> {
    let mut harness = harness();
    open_sample(&mut harness);
    harness.run_steps(3);
    harness
}

fn hidden(harness: &Harness<'_, Window>) -> Vec<bool> {
    let document = harness.state().session.document.as_ref();
    document.expect("open").hidden.clone()
}

/// Shapes of the parts that are drawn.
fn drawn(harness: &Harness<'_, Window>) -> Vec<usize> {
    picture(harness).iter().map(|item| item.shape).collect()
}

fn press(harness: &mut Harness<'_, Window>, modifiers: Modifiers, key: Key) {
    harness.key_press_modifiers(modifiers, key);
    harness.run_steps(2);
}

/// Where the middle of the peg is on the screen.
fn peg(harness: &Harness<'_, Window>) -> Pos2 {
    let view = harness.get_by_label("3D view").rect();
    let window = harness.state();
    let document = window.session.document.as_ref().expect("open");
    // The peg's frame is at its upper end.
    let middle = document.poses[1].translation - 30.0 * DVec3::Z;
    on_screen(&window.view.camera, view, middle).expect("in front")
}

fn click_at(harness: &mut Harness<'_, Window>, at: Pos2) {
    harness.drag_at(at);
    harness.step();
    harness.drop_at(at);
    harness.run_steps(2);
}

#[test]
fn keys_hide_the_selected_part_show_it_alone_and_show_all() {
    let mut harness = sample();
    press(&mut harness, Modifiers::NONE, Key::H);
    assert_eq!(hidden(&harness), [false, false], "nothing is selected");
    let all = drawn(&harness);
    click(&mut harness, "peg");
    press(&mut harness, Modifiers::NONE, Key::H);
    assert_eq!(hidden(&harness), [false, true]);
    assert_eq!(drawn(&harness), all[..1]);
    press(&mut harness, Modifiers::NONE, Key::H);
    assert_eq!(drawn(&harness), all);
    press(&mut harness, Modifiers::NONE, Key::I);
    assert_eq!(hidden(&harness), [true, false]);
    assert_eq!(drawn(&harness), all[1..]);
    press(&mut harness, Modifiers::SHIFT, Key::H);
    assert_eq!(hidden(&harness), [false, false]);
}

#[test]
fn the_eye_hides_a_part_and_the_heading_shows_all() {
    let mut harness = sample();
    click(&mut harness, "Hide block");
    assert_eq!(hidden(&harness), [true, false]);
    click(&mut harness, "Show block");
    click(&mut harness, "Hide block");
    assert_eq!(harness.state().session.selected, None, "the eye selects nothing");
    click(&mut harness, "Show all");
    assert_eq!(hidden(&harness), [false, false]);
    harness.run_steps(2);
    assert!(harness.query_by_label("Show all").is_none());
}

#[test]
fn a_hidden_part_is_not_picked() {
    let mut harness = sample();
    let at = peg(&harness);
    click_at(&mut harness, at);
    assert_eq!(harness.state().session.selected, Some(1));
    press(&mut harness, Modifiers::NONE, Key::H);
    click_at(&mut harness, at);
    assert_ne!(harness.state().session.selected, Some(1));
}

#[test]
fn the_part_in_hand_stays_visible() {
    let mut harness = holding();
    press(&mut harness, Modifiers::NONE, Key::H);
    assert_eq!(hidden(&harness), [false, false]);
    click(&mut harness, "block");
    press(&mut harness, Modifiers::NONE, Key::I);
    assert_eq!(
        hidden(&harness),
        [false, false],
        "the block alone, and what is held"
    );
    click(&mut harness, "STOP");
}

#[test]
fn a_search_shows_the_parts_of_the_name() {
    let mut harness = sample();
    click(&mut harness, "peg");
    harness.get_by_label("Search parts").focus();
    harness.run_steps(2);
    // A key that would hide the selected part.
    harness.get_by_label("Search parts").type_text("H");
    harness.run_steps(2);
    assert_eq!(hidden(&harness), [false, false]);
    assert!(harness.query_by_label("Hide peg").is_none() && harness.query_by_label("Hide block").is_none());
    harness.get_by_label("No part has this name");
    click(&mut harness, "Clear search");
    harness.get_by_label("Search parts").focus();
    harness.run_steps(2);
    harness.get_by_label("Search parts").type_text("BLO");
    harness.run_steps(2);
    harness.get_by_label("Hide block");
    assert!(harness.query_by_label("Hide peg").is_none());
    click(&mut harness, "Clear search");
    harness.get_by_label("Hide peg");
}
