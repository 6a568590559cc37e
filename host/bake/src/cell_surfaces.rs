//! Surfaces that can answer in a cell: unbounded surfaces of faces, local patches of free-form ones, and sides of smooth edges.

use glam::DVec3;
use mortise_brep::Surface;
use mortise_protocol::image::PatchRecord;

use crate::cell_samples::{ExactSample, Place};
use crate::cover::{LocalPatches, NEAR_CELLS, RELAXED, tolerance_at};
use crate::distance::ExactSurface;
use crate::format::FieldOptions;
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
    options: &'a FieldOptions<'a>,
    /// Cell edge, mm.
    cell: f64,
}

impl<'a> CellSurfaces<'a> {
    /// Of the faces of `surface`, their `patches` and the `sides` of their edges.
    pub fn new(
        surface: &ExactSurface,
        (patches, sides): (&'a LocalPatches, &'a Sides),
        options: &'a FieldOptions<'a>,
        cell: f64,
    ) -> Self {
        Self {
            faces: (surface.shape().faces.iter())
                .map(|face| (face.surface, if face.reversed { -1.0 } else { 1.0 }))
                .collect(),
            patches,
            sides,
            options,
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
    pub fn tolerance(&self, with_patches: bool, exact: &ExactSample, relaxed: f64) -> f64 {
        if with_patches {
            let of_patches = self.options.patch_tolerance_mm * self.options.factor(exact.face);
            SAME_MM + tolerance_at(relaxed * of_patches, self.cell, exact.distance)
        } else {
            SAME_MM
        }
    }

    /// By how much the tolerance may be relaxed: not where finer bricks can keep it.
    pub fn relaxations(&self) -> &'static [f64] {
        if self.options.finer.is_some() {
            &RELAXED[..1]
        } else {
            &RELAXED
        }
    }

    /// Whether a cell is so far from the surface, all of it, that no patch answers there.
    pub fn is_far(&self, corners: &[Place; 8]) -> bool {
        let nearest = corners.iter().map(|corner| corner.exact.distance.abs());
        nearest.fold(f64::INFINITY, f64::min) > self.cell
    }

    /// Whether a reader may interpolate at this distance from the surface where a patch has no foot.
    pub fn may_interpolate(&self, exact: f64) -> bool {
        exact.abs() > NEAR_CELLS * self.cell
    }

    /// Surfaces that can stand for each sheet of a face in a cell of the grid, the best first: the face itself, or its patches in the cell and in those
    /// around it, by their error at those of the `places` that are nearest to the sheet.
    pub fn alternatives(&self, cell: [u32; 3], face: u16, places: &[Place]) -> Vec<Vec<u16>> {
        let rated = self.rated(cell, face, places).into_iter();
        rated
            .map(|sheet| sheet.into_iter().map(|(_, surface)| surface).collect())
            .collect()
    }

    /// Whether no surface gives the distance of a sheet of a face at those of the `places` that are nearest to it.
    pub fn has_none(&self, cell: [u32; 3], face: u16, places: &[Place]) -> bool {
        let is_nearest =
            |place: &Place| place.exact.face == face && !self.may_interpolate(place.exact.distance);
        let Some(first) = places.iter().find(|place| is_nearest(place)) else {
            return false;
        };
        let most = self.tolerance(
            true,
            &ExactSample {
                distance: 0.0,
                ..first.exact
            },
            RELAXED[2],
        );
        let best = |sheet: &Vec<(f64, u16)>| sheet.first().map_or(f64::INFINITY, |best| best.0);
        self.rated(cell, face, places)
            .iter()
            .any(|sheet| best(sheet) > most)
    }

    /// The same with their errors, mm.
    fn rated(&self, cell: [u32; 3], face: u16, places: &[Place]) -> Vec<Vec<(f64, u16)>> {
        if !self.is_free_form(face) {
            return vec![vec![(0.0, face)]];
        }
        let mut found: Vec<u16> = Vec::new();
        // The cell itself first.
        for i in (0..27).map(|i| (i + 13) % 27) {
            let step = [i % 3, i / 3 % 3, i / 9];
            let beside = std::array::from_fn(|a| (cell[a] + step[a]).wrapping_sub(1));
            for sheet in self.patches.sheets(beside, face) {
                let surface = self.faces.len() as u16 + sheet.patch;
                if !found.contains(&surface) {
                    found.push(surface);
                }
            }
        }
        let sheets = self.patches.sheets(cell, face);
        let own = |sheet: usize| {
            let near =
                |place: &&Place| place.exact.face == face && !self.may_interpolate(place.exact.distance);
            let of_sheet = move |place: &&Place| {
                sheets.len() < 2 || LocalPatches::sheet_of(sheets, place) == Some(sheet)
            };
            places
                .iter()
                .filter(near)
                .filter(of_sheet)
                .collect::<Vec<&Place>>()
        };
        let error = |surface: u16, own: &[&Place]| {
            let Some(patch) = self.patch(surface) else {
                return f64::INFINITY;
            };
            (own.iter().filter(|place| is_foot(patch, place)))
                .map(|place| (board_distance(patch, place.at) - place.exact.distance).abs())
                .map(|error| if error.is_nan() { f64::INFINITY } else { error })
                .fold(0.0, f64::max)
        };
        (0..sheets.len().max(1))
            .map(|sheet| {
                let own = own(sheet);
                let rated = found.iter().map(|&surface| (error(surface, &own), surface));
                let mut rated: Vec<(f64, u16)> = rated.collect();
                rated.sort_by(|a, b| a.0.total_cmp(&b.0));
                rated
            })
            .collect()
    }

    /// Number of sheets of a face in a cell that have patches of their own.
    pub fn sheet_count(&self, cell: [u32; 3], face: u16) -> usize {
        self.patches.sheets(cell, face).len()
    }
}
