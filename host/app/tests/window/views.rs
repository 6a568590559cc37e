//! Standard views, projection, view cube and how the view turns, in the window.

use crate::common::{click, harness, open_sample, press, worst};
use egui::{Key, Modifiers, Pos2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use glam::DVec3;
use mortise::session::notes::Severity;
use mortise::ui::Window;
use mortise::viewport::camera::{Camera, Projection};
use mortise::viewport::screen::on_screen;

fn sample() -> Harness<'static, Window> {
    let mut harness = harness();
    open_sample(&mut harness);
    harness.run_steps(3);
    harness
}

fn camera(harness: &Harness<'_, Window>) -> Camera {
    harness.state().view.camera
}

fn place(harness: &Harness<'_, Window>, point: DVec3) -> Pos2 {
    let view = harness.get_by_label("3D view").rect();
    on_screen(&camera(harness), view, point).expect("in front")
}

fn assert_from(harness: &Harness<'_, Window>, from: DVec3) {
    let backward = camera(harness).backward();
    assert!((backward - from.normalize()).length() < 1e-9, "{backward} {from}");
}

#[test]
fn keys_show_the_standard_views() {
    let mut harness = sample();
    for (modifiers, key, from) in [
        (Modifiers::NONE, Key::Num1, -DVec3::Y),
        (Modifiers::COMMAND, Key::Num1, DVec3::Y),
        (Modifiers::NONE, Key::Num3, DVec3::X),
        (Modifiers::COMMAND, Key::Num3, -DVec3::X),
        (Modifiers::NONE, Key::Num7, DVec3::Z),
        (Modifiers::COMMAND, Key::Num7, -DVec3::Z),
    ] {
        harness.key_press_modifiers(modifiers, key);
        harness.run_steps(2);
        assert_from(&harness, from);
    }
    let above = camera(&harness);
    press(&mut harness, Key::Num0);
    let iso = camera(&harness);
    assert!(iso.backward().min_element() < 0.0 && iso.pitch > 0.3 && iso != above);
    // Not while a text is typed.
    harness.get_by_label("Search parts").focus();
    harness.run_steps(2);
    harness.get_by_label("Search parts").type_text("7");
    press(&mut harness, Key::Num7);
    assert_eq!(camera(&harness), iso);
}

#[test]
fn the_projection_is_switched_by_key_and_button() {
    let mut harness = sample();
    let target = camera(&harness).target;
    let across = target + 10.0 * camera(&harness).right();
    let before = place(&harness, across);
    press(&mut harness, Key::Num5);
    assert_eq!(camera(&harness).projection, Projection::Orthographic);
    assert!(
        place(&harness, across).distance(before) < 0.01,
        "the size at the target stays"
    );
    // A standard view and a fit keep it.
    press(&mut harness, Key::Num1);
    press(&mut harness, Key::F);
    assert_eq!(camera(&harness).projection, Projection::Orthographic);
    // What is one behind the other is at the same place, and the nearer one is picked.
    let [near, far] = [-25.0, 25.0].map(|y| DVec3::new(15.0, y, -20.0));
    assert!(place(&harness, near).distance(place(&harness, far)) < 0.01);
    let at = place(&harness, near);
    harness.drag_at(at);
    harness.step();
    harness.drop_at(at);
    harness.run_steps(2);
    let hit = harness.state().view.picked.expect("the block");
    assert!(hit.part == 0 && (hit.point - near).length() < 0.05, "{hit:?}");
    click(&mut harness, "Orthographic");
    assert_eq!(camera(&harness).projection, Projection::Perspective);
}

#[test]
fn a_wheel_zooms_to_the_pointer_in_both_projections() {
    for parallel in [false, true] {
        let mut harness = sample();
        if parallel {
            press(&mut harness, Key::Num5);
        }
        press(&mut harness, Key::Num1);
        let point = DVec3::new(15.0, -25.0, -20.0);
        let at = place(&harness, point);
        let distance = camera(&harness).distance;
        harness.hover_at(at);
        harness.event(egui::Event::MouseWheel {
            unit: egui::MouseWheelUnit::Point,
            delta: egui::vec2(0.0, 60.0),
            phase: egui::TouchPhase::Move,
            source: egui::MouseWheelSource::Unknown,
            modifiers: Modifiers::NONE,
        });
        harness.run_steps(30);
        assert!(camera(&harness).distance < 0.95 * distance);
        assert!(place(&harness, point).distance(at) < 0.1, "{parallel}");
    }
}

#[test]
fn the_view_cube_turns_to_faces_edges_and_corners() {
    let mut harness = sample();
    let (target, distance) = (camera(&harness).target, camera(&harness).distance);
    for (name, from) in [
        ("View from top", DVec3::Z),
        ("View from top front", DVec3::new(0.0, -1.0, 1.0)),
        ("View from top front right", DVec3::new(1.0, -1.0, 1.0)),
        ("View from right", DVec3::X),
    ] {
        press(&mut harness, Key::Num0);
        click(&mut harness, name);
        assert_from(&harness, from);
    }
    assert_eq!(
        (camera(&harness).target, camera(&harness).distance),
        (target, distance)
    );
    // A face that is behind is not there; the keyboard reaches one that is not.
    assert!(harness.query_by_label("View from bottom").is_none());
    press(&mut harness, Key::Num0);
    harness.get_by_label("View from top").focus();
    harness.run_steps(2);
    press(&mut harness, Key::Enter);
    assert_from(&harness, DVec3::Z);
    // A click on the cube selects nothing behind it.
    assert_eq!(harness.state().session.selected, None);
    // Too small a view has no cube.
    harness.set_size(egui::vec2(400.0, 300.0));
    harness.run_steps(3);
    assert!(harness.query_by_label("View from top").is_none());
}

#[test]
fn a_turn_glides_unless_motion_is_reduced() {
    let mut harness = sample();
    press(&mut harness, Key::Num1);
    harness.ctx.all_styles_mut(|style| style.animation_time = 0.12);
    harness.key_press(Key::Num3);
    harness.step();
    let on_the_way = camera(&harness).backward();
    assert!(
        (on_the_way - DVec3::X).length() > 0.02,
        "not there at once: {on_the_way}"
    );
    harness.run_steps(200);
    assert_from(&harness, DVec3::X);
    harness.ctx.all_styles_mut(|style| style.animation_time = 0.0);
    harness.key_press(Key::Num7);
    harness.step();
    assert_from(&harness, DVec3::Z);
}

#[test]
fn a_drag_orbits_about_the_point_under_the_pointer() {
    for parallel in [false, true] {
        let mut harness = sample();
        if parallel {
            press(&mut harness, Key::Num5);
        }
        press(&mut harness, Key::Num1);
        let point = DVec3::new(15.0, -25.0, -20.0);
        let at = place(&harness, point);
        harness.drag_at(at);
        harness.step();
        for x in 1..8 {
            harness.hover_at(at + egui::vec2(20.0 * x as f32, 5.0));
            harness.step();
        }
        harness.drop_at(at + egui::vec2(140.0, 5.0));
        harness.run_steps(2);
        assert!((camera(&harness).backward() + DVec3::Y).length() > 0.2, "turned");
        assert!(place(&harness, point).distance(at) < 1.0);
    }
}

/// Without motors a part cannot be grabbed: the double click looks at it.
#[test]
fn a_double_click_frames_the_part() {
    let mut harness = sample();
    let at = place(&harness, DVec3::new(0.0, -8.8, 50.0));
    harness.hover_at(at);
    harness.step();
    for pressed in [true, false, true, false] {
        harness.input_mut().events.push(egui::Event::PointerButton {
            pos: at,
            button: egui::PointerButton::Primary,
            pressed,
            modifiers: Modifiers::NONE,
        });
    }
    harness.run_steps(3);
    // The peg stands from 20 mm on and is 60 mm long.
    let camera = camera(&harness);
    assert!(
        camera.target.truncate().length() < 0.1 && camera.target.z > 40.0,
        "{}",
        camera.target
    );
    assert_eq!(harness.state().session.grabbed(), None);
    assert_eq!(
        worst(&harness.state().session).max(Severity::Good),
        Severity::Good
    );
}
