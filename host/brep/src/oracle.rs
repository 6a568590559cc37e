//! Point queries answered by the CAD kernel itself: a reference for computations based only on the plain structs.
//!
//! Lengths are in mm, in the shape's frame. Each call reads the file again, in a child process if possible (see [`child`]), and evaluates one point
//! at a time. Cost: [`classify`] shoots one ray per point, 10 to 500 µs; [`nearest`] examines every face near enough, about ten times that.

use crate::question::{Answer, Kind, Question, answer};
pub use crate::question::{Foot, Side};
use crate::{BrepError, LoadOptions, child};
use glam::DVec3;
use std::path::Path;

/// Side of each of `points` relative to the solid `shape` (an index into [`crate::CadModel::shapes`]) of the file at `path`, by
/// `BRepClass3d_SolidClassifier`. A solid whose faces point inward is reversed first, as on loading.
///
/// # Errors
/// As [`crate::load_step_with`], and [`BrepError::NoSuchShape`].
pub fn classify(
    path: impl AsRef<Path>,
    options: &LoadOptions,
    shape: usize,
    points: &[DVec3],
    tolerance_mm: f64,
) -> Result<Vec<Side>, BrepError> {
    let path = path.as_ref();
    match ask(path, options, Kind::Sides { tolerance_mm }, shape, points)? {
        Answer::Sides(sides) if sides.len() == points.len() => Ok(sides),
        _ => Err(mismatch(path)),
    }
}

/// Nearest point of the faces of `shape` to each of `points`, by `BRepExtrema_DistShapeShape`; `None` where the kernel finds none. On splines its
/// search starts from samples and may miss the nearest point: it then returns a point of the shape that is farther away.
///
/// # Errors
/// As [`classify`].
pub fn nearest(
    path: impl AsRef<Path>,
    options: &LoadOptions,
    shape: usize,
    points: &[DVec3],
) -> Result<Vec<Option<Foot>>, BrepError> {
    let path = path.as_ref();
    match ask(path, options, Kind::Feet, shape, points)? {
        Answer::Feet(feet) if feet.len() == points.len() => Ok(feet),
        _ => Err(mismatch(path)),
    }
}

pub(crate) fn ask(
    path: &Path,
    options: &LoadOptions,
    kind: Kind,
    shape: usize,
    points: &[DVec3],
) -> Result<Answer, BrepError> {
    let question = Question {
        kind,
        shape,
        points: points.to_vec(),
    };
    if child::is_ready() {
        child::ask(path, options, &question)
    } else {
        answer(path, options, &question)
    }
}

pub(crate) fn mismatch(path: &Path) -> BrepError {
    BrepError::Process {
        path: path.display().to_string(),
        reason: "its answer does not fit the question".into(),
    }
}
