//! Executes `docs/getting-started.md`: each step of the operator's list is done in the window, by the page's labels, and each command of
//! the page is run, or listed here with the step that runs it. A page that differs fails the test.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::common::{click, harness, until};
use egui::Role;
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use mortise::session::{Intent, Session, obstacle};
use mortise::ui::Window;
use mortise_protocol::message::DeviceState;

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");

fn page() -> String {
    std::fs::read_to_string(Path::new(ROOT).join("docs/getting-started.md")).expect("the page is there")
}

/// Numbered steps of a section, each joined to one line.
fn steps(page: &str, heading: &str) -> Vec<String> {
    let body = page.split(heading).nth(1).expect(heading);
    let body = body.split("\n#").next().expect("a section");
    let mut steps: Vec<String> = Vec::new();
    for line in body.lines() {
        if line.starts_with(|c: char| c.is_ascii_digit()) {
            steps.push(line.to_owned());
        } else if let (Some(step), true) = (steps.last_mut(), line.starts_with("   ")) {
            step.push(' ');
            step.push_str(line.trim());
        }
    }
    steps
}

/// The texts between asterisks: labels of the window.
fn labels(step: &str) -> Vec<&str> {
    let mut found = Vec::new();
    let mut rest = step;
    while let Some(start) = rest.find('*') {
        let strong = rest[start..].starts_with("**");
        let mark = if strong { "**" } else { "*" };
        let after = &rest[start + mark.len()..];
        let end = after.find(mark).expect("a closed label");
        found.push(&after[..end]);
        rest = &after[end + mark.len()..];
    }
    found
}

fn device(harness: &Harness<'_, Window>) -> Option<DeviceState> {
    harness.state().session.device()
}

fn is(state: DeviceState) -> impl Fn(&Session) -> bool {
    move |session| session.device() == Some(state)
}

#[test]
fn the_operators_steps_can_be_done_as_the_page_says() {
    let page = page();
    let steps = steps(&page, "## Operator");
    let all: Vec<Vec<&str>> = steps.iter().map(|step| labels(step)).collect();
    // The page's labels in their order; the steps below use them.
    let expected: [&[&str]; 8] = [
        &[],
        &["Open STEP file…", "Open the sample"],
        &["Connect", "Reconnect"],
        &["Collision model", "on the board", "Upload model"],
        &["Arm"],
        &["Grab", "Release"],
        &["STOP", "Clear stop", "Arm"],
        &["Disarm", "Reset parts"],
    ];
    assert_eq!(
        all, expected,
        "the page has changed: adapt the steps in this test"
    );

    let mut harness = harness();
    harness.run_steps(2);
    // 2: both buttons exist; the file dialog is the desktop's own.
    harness.get_by_label(all[1][0]);
    click(&mut harness, all[1][1]);
    until(&mut harness, "opened", |s| s.document.is_some());
    harness.get_by_role_and_label(Role::ListBoxOption, "peg");
    // 3: `sim` is chosen at the start.
    until(&mut harness, "rigs are listed", |s| !s.rigs.is_empty());
    assert_eq!(harness.state().session.chosen.to_string(), "sim");
    click(&mut harness, all[2][0]);
    until(&mut harness, "connected", is(DeviceState::Idle));
    assert!(harness.query_by_label(all[2][1]).is_none(), "nothing was lost");
    // 4: the upload starts without any action.
    until(&mut harness, "uploaded automatically", Session::scene_is_on_board);
    harness.run_steps(2);
    harness.get_by_label(all[3][0]);
    harness.get_by_label(all[3][1]);
    assert!(harness.query_by_label(all[3][2]).is_none(), "nothing to press");
    harness.state_mut().session.act(Intent::Bake);
    until(&mut harness, "baked again", |s| {
        !s.scene_is_on_board() && !s.is_busy()
    });
    harness.state_mut().session.act(Intent::CancelUpload);
    // If the upload was cancelled, the button is there. A small model may have arrived before.
    until(&mut harness, "sent or cancelled", |s| {
        s.connection().is_some_and(|c| c.upload.is_none())
    });
    if !harness.state().session.scene_is_on_board() {
        harness.run_steps(2);
        click(&mut harness, all[3][2]);
        until(&mut harness, "sent by hand", Session::scene_is_on_board);
    }
    // 5.
    click(&mut harness, all[4][0]);
    until(&mut harness, "armed", is(DeviceState::Armed));
    // 6: a click on the part's line, then the buttons; later a double click.
    click(&mut harness, "peg");
    click(&mut harness, all[5][0]);
    until(&mut harness, "held", |s| s.grabbed() == Some(1));
    harness.run_steps(2);
    click(&mut harness, all[5][1]);
    until(&mut harness, "released", is(DeviceState::Armed));
    let pos = (harness.get_by_role_and_label(Role::ListBoxOption, "peg").rect()).center();
    harness.hover_at(pos);
    harness.step();
    for pressed in [true, false, true, false] {
        harness.input_mut().events.push(egui::Event::PointerButton {
            pos,
            button: egui::PointerButton::Primary,
            pressed,
            modifiers: egui::Modifiers::NONE,
        });
    }
    harness.step();
    until(&mut harness, "grabbed by a double click", |s| {
        s.grabbed() == Some(1)
    });
    // 7.
    click(&mut harness, all[6][0]);
    until(&mut harness, "stopped", is(DeviceState::Stopped));
    harness.run_steps(2);
    click(&mut harness, all[6][1]);
    until(&mut harness, "idle", is(DeviceState::Idle));
    harness.run_steps(2);
    click(&mut harness, all[6][2]);
    until(&mut harness, "armed again", is(DeviceState::Armed));
    // 8: refused while the motors are on, possible after disarming.
    let refusal = obstacle(&harness.state().session, &Intent::ResetScene).expect("refused while armed");
    assert!(refusal.contains("motors are off"), "{refusal}");
    harness.run_steps(2);
    click(&mut harness, all[7][0]);
    until(&mut harness, "off", is(DeviceState::Idle));
    assert_eq!(obstacle(&harness.state().session, &Intent::ResetScene), None);
    harness.run_steps(2);
    click(&mut harness, all[7][1]);
    harness.run_steps(5);
    assert_eq!(device(&harness), Some(DeviceState::Idle));
}

/// The builder's steps need a rig; the labels they name do not.
#[test]
fn the_builders_labels_are_in_the_window() {
    let page = page();
    let steps = steps(&page, "### First start");
    let named: BTreeSet<&str> = steps.iter().flat_map(|step| labels(step)).collect();
    assert_eq!(
        named,
        BTreeSet::from(["off", "Set home", "Position", "Fault", "Stability margin"])
    );
    let mut harness = harness();
    harness.run_steps(2);
    until(&mut harness, "rigs are listed", |s| !s.rigs.is_empty());
    click(&mut harness, "Connect");
    until(&mut harness, "connected", |s| s.handle().is_some());
    harness.run_steps(2);
    for label in ["Board", "Loop", "Position", "Stability margin"] {
        harness.get_by_label(label);
    }
}

/// Place where a command of the page is run.
enum Run {
    /// In this test, with these arguments of `mortise`; the output contains the text.
    Here(&'static [&'static str], &'static str),
    /// Elsewhere: it needs a display, hardware or a program to be installed, or it runs this test.
    Elsewhere(&'static str),
}

const SAMPLE: &str = "host/app/samples/pair_d18.75_clear1.00.step";

const COMMANDS: [(&str, Run); 35] = [
    ("cargo xtask setup", Run::Elsewhere("CI, before anything else")),
    ("cargo xtask demo", Run::Elsewhere("the step `window` plays it")),
    (
        "cargo run --release",
        Run::Elsewhere("the step `window` opens it"),
    ),
    (
        "cargo run --release -- assembly.step",
        Run::Elsewhere("the step `window` opens one"),
    ),
    ("cargo run --release --", Run::Elsewhere("names the program only")),
    ("cargo run --release -- ports", Run::Here(&["ports"], "sim")),
    ("mortise", Run::Elsewhere("names the program only")),
    (
        "mortise inspect",
        Run::Here(&["inspect", SAMPLE, "--json"], "\"parts\""),
    ),
    (
        "mortise section FILE --plane x=12.5mm",
        Run::Here(
            &["section", SAMPLE, "--plane", "x=12.5mm", "--json"],
            "\"area_mm2\"",
        ),
    ),
    (
        "mortise clearance FILE",
        Run::Here(&["clearance", SAMPLE, "--json"], "\"pairs\""),
    ),
    (
        "mortise demo --headless --record run.mcap",
        Run::Elsewhere("`a_recorded_demo_replays` in cli.rs records one"),
    ),
    (
        "mortise replay run.mcap --check",
        Run::Elsewhere("`a_recorded_demo_replays` in cli.rs replays one"),
    ),
    (
        "mortise contacts",
        Run::Here(&["contacts", SAMPLE, "--json"], "\"contacts\""),
    ),
    (
        "mortise fit",
        Run::Here(
            &["fit", SAMPLE, "--moving", "peg", "--against", "block", "--json"],
            "\"fits\"",
        ),
    ),
    (
        "mortise features FILE",
        Run::Here(&["features", SAMPLE, "--json"], "\"ports\""),
    ),
    (
        "mortise mobility FILE",
        Run::Here(&["mobility", SAMPLE, "--json"], "\"translations\""),
    ),
    (
        "mortise disassemble FILE --part PART",
        Run::Here(
            &["disassemble", SAMPLE, "--part", "peg", "--json"],
            "\"comes_out\"",
        ),
    ),
    (
        "mortise assemble FILE",
        Run::Here(&["assemble", SAMPLE, "--json"], "\"assembles\""),
    ),
    (
        "mortise assemble FILE --report PAGE.html",
        Run::Here(
            &["assemble", SAMPLE, "--report", "REPORT", "--json"],
            "\"assembles\"",
        ),
    ),
    (
        "mortise assemble FILE --play emulated",
        Run::Here(
            &["assemble", SAMPLE, "--play", "sim", "--json"],
            "\"in_place\":true",
        ),
    ),
    (
        "mortise bake",
        Run::Here(
            &["bake", SAMPLE, "--no-cache", "-o", "OUT", "--json"],
            "\"image_bytes\"",
        ),
    ),
    (
        "mortise probe",
        Run::Here(
            &["probe", SAMPLE, "--moving", "peg", "--poses", "POSES", "--json"],
            "\"name\"",
        ),
    ),
    ("mortise ports", Run::Here(&["ports", "--json"], "\"rig\"")),
    (
        "mortise rig check firmware/rigs/woodenhaptics.toml",
        Run::Here(&["rig", "check", "firmware/rigs/woodenhaptics.toml"], "3 motors"),
    ),
    (
        "cargo xtask firmware nucleo-h743zi",
        Run::Elsewhere("the step `firmware`"),
    ),
    (
        "mortise rig flash firmware/boards/target/thumbv7em-none-eabihf/release/nucleo-h743zi",
        Run::Elsewhere("needs the board; host/flash/tests/writing.rs"),
    ),
    ("cargo xtask test --list", Run::Elsewhere("is what runs this")),
    ("cargo xtask test", Run::Elsewhere("is what runs this")),
    (
        "cargo xtask test --only unit-boards",
        Run::Elsewhere("the step of this name"),
    ),
    ("cargo xtask firmware", Run::Elsewhere("the step `firmware`")),
    (
        "mortise task",
        Run::Here(
            &["task", SAMPLE, "insert the peg into the block", "--json"],
            "\"outcome\"",
        ),
    ),
    (
        "cargo xtask book",
        Run::Elsewhere("needs mdBook; host/xtask/src/book/pages.rs tests what that gets"),
    ),
    ("cargo xtask package", Run::Elsewhere("the step `package`")),
    (
        "cargo install --path host/app",
        Run::Elsewhere("builds the program once more"),
    ),
    (
        "mortise manual ~/.local",
        Run::Here(&["manual", "MANUAL"], "share/man/man1"),
    ),
];

/// The page's separate block; it is run with the rig that is always available.
const HEADLESS: &str = "cargo xtask demo --headless --rig emulated --json";

/// Every command in code blocks and in the text, without trailing comments.
fn commands(page: &str) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    let mut keep = |text: &str| {
        let text = text.split(" #").next().unwrap_or(text).trim();
        let program = text.split(' ').next().unwrap_or_default();
        if ["cargo", "mortise"].contains(&program) {
            found.insert(text.to_owned());
        }
    };
    let mut in_block = false;
    for line in page.lines() {
        if line.starts_with("```") {
            in_block = !in_block;
        } else if in_block {
            keep(line);
        }
    }
    // Inline code may continue over the end of a line.
    let text: Vec<&str> = page.split("```").step_by(2).collect();
    for code in text
        .join("\n\n")
        .replace("\n   ", " ")
        .split('`')
        .skip(1)
        .step_by(2)
    {
        keep(code);
    }
    found
}

#[test]
fn every_command_of_the_page_is_run_or_has_its_place() {
    let known: BTreeSet<String> = (COMMANDS.iter().map(|(command, _)| *command))
        .chain([HEADLESS])
        // Commands with leading environment variables, as written.
        .map(str::to_owned)
        .collect();
    let there: BTreeSet<String> = (commands(&page()).into_iter())
        .filter(|command| command != "cargo test")
        .collect();
    assert_eq!(
        there, known,
        "the page's commands (left) differ from those run here (right)"
    );
    let folder = tempfile::tempdir().expect("a folder");
    let poses: PathBuf = folder.path().join("poses.csv");
    std::fs::write(&poses, "name,x,y,z,qw,qx,qy,qz\nas drawn,0,0,20,1,0,0,0\n").expect("written");
    let out = folder.path().join("pair.image");
    let report = folder.path().join("pair.html");
    let manual = folder.path().join("local");
    let headless = Run::Here(
        &["demo", "--headless", "--rig", "sim", "--json"],
        "\"state_hash\"",
    );
    for (command, run) in COMMANDS
        .iter()
        .map(|(c, r)| (*c, r))
        .chain([(HEADLESS, &headless)])
    {
        let (arguments, expected) = match run {
            Run::Here(arguments, expected) => (arguments, expected),
            Run::Elsewhere(place) => {
                assert!(!place.is_empty());
                continue;
            }
        };
        let arguments = arguments.iter().map(|argument| match *argument {
            "OUT" => out.as_os_str(),
            "REPORT" => report.as_os_str(),
            "POSES" => poses.as_os_str(),
            "MANUAL" => manual.as_os_str(),
            other => other.as_ref(),
        });
        let output = Command::new(env!("CARGO_BIN_EXE_mortise"))
            .args(arguments)
            .current_dir(ROOT)
            .output()
            .expect("it starts");
        let said = String::from_utf8_lossy(&output.stdout);
        assert!(
            output.status.success() && said.contains(expected),
            "{command}: {output:?}"
        );
    }
}
