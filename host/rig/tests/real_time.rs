//! The in-process rig's thread runs at real-time priority, or a message says that the system refused it. Linux only: the priority is read from
//! `/proc`.
#![cfg(target_os = "linux")]

use std::process::Command;

use mortise_rig::{Client, Event, RigSpec};

/// Set in the run of this test that has no right to real-time priority.
const WITHOUT: &str = "MORTISE_TEST_WITHOUT_REAL_TIME";
/// `SCHED_RR`.
const ROUND_ROBIN: &str = "2";

/// Whether the board's thread runs at real-time priority, and whether a refusal was reported.
fn granted_and_reported() -> (bool, bool) {
    let client = Client::connect(&RigSpec::Simulated { realtime: true }).expect("the rig greets");
    let reported = (client.events().try_iter())
        .any(|event| matches!(event, Event::Log(line) if line.contains("no real-time priority")));
    let board = (std::fs::read_dir("/proc/self/task").expect("threads").flatten())
        .map(|thread| thread.path())
        .find(|thread| {
            std::fs::read_to_string(thread.join("comm")).is_ok_and(|name| name.trim() == "mortise-board")
        })
        .expect("the board's thread");
    let stat = std::fs::read_to_string(board.join("stat")).expect("it runs");
    // proc(5): field 41 is the policy; fields are counted behind the name, which is field 2.
    let policy = (stat.rsplit(')').next()).and_then(|rest| rest.split_whitespace().nth(41 - 3));
    (policy == Some(ROUND_ROBIN), reported)
}

#[test]
fn real_time_priority_is_granted_or_its_refusal_is_reported() {
    let (granted, reported) = granted_and_reported();
    assert_eq!(
        reported, !granted,
        "granted: {granted}, a refusal reported: {reported}"
    );
    if std::env::var_os(WITHOUT).is_some() {
        assert!(reported);
        return;
    }
    // Once more without the right to it.
    let own = std::env::current_exe().expect("this test");
    let refused = Command::new("setpriv")
        .args([
            "--bounding-set=-sys_nice",
            "--inh-caps=-sys_nice",
            "prlimit",
            "--rtprio=0",
        ])
        .arg(own)
        .env(WITHOUT, "1")
        .output();
    match refused {
        Ok(output) if String::from_utf8_lossy(&output.stdout).contains("running 1 test") => {
            assert!(output.status.success(), "{output:?}");
        }
        other => println!("skipped: the right cannot be given up here: {other:?}"),
    }
}
