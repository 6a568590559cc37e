//! Reading in a child process: crashes, hangs and memory blow-ups of the kernel stay there.
//!
//! This test program starts itself again, so its `main` is its own and calls [`child::init`] first.

mod support;

use libtest_mimic::{Arguments, Failed, Trial};
use mortise_brep::{BrepError, LoadOptions, child, load_step, load_step_with};
use std::process::{Command, ExitCode};

fn main() -> ExitCode {
    child::init();
    let tests: [(&str, fn()); 6] = [
        (
            "a_child_reads_what_the_program_itself_would",
            a_child_reads_what_the_program_itself_would,
        ),
        (
            "a_crash_of_the_kernel_is_an_error",
            a_crash_of_the_kernel_is_an_error,
        ),
        ("a_hang_ends_at_the_time_limit", a_hang_ends_at_the_time_limit),
        ("memory_is_limited", memory_is_limited),
        (
            "the_program_prints_the_parts_of_a_file",
            the_program_prints_the_parts_of_a_file,
        ),
        (
            "errors_are_one_line_and_exit_code_2",
            errors_are_one_line_and_exit_code_2,
        ),
    ];
    let trial = |(name, test): (&str, fn())| {
        Trial::test(name, move || {
            // A panic is the failure; libtest-mimic reports it.
            test();
            Ok::<(), Failed>(())
        })
    };
    libtest_mimic::run(&Arguments::from_args(), tests.into_iter().map(trial).collect()).exit_code()
}

fn a_child_reads_what_the_program_itself_would() {
    assert!(child::is_ready());
    let model = load_step(support::data("pair_d18.75_clear1.00.step")).unwrap();
    assert_eq!(model.parts.len(), 2);
    assert!(model.shapes.iter().all(|s| s.closed));
    support::check::check(&model, 1e-6);
    // Errors come through as they are.
    let error = load_step("no such file.step").unwrap_err();
    assert!(matches!(error, BrepError::Unreadable { .. }), "{error}");
}

/// The kernel (7.6) follows a null pointer when a product's shape is of a type it does not know.
fn a_crash_of_the_kernel_is_an_error() {
    let pair = std::fs::read_to_string(support::data("deep_nesting.step")).unwrap();
    let at = pair.rfind("PRODUCT_DEFINITION_SHAPE").unwrap();
    let text = format!(
        "{}{}",
        &pair[..at],
        pair[at..].replacen("PRODUCT_DEFINITION_SHAPE", "PRODUCT_SHAPE", 1)
    );
    let result = load_step(support::file(&text));
    let error = result.map(|model| model.parts.len()).unwrap_err().to_string();
    assert!(!error.contains('\n'), "{error}");
    // Newer kernels may report it in words instead.
    assert!(
        error.contains("crashed on it") || error.contains("lost"),
        "{error}"
    );
}

fn a_hang_ends_at_the_time_limit() {
    let options = LoadOptions {
        time_limit_s: 0,
        ..LoadOptions::default()
    };
    let file = support::data("pair_d18.75_clear1.00.step");
    let error = load_step_with(file, &options)
        .map(|model| model.parts.len())
        .unwrap_err();
    assert!(matches!(error, BrepError::TimedOut { seconds: 0, .. }), "{error}");
}

fn memory_is_limited() {
    if !cfg!(target_os = "linux") {
        println!("skipped: the address space is limited on Linux only");
        return;
    }
    // Less than the program and its libraries take before they have read anything: the first allocation fails.
    let options = LoadOptions {
        memory_limit_bytes: 16 << 20,
        ..LoadOptions::default()
    };
    let file = support::data("pair_d18.75_clear1.00.step");
    let error = load_step_with(file, &options)
        .map(|model| model.parts.len())
        .unwrap_err()
        .to_string();
    assert!(error.contains("memory") && !error.contains('\n'), "{error}");
}

fn program() -> Command {
    Command::new(env!("CARGO_BIN_EXE_mortise-brep"))
}

fn the_program_prints_the_parts_of_a_file() {
    let output = program()
        .arg(support::data("pair_d18.75_clear1.00.step"))
        .output()
        .unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    assert!(text.contains("2 parts, 2 shapes, in millimetre"), "{text}");
    assert!(
        text.contains("block: 7 faces, 15 edges") && text.contains("88955.34 mm³, closed"),
        "{text}"
    );
}

fn errors_are_one_line_and_exit_code_2() {
    let output = program().arg("no such file.step").output().unwrap();
    let errors = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(
        errors.lines().count() == 1 && errors.contains("check the path"),
        "{errors}"
    );
}
