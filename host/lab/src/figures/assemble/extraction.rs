//! Tasks of extraction, several runs each, and pairs that stay together.

use std::path::Path;
use std::time::{Duration, Instant};

use mortise_task::removal::{Budget, Removal, remove};

use super::assembly_file::load;
use super::channels::Channel;
use super::checked::{Checked, Overlap};
use crate::LabError;
use crate::figures::{Plan, Row};
use crate::scene_p::median;

/// Tasks with a way out.
const TASKS: [&str; 9] = [
    "tbolt_slot",
    "ring_hook",
    "ubolt_plate",
    "cross_pin",
    "gear_housing",
    "flange_l_passage",
    "lock_maze",
    "bent_tube",
    "keyhole_loose_30um",
];
/// Pairs without one; by how much they overlap at the least, µm, and the least that is worth a proof.
const LOCKED: [(&str, f64, f64); 3] = [
    ("keyhole_locked_30um", 15.0, 14.5),
    ("ring_on_dumbbell", 500.0, 490.0),
    ("linked_rings", 6000.0, 2900.0),
];
/// Runs of each task in the full and in the shorter form, and how many of their ways are checked.
const RUNS: u64 = 10;
const RUNS_QUICK: u64 = 2;
const CHECKED: u64 = 1;
/// Time of one run, and the longest median time, s.
const RUN_S: u64 = 240;
const MEDIAN_S: f64 = 10.0;
/// Largest overlap on a way, µm.
const OVERLAP_UM: f64 = 10.0;

/// Channels of the repository's own, by their seeds.
const CHANNELS: [u64; 8] = [1, 2, 3, 4, 5, 6, 7, 8];

/// What runs of tasks came to.
#[derive(Default)]
struct Runs {
    found: u32,
    overlap: Overlap,
}

impl Runs {
    /// Takes part 1 out of part 0, and measures the time.
    fn run(&mut self, name: &str, checked: &Checked, plan: &Plan<'_>, out: &mut dyn FnMut(Row)) {
        let runs = runs(plan);
        let mut times = Vec::new();
        for seed in 0..runs {
            let start = Instant::now();
            let budget = Budget {
                seed,
                ..Budget::lasting(Duration::from_secs(RUN_S))
            };
            let removal = remove(&checked.assembly, &[1], &[0], &[], &budget);
            times.push(start.elapsed().as_secs_f64());
            if let Removal::Out(path) = removal {
                self.found += 1;
                if seed < CHECKED {
                    self.overlap = self.overlap.and(checked.overlap(&[1], &[0], &path));
                }
            } else {
                eprintln!("{name}, seed {seed}: {removal:?}");
            }
        }
        let what = format!("{name}, {runs} runs: median time to a way out");
        out(plan.timed(what, median(times.into_iter()), MEDIAN_S));
    }

    fn rows(self, what: &str, tasks: usize, plan: &Plan<'_>, out: &mut dyn FnMut(Row)) {
        let runs = runs(plan);
        let what = format!("{tasks} {what}, {runs} runs each");
        out(Row::exactly(
            format!("{what}: ways found"),
            f64::from(self.found),
            "ways",
            tasks as f64 * runs as f64,
        ));
        overlaps(&what, self.overlap, out);
    }
}

fn runs(plan: &Plan<'_>) -> u64 {
    if plan.quick { RUNS_QUICK } else { RUNS }
}

/// The repository's own tasks.
pub(super) fn own(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let mut runs = Runs::default();
    for seed in CHANNELS {
        let channel = Channel::random(seed);
        let file = channel.file()?;
        let name = format!("spool in channel {seed} with {} bends", channel.bends());
        runs.run(&name, &Checked::load(file.path())?, plan, out);
    }
    runs.rows("generated tasks of extraction", CHANNELS.len(), plan, out);
    Ok(())
}

pub(super) fn measure(cad: &Path, plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let folder = cad.join("10_extraction");
    let mut runs = Runs::default();
    for name in TASKS {
        let checked = Checked::load(&folder.join(format!("{name}.step")))?;
        runs.run(name, &checked, plan, out);
    }
    runs.rows("tasks of extraction", TASKS.len(), plan, out);
    for (name, held_um, least_um) in LOCKED {
        let assembly = load(&folder.join(format!("{name}.step")))?;
        let start = Instant::now();
        let budget = Budget::lasting(Duration::from_secs(RUN_S));
        let removal = remove(&assembly, &[1], &[0], &[], &budget);
        let proved_um = match removal {
            Removal::Blocked(blocked) if blocked.proof.is_some() && blocked.pair == [1, 0] => {
                blocked.overlap_mm.map_or(0.0, |mm| 1e3 * mm)
            }
            _ => 0.0,
        };
        out(Row::within(
            format!("{name}: overlap proved to be needed, of {held_um} µm"),
            proved_um,
            "µm",
            least_um,
            held_um,
        ));
        let what = format!("{name}: time to the proof");
        out(plan.timed(what, start.elapsed().as_secs_f64(), MEDIAN_S));
    }
    Ok(())
}

/// The rows of ways that were checked.
pub(super) fn overlaps(what: &str, overlap: Overlap, out: &mut dyn FnMut(Row)) {
    let row = |by: &str, mm: f64| {
        let what = format!("{what}: overlap on the ways checked by {by}");
        Row::at_most(what, 1e3 * mm, "µm", OVERLAP_UM)
    };
    out(row("fine meshes, every 0.1 mm", overlap.meshes_mm));
    out(row("the exact distance, every 10 µm", overlap.exact_mm));
    out(Row::within(
        format!("{what}: ways checked"),
        overlap.ways as f64,
        "ways",
        1.0,
        f64::INFINITY,
    ));
}
