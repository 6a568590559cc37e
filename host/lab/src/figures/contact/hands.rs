//! A slow and a fast hand over every shared file: the smallest part is pushed along each axis and towards its neighbour, and the overlap is measured outside of the tick.

use std::path::Path;

use glam::{DAffine3, DQuat, DVec3};
use mortise_bake::{BakeOptions, Grabbable};
use mortise_brep::load_step;
use mortise_haptics::Settings;
use mortise_scenario::overlap::penetration_of_poses_mm;
use mortise_scenario::{PreparedScene, Scenario, ScenarioError};

use super::ghosts::files;
use super::limits::ABSENT;
use crate::driven::{HandlePath, Image, drive};
use crate::figures::{Plan, Row};
use crate::least_distance::least_distance_mm;
use crate::parallel::trials;
use crate::{LabError, corpus};

/// Speeds, mm/s, and the largest overlap at each, mm.
const SLOW: (f64, f64) = (20.0, 0.05);
const FAST: (f64, f64) = (1000.0, 0.3);
/// How far the handle goes along each axis, mm: what presses with 10 N, the coupling's limit.
const PUSH_MM: f64 = 10.0;
/// Longest way towards the nearest part, mm.
const MOST_MM: f64 = 60.0;
/// Time that it stays there, s.
const STAY_S: f64 = 0.1;
/// Overlap as designed above which a file is left out, mm.
const DESIGNED_MM: f64 = 5e-3;
/// Poses at which the overlap is also searched between the sample points.
const SEARCHED: usize = 12;
/// Word of a bake's warning that the scene can exceed the budget.
const WARNING: &str = "budget";

/// Result of one file.
struct Pushed {
    file: String,
    /// Overlap as designed, mm.
    designed_mm: f64,
    /// Deepest overlap with the slow and the fast hand, mm.
    deepest_mm: [f64; 2],
    /// Energy generated at the handle, J.
    made_j: f64,
    warned: bool,
}

/// Measures the rows.
pub(super) fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let Some(cad) = corpus::folder() else {
        out(Row::skipped(
            "a slow and a fast hand over every shared file",
            ABSENT,
        ));
        return Ok(());
    };
    let files = files(&cad, plan.quick)?;
    let all: Vec<Pushed> = (trials(files.len(), |index| pushed(&files[index]))?.into_iter())
        .flatten()
        .collect();
    let clear: Vec<&Pushed> = all.iter().filter(|one| one.designed_mm <= DESIGNED_MM).collect();
    for (index, (speed, most)) in [SLOW, FAST].into_iter().enumerate() {
        let judged = || clear.iter().filter(|one| index == 1 || !one.warned);
        let worst = judged().max_by(|a, b| a.deepest_mm[index].total_cmp(&b.deepest_mm[index]));
        let (deepest, place) = worst.map_or((f64::NAN, "none"), |one| (one.deepest_mm[index], &one.file));
        let over = judged().filter(|one| one.deepest_mm[index] > most).count();
        let what = format!(
            "hand of {speed} mm/s, 10 N, {} shared assemblies, default bake and budget ({} overlap as designed and are left out): deepest overlap (at {place}; {over} files over)",
            clear.len(),
            all.len() - clear.len()
        );
        out(Row::at_most(what, 1e3 * deepest, "µm", 1e3 * most));
    }
    let made = all.iter().map(|one| one.made_j).fold(0.0, f64::max);
    out(Row::at_most(
        format!(
            "both hands, {} shared assemblies: energy generated at the handle over any interval",
            all.len()
        ),
        1e3 * made,
        "mJ",
        1.0,
    ));
    Ok(())
}

/// Pushes the smallest part of a file; `None` for files that are refused or have one part only.
fn pushed(path: &Path) -> Result<Option<Pushed>, LabError> {
    let Ok(model) = load_step(path) else {
        return Ok(None);
    };
    if model.parts.len() < 2 {
        return Ok(None);
    }
    let volume = |part: usize| {
        let volume = model.shapes[model.parts[part].shape].volume_mm3;
        if volume > 0.0 { volume } else { f64::INFINITY }
    };
    let smallest = (0..model.parts.len())
        .min_by(|&a, &b| volume(a).total_cmp(&volume(b)))
        .unwrap_or(0);
    let part = &model.parts[smallest];
    let mut scenario = Scenario::insertion(path)?;
    scenario.scene.part = part.name.clone();
    let options = BakeOptions {
        grabbable: Grabbable::Named(vec![part.name.clone()]),
        ..BakeOptions::default()
    };
    let scene = match PreparedScene::with(&scenario, &options) {
        Ok(scene) => scene,
        Err(error @ ScenarioError::Bake { .. }) => {
            eprintln!("{error}");
            return Ok(None);
        }
        Err(error) => return Err(error.into()),
    };
    let grip = part
        .placement
        .transform_point3(model.shapes[part.shape].center_of_mass);
    let designed_mm = overlap_mm(&scene, &[scene.placement()], 1);
    let (mut deepest_mm, mut made_j) = ([0.0; 2], 0.0f64);
    for (index, (speed, _)) in [SLOW, FAST].into_iter().enumerate() {
        let image = Image::new(&scene.image);
        let mut poses = Vec::new();
        let path = strokes(grip, nearest(&scene), speed);
        let made = drive(
            &image.scene()?,
            scene.part,
            &Settings::default(),
            &path,
            &mut |seen| {
                poses.push(seen.object);
            },
        )?;
        made_j = made_j.max(made.handle_j);
        deepest_mm[index] = overlap_mm(&scene, &poses, SEARCHED);
    }
    let file = path
        .file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned();
    let warned = scene
        .report
        .warnings
        .iter()
        .any(|warning| warning.contains(WARNING));
    eprintln!(
        "{file}, {}: {:.1} µm as designed, {:.1} µm slow, {:.1} µm fast, made {:.2} mJ{}",
        part.name,
        1e3 * designed_mm,
        1e3 * deepest_mm[0],
        1e3 * deepest_mm[1],
        1e3 * made_j,
        if warned { ", warned" } else { "" }
    );
    Ok(Some(Pushed {
        file,
        designed_mm,
        deepest_mm,
        made_j,
        warned,
    }))
}

/// Middle of the part that is nearest to the held one, mm.
fn nearest(scene: &PreparedScene) -> DVec3 {
    let moving = usize::from(scene.part);
    let middle = |index: usize| {
        let body = &scene.bodies()[index];
        body.placement.transform_point3(body.center)
    };
    (0..scene.bodies().len())
        .filter(|&index| index != moving)
        .map(middle)
        .min_by(|a, b| a.distance(middle(moving)).total_cmp(&b.distance(middle(moving))))
        .unwrap_or_default()
}

/// From the part's place to and fro along each axis, then towards the nearest part's middle, which parts that stand apart meet.
fn strokes(grip: DVec3, nearest: DVec3, mm_per_s: f64) -> HandlePath {
    let axes = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| PUSH_MM * axis);
    let towards = (nearest - grip).clamp_length_max(MOST_MM);
    let ways = axes.into_iter().flat_map(|way| [way, -way]).chain([towards]);
    ways.fold(HandlePath::from(grip, DQuat::IDENTITY), |path, way| {
        let (end, seconds) = (grip + way, (way.length() / mm_per_s).max(1e-3));
        path.then(seconds, end, DQuat::IDENTITY)
            .then(STAY_S, end, DQuat::IDENTITY)
            .then(seconds, grip, DQuat::IDENTITY)
            .then(0.5 * STAY_S, grip, DQuat::IDENTITY)
    })
}

/// Deepest overlap over all poses of the moving part: by sample points at every pose, and by search at some.
fn overlap_mm(scene: &PreparedScene, poses: &[DAffine3], searched: usize) -> f64 {
    let by_points = penetration_of_poses_mm(scene, poses.iter().copied());
    let moving = usize::from(scene.part);
    let bodies = scene.bodies();
    let step = poses.len().div_ceil(searched).max(1);
    let by_search = (poses.iter().step_by(step))
        .flat_map(|pose| {
            (bodies.iter().enumerate())
                .filter(move |(index, _)| *index != moving)
                .map(move |(_, other)| (other, other.placement.inverse() * *pose))
        })
        .filter(|(other, pose)| {
            let part = &bodies[moving];
            pose.transform_point3(part.center).distance(other.center) < part.radius + other.radius
        })
        .map(|(other, pose)| -least_distance_mm(other, &bodies[moving], &pose))
        .fold(0.0, f64::max);
    by_points.max(by_search)
}
