//! Palette entries beyond the nearest face: whether and how exact surfaces give the distance in a cell.
//!
//! A cell is *exact* when the distance at all its corners equals that to the unbounded surface of one face. At a convex edge or corner the distance
//! is the largest of the distances to two or three faces (exact inside and at the faces; outside it is a lower bound of the right sign); at a
//! re-entrant one it is the smallest. Cells for which the corners do not prove either are interpolated.

use glam::DVec3;
use mortise_brep::Surface;
use mortise_protocol::image::{BRICK_SAMPLES, NO_FACE, Nearby};

use crate::surface::to_local;

/// Tolerance of exact distances, mm: rounding, and vertices a tenth of a micrometre off their curves.
const SAME_MM: f64 = 2e-4;

/// A sample of a brick before rounding.
#[derive(Clone, Copy)]
pub(crate) struct ExactSample {
    /// Distance, mm, outside positive; NaN where it was not computed.
    pub distance: f64,
    /// Nearest face or [`NO_FACE`].
    pub face: u16,
}

/// Samples and faces from which the nearest faces of a cell are found.
pub(crate) struct CellNearby<'a> {
    /// Faces of the shape: surface, and +1 where the outward normal is the natural one, −1 where it is reversed.
    pub faces: &'a [(Surface, f64)],
    /// 9³ samples of the brick, x fastest.
    pub samples: &'a [ExactSample],
    /// Position of sample (0, 0, 0), mm, and the sample step.
    pub origin: DVec3,
    pub cell: f64,
}

impl CellNearby<'_> {
    /// Palette entry of the cell with the lowest corner `at`; `nearest` is the face nearest to it.
    pub fn of(&self, at: [usize; 3], nearest: u16) -> Nearby {
        if nearest > Nearby::MAX_FACES {
            return Nearby::Unknown;
        }
        let corners: [(DVec3, ExactSample); 8] = std::array::from_fn(|c| {
            let place = [at[0] + (c & 1), at[1] + (c >> 1 & 1), at[2] + (c >> 2)];
            (self.position(place), self.samples[index(place)])
        });
        if corners
            .iter()
            .all(|(p, s)| (self.distance(nearest, *p) - s.distance).abs() <= SAME_MM)
        {
            return Nearby::Face(nearest);
        }
        let group = self.faces_about(at, nearest);
        if group[1] != NO_FACE {
            if self.all(&corners, &group, f64::max, |exact| exact <= SAME_MM) {
                return Nearby::Convex(group);
            }
            if self.all(&corners, &group, f64::min, |exact| exact >= -SAME_MM) {
                return Nearby::Reentrant(group);
            }
        }
        Nearby::Roughly(nearest)
    }

    /// Whether `fold` of the distances to the faces of `group` has, at all corners, the sign of the true distance and no larger magnitude, and equals
    /// the true distance where `must` requires it.
    fn all(
        &self,
        corners: &[(DVec3, ExactSample); 8],
        group: &[u16; 3],
        fold: impl Fn(f64, f64) -> f64,
        must: impl Fn(f64) -> bool,
    ) -> bool {
        corners.iter().all(|(p, s)| {
            let found = (group.iter().filter(|&&face| face != NO_FACE))
                .map(|&face| self.distance(face, *p))
                .reduce(&fold)
                .unwrap_or(f64::NAN);
            if must(s.distance) {
                (found - s.distance).abs() <= SAME_MM
            } else {
                found * s.distance > 0.0 && found.abs() <= s.distance.abs() + SAME_MM
            }
        })
    }

    /// The faces nearest to the samples around a cell, `nearest` first; only `nearest` if there are more than three.
    fn faces_about(&self, at: [usize; 3], nearest: u16) -> [u16; 3] {
        let mut group = [nearest, NO_FACE, NO_FACE];
        let mut count = 1;
        let range = |a: usize| a.saturating_sub(1)..(a + 3).min(BRICK_SAMPLES);
        for z in range(at[2]) {
            for y in range(at[1]) {
                for x in range(at[0]) {
                    let face = self.samples[index([x, y, z])].face;
                    if face == NO_FACE || group[..count].contains(&face) {
                        continue;
                    }
                    if count == 3 || face > Nearby::MAX_FACES {
                        return [nearest, NO_FACE, NO_FACE];
                    }
                    group[count] = face;
                    count += 1;
                }
            }
        }
        group
    }

    fn position(&self, place: [usize; 3]) -> DVec3 {
        self.origin + DVec3::from_array(place.map(|i| i as f64)) * self.cell
    }

    /// Signed distance to the unbounded surface of a face, mm; NaN where it has no closed form.
    fn distance(&self, face: u16, p: DVec3) -> f64 {
        let Some((surface, sense)) = self.faces.get(usize::from(face)) else {
            return f64::NAN;
        };
        let natural = match *surface {
            Surface::Plane { frame } => to_local(&frame, p).z,
            Surface::Cylinder { frame, radius } => to_local(&frame, p).truncate().length() - radius,
            Surface::Cone {
                frame,
                radius,
                half_angle,
            } => {
                let q = to_local(&frame, p);
                (q.truncate().length() - radius) * half_angle.cos() - q.z * half_angle.sin()
            }
            Surface::Sphere { frame, radius } => p.distance(frame.origin) - radius,
            Surface::Torus { frame, major, minor } => {
                let q = to_local(&frame, p);
                (q.truncate().length() - major).hypot(q.z) - minor
            }
            Surface::Spline => f64::NAN,
        };
        natural * sense
    }
}

fn index([x, y, z]: [usize; 3]) -> usize {
    x + BRICK_SAMPLES * (y + BRICK_SAMPLES * z)
}
