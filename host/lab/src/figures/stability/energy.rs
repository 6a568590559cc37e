//! What the whole chain makes of nothing, in every closed-loop scenario there is.

use mortise_rig::RigSpec;
use tempfile::NamedTempFile;

use crate::LabError;
use crate::figures::{Plan, Row};
use crate::fit::Fit;
use crate::scenario::{Scenario, run};

/// Most net energy at the handle, mJ, and of what passed, %.
const MADE_MJ: f64 = 1.0;
const MADE_PERCENT: f64 = 1.0;

macro_rules! scenarios {
    ($($name:literal),+) => {
        &[$(($name, include_str!(concat!("../../../../../hil-tests/scenarios/", $name, ".toml")))),+]
    };
}

/// Every scenario of the bench.
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
/// A minute long: left out of the shorter form.
const LONG: &str = "load";

pub(super) fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let simulated = RigSpec::Simulated { realtime: false };
    let tight: NamedTempFile = Fit::thesis(0.02).engaged(-20.0).file()?;
    for &(name, text) in SCENARIOS {
        if plan.quick && name == LONG {
            out(Row::noted(
                format!("{name}: energy at the handle"),
                "left out of the shorter form",
            ));
            continue;
        }
        let mut scenario = Scenario::parse(text, name)?;
        let guided = name == "guided_fit";
        scenario.scene.step = if guided { tight.path() } else { plan.pair }.to_owned();
        // Every tick: what a held force does between two poses is then exact.
        scenario.run.telemetry_every_ticks = 1;
        let outcome = run(&scenario, &simulated)?;
        let what = format!("scenario {name}, every tick");
        out(Row::at_most(
            format!("{what}: net energy made at the handle"),
            outcome.energy_given_mj,
            "mJ",
            MADE_MJ,
        ));
        out(Row::at_most(
            format!("{what}: of the {:.3} mJ that passed", outcome.energy_passed_mj),
            100.0 * outcome.energy_given_mj / outcome.energy_passed_mj,
            "%",
            MADE_PERCENT,
        ));
        out(Row::at_most(
            format!("{what}: net energy that contacts made at the object"),
            outcome.contact_given_mj,
            "mJ",
            MADE_MJ,
        ));
    }
    Ok(())
}
