//! Assemblies put together by a simulated hand with contact, step by step: on the emulated board, and by hands that are off in random directions.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Duration;

use glam::DVec3;
use mortise_bake::{Grabbable, Planned, Request};
use mortise_rig::{Client, RigSpec};
use mortise_scenario::ScenarioError;
use mortise_scenario::insertions::{AssemblyScene, Inserted, Manner, play_insertions};
use mortise_task::insertion::{Insertion, insertions};
use mortise_task::{Assembly, sequence};

use super::assembly_file::{load, refused};
use crate::figures::Row;
use crate::guided::{SIM, emulated};
use crate::{LabError, generated};

const MOTOR: &str = "05_motor/motor_flat.step";
/// Tasks of extraction and whole assemblies with a way or an order. The leaves of the hinge come together with their bushes.
const OTHERS: [&str; 13] = [
    "10_extraction/bent_tube.step",
    "10_extraction/box_with_board.step",
    "10_extraction/cross_pin.step",
    "10_extraction/flange_l_passage.step",
    "10_extraction/gear_housing.step",
    "10_extraction/gearbox.step",
    "10_extraction/hinge.step",
    "10_extraction/keyhole_loose_30um.step",
    "10_extraction/lock_maze.step",
    "10_extraction/ring_hook.step",
    "10_extraction/tbolt_slot.step",
    "10_extraction/ubolt_plate.step",
    "real/as1-oc-214.stp",
];
/// Hands that put the motor together, each off in a direction of its own.
const HANDS: usize = 10;
const SEED: u64 = 18;
/// Time of a search, s.
const SEARCH_S: u64 = 240;
/// Largest force on the handle, N.
const FORCE_N: f64 = 10.0;
/// Parts of each row that may catch at the first attempt.
const CAUGHT: f64 = 1.0;
/// Instructions that a tick may take: 480 MHz for a millisecond.
const INSTRUCTIONS: f64 = 480e3;

/// An assembly that is ready to be played.
struct Ready {
    assembly: Assembly,
    steps: Vec<Insertion>,
    planned: Planned,
}

impl Ready {
    fn new(file: &Path, assembly: Assembly) -> Result<Self, LabError> {
        let all: Vec<usize> = (0..assembly.count()).collect();
        let found = sequence::disassemble(&assembly, &all, Duration::from_secs(SEARCH_S));
        let steps = insertions(&assembly, &found);
        let request = Request {
            grabbable: Grabbable::All,
            ..Request::default()
        };
        let planned = mortise_bake::plan(&assembly.model, &request, &|_| ControlFlow::Continue(()));
        let planned = planned.map_err(|source| ScenarioError::Bake {
            step: file.display().to_string(),
            source,
        })?;
        Ok(Self {
            assembly,
            steps,
            planned,
        })
    }

    fn play(&self, rig: &RigSpec, manner: &Manner) -> Result<Vec<Inserted>, LabError> {
        let scene = AssemblyScene {
            model: &self.assembly.model,
            image: &self.planned.image,
            report: &self.planned.plan.report,
        };
        let client = Client::connect_with_scene(&rig.lockstep(), scene.image)?;
        let mut played = Vec::new();
        play_insertions(&client, &scene, &self.steps, manner, &mut |inserted| {
            if !inserted.in_place || !inserted.caught.is_empty() {
                eprintln!("{}", inserted.words());
            }
            played.push(inserted);
        })?;
        Ok(played)
    }
}

/// The generated assembly of the repository.
pub(super) fn own(out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let count = generated::parts(true);
    let file = generated::file(count)?;
    let model = mortise_brep::load_step(file.path())?;
    let assembly = Assembly::new(model).map_err(|error| refused(file.path(), &error))?;
    let ready = Ready::new(file.path(), assembly)?;
    let what = format!("generated assembly of {count} parts played by a simulated hand");
    rows(&what, &ready.play(&SIM, &Manner::default())?, count - 1, out);
    Ok(())
}

/// The shared motor, and the other assemblies.
pub(super) fn measure(cad: &Path, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let file = cad.join(MOTOR);
    let ready = Ready::new(&file, load(&file)?)?;
    let count = ready.assembly.count();
    let what = format!("motor of {count} parts played by a simulated hand on the emulated board");
    let played = ready.play(&emulated(), &Manner::default())?;
    rows(&what, &played, count - 1, out);
    let missed: u32 = played.iter().map(|inserted| inserted.missed_ticks).sum();
    out(Row::exactly(
        format!("{what}: missed ticks"),
        f64::from(missed),
        "ticks",
        0.0,
    ));
    let longest = played.iter().map(|inserted| inserted.cost_max).max().unwrap_or(0);
    out(Row::at_most(
        format!("{what}: instructions in the longest tick"),
        f64::from(longest),
        "instructions",
        INSTRUCTIONS,
    ));
    let same = |a: &Inserted, b: &Inserted| {
        *a == Inserted {
            cost_max: a.cost_max,
            ..b.clone()
        }
    };
    let on_pc = ready.play(&SIM, &Manner::default())?;
    let differ = played.iter().zip(&on_pc).filter(|(a, b)| !same(a, b)).count();
    out(Row::exactly(
        format!("{what}: insertions with another result in-process"),
        differ as f64,
        "insertions",
        0.0,
    ));

    let mut random = fastrand::Rng::with_seed(SEED);
    let mut hands = Vec::new();
    for _ in 0..HANDS {
        let mut component = || random.f64() * 2.0 - 1.0;
        let manner = Manner {
            off_to: DVec3::new(component(), component(), component()),
            ..Manner::default()
        };
        hands.extend(ready.play(&SIM, &manner)?);
    }
    let what = format!("motor of {count} parts played by {HANDS} hands off in random directions");
    rows(&what, &hands, HANDS * (count - 1), out);
    caught(&what, &hands, out);

    let (mut others, mut wanted) = (Vec::new(), 0);
    for name in OTHERS {
        let file = cad.join(name);
        let ready = Ready::new(&file, load(&file)?)?;
        wanted += ready.assembly.count() - 1;
        others.extend(ready.play(&SIM, &Manner::default())?);
    }
    let what = format!("{} other assemblies and tasks of extraction played", OTHERS.len());
    rows(&what, &others, wanted, out);
    caught(&what, &others, out);
    Ok(())
}

/// How many parts went in, and the largest force.
fn rows(what: &str, played: &[Inserted], wanted: usize, out: &mut dyn FnMut(Row)) {
    let put_in = played.iter().filter(|inserted| inserted.in_place).count();
    out(Row::exactly(
        format!("{what}: parts put in"),
        put_in as f64,
        "parts",
        wanted as f64,
    ));
    let force = (played.iter()).fold(0.0, |most: f64, inserted| most.max(inserted.peak.force_n));
    out(Row::at_most(
        format!("{what}: largest force on the handle"),
        force,
        "N",
        FORCE_N,
    ));
}

/// Parts that went in at a later attempt only.
fn caught(what: &str, played: &[Inserted], out: &mut dyn FnMut(Row)) {
    let caught = played
        .iter()
        .filter(|inserted| !inserted.caught.is_empty())
        .count();
    out(Row::at_most(
        format!("{what}: parts that caught at the first attempt"),
        caught as f64,
        "parts",
        CAUGHT,
    ));
}
