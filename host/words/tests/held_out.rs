//! The list of instructions written before the grammar, on the shared assemblies: outcome, acts, candidates and codes as expected, and nothing done
//! that is not expected to be done.

use crate::support;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use mortise_words::{Outcome, Session, Turn};

const LIST: &str = include_str!("data/held_out.txt");
/// Instructions that must come out as expected.
const EXPECTED: usize = 110;

const FILES: &[(&str, &str)] = &[
    ("motor", "05_motor/motor_flat.step"),
    ("as1", "real/as1-oc-214.stp"),
    ("bolt", "06_joints/bolt_with_stop_start.step"),
    ("twopin", "06_joints/two_pin_start.step"),
    ("socket", "06_joints/ball_in_socket.step"),
    ("fixture", "07_fixture/fixture_row.step"),
    ("box", "10_extraction/box_with_board.step"),
    ("gearbox", "10_extraction/gearbox.step"),
    ("hinge", "10_extraction/hinge.step"),
];

struct Line<'a> {
    file: &'a str,
    before: Vec<&'a str>,
    say: &'a str,
    expected: &'a str,
}

fn lines() -> Vec<Line<'static>> {
    LIST.lines()
        .filter(|line| !line.trim().is_empty() && !line.starts_with('#'))
        .map(|line| {
            let cells: Vec<&str> = line.split('|').map(str::trim).collect();
            let [file, before, say, expected] = cells[..] else {
                panic!("four cells: {line}")
            };
            Line {
                file,
                before: before
                    .split('/')
                    .map(str::trim)
                    .filter(|b| !b.is_empty())
                    .collect(),
                say,
                expected,
            }
        })
        .collect()
}

/// What a turn came to, in the words of the list.
fn came_to(turn: &Turn) -> String {
    let joined = |names: &[String]| {
        names
            .iter()
            .map(|n| n.replace(' ', "~"))
            .collect::<Vec<_>>()
            .join(" ")
    };
    match turn.outcome {
        Outcome::Done => {
            let acts: Vec<String> = turn
                .acts
                .iter()
                .map(|act| {
                    let b = act.b.as_deref().unwrap_or("-").replace(' ', "~");
                    format!("{} {} {b}", act.verb.word(), act.a.replace(' ', "~"))
                })
                .collect();
            format!("done {}", acts.join(", ")).trim().to_owned()
        }
        Outcome::Ask => format!("ask {}", joined(&turn.candidates)),
        Outcome::Refuse => {
            let reason = turn.reason.as_ref().expect("a refusal has a reason");
            let code = serde_json::to_value(reason.code).expect("a code is a word");
            format!("refuse {}", code.as_str().unwrap_or_default())
        }
    }
}

/// The same outcome; acts in any order, where the list states no second part any is right; candidates in any order.
fn agrees(got: &str, expected: &str) -> bool {
    let sorted = |text: &str| {
        let mut names: Vec<&str> = text.split_whitespace().collect();
        names.sort_unstable();
        names.join(" ")
    };
    match (got.strip_prefix("done"), expected.strip_prefix("done")) {
        (Some(got), Some(expected)) => {
            let acts = |text: &'_ str| {
                let mut acts: Vec<String> = text.split(',').map(|act| act.trim().to_owned()).collect();
                acts.sort();
                acts
            };
            let (got, expected) = (acts(got), acts(expected));
            got.len() == expected.len()
                && got.iter().zip(&expected).all(|(g, e)| {
                    let (g, e): (Vec<&str>, Vec<&str>) =
                        (g.split_whitespace().collect(), e.split_whitespace().collect());
                    g.starts_with(&e)
                })
        }
        (None, None) => sorted(got) == sorted(expected),
        _ => false,
    }
}

#[test]
fn instructions_come_out_as_a_technician_expects() {
    let Some(cad) = support::shared() else {
        println!(
            "skipped {} instructions: no shared test parts (set MORTISE_SHARED)",
            lines().len()
        );
        return;
    };
    let mut sessions: BTreeMap<&str, Session> = BTreeMap::new();
    let (mut right, mut done_wrong, mut skipped, mut longest) = (0, Vec::new(), 0, Duration::ZERO);
    let mut slow = Vec::new();
    for line in lines() {
        let path = FILES
            .iter()
            .find(|(name, _)| *name == line.file)
            .expect("a file of the list")
            .1;
        if !cad.join(path).is_file() {
            skipped += 1;
            continue;
        }
        let session = sessions.entry(line.file).or_insert_with(|| {
            let model = mortise_brep::load_step(cad.join(path)).expect("a shared file is read");
            Session::new(model).expect("a shared file is an assembly")
        });
        session.start_over();
        for before in &line.before {
            let turn = session.say(before);
            if turn.outcome != Outcome::Done {
                println!(
                    "  before: {} | {before}: {:?} {:?}",
                    line.file,
                    came_to(&turn),
                    turn.reason.map(|r| r.words)
                );
            }
        }
        let placements = session.world().placements();
        let start = Instant::now();
        let turn = session.say(line.say);
        let took = start.elapsed();
        longest = longest.max(took);
        slow.push((
            took / turn.acts.len().max(1) as u32,
            format!("{} | {}", line.file, line.say),
        ));
        if turn.outcome != Outcome::Done {
            assert!(
                turn.moved.is_empty() && placements == session.world().placements(),
                "moved: {}",
                line.say
            );
        }
        let got = came_to(&turn);
        if agrees(&got, line.expected) {
            right += 1;
        } else {
            let words = turn.reason.map(|r| r.words).or(turn.question).unwrap_or_default();
            println!(
                "  {} | {} | expected {} | got {got} {words}",
                line.file, line.say, line.expected
            );
            if turn.outcome == Outcome::Done {
                done_wrong.push(line.say);
            }
        }
    }
    slow.sort();
    for (took, say) in slow.iter().rev().take(8) {
        println!("  {took:?} per act: {say}");
    }
    println!(
        "{right} of {} as expected, {skipped} skipped, longest turn {longest:?}",
        lines().len()
    );
    assert!(done_wrong.is_empty(), "done wrong: {done_wrong:?}");
    assert!(right + skipped >= EXPECTED, "{right} as expected");
}
