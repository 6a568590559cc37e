//! Candidate rotations: those that lay directions of one solid on opposite directions of the other.
//!
//! Directions are normals of planes and axes of round walls, parallel ones taken together. Two of them fix a rotation when the angle between them is
//! the same on both solids; parallel round walls whose distance is the same on both fix it too (a pattern of pins and holes). Each rotation is rated
//! by the area whose directions then agree: the overlap of the two area-weighted normal distributions (extended Gaussian images, Horn 1984).
//!
//! Cost: (16 · 16)² / 2 comparisons of angles, and one rating for each distinct rotation.

use glam::{DMat3, DQuat, DVec3};
use mortise_brep::Surface;
use mortise_mating::Side;

use crate::solid::{Solid, Wall};

/// Largest number of directions of a solid, by area.
const MOST_DIRECTIONS: usize = 16;
/// Angle within which directions are parallel, rad.
pub(crate) const PARALLEL_RAD: f64 = 2e-3;
/// Largest number of rotations returned.
const MOST_ROTATIONS: usize = 160;
/// Largest relative difference of the radii of a shaft and its bore.
pub(crate) const MOST_PLAY: f64 = 0.16;

#[derive(Clone, Copy, Debug)]
struct Direction {
    d: DVec3,
    area: f64,
    /// Of a round wall's axis, else of a plane's normal.
    axis: bool,
}

/// Axis of a wall of revolution.
pub(crate) fn axis(surface: &Surface) -> Option<DVec3> {
    match surface {
        Surface::Cylinder { frame, .. } | Surface::Cone { frame, .. } | Surface::Torus { frame, .. } => {
            Some(frame.z)
        }
        _ => None,
    }
}

/// Whether two walls could be a shaft and its bore: play over the shaft's radius, at most [`MOST_PLAY`].
pub(crate) fn shaft_in_bore(a: &Wall, b: &Wall) -> Option<f64> {
    let (shaft, bore) = match (a.side, b.side) {
        (Side::Convex, Side::Concave) => (a, b),
        (Side::Concave, Side::Convex) => (b, a),
        _ => return None,
    };
    let (Surface::Cylinder { radius: r, .. }, Surface::Cylinder { radius: s, .. }) =
        (&shaft.surface, &bore.surface)
    else {
        return None;
    };
    (s - r > -1e-3 && s - r < MOST_PLAY * r).then_some(s - r)
}

/// Candidate rotations from `moving`'s frame to `fixed`'s, the best rated first; `current` decides turns that nothing fixes.
pub(crate) fn rotations(moving: &Solid, fixed: &Solid, current: DMat3) -> Vec<DMat3> {
    // Opposite directions touch: those of the fixed solid are turned round.
    let (from, to) = (
        directions(moving),
        directions(fixed)
            .into_iter()
            .map(|direction| Direction {
                d: -direction.d,
                ..direction
            })
            .collect::<Vec<_>>(),
    );
    let mut found = Distinct::default();
    for (i, a) in from.iter().enumerate() {
        for b in &from[i + 1..] {
            let angle = a.d.angle_between(b.d);
            if angle.sin() < 0.05 {
                continue;
            }
            for p in to.iter().filter(|p| p.axis == a.axis) {
                for q in to.iter().filter(|q| q.axis == b.axis) {
                    if (p.d.angle_between(q.d) - angle).abs() < PARALLEL_RAD {
                        found.add(basis(p.d, q.d) * basis(a.d, b.d).transpose());
                    }
                }
            }
        }
    }
    for rotation in along_axes(moving, fixed, current) {
        found.add(rotation);
    }
    let mut rated: Vec<(f64, DMat3)> = (found.all.iter())
        .map(|&q| {
            let rotation = DMat3::from_quat(q);
            (agreement(&from, &to, rotation), rotation)
        })
        .collect();
    rated.sort_by(|a, b| b.0.total_cmp(&a.0));
    rated.truncate(MOST_ROTATIONS);
    rated.into_iter().map(|(_, rotation)| rotation).collect()
}

/// Rotations that make a shaft parallel to a bore: turned as little as possible from `current`, and so that a second parallel pair meets.
fn along_axes(moving: &Solid, fixed: &Solid, current: DMat3) -> Vec<DMat3> {
    let mut out = Vec::new();
    let mut pairs = Vec::new();
    for a in &moving.walls {
        for b in &fixed.walls {
            let rounds = match (a.surface, b.surface) {
                (Surface::Cylinder { frame: f, .. }, Surface::Cylinder { frame: g, .. }) => {
                    shaft_in_bore(a, b).map(|_| (f, g))
                }
                (Surface::Cone { frame: f, .. }, Surface::Cone { frame: g, .. })
                | (Surface::Torus { frame: f, .. }, Surface::Torus { frame: g, .. })
                    if a.side != b.side =>
                {
                    Some((f, g))
                }
                _ => None,
            };
            pairs.extend(rounds.map(|(f, g)| (a.area.min(b.area), f, g)));
        }
    }
    pairs.sort_by(|a, b| b.0.total_cmp(&a.0));
    pairs.truncate(24);
    for &(_, f, g) in &pairs {
        for z in [g.z, -g.z] {
            let turned = DMat3::from_quat(DQuat::from_rotation_arc(current * f.z, z)) * current;
            out.push(turned);
            for &(_, f2, g2) in &pairs {
                let across = |a: DVec3, b: DVec3, z: DVec3| (b - a).reject_from_normalized(z);
                let (u, v) = (across(f.origin, f2.origin, f.z), across(g.origin, g2.origin, g.z));
                let parallel =
                    f.z.cross(f2.z).length() < PARALLEL_RAD && g.z.cross(g2.z).length() < PARALLEL_RAD;
                if parallel && u.length() > 1.0 && (u.length() - v.length()).abs() < 0.25 {
                    out.push(basis(z, v) * basis(f.z, u).transpose());
                }
            }
        }
    }
    out
}

/// Right-handed orthonormal basis whose x is along `a` and whose y is on the side of `b`.
fn basis(a: DVec3, b: DVec3) -> DMat3 {
    let x = a.normalize();
    let y = b
        .reject_from_normalized(x)
        .try_normalize()
        .unwrap_or_else(|| x.any_orthonormal_vector());
    DMat3::from_cols(x, y, x.cross(y))
}

fn directions(solid: &Solid) -> Vec<Direction> {
    let mut out: Vec<Direction> = Vec::new();
    let mut add = |d: DVec3, area: f64, axis: bool| match (out.iter_mut())
        .find(|o| o.axis == axis && o.d.dot(d) > 0.0 && o.d.cross(d).length() < PARALLEL_RAD / 2.0)
    {
        Some(known) => known.area += area,
        None => out.push(Direction { d, area, axis }),
    };
    for wall in &solid.walls {
        match wall.surface {
            Surface::Plane { frame } => add(frame.z, wall.area, false),
            _ => {
                if let Some(z) = axis(&wall.surface) {
                    add(z, wall.area, true);
                    add(-z, wall.area, true);
                }
            }
        }
    }
    out.sort_by(|a, b| b.area.total_cmp(&a.area));
    out.truncate(MOST_DIRECTIONS);
    out
}

/// Area whose directions agree.
fn agreement(from: &[Direction], to: &[Direction], rotation: DMat3) -> f64 {
    (from.iter())
        .map(|a| {
            let turned = rotation * a.d;
            (to.iter())
                .filter(|b| {
                    b.axis == a.axis
                        && b.d.dot(turned) > 0.0
                        && b.d.cross(turned).length() < 2.0 * PARALLEL_RAD
                })
                .map(|b| b.area.min(a.area).sqrt())
                .sum::<f64>()
        })
        .sum()
}

/// Rotations that differ.
#[derive(Default)]
struct Distinct {
    all: Vec<DQuat>,
}

impl Distinct {
    fn add(&mut self, rotation: DMat3) {
        let q = DQuat::from_mat3(&rotation).normalize();
        // |q·q'| = cos(angle / 2).
        let least = (PARALLEL_RAD).cos();
        if self.all.iter().all(|known| known.dot(q).abs() < least) {
            self.all.push(q);
        }
    }
}
