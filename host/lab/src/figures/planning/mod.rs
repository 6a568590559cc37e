//! Planning: the smallest image for an accuracy, in bounded time, and what it states against what is measured.

mod hundreds;

use std::collections::HashMap;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Mutex;
use std::time::Instant;

use glam::{DQuat, DVec3};
use mortise_bake::{BakeError, Cache, ELSEWHERE, Grabbable, NoCache, Planned, Request, plan_with};
use mortise_brep::{CadModel, load_step};
use mortise_scenario::ScenarioError;
use mortise_scenario::probe::{NamedPose, ProbeScene, Resolution};

use super::{Plan, Row};
use crate::fit::Fit;
use crate::scene_p::median;
use crate::{LabError, corpus, scene_p};

const ABSENT: &str = "the shared parts are not there; set MORTISE_SHARED to their folder";
/// Accuracies of scene P, µm, and the most bytes at each.
const SCENE_P: [(f64, f64); 2] = [(5.0, 32.0 * 1024.0), (20.0, 20.0 * 1024.0)];
const MOTOR: &str = "05_motor/motor_nested.step";
/// Bounds of the motor at 10 µm: bytes, and seconds without and with the results of an earlier plan.
const MOTOR_BYTES: f64 = 192.0 * 1024.0;
const MOTOR_COLD_S: f64 = 10.0;
const MOTOR_AGAIN_S: f64 = 0.5;
/// Longest planning time of any file, s.
const LONGEST_S: f64 = 60.0;
/// Error in fits that counts as playable, mm.
const PLAYABLE_MM: f64 = 0.02;
/// Files of the shorter form, bytes at most.
const SMALL_BYTES: u64 = 80 << 10;
/// Random fits, and poses of each, in the full and in the shorter form.
const FITS: usize = 200;
const FITS_QUICK: usize = 20;
const POSES: usize = 60;
/// Error that a position in single precision has in any case, µm: smaller errors are taken for this.
const ROUNDING_UM: f64 = 0.05;

/// Measures every row.
pub(super) fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    scene_p(out)?;
    random_fits(plan, out)?;
    motor(plan, out)?;
    hundreds::measure(plan, out)?;
    real_files(plan, out)
}

/// Scene P: bytes, and the measured error against the stated one.
fn scene_p(out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let file = scene_p::file()?;
    let model = load_step(file.path())?;
    for (accuracy_um, most_bytes) in SCENE_P {
        let request = Request {
            accuracy_mm: 1e-3 * accuracy_um,
            grabbable: Grabbable::All,
            ..Request::default()
        };
        let planned = planned(file.path(), &model, &request, &NoCache)?;
        let what_of = |what: &str| format!("scene P planned at {accuracy_um} µm: {what}");
        out(Row::at_most(
            what_of("image"),
            planned.image.len() as f64,
            "bytes",
            most_bytes,
        ));
        // Parallel in the hole with the gap still open, and all other poses.
        let (fitted, others): (Vec<_>, Vec<_>) = (scene_p::cases().into_iter())
            .map(|case| (case.pose, case.exact_mm))
            .partition(|(pose, exact_mm)| pose.name.contains("aside at") && *exact_mm >= 0.0);
        let plan = &planned.plan;
        for (place, cases, stated_mm, most_um) in [
            ("in the hole", fitted, plan.error_in_fits_mm(), accuracy_um),
            (
                "elsewhere",
                others,
                plan.error_elsewhere_mm(),
                ELSEWHERE * accuracy_um,
            ),
        ] {
            let what = |what: &str| what_of(&format!("{place}: {what}"));
            let found = 1e3 * largest_error_mm(&model, &planned, ["peg", "block"], &cases)?;
            out(Row::at_most(what("largest error measured"), found, "µm", most_um));
            let ratio = stated_over(1e3 * stated_mm, found);
            out(Row::within(
                what("stated error over the measured one"),
                ratio,
                "",
                1.0,
                f64::INFINITY,
            ));
        }
    }
    Ok(())
}

/// Pegs of random size in holes: the stated error of gaps against the measured one.
fn random_fits(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let count = if plan.quick { FITS_QUICK } else { FITS };
    let mut ratios = Vec::new();
    for seed in 0..count as u64 {
        ratios.push(stated_over_measured(seed)?);
    }
    let what = |what: &str| format!("{count} random pegs in holes, {POSES} poses each: {what}");
    let least = ratios.iter().copied().fold(f64::INFINITY, f64::min);
    out(Row::within(
        what("least ratio of stated to measured error"),
        least,
        "",
        1.0,
        f64::INFINITY,
    ));
    out(Row::at_most(
        what("median ratio of stated to measured error"),
        median(ratios.into_iter()),
        "",
        2.0,
    ));
    Ok(())
}

fn stated_over_measured(seed: u64) -> Result<f64, LabError> {
    let mut random = fastrand::Rng::with_seed(seed);
    let mut within = |low: f64, high: f64| low + (high - low) * random.f64();
    let hole = within(6.0, 40.0);
    let clearance = 0.02 * 20f64.powf(within(0.0, 1.0));
    let fit = Fit {
        width_mm: hole + within(8.0, 30.0),
        height_mm: within(10.0, 50.0),
        hole_mm: hole,
        peg_mm: hole - clearance,
        length_mm: within(20.0, 80.0),
        engaged_mm: 1.0,
    };
    let accuracy_mm = 2e-3 * 25f64.powf(within(0.0, 1.0));
    let file = fit.file()?;
    let model = load_step(file.path())?;
    let request = Request {
        accuracy_mm,
        grabbable: Grabbable::All,
        ..Request::default()
    };
    let planned = planned(file.path(), &model, &request, &NoCache)?;
    let cases: Vec<(NamedPose, f64)> = (0..POSES)
        .map(|index| {
            // Half the diametral clearance is the gap of a centred peg.
            let (by, angle) = (within(0.0, 0.5 * clearance), within(0.0, std::f64::consts::TAU));
            let up = 0.5 * fit.height_mm + fit.length_mm;
            let pose = NamedPose {
                name: index.to_string(),
                position_mm: DVec3::new(by * angle.cos(), by * angle.sin(), up),
                // The peg's frame is at its upper end and points downwards; the block's is in its lower face.
                orientation: DQuat::from_rotation_x(std::f64::consts::PI),
            };
            (pose, 0.5 * clearance - by)
        })
        .collect();
    let found = 1e3 * largest_error_mm(&model, &planned, ["peg", "block"], &cases)?;
    Ok(stated_over(1e3 * planned.plan.error_in_fits_mm(), found))
}

/// Ratio of a stated to a measured error, µm, neither of them less than rounding.
fn stated_over(stated_um: f64, found_um: f64) -> f64 {
    stated_um.max(ROUNDING_UM) / found_um.max(ROUNDING_UM)
}

/// The motor of 18 parts, planned twice with the same cache.
fn motor(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let Some(cad) = corpus::folder() else {
        out(Row::skipped("motor of 18 parts, planned at 10 µm", ABSENT));
        return Ok(());
    };
    let path = cad.join(MOTOR);
    let model = load_step(&path)?;
    let kept = InMemory::default();
    let request = Request::default();
    let start = Instant::now();
    let first = planned(&path, &model, &request, &kept)?;
    let cold = start.elapsed().as_secs_f64();
    let start = Instant::now();
    planned(&path, &model, &request, &kept)?;
    let again = start.elapsed().as_secs_f64();
    let what = |what: &str| format!("motor of {} parts, planned at 10 µm: {what}", model.parts.len());
    out(Row::at_most(
        what("image"),
        first.image.len() as f64,
        "bytes",
        MOTOR_BYTES,
    ));
    out(Row::same(
        what("the accuracy is met"),
        if first.met { "yes" } else { "no" },
        "yes",
    ));
    out(plan.timed(what("time without a cache"), cold, MOTOR_COLD_S));
    out(plan.timed(what("time when nothing changed"), again, MOTOR_AGAIN_S));
    Ok(())
}

/// Every readable real file, planned by default.
fn real_files(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let of = if plan.quick {
        "readable real files, the small ones, planned by default"
    } else {
        "readable real files, planned by default"
    };
    let Some(cad) = corpus::folder() else {
        out(Row::skipped(of, ABSENT));
        return Ok(());
    };
    let (mut readable, mut playable, mut refused, mut longest) = (0, 0, 0, 0.0f64);
    let request = Request::default();
    for path in corpus::step_files(&cad.join("real"))? {
        let small = path.metadata().is_ok_and(|data| data.len() <= SMALL_BYTES);
        if plan.quick && !small {
            continue;
        }
        let Ok(model) = load_step(&path) else { continue };
        readable += 1;
        let start = Instant::now();
        let found = plan_with(&model, &request, &NoCache, &|_| ControlFlow::Continue(()));
        longest = longest.max(start.elapsed().as_secs_f64());
        let text = match found {
            Ok(planned) => {
                refused += usize::from(!planned.fits);
                playable += usize::from(planned.fits && planned.plan.error_in_fits_mm() <= PLAYABLE_MM);
                planned.reached(&request)
            }
            Err(error) => {
                refused += 1;
                error.to_string()
            }
        };
        eprintln!("{}: {text}", path.display());
    }
    out(Row::within(
        format!("{of}: at most 20 µm in fits"),
        f64::from(playable as u32),
        &format!("of {readable} files"),
        f64::from(readable - readable / 14),
        f64::from(readable),
    ));
    out(Row::exactly(
        format!("{of}: refused"),
        refused as f64,
        "files",
        0.0,
    ));
    out(Row::at_most(format!("{of}: longest planning time"), longest, "s", LONGEST_S).varies());
    Ok(())
}

fn planned(step: &Path, model: &CadModel, request: &Request, cache: &dyn Cache) -> Result<Planned, LabError> {
    let refused = |source: BakeError| ScenarioError::Bake {
        step: step.display().to_string(),
        source,
    };
    Ok(plan_with(model, request, cache, &|_| ControlFlow::Continue(())).map_err(refused)?)
}

/// Largest error of the image's distances between two parts, mm; where the image gives a bound only, what exceeds it.
fn largest_error_mm(
    model: &CadModel,
    planned: &Planned,
    [moving, fixed]: [&str; 2],
    cases: &[(NamedPose, f64)],
) -> Result<f64, LabError> {
    let names = planned.plan.report.parts.iter().map(|part| part.name.clone());
    let scene = ProbeScene::of_image(model.unit.clone(), &planned.image, names.collect());
    let pair = scene.pair(moving, Some(fixed))?;
    let mut worst = 0.0f64;
    for (pose, exact_mm) in cases {
        let row = scene.probe(pair, pose)?;
        let off = row.distance_mm - exact_mm;
        let error = match (row.resolution == Resolution::Bound, *exact_mm >= 0.0) {
            (true, true) => off.max(0.0),
            (true, false) => (-off).max(0.0),
            (false, _) => off.abs(),
        };
        worst = worst.max(error);
    }
    Ok(worst)
}

/// A cache that lasts as long as the measurement.
#[derive(Default)]
struct InMemory(Mutex<HashMap<String, Vec<u8>>>);

impl Cache for InMemory {
    fn get(&self, name: &str) -> Option<Vec<u8>> {
        self.0.lock().ok()?.get(name).cloned()
    }

    fn put(&self, name: &str, bytes: &[u8]) {
        if let Ok(mut kept) = self.0.lock() {
            kept.insert(name.to_owned(), bytes.to_vec());
        }
    }
}
