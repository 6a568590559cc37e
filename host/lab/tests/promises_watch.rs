//! The promises on still hands, dead encoders, rotation, STOP behind a full line and external sets hold in their shorter form, and fail if nothing is
//! measured.

use std::path::Path;

use mortise_lab::figures::promises::{files, stop, watch};
use mortise_lab::figures::{Plan, Row};

fn main() {
    // First, because STEP files are read in a child process that is this same program.
    mortise_brep::child::init();
    let pair = Path::new(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../app/samples/pair_d18.75_clear1.00.step"
    ));
    let plan = Plan {
        quick: std::env::var_os("PROMISES_FULL").is_none(),
        program: Path::new("not asked for"),
        pair,
        only: None,
    };
    let mut rows = Vec::new();
    let mut keep = |row: Row| {
        println!("{row:?}");
        rows.push(row);
    };
    watch::measure(&plan, &mut keep).expect("measured");
    stop::measure(&plan, &mut keep).expect("measured");
    files::external_set(&plan, &mut keep).expect("measured");
    let broken: Vec<&Row> = rows.iter().filter(|row| row.fails()).collect();
    assert!(broken.is_empty(), "{broken:#?}");
    assert_eq!(rows.len(), 9);
    // Without STOP the same motors are driven to the end.
    assert_eq!(
        stop::ticks_until_off(&plan, false).expect("measured"),
        f64::INFINITY
    );
    if mortise_rig::emulator_available(None).is_ok() {
        assert_eq!(
            stop::emulated_ticks_until_off(&plan, false).expect("measured"),
            f64::INFINITY
        );
    }
    println!("test result: ok. 1 passed; 0 failed; 0 ignored; 0 measured; 0 filtered out");
}
