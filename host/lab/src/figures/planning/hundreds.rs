//! A generated assembly of hundreds of parts, planned for the board, and parts of every kind held and moved in it.

use std::path::Path;
use std::time::Instant;

use mortise_bake::{Grabbable, Request};
use mortise_brep::load_step;
use mortise_scenario::{PreparedScene, Scenario, connect_with_scene, run_on};

use super::super::{Plan, Row};
use crate::guided::{self, key};
use crate::{LabError, generated};

/// Seed by which parts are drawn.
const DRAW: u64 = 19;
/// Parts of each kind that are held.
const EACH: usize = 2;
const EACH_QUICK: usize = 1;
/// Longest times to open the file and to plan its image, s.
const OPEN_S: f64 = 10.0;
const BAKE_S: f64 = 60.0;
/// Instructions of a tick.
const TICK: f64 = 120_000.0;
/// The hand pulls by this, mm, out and back along each axis, at this speed, mm/s.
const PULL_MM: f64 = 6.0;
const MM_PER_S: f64 = 20.0;

/// Measures the rows.
pub(super) fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let count = generated::parts(plan.quick);
    let each = if plan.quick { EACH_QUICK } else { EACH };
    let what = |what: &str| format!("generated assembly of {count} parts, planned by default: {what}");
    let file = generated::file(count)?;
    let begun = Instant::now();
    let model = load_step(file.path())?;
    let opened = begun.elapsed().as_secs_f64();
    let names: Vec<String> = model.parts.iter().map(|part| part.name.clone()).collect();
    let request = Request {
        grabbable: Grabbable::All,
        ..Request::default()
    };
    let begun = Instant::now();
    let mut scene = PreparedScene::plan(file.path(), model, &names[0], &request)?;
    let baked = begun.elapsed().as_secs_f64();
    for (of, seconds, most) in [
        ("time to open it", opened, OPEN_S),
        ("time to plan it", baked, BAKE_S),
    ] {
        out(plan.timed(what(of), seconds, most));
    }
    out(Row::at_most(
        what("image"),
        scene.image.len() as f64,
        "bytes",
        request.flash_bytes as f64,
    ));
    let held = chosen(&names, each);
    let mut seen = Vec::new();
    for name in &held {
        seen.push(pulled(file.path(), &mut scene, name)?);
    }
    let what = |of: &str| {
        what(&format!(
            "{} parts of all kinds held and pulled to and fro by {PULL_MM} mm at {MM_PER_S} mm/s, emulated board: {of}",
            held.len()
        ))
    };
    let longest = seen.iter().map(|seen| seen.0).fold(0.0, f64::max);
    out(Row::at_most(
        what("instructions in the longest tick"),
        longest,
        "instructions",
        TICK,
    ));
    let missed: u32 = seen.iter().map(|seen| seen.1).sum();
    out(Row::exactly(
        what("missed ticks"),
        f64::from(missed),
        "ticks",
        0.0,
    ));
    Ok(())
}

/// Some parts of every kind: names are the kind and a number.
fn chosen(names: &[String], each: usize) -> Vec<String> {
    let mut random = fastrand::Rng::with_seed(DRAW);
    let kind = |name: &str| name.trim_end_matches(|c: char| c.is_ascii_digit()).to_owned();
    let mut kinds: Vec<String> = names.iter().map(|name| kind(name)).collect();
    kinds.sort();
    kinds.dedup();
    let mut all = Vec::new();
    for of in kinds {
        let mut parts: Vec<String> = names.iter().filter(|name| kind(name) == of).cloned().collect();
        random.shuffle(&mut parts);
        all.extend(parts.into_iter().take(each));
    }
    all
}

/// Longest tick in instructions, and the number of missed ticks, while a part is pulled along each axis from its place.
fn pulled(step: &Path, scene: &mut PreparedScene, name: &str) -> Result<(f64, u32), LabError> {
    let mut scenario = Scenario::insertion(step)?;
    scenario.scene.part = name.to_owned();
    scenario.depth = None;
    // Few samples: their overlap is not what is measured here.
    scenario.run.telemetry_every_ticks = 300;
    let part = scene.part_named(name).ok_or_else(|| LabError::Input {
        name: name.to_owned(),
        what: "is not in the image".to_owned(),
    })?;
    scene.part = part as u16;
    let body = &scene.bodies()[part];
    scenario.hand.grip_mm = body.placement.transform_point3(body.center).to_array();
    scenario.hand.keyframes.clear();
    let mut t = 0.0;
    let mut go = |offset: [f64; 3]| {
        scenario.hand.keyframes.push(key(t, offset, [0.0; 3]));
        t += PULL_MM / MM_PER_S;
    };
    go([0.0; 3]);
    // Up first: what lies on top or stands in a hole leaves it.
    for offset in [
        [0.0, 0.0, PULL_MM],
        [PULL_MM, 0.0, 0.0],
        [-PULL_MM, 0.0, 0.0],
        [0.0, PULL_MM, 0.0],
    ] {
        go(offset);
        go([0.0; 3]);
    }
    scenario.run.duration_s = t;
    let client = connect_with_scene(&scenario, &guided::emulated(), scene)?;
    let outcome = run_on(&client, &scenario, scene)?;
    let longest = outcome.instructions_per_tick_max.map_or(f64::NAN, f64::from);
    eprintln!("{name}: {longest} instructions, {} missed", outcome.missed_ticks);
    Ok((longest, outcome.missed_ticks))
}
