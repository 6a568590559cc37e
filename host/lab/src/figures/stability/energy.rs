//! Energy that the whole chain generates, in every closed-loop scenario.

use std::path::Path;

use mortise_rig::RigSpec;
use mortise_scenario::{Outcome, Scenario, run};
use tempfile::NamedTempFile;

use crate::LabError;
use crate::figures::{Plan, Row};
use crate::fit::Fit;
use crate::stability::lapses;

/// Largest energy generated at the handle over any interval, mJ, and as a share of the energy passed, %.
const MADE_MJ: f64 = 1.0;
const MADE_PERCENT: f64 = 1.0;

macro_rules! scenarios {
    ($($name:literal),+) => {
        &[$(($name, include_str!(concat!("../../../../../hil-tests/scenarios/", $name, ".toml")))),+]
    };
}

/// Every scenario of the bench but the guided one.
const SCENARIOS: &[(&str, &str)] = scenarios!(
    "insertion",
    "guided_fit",
    "press_flat_1n",
    "press_flat_3n",
    "press_flat_5n",
    "press_wall_1n",
    "press_wall_3n",
    "press_wall_5n",
    "load"
);
/// The scenario with targets and a fit of its own.
const GUIDED: &str = "guided_fit";
/// The scenario of a minute: omitted in the shorter form.
const LONG: &str = "load";

pub(super) fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let tight: NamedTempFile = Fit::thesis(0.02).engaged(-20.0).file()?;
    for &(name, text) in SCENARIOS {
        if plan.quick && name == LONG {
            out(Row::noted(
                format!("{name}: energy at the handle"),
                "left out of the shorter form",
            ));
            continue;
        }
        let guided = name == GUIDED;
        let outcome = play(name, text, if guided { tight.path() } else { plan.pair })?;
        let what = format!("scenario {name}, every tick");
        // Readings are not accurate enough: their rounding generates more energy than some scenarios may.
        let exact = if outcome.energy_exact { 1.0 } else { f64::NAN };
        out(Row::at_most(
            format!("{what}: energy made at the handle over any interval"),
            exact * outcome.energy_given_mj,
            "mJ",
            MADE_MJ,
        ));
        out(Row::at_most(
            format!("{what}: of the {:.3} mJ that passed", outcome.energy_passed_mj),
            exact * 100.0 * outcome.energy_given_mj / outcome.energy_passed_mj,
            "%",
            MADE_PERCENT,
        ));
        out(Row::at_most(
            format!("{what}: energy that contacts made at the object over any interval"),
            outcome.contact_given_mj,
            "mJ",
            MADE_MJ,
        ));
        out(Row::at_most(
            format!("{what}: energy that contacts and targets together made at the object over any interval"),
            outcome.constraint_given_mj,
            "mJ",
            MADE_MJ,
        ));
    }
    lapses::sweep(true, &mut |held| {
        let what = format!(
            "peg held 1 mm and 2° off at rest, {}, {:.0} % of refreshes lost",
            held.case,
            100.0 * held.lost
        );
        out(Row::at_most(
            format!("{what}: energy made at the handle over any interval since the grab"),
            held.handle_made_mj,
            "mJ",
            MADE_MJ,
        ));
        out(Row::at_most(
            format!("{what}: of the {:.3} mJ that passed", held.handle_passed_mj),
            100.0 * held.handle_made_mj / held.handle_passed_mj,
            "%",
            MADE_PERCENT,
        ));
    })?;
    Ok(())
}

fn play(name: &str, text: &str, step: &Path) -> Result<Outcome, LabError> {
    let mut scenario = Scenario::parse(text, name)?;
    scenario.scene.step = step.to_owned();
    // With telemetry each tick the handle's true motion is known, and so is the work that a held force does on it.
    scenario.run.telemetry_every_ticks = 1;
    Ok(run(&scenario, &RigSpec::Simulated { realtime: false })?)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The presses that pass the least energy, where a constant error weighs most: the ramp after the grab generated an eleventh of it while it
    /// scaled the wrench.
    #[test]
    fn what_passes_little_makes_little() {
        let pair = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../app/samples/pair_d18.75_clear1.00.step"
        );
        for (name, text) in SCENARIOS.iter().filter(|(name, _)| name.starts_with("press")) {
            let made = play(name, text, Path::new(pair)).expect("played");
            let (given, passed) = (made.energy_given_mj, made.energy_passed_mj);
            println!(
                "{name}: {given} mJ of {passed} mJ, contacts {} mJ",
                made.contact_given_mj
            );
            assert!(made.energy_exact, "{name}: the replay went another way");
            assert!(passed > 0.1, "{name}: nothing passed");
            assert!(
                given <= 1e-2 * MADE_PERCENT * passed,
                "{name}: {given} of {passed} mJ"
            );
        }
    }

    /// A target that engages a part beside its axis supplies the energy of its pull. The observer must see that energy, and no more may appear.
    #[test]
    fn targets_are_seen_at_the_object_and_give_little() {
        let tight = Fit::thesis(0.02).engaged(-20.0).file().expect("written");
        let guided = SCENARIOS.iter().find(|(name, _)| *name == GUIDED);
        let (name, text) = guided.expect("among the scenarios");
        let made = play(name, text, tight.path()).expect("played");
        let (contacts, both) = (made.contact_given_mj, made.constraint_given_mj);
        println!("{name}: contacts {contacts} mJ, with targets {both} mJ");
        assert!(
            both > contacts + 0.1,
            "targets pulled the part onto its axis: {both} mJ"
        );
        assert!(both <= MADE_MJ, "{both} mJ");
    }
}
