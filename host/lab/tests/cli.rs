//! The program as a person or a script runs it: output and exit code.

use std::path::Path;
use std::process::{Command, Output};

use mortise_lab::experiments::ALL;

fn lab(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_mortise-lab"))
        .current_dir(folder)
        .args(arguments)
        .output()
        .expect("the program starts")
}

/// Exit code 2, nothing on standard output (so it failed before the first trial), and one line on standard error that names `what`.
fn refused(folder: &Path, arguments: &[&str], what: &str) {
    let output = lab(folder, arguments);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {output:?}");
    assert!(output.stdout.is_empty(), "{output:?}");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(said.lines().count(), 1, "{said}");
    assert!(
        said.starts_with("mortise-lab: ") && said.contains(what),
        "{what}: {said}"
    );
}

/// Every experiment of the table is a command, and its help states the scope of the quick form.
#[test]
fn every_experiment_is_a_command() {
    let help = |arguments: &[&str]| {
        let output = lab(Path::new("."), arguments);
        assert!(output.status.success(), "{output:?}");
        String::from_utf8(output.stdout).expect("UTF-8")
    };
    let overview = help(&["--help"]);
    for experiment in ALL {
        assert!(overview.contains(experiment.about()), "{overview}");
        let own = help(&[experiment.name(), "--help"]);
        assert!(own.contains(experiment.quick()), "{own}");
    }
}

#[test]
fn every_bad_option_value_is_one_line() {
    let place = tempfile::tempdir().expect("temporary folder");
    let cases: &[(&[&str], &str)] = &[
        (&["figures", "no-such"], "end-to-end"),
        (&["stability", "--map", "x"], "stability-jam"),
        (&["shrink", "--force"], "--out"),
        (&["endurance", "--hours", "-1"], "100 h"),
        (&["endurance", "--hours", "nan"], "100 h"),
        (
            &["figures", "contact", "--program", "absent"],
            "absent is not there",
        ),
        (&["sweep"], "sweep"),
    ];
    for (arguments, what) in cases {
        refused(place.path(), arguments, what);
    }
    assert_eq!(std::fs::read_dir(place.path()).expect("folder").count(), 0);
}

#[test]
fn tables_and_charts_are_replaced_on_request_only() {
    let place = tempfile::tempdir().expect("temporary folder");
    let table = place.path().join("stability-impact.svg");
    std::fs::write(&table, "mine").expect("written");
    let sweep = ["stability", "--quick", "--map", "stability-impact", "--out", "."];
    refused(place.path(), &sweep, "--force");
    assert_eq!(std::fs::read(&table).expect("there"), b"mine");
}

/// Refused before the first trial, which would print to standard output.
#[test]
fn a_folder_that_cannot_be_written_is_refused_before_the_sweep() {
    let place = tempfile::tempdir().expect("temporary folder");
    let file = place.path().join("taken");
    std::fs::write(&file, "no folder").expect("written");
    let inside = file.join("out");
    for folder in [file.to_str().expect("UTF-8"), inside.to_str().expect("UTF-8")] {
        for experiment in ALL {
            let said = format!("{folder}: ");
            let arguments = [experiment.name(), "--quick", "--out", folder];
            refused(place.path(), &arguments, &said);
        }
    }
    assert_eq!(std::fs::read(&file).expect("still there"), b"no folder");
}

#[test]
fn a_missing_folder_is_made_and_holds_nothing_but_the_results() {
    let place = tempfile::tempdir().expect("temporary folder");
    let folder = place.path().join("to/results");
    let name = "stability-impact";
    let output = lab(
        place.path(),
        &[
            "stability",
            "--quick",
            "--map",
            name,
            "--out",
            folder.to_str().expect("UTF-8"),
        ],
    );
    assert!(output.status.success(), "{output:?}");
    let mut found: Vec<String> = (std::fs::read_dir(&folder).expect("made"))
        .map(|entry| {
            entry
                .expect("readable")
                .file_name()
                .to_string_lossy()
                .into_owned()
        })
        .collect();
    found.sort();
    assert_eq!(found, ["csv", "png", "svg"].map(|kind| format!("{name}.{kind}")));
}
