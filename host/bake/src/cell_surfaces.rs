//! Surfaces that can answer in a cell: unbounded surfaces of faces, local patches of free-form ones, and sides of smooth edges.

use glam::DVec3;
use mortise_brep::Surface;
use mortise_protocol::image::PatchRecord;

use crate::cell_samples::Place;
use crate::cover::{LocalPatches, NEAR_CELLS, RELAXED, tolerance_at};
use crate::distance::ExactSurface;
use crate::local_patch::{board_distance, board_foot, is_foot};
use crate::rule::SAME_MM;
use crate::sides::Sides;
use crate::surface::{project, signed_distance};

/// Surfaces of a shape by their surface index: faces first, then patches, then sides.
pub(crate) struct CellSurfaces<'a> {
    /// Faces: surface, and +1 where the outward normal is the natural one, −1 where it is reversed.
    faces: Vec<(Surface, f64)>,
    patches: &'a LocalPatches,
    /// Sides of smooth edges, behind the patches.
    sides: &'a Sides,
    /// Largest error of a patch, mm.
    tolerance_mm: f64,
    /// Cell edge, mm.
    cell: f64,
}

impl<'a> CellSurfaces<'a> {
    /// Of the faces of `surface`, their `patches` and the `sides` of their edges.
    pub fn new(
        surface: &ExactSurface,
        (patches, sides): (&'a LocalPatches, &'a Sides),
        tolerance_mm: f64,
        cell: f64,
    ) -> Self {
        Self {
            faces: (surface.shape().faces.iter())
                .map(|face| (face.surface, if face.reversed { -1.0 } else { 1.0 }))
                .collect(),
            patches,
            sides,
            tolerance_mm,
            cell,
        }
    }

    /// Whether a surface is a patch.
    pub fn is_patch(&self, surface: u16) -> bool {
        self.patch(surface).is_some()
    }

    /// Whether a face answers by patches only.
    pub fn is_free_form(&self, face: u16) -> bool {
        matches!(self.faces.get(usize::from(face)), Some((Surface::Spline, _)))
    }

    /// Number of different surfaces under these faces. Where a face enters a cell, only its own surface is zero: with more of them than a group names
    /// there is no rule.
    pub fn count(&self, faces: &[u16]) -> usize {
        let surface = |face: u16| self.faces.get(usize::from(face));
        let is_first =
            |&(i, &face): &(usize, &u16)| !faces[..i].iter().any(|&other| surface(other) == surface(face));
        let free_forms = faces.iter().filter(|&&face| self.is_free_form(face)).count();
        let closed = faces.iter().enumerate().filter(is_first);
        closed.filter(|&(_, &face)| !self.is_free_form(face)).count() + free_forms
    }

    fn patch(&self, surface: u16) -> Option<&PatchRecord> {
        let number = usize::from(surface).checked_sub(self.faces.len())?;
        self.patches.records.get(number)
    }

    /// Surface indices of the sides of edges between two of these faces, which are in ascending order.
    pub fn sides(&self, faces: &'a [u16]) -> impl Iterator<Item = u16> + 'a {
        self.sides.among(faces)
    }

    /// Signed distance to a surface, or that by which a side counts, mm: NaN where it has none.
    pub fn distance(&self, surface: u16, p: DVec3) -> f64 {
        let number = usize::from(surface);
        match self.faces.get(number) {
            Some((face, sense)) => signed_distance(face, p) * sense,
            None => self.patch(surface).map_or_else(
                || self.sides.distance(surface, p),
                |patch| board_distance(patch, p),
            ),
        }
    }

    /// Point of a surface nearest to `p`.
    pub fn foot(&self, surface: u16, p: DVec3) -> Option<DVec3> {
        let number = usize::from(surface);
        match self.faces.get(number) {
            Some((face, _)) => project(face, p, p).map(|on| on.point),
            None => board_foot(self.patch(surface)?, p),
        }
    }

    /// Largest error of a rule where the exact distance is `exact`, mm: with patches theirs times `relaxed`.
    pub fn tolerance(&self, with_patches: bool, exact: f64, relaxed: f64) -> f64 {
        if with_patches {
            SAME_MM + tolerance_at(relaxed * self.tolerance_mm, self.cell, exact)
        } else {
            SAME_MM
        }
    }

    /// Whether a reader may interpolate at this distance from the surface where a patch has no foot.
    pub fn may_interpolate(&self, exact: f64) -> bool {
        exact.abs() > NEAR_CELLS * self.cell
    }

    /// Surfaces that can stand for a face in a cell of the grid, the best first: the face itself, or its patches in the cell and in those around it, by
    /// their error at those of the `places` to which the face is nearest.
    pub fn alternatives(&self, cell: [u32; 3], face: u16, places: &[Place]) -> Vec<u16> {
        let rated = self.rated(cell, face, places);
        rated.into_iter().map(|(_, surface)| surface).collect()
    }

    /// Whether no surface gives the distance of a face at those of the `places` to which it is nearest.
    pub fn has_none(&self, cell: [u32; 3], face: u16, places: &[Place]) -> bool {
        let best = self
            .rated(cell, face, places)
            .first()
            .map_or(f64::INFINITY, |best| best.0);
        let is_nearest =
            |place: &Place| place.exact.face == face && !self.may_interpolate(place.exact.distance);
        best > self.tolerance(true, 0.0, RELAXED[2]) && places.iter().any(is_nearest)
    }

    /// The same with their errors, mm.
    fn rated(&self, cell: [u32; 3], face: u16, places: &[Place]) -> Vec<(f64, u16)> {
        if !self.is_free_form(face) {
            return vec![(0.0, face)];
        }
        let mut found: Vec<u16> = Vec::new();
        // The cell itself first.
        for i in (0..27).map(|i| (i + 13) % 27) {
            let step = [i % 3, i / 3 % 3, i / 9];
            let beside = std::array::from_fn(|a| (cell[a] + step[a]).wrapping_sub(1));
            let patch = self.patches.patch(beside, face);
            let surface = patch.map(|patch| self.faces.len() as u16 + patch);
            found.extend(surface.filter(|surface| !found.contains(surface)));
        }
        let own: Vec<&Place> = (places.iter())
            .filter(|place| place.exact.face == face && !self.may_interpolate(place.exact.distance))
            .collect();
        let error = |surface: u16| {
            let Some(patch) = self.patch(surface) else {
                return f64::INFINITY;
            };
            (own.iter().filter(|place| is_foot(patch, place)))
                .map(|place| (board_distance(patch, place.at) - place.exact.distance).abs())
                .map(|error| if error.is_nan() { f64::INFINITY } else { error })
                .fold(0.0, f64::max)
        };
        let mut rated: Vec<(f64, u16)> = found
            .into_iter()
            .map(|surface| (error(surface), surface))
            .collect();
        rated.sort_by(|a, b| a.0.total_cmp(&b.0));
        rated
    }
}
