//! The same questions asked of another engine: parry3d, triangle meshes with a tree of boxes.
//!
//! Gaps come from `query::distance`, which answers 0 for whatever overlaps; depths from `query::contact`, the deepest it finds over pairs of
//! triangles. The meshes are the kernel's tessellation, as fine as asked. Source: <https://parry.rs>, as `Cargo.lock` has it.

use std::hint::black_box;
use std::time::Instant;

use glam::{DQuat, DVec3};
use mortise_brep::{CadModel, LoadOptions, Shape};
use parry3d_f64::math::{Pose, Rotation, Vector};
use parry3d_f64::query;
use parry3d_f64::shape::{TriMesh, TriMeshFlags};

use crate::error::LabError;
use crate::scene_p::{self, Case, median};

/// Times each query is made: what else the computer does makes one longer, never shorter, so the least is taken.
const REPEATS: usize = 5;
/// A question that takes longer is asked once.
const LONG_NS: f64 = 20e6;

/// What it answered.
#[derive(Clone, Debug, PartialEq)]
pub struct Answers {
    /// Triangles of both meshes.
    pub triangles: usize,
    /// Largest error of a gap, mm.
    pub gap_error_mm: f64,
    /// Largest error of a depth, mm.
    pub depth_error_mm: f64,
    /// Median of the least times of gaps, ns.
    pub gap_ns: f64,
    /// The same of depths, ns.
    pub depth_ns: f64,
    /// The same over all cases, ns.
    pub median_ns: f64,
}

/// Asks every case of scene P of meshes that leave the surfaces by at most `deflection_mm`.
///
/// # Errors
/// `Unwritable`, `Brep`; `Input` when a mesh is refused.
pub fn ask(deflection_mm: f64) -> Result<Answers, LabError> {
    let options = LoadOptions {
        linear_deflection_mm: Some(deflection_mm),
        // The distance alone is to decide.
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
        let (found, ns) = timed(&case, &block, &peg);
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

fn mesh(model: &CadModel, name: &str) -> Result<TriMesh, LabError> {
    let bad = |what: String| LabError::Input {
        name: format!("scene P, {name}"),
        what,
    };
    let part =
        (model.parts.iter().find(|part| part.name == name)).ok_or_else(|| bad("there is none".into()))?;
    let Shape { mesh, .. } = &model.shapes[part.shape];
    // Both parts lie at the origin in the file, so the shape's frame is the part's.
    let vertices = mesh.vertices.iter().map(|v| Vector::new(v.x, v.y, v.z)).collect();
    TriMesh::with_flags(vertices, mesh.triangles.clone(), TriMeshFlags::ORIENTED)
        .map_err(|error| bad(error.to_string()))
}

fn timed(case: &Case, block: &TriMesh, peg: &TriMesh) -> (f64, f64) {
    let at = pose(case.pose.position_mm, case.pose.orientation);
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
    // Meshes are supported, so neither refuses; if one did, NaN is never within a bound.
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
