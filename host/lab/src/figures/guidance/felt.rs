//! Force over time with the geometric energy (Behandish & Ilieş 2015, fig. 7) on the emulated board: missed ticks, force, overlap, vibration, approaches.

use super::super::{Plan, Row};
use super::energy::TICK_INSTRUCTIONS;
use crate::LabError;
use crate::energy::felt::{CASES, Felt, PLAY_MM, Test, Vibration, play};
use crate::energy::sections::Section;
use crate::guided::{self, SIM};
use crate::parallel::trials;

/// Time of a test, s.
const TEST_S: f64 = 20.0;
const TEST_QUICK_S: f64 = 4.0;
/// Ticks between samples of the emulated board: its states are compared with the simulation's, which reports every tick.
const EMULATED_EVERY: u16 = 100;
/// Largest overlap in the collision test, mm, the walls being pushed at with 4 N: what the paper calls alignment up to observable precision.
const OVERLAP_MM: f64 = 0.05;

/// A test of a section, simulated and on the emulated board.
struct Tested {
    simulated: Felt,
    emulated: Felt,
}

/// Measures every row.
pub(super) fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let (sections, seconds) = if plan.quick {
        (&Section::ALL[..1], TEST_QUICK_S)
    } else {
        (&Section::ALL[..], TEST_S)
    };
    let tested = trials(sections.len(), |index| {
        let section = sections[index];
        let begun = std::time::Instant::now();
        let scenes = [section.round(0.0)?.0, section.round(PLAY_MM)?.0];
        let tests = CASES.into_iter().map(|(test, clearance_mm)| {
            let followed = &scenes[usize::from(clearance_mm > 0.0)];
            let felt = |every, rig| play(followed, test, test.recordings(seconds), every, rig);
            let tested = Tested {
                simulated: felt(1, &SIM)?,
                emulated: felt(EMULATED_EVERY, &guided::emulated())?,
            };
            let row = tested.simulated.row(section.name(), clearance_mm);
            eprintln!("{:.1} s: {row}", begun.elapsed().as_secs_f64());
            Ok(tested)
        });
        tests.collect::<Result<Vec<Tested>, LabError>>()
    })?;
    for (index, (test, clearance_mm)) in CASES.into_iter().enumerate() {
        let simulated: Vec<&Felt> = tested.iter().map(|tested| &tested[index].simulated).collect();
        let emulated: Vec<&Felt> = tested.iter().map(|tested| &tested[index].emulated).collect();
        let pegs = match sections {
            [section] => format!("{} peg", section.name()),
            _ => format!("pegs of {} sections", sections.len()),
        };
        let fit = if clearance_mm > 0.0 {
            format!("with {clearance_mm} mm of play")
        } else {
            "at exact fit".to_owned()
        };
        let of = format!(
            "board's energy, {pegs} {fit}, {} test of {:.0} s, emulated",
            test.name(),
            simulated.iter().map(|felt| felt.seconds()).fold(0.0, f64::max)
        );
        rows(test, &of, [&simulated, &emulated], out);
    }
    Ok(())
}

/// The rows of a test: the worst of its sections.
fn rows(test: Test, of: &str, [simulated, emulated]: [&[&Felt]; 2], out: &mut dyn FnMut(Row)) {
    let what = |row: &str| format!("{of}: {row}");
    let worst =
        |felt: &[&Felt], of: &dyn Fn(&Felt) -> f64| felt.iter().map(|felt| of(felt)).fold(0.0, f64::max);
    let missed = worst(emulated, &|felt| f64::from(felt.missed));
    out(Row::exactly(what("missed ticks"), missed, "ticks", 0.0));
    let recordings = |felt: &[&Felt]| {
        felt.iter()
            .flat_map(|felt| felt.states.clone())
            .collect::<Vec<String>>()
    };
    let pairs = recordings(simulated).into_iter().zip(recordings(emulated));
    let differ = pairs
        .filter(|(simulated, emulated)| simulated != emulated)
        .count();
    out(Row::exactly(
        what("recordings of which a tick differs from the simulation's in a bit"),
        differ as f64,
        "recordings",
        0.0,
    ));
    let instructions = worst(emulated, &|felt| felt.instructions);
    out(Row::at_most(
        what("instructions of the longest tick"),
        instructions,
        "instructions",
        TICK_INSTRUCTIONS,
    ));
    let force = worst(emulated, &|felt| felt.peak_n);
    out(Row::reported(what("largest force at the handle"), force, "N"));
    // From here on every tick's sample is needed: those of the simulation, which are the board's.
    if test == Test::Collision {
        let overlap = worst(simulated, &|felt| felt.overlap_mm);
        out(Row::at_most(
            what("deepest overlap by the exact surfaces"),
            overlap,
            "mm",
            OVERLAP_MM,
        ));
        let aside = worst(simulated, &|felt| felt.off()[0]);
        out(Row::reported(what("farthest off the way"), aside, "mm"));
    } else {
        let counts: Vec<[usize; 3]> = simulated.iter().filter_map(|felt| felt.approaches()).collect();
        let share = |k: usize| {
            let shares = counts
                .iter()
                .map(|count| count[k] as f64 / count[0].max(1) as f64);
            shares.fold(f64::INFINITY, f64::min)
        };
        out(Row::reported(
            what("approaches that end within 0.15 mm of the way, least of a section"),
            share(1),
            "of all",
        ));
        out(Row::reported(
            what("approaches that end within 0.1 mm of the fit, least of a section"),
            share(2),
            "of all",
        ));
    }
    let vibration: Vec<Vibration> = simulated.iter().map(|felt| felt.vibration()).collect();
    let percent = vibration.iter().map(|of| of.percent).fold(0.0, f64::max);
    out(Row::reported(
        what("buzzing: energy of the force above 100 Hz, of that of all its variation"),
        percent,
        "%",
    ));
    let rms = vibration.iter().map(|of| of.rms_n).fold(0.0, f64::max);
    out(Row::reported(
        what("buzzing: root mean square of the force above 100 Hz, largest over a tenth of a second"),
        rms,
        "N",
    ));
}
