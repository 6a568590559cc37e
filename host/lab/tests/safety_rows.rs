//! The two tables of safety hold in their shorter form, and fail if nothing is measured.

use std::path::Path;

use mortise_lab::figures::stability::{faults, unsafe_commands};
use mortise_lab::figures::{Plan, Row};

fn main() {
    // First, because STEP files are read in a child process that is this same program.
    mortise_brep::child::init();
    let pair = Path::new(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../app/samples/pair_d18.75_clear1.00.step"
    ));
    let plan = Plan {
        quick: true,
        program: Path::new("not asked for"),
        pair,
        only: None,
    };
    let mut rows = Vec::new();
    let mut keep = |row: Row| {
        println!("{} {:?} {} ({})", row.what, row.value, row.unit, row.bound());
        rows.push(row);
    };
    faults::measure(&plan, &mut keep).expect("every fault in every state");
    unsafe_commands::measure(&plan, &mut keep).expect("unsafe commands");
    let broken: Vec<&Row> = rows.iter().filter(|row| row.fails()).collect();
    assert!(broken.is_empty(), "{broken:#?}");
    assert_eq!(rows.len(), 10);
    println!("test result: ok. 2 passed; 0 failed; 0 ignored; 0 measured; 0 filtered out");
}
