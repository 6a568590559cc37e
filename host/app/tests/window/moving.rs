//! Parts moved in the window by handles, keys and numbers, and undo and redo of every move.

use std::cell::Cell;

use crate::common::{arm, click, connect, harness, holding, open_sample, poses, until};
use egui::{Event, Key, Modifiers, Pos2};
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT as _, Queryable as _};
use glam::{DAffine3, DVec3};
use mortise::session::{Intent, Session, insertion, obstacle};
use mortise::ui::{Window, keys};
use mortise::viewport::camera::View;
use mortise::viewport::gesture::on_screen;
use mortise::viewport::gizmo::Axes;
use mortise_protocol::message::DeviceState;

/// The sample, its peg selected, seen from the front.
fn selected() -> Harness<'static, Window> {
    let mut harness = harness();
    open_sample(&mut harness);
    harness.run_steps(3);
    click(&mut harness, "peg");
    harness.state_mut().view.camera.look(View::Front);
    harness.run_steps(2);
    harness
}

fn press(harness: &mut Harness<'_, Window>, modifiers: Modifiers, key: Key) {
    harness.key_press_modifiers(modifiers, key);
    harness.run_steps(2);
}

fn undo(harness: &mut Harness<'_, Window>) {
    press(harness, Modifiers::COMMAND, Key::Z);
}

fn redo(harness: &mut Harness<'_, Window>) {
    press(harness, Modifiers::COMMAND | Modifiers::SHIFT, Key::Z);
}

/// Where a handle is taken hold of.
fn grip(harness: &Harness<'_, Window>, handle: &str) -> Pos2 {
    harness.get_by_label(handle).rect().center()
}

/// Presses on a handle and drags it, without letting go.
fn hold(harness: &mut Harness<'_, Window>, handle: &str, by: egui::Vec2) -> Pos2 {
    let from = grip(harness, handle);
    harness.hover_at(from);
    harness.step();
    harness.drag_at(from);
    harness.step();
    for part in 1..=10 {
        harness.hover_at(from + 0.1 * part as f32 * by);
        harness.step();
    }
    from + by
}

fn drag(harness: &mut Harness<'_, Window>, handle: &str, by: egui::Vec2) {
    let to = hold(harness, handle, by);
    harness.drop_at(to);
    harness.run_steps(2);
}

/// What the peg has moved by, mm.
fn shift(harness: &Harness<'_, Window>, before: &[DAffine3]) -> DVec3 {
    poses(harness)[1].translation - before[1].translation
}

fn said(harness: &Harness<'_, Window>) -> String {
    let note = harness.state().session.notes.newest();
    note.map(|note| note.text.clone()).unwrap_or_default()
}

#[test]
fn a_handle_moves_the_part_with_the_pointer_and_undo_takes_it_back() {
    let mut harness = selected();
    let before = poses(&harness);
    let view = harness.get_by_label("3D view").rect();
    let seen = |harness: &Harness<'_, Window>| {
        let at = poses(harness)[1].translation - 30.0 * DVec3::Z;
        on_screen(&harness.state().view.camera, view, at).expect("in front")
    };
    let start = seen(&harness);
    drag(&mut harness, "Move along x", egui::vec2(60.0, 5.0));
    let by = shift(&harness, &before);
    assert!(by.x > 1.0 && by.y == 0.0 && by.z == 0.0, "{by}");
    let went = seen(&harness) - start;
    assert!((went.x - 60.0).abs() < 1.0, "with the pointer: {went}");
    assert_eq!(harness.state().session.selected, Some(1));

    harness.get_by_label("Undo").hover();
    harness.run_steps(60);
    harness.get_by_label("Undo: move peg (Ctrl+Z)");
    click(&mut harness, "Undo");
    assert_eq!(poses(&harness), before);
    assert_eq!(said(&harness), "Undone: move peg");
    assert!(harness.get_by_label("Undo").accesskit_node().is_disabled());
    redo(&mut harness);
    assert_eq!(shift(&harness, &before), by);
    undo(&mut harness);
    press(&mut harness, Modifiers::COMMAND, Key::Y);
    assert_eq!(shift(&harness, &before), by);
}

#[test]
fn every_handle_moves_as_it_says() {
    let mut harness = selected();
    harness.state_mut().view.camera.look(View::Iso);
    harness.run_steps(2);
    let before = poses(&harness);
    for (handle, still) in [
        ("Move along x", DVec3::new(0.0, 1.0, 1.0)),
        ("Move along y", DVec3::new(1.0, 0.0, 1.0)),
        ("Move along z", DVec3::new(1.0, 1.0, 0.0)),
        ("Move along x and y", DVec3::Z),
        ("Move along y and z", DVec3::X),
        ("Move along z and x", DVec3::Y),
        ("Move in the view", DVec3::ZERO),
    ] {
        drag(&mut harness, handle, egui::vec2(25.0, 30.0));
        let by = shift(&harness, &before);
        assert!(
            (by * still).length() < 1e-9 && by.length() > 0.5,
            "{handle}: {by}"
        );
        assert_eq!(poses(&harness)[1].matrix3, before[1].matrix3, "{handle}");
        assert_eq!(poses(&harness)[0], before[0]);
        undo(&mut harness);
        assert_eq!(poses(&harness), before);
    }
    let document = harness.state().session.document.as_ref().expect("open");
    let middle = document.middle(1).expect("a part");
    for (handle, axis) in [
        ("Turn about x", DVec3::X),
        ("Turn about y", DVec3::Y),
        ("Turn about z", DVec3::Z),
    ] {
        drag(&mut harness, handle, egui::vec2(18.0, 22.0));
        let now = poses(&harness)[1];
        let turn = now * before[1].inverse();
        assert!((turn.transform_vector3(axis) - axis).length() < 1e-9, "{handle}");
        assert!(
            (turn.transform_point3(middle) - middle).length() < 1e-9,
            "{handle}"
        );
        assert!((now.matrix3.determinant() - 1.0).abs() < 1e-12);
        assert!(!now.abs_diff_eq(before[1], 1e-2), "{handle}");
        undo(&mut harness);
        assert_eq!(poses(&harness), before);
    }
}

#[test]
fn ctrl_snaps_and_the_amount_is_beside_the_pointer() {
    let mut harness = selected();
    let before = poses(&harness);
    let to = hold(&mut harness, "Move along x", egui::vec2(43.0, 0.0));
    let free = shift(&harness, &before).x;
    harness.get_by_label(&format!("x {free:.3} mm"));
    harness.event(Event::ModifiersChanged(Modifiers::CTRL));
    harness.run_steps(2);
    assert_eq!(shift(&harness, &before), DVec3::X * free.round());
    harness.get_by_label(&format!("x {:.3} mm", free.round()));
    harness.event(Event::ModifiersChanged(Modifiers::CTRL | Modifiers::SHIFT));
    harness.run_steps(2);
    let fine = shift(&harness, &before).x;
    assert!(
        (fine - (10.0 * free).round() / 10.0).abs() < 1e-9,
        "{fine} {free}"
    );
    harness.event(Event::ModifiersChanged(Modifiers::NONE));
    harness.drop_at(to);
    harness.run_steps(2);
    assert_eq!(shift(&harness, &before).x, free);
    assert!(harness.query_by_label(&format!("x {free:.3} mm")).is_none());
}

#[test]
fn esc_takes_a_drag_back() {
    let mut harness = selected();
    let before = poses(&harness);
    let to = hold(&mut harness, "Move along x", egui::vec2(50.0, 0.0));
    assert_ne!(poses(&harness), before);
    press(&mut harness, Modifiers::NONE, Key::Escape);
    assert_eq!(poses(&harness), before);
    // The rest of the drag moves nothing, and neither part nor camera.
    let camera = harness.state().view.camera;
    harness.hover_at(to + egui::vec2(30.0, 30.0));
    harness.step();
    harness.drop_at(to);
    harness.run_steps(2);
    assert_eq!(poses(&harness), before);
    assert_eq!(harness.state().view.camera, camera);
    let why = obstacle(&harness.state().session, &Intent::Undo);
    assert_eq!(why.as_deref(), Some("There is nothing to undo"));
}

#[test]
fn keys_nudge_the_selected_part_and_leave_text_alone() {
    let mut harness = selected();
    let before = poses(&harness);
    for (modifiers, key, by) in [
        (Modifiers::NONE, Key::ArrowRight, DVec3::X),
        (Modifiers::SHIFT, Key::ArrowUp, 0.1 * DVec3::Z),
        (Modifiers::CTRL, Key::PageUp, -10.0 * DVec3::Y),
        (Modifiers::NONE, Key::ArrowLeft, -DVec3::X),
    ] {
        let start = poses(&harness);
        press(&mut harness, modifiers, key);
        assert!((shift(&harness, &start) - by).length() < 1e-12, "{key:?}");
    }
    press(&mut harness, Modifiers::ALT, Key::ArrowRight);
    let turn = poses(&harness)[1].matrix3 * before[1].matrix3.inverse();
    let five = 5f64.to_radians();
    assert!((turn.x_axis - DVec3::new(five.cos(), five.sin(), 0.0)).length() < 1e-9);
    for _ in 0..5 {
        undo(&mut harness);
    }
    assert_eq!(poses(&harness), before);

    // A key that is held down is one step.
    for repeat in [false, true, true, true] {
        harness.event(Event::Key {
            key: Key::ArrowUp,
            physical_key: None,
            pressed: true,
            repeat,
            modifiers: Modifiers::NONE,
        });
        harness.step();
    }
    assert!((shift(&harness, &before) - 4.0 * DVec3::Z).length() < 1e-12);
    undo(&mut harness);
    assert_eq!(poses(&harness), before);

    // In a text field they move the cursor, and Ctrl+Z is of the text.
    press(&mut harness, Modifiers::NONE, Key::ArrowUp);
    let nudged = poses(&harness);
    harness.get_by_label("Search parts").focus();
    harness.run_steps(2);
    harness.get_by_label("Search parts").type_text("pe");
    harness.run_steps(2);
    for key in [Key::ArrowLeft, Key::ArrowUp, Key::PageDown] {
        press(&mut harness, Modifiers::NONE, key);
    }
    undo(&mut harness);
    assert_eq!(poses(&harness), nudged);
}

#[test]
fn numbers_move_the_part_along_its_own_axes() {
    let mut harness = selected();
    let before = poses(&harness);
    let enter = |harness: &mut Harness<'_, Window>, field: &str, number: &str| {
        harness.get_by_label(field).focus();
        harness.run_steps(2);
        // What is in the field is selected.
        harness.event(Event::Text(number.to_owned()));
        harness.run_steps(2);
        press(harness, Modifiers::NONE, Key::Enter);
    };
    assert!(
        harness
            .get_by_label("Move by these")
            .accesskit_node()
            .is_disabled()
    );
    enter(&mut harness, "Turn by, y, degrees", "90");
    let turned = poses(&harness)[1];
    let turn = turned * before[1].inverse();
    assert!(
        (turn.transform_vector3(DVec3::X) + DVec3::Z).length() < 1e-9,
        "{turned}"
    );
    click(&mut harness, "Zero");
    click(&mut harness, "Axes of the part");
    assert_eq!(harness.state().view.handles.axes, Axes::Part);
    enter(&mut harness, "Move by, x, mm", "2.5");
    let along = turned.transform_vector3(DVec3::X);
    assert!((poses(&harness)[1].translation - turned.translation - 2.5 * along).length() < 1e-9);
    click(&mut harness, "Move by these");
    assert!((poses(&harness)[1].translation - turned.translation - 5.0 * along).length() < 1e-9);
    for _ in 0..3 {
        click(&mut harness, "Undo");
    }
    assert_eq!(poses(&harness), before);
}

#[test]
fn one_history_has_words_fits_and_moves_by_hand() {
    let mut harness = selected();
    let mut states = vec![poses(&harness)];
    let instruct = |harness: &mut Harness<'_, Window>, text: &str| {
        harness.state_mut().session.act(Intent::Instruct(text.to_owned()));
        until(harness, "answered", |s| {
            s.instructions.answer.as_ref().is_some_and(|a| a.text == text)
        });
        harness.run_steps(2);
    };
    instruct(&mut harness, "insert the peg into the block");
    states.push(poses(&harness));
    press(&mut harness, Modifiers::CTRL, Key::ArrowUp);
    states.push(poses(&harness));
    click(&mut harness, "Reset parts");
    states.push(poses(&harness));
    assert_eq!(states[3], states[0]);
    press(&mut harness, Modifiers::NONE, Key::M);
    until(&mut harness, "searched", |s| {
        s.fitting
            .as_ref()
            .is_some_and(|f| f.search.is_none() && !f.offers.is_empty())
    });
    press(&mut harness, Modifiers::NONE, Key::P);
    states.push(poses(&harness));
    assert!(states.windows(2).all(|pair| pair[0] != pair[1]));
    let names = [
        "place peg in its fit with block",
        "put parts back",
        "move peg",
        "\"insert the peg into the block\"",
    ];
    for (back, name) in names.into_iter().enumerate() {
        assert_eq!(harness.state().session.moves.to_undo(), Some(name));
        // By words as by keys.
        match back % 2 {
            0 => instruct(&mut harness, "undo that"),
            _ => undo(&mut harness),
        }
        assert_eq!(poses(&harness), states[3 - back], "{name}");
    }
    instruct(&mut harness, "undo");
    let answer = harness.state().session.instructions.answer.as_ref();
    assert_eq!(answer.map(|a| a.words.as_str()), Some("There is nothing to undo"));
    instruct(&mut harness, "redo");
    assert_eq!(poses(&harness), states[1]);
    // What was spoken of is not forgotten by undo and redo.
    undo(&mut harness);
    instruct(&mut harness, "put it back");
    assert_eq!(harness.state().session.moves.to_redo(), None);
}

#[test]
fn nothing_is_undone_or_moved_while_the_motors_are_on() {
    let mut harness = holding();
    let before = poses(&harness)[0];
    assert!(harness.query_by_label("Move along x").is_none(), "no handles");
    for (key, modifiers) in [
        (Key::ArrowUp, Modifiers::NONE),
        (Key::Z, Modifiers::COMMAND),
        (Key::Y, Modifiers::COMMAND),
    ] {
        press(&mut harness, modifiers, key);
    }
    let why = |harness: &Harness<'_, Window>, intent: &Intent| obstacle(&harness.state().session, intent);
    assert!(harness.state().session.grabbed() == Some(1) && poses(&harness)[0] == before);
    click(&mut harness, "STOP");
    until(&mut harness, "stopped", |s| {
        s.device() == Some(DeviceState::Stopped)
    });
    harness.run_steps(3);
    // What the hand moved is a step, now that the motors are off.
    let moved = poses(&harness);
    harness.state_mut().session.act(Intent::Undo);
    harness.run_steps(2);
    let name = harness.state().session.moves.to_redo().map(str::to_owned);
    if let Some(name) = name {
        assert_eq!(name, "motion of peg on the board");
        assert_ne!(poses(&harness), moved);
    } else {
        assert_eq!(
            why(&harness, &Intent::Undo).as_deref(),
            Some("There is nothing to undo")
        );
    }
}

#[test]
fn a_board_gets_what_is_dragged_once_it_is_let_go_of_and_what_is_undone() {
    let mut harness = selected();
    connect(&mut harness);
    harness.run_steps(2);
    let before = poses(&harness);
    let to = hold(&mut harness, "Move along x", egui::vec2(50.0, 0.0));
    assert!(harness.state().session.scene_is_on_board(), "nothing is sent yet");
    harness.drop_at(to);
    harness.step();
    until(&mut harness, "on the board there", Session::scene_is_on_board);
    let there = poses(&harness);
    assert!(shift(&harness, &before).x > 1.0);
    harness.run_steps(2);
    undo(&mut harness);
    until(&mut harness, "back on the board", Session::scene_is_on_board);
    assert_eq!(poses(&harness), before);
    harness.run_steps(2);
    redo(&mut harness);
    until(&mut harness, "again", Session::scene_is_on_board);
    assert_eq!(poses(&harness), there);
    arm(&mut harness);
    let why = obstacle(&harness.state().session, &Intent::Undo).expect("refused");
    assert!(why.contains("motors are off"), "{why}");
    undo(&mut harness);
    assert_eq!(poses(&harness), there);
    assert_eq!(said(&harness), why);
    // Without another upload: the parts alone were placed, and the board has them there.
    let uploads: Vec<u32> = (harness.state().session.notes.iter())
        .filter(|note| note.text == "The collision model is on the board")
        .map(|note| note.times)
        .collect();
    assert_eq!(uploads, [1]);
    harness.state_mut().session.act(Intent::Grab(1));
    until(&mut harness, "held", |s| s.grabbed() == Some(1));
    assert!(poses(&harness)[1].abs_diff_eq(there[1], 0.05));
    click(&mut harness, "STOP");
}

/// With a rig Esc is STOP: it takes the drag back too.
#[test]
fn stop_takes_a_drag_back() {
    let mut harness = selected();
    connect(&mut harness);
    harness.run_steps(2);
    let before = poses(&harness);
    hold(&mut harness, "Move along x", egui::vec2(50.0, 0.0));
    assert_ne!(poses(&harness), before);
    press(&mut harness, Modifiers::NONE, Key::Escape);
    assert_eq!(poses(&harness), before);
    until(&mut harness, "stopped", |s| {
        s.device() == Some(DeviceState::Stopped)
    });
}

#[test]
fn handles_come_before_parts_and_follow_section_and_visibility() {
    let mut harness = selected();
    // Beside the part, where a click would select nothing.
    let tip = grip(&harness, "Move along x");
    harness.hover_at(tip);
    harness.step();
    harness.drag_at(tip);
    harness.step();
    harness.drop_at(tip);
    harness.run_steps(2);
    assert_eq!(harness.state().session.selected, Some(1));
    // The front half is cut away, and with it the surface at which the handles stand.
    press(&mut harness, Modifiers::NONE, Key::X);
    let before = poses(&harness);
    drag(&mut harness, "Move along z", egui::vec2(0.0, -30.0));
    assert!(shift(&harness, &before).z > 0.5);
    undo(&mut harness);
    press(&mut harness, Modifiers::NONE, Key::H);
    assert!(harness.query_by_label("Move along x").is_none(), "hidden");
    press(&mut harness, Modifiers::NONE, Key::H);
    harness.get_by_label("Move along x");
    click(&mut harness, "Show handles");
    assert!(harness.query_by_label("Move along x").is_none(), "switched off");
}

/// The peg stands 20 mm above the block, and is not over its bore.
#[test]
fn a_part_that_is_dragged_without_overlap_stops_at_contact() {
    let mut harness = selected();
    click(&mut harness, "Drag without overlap");
    press(&mut harness, Modifiers::CTRL, Key::ArrowRight);
    press(&mut harness, Modifiers::CTRL, Key::ArrowRight);
    let before = poses(&harness);
    let to = hold(&mut harness, "Move along z", egui::vec2(0.0, 250.0));
    until(&mut harness, "at contact", |s| s.moves.stopped_by() == Some(0));
    harness.run_steps(2);
    harness.get_by_label_contains("stopped by block");
    harness.drop_at(to);
    until(&mut harness, "let go of", |s| s.moves.dragged().is_none());
    let by = shift(&harness, &before);
    // An overlap of at most 2 µm.
    assert!((by.z + 20.0).abs() < 2.1e-3 && by.x == 0.0, "{by}");
    undo(&mut harness);
    assert_eq!(poses(&harness), before);
}

/// The list in the window is the page's.
#[test]
fn keys_are_listed_in_the_window_and_on_the_page() {
    let mut harness = selected();
    press(&mut harness, Modifiers::NONE, Key::F1);
    let page = std::fs::read_to_string(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../docs/getting-started.md"
    ));
    let page = page.expect("the page");
    let rows: Vec<&str> = page.lines().filter(|line| line.starts_with("| ")).collect();
    for (key, what) in keys::KEYS.iter().flat_map(|(_, keys)| *keys) {
        let row = format!("| {key} | {what} |");
        assert!(rows.contains(&row.as_str()), "{row}");
        assert!(harness.query_all_by_label(what).count() > 0, "{what}");
    }
    press(&mut harness, Modifiers::NONE, Key::F1);
    assert!(harness.query_by_label("undo the last move").is_none());
}

/// While C is down the hand moves alone; when it comes up, the part is held where it is, and follows the hand from there.
#[test]
fn the_clutch_leaves_the_part_and_holds_it_again_without_a_jump() {
    let mut harness = holding();
    let shift = |harness: &mut Harness<'_, Window>, by: DVec3| {
        let handle = harness.state().session.handle().expect("a handle");
        let to = DAffine3::from_translation(by) * handle;
        harness.state_mut().session.move_hand(insertion::hold(&to));
        until(harness, "the hand is there", move |s| {
            let handle = s.handle().expect("a handle");
            (handle.translation - to.translation).length() < 0.2
        });
        // It comes to rest: a tenth of a second of the board without a motion.
        let last = Cell::new(None);
        until(harness, "it rests", move |s| {
            let (Some(sample), Some(handle)) = (&s.telemetry, s.handle()) else {
                return false;
            };
            let (tick, at) = (sample.tick, handle.translation);
            match last.get() {
                Some((then, _)) if tick.wrapping_sub(then) < 100 => false,
                before => {
                    last.set(Some((tick, at)));
                    before.is_some_and(|(_, was): (u32, DVec3)| (at - was).length() < 0.005)
                }
            }
        });
    };
    let free = DVec3::new(0.0, 0.0, 4.0);
    shift(&mut harness, free);
    harness.key_down(Key::C);
    harness.run_steps(2);
    until(&mut harness, "the part is let go of", |s| {
        s.device() == Some(DeviceState::Armed) && s.clutched() == Some(1)
    });
    let left = poses(&harness)[1];
    let handle = harness.state().session.handle().expect("a handle");
    shift(&mut harness, -free);
    assert_eq!(poses(&harness)[1], left, "the handle moves alone");
    harness.key_up(Key::C);
    harness.run_steps(2);
    until(&mut harness, "the part is held again", |s| s.grabbed() == Some(1));
    assert_eq!(harness.state().session.clutched(), None);
    let off = |harness: &Harness<'_, Window>, from: DAffine3| {
        (poses(harness)[1].translation - from.translation).length()
    };
    assert!(
        off(&harness, left) < 0.1,
        "it jumps by {} mm",
        off(&harness, left)
    );
    shift(&mut harness, free);
    let now = harness.state().session.handle().expect("a handle");
    assert!(
        (now.translation - handle.translation).length() < 0.5,
        "the hand is back"
    );
    until(&mut harness, "the part follows", move |s| {
        let at = s.document.as_ref().expect("open").poses[1].translation;
        (at - left.translation - free).length() < 0.3
    });
    // After STOP nothing is held again.
    harness.key_down(Key::C);
    harness.run_steps(2);
    until(&mut harness, "the part is let go of", |s| s.clutched() == Some(1));
    click(&mut harness, "STOP");
    until(&mut harness, "stopped", |s| {
        s.device() == Some(DeviceState::Stopped)
    });
    assert_eq!(harness.state().session.clutched(), None);
    harness.key_up(Key::C);
    harness.run_steps(5);
    assert_eq!(harness.state().session.device(), Some(DeviceState::Stopped));
}
