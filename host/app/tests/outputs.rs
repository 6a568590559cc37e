//! Files written by commands, tested with the real program: no existing file is destroyed without --force, and every refusal is one line
//! with exit code 2.

use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::Duration;

const SAMPLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/samples/pair_d18.75_clear1.00.step");

fn program() -> Command {
    Command::new(env!("CARGO_BIN_EXE_mortise"))
}

fn mortise(folder: &Path, arguments: &[&str]) -> Output {
    (program().current_dir(folder).args(arguments).output()).expect("the program starts")
}

/// Checks for exit code 2 and one line that contains `what`.
fn refused(output: &Output, what: &str) {
    assert_eq!(output.status.code(), Some(2), "{what}: {output:?}");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(said.lines().count(), 1, "{said}");
    assert!(
        said.starts_with("mortise: ") && said.contains(what),
        "{what}: {said}"
    );
}

/// Regression test: each of these was once replaced or written through, with exit code 0.
#[cfg(unix)]
#[test]
fn bake_destroys_nothing() {
    use std::os::unix::fs::symlink;
    let place = tempfile::tempdir().expect("temporary folder");
    let at = |name: &str| place.path().join(name);
    let source = std::fs::read(SAMPLE).expect("sample");
    std::fs::write(at("x.step"), &source).expect("written");
    std::fs::write(at("victim"), "precious").expect("written");
    std::fs::hard_link(at("x.step"), at("hard.step")).expect("hard link");
    symlink("victim", at("link")).expect("link");
    symlink("victim", at("new.image.part")).expect("link");
    std::fs::create_dir(at("folder")).expect("folder");
    let _socket = std::os::unix::net::UnixListener::bind(at("socket")).expect("socket");
    let bake = |out: &str, force: bool| {
        let mut arguments = vec!["bake", "x.step", "--no-cache", "-o", out];
        arguments.extend(force.then_some("--force"));
        mortise(place.path(), &arguments)
    };
    for (out, what) in [
        ("x.step", "is the input"),
        ("hard.step", "is the input"),
        ("link", "a symbolic link"),
        ("folder", "a folder"),
        ("socket", "a socket"),
        ("/dev/null", "a device"),
        ("absent/x.image", "its folder absent does not exist"),
    ] {
        refused(&bake(out, true), what);
    }
    refused(&bake("victim", false), "--force");
    assert_eq!(std::fs::read(at("x.step")).expect("there"), source);
    assert_eq!(std::fs::read(at("victim")).expect("there"), b"precious");
    assert!(
        bake("new.image", false).status.success(),
        "a link at an old temporary name has no effect"
    );
    assert_eq!(std::fs::read(at("victim")).expect("there"), b"precious");
    assert!(bake("victim", true).status.success());
    assert_eq!(
        std::fs::read(at("victim")).expect("replaced"),
        std::fs::read(at("new.image")).expect("written")
    );
}

#[test]
fn a_killed_bake_leaves_no_half_of_a_file() {
    let place = tempfile::tempdir().expect("temporary folder");
    let whole = mortise(place.path(), &["bake", SAMPLE, "--no-cache", "-o", "whole.image"]);
    assert!(whole.status.success(), "{whole:?}");
    let whole = std::fs::read(place.path().join("whole.image")).expect("written");
    let out = place.path().join("x.image");
    for milliseconds in [50, 300, 800, 1200, 1600, 2000] {
        let mut child = program()
            .current_dir(place.path())
            .args(["bake", SAMPLE, "--no-cache", "-o", "x.image", "--force"])
            .stdout(Stdio::null())
            .spawn()
            .expect("the program starts");
        std::thread::sleep(Duration::from_millis(milliseconds));
        child.kill().expect("killed or ended");
        child.wait().expect("ended");
        if let Ok(bytes) = std::fs::read(&out) {
            assert!(bytes == whole, "after {milliseconds} ms: {} bytes", bytes.len());
        }
    }
}

#[test]
fn a_picture_is_refused_before_the_window_opens() {
    let place = tempfile::tempdir().expect("temporary folder");
    std::fs::write(place.path().join("x.png"), "mine").expect("written");
    refused(
        &mortise(place.path(), &["open", "--screenshot", "x.png"]),
        "--force",
    );
    refused(
        &mortise(place.path(), &["demo", "--screenshot", "absent/x.png"]),
        "its folder absent does not exist",
    );
    std::fs::copy(SAMPLE, place.path().join("x.step")).expect("copied");
    for command in ["open", "demo"] {
        refused(
            &mortise(
                place.path(),
                &[command, "x.step", "--screenshot", "x.step", "--force"],
            ),
            "is the input",
        );
    }
}

/// A file that cannot be read is found out by reading it, so an answer about the output instead shows that this was looked at before.
#[test]
fn an_output_is_refused_before_the_input_is_read() {
    let place = tempfile::tempdir().expect("temporary folder");
    let at = |name: &str| place.path().join(name);
    std::fs::write(at("x.step"), "no STEP file").expect("written");
    std::fs::write(at("victim"), "precious").expect("written");
    std::fs::write(at("script"), "remove the peg").expect("written");
    let cases: &[(&[&str], &str)] = &[
        (
            &["bake", "x.step", "-o", "absent/x.image"],
            "its folder absent does not exist",
        ),
        (&["bake", "x.step", "-o", "victim"], "--force"),
        (&["bake", "x.step", "-o", "x.step", "--force"], "is the input"),
        (
            &["task", "x.step", "remove the peg", "-o", "absent/y.step"],
            "its folder absent does not exist",
        ),
        (&["task", "x.step", "remove the peg", "-o", "victim"], "--force"),
        (
            &["task", "x.step", "remove the peg", "-o", "x.step", "--force"],
            "is the input",
        ),
        (
            &["task", "x.step", "--script", "script", "-o", "script", "--force"],
            "is the input",
        ),
    ];
    for (arguments, what) in cases {
        refused(&mortise(place.path(), arguments), what);
    }
}

#[test]
fn every_bad_option_value_is_one_line() {
    let place = tempfile::tempdir().expect("temporary folder");
    let cases: &[(&[&str], &str)] = &[
        (&["inspect"], "<FILE>"),
        (&["inspect", SAMPLE, "--jsn"], "--json"),
        (&["inspect", SAMPLE, "--timeout", "0"], "1 to 86400"),
        (&["contacts", SAMPLE, "--timeout", "-1"], "1 to 86400"),
        (&["contacts", SAMPLE, "--tolerance", "0"], "more than 0"),
        (&["contacts", SAMPLE, "--fit", "-1"], "more than 0"),
        (&["bake", SAMPLE], "--output"),
        (&["bake", SAMPLE, "-o", "q", "--cell", "abc"], "--cell"),
        (&["bake", SAMPLE, "-o", "q", "--cell", "-1"], "0.001 to 1000"),
        (&["bake", SAMPLE, "-o", "q", "--cell", "nan"], "0.001 to 1000"),
        (&["bake", SAMPLE, "-o", "q", "--accuracy", "5"], "5um"),
        (
            &["bake", SAMPLE, "-o", "q", "--accuracy", "5um", "--tick", "0"],
            "--tick",
        ),
        (&["bake", SAMPLE, "-o", "q", "--flash", "0"], "--flash"),
        (
            &["bake", SAMPLE, "-o", "q", "--cell", "1", "--tick", "9000"],
            "--tick",
        ),
        (&["bake", SAMPLE, "-o", "q", "--voxel", "1"], "--shell"),
        (
            &["bake", SAMPLE, "-o", "q", "--shell", "round"],
            "error-bounded, classic",
        ),
        (&["bake", SAMPLE, "-o", "q", "--method", "x"], "distance-field"),
        (&["demo", "--rig", "emulated:q"], "emulated:lockstep"),
        (&["demo", "--json"], "--headless"),
        (&["lab", "rate", "--quick"], "`mortise-lab rate --quick`"),
        (&["probe", SAMPLE], "--moving"),
        (&["rig", "show", "--rig", "emulated:q"], "emulated:lockstep"),
        (&["ports", "--jsn"], "--json"),
        (&["open", SAMPLE, "--timeout", "soon"], "1 to 86400"),
        (
            &["open", SAMPLE, "--screenshot", "q", "--after", "nan"],
            "0 to 3600",
        ),
    ];
    for (arguments, what) in cases {
        let output = mortise(place.path(), arguments);
        refused(&output, what);
        assert!(output.stdout.is_empty(), "{arguments:?}");
    }
    assert_eq!(std::fs::read_dir(place.path()).expect("folder").count(), 0);
}
