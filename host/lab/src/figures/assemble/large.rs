//! A generated assembly of hundreds of parts: time to open it, to its graph and to its sequence, and memory.

use std::time::{Duration, Instant};

use mortise_task::graph::graph;
use mortise_task::{Assembly, sequence};

use super::assembly_file::refused;
use crate::figures::{Plan, Row};
use crate::{LabError, generated};

/// Longest times, s, and most memory, MiB.
const OPEN_S: f64 = 10.0;
const GRAPH_S: f64 = 10.0;
const SEQUENCE_S: f64 = 300.0;
const MEMORY_MIB: f64 = 4096.0;

/// Measures the rows.
pub(super) fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let count = generated::parts(plan.quick);
    let what = format!("generated assembly of {count} parts");
    let file = generated::file(count)?;
    let begun = reset_peak();

    let start = Instant::now();
    let model = mortise_brep::load_step(file.path())?;
    let seconds = start.elapsed().as_secs_f64();
    out(plan.timed(format!("{what}: time to open it"), seconds, OPEN_S));

    let start = Instant::now();
    let assembly = Assembly::new(model).map_err(|error| refused(file.path(), &error))?;
    let graph = graph(&assembly);
    let seconds = start.elapsed().as_secs_f64();
    out(plan.timed(format!("{what}: time to its connection graph"), seconds, GRAPH_S));
    out(Row::exactly(
        format!("{what}: connections"),
        graph.edge_count() as f64,
        "connections",
        generated::connections(count) as f64,
    ));

    let start = Instant::now();
    let all: Vec<usize> = (0..assembly.count()).collect();
    let found = sequence::disassemble(&assembly, &all, Duration::from_secs_f64(SEQUENCE_S));
    let seconds = start.elapsed().as_secs_f64();
    out(plan.timed(format!("{what}: time to its sequence"), seconds, SEQUENCE_S));
    let whole = found.complete() && found.steps.iter().all(|step| step.measured);
    out(Row::same(
        format!("{what}: comes apart, every step measured"),
        if whole { "yes" } else { "no" },
        "yes",
    ));
    out(Row::exactly(
        format!("{what}: washers that leave from between a bolt and its part"),
        through_bolts(&assembly, &found) as f64,
        "washers",
        0.0,
    ));
    if begun {
        let peak = peak_mib().unwrap_or(f64::NAN);
        let what = format!("{what}: largest memory of the program");
        out(Row::at_most(what, peak, "MiB", MEMORY_MIB).varies());
    }
    Ok(())
}

/// Number of washers that were taken out while the bolt and the part between which they lie were both in place.
fn through_bolts(assembly: &Assembly, found: &sequence::Sequence) -> usize {
    let is = |part: usize, kind: &str| assembly.name(part).contains(kind);
    let washers = (0..assembly.count()).filter(|&part| is(part, "washer"));
    let taken = |washer: usize| {
        let beside: Vec<usize> = (assembly.contacts.iter())
            .filter(|contact| contact.parts.contains(&washer))
            .flat_map(|contact| contact.parts)
            .filter(|&part| part != washer)
            .collect();
        found.steps.iter().any(|step| {
            let stays = |bolt: bool| {
                let mut of_kind = beside.iter().filter(|&&part| is(part, "bolt") == bolt);
                of_kind.any(|part| step.onto.contains(part))
            };
            step.group.contains(&washer) && stays(true) && stays(false)
        })
    };
    washers.filter(|&washer| taken(washer)).count()
}

/// Sets the largest resident memory of this program to the present one; whether the operating system does that.
fn reset_peak() -> bool {
    std::fs::write("/proc/self/clear_refs", "5").is_ok() && peak_mib().is_some()
}

/// Largest resident memory of this program, MiB.
fn peak_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kib: f64 = line.split_whitespace().next()?.parse().ok()?;
    Some(kib / 1024.0)
}
