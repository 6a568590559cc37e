//! A query to the CAD kernel and its answer, by the process that has the kernel.

use crate::kernel::RawPlace;
use crate::{BrepError, LoadOptions, Part, assemble};
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

#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) enum Kind {
    Sides {
        tolerance_mm: f64,
    },
    Feet,
    /// The STEP text of an assembly with these parts.
    Write(Vec<Part>),
}

/// Answer with one entry for each point.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) enum Answer {
    Sides(Vec<Side>),
    Feet(Vec<Option<Foot>>),
    Text(Vec<u8>),
}

/// Queries the kernel in this process.
pub(crate) fn answer(path: &Path, options: &LoadOptions, question: &Question) -> Result<Answer, BrepError> {
    let flat: Vec<f64> = question.points.iter().flat_map(|p| p.to_array()).collect();
    let shape = question.shape;
    assemble::ask(path, options, shape, |document| {
        Ok(match &question.kind {
            Kind::Sides { tolerance_mm } => Answer::Sides(
                document
                    .sides(shape, &flat, *tolerance_mm)?
                    .into_iter()
                    .map(|code| match code {
                        0 => Side::In,
                        1 => Side::Out,
                        2 => Side::On,
                        _ => Side::Unknown,
                    })
                    .collect(),
            ),
            Kind::Write(parts) => Answer::Text(document.write(&parts.iter().map(raw).collect())?),
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

fn raw(part: &Part) -> RawPlace {
    let (m, t) = (part.placement.matrix3, part.placement.translation);
    let row = |i: usize| [m.x_axis[i], m.y_axis[i], m.z_axis[i], t[i]];
    let mut placement = [0.0; 12];
    for i in 0..3 {
        placement[4 * i..4 * i + 4].copy_from_slice(&row(i));
    }
    RawPlace {
        shape: part.shape,
        name: part.name.clone(),
        placement,
        has_color: part.color.is_some(),
        color: part.color.unwrap_or_default(),
    }
}
