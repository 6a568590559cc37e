//! A query to the CAD kernel and its answer, by the process that has the kernel.

use crate::{BrepError, LoadOptions, assemble};
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
    pub kind: Kind,
    pub shape: usize,
    pub points: Vec<DVec3>,
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) enum Kind {
    Sides { tolerance_mm: f64 },
    Feet,
}

/// Answer with one entry for each point.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) enum Answer {
    Sides(Vec<Side>),
    Feet(Vec<Option<Foot>>),
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
