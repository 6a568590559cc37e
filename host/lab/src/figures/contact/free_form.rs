//! Gap and penetration errors of fits at a planned accuracy, and what the probe calls exact, against true distances.

use std::ops::ControlFlow;
use std::path::Path;

use mortise_bake::{BakeOptions, Grabbable, Planned, Request};
use mortise_brep::load_step;
use mortise_scenario::probe::{NamedPose, ProbeScene};
use mortise_scenario::{Body, ScenarioError};

use super::convex_pairs::placed;
use super::errors::Errors;
use super::limits::ABSENT;
use crate::corpus::truths::{TrueCase, TruePair, true_pairs};
use crate::figures::{Plan, Row};
use crate::least_distance::least_distance_mm;
use crate::parallel::trials;
use crate::{LabError, corpus, scene_p};

/// Planned accuracy, mm.
const ACCURACY_MM: f64 = 5e-3;
/// Cells of which exact answers are judged, mm.
const CELLS_MM: [f64; 5] = [0.5, 1.0, 2.0, 4.0, 8.0];
const CELLS_QUICK_MM: [f64; 2] = [2.0, 8.0];
/// Pairs of the shorter form: every kind of face, few bytes.
const QUICK: [&str; 5] = [
    "bars_s05",
    "dovetail",
    "keyed_shaft",
    "loft_peg_c0.10",
    "torus_ring",
];

/// Names of pairs of convex solids begin so.
const CONVEX: [&str; 3] = ["bars", "plate", "wedges"];
/// Of the poses searched in the shorter form one of so many.
const SEARCHED_QUICK: usize = 6;

fn shared(plan: &Plan<'_>) -> Result<Option<Vec<TruePair>>, LabError> {
    let Some(cad) = corpus::folder() else {
        return Ok(None);
    };
    let mut pairs = true_pairs(&cad)?;
    pairs.retain(|pair| !plan.quick || QUICK.contains(&pair.name.as_str()));
    Ok(Some(pairs))
}

/// Errors of the shared pairs at the planned accuracy.
pub(super) fn planned(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let what = format!(
        "shared pairs with true distances, planned at {} µm",
        1e3 * ACCURACY_MM
    );
    let Some(pairs) = shared(plan)? else {
        out(Row::skipped(what, ABSENT));
        return Ok(());
    };
    let all = trials(pairs.len(), |index| {
        let pair = &pairs[index];
        let (scene, stated_mm) = plan_pair(&pair.step)?;
        let errors = ask(&scene, pair, stated_mm)?;
        eprintln!(
            "{}: {} bytes, {:.2} µm stated, gap {:.2} µm{}, depth {:.2} µm{}, {} ghosts",
            pair.name,
            scene.image_bytes(),
            1e3 * stated_mm,
            1e3 * errors.gap.mm,
            errors.gap.remark(),
            1e3 * errors.depth.mm,
            errors.depth.remark(),
            errors.ghosts
        );
        Ok(errors)
    })?;
    let what = format!("{} {what}", pairs.len());
    Errors::of(all).planned_rows(&what, out);
    Ok(())
}

/// The file planned and baked, and the largest error that its plan states between the two parts, mm: in fits where it found any. A plan that is not met
/// is measured as it stands.
pub(super) fn plan_pair(step: &Path) -> Result<(ProbeScene, f64), LabError> {
    let model = load_step(step)?;
    let request = Request {
        accuracy_mm: ACCURACY_MM,
        flash_bytes: BakeOptions::default().image_limit_bytes,
        tick_instructions: None,
        grabbable: Grabbable::All,
    };
    let name = step.display().to_string();
    let planned = mortise_bake::plan(&model, &request, &|_| ControlFlow::Continue(())).map_err(|source| {
        ScenarioError::Bake {
            step: name.clone(),
            source,
        }
    })?;
    let stated_mm = stated_mm(&planned);
    let parts = planned
        .plan
        .report
        .parts
        .into_iter()
        .map(|part| part.name)
        .collect();
    Ok((ProbeScene::of_image(name, &planned.image, parts), stated_mm))
}

fn stated_mm(planned: &Planned) -> f64 {
    let shapes = &planned.plan.shapes;
    let most = |of: fn(&mortise_bake::ShapePlan) -> f64| shapes.iter().map(of).fold(0.0, f64::max);
    if shapes.iter().any(|shape| !shape.faces_that_fit.is_empty()) {
        // One part's shell in the other's field.
        most(|shape| shape.field_error_in_fits_mm) + most(|shape| shape.shell_error_in_fits_mm)
    } else {
        most(|shape| shape.error_elsewhere_mm)
    }
}

/// Probes every case.
pub(super) fn ask(scene: &ProbeScene, of: &TruePair, stated_mm: f64) -> Result<Errors, LabError> {
    let [moving, fixed] = of.parts;
    let pair = scene.pair(moving, Some(fixed))?;
    let poses: Vec<NamedPose> = of.cases.iter().map(|case| case.pose.clone()).collect();
    let rows = scene.probe_all(pair, &poses)?;
    let mut errors = Errors::default();
    for (case, row) in of.cases.iter().zip(&rows) {
        errors.see(&of.name, case.distance_mm, case.error_mm, stated_mm, row);
    }
    Ok(errors)
}

/// What the probe calls exact, at every cell.
pub(super) fn exact(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let pairs = shared(plan)?;
    if pairs.is_none() {
        out(Row::skipped(
            "exact answers on the shared pairs with true distances",
            ABSENT,
        ));
    }
    let mut pairs = pairs.unwrap_or_default();
    let scene_p = scene_p::file()?;
    pairs.push(TruePair {
        name: "scene P".into(),
        parts: ["peg", "block"],
        step: scene_p.path().to_owned(),
        cases: (scene_p::cases().into_iter())
            .map(|case| TrueCase {
                pose: case.pose,
                distance_mm: case.exact_mm,
                error_mm: 0.0,
            })
            .collect(),
    });
    let cells: &[f64] = if plan.quick { &CELLS_QUICK_MM } else { &CELLS_MM };
    for &cell in cells {
        let all = trials(pairs.len(), |index| {
            let pair = &pairs[index];
            let scene = ProbeScene::load(&pair.step, Some(cell))?;
            let errors = ask(&scene, pair, f64::INFINITY)?;
            eprintln!(
                "{}, {cell} mm cells: {} of {} called exact, {} off by over 1 µm, worst {:.1} µm{}; {} ghosts",
                pair.name,
                errors.exact,
                errors.poses,
                errors.inexact,
                1e3 * errors.worst_exact.mm,
                errors.worst_exact.remark(),
                errors.ghosts
            );
            Ok(errors)
        })?;
        let errors = Errors::of(all);
        let what = |what: &str| {
            format!(
                "{} pairs with true distances, {cell} mm cells, {} poses: {what}",
                pairs.len(),
                errors.poses
            )
        };
        let worst = format!(
            "called exact and off by over 1 µm (worst {:.1} µm{})",
            1e3 * errors.worst_exact.mm,
            errors.worst_exact.remark()
        );
        out(Row::exactly(what(&worst), errors.inexact as f64, "poses", 0.0));
        out(Row::exactly(
            what("contact reported where they are over 5 µm apart"),
            errors.ghosts as f64,
            "poses",
            0.0,
        ));
        out(Row::reported(
            what("called exact"),
            100.0 * errors.exact as f64 / errors.poses as f64,
            "%",
        ));
    }
    Ok(())
}

/// The search that gives the truth of random fits, against the true distances of the shared ones.
pub(super) fn search(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let what = "search on the exact surfaces, of shared fits with true distances: largest error";
    let Some(mut pairs) = shared(plan)? else {
        out(Row::skipped(what, ABSENT));
        return Ok(());
    };
    // Truths of convex pairs are least translations, not depths of points.
    pairs.retain(|pair| !CONVEX.iter().any(|kind| pair.name.starts_with(kind)));
    let errors = trials(pairs.len(), |index| {
        let pair = &pairs[index];
        let model = load_step(&pair.step)?;
        let part = |name: &str| model.parts.iter().position(|part| part.name == name).unwrap_or(0);
        let [moving, fixed] = pair.parts.map(|name| Body::of(&model, part(name)));
        let step = if plan.quick { SEARCHED_QUICK } else { 1 };
        let error = (pair.cases.iter().step_by(step))
            .map(|case| {
                let found = least_distance_mm(&fixed, &moving, &placed(&case.pose));
                ((found - case.distance_mm).abs() - case.error_mm).max(0.0)
            })
            .fold(0.0, f64::max);
        eprintln!("{}: search off by {:.3} µm", pair.name, 1e3 * error);
        Ok(error)
    })?;
    let worst = errors.into_iter().fold(0.0, f64::max);
    out(Row::at_most(what, 1e3 * worst, "µm", 1.0));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A key in its slot: the slot is narrower than a cell, and the search of the exact surfaces uses up its budget.
    #[test]
    fn a_keyed_shaft_errs_by_no_more_than_its_plan_states() {
        let Some(cad) = corpus::folder() else {
            eprintln!("skipped: {ABSENT}");
            return;
        };
        let pairs = true_pairs(&cad).expect("the shared pairs can be read");
        for pair in pairs
            .iter()
            .filter(|pair| ["keyed_shaft", "dovetail"].contains(&pair.name.as_str()))
        {
            let (scene, stated_mm) = plan_pair(&pair.step).expect("it is planned");
            let errors = ask(&scene, pair, stated_mm).expect("it is probed");
            assert_eq!(
                (errors.unstated, errors.ghosts),
                (0, 0),
                "{}: {errors:?}",
                pair.name
            );
        }
    }
}
