//! How parts are grouped in the window: selected in the list and the view, listed as a group, and refused in words.

use egui::accesskit::Toggled;
use egui::{Key, Modifiers};
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT as _, Queryable as _};
use glam::DVec3;
use mortise::session::document::Document;
use mortise::session::grouping::GroupIntent;
use mortise::session::{Intent, Session, obstacle};
use mortise::ui::Window;
use mortise::viewport::gesture::on_screen;
use mortise_brep::CadModel;

use crate::common::{arm, click, connect, harness, poses, until};
use crate::groups::{
    NAME, PINS, ROW, click_with, document, grouped, is_baked, line, of_repository, opened, press,
};

fn why(session: &Session, intent: GroupIntent) -> String {
    obstacle(session, &Intent::Group(intent)).unwrap_or_default()
}

#[test]
fn what_cannot_be_grouped_is_said() {
    let mut harness = harness();
    harness.step();
    let group = |parts: &[usize]| GroupIntent::Group(parts.to_vec());
    assert_eq!(why(&harness.state().session, group(&PINS)), "No file is open");
    drop(harness);
    let mut harness = grouped();
    let session = &mut harness.state_mut().session;
    assert!(why(session, group(&[3])).contains("Select two or more parts"));
    assert!(why(session, group(&[])).contains("Select two or more parts"));
    assert!(why(session, group(&[3, 77])).contains("Select two or more parts"));
    assert_eq!(why(session, group(&[2])), format!("{NAME} is a group already"));
    assert!(why(session, group(&[0, 1, 3, 4])).contains("leave one out"));
    assert_eq!(
        why(session, GroupIntent::Ungroup(3)),
        "pin-in-hole-8 is in no group"
    );
    assert_eq!(
        why(session, GroupIntent::Ungroup(usize::MAX)),
        "Select a group first"
    );
    // Instructions move parts by themselves.
    let before = poses(&harness);
    harness
        .state_mut()
        .session
        .act(Intent::Instruct("remove the pin-in-hole-4".into()));
    until(&mut harness, "answered", |s| s.instructions.answer.is_some());
    let answer = harness.state().session.instructions.answer.clone().expect("one");
    assert!(answer.words.contains("are a group and move as one"), "{answer:?}");
    assert_eq!(poses(&harness), before);
    // A bake would end the reading of another file.
    let session = &mut harness.state_mut().session;
    session.act(Intent::Open(of_repository(ROW)));
    assert_eq!(
        why(session, GroupIntent::Ungroup(1)),
        "Wait until the other file is read"
    );
    let undo = obstacle(session, &Intent::Undo);
    assert_eq!(undo.as_deref(), Some("Wait until the other file is read"));
    session.act(Intent::CancelWork);
    connect(&mut harness);
    arm(&mut harness);
    let session = &mut harness.state_mut().session;
    for intent in [group(&[1, 3]), GroupIntent::Ungroup(1)] {
        assert_eq!(
            why(session, intent.clone()),
            "Only while the motors are off: disarm first"
        );
        session.act(Intent::Group(intent));
    }
    assert_eq!(document(session).groups().together(1), PINS);
    click(&mut harness, "STOP");
}

/// The list says which parts are one, and each of them is hidden, shown alone, searched and marked as without a group.
#[test]
fn the_list_has_the_group_with_its_parts_below_and_acts_on_either() {
    let mut harness = grouped();
    // All lines are seen.
    harness.set_size(egui::vec2(1500.0, 1400.0));
    harness.run_steps(3);
    let hidden = |harness: &Harness<'_, Window>| document(&harness.state().session).hidden.clone();
    let at = |harness: &Harness<'_, Window>, label: &str| line(harness, label).rect();
    let group = at(&harness, NAME);
    for pin in ["pin-in-hole-3", "pin-in-hole-4"] {
        let own = at(&harness, pin);
        assert!(own.top() > group.top() && own.left() > group.left(), "{pin}");
        assert!(own.top() < at(&harness, "fixture-plate").top());
    }
    let _ = harness.get_by_label("Ungroup");
    click(&mut harness, &format!("Hide {NAME}"));
    assert_eq!(hidden(&harness), [false, true, true, false, false]);
    click(&mut harness, &format!("Show {NAME}"));
    click(&mut harness, "Hide pin-in-hole-4");
    assert_eq!(hidden(&harness), [false, false, true, false, false]);
    click(&mut harness, "Show pin-in-hole-4");
    click_with(&mut harness, Modifiers::NONE, NAME);
    press(&mut harness, Modifiers::NONE, Key::I);
    assert_eq!(hidden(&harness), [true, false, false, true, true]);
    press(&mut harness, Modifiers::SHIFT, Key::H);
    // By keyboard: a further part beside the group, and all of them as one.
    line(&harness, "pin-free").focus();
    harness.run_steps(2);
    press(&mut harness, Modifiers::CTRL, Key::Enter);
    assert_eq!(harness.state().session.selection(), [1, 2, 4]);
    let _ = harness.get_by_label("3 parts selected");
    press(&mut harness, Modifiers::COMMAND, Key::G);
    let all = format!("{NAME}, pin-free");
    assert!(line(&harness, &all).accesskit_node().toggled() == Some(Toggled::True));
    // From there to here.
    click(&mut harness, "fixture-plate");
    click_with(&mut harness, Modifiers::SHIFT, "pin-in-hole-8");
    assert_eq!(harness.state().session.selection(), [0, 3]);
    // A search finds the group by its name, which has those of its parts.
    harness.get_by_label("Search parts").focus();
    harness.run_steps(2);
    harness.get_by_label("Search parts").type_text("free");
    harness.run_steps(2);
    let _ = (line(&harness, &all), line(&harness, "pin-free"));
    assert!(harness.query_by_label("Hide fixture-plate").is_none());
}

#[test]
fn a_click_with_ctrl_in_the_view_selects_a_part_beside_others() {
    let mut harness = opened();
    // The handles of one pin are before the next one.
    harness.state_mut().view.handles.shown = false;
    let view = harness.get_by_label("3D view").rect();
    let click_at = |harness: &mut Harness<'_, Window>, part: usize| {
        let window = harness.state();
        let document = document(&window.session);
        let middle = document.middle(part).expect("a part");
        let top = middle + 13.0 * DVec3::Z;
        let at = on_screen(&window.view.camera, view, top).expect("in front");
        harness.drag_at(at);
        harness.step();
        harness.drop_at(at);
        harness.run_steps(2);
    };
    click_at(&mut harness, 1);
    assert_eq!(harness.state().session.selection(), [1]);
    harness.event(egui::Event::ModifiersChanged(Modifiers::CTRL));
    click_at(&mut harness, 2);
    assert_eq!(harness.state().session.selection(), [1, 2]);
    click_at(&mut harness, 1);
    assert_eq!(harness.state().session.selection(), [2]);
}

/// The plate with its pins as a subassembly of two.
fn with_subassembly(harness: &mut Harness<'_, Window>) {
    let session = &mut harness.state_mut().session;
    let document = session.document.as_mut().expect("open");
    let mut model = CadModel::clone(&document.model);
    for part in PINS {
        model.parts[part].path = vec!["pins".into()];
    }
    *document = Document::of(model, document.path.clone(), "row".into(), document.generation);
    session.act(Intent::Bake);
    until(harness, "it is baked", is_baked);
    harness.run_steps(3);
}

#[test]
fn a_subassembly_is_grouped_at_once_and_has_its_name() {
    let mut harness = opened();
    with_subassembly(&mut harness);
    click(&mut harness, "pins");
    assert_eq!(harness.state().session.selection(), PINS);
    click(&mut harness, "Group pins");
    until(&mut harness, "it is baked", is_baked);
    harness.run_steps(3);
    assert_eq!(harness.state().session.selection(), PINS, "it is selected");
    let groups = document(&harness.state().session).groups();
    assert_eq!(groups.of(2).map(|group| group.name.as_str()), Some("pins"));
    // No clearance within the group is listed, and its joints are those of both pins.
    click(&mut harness, "Joints");
    harness.run_steps(10);
    click(&mut harness, "Find the joints");
    until(&mut harness, "the joints", |s| {
        s.joints.of(document(s), 2).is_some()
    });
    let session = &harness.state().session;
    let found = session.joints.of(document(session), 1).expect("found");
    assert_eq!(found.parts, PINS);
    assert!(found.joints.iter().all(|joint| joint.other == 0), "{found:?}");
}
