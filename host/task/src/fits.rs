//! Fits: a shaft in a bore, or a profile in a hole of its form, with a small clearance or overlap. They connect parts also where their faces lie side by side
//! without touching.

use glam::{DVec2, DVec3};
use mortise_brep::Surface;
use mortise_mating::Side;

use crate::assembly::Assembly;
use crate::profile::{Profile, signed};

/// Largest clearance of a fit: on the radius, mm.
pub const FIT_MM: f64 = 0.5;
/// Largest overlap on the radius of a press fit, mm.
const PRESS_MM: f64 = 0.2;
/// Angle between, and share of the clearance beside which the axes of a fit are one.
const COAXIAL_RAD: f64 = 2e-3;
/// Distance beyond a bore's end at which its part is sought, as a share of the radius, and least distance, mm.
const BEYOND: f64 = 0.2;
const BEYOND_MM: f64 = 0.05;
/// Where beside an outline, as a share of a corner's distance from its centre.
const BESIDE: f64 = 0.98;
/// Faces about an axis with a smaller gap between them are one stretch, mm.
const JOINED_MM: f64 = 1e-3;
/// Least common length of a fit, mm.
const COMMON_MM: f64 = 0.2;

/// A shaft in a bore, or a profile in a hole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// Part with the shaft and part with the bore.
    pub parts: [usize; 2],
    /// Whether both are round; else they are profiles.
    pub is_round: bool,
    /// Middle of the common length on the axis, mm, in the assembly's frame.
    pub center: DVec3,
    /// Unit direction of the axis.
    pub axis: DVec3,
    /// Radius of the shaft, or of the circle about the profile, mm.
    pub radius_mm: f64,
    /// Radius of the bore less that of the shaft, or least distance of the outlines, mm; negative where they overlap.
    pub clearance_mm: f64,
    /// Common length, mm.
    pub length_mm: f64,
    /// Whether the bore is open at both ends.
    pub is_through: bool,
}

/// A stretch of a merged cylinder of a part, in the assembly's frame.
struct Round {
    faces: Vec<u32>,
    radius: f64,
    origin: DVec3,
    axis: DVec3,
}

/// The shafts and holes of a part.
pub(crate) struct Ends<'a> {
    part: usize,
    shafts: Vec<Round>,
    bores: Vec<Round>,
    profiles: &'a [Profile],
}

impl<'a> Ends<'a> {
    pub fn of(assembly: &'a Assembly, part: usize) -> Self {
        let place = assembly.placement(part);
        let mut found = Self {
            part,
            shafts: Vec::new(),
            bores: Vec::new(),
            profiles: assembly.profiles(part),
        };
        for merged in assembly.surfaces(part) {
            let Surface::Cylinder { frame, radius } = merged.surface else {
                continue;
            };
            let (origin, axis) = (
                place.transform_point3(frame.origin),
                place.transform_vector3(frame.z),
            );
            let rounds = stretches(assembly, part, &merged.faces, origin, axis).into_iter();
            let rounds = rounds.map(|faces| Round {
                faces,
                radius,
                origin,
                axis,
            });
            match merged.side {
                Side::Convex => found.shafts.extend(rounds),
                Side::Concave => found.bores.extend(rounds),
                Side::Flat => {}
            }
        }
        found
    }
}

/// Shafts and profiles of `a` in bores and holes of `b`.
pub(crate) fn fits(assembly: &Assembly, a: &Ends<'_>, b: &Ends<'_>) -> Vec<Fit> {
    let mut found = Vec::new();
    for shaft in &a.shafts {
        let bores = b.bores.iter();
        found.extend(bores.filter_map(|bore| in_bore(assembly, (a.part, shaft), (b.part, bore))));
    }
    // Outlines are compared where the parts are near each other.
    if assembly.boxes_are_near(a.part, b.part, FIT_MM) {
        for male in a.profiles.iter().filter(|profile| profile.is_male) {
            let females = b.profiles.iter().filter(|profile| !profile.is_male);
            found.extend(females.filter_map(|hole| in_hole(assembly, (a.part, male), (b.part, hole))));
        }
    }
    found
}

fn in_bore(assembly: &Assembly, (a, shaft): (usize, &Round), (b, bore): (usize, &Round)) -> Option<Fit> {
    let clearance = bore.radius - shaft.radius;
    if !(-PRESS_MM..=FIT_MM).contains(&clearance) {
        return None;
    }
    let (o, z) = (shaft.origin, shaft.axis);
    let apart = (bore.origin - o).reject_from_normalized(z).length();
    if z.cross(bore.axis).length() > COAXIAL_RAD || apart > clearance.abs() + 1e-3 {
        return None;
    }
    let along = |part: usize, round: &Round| extent(assembly, part, &round.faces, o, z);
    let ends = along(b, bore)?;
    let (center, length_mm) = common(o, z, along(a, shaft)?, ends)?;
    Some(Fit {
        parts: [a, b],
        is_round: true,
        center,
        axis: z,
        radius_mm: shaft.radius,
        clearance_mm: clearance,
        length_mm,
        is_through: is_through(assembly, b, o, z, bore.radius, ends),
    })
}

/// Middle and length of the interval that two along an axis have in common.
fn common(origin: DVec3, axis: DVec3, a: [f64; 2], b: [f64; 2]) -> Option<(DVec3, f64)> {
    let (low, high) = (a[0].max(b[0]), a[1].min(b[1]));
    (high - low > COMMON_MM).then(|| (origin + axis * ((low + high) / 2.0), high - low))
}

fn in_hole(assembly: &Assembly, (a, male): (usize, &Profile), (b, hole): (usize, &Profile)) -> Option<Fit> {
    // From the frame of the hole's part to that of the shaft's.
    let by = assembly.placement(a).inverse() * assembly.placement(b);
    let axis = by.transform_vector3(hole.axis);
    // A hole is wider than what is in it, but for a press fit, and by no more than the clearance all around.
    let around = male.diameter_mm() * std::f64::consts::PI;
    let more = hole.area_mm2 - male.area_mm2;
    if axis.cross(male.axis).length() > COAXIAL_RAD
        || more < -PRESS_MM * around
        || more > 2.0 * FIT_MM * around
    {
        return None;
    }
    let flat = |p: DVec3| {
        let d = p - male.origin;
        DVec2::new(d.dot(male.x), d.dot(male.y))
    };
    let outline: Vec<DVec2> = (hole.outline.iter())
        .map(|p| flat(by.transform_point3(hole.origin + hole.x * p.x + hole.y * p.y)))
        .collect();
    let beyond: Vec<f64> = outline.iter().map(|&p| signed(&male.outline, p)).collect();
    let within = (male.outline.iter()).map(|&p| -signed(&outline, p));
    let clearance = within.chain(beyond.iter().copied()).fold(f64::INFINITY, f64::min);
    // Corners of a hole may be relieved, so its farthest corner may be farther than the clearance.
    let farthest = beyond.iter().copied().fold(0.0, f64::max);
    if !(-PRESS_MM..=FIT_MM).contains(&clearance) || farthest > 4.0 * FIT_MM {
        return None;
    }
    let start = (by.transform_point3(hole.origin) - male.origin).dot(male.axis);
    let ends = hole.capacity_mm.map(|t| start + axis.dot(male.axis) * t);
    let ends = [ends[0].min(ends[1]), ends[0].max(ends[1])];
    let (center, length_mm) = common(male.origin, male.axis, male.capacity_mm, ends)?;
    let place = assembly.placement(a);
    Some(Fit {
        parts: [a, b],
        is_round: false,
        center: place.transform_point3(center),
        axis: place.transform_vector3(male.axis),
        radius_mm: male.diameter_mm() / 2.0,
        clearance_mm: clearance,
        length_mm,
        is_through: is_through_profile(assembly, b, hole),
    })
}

/// Faces about an axis by the stretches that they cover: a groove or a collar interrupts a shaft.
pub(crate) fn stretches(
    assembly: &Assembly,
    part: usize,
    faces: &[u32],
    origin: DVec3,
    axis: DVec3,
) -> Vec<Vec<u32>> {
    let mut each: Vec<([f64; 2], u32)> = (faces.iter())
        .filter_map(|&face| Some((extent(assembly, part, &[face], origin, axis)?, face)))
        .collect();
    each.sort_by(|a, b| a.0[0].total_cmp(&b.0[0]));
    let mut found: Vec<(f64, Vec<u32>)> = Vec::new();
    for ([low, high], face) in each {
        match found.last_mut() {
            Some((end, stretch)) if low <= *end + JOINED_MM => {
                *end = end.max(high);
                stretch.push(face);
            }
            _ => found.push((high, vec![face])),
        }
    }
    found.into_iter().map(|(_, stretch)| stretch).collect()
}

/// Interval of some faces of a part along an axis in the assembly's frame, mm from `origin`.
pub(crate) fn extent(
    assembly: &Assembly,
    part: usize,
    faces: &[u32],
    origin: DVec3,
    axis: DVec3,
) -> Option<[f64; 2]> {
    let shape = assembly.body(part).surface().shape();
    let place = assembly.placement(part);
    let mut range = [f64::INFINITY, f64::NEG_INFINITY];
    for (triangle, face) in shape.mesh.triangles.iter().zip(&shape.mesh.triangle_face) {
        if faces.contains(face) {
            for &v in triangle {
                let t = (place.transform_point3(shape.mesh.vertices[v as usize]) - origin).dot(axis);
                range = [range[0].min(t), range[1].max(t)];
            }
        }
    }
    (range[0] < range[1]).then_some(range)
}

/// Whether the part has no material on the axis of a bore just beyond its ends.
pub(crate) fn is_through(
    assembly: &Assembly,
    part: usize,
    origin: DVec3,
    axis: DVec3,
    radius: f64,
    [low, high]: [f64; 2],
) -> bool {
    let beyond = (BEYOND * radius).max(BEYOND_MM);
    let back = assembly.placement(part).inverse();
    [low - beyond, high + beyond].iter().all(|&t| {
        let p = back.transform_point3(origin + axis * t);
        assembly
            .body(part)
            .surface()
            .nearest(p)
            .is_none_or(|n| n.distance > 0.0)
    })
}

/// As [`is_through`], of a hole of any form.
pub(crate) fn is_through_profile(assembly: &Assembly, part: usize, hole: &Profile) -> bool {
    // A hole around a boss has material on its axis: what is beyond it is sought beside its outline.
    let beside = (hole.outline.first()).map_or(DVec3::ZERO, |p| (hole.x * p.x + hole.y * p.y) * BESIDE);
    let pose = assembly.placement(part);
    let (at, axis) = (
        pose.transform_point3(hole.origin + beside),
        pose.transform_vector3(hole.axis),
    );
    let radius = hole.across_mm().max(0.0) / 2.0;
    is_through(assembly, part, at, axis, radius, hole.capacity_mm)
}
