//! Reading in a child process: crashes, hangs and excessive memory use of the kernel stay there.
//!
//! This test program starts itself again, so it has its own `main`, which calls [`child::init`] first.

mod support;

use glam::{DAffine3, DVec3};
use libtest_mimic::{Arguments, Failed, Trial};
use mortise_brep::oracle::{self, Side};
use mortise_brep::{BrepError, LoadOptions, child, load_step, load_step_while, load_step_with};
use std::cell::RefCell;
use std::ops::ControlFlow;
use std::process::{Command, ExitCode, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use support::StepText;

/// Name of the environment variable with a file that this program is to read and do nothing else.
const SLOW_VARIABLE: &str = "MORTISE_BREP_TEST_SLOW";

fn main() -> ExitCode {
    child::init();
    if let Some(path) = std::env::var_os(SLOW_VARIABLE) {
        let read = load_step(path).map(|model| model.parts.len());
        println!("{read:?}");
        return ExitCode::SUCCESS;
    }
    let tests: Vec<(&str, fn())> = vec![
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
            "processor_time_is_limited_and_the_process_ends_with_its_parent",
            processor_time_is_limited_and_the_process_ends_with_its_parent,
        ),
        (
            "the_system_holds_the_limits_of_a_reading_process",
            the_system_holds_the_limits_of_a_reading_process,
        ),
        (
            "a_reading_reports_rising_progress",
            a_reading_reports_rising_progress,
        ),
        (
            "a_reading_that_is_cancelled_leaves_no_process",
            a_reading_that_is_cancelled_leaves_no_process,
        ),
        ("an_answer_is_limited", an_answer_is_limited),
        (
            "an_assembly_bomb_is_refused_at_once",
            an_assembly_bomb_is_refused_at_once,
        ),
        (
            "coordinates_beyond_all_sizes_are_refused_at_once",
            coordinates_beyond_all_sizes_are_refused_at_once,
        ),
        (
            "the_kernel_classifies_points_and_finds_the_nearest",
            the_kernel_classifies_points_and_finds_the_nearest,
        ),
        ("questions_fail_like_reading", questions_fail_like_reading),
        (
            "the_program_prints_the_parts_of_a_file",
            the_program_prints_the_parts_of_a_file,
        ),
        (
            "errors_are_one_line_and_exit_code_2",
            errors_are_one_line_and_exit_code_2,
        ),
        #[cfg(unix)]
        ("only_regular_files_are_read", only_regular_files_are_read),
    ];
    let trial = |(name, test): (&str, fn())| {
        Trial::test(name, move || {
            // A panic is the test's failure; libtest-mimic reports it.
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
    // Errors arrive unchanged.
    let error = load_step("no such file.step").unwrap_err();
    assert!(matches!(error, BrepError::Unreadable { .. }), "{error}");
}

/// The kernel (7.6) dereferences a null pointer when a product's shape is of an unknown type.
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
    // Newer kernels may report an error message instead.
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
    // Less than the program and its libraries use before they have read anything: the first allocation fails.
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

/// A file that takes the kernel several seconds to read.
fn slow_file() -> tempfile::TempPath {
    let mut text = StepText::millimetres();
    let solids: Vec<u64> = (1..=2500u32)
        .map(|i| text.solid_box("", DVec3::splat(f64::from(i)), true))
        .collect();
    text.part("many", &solids);
    support::file(&text.finish())
}

fn processor_time_is_limited_and_the_process_ends_with_its_parent() {
    assert_eq!(LoadOptions::default().time_limit_s, 60);
    let file = slow_file();
    let options = LoadOptions {
        time_limit_s: 1,
        ..LoadOptions::default()
    };
    let error = load_step_with(&file, &options)
        .map(|model| model.parts.len())
        .unwrap_err();
    assert!(matches!(error, BrepError::TimedOut { seconds: 1, .. }), "{error}");
    if !cfg!(target_os = "linux") {
        println!("not looked at: which processes there are is read from /proc");
        return;
    }
    let mut parent = Command::new(std::env::current_exe().unwrap())
        .env(SLOW_VARIABLE, &file as &std::path::Path)
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let children = format!("/proc/{0}/task/{0}/children", parent.id());
    let child = (0..1000)
        .find_map(|_| {
            std::thread::sleep(Duration::from_millis(2));
            let text = std::fs::read_to_string(&children).ok()?;
            text.split_whitespace().next().map(str::to_owned)
        })
        .expect("a reading process");
    // A process whose parent does not wait for it stays in the list as a zombie.
    let runs = || {
        std::fs::read_to_string(format!("/proc/{child}/stat"))
            .is_ok_and(|stat| !stat.rsplit(')').next().is_some_and(|rest| rest.starts_with(" Z")))
    };
    assert!(runs());
    // SIGKILL: no code of the parent runs after this.
    parent.kill().unwrap();
    parent.wait().unwrap();
    let killed = Instant::now();
    while runs() {
        assert!(
            killed.elapsed() < Duration::from_secs(1),
            "the reading process outlives its parent"
        );
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Goes on unless the flag is set.
fn unless(cancel: &AtomicBool) -> impl Fn(f64) -> ControlFlow<()> {
    |_| match cancel.load(Ordering::Acquire) {
        true => ControlFlow::Break(()),
        false => ControlFlow::Continue(()),
    }
}

/// Parsing, transfer and description of the shapes each have their part.
fn a_reading_reports_rising_progress() {
    let file = slow_file();
    let seen = RefCell::new(Vec::new());
    let model = load_step_while(&file, &LoadOptions::default(), &|fraction| {
        seen.borrow_mut().push(fraction);
        ControlFlow::Continue(())
    });
    let mut seen = seen.into_inner();
    assert!(seen.is_sorted(), "{seen:?}");
    assert!(seen.iter().all(|f| (0.0..=1.0).contains(f)), "{seen:?}");
    seen.dedup();
    for part in [0.05..0.2, 0.2..0.4, 0.4..1.0] {
        let within = seen.iter().filter(|&f| part.start < *f && *f < part.end);
        assert!(within.count() > 1, "{part:?} of {seen:?}");
    }
    let model = model.unwrap();
    assert_eq!(model.parts.len(), 2500);
    assert!(model.shapes.iter().all(|shape| shape.closed));
}

/// The test program's own children are identified by the name of the file they read.
fn a_reading_that_is_cancelled_leaves_no_process() {
    let file = slow_file();
    let cancel = AtomicBool::new(false);
    let (result, took) = std::thread::scope(|scope| {
        let reading = scope.spawn(|| load_step_while(&file, &LoadOptions::default(), &unless(&cancel)));
        if cfg!(target_os = "linux") {
            let started = (0..1000).any(|_| {
                std::thread::sleep(Duration::from_millis(2));
                readers_of(&file) > 0
            });
            assert!(started, "no reading process");
        } else {
            std::thread::sleep(Duration::from_millis(200));
        }
        let begun = Instant::now();
        cancel.store(true, Ordering::Release);
        (reading.join().unwrap(), begun.elapsed())
    });
    let error = result.map(|model| model.parts.len()).unwrap_err();
    assert!(matches!(error, BrepError::Cancelled { .. }), "{error}");
    assert!(took < Duration::from_secs(1), "{took:?}");
    assert_eq!(readers_of(&file), 0, "it reads on");
}

/// A wall clock ends a reading too, later; and no file here needs more memory than a machine has. So the limits are read from the system.
fn the_system_holds_the_limits_of_a_reading_process() {
    if !cfg!(target_os = "linux") {
        println!("skipped: limits are read from /proc");
        return;
    }
    let file = slow_file();
    let cancel = AtomicBool::new(false);
    let options = LoadOptions {
        time_limit_s: 7,
        ..LoadOptions::default()
    };
    let limits = std::thread::scope(|scope| {
        let reading =
            scope.spawn(|| load_step_while(&file, &options, &unless(&cancel)).map(|model| model.parts.len()));
        // The process sets them at its start; before that they are the test's own.
        let mut limits = [None, None];
        for _ in 0..500 {
            std::thread::sleep(Duration::from_millis(2));
            limits = ["Max cpu time", "Max address space"].map(|name| limit_of_reader(&file, name));
            if limits.iter().all(Option::is_some) {
                break;
            }
        }
        cancel.store(true, Ordering::Release);
        let _ = reading.join().unwrap();
        limits
    });
    assert_eq!(limits[0], Some(7), "seconds of processor time");
    let machine = std::fs::read_to_string("/proc/meminfo").unwrap();
    let total = machine
        .lines()
        .find_map(|line| line.strip_prefix("MemTotal:"))
        .unwrap();
    let kibibytes: u64 = total.trim().trim_end_matches("kB").trim().parse().unwrap();
    let memory = limits[1].expect("a limit of memory");
    assert!(memory <= (kibibytes * 1024 / 2).max(1 << 30), "{memory} bytes");
}

/// A soft limit of the process that reads this file; `None` without such a process, or when it is unlimited.
fn limit_of_reader(file: &std::path::Path, name: &str) -> Option<u64> {
    let wanted = format!("MORTISE_BREP_CHILD_PATH={}\0", file.display());
    let reader = std::fs::read_dir("/proc").ok()?.flatten().find(|process| {
        std::fs::read(process.path().join("environ"))
            .is_ok_and(|all| all.windows(wanted.len()).any(|part| part == wanted.as_bytes()))
    })?;
    let limits = std::fs::read_to_string(reader.path().join("limits")).ok()?;
    let row = limits.lines().find_map(|line| line.strip_prefix(name))?;
    row.split_whitespace().next()?.parse().ok()
}

/// Number of processes that read this file; 0 if there is no /proc.
fn readers_of(file: &std::path::Path) -> usize {
    let wanted = format!("MORTISE_BREP_CHILD_PATH={}\0", file.display());
    let processes = std::fs::read_dir("/proc").into_iter().flatten().flatten();
    processes
        .filter_map(|process| std::fs::read(process.path().join("environ")).ok())
        .filter(|environment| {
            environment
                .windows(wanted.len())
                .any(|part| part == wanted.as_bytes())
        })
        .count()
}

fn an_answer_is_limited() {
    let options = LoadOptions {
        answer_limit_bytes: 1000,
        ..LoadOptions::default()
    };
    let file = support::data("pair_d18.75_clear1.00.step");
    let error = load_step_with(file, &options)
        .map(|model| model.parts.len())
        .unwrap_err();
    assert!(matches!(error, BrepError::AnswerTooLong { .. }), "{error}");
}

/// The refusal of `text`, which must arrive within 5 s.
fn refused_at_once(text: StepText) -> BrepError {
    let file = support::file(&text.finish());
    let begun = Instant::now();
    let error = load_step(file).map(|model| model.parts.len()).unwrap_err();
    assert!(
        begun.elapsed() < Duration::from_secs(5),
        "{error}: after {:?}",
        begun.elapsed()
    );
    error
}

fn an_assembly_bomb_is_refused_at_once() {
    let mut text = StepText::millimetres();
    let solid = text.solid_box("", DVec3::splat(1.0), true);
    let mut child = text.part("leaf", &[solid]);
    for level in 0..24 {
        let parent = text.assembly(&format!("level {level}"));
        text.component("left", parent, child, DAffine3::IDENTITY);
        text.component("right", parent, child, DAffine3::from_translation(DVec3::X));
        child = parent;
    }
    let error = refused_at_once(text);
    assert!(
        matches!(
            error,
            BrepError::TooManyParts {
                found: 16_777_216,
                ..
            }
        ),
        "{error}"
    );
}

fn coordinates_beyond_all_sizes_are_refused_at_once() {
    for size in [1e308, -1e308, 1e100, 2e9] {
        let mut text = StepText::millimetres();
        let solid = text.solid_box("", DVec3::new(1.0, 1.0, size), true);
        text.part("endless", &[solid]);
        let error = refused_at_once(text);
        let words = error.to_string();
        assert!(
            words.contains("CARTESIAN_POINT has the number") && words.contains("beyond the largest"),
            "{words}"
        );
    }
}

/// The block of the pair against its closed form: 50 × 50 × 40 with a hole of 18.75.
fn the_kernel_classifies_points_and_finds_the_nearest() {
    let file = support::data("pair_d18.75_clear1.00.step");
    let options = LoadOptions::default();
    let model = load_step(&file).unwrap();
    let block = model.parts.iter().find(|p| p.name.contains("block")).unwrap();
    let center = model.shapes[block.shape].center_of_mass;
    let points: Vec<DVec3> = (0..2000u32)
        .map(|i| {
            let u = |base: f64| (f64::from(i) * base).fract() * 2.0 - 1.0;
            center + DVec3::new(u(0.819_172_5), u(0.671_043_6), u(0.549_700_5)) * 30.0
        })
        .collect();
    // Distance to the box less the cylinder; exact inside and outside near faces, a lower bound beyond edges.
    let expected = |p: DVec3| {
        let p = p - center;
        let outer = (p.abs() - DVec3::new(25.0, 25.0, 20.0)).max_element();
        outer.max(9.375 - p.truncate().length())
    };
    let sides = oracle::classify(&file, &options, block.shape, &points, 1e-6).unwrap();
    let feet = oracle::nearest(&file, &options, block.shape, &points).unwrap();
    for ((&p, side), foot) in points.iter().zip(sides).zip(feet) {
        let d = expected(p);
        assert_eq!(side, if d < 0.0 { Side::In } else { Side::Out }, "{p}: {d}");
        let foot = foot.unwrap();
        assert!((foot.point.distance(p) - foot.distance).abs() < 1e-9);
        assert!(expected(foot.point).abs() < 1e-6, "{p}");
        assert!(foot.distance > d.abs() - 1e-6, "{p}");
        if d < 0.0 {
            assert!(foot.distance < -d + 1e-6, "{p}: {} for {d}", foot.distance);
        }
    }
    let on = oracle::classify(&file, &options, block.shape, &[center + DVec3::X * 25.0], 1e-6).unwrap();
    assert_eq!(on, [Side::On]);
}

fn questions_fail_like_reading() {
    let file = support::data("pair_d18.75_clear1.00.step");
    let slow = LoadOptions {
        time_limit_s: 0,
        ..LoadOptions::default()
    };
    let points = vec![DVec3::ZERO; 100_000];
    let error = oracle::classify(&file, &slow, 0, &points, 1e-6).unwrap_err();
    assert!(matches!(error, BrepError::TimedOut { seconds: 0, .. }), "{error}");
    let error = oracle::classify(&file, &LoadOptions::default(), 2, &points, 1e-6).unwrap_err();
    assert!(
        error.to_string().contains("no shape number 2: the file has 2"),
        "{error}"
    );
    let error = oracle::nearest("no such file.step", &slow, 0, &[]).unwrap_err();
    // A child that takes any time at all exceeds this limit.
    assert!(
        matches!(error, BrepError::Unreadable { .. } | BrepError::TimedOut { .. }),
        "{error}"
    );
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

/// A pipe without a writer would be waited for without end, and a device can be endless.
#[cfg(unix)]
fn only_regular_files_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("pipe.step");
    let made = Command::new("mkfifo").arg(&pipe).status().unwrap();
    assert!(made.success());
    for file in [pipe.as_path(), "/dev/zero".as_ref()] {
        let begun = Instant::now();
        let words = load_step(file)
            .map(|model| model.parts.len())
            .unwrap_err()
            .to_string();
        assert!(words.contains("not a regular file"), "{words}");
        assert!(begun.elapsed() < Duration::from_secs(5), "{:?}", begun.elapsed());
    }
}
