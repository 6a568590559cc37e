//! Insertion along a way: shared shapes, random ones, and random starts, with and without the way held.

use mortise_shapes::{Designed, KINDS};

use super::super::{Plan, Row};
use crate::LabError;
use crate::corpus;
use crate::followed::{Followed, Help, Off, Seen, off};
use crate::guided::{self, SIM};
use crate::parallel::trials;

/// The hand at the mouth: aside, mm, and turned, degrees; its tremor is the scenario's, 0.2 mm.
const ASIDE_MM: f64 = 1.0;
const TURN_DEG: f64 = 3.0;
/// Largest distance from the way, mm, and angle, mrad, once held.
const OFF_MM: f64 = 5e-3;
const OFF_MRAD: f64 = 0.5;
/// Largest overlap of the exact surfaces, mm: the allowance that contact makes for guided faces while a part is drawn to its way.
const OVERLAP_MM: f64 = 0.1;
/// Shared pairs, beside what they are.
const SHARED: [(&str, &str); 8] = [
    ("square_taper", "tapered square"),
    ("keyed_shaft", "keyed shaft"),
    ("dovetail", "dovetail"),
    ("tslot_nut", "T-slot"),
    ("loft_peg_c0.02", "lobed loft, 0.02 mm"),
    ("loft_peg_c0.10", "lobed loft, 0.10 mm"),
    ("spline_gear9", "gear of splines"),
    ("ellipsoid_socket", "ellipsoid"),
];
/// Plugs that are put in from many starts, and the seed of the first one: a polygonal one.
const PLUGS: usize = 5;
const FIRST_PLUG: u64 = 3;
/// Random pairs of each kind, and starts of each pair.
const EACH: u64 = 5;
const STARTS: usize = 100;
const STARTS_QUICK: usize = 4;

/// The shapes, each from one start, simulated and on the emulated board.
pub(super) fn shared_shapes(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let Some(folder) = corpus::folder() else {
        out(Row::skipped(
            "shared shapes inserted along their ways",
            "the folder `shared` is absent",
        ));
        return Ok(());
    };
    // Free forms take up to a minute each to plan.
    let (shared, emulated) = if plan.quick {
        (&SHARED[..4], 1)
    } else {
        (&SHARED[..], SHARED.len())
    };
    let seen = trials(shared.len(), |index| {
        let (name, _) = shared[index];
        let step = folder.join("09_free_form").join(format!("{name}.step"));
        let begun = std::time::Instant::now();
        let followed = Followed::new(&step, ["moving", "fixed"])?;
        let start = off(&mut fastrand::Rng::with_seed(index as u64), ASIDE_MM, TURN_DEG);
        let mut all = vec![followed.insert(&start, Help::Way, &SIM)?];
        if index < emulated {
            all.push(followed.insert(&start, Help::Way, &guided::emulated())?);
        }
        eprintln!("{name}, {:.1} s: {all:?}", begun.elapsed().as_secs_f64());
        Ok(all)
    })?;
    for ((_, what), seen) in shared.iter().zip(&seen) {
        for (seen, rig) in seen.iter().zip(["sim", "emulated"]) {
            rows(&format!("{what}, {rig}"), std::slice::from_ref(seen), out);
        }
    }
    Ok(())
}

/// Random members of every kind of pair.
pub(super) fn random_shapes(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let each = if plan.quick { 1 } else { EACH };
    let count = each * KINDS as u64;
    let seen = trials(count as usize, |index| {
        let (seed, designed) = with_play(index as u64);
        let file = guided::file(&designed.text())?;
        let followed = Followed::new(file.path(), ["moving", "fixed"])?;
        let start = off(&mut fastrand::Rng::with_seed(seed), ASIDE_MM, TURN_DEG);
        let seen = followed.insert(&start, Help::Way, &SIM)?;
        eprintln!(
            "{seed} {}, clearance {:.3} mm: {seen:?}",
            designed.kind, designed.clearance
        );
        Ok(seen)
    })?;
    rows(
        &format!("{count} random pairs of {KINDS} kinds, 0.02 to 0.1 mm, sim"),
        &seen,
        out,
    );
    Ok(())
}

/// The pair of a seed, or another one of its kind that has play: some tapered pegs have none.
fn with_play(seed: u64) -> (u64, Designed) {
    let mut seed = seed;
    loop {
        let designed = Designed::random(seed);
        if designed.clearance > 0.0 {
            return (seed, designed);
        }
        // Over all kinds, past the seeds of other pairs.
        seed += 101 * KINDS as u64;
    }
}

/// Polygonal plugs from many starts, with contact alone, with their energy and with their way held.
pub(super) fn starts(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let count = if plan.quick { STARTS_QUICK } else { STARTS };
    // Of one kind, so that the starts are alike, but not one plug: whether contact or an energy lets it slip in is a matter of its corners.
    let plugs = trials(PLUGS, |index| {
        let (_, designed) = with_play(FIRST_PLUG + index as u64 * KINDS as u64);
        let file = guided::file(&designed.text())?;
        let followed = Followed::new(file.path(), ["moving", "fixed"])?;
        Ok(followed.with_energy()?.0)
    })?;
    let helps = [
        (Help::Nothing, "contact alone"),
        (Help::Energy, "its energy alone"),
        (Help::Way, "its way held"),
    ];
    for (help, how) in helps {
        let seen = trials(count, |index| {
            let mut random = fastrand::Rng::with_seed(index as u64);
            let (aside, turn) = (ASIDE_MM * random.f64(), TURN_DEG * random.f64());
            let start: Off = off(&mut random, aside, turn);
            plugs[index % PLUGS].insert(&start, help, &SIM)
        })?;
        let what = |what: &str| {
            format!(
                "{PLUGS} polygonal plugs, 0.02 to 0.1 mm, {count} starts up to {ASIDE_MM} mm and {TURN_DEG}° off, {how}: {what}"
            )
        };
        let inserted = seen.iter().filter(|seen| seen.is_in).count() as f64;
        match help {
            Help::Nothing | Help::Energy => out(Row::reported(what("inserted"), inserted, "starts")),
            Help::Way => out(Row::exactly(what("inserted"), inserted, "starts", count as f64)),
        }
        let mut times: Vec<f64> = seen
            .iter()
            .map(|seen| seen.after_s)
            .filter(|t| t.is_finite())
            .collect();
        times.sort_by(f64::total_cmp);
        if let Some(median) = times.get(times.len() / 2) {
            out(Row::reported(what("median time to insert"), *median, "s"));
        }
        let peak = seen.iter().map(|seen| seen.peak_n).fold(0.0, f64::max);
        out(Row::reported(what("largest force"), peak, "N"));
    }
    Ok(())
}

/// The rows of some insertions with the way held.
fn rows(what: &str, seen: &[Seen], out: &mut dyn FnMut(Row)) {
    let largest = |of: fn(&Seen) -> f64| {
        seen.iter().map(of).fold(0.0, |a: f64, b| {
            if a.is_nan() || b.is_nan() {
                f64::NAN
            } else {
                a.max(b)
            }
        })
    };
    let what = |row: &str| {
        format!("{what}, along its way, hand {ASIDE_MM} mm and {TURN_DEG}° off at the mouth: {row}")
    };
    let inserted = seen.iter().filter(|seen| seen.is_in).count() as f64;
    out(Row::exactly(
        what("inserted"),
        inserted,
        "of those tried",
        seen.len() as f64,
    ));
    out(Row::at_most(
        what("off the way once held"),
        largest(|seen| seen.off_mm),
        "mm",
        OFF_MM,
    ));
    let angle = 1e3 * largest(|seen| seen.off_rad);
    out(Row::at_most(
        what("turned off it once held"),
        angle,
        "mrad",
        OFF_MRAD,
    ));
    out(Row::at_most(
        what("deepest overlap"),
        largest(|seen| seen.overlap_mm),
        "mm",
        OVERLAP_MM,
    ));
    out(Row::exactly(
        what("missed ticks"),
        largest(|seen| f64::from(seen.missed)),
        "ticks",
        0.0,
    ));
}
