//! Results of a run of the steps: times, numbers of tests, and the closing line.

use std::time::Duration;

use anyhow::Result;

/// Tests counted from what cargo and libtest-mimic print.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Tests that ran and passed.
    pub passed: u64,
    /// Tests that ran and failed.
    pub failed: u64,
    /// Tests that were not run.
    pub ignored: u64,
}

impl Counts {
    /// Adds one line of output: `test result: ok. 3 passed; 0 failed; 1 ignored; …`.
    pub fn add_line(&mut self, line: &str) {
        let Some(rest) = line.trim().strip_prefix("test result: ") else {
            return;
        };
        for part in rest.split(['.', ';']) {
            let mut words = part.split_whitespace();
            let Some(number) = words.next().and_then(|word| word.parse::<u64>().ok()) else {
                continue;
            };
            match words.next() {
                Some("passed") => self.passed += number,
                Some("failed") => self.failed += number,
                Some("ignored") => self.ignored += number,
                _ => {}
            }
        }
    }

    fn add(&mut self, other: Self) {
        self.passed += other.passed;
        self.failed += other.failed;
        self.ignored += other.ignored;
    }
}

struct Entry {
    name: &'static str,
    took: Duration,
    counts: Counts,
    outcome: Result<String>,
}

/// The steps run so far.
#[derive(Default)]
pub struct Report {
    entries: Vec<Entry>,
}

impl Report {
    /// Adds a finished step with its tests and its remark, if any.
    pub fn add(&mut self, name: &'static str, took: Duration, counts: Counts, outcome: Result<String>) {
        self.entries.push(Entry {
            name,
            took,
            counts,
            outcome,
        });
    }

    /// Steps run.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// True if a step failed.
    pub fn failed(&self) -> bool {
        self.entries.iter().any(|entry| entry.outcome.is_err())
    }

    /// The summary; `not_run` lists the steps after the failing one.
    pub fn text(&self, not_run: &[&str]) -> String {
        let mut text = format!("\n{:<12} {:>11}  result\n", "step", "time");
        let mut total = Duration::ZERO;
        let mut counts = Counts::default();
        for entry in &self.entries {
            total += entry.took;
            counts.add(entry.counts);
            let Counts { passed, ignored, .. } = entry.counts;
            let result = match &entry.outcome {
                Ok(note) => {
                    let mut words = vec!["ok".to_owned()];
                    if passed + ignored > 0 {
                        words.push(format!("{passed} tests, {ignored} ignored"));
                    }
                    words.extend(Some(note.clone()).filter(|note| !note.is_empty()));
                    words.join(", ")
                }
                Err(error) => format!("FAILED: {error:#}"),
            };
            text.push_str(&format!(
                "{:<12} {:>11}  {result}\n",
                entry.name,
                clock(entry.took)
            ));
        }
        for name in not_run {
            text.push_str(&format!("{name:<12} {:>11}  not run\n", "-"));
        }
        text.push_str(&format!("{:<12} {:>11}\n\n", "all", clock(total)));
        // Worded like cargo's own closing line, which log-reading tools recognise.
        text.push_str(&format!(
            "test result: {}. {} passed; {} failed; {} ignored; 0 measured; 0 filtered out; finished in {:.2}s\n",
            if self.failed() { "FAILED" } else { "ok" },
            counts.passed,
            counts.failed,
            counts.ignored,
            total.as_secs_f64()
        ));
        text
    }
}

fn clock(took: Duration) -> String {
    let seconds = took.as_secs();
    format!("{} min {:02} s", seconds / 60, seconds % 60)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_come_from_result_lines_alone() {
        let mut counts = Counts::default();
        for line in [
            "running 3 tests",
            "test a::b ... ok",
            "test result: ok. 2 passed; 0 failed; 1 ignored; 0 measured; 0 filtered out; finished in 0.05s",
            "",
            "test result: FAILED. 4 passed; 5 failed; 6 ignored; 0 measured; 0 filtered out; finished in 1.10s",
        ] {
            counts.add_line(line);
        }
        assert_eq!(
            counts,
            Counts {
                passed: 6,
                failed: 5,
                ignored: 7
            }
        );
    }

    #[test]
    fn the_report_names_what_failed_and_what_was_not_run() {
        let mut report = Report::default();
        let unit = Counts {
            passed: 41,
            failed: 0,
            ignored: 2,
        };
        report.add("unit", Duration::from_secs(61), unit, Ok("fine".into()));
        assert!(!report.failed());
        let hil = Counts {
            passed: 1,
            failed: 3,
            ignored: 0,
        };
        report.add(
            "hil",
            Duration::from_secs(2),
            hil,
            Err(anyhow::anyhow!("no QEMU").context("step `hil`")),
        );
        let text = report.text(&["docs"]);
        assert!(
            text.contains("unit          1 min 01 s  ok, 41 tests, 2 ignored, fine"),
            "{text}"
        );
        assert!(text.contains("FAILED: step `hil`: no QEMU"), "{text}");
        assert!(text.contains("docs                   -  not run"), "{text}");
        assert!(text.ends_with("test result: FAILED. 42 passed; 3 failed; 2 ignored; 0 measured; 0 filtered out; finished in 63.00s\n"), "{text}");
    }
}
