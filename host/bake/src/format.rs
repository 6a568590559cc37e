//! Number format and options of a field.

use mortise_protocol::image::{FORMAT_I8, FORMAT_I16, SAMPLES_PER_BRICK};
use serde::{Deserialize, Serialize};

/// Number format of samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SampleFormat {
    /// One byte, half the size of int16: steps of a 34th of a cell at a band of two cells, a 46th at one.
    Int8,
    /// Two bytes: steps of an 8700th of a cell at a band of two cells.
    #[default]
    Int16,
}

impl SampleFormat {
    /// Largest sample.
    pub fn max(self) -> f64 {
        match self {
            Self::Int8 => 127.0,
            Self::Int16 => 32767.0,
        }
    }

    /// Code of the format in a [`FieldRecord`](mortise_protocol::image::FieldRecord).
    pub fn code(self) -> u16 {
        match self {
            Self::Int8 => FORMAT_I8,
            Self::Int16 => FORMAT_I16,
        }
    }

    /// Bytes of one sample.
    pub fn bytes(self) -> usize {
        match self {
            Self::Int8 => 1,
            Self::Int16 => 2,
        }
    }
}

/// Bricks that store samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Samples {
    /// Those in which a reader interpolates: elsewhere it evaluates surfaces.
    #[default]
    WhereInterpolated,
    /// All, so that the samples alone give the distance.
    Everywhere,
}

/// Factor of [`FieldOptions::finer`] for a face that nothing can reach: its errors do not count.
pub(crate) const NOT_REACHED: f64 = 50.0;

/// How to sample a field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldOptions<'a> {
    /// Cell edge, mm.
    pub cell_mm: f64,
    /// Every point within this many cells of the surface lies in a stored brick, and interpolation there uses no clamped sample.
    pub band_cells: f64,
    /// Number format.
    pub format: SampleFormat,
    /// Largest error of the local patches of free-form faces, mm.
    pub patch_tolerance_mm: f64,
    /// Bricks that store samples.
    pub samples: Samples,
    /// With finer bricks over the cells that have no rule: by how many times the tolerance of patches each face may err. `None`: without.
    pub finer: Option<&'a [f64]>,
}

impl FieldOptions<'_> {
    /// Whether the error near a face counts: not where nothing can reach it.
    pub(crate) fn counts(&self, face: u16) -> bool {
        self.factor(face) < NOT_REACHED
    }

    /// By how many times the tolerance of patches the distance may err near a face.
    pub(crate) fn factor(&self, face: u16) -> f64 {
        let factors = self.finer.unwrap_or_default();
        factors.get(usize::from(face)).copied().unwrap_or(1.0)
    }

    /// Sample units per cell: a whole number, so that planes and repeated features at whole-cell offsets give equal bricks.
    pub(crate) fn units_per_cell(&self) -> f64 {
        (self.format.max() / self.range_cells()).floor().max(1.0)
    }

    /// Distance up to which samples are exact, in cells: the corners of a cell that the band touches are at most the cell's diagonal farther.
    /// Clamping samples beyond it makes more bricks equal.
    pub(crate) fn range_cells(&self) -> f64 {
        self.band_cells + 3f64.sqrt()
    }
}

/// Bytes of samples in one brick.
pub(crate) fn brick_bytes(format: SampleFormat) -> usize {
    SAMPLES_PER_BRICK * format.bytes()
}
