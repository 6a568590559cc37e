//! What is made for the shapes of a scene before it is put together, and its bytes.

use mortise_protocol::image::{BrickRecord, NodeRecord, PatchRecord};

use crate::field::BakedField;
use crate::image::shell_bytes;
use crate::shell::Pointshell;
use crate::tree::node_count;

/// Cell edge over the pointshell's default error bound. The error reaches the bound only where a lone convex edge or a curved face touches a
/// dissimilar surface; in a fit it is smaller by the factor of the radius difference over the radius.
pub(crate) const EPSILON_PER_CELL: f64 = 20.0;
/// Fields and pointshells made for the shapes.
pub(crate) struct Made {
    pub fields: Vec<BakedField>,
    pub shells: Vec<Pointshell>,
}

impl Made {
    /// Bytes of the shapes in the image, without parts and header.
    pub fn bytes(&self) -> u64 {
        let shells = self.shells.iter().map(|shell| {
            (shell_bytes(shell) + node_count(shell.points.len()) * size_of::<NodeRecord>()) as u64
        });
        self.fields.iter().map(field_bytes).chain(shells).sum()
    }
}

/// Bytes of a field in the image.
pub(crate) fn field_bytes(field: &BakedField) -> u64 {
    let bricks = field.bricks.len() * size_of::<BrickRecord>();
    // Alignment of the blob and of the grid: less than 8 bytes.
    let patches = field.patches.len() * size_of::<PatchRecord>();
    (field.blob.len() + 2 * field.grid.len() + bricks + 2 * field.palette.len() + patches + 8) as u64
}
