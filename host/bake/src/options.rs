//! Options of a bake, and its progress reports.

use serde::{Deserialize, Serialize};

use crate::error::BakeError;
use crate::format::{SampleFormat, Samples};

/// What to bake and how finely.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BakeOptions {
    /// How the inside of a part is distinguished from its outside.
    pub method: Method,
    /// Cell edge, mm. `None`: a hundredth of the largest part, rounded to 1, 2 or 5; finer for parts much smaller than that, and coarsened until the
    /// image fits [`Self::image_limit_bytes`].
    pub cell_mm: Option<f64>,
    /// Cell edges of single parts by name, mm, which override [`Self::cell_mm`]; that must then be given. For parts that share a shape the first
    /// entry counts.
    pub part_cells_mm: Vec<(String, f64)>,
    /// Depth and height, in cells, to which the surface's neighbourhood is stored.
    pub band_cells: f64,
    /// Number format of samples.
    pub format: SampleFormat,
    /// Largest error of the local patches that free-form faces are divided into, mm.
    pub patch_tolerance_mm: f64,
    /// Bricks that store samples.
    pub samples: Samples,
    /// Kind of the pointshells.
    pub shell: PointshellKind,
    /// Bound on how much deeper a contact can be than its deepest sample, mm. `None`: a twentieth of the cell.
    pub epsilon_mm: Option<f64>,
    /// The same bound where only convex faces touch each other away from edges, mainly crossed shafts, mm. `None`: as `epsilon_mm`.
    pub crossing_epsilon_mm: Option<f64>,
    /// Largest spacing of pointshell points along edges, mm. Two flat strips that are narrower than this and cross each other can miss each other.
    /// `None`: four cells.
    pub max_spacing_mm: Option<f64>,
    /// Parts that may be grabbed.
    pub grabbable: Grabbable,
    /// Largest size of the image in bytes.
    pub image_limit_bytes: u64,
}

impl Default for BakeOptions {
    fn default() -> Self {
        Self {
            method: Method::DistanceField,
            cell_mm: None,
            part_cells_mm: Vec::new(),
            band_cells: 2.0,
            format: SampleFormat::Int16,
            patch_tolerance_mm: 2e-3,
            samples: Samples::WhereInterpolated,
            shell: PointshellKind::ErrorBounded,
            epsilon_mm: None,
            crossing_epsilon_mm: None,
            max_spacing_mm: None,
            grabbable: Grabbable::AllButLargest,
            image_limit_bytes: 1 << 20,
        }
    }
}

impl BakeOptions {
    /// Rejects values out of range.
    pub(crate) fn check(&self) -> Result<(), BakeError> {
        let within = |option, value: f64, least: f64, most: f64, expected| {
            if value >= least && value <= most {
                Ok(())
            } else {
                Err(BakeError::Option {
                    option,
                    value,
                    expected,
                })
            }
        };
        let cells = self.part_cells_mm.iter().map(|(_, cell)| *cell);
        for cell in cells.chain(self.cell_mm) {
            within("cell_mm", cell, 1e-3, 1e3, "0.001 to 1000 mm")?;
        }
        // With less than one diagonal not all cells next to the surface would be stored.
        within("band_cells", self.band_cells, 1.0, 64.0, "1 to 64 cells")?;
        within(
            "patch_tolerance_mm",
            self.patch_tolerance_mm,
            1e-6,
            1e3,
            "0.000001 to 1000 mm",
        )?;
        for epsilon in [self.epsilon_mm, self.crossing_epsilon_mm].into_iter().flatten() {
            within("epsilon_mm", epsilon, 1e-6, 1e3, "0.000001 to 1000 mm")?;
        }
        if let PointshellKind::Classic {
            voxel_mm,
            shrink_percent,
        } = self.shell
        {
            if let Some(voxel) = voxel_mm {
                within("voxel_mm", voxel, 1e-3, 1e3, "0.001 to 1000 mm")?;
            }
            within(
                "shrink_percent",
                shrink_percent,
                0.0,
                100.0,
                "0 to 100 % of a voxel",
            )?;
        }
        if let Some(spacing) = self.max_spacing_mm {
            within("max_spacing_mm", spacing, 1e-3, 1e6, "0.001 to 1000000 mm")?;
        }
        Ok(())
    }
}

/// Representation from which contact depth and direction are computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Interpolated signed distance: depth and direction to micrometres.
    #[default]
    DistanceField,
    /// Two bits per voxel, depth to a tangent plane through its centre (McNeely, Puterbaugh & Troy 1999): the textbook baseline, with errors up to a
    /// voxel.
    Occupancy,
}

impl Method {
    /// All methods.
    pub const ALL: [Self; 2] = [Self::DistanceField, Self::Occupancy];

    /// Name on the command line and in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::DistanceField => "distance-field",
            Self::Occupancy => "occupancy",
        }
    }
}

impl std::fmt::Display for Method {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl std::str::FromStr for Method {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        (Self::ALL.into_iter())
            .find(|method| method.name() == text)
            .ok_or_else(|| {
                format!(
                    "no method `{text}`; give {}",
                    Self::ALL.map(Self::name).join(" or ")
                )
            })
    }
}

/// Kind of pointshell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PointshellKind {
    /// Points on the exact surface, as dense as an error bound requires, on every part.
    #[default]
    ErrorBounded,
    /// One point for each voxel the surface crosses, on the parts that may be grabbed (McNeely, Puterbaugh & Troy 1999): the textbook baseline.
    Classic {
        /// Voxel edge, mm. `None`: the field's cell.
        voxel_mm: Option<f64>,
        /// Distance by which points are moved inward, percent of a voxel.
        shrink_percent: f64,
    },
}

/// Parts that may be grabbed and moved; the others are fixed.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Grabbable {
    /// Every part except the one of largest volume (a single part can always be grabbed).
    #[default]
    AllButLargest,
    /// Every part.
    All,
    /// The parts with these names.
    Named(Vec<String>),
}

/// Stage of a bake.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Stage {
    /// Sampling the distance.
    Field,
    /// Sampling the surface.
    Pointshell,
    /// Putting the image together.
    Image,
}

/// Progress of a bake.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress<'a> {
    /// Current stage.
    pub stage: Stage,
    /// Part whose shape is being processed.
    pub part: &'a str,
    /// Index of the shape, from 0, and number of shapes.
    pub shape: (usize, usize),
    /// Progress from 0 to 1 within this shape and stage.
    pub fraction: f64,
}
