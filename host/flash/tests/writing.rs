//! Writing firmware through a simulated probe, with every fault, and reading files that are no firmware.
#![cfg(unix)]

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use mortise_flash::simulated::{self, Fault, SimulatedProbe};
use mortise_flash::{Firmware, FlashError, Prober};
use mortise_protocol::label::Label;

const LABEL: Label = Label::new("some-board", "STM32H743ZITx");

fn kept(folder: &Path, bytes: &[u8]) -> PathBuf {
    let path = folder.join("--erase all.elf");
    std::fs::write(&path, bytes).expect("written");
    path
}

/// Writes with a fault; returns the result, the lines said, and the flash of the board.
fn write(fault: Fault) -> (Result<(), FlashError>, Vec<String>, Option<Vec<u8>>, String) {
    let folder = tempfile::tempdir().expect("a folder");
    let file = kept(folder.path(), &simulated::firmware(&LABEL));
    let probe = SimulatedProbe::new(folder.path(), fault).expect("a probe");
    let prober = probe.prober().with_silence(Duration::from_millis(500));
    let firmware = Firmware::read(&file).expect("firmware");
    let mut lines = Vec::new();
    let result = prober.choose(None).and_then(|chosen| {
        prober.write(
            &firmware,
            &chosen,
            &mut |line| lines.push(line.to_owned()),
            &mut || false,
        )
    });
    (result, lines, probe.flash(), probe.calls())
}

#[test]
fn firmware_is_written_read_back_and_started() {
    let (result, lines, flash, calls) = write(Fault::None);
    result.expect("written");
    assert_eq!(lines, ["Erasing", "Programming", "Verifying", "Finished in 5.2s"]);
    assert_eq!(flash, Some(simulated::firmware(&LABEL)));
    let calls: Vec<&str> = calls.lines().collect();
    let selector = "--chip STM32H743ZITx --probe 0483:374b:066FFF485550755187121723";
    assert_eq!(calls[0], "list");
    let download = format!("download --non-interactive --disable-progressbars --verify {selector} -- ");
    assert!(calls[1].starts_with(&download), "{}", calls[1]);
    assert_eq!(calls[2], format!("reset --non-interactive {selector}"));
}

#[test]
fn each_fault_is_named_and_says_what_to_do() {
    for fault in Fault::ALL {
        let (result, _, flash, _) = write(fault);
        let expected: &[&str] = match fault {
            Fault::None => &[],
            Fault::Unplugged => &["no debug probe is found", "ST-LINK"],
            Fault::Forbidden => &["may not be used by you", "udev"],
            Fault::Two => &[
                "several debug probes",
                "--probe",
                "J-Link (1366:0101:000123456789)",
            ],
            Fault::Unpowered => &["did not respond", "power", "motors stay off"],
            Fault::Pulled => &["USB Communication Error", "cable", "motors stay off"],
            Fault::Worn => &["verification failed", "motors stay off"],
            Fault::Silent => &["said nothing for", "motors stay off"],
            Fault::Unlisted => &["no USB bus", "nothing was written"],
            Fault::NotReset => &["is written and read back", "reset timed out", "reset button"],
        };
        let said = result.err().map(|error| error.to_string()).unwrap_or_default();
        assert_eq!(said.is_empty(), expected.is_empty(), "{fault:?}: {said}");
        for words in expected {
            assert!(said.contains(words), "{fault:?}: {said}");
        }
        // Nothing is written before a probe is chosen.
        let written = matches!(fault, Fault::None | Fault::Pulled | Fault::Worn | Fault::NotReset);
        assert_eq!(flash.is_some(), written, "{fault:?}");
    }
}

#[test]
fn one_of_several_probes_is_chosen_by_its_name() {
    let folder = tempfile::tempdir().expect("a folder");
    let prober = SimulatedProbe::new(folder.path(), Fault::Two)
        .expect("a probe")
        .prober();
    for (wanted, name) in [
        ("1366", "J-Link"),
        ("0483:374b", "STLink V2-1"),
        ("187121723", "STLink V2-1"),
    ] {
        assert_eq!(prober.choose(Some(wanted)).expect("chosen").name, name);
    }
    for wanted in ["", "9999"] {
        let refused = prober.choose(Some(wanted)).expect_err("none");
        assert!(matches!(refused, FlashError::NoSuchProbe { .. }), "{refused}");
        assert!(refused.to_string().contains("J-Link"), "{refused}");
    }
}

#[test]
fn the_operator_ends_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = kept(folder.path(), &simulated::firmware(&LABEL));
    let prober = SimulatedProbe::new(folder.path(), Fault::Silent)
        .expect("a probe")
        .prober();
    let firmware = Firmware::read(&file).expect("firmware");
    let probe = prober.choose(None).expect("a probe");
    let begun = Instant::now();
    let result = prober.write(&firmware, &probe, &mut |_| {}, &mut || {
        begun.elapsed() > Duration::from_millis(300)
    });
    assert!(matches!(result, Err(FlashError::Cancelled)), "{result:?}");
    assert!(begun.elapsed() < Duration::from_secs(10));
}

#[test]
fn a_missing_program_is_an_error() {
    let missing = Prober::at(PathBuf::from("/no/such/probe-rs"));
    assert!(matches!(missing.probes(), Err(FlashError::NotStarted { .. })));
}

#[test]
fn files_that_are_no_firmware_are_refused_with_the_reason() {
    let folder = tempfile::tempdir().expect("a folder");
    let read = |bytes: &[u8]| {
        let error = Firmware::read(&kept(folder.path(), bytes)).expect_err("refused");
        error.to_string()
    };
    let good = simulated::firmware(&LABEL);
    assert!(read(b"").contains("not an ELF file"));
    assert!(read(b"ISO-10303-21;").contains("not an ELF file"));
    let mut other = good.clone();
    other[18] = 62;
    assert!(read(&other).contains("another processor"), "{}", read(&other));
    let at = |text: &[u8]| {
        good.windows(text.len())
            .position(|bytes| bytes == text)
            .expect("there")
    };
    let mut unlabelled = good.clone();
    unlabelled[at(b"MORTISE_FIRMWARE")] = b'X';
    assert!(read(&unlabelled).contains("no label"));
    let mut damaged = good.clone();
    damaged[at(b"mortise1")] = b'X';
    assert!(read(&damaged).contains("damaged"));
    let mut another = good.clone();
    another[at(b"mortise1") + 8] ^= 1;
    assert!(read(&another).contains("another protocol"), "{}", read(&another));
    let missing = Firmware::read(&folder.path().join("missing")).expect_err("refused");
    assert!(matches!(missing, FlashError::Unreadable { .. }));
    let unreadable = Firmware::read(folder.path()).expect_err("refused");
    assert!(
        matches!(unreadable, FlashError::Unreadable { .. }),
        "{unreadable}"
    );
}

/// Cut anywhere, and with any byte changed: refused or read, never a crash, and no name that is an option.
#[test]
fn damaged_files_never_crash() {
    let folder = tempfile::tempdir().expect("a folder");
    let good = simulated::firmware(&LABEL);
    let mut random = fastrand::Rng::with_seed(7);
    for round in 0..500 {
        let mut bytes = good.clone();
        for _ in 0..random.usize(1..4) {
            let at = random.usize(..bytes.len());
            bytes[at] = random.u8(..);
        }
        if round % 3 == 0 {
            bytes.truncate(random.usize(..good.len()));
        }
        if let Ok(firmware) = Firmware::read(&kept(folder.path(), &bytes)) {
            assert!(firmware.chip().starts_with(|c: char| c.is_ascii_alphanumeric()));
        }
    }
}
