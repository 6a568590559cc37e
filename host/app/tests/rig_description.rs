//! `mortise rig` as a rig builder runs it: a valid description, every kind of invalid one, and the storage on a board.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

const RIGS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../firmware/rigs");

fn mortise(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_mortise"))
        .args(arguments)
        .output()
        .expect("the program starts")
}

fn example(name: &str) -> PathBuf {
    Path::new(RIGS).join(name)
}

fn text(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}

/// Checks for exit code 2, nothing on standard output, and one line on standard error with each of `pieces`.
fn refused(arguments: &[&str], pieces: &[&str]) {
    let output = mortise(arguments);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {output:?}");
    assert!(output.stdout.is_empty(), "{output:?}");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(
        said.starts_with("mortise: ") && said.lines().count() == 1,
        "{said}"
    );
    for piece in pieces {
        assert!(said.contains(piece), "`{piece}` is not in: {said}");
    }
}

#[test]
fn check_says_what_a_described_rig_can_do() {
    let file = example("hapkit.toml");
    let output = mortise(&["rig", "check", text(&file), "--json"]);
    assert!(output.status.success(), "{output:?}");
    let found: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!((&found["name"], &found["joints"]), (&"hapkit".into(), &1.into()));
    // One count of 25967 per revolution at a radius of 65.659 mm.
    let step = std::f64::consts::TAU * 65.659 / 25967.0;
    let found_value = found["resolution_mm"].as_f64().expect("a number");
    assert!(
        (found_value / step - 1.0).abs() < 1e-3,
        "{found_value} for {step}"
    );
    // Pulley torque at 1 A times the gear ratio over the radius; the hardware limit of 5 N is below it.
    let most = 0.03 * 17.4546 / 0.065659;
    let found_value = found["force_strongest_n"].as_f64().expect("a number");
    assert!(
        most > 5.0 && found_value <= 5.0 + 1e-6 && found_value > 4.99,
        "{found_value}"
    );

    for name in ["haply_2diy.toml", "woodenhaptics.toml", "polhem.toml"] {
        let output = mortise(&["rig", "check", text(&example(name))]);
        assert!(output.status.success(), "{name}: {output:?}");
        let said = String::from_utf8(output.stdout).expect("UTF-8");
        assert!(said.contains("home:") && said.contains("force:"), "{said}");
    }
}

#[test]
fn check_says_what_is_wrong_where_and_what_to_do() {
    let good = std::fs::read_to_string(example("woodenhaptics.toml")).expect("there");
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("arm.toml");
    for (from, to, pieces) in [
        (
            "current_limit_a = 3.0",
            "current_limit_a = 300.0",
            &["arm.toml", "current_limit_a of joint 1", "0.01 to 30 A"][..],
        ),
        (
            "upper_mm = 205",
            "upper_mm = nan",
            &["kinematics.upper_mm is NaN"],
        ),
        ("upper_mm = 205", "uper_mm = 205", &["uper_mm"]),
        (
            "kind = \"serial-arm\"",
            "kind = \"spring\"",
            &["spring", "serial-arm"],
        ),
        ("home_deg = 90", "home_deg = 170", &["home_deg", "range_deg"]),
        (
            "workspace_mm = ",
            "workspace_mm = 20 #",
            &["outside ceilings.workspace_mm"],
        ),
        ("name = ", "name = 5 #", &["line"]),
        ("[kinematics]", "[[joint]]\n[kinematics]", &["arm.toml"]),
    ] {
        assert!(good.contains(from), "{from}");
        std::fs::write(&file, good.replacen(from, to, 1)).expect("written");
        refused(&["rig", "check", text(&file)], pieces);
        // A description that fails the check is never sent to a board.
        refused(&["rig", "send", text(&file), "--rig", "sim"], pieces);
    }
    std::fs::write(&file, [0xff, 0xfe, 0x00]).expect("written");
    refused(&["rig", "check", text(&file)], &["arm.toml", "check the path"]);
    refused(
        &["rig", "check", text(&folder.path().join("absent.toml"))],
        &["absent.toml", "check the path"],
    );
}

/// Two consecutive program runs: neither may claim that a simulated rig stores the description it was sent.
#[test]
fn a_simulated_rig_says_that_it_keeps_a_description_only_as_long_as_the_program_runs() {
    let file = example("haply_2diy.toml");
    let output = mortise(&["rig", "send", text(&file), "--rig", "sim"]);
    assert!(output.status.success(), "{output:?}");
    let said = String::from_utf8(output.stdout).expect("UTF-8");
    assert!(
        said.contains("until this program ended") && !said.contains("keeps `"),
        "{said}"
    );
    refused(
        &["rig", "show", "--rig", "sim"],
        &["keeps no description", "ends with it"],
    );
}
