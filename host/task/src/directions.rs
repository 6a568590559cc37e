//! Directions and axes along which a part could move: those of its own surfaces and of the surfaces beside it, and the normals of its contacts.

use glam::{DAffine3, DVec3};
use mortise_brep::{Frame, Surface};
use mortise_mating::Tolerances;

use crate::assembly::{Assembly, Moved};
use crate::clearance::Placed;
pub use crate::line::Line;
use crate::line::{same_direction, same_line};

/// Most directions (each used both ways) and axes of a group.
const MOST_DIRECTIONS: usize = 8;
const MOST_AXES: usize = 8;
/// Smallest share of its shape's area that a surface must have to count.
const LEAST_SHARE: f64 = 2e-3;
/// Sine between opposing normals in a contact.
const FACING: f64 = 1e-2;

/// Candidates of motion of a group, most important first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Candidates {
    /// Unit directions, of which both ways count.
    pub directions: Vec<DVec3>,
    /// Axes of turns.
    pub axes: Vec<Line>,
}

/// Normals of the contacts of a moved group with `others`: unit, pointing out of the other part, in the assembly's frame. A contact is a sample inside
/// a face within [`Tolerances::linear_mm`] of the other part's face that it faces.
pub fn contact_normals(assembly: &Assembly, group: &Moved<'_>, others: &[usize]) -> Vec<DVec3> {
    let near = Tolerances::default().linear_mm;
    let mut normals = Vec::new();
    for (a, b) in assembly.pairs(group, others, near) {
        let error = [a, b].map(|p| assembly.body(p).surface().surface_error_mm());
        let within = near + error[0] + error[1];
        let (pa, pb) = (
            assembly.placed(a, group.by),
            assembly.placed(b, DAffine3::IDENTITY),
        );
        touching(pa, pb, within, &mut |n| normals.push(-n));
        touching(pb, pa, within, &mut |n| normals.push(n));
    }
    normals
}

/// Outward normals, in the assembly's frame, of the samples inside faces of `a` that touch faces of `b`.
fn touching(a: Placed<'_>, b: Placed<'_>, within: f64, each: &mut dyn FnMut(DVec3)) {
    let to = b.pose.inverse() * a.pose;
    for sample in a.body.samples() {
        let Some(normal) = sample.normal else { continue };
        let p = to.transform_point3(sample.position);
        if b.body.exceeds(p, within) {
            continue;
        }
        let Some(near) = b.body.nearest(p) else { continue };
        let facing = b.body.face_normal(near.face, p);
        let own = to.transform_vector3(normal);
        if near.distance >= -10.0 * within
            && facing.is_some_and(|n| n.dot(own) < 0.0 && n.cross(own).length() < FACING)
        {
            each(a.pose.transform_vector3(normal));
        }
    }
}

/// Directions and axes of a moved group and of the surfaces beside it, by area: axes of cylinders, cones and tori, normals of planes.
pub fn candidates(assembly: &Assembly, group: &Moved<'_>, others: &[usize]) -> Candidates {
    let mut directions: Vec<(f64, DVec3)> = Vec::new();
    let mut axes: Vec<(f64, Line)> = Vec::new();
    let (low, high) = assembly.bounds_of(group.parts, group.by);
    let near = 0.05 * low.distance(high);
    let all = group
        .parts
        .iter()
        .map(|&p| (p, group.by))
        .chain(others.iter().map(|&p| (p, DAffine3::IDENTITY)));
    for (part, by) in all {
        let (l, h) = assembly.bounds(part, by);
        if (low - h).max(l - high).max_element() > near {
            continue;
        }
        let pose = by * assembly.placement(part);
        let shape = assembly.body(part).surface().shape();
        // Surfaces of the group count twice: it moves along its own.
        let weight = if group.parts.contains(&part) { 2.0 } else { 1.0 } / shape.area_mm2.max(1e-9);
        for face in &shape.faces {
            let share = face.area_mm2 * weight;
            if share < LEAST_SHARE {
                continue;
            }
            let line = |f: &Frame| Line {
                point: pose.transform_point3(f.origin),
                direction: pose.transform_vector3(f.z),
            };
            match &face.surface {
                Surface::Plane { frame } => add(
                    &mut directions,
                    share,
                    pose.transform_vector3(frame.z),
                    same_direction,
                ),
                Surface::Cylinder { frame, .. }
                | Surface::Cone { frame, .. }
                | Surface::Torus { frame, .. } => {
                    let line = line(frame);
                    if !matches!(face.surface, Surface::Torus { .. }) {
                        add(&mut directions, share, line.direction, same_direction);
                    }
                    // An axis far beyond both parts is that of a slightly curved face.
                    let foot =
                        line.point + line.direction * ((low + high) / 2.0 - line.point).dot(line.direction);
                    if foot.distance((low + high) / 2.0) < 2.0 * low.distance(high) {
                        add(&mut axes, share, line, same_line);
                    }
                }
                Surface::Sphere { frame, .. } => {
                    for z in [frame.z, frame.x, frame.y] {
                        add(&mut axes, share, line(&Frame { z, ..*frame }), same_line);
                    }
                }
                Surface::Spline => {}
            }
        }
    }
    directions.sort_by(|a, b| b.0.total_cmp(&a.0));
    axes.sort_by(|a, b| b.0.total_cmp(&a.0));
    Candidates {
        directions: directions
            .into_iter()
            .take(MOST_DIRECTIONS)
            .map(|(_, d)| d)
            .collect(),
        axes: axes.into_iter().take(MOST_AXES).map(|(_, l)| l).collect(),
    }
}

/// Smallest sine of the angle between two planes whose common line counts.
const CROSSING: f64 = 5e-2;

/// Directions in which a moved group slides between the planes that face it within `within` mm: each lies in two of these planes. Those with most samples nearby first.
///
/// A part in a channel touches neither wall and slides along no normal; the line that a wall and the floor have in common is its way.
pub(crate) fn between_planes(
    assembly: &Assembly,
    group: &Moved<'_>,
    others: &[usize],
    within: f64,
) -> Vec<DVec3> {
    let mut normals: Vec<(f64, DVec3)> = Vec::new();
    for (a, b) in assembly.pairs(group, others, within) {
        let (pa, pb) = (
            assembly.placed(a, group.by),
            assembly.placed(b, DAffine3::IDENTITY),
        );
        let mut each = |n| add(&mut normals, 1.0, n, same_direction);
        facing_planes(pa, pb, within, &mut each);
        facing_planes(pb, pa, within, &mut each);
    }
    let mut directions: Vec<(f64, DVec3)> = Vec::new();
    for (i, (m, a)) in normals.iter().enumerate() {
        for (n, b) in &normals[i + 1..] {
            let line = a.cross(*b);
            if line.length() > CROSSING {
                add(&mut directions, m.min(*n), line.normalize(), same_direction);
            }
        }
    }
    directions.sort_by(|a, b| b.0.total_cmp(&a.0));
    directions.into_iter().map(|(_, d)| d).collect()
}

/// Normals, in the assembly's frame, of the planes of `b` that are nearest to samples of `a` and within reach of them.
fn facing_planes(a: Placed<'_>, b: Placed<'_>, within: f64, each: &mut dyn FnMut(DVec3)) {
    let to = b.pose.inverse() * a.pose;
    let faces = &b.body.surface().shape().faces;
    for sample in a.body.samples() {
        let p = to.transform_point3(sample.position);
        if b.body.exceeds(p, within) {
            continue;
        }
        let plane = (b.body.nearest(p)).and_then(|near| match faces.get(near.face as usize)?.surface {
            Surface::Plane { frame } => Some(frame.z),
            _ => None,
        });
        if let Some(normal) = plane {
            each(b.pose.transform_vector3(normal));
        }
    }
}

fn add<T: Copy>(list: &mut Vec<(f64, T)>, weight: f64, item: T, same: fn(T, T) -> bool) {
    match list.iter_mut().find(|(_, other)| same(item, *other)) {
        Some((sum, _)) => *sum += weight,
        None => list.push((weight, item)),
    }
}
