//! Parameters that the sweeps vary: method, shell, cell, number format, bound on the pointshell's error.

use std::fmt;

use mortise_bake::{BakeOptions, Grabbable, Method, PointshellKind, SampleFormat};

/// A model of a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Variant {
    /// How contact finds depth and direction.
    pub method: Method,
    /// Kind of the pointshells.
    pub shell: PointshellKind,
    /// Cell edge, mm.
    pub cell_mm: f64,
    /// Number format of samples.
    pub format: SampleFormat,
    /// Bound on the pointshell's error, mm; `None`: as [`BakeOptions`] chooses.
    pub epsilon_mm: Option<f64>,
    /// Smallest depth to which the field is stored, mm; never less than two cells.
    pub reach_mm: f64,
}

/// The textbook's pointshell: a point for each voxel of the surface, not moved inward.
const CLASSIC: PointshellKind = PointshellKind::Classic {
    voxel_mm: None,
    shrink_percent: 0.0,
};

impl Variant {
    /// The distance field in 16 bit with a pointshell error of a hundredth of the cell: no more than the field's own error, cell²/(8·R), up to radii
    /// R of twelve cells.
    pub const fn field(cell_mm: f64) -> Self {
        Self {
            method: Method::DistanceField,
            shell: PointshellKind::ErrorBounded,
            cell_mm,
            format: SampleFormat::Int16,
            epsilon_mm: Some(cell_mm / 100.0),
            reach_mm: 0.0,
        }
    }

    /// The same field with the default bound on the pointshell's error, a twentieth of the cell.
    pub const fn board(cell_mm: f64) -> Self {
        Self::field(cell_mm).epsilon_mm(cell_mm / 20.0)
    }

    /// Voxmap and pointshell as in McNeely, Puterbaugh & Troy 1999 and Faas 2010.
    pub const fn textbook(cell_mm: f64) -> Self {
        Self {
            method: Method::Occupancy,
            shell: CLASSIC,
            epsilon_mm: None,
            ..Self::field(cell_mm)
        }
    }

    /// Voxmap and pointshell as in the textbook, each point moved inward by a share of a voxel, percent: what Faas 2010 calls shrinking.
    pub const fn shrunk(cell_mm: f64, shrink_percent: f64) -> Self {
        Self {
            shell: PointshellKind::Classic {
                voxel_mm: None,
                shrink_percent,
            },
            ..Self::textbook(cell_mm)
        }
    }

    /// The same model in another number format.
    pub const fn format(self, format: SampleFormat) -> Self {
        Self { format, ..self }
    }

    /// The same model with another bound on the pointshell's error.
    pub const fn epsilon_mm(self, epsilon_mm: f64) -> Self {
        let epsilon_mm = Some(epsilon_mm);
        Self { epsilon_mm, ..self }
    }

    /// The same model with a field stored to this depth.
    pub const fn reach_mm(self, reach_mm: f64) -> Self {
        Self { reach_mm, ..self }
    }

    /// The same model with the textbook's pointshell, a point for each voxel of `voxel_mm`, shrunk by half a voxel: otherwise points would stand out
    /// by as much.
    pub const fn classic_shell(self, voxel_mm: f64) -> Self {
        Self {
            shell: PointshellKind::Classic {
                voxel_mm: Some(voxel_mm),
                shrink_percent: 50.0,
            },
            epsilon_mm: None,
            ..self
        }
    }

    /// Options for baking it. The image may be as large as the layout allows: its size is measured, not limited.
    pub fn options(&self, grabbable: Grabbable) -> BakeOptions {
        let band_cells = BakeOptions::default()
            .band_cells
            .max(self.reach_mm / self.cell_mm);
        BakeOptions {
            band_cells,
            method: self.method,
            shell: self.shell,
            cell_mm: Some(self.cell_mm),
            format: self.format,
            epsilon_mm: self.epsilon_mm,
            grabbable,
            image_limit_bytes: u64::from(u32::MAX),
            ..BakeOptions::default()
        }
    }

    /// Name of its kind, without the cell.
    pub fn kind(&self) -> &'static str {
        match (self.method, self.shell, self.format) {
            (Method::Occupancy, ..) => "textbook voxmap",
            (_, PointshellKind::Classic { .. }, SampleFormat::Int16) => {
                "distance field, 16 bit, classic shell"
            }
            (_, PointshellKind::Classic { .. }, SampleFormat::Int8) => "distance field, 8 bit, classic shell",
            (_, _, SampleFormat::Int16) => "distance field, 16 bit",
            (_, _, SampleFormat::Int8) => "distance field, 8 bit",
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
