//! Palette entries of cells near free-form faces: whether and how local patches and exact surfaces give the distance there.
//!
//! A free-form face answers by its local patch in the cell or in one beside it ([`crate::cover`]). Alone, or as the largest or smallest of two or
//! three surfaces at a convex or re-entrant edge, the surfaces must give the distance at the cell's corners and, where a patch takes part, at places
//! inside the cell. Cells for which they do not are interpolated.

use glam::DVec3;
use mortise_brep::Surface;
use mortise_protocol::image::{Group, NO_FACE, Nearby};

use crate::cell_samples::{ExactSample, Place, about, corner_places, index};
use crate::cover::{LocalPatches, NEAR_CELLS, tolerance_at};
use crate::local_patch::board_distance;
use crate::rule::SAME_MM;
use crate::surface::signed_distance;

/// Most patches tried for one face of a group.
const MOST_CHOICES: usize = 8;

/// Samples and surfaces from which the nearest surfaces of the cells of a brick are found.
pub(crate) struct FreeFormCells<'a> {
    /// Faces of the shape: surface, and +1 where the outward normal is the natural one, −1 where it is reversed.
    pub faces: &'a [(Surface, f64)],
    /// Local patches of its free-form faces.
    pub patches: &'a LocalPatches,
    /// Largest error of a patch, mm.
    pub tolerance_mm: f64,
    /// 9³ samples of the brick, x fastest.
    pub samples: &'a [ExactSample],
    /// Position of sample (0, 0, 0), mm, and the sample step.
    pub origin: DVec3,
    pub cell: f64,
    /// Place of the brick's first cell in the grid.
    pub first: [u32; 3],
}

impl FreeFormCells<'_> {
    /// Palette entry of the cell with the lowest corner `at`; `nearest` is the face nearest to it, and `inside` returns exact samples inside it.
    pub fn of(&self, at: [usize; 3], nearest: u16, inside: impl FnOnce() -> Vec<Place>) -> Nearby {
        if nearest > Nearby::MAX_FACES {
            return Nearby::Unknown;
        }
        let mut places: Vec<Place> = corner_places(at).map(|place| self.place(place)).to_vec();
        let alone = self.alternatives(at, nearest);
        let choices_of = |faces: [u16; 3]| {
            faces.map(|face| match face {
                NO_FACE => vec![NO_FACE],
                _ => self.alternatives(at, face),
            })
        };
        let mut faces = self.faces_about(at, nearest, &[]);
        let mut choices = choices_of(faces);
        if (alone.iter().chain(choices.iter().flatten())).any(|&surface| self.is_patch(surface)) {
            let inside = inside();
            faces = self.faces_about(at, nearest, &inside);
            choices = choices_of(faces);
            places.extend(inside);
        }
        for surface in alone {
            let group = [surface, NO_FACE, NO_FACE];
            if self.all(&places, &group, f64::max, |_| true) {
                return Nearby::Face(surface);
            }
        }
        if faces[1] != NO_FACE {
            for group in combinations(&choices) {
                if self.all(&places, &group, f64::max, |exact| exact <= SAME_MM) {
                    return plain(&group).map_or(Nearby::Roughly(nearest), Nearby::Convex);
                }
                if self.all(&places, &group, f64::min, |exact| exact >= -SAME_MM) {
                    return plain(&group).map_or(Nearby::Roughly(nearest), Nearby::Reentrant);
                }
            }
        }
        Nearby::Roughly(nearest)
    }

    /// Distance that the board computes at a place of the cell with the lowest corner `at`, before rounding; `None` where it is only a bound.
    pub fn rendered(&self, at: [usize; 3], nearby: Nearby, place: &Place) -> Option<f64> {
        let fold = |group: Group, fold: fn(f64, f64) -> f64| {
            let each = group.faces().map(|(surface, _)| surface);
            each.map(|surface| self.distance(surface, place.at)).reduce(fold)
        };
        match nearby {
            Nearby::Face(surface) => Some(self.distance(surface, place.at)),
            Nearby::Convex(group) => fold(group, f64::max).filter(|_| place.exact.distance <= 0.0),
            Nearby::Reentrant(group) => fold(group, f64::min).filter(|_| place.exact.distance >= 0.0),
            Nearby::Roughly(_) | Nearby::Unknown => {
                let lowest = self.place(at).at;
                let fraction = (place.at - lowest) / self.cell;
                let weighted = corner_places(at).into_iter().enumerate().map(|(c, corner)| {
                    let along = |a: usize| {
                        if c >> a & 1 == 1 {
                            fraction[a]
                        } else {
                            1.0 - fraction[a]
                        }
                    };
                    along(0) * along(1) * along(2) * self.samples[index(corner)].distance
                });
                Some(weighted.sum())
            }
        }
    }

    /// Surfaces that can stand for a face in a cell: the face itself, or its patches in the cell and in those around it.
    fn alternatives(&self, at: [usize; 3], face: u16) -> Vec<u16> {
        if !matches!(self.faces.get(usize::from(face)), Some((Surface::Spline, _))) {
            return vec![face];
        }
        let cell: [u32; 3] = std::array::from_fn(|a| self.first[a] + at[a] as u32);
        let mut found: Vec<u16> = Vec::new();
        // The cell itself first.
        for i in (0..27).map(|i| (i + 13) % 27) {
            let step = [i % 3, i / 3 % 3, i / 9];
            let beside = std::array::from_fn(|a| (cell[a] + step[a]).wrapping_sub(1));
            let patch = self.patches.patch(beside, face);
            let surface = patch.map(|patch| self.faces.len() as u16 + patch);
            found.extend(surface.filter(|surface| !found.contains(surface)));
        }
        found
    }

    fn is_patch(&self, surface: u16) -> bool {
        surface != NO_FACE && usize::from(surface) >= self.faces.len()
    }

    /// Whether `fold` of the distances to the surfaces of `group` has, at all places, the sign of the true distance and no larger magnitude, and equals
    /// the true distance where `must` requires it.
    fn all(
        &self,
        places: &[Place],
        group: &[u16; 3],
        fold: impl Fn(f64, f64) -> f64,
        must: impl Fn(f64) -> bool,
    ) -> bool {
        let any_patch = group.iter().any(|&surface| self.is_patch(surface));
        places.iter().all(|place| {
            let exact = place.exact.distance;
            let tolerance = match any_patch {
                true => SAME_MM + tolerance_at(self.tolerance_mm, self.cell, exact),
                false => SAME_MM,
            };
            let found = (group.iter().filter(|&&surface| surface != NO_FACE))
                .map(|&surface| self.distance(surface, place.at))
                .reduce(|a, b| {
                    if a.is_nan() || b.is_nan() {
                        f64::NAN
                    } else {
                        fold(a, b)
                    }
                })
                .unwrap_or(f64::NAN);
            if found.is_nan() {
                // Beyond the centre of curvature of a patch the board interpolates.
                any_patch && exact.abs() > NEAR_CELLS * self.cell
            } else if must(exact) {
                (found - exact).abs() <= tolerance
            } else {
                found * exact > 0.0 && found.abs() <= exact.abs() + tolerance
            }
        })
    }

    /// Whether a cell has another face about it, or at a place `inside` it, than `nearest`.
    pub fn at_edge(&self, at: [usize; 3], nearest: u16, inside: &[Place]) -> bool {
        let inside = inside.iter().map(|place| place.exact.face);
        (about(at)
            .map(|place| self.samples[index(place)].face)
            .chain(inside))
        .any(|face| face != nearest)
    }

    /// The faces nearest to the samples around a cell and to the places `inside` it, `nearest` first; only `nearest` if there are more than three. At
    /// the brick's border the samples beyond it are not seen, and the edge of another face that just enters the cell shows inside only.
    fn faces_about(&self, at: [usize; 3], nearest: u16, inside: &[Place]) -> [u16; 3] {
        let mut group = [nearest, NO_FACE, NO_FACE];
        let mut count = 1;
        let inside = inside.iter().map(|place| place.exact.face);
        for face in about(at)
            .map(|place| self.samples[index(place)].face)
            .chain(inside)
        {
            if face == NO_FACE || group[..count].contains(&face) {
                continue;
            }
            if count == 3 || face > Nearby::MAX_FACES {
                return [nearest, NO_FACE, NO_FACE];
            }
            group[count] = face;
            count += 1;
        }
        group
    }

    /// Exact sample at a place of the brick's lattice.
    pub fn place(&self, place: [usize; 3]) -> Place {
        Place {
            at: self.origin + DVec3::from_array(place.map(|i| i as f64)) * self.cell,
            exact: self.samples[index(place)],
        }
    }

    /// Signed distance to a surface by its index, mm: to the unbounded surface of a face, NaN where it has no closed form, or to a patch.
    fn distance(&self, surface: u16, p: DVec3) -> f64 {
        let number = usize::from(surface);
        match self.faces.get(number) {
            Some((face, sense)) => signed_distance(face, p) * sense,
            None => (self.patches.records.get(number - self.faces.len()))
                .map_or(f64::NAN, |patch| board_distance(patch, p)),
        }
    }
}

/// Group of up to three surfaces, each a clause of its own.
fn plain(group: &[u16; 3]) -> Option<Group> {
    let used = group.iter().filter(|&&surface| surface != NO_FACE);
    let clauses: Vec<&[u16]> = used.map(std::slice::from_ref).collect();
    Group::new(&clauses)
}

/// All groups with one surface of each choice; none where a choice is empty.
fn combinations(choices: &[Vec<u16>; 3]) -> impl Iterator<Item = [u16; 3]> {
    let [a, b, c] = choices
        .each_ref()
        .map(|choice| &choice[..choice.len().min(MOST_CHOICES)]);
    (a.iter()).flat_map(move |&a| b.iter().flat_map(move |&b| c.iter().map(move |&c| [a, b, c])))
}
