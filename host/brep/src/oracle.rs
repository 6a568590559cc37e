//! Point queries answered by the CAD kernel itself: a reference for computations based only on the plain structs.
//!
//! Lengths are in mm, in the shape's frame. Each call reads the file again, in a child process if possible (see [`child`]), and evaluates one point
//! at a time. Cost: [`classify`] shoots one ray per point, 10 to 500 µs; [`nearest`] examines every face near enough, about ten times that.

use crate::{BrepError, LoadOptions, assemble, child};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Side of a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Side {
    /// Inside the solid.
    In,
    /// Outside.
    Out,
    /// Within the tolerance of its surface.
    On,
    /// Undecided by the kernel: not a solid, or a ray that it could not follow.
    Unknown,
}

/// Nearest point of a shape's faces.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Foot {
    /// Unsigned distance, mm.
    pub distance: f64,
    /// Position, mm.
    pub point: DVec3,
}

/// Query about a shape.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Question {
    kind: Kind,
    shape: usize,
    points: Vec<DVec3>,
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
enum Kind {
    Sides { tolerance_mm: f64 },
    Feet,
}

/// Answer with one entry for each point.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) enum Answer {
    Sides(Vec<Side>),
    Feet(Vec<Option<Foot>>),
}

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

fn ask(
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

/// Queries the kernel in this process.
pub(crate) fn answer(path: &Path, options: &LoadOptions, question: &Question) -> Result<Answer, BrepError> {
    let flat: Vec<f64> = question.points.iter().flat_map(|p| p.to_array()).collect();
    let shape = question.shape;
    assemble::ask(path, options, shape, |document| {
        Ok(match question.kind {
            Kind::Sides { tolerance_mm } => Answer::Sides(
                document
                    .sides(shape, &flat, tolerance_mm)?
                    .into_iter()
                    .map(|code| match code {
                        0 => Side::In,
                        1 => Side::Out,
                        2 => Side::On,
                        _ => Side::Unknown,
                    })
                    .collect(),
            ),
            Kind::Feet => Answer::Feet(
                document
                    .feet(shape, &flat)?
                    .as_chunks::<4>()
                    .0
                    .iter()
                    .map(|&[distance, x, y, z]| {
                        (distance >= 0.0).then_some(Foot {
                            distance,
                            point: DVec3::new(x, y, z),
                        })
                    })
                    .collect(),
            ),
        })
    })
}

fn mismatch(path: &Path) -> BrepError {
    BrepError::Process {
        path: path.display().to_string(),
        reason: "its answer does not fit the question".into(),
    }
}
