//! Palette entries: whether and how exact surfaces give the distance in a cell.
//!
//! A point of a cell has its nearest surface point on one of the faces with a triangle near the cell; among these the cell's rule is sought. The cell
//! is *exact* where one face's unbounded surface gives the distance. At convex edges, corners and thin walls the largest of several distances does
//! (exact inside and at the faces; outside it is a lower bound of the right sign), at re-entrant ones the smallest, at mixed ones a largest of
//! smallest ones or the reverse (see `rule`). A rule is tested against the exact distance at the corners and half-way between them, at points of the
//! near faces in the cell and, where the surface crosses the cell, on a lattice of 4³ more; a point at which it fails joins the tests of the next
//! attempt. Cells without a rule are interpolated.

use glam::DVec3;
use mortise_brep::Surface;
use mortise_protocol::image::{BRICK_CELLS, BRICK_SAMPLES, NO_FACE, Nearby};

use crate::cell_samples::ExactSample;
use crate::distance::{ExactSurface, Scratch};
use crate::rule::{SAME_MM, Test, find_rule, holds};
use crate::sides::Sides;
use crate::surface::signed_distance;

/// Half steps of samples along a brick's edge.
const HALVES: usize = 2 * BRICK_CELLS + 1;
/// Attempts to find a rule: each failed one adds tests.
const ATTEMPTS: usize = 4;
/// The same where sides of smooth edges take part, after the attempts without them.
const ATTEMPTS_WITH_SIDES: usize = 10;
/// Most sides that take part: two for each smooth edge.
const MOST_SIDES: usize = 16;
/// Most points of near faces that are tests.
const MOST_TOUCHES: usize = 24;
/// Steps to a point at which the surface crosses a line.
const SECANTS: usize = 3;
/// Points along a cell's edge at which the rule of a crossed cell is verified.
const VERIFIED: usize = 4;

/// Cells crossed by the surface that have no rule although all near faces have a closed form.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Unproven {
    /// Their number.
    pub cells: usize,
    /// Centre of one of them, mm.
    pub at: Option<DVec3>,
}

/// Finds the palette entries of a brick's cells.
pub(crate) struct CellNearby<'a> {
    surface: &'a ExactSurface,
    /// Faces of the shape: surface, and +1 where the outward normal is the natural one, −1 where it is reversed.
    faces: Vec<(Surface, f64)>,
    /// Sides of its smooth edges.
    sides: &'a Sides,
    /// 9³ samples of the brick, x fastest.
    samples: &'a [ExactSample],
    /// Position of sample (0, 0, 0), mm, and the sample step.
    origin: DVec3,
    cell: f64,
    /// Whether only one face is near the brick.
    alone: bool,
    /// Distances on the lattice of half steps, NaN where not yet computed.
    halves: Vec<f64>,
    /// Distances on the lattice by which the present cell's rules are verified; empty where not yet computed.
    lattice: Vec<f64>,
    scratch: Scratch,
    /// Crossed cells without a rule so far.
    pub unproven: Unproven,
}

impl<'a> CellNearby<'a> {
    /// Of the brick with `samples` from `origin` in steps of `cell`, mm.
    pub fn new(
        surface: &'a ExactSurface,
        sides: &'a Sides,
        samples: &'a [ExactSample],
        origin: DVec3,
        cell: f64,
    ) -> Self {
        let mut this = Self {
            surface,
            sides,
            faces: (surface.shape().faces.iter())
                .map(|face| (face.surface, if face.reversed { -1.0 } else { 1.0 }))
                .collect(),
            samples,
            origin,
            cell,
            alone: false,
            halves: vec![f64::NAN; HALVES * HALVES * HALVES],
            lattice: Vec::new(),
            scratch: Scratch::default(),
            unproven: Unproven::default(),
        };
        let center = origin + DVec3::splat(0.5 * cell * BRICK_CELLS as f64);
        this.alone = this
            .near(center, cell * BRICK_CELLS as f64, f64::INFINITY)
            .0
            .len()
            < 2;
        this
    }

    /// Palette entry of the cell with the lowest corner `at`; `nearest` is the face nearest to it.
    pub fn of(&mut self, at: [usize; 3], nearest: u16) -> Nearby {
        if nearest > Nearby::MAX_FACES {
            return Nearby::Unknown;
        }
        let corners = (0..8).all(|c| {
            let place = [at[0] + (c & 1), at[1] + (c >> 1 & 1), at[2] + (c >> 2)];
            let distance = self.samples[index(place, BRICK_SAMPLES)].distance;
            (self.distance(nearest, self.position(place)) - distance).abs() <= SAME_MM
        });
        let (mut candidates, mut touches) = if self.alone {
            (vec![nearest], Vec::new())
        } else {
            let center = self.position(at) + DVec3::splat(0.5 * self.cell);
            self.near(center, self.cell, self.within(at))
        };
        if candidates.len() < 2 {
            return if corners {
                Nearby::Face(nearest)
            } else {
                Nearby::Roughly(nearest)
            };
        }
        let faces = candidates.len();
        let sides: Vec<u16> = self.sides.among(&candidates).take(MOST_SIDES).collect();
        candidates.extend(&sides);
        let attempts = if sides.is_empty() {
            ATTEMPTS
        } else {
            ATTEMPTS_WITH_SIDES
        };
        let crossed = !touches.is_empty();
        if crossed && !sides.is_empty() {
            touches.extend(self.crossings(at));
        }
        self.lattice.clear();
        let mut tests = self.tests(at, &candidates, touches);
        for _ in 0..attempts {
            let Some(rule) = find_rule(&tests, &candidates, faces, nearest) else {
                break;
            };
            let failed = if crossed {
                self.failures(at, rule, &candidates)
            } else {
                Vec::new()
            };
            if failed.is_empty() {
                return rule;
            }
            tests.extend(failed);
        }
        if crossed && tests.iter().all(|test| test.faces.iter().all(|d| d.is_finite())) {
            self.unproven.cells += 1;
            (self.unproven.at).get_or_insert(self.position(at) + DVec3::splat(0.5 * self.cell));
        }
        Nearby::Roughly(nearest)
    }

    /// Faces that can hold the point nearest to some point of the cube with this centre and edge; and points of their triangles in the cube. No face is
    /// farther from the centre than `within`.
    fn near(&mut self, center: DVec3, edge: f64, within: f64) -> (Vec<u16>, Vec<DVec3>) {
        let (mut faces, mut touches) = (Vec::new(), Vec::new());
        let Some(nearest) = self.surface.query(center, within, &mut self.scratch) else {
            return (faces, touches);
        };
        let diagonal = edge * 3f64.sqrt();
        let radius = nearest.distance.abs() + diagonal + 2.0 * self.surface.chord + SAME_MM;
        self.surface.triangles.within(center, radius, |triangle, on, _| {
            faces.push(self.surface.shape.mesh.triangle_face[triangle as usize] as u16);
            if (on.point - center).abs().max_element() <= 0.5 * edge {
                touches.push(on.point);
            }
        });
        faces.sort_unstable();
        faces.dedup();
        faces.retain(|&face| face <= Nearby::MAX_FACES && face != NO_FACE);
        let step = touches.len().div_ceil(MOST_TOUCHES).max(1);
        (faces, touches.into_iter().step_by(step).collect())
    }

    /// Points at which the surface crosses the lines of a cell's lattice of half steps. Where faces continue each other smoothly a rule that omits one
    /// errs only farthest from their edge: at the cell's border.
    fn crossings(&mut self, at: [usize; 3]) -> Vec<DVec3> {
        let (low, step) = (self.position(at), 0.5 * self.cell);
        let place = |i: usize| DVec3::new((i % 3) as f64, (i / 3 % 3) as f64, (i / 9) as f64);
        let known: Vec<f64> = (0..27).map(|i| self.exact(at, low + place(i) * step)).collect();
        let mut crossings = Vec::new();
        for i in 0..27 {
            for (axis, stride) in [1, 3, 9].into_iter().enumerate() {
                if i / stride % 3 == 2 || known[i] * known[i + stride] > 0.0 {
                    continue;
                }
                // Secants between places on both sides.
                let (mut a, mut b) = ([0.0, known[i]], [step, known[i + stride]]);
                let mut p = low + place(i) * step;
                for _ in 0..SECANTS {
                    let between = a[0] + (b[0] - a[0]) * (a[1] / (a[1] - b[1]));
                    p = low + place(i) * step + DVec3::AXES[axis] * between;
                    let distance = self.exact(at, p);
                    let end = if distance * a[1] > 0.0 { &mut a } else { &mut b };
                    *end = [between, distance];
                }
                crossings.push(p);
            }
        }
        crossings.retain(|p| p.is_finite());
        crossings
    }

    /// Tests on the lattice of half steps of the cell, and at points of the surface.
    fn tests(&mut self, at: [usize; 3], candidates: &[u16], touches: Vec<DVec3>) -> Vec<Test> {
        let mut tests = Vec::with_capacity(27 + touches.len());
        for i in 0..27 {
            let place = [2 * at[0] + i % 3, 2 * at[1] + i / 3 % 3, 2 * at[2] + i / 9];
            let p = self.origin + DVec3::from_array(place.map(|i| i as f64)) * (0.5 * self.cell);
            let known = self.halves[index(place, HALVES)];
            let distance = if place.iter().all(|i| i % 2 == 0) {
                self.samples[index(place.map(|i| i / 2), BRICK_SAMPLES)].distance
            } else if known.is_nan() {
                self.exact(at, p)
            } else {
                known
            };
            self.halves[index(place, HALVES)] = distance;
            tests.push(self.test(p, distance, candidates));
        }
        for p in touches {
            let distance = self.exact(at, p);
            tests.push(self.test(p, distance, candidates));
        }
        tests
    }

    /// Tests at which `rule` fails, of the lattice by which a crossed cell is verified.
    fn failures(&mut self, at: [usize; 3], rule: Nearby, candidates: &[u16]) -> Vec<Test> {
        let mut failed = Vec::new();
        let low = self.position(at);
        for i in 0..VERIFIED * VERIFIED * VERIFIED {
            let place = [i % VERIFIED, i / VERIFIED % VERIFIED, i / VERIFIED / VERIFIED];
            let share = DVec3::from_array(place.map(|i| (i as f64 + 0.5) / VERIFIED as f64));
            let p = low + share * self.cell;
            if self.lattice.len() == i {
                let distance = self.exact(at, p);
                self.lattice.push(distance);
            }
            let test = self.test(p, self.lattice[i], candidates);
            if !holds(rule, &test, candidates) {
                failed.push(test);
            }
        }
        failed
    }

    fn test(&self, p: DVec3, distance: f64, candidates: &[u16]) -> Test {
        Test {
            distance,
            faces: candidates.iter().map(|&face| self.distance(face, p)).collect(),
        }
    }

    /// Exact distance at `p` in the cell with the lowest corner `at`.
    fn exact(&mut self, at: [usize; 3], p: DVec3) -> f64 {
        let within = self.within(at);
        (self.surface.query(p, within, &mut self.scratch)).map_or(f64::NAN, |n| n.distance)
    }

    /// Upper bound of the distance's magnitude in a cell, mm: that at its lowest corner and the diagonal.
    fn within(&self, at: [usize; 3]) -> f64 {
        let corner = self.samples[index(at, BRICK_SAMPLES)].distance.abs();
        if corner.is_nan() {
            f64::INFINITY
        } else {
            corner + 1.7321 * self.cell
        }
    }

    fn position(&self, place: [usize; 3]) -> DVec3 {
        self.origin + DVec3::from_array(place.map(|i| i as f64)) * self.cell
    }

    /// Signed distance to the unbounded surface of a face, or that by which a side counts, mm; NaN where it has no closed form.
    fn distance(&self, face: u16, p: DVec3) -> f64 {
        let Some((surface, sense)) = self.faces.get(usize::from(face)) else {
            return self.sides.distance(face, p);
        };
        signed_distance(surface, p) * sense
    }
}

fn index([x, y, z]: [usize; 3], across: usize) -> usize {
    x + across * (y + across * z)
}
