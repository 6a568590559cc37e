//! Ghost contacts: shared assemblies as designed, every near pair of parts probed in place, against the exact surfaces.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::{DAffine3, DQuat};
use mortise_brep::{CadModel, load_step};
use mortise_scenario::probe::ProbeScene;
use mortise_scenario::{Body, ScenarioError};

use super::convex_pairs::{placed, rounded};
use super::limits::ABSENT;
use crate::figures::{Plan, Row};
use crate::least_distance::least_distance_mm;
use crate::parallel::trials;
use crate::{LabError, corpus};

/// Distance above which parts are clear of each other, and below whose negative they overlap as designed, mm.
const CLEAR_MM: f64 = 1e-3;
/// Largest error of a depth, mm.
const DEPTH_MM: f64 = 0.01;
/// Files of the shorter form: fits and joints of every kind, few parts.
const QUICK: [&str; 3] = [
    "06_joints/ball_in_socket.step",
    "06_joints/two_pin_assembled.step",
    "08_hard/pair_clear0.10_nurbs.step",
];

/// Answers on one file.
#[derive(Clone, Copy, Debug, Default)]
struct Found {
    assemblies: usize,
    /// Files that were refused, and parts without surface.
    refused: usize,
    pairs: usize,
    /// Contact reported of pairs that are clear.
    ghosts: usize,
    /// Depths reported that exceed the true ones.
    too_deep: usize,
    /// Pairs that overlap as designed.
    overlapping: usize,
}

/// Measures the rows.
pub(super) fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let Some(cad) = corpus::folder() else {
        out(Row::skipped(
            "ghost contacts in shared assemblies as designed",
            ABSENT,
        ));
        return Ok(());
    };
    let files = files(&cad, plan.quick)?;
    let all = trials(files.len(), |index| probed(&files[index]))?;
    let found = all.into_iter().fold(Found::default(), |sum, one| Found {
        assemblies: sum.assemblies + one.assemblies,
        refused: sum.refused + one.refused,
        pairs: sum.pairs + one.pairs,
        ghosts: sum.ghosts + one.ghosts,
        too_deep: sum.too_deep + one.too_deep,
        overlapping: sum.overlapping + one.overlapping,
    });
    let what = |what: &str| {
        format!(
            "{} shared assemblies as designed, default bake, {} near pairs of parts ({} overlap as designed, {} files refused): {what}",
            found.assemblies, found.pairs, found.overlapping, found.refused
        )
    };
    let count = |of: &str, value: usize| Row::exactly(what(of), value as f64, "pairs", 0.0);
    out(count(
        "contact reported where they are over 1 µm apart",
        found.ghosts,
    ));
    out(count(
        "a depth reported over 10 µm more than there is",
        found.too_deep,
    ));
    out(Row::within(
        what("assemblies"),
        found.assemblies as f64,
        "files",
        1.0,
        f64::INFINITY,
    ));
    Ok(())
}

/// Shared files; broken ones are refused when read.
pub(super) fn files(cad: &Path, quick: bool) -> Result<Vec<PathBuf>, LabError> {
    let mut files = corpus::step_files(cad)?;
    files.retain(|path| !quick || QUICK.iter().any(|name| path.ends_with(name)));
    Ok(files)
}

fn probed(path: &Path) -> Result<Found, LabError> {
    let mut found = Found::default();
    let Ok(model) = load_step(path) else {
        found.refused = 1;
        return Ok(found);
    };
    if model.parts.len() < 2 {
        return Ok(found);
    }
    let scene = match ProbeScene::load(path, None) {
        Ok(scene) => scene,
        Err(error @ ScenarioError::Bake { .. }) => {
            eprintln!("{error}");
            found.refused = 1;
            return Ok(found);
        }
        Err(error) => return Err(error.into()),
    };
    found.assemblies = 1;
    let mut bodies = BTreeMap::new();
    for (fixed, moving) in near_pairs(&model) {
        let names = [moving, fixed].map(|part| model.parts[part].name.as_str());
        // A part without surface is not in the scene.
        let Ok(pair) = scene.pair(names[0], Some(names[1])) else {
            continue;
        };
        let relative = model.parts[fixed].placement.inverse() * model.parts[moving].placement;
        let pose = rounded(relative.translation, DQuat::from_mat3(&relative.matrix3));
        let row = scene.probe_all(pair, std::slice::from_ref(&pose))?.swap_remove(0);
        found.pairs += 1;
        if row.contacts == 0 && row.distance_mm > 0.0 {
            continue;
        }
        for part in [fixed, moving] {
            bodies.entry(part).or_insert_with(|| Body::of(&model, part));
        }
        let truth = least_distance_mm(&bodies[&fixed], &bodies[&moving], &placed(&pose));
        found.overlapping += usize::from(truth < -CLEAR_MM);
        let ghost = truth > CLEAR_MM;
        let too_deep = row.distance_mm < truth.min(0.0) - DEPTH_MM;
        found.ghosts += usize::from(ghost);
        found.too_deep += usize::from(too_deep);
        if ghost || too_deep {
            eprintln!(
                "{}: {} against {}: {row}; true distance {truth:+.4} mm",
                path.display(),
                names[0],
                names[1]
            );
        }
    }
    Ok(found)
}

/// Pairs of parts whose bounding spheres meet.
fn near_pairs(model: &CadModel) -> Vec<(usize, usize)> {
    let spheres: Vec<_> = (model.parts.iter())
        .map(|part| sphere(model, part.shape, &part.placement))
        .collect();
    let mut pairs = Vec::new();
    for (fixed, (center, radius)) in spheres.iter().enumerate() {
        for (moving, (there, reach)) in spheres.iter().enumerate().skip(fixed + 1) {
            if center.distance(*there) <= radius + reach {
                pairs.push((fixed, moving));
            }
        }
    }
    pairs
}

fn sphere(model: &CadModel, shape: usize, placement: &DAffine3) -> (glam::DVec3, f64) {
    let vertices = &model.shapes[shape].mesh.vertices;
    let center = vertices.iter().sum::<glam::DVec3>() / vertices.len().max(1) as f64;
    let radius = vertices.iter().map(|v| v.distance(center)).fold(0.0, f64::max);
    (placement.transform_point3(center), radius)
}
