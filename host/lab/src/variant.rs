//! What the sweeps vary: method, cell, number format, bound on the pointshell's error.

use std::fmt;

use mortise_bake::{BakeOptions, Grabbable, SampleFormat};
use serde::Serialize;

/// How contact is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Interpolated signed distance, points by an error bound.
    DistanceField,
}

/// One way to model a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Variant {
    /// How contact is computed.
    pub method: Method,
    /// Cell edge, mm.
    pub cell_mm: f64,
    /// Number format of samples.
    pub format: SampleFormat,
    /// Bound on the pointshell's chord error, mm; `None`: as [`BakeOptions`] chooses.
    pub epsilon_mm: Option<f64>,
}

impl Variant {
    /// The distance field in 16 bit, its points' error a hundredth of the cell: no more than the field's own, cell²/(8·R), up to
    /// radii of twelve cells.
    pub const fn field(cell_mm: f64) -> Self {
        Self {
            method: Method::DistanceField,
            cell_mm,
            format: SampleFormat::Int16,
            epsilon_mm: Some(cell_mm / 100.0),
        }
    }

    /// The same in another number format.
    pub const fn format(self, format: SampleFormat) -> Self {
        Self { format, ..self }
    }

    /// The same with another bound on the pointshell's error.
    pub const fn epsilon_mm(self, epsilon_mm: f64) -> Self {
        let epsilon_mm = Some(epsilon_mm);
        Self { epsilon_mm, ..self }
    }

    /// How to bake it. The image may be as large as layouts allow: what it costs is measured, not limited.
    pub fn options(&self, grabbable: Grabbable) -> BakeOptions {
        BakeOptions {
            cell_mm: Some(self.cell_mm),
            format: self.format,
            epsilon_mm: self.epsilon_mm,
            grabbable,
            image_limit_bytes: u64::from(u32::MAX),
            ..BakeOptions::default()
        }
    }

    /// Its kind, without the cell.
    pub fn kind(&self) -> &'static str {
        match (self.method, self.format) {
            (Method::DistanceField, SampleFormat::Int16) => "distance field, 16 bit",
            (Method::DistanceField, SampleFormat::Int8) => "distance field, 8 bit",
        }
    }
}

impl fmt::Display for Variant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, {} mm cells", self.kind(), self.cell_mm)?;
        match self.epsilon_mm {
            Some(epsilon) => write!(f, ", ε = {} µm", 1e3 * epsilon),
            None => Ok(()),
        }
    }
}
