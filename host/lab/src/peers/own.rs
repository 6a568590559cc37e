//! Answers in this process: the probe of ours, and parry.

use std::ops::ControlFlow;
use std::path::Path;

use mortise_bake::{BakeOptions, Grabbable, Request};
use mortise_brep::{CadModel, load_step};
use mortise_scenario::probe::{Pair, ProbeScene, Resolution};
use tempfile::NamedTempFile;

use super::method::{Answer, Kind, Method};
use super::scene::Scene;
use crate::error::LabError;
use crate::peer;

/// Name of the method whose median others are compared with.
pub const DEFAULT: &str = "mortise, default bake";
/// Rounds of repetitions at a pose: one that is interrupted at its first query, which then seems too long to be repeated, does not decide.
const ROUNDS: usize = 3;
/// A query of parry that takes longer is asked in one round, ns.
const LONG_NS: f64 = 5e8;
/// Accuracy that the planned bake is asked for, mm.
const PLANNED_MM: f64 = 0.005;

/// How a scene is baked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bake {
    /// As `mortise probe` bakes without options.
    Default,
    /// With cells of this edge, mm.
    Cells(f64),
    /// As `mortise bake --accuracy 5um` bakes.
    Planned,
}

impl Bake {
    /// Name of the method.
    pub fn name(self) -> String {
        match self {
            Self::Default => DEFAULT.into(),
            Self::Cells(mm) => format!("mortise, {mm} mm cells"),
            Self::Planned => format!("mortise, planned for {} µm", 1e3 * PLANNED_MM),
        }
    }
}

/// Answers of the probe.
///
/// # Errors
/// Anything that prevents the bake or a probe.
pub fn probe(scene: &Scene, bake: Bake) -> Result<Method, LabError> {
    let (probed, pair) = baked(scene, bake)?;
    let answer = |case: &crate::scene_p::Case| {
        let mut row = probed.probe(pair, &case.pose)?;
        for _ in 1..ROUNDS {
            let again = probed.probe(pair, &case.pose)?;
            row.least_ns = row.least_ns.min(again.least_ns);
        }
        Ok(Answer {
            overlaps: row.distance_mm < 0.0,
            mm: (row.resolution != Resolution::Bound).then_some(row.distance_mm),
            us: 1e-3 * row.least_ns as f64,
        })
    };
    Ok(Method {
        peer: "mortise".into(),
        name: bake.name(),
        kind: Kind::Ours,
        version: None,
        floor_us: None,
        mesh: None,
        image_bytes: Some(probed.image_bytes()),
        answers: scene.cases.iter().map(answer).collect::<Result<_, LabError>>()?,
    })
}

fn baked(scene: &Scene, bake: Bake) -> Result<(ProbeScene, Pair), LabError> {
    let cells = match bake {
        Bake::Default => None,
        Bake::Cells(mm) => Some(mm),
        Bake::Planned => return planned(scene),
    };
    let probed = ProbeScene::load(scene.step(), cells)?;
    let pair = probed.pair(scene.moving, Some(scene.fixed))?;
    Ok((probed, pair))
}

/// The planned image goes through a file, as it does for a user; parts of an image are called by their indices.
fn planned(scene: &Scene) -> Result<(ProbeScene, Pair), LabError> {
    let model = load_step(scene.step())?;
    let request = Request {
        accuracy_mm: PLANNED_MM,
        flash_bytes: BakeOptions::default().image_limit_bytes,
        tick_instructions: None,
        grabbable: Grabbable::All,
    };
    let bad = |what: String| LabError::Input {
        name: scene.name.clone(),
        what,
    };
    let planned = mortise_bake::plan(&model, &request, &|_| ControlFlow::Continue(()))
        .map_err(|error| bad(error.to_string()))?;
    let file = NamedTempFile::new().and_then(|file| {
        std::fs::write(file.path(), &planned.image)?;
        Ok(file)
    });
    let file = file.map_err(|source| LabError::Unwritable {
        path: std::env::temp_dir(),
        source,
    })?;
    let probed = ProbeScene::load(file.path(), None)?;
    let index = |name: &str| {
        let found = model.parts.iter().position(|part| part.name == name);
        (found.map(|index| index.to_string())).ok_or_else(|| bad(format!("there is no part `{name}`")))
    };
    let pair = probed.pair(&index(scene.moving)?, Some(&index(scene.fixed)?))?;
    Ok((probed, pair))
}

/// Answers of parry on the scene's tessellation.
///
/// # Errors
/// `Input` when parry refuses a mesh.
pub fn parry(scene: &Scene, model: &CadModel, deflection_mm: f64) -> Result<Method, LabError> {
    let (fixed, moving) = (peer::mesh(model, scene.fixed)?, peer::mesh(model, scene.moving)?);
    let answer = |case: &crate::scene_p::Case| {
        let (mm, mut ns) = peer::timed(&case.pose, &fixed, &moving);
        if ns < LONG_NS {
            ns = ns.min(peer::timed(&case.pose, &fixed, &moving).1);
        }
        Answer {
            overlaps: mm < 0.0,
            mm: mm.is_finite().then_some(mm),
            us: 1e-3 * ns,
        }
    };
    Ok(Method {
        peer: "parry".into(),
        name: "parry, triangles".into(),
        kind: Kind::Triangles,
        version: None,
        floor_us: None,
        mesh: Some((deflection_mm, fixed.num_triangles() + moving.num_triangles())),
        image_bytes: None,
        answers: scene.cases.iter().map(answer).collect(),
    })
}

/// Writes a part's mesh as OBJ: vertices and triangles alone, every digit of a double.
///
/// # Errors
/// `Input` if there is no such part; `Unwritable`.
pub fn write_obj(model: &CadModel, name: &str, path: &Path) -> Result<usize, LabError> {
    let part = model.parts.iter().find(|part| part.name == name);
    let part = part.ok_or_else(|| LabError::Input {
        name: path.display().to_string(),
        what: format!("there is no part `{name}`"),
    })?;
    let mesh = &model.shapes[part.shape].mesh;
    let mut text = String::new();
    for v in &mesh.vertices {
        text.push_str(&format!("v {} {} {}\n", v.x, v.y, v.z));
    }
    for [a, b, c] in &mesh.triangles {
        text.push_str(&format!("f {} {} {}\n", a + 1, b + 1, c + 1));
    }
    std::fs::write(path, text).map_err(|source| LabError::Unwritable {
        path: path.to_owned(),
        source,
    })?;
    Ok(mesh.triangles.len())
}
