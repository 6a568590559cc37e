//! The command line in the window: instructions in plain words, their questions and refusals.

use crate::common::{arm, click, connect, harness, open_sample, poses, press, until};
use egui::{Key, Modifiers};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use mortise::session::document::Document;
use mortise::session::{Intent, obstacle};
use mortise::ui::Window;
use mortise_words::Outcome;

fn document<'a>(harness: &'a Harness<'_, Window>) -> &'a Document {
    harness.state().session.document.as_ref().expect("open")
}

/// Types into the command line.
fn write(harness: &mut Harness<'_, Window>, text: &str) {
    harness.get_by_label("Instruction").type_text(text);
    harness.run_steps(2);
}

/// Gives an instruction and waits for its end.
fn say(harness: &mut Harness<'_, Window>, text: &str) -> Outcome {
    write(harness, text);
    press(harness, Key::Enter);
    answered(harness, text)
}

fn answered(harness: &mut Harness<'_, Window>, text: &str) -> Outcome {
    until(harness, "answered", |s| {
        s.instructions.answer.as_ref().is_some_and(|a| a.text == text)
    });
    let answer = harness.state().session.instructions.answer.as_ref();
    answer.expect("answered").outcome
}

fn open_line(harness: &mut Harness<'_, Window>) {
    harness.key_press_modifiers(Modifiers::COMMAND, Key::K);
    harness.run_steps(3);
}

#[test]
fn an_instruction_moves_parts_and_undo_moves_them_back() {
    let mut harness = harness();
    open_sample(&mut harness);
    assert!(harness.query_by_label("Instruction").is_none());
    open_line(&mut harness);
    let before = poses(&harness);
    assert_eq!(say(&mut harness, "insert the peg into the block"), Outcome::Done);
    let inserted = poses(&harness);
    assert_eq!(inserted[0], before[0]);
    let down = before[1].translation.z - inserted[1].translation.z;
    assert!((20.0..=100.0).contains(&down), "{down}");
    assert_eq!(say(&mut harness, "undo"), Outcome::Done);
    assert_eq!(poses(&harness), before);

    // What cannot be done says why, and moves nothing.
    assert_eq!(say(&mut harness, "remove the dragon"), Outcome::Refuse);
    assert!(
        harness
            .query_by_label_contains("Not done – remove the dragon")
            .is_some()
    );
    assert_eq!(poses(&harness), before);

    // Earlier instructions come back.
    press(&mut harness, Key::ArrowUp);
    press(&mut harness, Key::ArrowUp);
    press(&mut harness, Key::ArrowUp);
    press(&mut harness, Key::ArrowDown);
    assert_eq!(
        harness.get_by_label("Instruction").value().as_deref(),
        Some("undo")
    );
    press(&mut harness, Key::ArrowDown);
    press(&mut harness, Key::ArrowDown);
    assert_eq!(harness.get_by_label("Instruction").value().as_deref(), Some(""));

    // A name is completed; then Enter gives the instruction.
    write(&mut harness, "insert the p");
    press(&mut harness, Key::Tab);
    assert_eq!(
        harness.get_by_label("Instruction").value().as_deref(),
        Some("insert the peg")
    );
    press(&mut harness, Key::Enter);
    assert_eq!(answered(&mut harness, "insert the peg"), Outcome::Done);
    assert_ne!(poses(&harness), before);

    harness.key_press(Key::Escape);
    harness.run_steps(3);
    assert!(harness.query_by_label("Instruction").is_none());
}

#[test]
fn a_cancelled_instruction_moves_nothing() {
    let mut harness = harness();
    open_sample(&mut harness);
    open_line(&mut harness);
    let before = poses(&harness);
    write(&mut harness, "insert the peg");
    press(&mut harness, Key::Enter);
    // It may have ended by then, on a fast computer.
    if harness.query_by_label("Cancel").is_some() {
        click(&mut harness, "Cancel");
        assert!(harness.state().session.instructions.under_way().is_none());
        std::thread::sleep(std::time::Duration::from_secs(3));
        harness.run_steps(5);
        assert_eq!(poses(&harness), before);
        assert!(harness.state().session.instructions.answer.is_none());
    }
    // The next one is carried out.
    assert_eq!(say(&mut harness, "insert the peg into the block"), Outcome::Done);
}

#[test]
fn a_board_gets_the_parts_where_they_are_put_and_only_while_its_motors_are_off() {
    let mut harness = harness();
    open_sample(&mut harness);
    connect(&mut harness);
    let before = poses(&harness);
    open_line(&mut harness);
    assert_eq!(say(&mut harness, "insert the peg into the block"), Outcome::Done);
    let inserted = poses(&harness);
    assert_ne!(inserted, before);
    until(
        &mut harness,
        "the scene is on the board anew",
        mortise::session::Session::scene_is_on_board,
    );
    assert_eq!(poses(&harness), inserted);

    arm(&mut harness);
    let intent = Intent::Instruct("insert the peg".to_owned());
    let why = obstacle(&harness.state().session, &intent).expect("refused");
    assert!(why.contains("disarm"), "{why}");
    harness.state_mut().session.act(intent);
    harness.run_steps(5);
    assert_eq!(poses(&harness), inserted);
    assert!(harness.state().session.instructions.under_way().is_none());
    let said =
        |notes: &mortise::session::notes::Notes| notes.iter().any(|note| note.text.contains("disarm first"));
    assert!(said(&harness.state().session.notes));
}

/// The motor has parts that only their place tells apart.
#[test]
fn a_question_lists_and_marks_the_candidates_and_a_click_answers() {
    let file =
        std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/cad/05_motor/motor_flat.step");
    if !file.exists() {
        eprintln!("left out: {} is missing", file.display());
        return;
    }
    let mut harness = harness();
    harness.step();
    harness.state_mut().session.act(Intent::Open(file));
    until(&mut harness, "opened", |s| s.document.is_some());
    open_line(&mut harness);
    let before = poses(&harness);
    assert_eq!(say(&mut harness, "remove the screw"), Outcome::Ask);
    harness.run_steps(3);
    assert_eq!(poses(&harness), before);
    let candidates = harness.state().session.instructions.candidates().to_vec();
    assert!(candidates.len() > 1, "{candidates:?}");
    assert_eq!(harness.state().view.marked.parts, candidates);
    let name = document(&harness).part_name(candidates[0]).to_owned();
    assert!(harness.query_by_label(&format!("Answer {name}")).is_some());
    // A click on its line in the list of parts.
    click(&mut harness, &name);
    assert_eq!(answered(&mut harness, &name), Outcome::Done);
    harness.run_steps(3);
    assert_ne!(poses(&harness)[candidates[0]], before[candidates[0]]);
    assert!(harness.state().view.marked.parts.is_empty());
}
