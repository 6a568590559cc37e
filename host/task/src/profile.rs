//! Profiles: closed outlines of any form that faces of a part extrude along an axis, outwards (a square shaft, a hexagon head, a spline shaft) or inwards (a
//! socket, a keyed or lobed hole). Outlines that are one circle are no profiles: they are merged cylinders.
//!
//! Faces that are ruled along a direction (planes and cylinders along it, splines whose normals are perpendicular to it) are joined where they share an edge along
//! it. Between two heights at which such faces begin or end, a section through the joined faces is an outline if it closes; neighbouring closed sections are one
//! profile. Directions are those of the part's straight edges, along which alone two faces of a prism can meet.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use glam::{DVec2, DVec3};
use mortise_brep::{Curve, Shape, Surface};

use crate::line::same_direction;

/// Most directions, those with the longest edges first.
const DIRECTIONS: usize = 12;
/// Sine of the angle by which a normal may leave the plane across the axis: splines are extruded to the accuracy of their file.
const ACROSS: f64 = 1e-3;
/// Heights that are nearer to each other are one, mm.
const SAME_MM: f64 = 1e-4;
/// Where a section is made between two heights: no likely height of a vertex.
const BETWEEN: f64 = 0.487_13;

/// A closed outline extruded along an axis, in the shape's frame, to the accuracy of its triangles.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    /// Faces that it has in its longest section.
    pub faces: Vec<u32>,
    /// Whether the material is inside (a shaft), else outside (a hole).
    pub is_male: bool,
    /// Centre of area of the outline, mm, at height 0.
    pub origin: DVec3,
    /// Unit direction, and two across it.
    pub axis: DVec3,
    /// First direction of the outline's plane.
    pub x: DVec3,
    /// Second direction of the outline's plane.
    pub y: DVec3,
    /// Corners around the material's or hole's inside, counterclockwise seen against the axis, mm from the origin.
    pub outline: Vec<DVec2>,
    /// Area within the outline, mm².
    pub area_mm2: f64,
    /// Interval along the axis, mm from the origin.
    pub capacity_mm: [f64; 2],
    /// Number of flats, and of other faces.
    pub sides: [usize; 2],
}

impl Profile {
    /// Diameter of the circle about the origin in which the outline lies, mm.
    pub fn diameter_mm(&self) -> f64 {
        2.0 * self.outline.iter().map(|p| p.length()).fold(0.0, f64::max)
    }

    /// Whether its corners, apart from those on a straight side, are as far from the origin and from each other, to this share.
    pub fn is_regular(&self, share: f64) -> bool {
        let count = self.outline.len();
        let corners: Vec<DVec2> = (0..count)
            .filter(|&i| {
                let [p, q, r] = [count - 1, 0, 1].map(|step| self.outline[(i + step) % count]);
                let (before, after) = ((q - p).normalize_or_zero(), (r - q).normalize_or_zero());
                before.perp_dot(after).abs() > share
            })
            .map(|i| self.outline[i])
            .collect();
        let even = |lengths: Vec<f64>| {
            let (low, high) = (lengths.iter().copied())
                .fold((f64::INFINITY, 0.0), |(low, high): (f64, f64), l| {
                    (low.min(l), high.max(l))
                });
            high - low <= share * high
        };
        corners.len() > 2
            && even(corners.iter().map(|p| p.length()).collect())
            && even(pairs(&corners).map(|(p, q)| p.distance(q)).collect())
    }

    /// Least distance of the outline from its origin, times two, mm: the width across flats of a regular one.
    pub fn across_mm(&self) -> f64 {
        2.0 * -signed(&self.outline, DVec2::ZERO)
    }
}

/// Profiles of a shape, longest first. Cost: for each direction the triangles of the faces along it, for each interval between heights.
pub fn profiles(shape: &Shape) -> Vec<Profile> {
    let by_face = triangles(shape);
    let mut found = Vec::new();
    for axis in directions(shape) {
        let along: BTreeMap<u32, Ruled> = (0..shape.faces.len() as u32)
            .filter_map(|face| Some((face, ruled(shape, &by_face, face, axis)?)))
            .collect();
        for joined in joined(shape, &along, axis) {
            let one_round = joined.iter().all(|face| is_about(shape, *face, joined[0]));
            if !one_round {
                found.extend(profile(shape, &by_face, &along, &joined, axis));
            }
        }
    }
    found.sort_by(|a, b| length(b).total_cmp(&length(a)));
    found
}

fn length(profile: &Profile) -> f64 {
    profile.capacity_mm[1] - profile.capacity_mm[0]
}

/// Triangles of each face.
fn triangles(shape: &Shape) -> Vec<Vec<[u32; 3]>> {
    let mut by_face = vec![Vec::new(); shape.faces.len()];
    for (triangle, &face) in shape.mesh.triangles.iter().zip(&shape.mesh.triangle_face) {
        if let Some(list) = by_face.get_mut(face as usize) {
            list.push(*triangle);
        }
    }
    by_face
}

/// Directions of straight edges, by their common length.
fn directions(shape: &Shape) -> Vec<DVec3> {
    let mut sums: Vec<(f64, DVec3)> = Vec::new();
    for edge in &shape.edges {
        let Curve::Line { direction, .. } = edge.curve else {
            continue;
        };
        match sums
            .iter_mut()
            .find(|(_, known)| same_direction(*known, direction))
        {
            Some((sum, _)) => *sum += edge.length_mm,
            None => sums.push((edge.length_mm, direction)),
        }
    }
    sums.sort_by(|a, b| b.0.total_cmp(&a.0));
    let upward = |d: DVec3| {
        if d.dot(DVec3::new(1e-6, 1e-3, 1.0)) < 0.0 {
            -d
        } else {
            d
        }
    };
    (sums.into_iter().take(DIRECTIONS))
        .map(|(_, direction)| upward(direction))
        .collect()
}

/// A face along the axis: its heights.
type Ruled = [f64; 2];

fn ruled(shape: &Shape, by_face: &[Vec<[u32; 3]>], face: u32, axis: DVec3) -> Option<Ruled> {
    let corners = |triangle: &[u32; 3]| triangle.map(|v| shape.mesh.vertices[v as usize]);
    let own = &by_face[face as usize];
    let is_along = match shape.faces[face as usize].surface {
        Surface::Plane { frame } => frame.z.dot(axis).abs() < ACROSS,
        Surface::Cylinder { frame, .. } => frame.z.cross(axis).length() < ACROSS,
        Surface::Spline => own.iter().all(|triangle| {
            let [a, b, c] = corners(triangle);
            let normal = (b - a).cross(c - a);
            normal.dot(axis).abs() <= ACROSS * normal.length()
        }),
        _ => false,
    };
    let heights = || own.iter().flat_map(|t| corners(t).map(|p| p.dot(axis)));
    let (low, high) = (
        heights().fold(f64::INFINITY, f64::min),
        heights().fold(f64::NEG_INFINITY, f64::max),
    );
    (is_along && high - low > SAME_MM).then_some([low, high])
}

/// Sets of faces that are joined by edges along the axis, each in ascending order.
fn joined(shape: &Shape, along: &BTreeMap<u32, Ruled>, axis: DVec3) -> Vec<Vec<u32>> {
    let mut beside: BTreeMap<u32, BTreeSet<u32>> =
        along.keys().map(|&face| (face, BTreeSet::new())).collect();
    for edge in &shape.edges {
        let is_straight =
            (edge.polyline.windows(2)).all(|p| same_direction((p[1] - p[0]).normalize_or_zero(), axis));
        for (&a, &b) in edge
            .faces
            .iter()
            .flat_map(|a| edge.faces.iter().map(move |b| (a, b)))
        {
            if is_straight
                && a != b
                && along.contains_key(&b)
                && let Some(set) = beside.get_mut(&a)
            {
                set.insert(b);
            }
        }
    }
    let mut sets = Vec::new();
    while let Some((first, _)) = beside.first_key_value() {
        let (mut open, mut set) = (vec![*first], Vec::new());
        while let Some(face) = open.pop() {
            if let Some(next) = beside.remove(&face) {
                set.push(face);
                open.extend(next);
            }
        }
        set.sort_unstable();
        sets.push(set);
    }
    sets
}

/// Whether two faces are cylinders about one axis, of one radius.
fn is_about(shape: &Shape, a: u32, b: u32) -> bool {
    match [a, b].map(|face| shape.faces[face as usize].surface) {
        [
            Surface::Cylinder { frame: f, radius: r },
            Surface::Cylinder { frame: g, radius: s },
        ] => {
            let apart = (f.origin - g.origin).reject_from_normalized(g.z).length();
            (r - s).abs() < SAME_MM && apart < SAME_MM
        }
        _ => false,
    }
}

/// The longest profile of some joined faces.
fn profile(
    shape: &Shape,
    by_face: &[Vec<[u32; 3]>],
    along: &BTreeMap<u32, Ruled>,
    joined: &[u32],
    axis: DVec3,
) -> Option<Profile> {
    let mut heights: Vec<f64> = joined
        .iter()
        .filter_map(|face| along.get(face))
        .flatten()
        .copied()
        .collect();
    heights.sort_by(f64::total_cmp);
    heights.dedup_by(|a, b| *a - *b < SAME_MM);
    // Runs of neighbouring closed sections: the outline of the longest of each, and where it begins and ends.
    let mut best: Option<(f64, [f64; 2], Outline)> = None;
    let mut run: Option<(f64, [f64; 2], Outline)> = None;
    for pair in heights.windows(2) {
        let [low, high] = [pair[0], pair[1]];
        let at = low + BETWEEN * (high - low);
        let faces: Vec<u32> = (joined.iter().copied())
            .filter(|face| along.get(face).is_some_and(|[l, h]| *l < at && at < *h))
            .collect();
        let outline = outline(shape, by_face, &faces, axis, at);
        run = match (run, outline) {
            (Some((long, [from, _], _)), Some(outline)) if high - low > long => {
                Some((high - low, [from, high], outline))
            }
            (Some((long, [from, _], outline)), Some(_)) => Some((long, [from, high], outline)),
            (None, Some(outline)) => Some((high - low, [low, high], outline)),
            (_, None) => None,
        };
        if let Some((long, [from, to], outline)) = &run
            && (best.as_ref()).is_none_or(|(_, [a, b], _)| to - from > b - a)
        {
            best = Some((*long, [*from, *to], outline.clone()));
        }
    }
    let (_, capacity_mm, found) = best?;
    let flats = (found.faces.iter())
        .filter(|face| matches!(shape.faces[**face as usize].surface, Surface::Plane { .. }))
        .count();
    let origin = found.x * found.middle.x + found.y * found.middle.y;
    Some(Profile {
        is_male: found.area > 0.0,
        origin,
        axis,
        x: found.x,
        y: found.y,
        area_mm2: found.area.abs(),
        outline: found.corners,
        capacity_mm,
        sides: [flats, found.faces.len() - flats],
        faces: found.faces,
    })
}

/// A closed section.
#[derive(Clone)]
struct Outline {
    faces: Vec<u32>,
    x: DVec3,
    y: DVec3,
    /// Centre of area in x and y.
    middle: DVec2,
    /// Corners from the middle.
    corners: Vec<DVec2>,
    /// Signed area: positive where the material is inside.
    area: f64,
}

/// The section of some faces at a height, if it is one closed line.
fn outline(shape: &Shape, by_face: &[Vec<[u32; 3]>], faces: &[u32], axis: DVec3, at: f64) -> Option<Outline> {
    let x = axis.any_orthonormal_vector();
    let y = axis.cross(x);
    let height = |v: u32| shape.mesh.vertices[v as usize].dot(axis) - at;
    // From the edge of the mesh on which a segment begins to the one on which it ends; the material is on its left.
    let mut next: HashMap<[u32; 2], ([u32; 2], DVec2)> = HashMap::new();
    let mut first = None;
    for triangle in faces.iter().flat_map(|face| &by_face[*face as usize]) {
        let [mut rises, mut falls] = [None, None];
        for i in 0..3 {
            let (a, b) = (triangle[i], triangle[(i + 1) % 3]);
            let (ha, hb) = (height(a), height(b));
            if (ha < 0.0) == (hb < 0.0) {
                continue;
            }
            let [p, q] = [a, b].map(|v| shape.mesh.vertices[v as usize]);
            let point = p.lerp(q, ha / (ha - hb));
            let end = ([a.min(b), a.max(b)], DVec2::new(point.dot(x), point.dot(y)));
            *(if hb < 0.0 { &mut falls } else { &mut rises }) = Some(end);
        }
        // Seen from outside a triangle runs counterclockwise: with the axis upwards its boundary falls on the left and rises on the right, and seen against
        // the axis the outline runs to the right.
        if let (Some((to, _)), Some((from, point))) = (rises, falls) {
            first.get_or_insert(from);
            if next.insert(from, (to, point)).is_some() {
                return None;
            }
        }
    }
    let first = first?;
    let (mut at, mut corners) = (first, Vec::new());
    while let Some((to, point)) = next.remove(&at) {
        corners.push(point);
        at = to;
        if at == first {
            break;
        }
    }
    if at != first || !next.is_empty() || corners.len() < 3 {
        return None;
    }
    let (area, middle) = area_and_middle(&corners)?;
    let mut corners: Vec<DVec2> = corners.into_iter().map(|p| p - middle).collect();
    if area < 0.0 {
        corners.reverse();
    }
    Some(Outline {
        faces: faces.to_vec(),
        x,
        y,
        middle,
        corners,
        area,
    })
}

/// Signed area and centre of area of a polygon.
fn area_and_middle(corners: &[DVec2]) -> Option<(f64, DVec2)> {
    let base = *corners.first()?;
    let (mut twice, mut sum) = (0.0, DVec2::ZERO);
    for (p, q) in pairs(corners) {
        let (p, q) = (p - base, q - base);
        let cross = p.perp_dot(q);
        twice += cross;
        sum += (p + q) * cross;
    }
    (twice != 0.0).then(|| (twice / 2.0, base + sum / (3.0 * twice)))
}

fn pairs(corners: &[DVec2]) -> impl Iterator<Item = (DVec2, DVec2)> + '_ {
    let next = corners.iter().cycle().skip(1);
    corners.iter().zip(next).map(|(p, q)| (*p, *q))
}

/// Signed distance of a point from an outline, negative inside.
pub fn signed(outline: &[DVec2], at: DVec2) -> f64 {
    let (mut least, mut is_inside) = (f64::INFINITY, false);
    for (p, q) in pairs(outline) {
        let along = q - p;
        let share = ((at - p).dot(along) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        least = least.min((p + along * share).distance(at));
        if (p.y > at.y) != (q.y > at.y) && at.x < p.x + along.x * (at.y - p.y) / along.y {
            is_inside = !is_inside;
        }
    }
    if is_inside { -least } else { least }
}
