//! Whole assemblies: their sequence, its order, and what blocks the others.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use mortise_task::report::{self, Sense};
use mortise_task::{Assembly, sequence};
use serde::Deserialize;

use super::assembly_file::{load, refused};
use super::checked::{Checked, Overlap};
use super::extraction::overlaps;
use crate::LabError;
use crate::figures::{Plan, Row};

/// Samples of the repository, below `host`.
const OWN: [&str; 4] = [
    "two_pin_exact",
    "cone_in_cone",
    "ball_in_cylinder",
    "ball_in_socket",
];
/// Assemblies with a known order.
const ORDERED: [&str; 3] = ["box_with_board", "gearbox", "hinge"];
/// Assemblies by others, and others of the shared parts, with their verdicts. The rod's heads are larger than the openings of its cylinder; the ring's pins are in bores on both sides of it.
const OTHERS: [(&str, &str); 4] = [
    ("real/as1-oc-214.stp", APART),
    (
        "real/o2ac_fixture_diagonal.step",
        "_JMGPM12_20_0__ROD_11 does not leave _JMGPM12_20_0__BODY_2",
    ),
    (
        "real/dn_flex_assembly.step",
        "gimbal_ring does not leave pivot_post",
    ),
    ("05_motor/motor_flat.step", APART),
];
const APART: &str = "comes apart";
/// Time of a search, which is that of the command line without options, and the longest one, s: a verdict holds only where it is found before the time is over.
const SEARCH_S: u64 = 60;
const LONGEST_S: f64 = 60.0;

/// Steps of an assembly: parts that are put together, and those they are put onto.
type Steps<'a> = [(Vec<&'a str>, Vec<&'a str>)];

/// One constraint of an order: `first` are together no later than `then`; or one of `any` holds.
#[derive(Deserialize)]
struct Constraint {
    first: Option<[String; 2]>,
    then: Option<[String; 2]>,
    any: Option<Vec<Constraint>>,
}

#[derive(Deserialize)]
struct Order {
    constraints: Vec<Constraint>,
}

impl Constraint {
    fn is_met(&self, steps: &Steps<'_>) -> bool {
        if let Some(any) = &self.any {
            return any.iter().any(|one| one.is_met(steps));
        }
        let step = |pair: &Option<[String; 2]>| pair.as_ref().and_then(|[a, b]| together(steps, a, b));
        step(&self.first).is_some_and(|first| step(&self.then).is_some_and(|then| first <= then))
    }
}

/// The step after which two parts are together.
fn together(steps: &Steps<'_>, a: &str, b: &str) -> Option<usize> {
    let is_last = |name: &&str, part: &str| *name == part || name.ends_with(&format!("/{part}"));
    let holds = |parts: &[&str], part: &str| parts.iter().any(|name| is_last(name, part));
    steps
        .iter()
        .position(|(group, onto)| (holds(group, a) && holds(onto, b)) || (holds(group, b) && holds(onto, a)))
}

/// Sequences of the samples, each step checked.
pub(super) fn own(out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../mating/tests/data");
    let mut overlap = Overlap::default();
    let mut complete = 0;
    for name in OWN {
        let checked = Checked::load(&folder.join(format!("{name}.step")))?;
        let (found, whole) = apart(&checked.assembly);
        complete += usize::from(whole);
        for step in &found.steps {
            overlap = overlap.and(checked.overlap(&step.group, &step.onto, &step.path));
        }
    }
    let what = format!("{} samples of joints", OWN.len());
    out(Row::exactly(
        format!("{what}: taken apart"),
        complete as f64,
        "assemblies",
        OWN.len() as f64,
    ));
    overlaps(&what, overlap, out);
    Ok(())
}

fn apart(assembly: &Assembly) -> (sequence::Sequence, bool) {
    let all: Vec<usize> = (0..assembly.count()).collect();
    let found = sequence::disassemble(assembly, &all, Duration::from_secs(SEARCH_S));
    let whole = found.complete();
    (found, whole)
}

pub(super) fn measure(cad: &Path, plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let folder = cad.join("10_extraction");
    for name in ORDERED {
        let checked = Checked::load(&folder.join(format!("{name}.step")))?;
        let start = Instant::now();
        let (found, whole) = apart(&checked.assembly);
        let seconds = start.elapsed().as_secs_f64();
        let report = report::sequence(&checked.assembly, &found, Sense::Assembly);
        let steps: Vec<_> = (report.steps.iter())
            .map(|step| (step.moving.clone(), step.onto.clone()))
            .collect();
        let order = folder.join(format!("{name}.order.json"));
        let order = read_order(&order)?;
        let met = order.constraints.iter().filter(|one| one.is_met(&steps)).count();
        out(Row::same(
            format!("{name}: comes apart"),
            if whole { "yes" } else { "no" },
            "yes",
        ));
        out(Row::exactly(
            format!("{name}: constraints of its order met"),
            met as f64,
            "constraints",
            order.constraints.len() as f64,
        ));
        out(plan.timed(format!("{name}: time to its sequence"), seconds, LONGEST_S));
        let overlap = (found.steps.iter())
            .map(|step| checked.overlap(&step.group, &step.onto, &step.path))
            .fold(Overlap::default(), Overlap::and);
        overlaps(name, overlap, out);
    }
    for (file, expected) in OTHERS {
        let path = cad.join(file);
        if !path.is_file() {
            out(Row::skipped(file, "the file is not there"));
            continue;
        }
        let assembly = load(&path)?;
        let start = Instant::now();
        let (found, whole) = apart(&assembly);
        let seconds = start.elapsed().as_secs_f64();
        let stuck = found.stuck.iter().map(|(_, blocked)| {
            let [a, b] = blocked.pair.map(|part| assembly.name(part));
            format!("{a} does not leave {b}")
        });
        let stuck = stuck.collect::<Vec<_>>().join(", ");
        let verdict = match (whole, found.timed_out) {
            (true, _) => APART.to_owned(),
            (false, true) => format!("time ran out; {stuck}"),
            (false, false) => stuck,
        };
        out(Row::same(
            format!("{file}, {} parts: verdict", assembly.count()),
            &verdict,
            expected,
        ));
        out(plan.timed(format!("{file}: time to its sequence"), seconds, LONGEST_S));
    }
    Ok(())
}

fn read_order(path: &PathBuf) -> Result<Order, LabError> {
    let text = std::fs::read_to_string(path).map_err(|source| LabError::Unreadable {
        path: path.clone(),
        source,
    })?;
    serde_json::from_str(&text).map_err(|error| refused(path, &error))
}
