//! The same queries answered by another engine: parry3d, triangle meshes with a tree of boxes.
//!
//! Gaps come from `query::distance`, which returns 0 for overlapping meshes; depths from `query::contact`, the deepest contact over pairs of
//! triangles. The meshes are the kernel's tessellation at the requested deflection. Source: <https://parry.rs>, in the version of `Cargo.lock`.

use std::hint::black_box;
use std::time::Instant;

use glam::{DQuat, DVec3};
use mortise_brep::{CadModel, LoadOptions, Shape};
use mortise_scenario::probe::NamedPose;
use parry3d_f64::math::{Pose, Rotation, Vector};
use parry3d_f64::query;
use parry3d_f64::shape::{TriMesh, TriMeshFlags};

use crate::error::LabError;
use crate::scene_p::{self, median};

/// Repetitions of each query: other load on the computer only lengthens it, so the shortest time is used.
const REPEATS: usize = 5;
/// A query that takes longer is made once, ns.
const LONG_NS: f64 = 20e6;

/// Errors and times of its results.
#[derive(Clone, Debug, PartialEq)]
pub struct Answers {
    /// Triangles of both meshes.
    pub triangles: usize,
    /// Largest error of a gap, mm.
    pub gap_error_mm: f64,
    /// Largest error of a depth, mm.
    pub depth_error_mm: f64,
    /// Median of the shortest times of gaps, ns.
    pub gap_ns: f64,
    /// Median of the shortest times of depths, ns.
    pub depth_ns: f64,
    /// Median over all cases, ns.
    pub median_ns: f64,
}

/// Queries every case of scene P on meshes that deviate from the surfaces by at most `deflection_mm`.
///
/// # Errors
/// `Unwritable`, `Brep`; `Input` when parry refuses a mesh.
pub fn ask(deflection_mm: f64) -> Result<Answers, LabError> {
    let options = LoadOptions {
        linear_deflection_mm: Some(deflection_mm),
        // The angle has no effect: the deflection alone determines the mesh.
        angular_deflection_rad: 1.0,
        ..LoadOptions::default()
    };
    let model = scene_p::model(&options)?;
    let (block, peg) = (mesh(&model, "block")?, mesh(&model, "peg")?);
    let triangles = block.num_triangles() + peg.num_triangles();
    let mut answers = Answers {
        triangles,
        gap_error_mm: 0.0,
        depth_error_mm: 0.0,
        gap_ns: f64::NAN,
        depth_ns: f64::NAN,
        median_ns: f64::NAN,
    };
    let (mut gaps, mut depths) = (Vec::new(), Vec::new());
    for case in scene_p::cases() {
        let (found, ns) = timed(&case.pose, &block, &peg);
        let error = (found - case.exact_mm).abs();
        if case.exact_mm >= 0.0 {
            answers.gap_error_mm = answers.gap_error_mm.max(error);
            gaps.push(ns);
        } else {
            answers.depth_error_mm = answers.depth_error_mm.max(error);
            depths.push(ns);
        }
    }
    answers.gap_ns = median(gaps.iter().copied());
    answers.depth_ns = median(depths.iter().copied());
    answers.median_ns = median(gaps.into_iter().chain(depths));
    Ok(answers)
}

/// A part's mesh in its own frame.
///
/// # Errors
/// `Input` when there is no such part, or parry refuses its mesh.
pub fn mesh(model: &CadModel, name: &str) -> Result<TriMesh, LabError> {
    let bad = |what: String| LabError::Input {
        name: format!("part `{name}`"),
        what,
    };
    let part =
        (model.parts.iter().find(|part| part.name == name)).ok_or_else(|| bad("there is none".into()))?;
    let Shape { mesh, .. } = &model.shapes[part.shape];
    let vertices = mesh.vertices.iter().map(|v| Vector::new(v.x, v.y, v.z)).collect();
    TriMesh::with_flags(vertices, mesh.triangles.clone(), TriMeshFlags::ORIENTED)
        .map_err(|error| bad(error.to_string()))
}

/// Signed distance, mm, of `peg` at a pose in the frame of `block`, and the shortest time of the query, ns.
pub fn timed(named: &NamedPose, block: &TriMesh, peg: &TriMesh) -> (f64, f64) {
    let at = pose(named.position_mm, named.orientation);
    let (mut least, mut found) = (f64::INFINITY, f64::NAN);
    for _ in 0..REPEATS {
        let start = Instant::now();
        found = black_box(signed(black_box(&at), block, peg));
        let ns = start.elapsed().as_nanos() as f64;
        least = least.min(ns);
        if ns > LONG_NS {
            break;
        }
    }
    (found, least)
}

fn signed(at: &Pose, block: &TriMesh, peg: &TriMesh) -> f64 {
    let identity = Pose::identity();
    // parry supports pairs of meshes, so neither query fails; if one did, NaN would fail every bound.
    match query::distance(&identity, block, at, peg) {
        Ok(gap) if gap.distance > 0.0 => gap.distance,
        Ok(_) => match query::contact(&identity, block, at, peg, 0.0) {
            Ok(Some(contact)) => contact.dist,
            Ok(None) => 0.0,
            Err(_) => f64::NAN,
        },
        Err(_) => f64::NAN,
    }
}

fn pose(position: DVec3, orientation: DQuat) -> Pose {
    let [x, y, z, w] = orientation.to_array();
    Pose::from_parts(position.to_array().into(), Rotation::from_xyzw(x, y, z, w))
}
