//! Flags and constraint kinds have one table each in `protocol`: the window's text and `docs/protocol.md` follow it. Parameters in the
//! window: unit tests of `src/ui/parameters.rs`.

use crate::common::{click, holding, until};
use egui::Shape;
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use mortise::ui::Window;
use mortise_protocol::message::{ConstraintKind, Flags};
use mortise_protocol::parameter::PARAMETERS;

/// Frames until a changed state is seen: the board's next sample may replace it before a frame shows it.
const FRAMES: usize = 200;

/// All text of the last frame.
fn painted(harness: &Harness<'_, Window>) -> Vec<String> {
    fn texts(shape: &Shape, found: &mut Vec<String>) {
        match shape {
            Shape::Text(text) => found.push(text.galley.text().to_owned()),
            Shape::Vec(shapes) => shapes.iter().for_each(|shape| texts(shape, found)),
            _ => {}
        }
    }
    let mut found = Vec::new();
    for clipped in &harness.output().shapes {
        texts(&clipped.shape, &mut found);
    }
    found
}

/// Repeats `change` before each frame until a frame shows exactly `expected` of the texts `among`.
fn shows(harness: &mut Harness<'_, Window>, among: &[&str], expected: &[&str], change: impl Fn(&mut Window)) {
    let mut shown = Vec::new();
    for _ in 0..FRAMES {
        harness.state_mut().session.poll();
        change(harness.state_mut());
        harness.step();
        let all = painted(harness);
        shown = among
            .iter()
            .copied()
            .filter(|text| all.iter().any(|painted| painted == text))
            .collect();
        if shown == expected {
            return;
        }
    }
    panic!("shown: {shown:?}, expected: {expected:?}");
}

#[test]
fn the_window_shows_each_flag_in_the_words_of_its_row() {
    let mut harness = holding();
    let all: Vec<&str> = Flags::ROWS.iter().map(|row| row.words).collect();
    for row in Flags::ROWS {
        shows(&mut harness, &all, &[row.words], |window| {
            let telemetry = window.session.telemetry.as_mut().expect("in hand");
            telemetry.flags = row.flag.bits();
        });
    }
    click(&mut harness, "STOP");
}

#[test]
fn the_window_names_each_constraint_kind_by_its_row() {
    let mut harness = holding();
    click(&mut harness, "Play insertion");
    until(&mut harness, "a target is found", |s| !s.guidance.rows.is_empty());
    for kind in ConstraintKind::ALL {
        let mut list = harness.state().session.guidance.clone();
        list.held = Some(1);
        list.rows.truncate(1);
        list.rows[0].target.kind = kind;
        let mut name = kind.name().to_owned();
        name[..1].make_ascii_uppercase();
        let mut seen = false;
        for _ in 0..FRAMES {
            harness.state_mut().session.poll();
            harness.state_mut().session.guidance.clone_from(&list);
            harness.step();
            seen = harness
                .query_all_by_label_contains(&format!("{name}: peg "))
                .count()
                > 0;
            if seen {
                break;
            }
        }
        assert!(seen, "{name}");
    }
    click(&mut harness, "STOP");
}

fn page() -> String {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/protocol.md");
    std::fs::read_to_string(path).expect("the page is there")
}

/// The page's range and default are compared in `protocol/tests/document.rs`.
#[test]
fn the_page_has_the_meaning_and_choices_of_every_parameter() {
    let page = page();
    for row in PARAMETERS {
        let name = format!("| `{}` |", row.name);
        let line = page.lines().find(|line| line.starts_with(&name)).expect(row.name);
        let choices = row.choices.iter().enumerate();
        let choices: Vec<String> = choices.map(|(value, name)| format!("{value} {name}")).collect();
        let choices = if choices.is_empty() {
            String::new()
        } else {
            format!(": {}, rounded to the nearest", choices.join(", "))
        };
        let ends = format!("| {}{choices} |", row.description.trim().trim_end_matches('.'));
        assert!(line.ends_with(&ends), "{line} does not end with {ends}");
    }
}

#[test]
fn the_page_has_every_constraint_kind() {
    let page = page();
    let (_, section) = page.split_once("\n## Constraint kinds\n").expect("the section");
    let section = section.split("\n## ").next().unwrap_or_default();
    let rows: Vec<&str> = section
        .lines()
        .filter(|line| line.starts_with("| "))
        .skip(1)
        .collect();
    assert_eq!(rows.len(), ConstraintKind::ALL.len());
    for (number, (row, kind)) in rows.iter().zip(ConstraintKind::ALL).enumerate() {
        let begins = format!("| {number} | `{kind:?}` | {} |", kind.name());
        assert!(row.starts_with(&begins), "{begins} … is not {row}");
    }
}
