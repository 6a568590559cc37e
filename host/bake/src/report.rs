//! What a bake made: bytes by part and kind, leaks, doubts.

use serde::{Deserialize, Serialize};

use crate::field::SampleFormat;
use crate::options::Method;

/// Bytes by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ByteCount {
    /// Field samples.
    pub samples: usize,
    /// Cell-to-palette indices, with padding.
    pub indices: usize,
    /// Brick grid.
    pub grid: usize,
    /// Brick records.
    pub bricks: usize,
    /// Palette entries.
    pub palette: usize,
    /// Pointshell.
    pub points: usize,
    /// Sphere tree.
    pub nodes: usize,
    /// Face records.
    pub faces: usize,
    /// Shape and field records.
    pub records: usize,
}

impl ByteCount {
    /// All of them.
    pub fn total(&self) -> usize {
        self.samples
            + self.indices
            + self.grid
            + self.bricks
            + self.palette
            + self.points
            + self.nodes
            + self.faces
            + self.records
    }
}

/// One shape of the image.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ShapeReport {
    /// First part that places it.
    pub name: String,
    /// Cell edge, mm.
    pub cell_mm: f64,
    /// What its field holds.
    pub method: Method,
    /// Number format of distances.
    pub format: SampleFormat,
    /// One step of a sample, mm; the cell's edge where there are no distances.
    pub scale_mm: f64,
    /// Bricks along x, y, z.
    pub brick_dims: [u16; 3],
    /// Grid entries with samples.
    pub stored_entries: usize,
    /// Bricks stored: equal ones once.
    pub bricks: usize,
    /// Points inside faces, along edges, at corners.
    pub points: [usize; 3],
    /// Bytes by kind.
    pub bytes: ByteCount,
    /// Mesh edges not used exactly twice; 0 for a closed shape.
    pub open_edges: usize,
    /// The sign away from the surface is the winding number's, because the shell is open or inconsistent.
    pub sign_by_winding: bool,
    /// Points at which normals and winding number were compared, and disagreed.
    pub sign_tests: usize,
    /// See [`Self::sign_tests`].
    pub sign_disagreements: usize,
    /// Most the tessellation leaves the faces, mm (taken out again by exact projection).
    pub chord_error_mm: f64,
    /// Stated bound of the exact distance's error, mm: 0 when all is analytic; see [`crate::ExactSurface::surface_error_mm`].
    #[serde(default)]
    pub surface_error_mm: f64,
    /// Faces without closed form.
    pub spline_faces: usize,
}

/// One part of the image.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PartReport {
    /// Its name.
    pub name: String,
    /// Its index in the model's parts.
    pub model_part: usize,
    /// Index into [`BakeReport::shapes`].
    pub shape: usize,
    /// Whether it may be grabbed.
    pub grabbable: bool,
    /// Bytes of its shape; 0 when an earlier part has the same shape.
    pub bytes: usize,
}

/// What a bake made.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BakeReport {
    /// Bytes of the image.
    pub image_bytes: usize,
    /// Bytes of all shapes by kind; header, part records and alignment make up the rest.
    pub bytes: ByteCount,
    /// In the image's order.
    pub parts: Vec<PartReport>,
    /// In the image's order.
    pub shapes: Vec<ShapeReport>,
    /// What was left out or is in doubt, in words.
    pub warnings: Vec<String>,
}
