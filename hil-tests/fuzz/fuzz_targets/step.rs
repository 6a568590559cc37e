//! The stages between a STEP file and the CAD kernel: scanner, checks, units, rewriting.
//!
//! The kernel itself is not fuzzed here: it runs in a separate process, whose crash, hang or memory exhaustion is an error message
//! (`host/brep/tests/child.rs`). The text rendered for it must scan again, with the same number of entities: otherwise the kernel would read
//! something different from what was checked.
#![no_main]
#![allow(dead_code, reason = "the module has more than is fuzzed")]

use libfuzzer_sys::fuzz_target;

#[path = "../../../host/brep/src/part21/mod.rs"]
mod part21;

fuzz_target!(|data: &[u8]| {
    let Ok(mut file) = part21::parse(data) else {
        return;
    };
    let _ = part21::units::length_units(&file);
    if part21::check::check(&file).is_err() || part21::operators::split(&mut file).is_err() {
        return;
    }
    let rendered = part21::render::render(&file);
    let again = part21::parse(&rendered).expect("what was rendered scans");
    assert_eq!(again.entities.len(), file.entities.len());
    for entity in 0..file.entities.len() {
        let _ = part21::render::name(&file, &file.label(entity));
    }
});
