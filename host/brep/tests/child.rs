//! Reading in a child process, through the program itself.

mod support;

use std::process::Command;

fn program() -> Command {
    Command::new(env!("CARGO_BIN_EXE_mortise-brep"))
}

#[test]
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

#[test]
fn a_missing_file_is_one_line_and_exit_code_2() {
    let output = program().arg("no such file.step").output().unwrap();
    let errors = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(
        errors.lines().count() == 1 && errors.contains("check the path"),
        "{errors}"
    );
}
