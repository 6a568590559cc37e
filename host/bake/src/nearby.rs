//! Palette entries: whether and how exact surfaces give the distance in a cell.
//!
//! A point of a cell has its nearest surface point on one of the faces with a triangle near the cell; among these the cell's rule is sought. The cell
//! is *exact* where one face's unbounded surface gives the distance. At convex edges, corners and thin walls the largest of several distances does
//! (exact inside and at the faces; outside it is a lower bound of the right sign), at re-entrant ones the smallest, at mixed ones a largest of
//! smallest ones or the reverse (see `rule`), in which sides of smooth edges may take part ([`crate::sides`]). For a free-form face its local patch answers ([`crate::cover`]).
//!
//! A rule is tested against the exact distance at the corners and half-way between them, and at places on and beside every face, edge and corner in the
//! cell ([`crate::cell_features`]). Where the surface crosses the cell it is then verified on another lattice, and where one of its surfaces appears to
//! be the boundary, and in any cell where surfaces of the rule meet ([`crate::meetings`]); a place at which it fails joins the tests of the next attempt.
//! All this extends a little beyond the cell: a bound that is zero on the cell's border, clear of the surface, would be felt there. Cells without a rule
//! are interpolated.

use glam::DVec3;
use mortise_protocol::image::{BRICK_CELLS, BRICK_SAMPLES, Group, NO_FACE, Nearby};

use crate::cell_features::CellFeatures;
use crate::cell_samples::{ExactSample, Place, about, corner_places};
use crate::cell_surfaces::CellSurfaces;
use crate::cover::LocalPatches;
use crate::distance::{ExactSurface, Scratch};
use crate::meetings::{Extent, bends, lattice, meetings};
use crate::rule::{SAME_MM, Test, find_rule, holds, value};

/// Half steps of samples along a brick's edge.
const HALVES: usize = 2 * BRICK_CELLS + 1;
/// Attempts to find a rule: each failed one adds tests.
const ATTEMPTS: usize = 4;
/// The same where sides of smooth edges take part, after the attempts without them.
const ATTEMPTS_WITH_SIDES: usize = 10;
/// Most sides that take part: two for each smooth edge.
const MOST_SIDES: usize = 16;
/// Points along a cell's edge at which the rule of a crossed cell is verified.
const VERIFIED: usize = 4;
/// Share of a cell's edge by which rules hold beyond the cell.
const BEYOND: f64 = 0.01;
/// Most feet of verified points on surfaces of a rule that are tested.
const MOST_FEET: usize = 24;
/// Points along a cell's edge at which a rule with sides of edges is compared with the near faces, and most of them that are tested.
const SUSPECTED: usize = 9;
const MOST_SUSPECT: usize = 32;
/// Most patches tried for a free-form face beside the best one.
const MOST_OTHERS: usize = 4;

/// Where a field's cells are: the brick, its exact samples and its surfaces.
#[derive(Clone, Copy)]
pub(crate) struct BrickCells<'a> {
    /// 9³ samples of the brick, x fastest.
    pub samples: &'a [ExactSample],
    /// Position of sample (0, 0, 0), mm, and the sample step.
    pub origin: DVec3,
    pub cell: f64,
    /// Place of the brick's first cell in the grid.
    pub first: [u32; 3],
    /// Surfaces that can answer.
    pub surfaces: &'a CellSurfaces<'a>,
}

impl BrickCells<'_> {
    /// Exact sample at a place of the brick's lattice.
    pub fn place(&self, place: [usize; 3]) -> Place {
        Place {
            at: self.position(place),
            exact: self.samples[index(place, BRICK_SAMPLES)],
        }
    }

    fn position(&self, place: [usize; 3]) -> DVec3 {
        self.origin + DVec3::from_array(place.map(|i| i as f64)) * self.cell
    }
}

/// Finds the palette entries of a brick's cells.
pub(crate) struct CellNearby<'a> {
    surface: &'a ExactSurface,
    brick: BrickCells<'a>,
    /// Exact samples inside cells near free-form faces.
    patches: &'a LocalPatches,
    /// Whether only one face is near the brick.
    alone: bool,
    /// Exact samples on the lattice of half steps, where already computed.
    halves: Vec<Option<ExactSample>>,
    /// Exact samples on the lattice by which the present cell's rules are verified; empty where not yet computed.
    lattice: Vec<Place>,
    scratch: Scratch,
    /// Number of crossed cells so far that have no rule although all near faces have a closed form.
    pub unproven: usize,
}

/// Surfaces that stand for the faces near a cell, and the tests of their rule.
struct Trial {
    surfaces: Vec<u16>,
    /// Number of those that are no sides of edges, which stand behind them.
    faces: usize,
    with_patches: bool,
    nearest: u16,
    /// Factor of the tolerance.
    relaxed: f64,
    tests: Vec<Test>,
}

impl<'a> CellNearby<'a> {
    /// Of a brick of `surface`.
    pub fn new(surface: &'a ExactSurface, brick: BrickCells<'a>, patches: &'a LocalPatches) -> Self {
        let mut this = Self {
            surface,
            brick,
            patches,
            alone: false,
            halves: vec![None; HALVES * HALVES * HALVES],
            lattice: Vec::new(),
            scratch: Scratch::default(),
            unproven: 0,
        };
        let edge = brick.cell * BRICK_CELLS as f64;
        let center = brick.origin + DVec3::splat(0.5 * edge);
        this.alone = this
            .features(center, edge * (1.0 + BEYOND), f64::INFINITY)
            .faces
            .len()
            < 2;
        this
    }

    /// Palette entry of the cell with the lowest corner `at`; `nearest` is the face nearest to it.
    pub fn of(&mut self, at: [usize; 3], nearest: u16) -> Nearby {
        if nearest > Nearby::MAX_FACES {
            return Nearby::Unknown;
        }
        let features = if self.alone {
            CellFeatures {
                faces: vec![nearest],
                ..CellFeatures::default()
            }
        } else {
            let center = self.brick.position(at) + DVec3::splat(0.5 * self.brick.cell);
            self.features(center, self.brick.cell * (1.0 + 2.0 * BEYOND), self.within(at))
        };
        let surfaces = self.brick.surfaces;
        let corners = corner_places(at).map(|place| self.brick.place(place));
        if surfaces.is_free_form(nearest) && surfaces.is_far(&corners) {
            return Nearby::Roughly(nearest);
        }
        let cell = std::array::from_fn(|a| self.brick.first[a] + at[a] as u32);
        let known = self.patches.verified(cell);
        if let Some(known) = known {
            // Without a patch that holds at the places known already no others need be queried.
            let mut few = corners.to_vec();
            few.extend(known);
            let has_none = |face: &u16| surfaces.has_none(cell, *face, &few);
            if features.faces.iter().any(has_none) {
                return Nearby::Roughly(nearest);
            }
        }
        let is_alone =
            features.faces.len() < 2 || (known.is_some() && self.is_within_a_face(at, nearest, &features));
        if is_alone && surfaces.sheet_count(cell, nearest) < 2 {
            return self.one_face(at, cell, nearest);
        }
        self.several_faces(at, cell, nearest, features)
    }

    /// Whether no other face enters a cell near free-form faces, and none is nearest about it.
    fn is_within_a_face(&self, at: [usize; 3], nearest: u16, features: &CellFeatures) -> bool {
        features.entering.iter().all(|&face| face == nearest)
            && about(at).all(|place| self.brick.place(place).exact.face == nearest)
    }

    /// Entry of a cell near one face only.
    fn one_face(&mut self, at: [usize; 3], cell: [u32; 3], nearest: u16) -> Nearby {
        let surfaces = self.brick.surfaces;
        let places = if surfaces.is_free_form(nearest) {
            let mut places = self.places(at, &[]);
            places.extend(self.patches.verified(cell).into_iter().flatten());
            places
        } else {
            corner_places(at).map(|place| self.brick.place(place)).to_vec()
        };
        let answering = surfaces.alternatives(cell, nearest, &places).concat();
        let holds_with = |surface: u16, relaxed: f64| {
            let rule = Nearby::Face(surface);
            let trial = self.trial(vec![surface], surface, &places, relaxed);
            trial.tests.iter().all(|test| holds(rule, test, &trial.surfaces))
        };
        let found = surfaces.relaxations().iter().find_map(|&relaxed| {
            let mut answering = answering.iter().copied();
            answering.find(|&surface| holds_with(surface, relaxed))
        });
        found.map_or(Nearby::Roughly(nearest), Nearby::Face)
    }

    /// Entry of a cell near several faces.
    fn several_faces(
        &mut self,
        at: [usize; 3],
        cell: [u32; 3],
        nearest: u16,
        features: CellFeatures,
    ) -> Nearby {
        let crossed = !features.entering.is_empty();
        if self.brick.surfaces.count(&features.entering) > Group::MOST {
            return self.without_rule(nearest, &features);
        }
        self.lattice.clear();
        let mut places = self.places(at, &features.places);
        places.extend(self.patches.verified(cell).into_iter().flatten());
        let mut own = None;
        let mut choices: Vec<Vec<u16>> = Vec::new();
        for &face in &features.faces {
            if face == nearest {
                own = Some(choices.len());
            }
            choices.extend(self.brick.surfaces.alternatives(cell, face, &places));
        }
        let closed = self.is_closed(&features);
        let sides: Vec<u16> = (self.brick.surfaces.sides(&features.faces))
            .take(MOST_SIDES)
            .collect();
        let relaxations = self.brick.surfaces.relaxations();
        for &relaxed in if closed { &relaxations[..1] } else { relaxations } {
            // Others than the best patches may keep the tolerance itself.
            let most = if relaxed > 1.0 { 1 } else { usize::MAX };
            for mut surfaces in selections(&choices).into_iter().take(most) {
                let of_nearest = own.map_or(NO_FACE, |own| surfaces[own]);
                surfaces.extend(&sides);
                let mut trial = self.trial(surfaces, of_nearest, &places, relaxed);
                trial.faces -= sides.len();
                if let Some(rule) = self.rule(at, crossed, &mut trial, &mut places) {
                    return rule;
                }
            }
        }
        self.without_rule(nearest, &features)
    }

    /// Whether all near faces have a closed form.
    fn is_closed(&self, features: &CellFeatures) -> bool {
        let surfaces = self.brick.surfaces;
        features.faces.iter().all(|&face| !surfaces.is_free_form(face))
    }

    /// Entry of a cell without a rule, which is counted where there should be one.
    fn without_rule(&mut self, nearest: u16, features: &CellFeatures) -> Nearby {
        if !features.entering.is_empty() && self.is_closed(features) {
            self.unproven += 1;
        }
        Nearby::Roughly(nearest)
    }

    /// The rule of a cell with these surfaces, if one is found; places at which one failed join `places`.
    fn rule(
        &mut self,
        at: [usize; 3],
        crossed: bool,
        trial: &mut Trial,
        places: &mut Vec<Place>,
    ) -> Option<Nearby> {
        let attempts = if trial.faces < trial.surfaces.len() {
            ATTEMPTS_WITH_SIDES
        } else {
            ATTEMPTS
        };
        for _ in 0..attempts {
            let rule = find_rule(&trial.tests, &trial.surfaces, trial.faces, trial.nearest)?;
            let mut failed = if crossed {
                self.failures(at, rule, trial)
            } else {
                Vec::new()
            };
            if failed.is_empty() {
                failed = self.failures_at_meetings(at, rule, trial);
            }
            if failed.is_empty() {
                return Some(rule);
            }
            let more: Vec<Test> = failed.iter().map(|place| self.test(trial, place)).collect();
            trial.tests.extend(more);
            places.extend(failed);
        }
        None
    }

    /// Tests of these surfaces at these places, with the tolerance times `relaxed`.
    fn trial(&self, surfaces: Vec<u16>, nearest: u16, places: &[Place], relaxed: f64) -> Trial {
        let mut trial = Trial {
            with_patches: surfaces
                .iter()
                .any(|&surface| self.brick.surfaces.is_patch(surface)),
            faces: surfaces.len(),
            surfaces,
            nearest,
            relaxed,
            tests: Vec::with_capacity(places.len()),
        };
        trial.tests = places.iter().map(|place| self.test(&trial, place)).collect();
        trial
    }

    fn test(&self, trial: &Trial, place: &Place) -> Test {
        let surfaces = self.brick.surfaces;
        let distance = place.exact.distance;
        Test {
            distance,
            faces: (trial.surfaces.iter())
                .map(|&surface| surfaces.distance(surface, place.at))
                .collect(),
            tolerance: surfaces.tolerance(trial.with_patches, &place.exact, trial.relaxed),
            may_interpolate: trial.with_patches && surfaces.may_interpolate(distance),
        }
    }

    /// Largest error of interpolation in a cell, near the surface, over what may err there.
    pub fn interpolation_over(&mut self, at: [usize; 3]) -> f64 {
        let places = self.places(at, &[]);
        let near = (places.iter()).filter(|place| !self.brick.surfaces.may_interpolate(place.exact.distance));
        near.map(|place| {
            let error = (self.brick.interpolated(at, place) - place.exact.distance).abs();
            error / self.brick.surfaces.tolerance(true, &place.exact, 1.0)
        })
        .fold(0.0, f64::max)
    }

    /// Faces and places of the cube with this centre and edge. No face is farther from the centre than `within`.
    fn features(&mut self, center: DVec3, edge: f64, within: f64) -> CellFeatures {
        let Some(nearest) = self.surface.query(center, within, &mut self.scratch) else {
            return CellFeatures::default();
        };
        let diagonal = edge * 3f64.sqrt();
        let radius = nearest.distance.abs() + diagonal + 2.0 * self.surface.chord + SAME_MM;
        CellFeatures::of(self.surface, center, edge, radius)
    }

    /// Exact samples on the lattice of half steps of the cell, and at points of features.
    pub fn places(&mut self, at: [usize; 3], of_features: &[DVec3]) -> Vec<Place> {
        let mut places = Vec::with_capacity(27 + of_features.len());
        for i in 0..27 {
            let place = [2 * at[0] + i % 3, 2 * at[1] + i / 3 % 3, 2 * at[2] + i / 9];
            let p = self.brick.origin + DVec3::from_array(place.map(|i| i as f64)) * (0.5 * self.brick.cell);
            let exact = if place.iter().all(|i| i % 2 == 0) {
                self.brick.samples[index(place.map(|i| i / 2), BRICK_SAMPLES)]
            } else {
                match self.halves[index(place, HALVES)] {
                    Some(known) => known,
                    None => self.exact(at, p),
                }
            };
            self.halves[index(place, HALVES)] = Some(exact);
            places.push(Place { at: p, exact });
        }
        places.extend(of_features.iter().map(|&p| Place {
            at: p,
            exact: self.exact(at, p),
        }));
        places
    }

    /// Places at which `rule` fails: of the lattice by which a crossed cell is verified, and of its feet on surfaces where the rule has the boundary.
    fn failures(&mut self, at: [usize; 3], rule: Nearby, trial: &Trial) -> Vec<Place> {
        let low = self.brick.position(at);
        if self.lattice.is_empty() {
            self.lattice = (0..VERIFIED * VERIFIED * VERIFIED)
                .map(|i| {
                    let place = [i % VERIFIED, i / VERIFIED % VERIFIED, i / VERIFIED / VERIFIED];
                    let share = DVec3::from_array(place.map(|i| i as f64 / (VERIFIED - 1) as f64));
                    let p = low + (share * (1.0 + 2.0 * BEYOND) - BEYOND) * self.brick.cell;
                    Place {
                        at: p,
                        exact: self.exact(at, p),
                    }
                })
                .collect();
        }
        let feet = self.feet(low, rule);
        let feet: Vec<Place> = (feet.into_iter())
            .map(|p| Place {
                at: p,
                exact: self.exact(at, p),
            })
            .collect();
        (self.lattice.iter().copied().chain(feet))
            .filter(|place| !holds(rule, &self.test(trial, place), &trial.surfaces))
            .collect()
    }

    /// Places at which `rule` fails where its surfaces meet, if it leaves out another one or sides take part: beyond the cell too where it is zero, and in
    /// the cell where it changes from one to another and a face may be nearer.
    fn failures_at_meetings(&mut self, at: [usize; 3], rule: Nearby, trial: &Trial) -> Vec<Place> {
        let (Nearby::Convex(group) | Nearby::Reentrant(group)) = rule else {
            return Vec::new();
        };
        let surfaces = self.brick.surfaces;
        let is_named = |surface: &u16| group.faces().any(|(named, _)| named == *surface);
        let near = &trial.surfaces[..trial.faces];
        let (named, omitted): (Vec<u16>, Vec<u16>) = near.iter().partition(|&surface| is_named(surface));
        // Across sides of edges the rule jumps (or it has a face twice).
        let has_sides = group.faces().count() > named.len();
        if omitted.is_empty() && !has_sides {
            return Vec::new();
        }
        let to: Vec<_> = (named.iter())
            .map(|&surface| move |p: DVec3| surfaces.distance(surface, p))
            .collect();
        let to: Vec<&dyn Fn(DVec3) -> f64> = to.iter().map(|to| to as _).collect();
        let found = |p: DVec3| value(rule, |surface| surfaces.distance(surface, p));
        let is_zero = |p: &DVec3| found(*p).is_some_and(|found| found.abs() <= SAME_MM);
        // No point of a face is nearer than its unbounded surface.
        let may_exceed = |p: &DVec3, faces: &[u16]| {
            found(*p).is_some_and(|found| {
                let clear = |surface: &u16| surfaces.distance(*surface, *p).abs() >= found.abs() - SAME_MM;
                !faces.iter().all(clear)
            })
        };
        let is_bend = |p: &DVec3| {
            let equal = |found: f64| to.iter().filter(|to| (to(*p) - found).abs() <= SAME_MM).count();
            found(*p).is_some_and(|found| equal(found) > 1)
        };
        let low = self.brick.position(at);
        let extent = |beyond: f64| Extent {
            low: low - beyond * self.brick.cell,
            high: low + (1.0 + beyond) * self.brick.cell,
        };
        let mut places: Vec<DVec3> = meetings(extent(BEYOND), &to)
            .into_iter()
            .filter(is_zero)
            .collect();
        places
            .extend((bends(extent(0.0), &to).into_iter()).filter(|p| is_bend(p) && may_exceed(p, &omitted)));
        if has_sides {
            let suspect = lattice(extent(0.0), SUSPECTED).filter(|p| may_exceed(p, near));
            let suspect: Vec<DVec3> = suspect.collect();
            let step = suspect.len().div_ceil(MOST_SUSPECT).max(1);
            places.extend(suspect.into_iter().step_by(step));
        }
        let places: Vec<Place> = (places.into_iter())
            .map(|p| Place {
                at: p,
                exact: self.exact(at, p),
            })
            .collect();
        let fails = |place: &Place| !holds(rule, &self.test(trial, place), &trial.surfaces);
        places.into_iter().filter(fails).collect()
    }

    /// Feet of the lattice in the cell on surfaces of `rule` where the rule is zero: there the boundary must be.
    fn feet(&self, low: DVec3, rule: Nearby) -> Vec<DVec3> {
        let (Nearby::Convex(group) | Nearby::Reentrant(group)) = rule else {
            return Vec::new();
        };
        let surfaces = self.brick.surfaces;
        let first = low - BEYOND * self.brick.cell;
        let last = low + (1.0 + BEYOND) * self.brick.cell;
        let zero = |p: DVec3| {
            let distance = |surface| surfaces.distance(surface, p);
            value(rule, distance).is_some_and(|found| found.abs() <= SAME_MM)
        };
        let feet: Vec<DVec3> = (group.faces())
            .flat_map(|(surface, _)| {
                let of = self.lattice.iter();
                of.filter_map(move |place| surfaces.foot(surface, place.at))
            })
            .filter(|p| p.cmpge(first).all() && p.cmple(last).all() && zero(*p))
            .collect();
        let step = feet.len().div_ceil(MOST_FEET).max(1);
        feet.into_iter().step_by(step).collect()
    }

    /// Exact sample at `p` in the cell with the lowest corner `at`.
    fn exact(&mut self, at: [usize; 3], p: DVec3) -> ExactSample {
        let within = self.within(at);
        (self.surface.query(p, within, &mut self.scratch)).map_or(ExactSample::NONE, ExactSample::of)
    }

    /// Upper bound of the distance's magnitude in and just beyond a cell, mm: that at its lowest corner and the diagonal.
    fn within(&self, at: [usize; 3]) -> f64 {
        let corner = self.brick.samples[index(at, BRICK_SAMPLES)].distance.abs();
        if corner.is_nan() {
            f64::INFINITY
        } else {
            corner + 1.7321 * (1.0 + 2.0 * BEYOND) * self.brick.cell
        }
    }
}

/// One surface of each choice, a surface index that is none where a choice is empty: first the best ones, then others for one face at a time.
fn selections(choices: &[Vec<u16>]) -> Vec<Vec<u16>> {
    let best: Vec<u16> = (choices.iter())
        .map(|choice| choice.first().copied().unwrap_or(NO_FACE))
        .collect();
    let others = choices.iter().enumerate().flat_map(|(i, choice)| {
        let best = best.clone();
        choice.iter().skip(1).take(MOST_OTHERS).map(move |&other| {
            let mut chosen = best.clone();
            chosen[i] = other;
            chosen
        })
    });
    std::iter::once(best.clone()).chain(others).collect()
}

fn index([x, y, z]: [usize; 3], across: usize) -> usize {
    x + across * (y + across * z)
}
