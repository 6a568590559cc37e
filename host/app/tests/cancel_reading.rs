//! A reading in the window shows its progress; cancelling it leaves no process behind, and its file does not open afterwards.
//!
//! The test program starts itself as the reading process, so it defines its own `main` and calls [`child::init`] first.

use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, Instant};

use libtest_mimic::{Arguments, Failed, Trial};
use mortise::session::{Intent, Session};
use mortise_brep::child;

/// Copies of the sample in one file, for which the kernel needs several seconds.
const COPIES: u64 = 400;
/// Offset of the copies' entity numbers, above every number of the sample.
const NUMBERS: u64 = 10_000;
/// Time within which the process must have ended.
const SOON: Duration = Duration::from_secs(1);

fn main() -> ExitCode {
    child::init();
    let trial = |name, test: fn()| {
        Trial::test(name, move || {
            // The test fails by a panic, which libtest-mimic reports.
            test();
            Ok::<(), Failed>(())
        })
    };
    let tests = vec![
        trial("a_reading_reports_its_progress", a_reading_reports_its_progress),
        trial(
            "cancelling_ends_the_reading_process",
            cancelling_ends_the_reading_process,
        ),
        trial(
            "opening_another_file_ends_the_reading_process",
            opening_another_file_ends_the_reading_process,
        ),
        trial(
            "closing_the_window_ends_the_reading_process",
            closing_the_window_ends_the_reading_process,
        ),
        trial(
            "a_time_limit_on_the_command_line_ends_the_reading",
            a_time_limit_on_the_command_line_ends_the_reading,
        ),
    ];
    let mut arguments = Arguments::from_args();
    // Each test searches for the reader of its own file; running two at once would only slow both.
    arguments.test_threads = Some(1);
    libtest_mimic::run(&arguments, tests).exit_code()
}

/// The sample's entities repeated under other numbers.
fn slow_file() -> tempfile::TempPath {
    let sample = include_str!("../samples/pair_d18.75_clear1.00.step");
    let (header, rest) = sample.split_once("DATA;").expect("a data section");
    let data = rest.split_once("ENDSEC;").expect("its end").0;
    let mut text = format!("{header}DATA;");
    for copy in 0..COPIES {
        let mut pieces = data.split('#');
        text += pieces.next().unwrap_or_default();
        for piece in pieces {
            let digits = piece.bytes().take_while(u8::is_ascii_digit).count();
            let number: u64 = piece[..digits].parse().expect("a number");
            assert!(number < NUMBERS);
            text += &format!("#{}{}", number + copy * NUMBERS, &piece[digits..]);
        }
    }
    text += "ENDSEC;\nEND-ISO-10303-21;\n";
    let file = tempfile::Builder::new()
        .suffix(".step")
        .tempfile()
        .expect("a file");
    std::fs::write(file.path(), text).expect("written");
    file.into_temp_path()
}

/// Number of processes that read this file; `None` without /proc.
fn readers_of(file: &Path) -> Option<usize> {
    let wanted = format!("MORTISE_BREP_CHILD_PATH={}\0", file.display());
    let processes = std::fs::read_dir("/proc").ok()?.flatten();
    let environments = processes.filter_map(|process| std::fs::read(process.path().join("environ")).ok());
    Some(
        environments
            .filter(|all| all.windows(wanted.len()).any(|part| part == wanted.as_bytes()))
            .count(),
    )
}

/// A session that reads `file` in its own process; `None` where processes cannot be listed.
fn reading(file: &Path) -> Option<Session> {
    if !cfg!(target_os = "linux") {
        println!("skipped: processes are listed from /proc, which is missing here");
        return None;
    }
    let mut session = Session::new(Arc::new(|| {}));
    session.act(Intent::Open(file.to_owned()));
    let begun = Instant::now();
    while readers_of(file) == Some(0) {
        session.poll();
        assert!(
            begun.elapsed() < Duration::from_secs(60),
            "no process reads the file"
        );
        std::thread::sleep(Duration::from_millis(2));
    }
    assert!(session.is_busy() && session.document.is_none());
    Some(session)
}

fn gone_soon(file: &Path, begun: Instant) {
    while readers_of(file) != Some(0) {
        assert!(begun.elapsed() < SOON, "it still reads");
        std::thread::sleep(Duration::from_millis(2));
    }
    println!("ended after {:?}", begun.elapsed());
}

fn a_reading_reports_its_progress() {
    let file = slow_file();
    let Some(mut session) = reading(&file) else { return };
    let mut seen = Vec::new();
    while session.is_busy() && session.document.is_none() {
        let job = session.job.as_ref().expect("busy");
        assert!(job.doing.starts_with("Reading "), "{}", job.doing);
        seen.extend(job.fraction);
        std::thread::sleep(Duration::from_millis(2));
        session.poll();
    }
    assert!(session.document.is_some(), "read");
    assert!(
        seen.is_sorted() && seen.iter().all(|f| (0.0..=1.0).contains(f)),
        "{seen:?}"
    );
    seen.dedup();
    let between = seen.iter().filter(|&&f| 0.1 < f && f < 0.9).count();
    assert!(between > 5, "{seen:?}");
}

fn cancelling_ends_the_reading_process() {
    let file = slow_file();
    let Some(mut session) = reading(&file) else { return };
    let begun = Instant::now();
    session.act(Intent::CancelWork);
    gone_soon(&file, begun);
    std::thread::sleep(Duration::from_millis(100));
    session.poll();
    assert!(!session.is_busy() && session.document.is_none());
    let notes: Vec<&str> = session.notes.iter().map(|note| note.text.as_str()).collect();
    assert_eq!(notes, ["Cancelled"]);
}

fn opening_another_file_ends_the_reading_process() {
    let file = slow_file();
    let Some(mut session) = reading(&file) else { return };
    let begun = Instant::now();
    session.act(Intent::OpenSample);
    gone_soon(&file, begun);
}

fn closing_the_window_ends_the_reading_process() {
    let file = slow_file();
    let Some(session) = reading(&file) else { return };
    let begun = Instant::now();
    drop(session);
    gone_soon(&file, begun);
}

fn a_time_limit_on_the_command_line_ends_the_reading() {
    let file = slow_file();
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_mortise"))
        .args(["inspect", "--timeout", "1"])
        .arg(&file)
        .output()
        .expect("the program starts");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("1 s") && said.lines().count() == 1, "{said}");
}
