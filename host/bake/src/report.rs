//! Result of a bake: bytes by part and kind, leaks, warnings.

use serde::{Deserialize, Serialize};

use crate::format::SampleFormat;
use crate::free_form_error::FreeFormError;
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
    /// Pieces of edges and their tree.
    #[serde(default)]
    pub edges: usize,
    /// Local patches of free-form faces.
    #[serde(default)]
    pub patches: usize,
    /// Shape and field records.
    pub records: usize,
}

impl ByteCount {
    /// Sum of all kinds.
    pub fn total(&self) -> usize {
        self.samples
            + self.indices
            + self.grid
            + self.bricks
            + self.palette
            + self.points
            + self.nodes
            + self.faces
            + self.edges
            + self.patches
            + self.records
    }
}

/// One shape of the image.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ShapeReport {
    /// First part with this shape.
    pub name: String,
    /// Cell edge, mm.
    pub cell_mm: f64,
    /// Content of its field.
    pub method: Method,
    /// Number format of distances.
    pub format: SampleFormat,
    /// One step of a sample, mm; the cell's edge where there are no distances.
    pub scale_mm: f64,
    /// Bricks along x, y, z.
    pub brick_dims: [u16; 3],
    /// Grid entries with samples.
    pub stored_entries: usize,
    /// Number of bricks stored; equal ones count once.
    pub bricks: usize,
    /// Number of points inside faces, along edges, at corners.
    pub points: [usize; 3],
    /// Bytes by kind.
    pub bytes: ByteCount,
    /// Mesh edges not used exactly twice; 0 for a closed shape.
    pub open_edges: usize,
    /// Whether the sign away from the surface is the winding number's, because the shell is open or inconsistent.
    pub sign_by_winding: bool,
    /// Number of points at which normals and winding number were compared.
    pub sign_tests: usize,
    /// Number of those at which they disagreed.
    pub sign_disagreements: usize,
    /// Largest deviation of the tessellation from the faces, mm (removed again by exact projection).
    pub chord_error_mm: f64,
    /// Stated error bound of the exact distance, mm: 0 when all faces are analytic; see [`crate::ExactSurface::surface_error_mm`].
    #[serde(default)]
    pub surface_error_mm: f64,
    /// Number of faces without closed form.
    pub spline_faces: usize,
    /// Measured error of the field near them.
    #[serde(default)]
    pub free_form: FreeFormError,
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

/// Report on a bake.
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
    /// Skipped parts and doubtful geometry, as text.
    pub warnings: Vec<String>,
}
