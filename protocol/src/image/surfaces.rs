//! The surfaces of a shape that palettes name: its faces, then the local patches of its free-form faces.

use super::records::{FaceRecord, NO_FACE, PatchRecord};

/// Surfaces of a shape by *surface index*: faces come first, patches follow, so an index of at least the number of faces names a patch.
#[derive(Clone, Copy, Debug)]
pub struct Surfaces<'a> {
    /// Exact surfaces under the B-rep faces.
    pub faces: &'a [FaceRecord],
    /// Local patches of faces without closed form.
    pub patches: &'a [PatchRecord],
}

/// One surface of a shape.
#[derive(Clone, Copy, Debug)]
pub enum Surface<'a> {
    /// The unbounded surface of a face.
    Face(&'a FaceRecord),
    /// A local patch.
    Patch(&'a PatchRecord),
}

impl<'a> Surfaces<'a> {
    /// The surface with this index, if there is one.
    #[inline(always)]
    pub fn get(&self, surface: u16) -> Option<Surface<'a>> {
        let index = usize::from(surface);
        match self.faces.get(index) {
            Some(face) => Some(Surface::Face(face)),
            None => self.patches.get(index - self.faces.len()).map(Surface::Patch),
        }
    }

    /// The B-rep face that the surface belongs to; [`NO_FACE`] when there is no such surface.
    #[inline(always)]
    pub fn face_of(&self, surface: u16) -> u16 {
        match self.get(surface) {
            Some(Surface::Face(_)) => surface,
            Some(Surface::Patch(patch)) => patch.face,
            None => NO_FACE,
        }
    }
}
