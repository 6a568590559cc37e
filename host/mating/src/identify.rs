//! Identification of all contacts of an assembly.

use std::collections::BTreeMap;

use glam::{DAffine3, DVec3};
use mortise_brep::{CadModel, Shape, Surface};
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy};

use crate::annular;
use crate::contact::{Axis, Contact, ContactKind};
use crate::merge::{MergedSurface, Side, merge};
use crate::overlap::Chart;
use crate::same::{Ball, difference, moved};
use crate::sphere::SphereDrawing;
use crate::tiles::{FaceTiles, ShapeTiles, Tiles};
use crate::tolerances::Tolerances;

/// Largest relative error of an area whose outline has arcs, unless the arcs are already followed at the finest step.
const AREA_ERROR: f64 = 1e-3;

/// Finds the contacts between different parts of `model` at their placements, ordered by parts and surfaces.
///
/// Cost: a tree over the boxes of all faces; then, for each pair of faces whose boxes overlap and whose surfaces agree, the
/// product of their numbers of triangles.
pub fn identify(model: &CadModel, tolerances: &Tolerances) -> Vec<Contact> {
    let mut shapes: Vec<Option<Prepared>> = model.shapes.iter().map(|_| None).collect();
    for part in &model.parts {
        if let (Some(slot), Some(shape)) = (shapes.get_mut(part.shape), model.shapes.get(part.shape)) {
            slot.get_or_insert_with(|| Prepared::new(shape, tolerances));
        }
    }
    let leaves: Vec<Leaf> = (model.parts.iter().enumerate())
        .filter_map(|(part, p)| Some((part, shapes.get(p.shape)?.as_ref()?)))
        .flat_map(|(part, shape)| (0..shape.faces.len()).map(move |face| Leaf { part, face }))
        .collect();
    let at = |leaf: &Leaf| {
        (
            shapes[model.parts[leaf.part].shape].as_ref(),
            &model.parts[leaf.part].placement,
        )
    };
    let boxes: Vec<Aabb> = leaves
        .iter()
        .map(|leaf| {
            let (Some(shape), placement) = at(leaf) else {
                return Aabb::new_invalid();
            };
            let (low, high) = shape.faces[leaf.face].reach(placement, tolerances.linear_mm);
            Aabb::new(low.to_array().into(), high.to_array().into())
        })
        .collect();
    let tree = Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes);
    let mut found: BTreeMap<([usize; 2], [usize; 2], ContactKind), Vec<Touch>> = BTreeMap::new();
    for (i, leaf) in leaves.iter().enumerate() {
        for j in tree.intersect_aabb(&boxes[i]) {
            let other = &leaves[j as usize];
            // Leaves are ordered by part, so each pair is visited once.
            if other.part <= leaf.part {
                continue;
            }
            let ((Some(a), place_a), (Some(b), place_b)) = (at(leaf), at(other)) else {
                continue;
            };
            let pair = Pair {
                a,
                b,
                faces: [leaf.face, other.face],
                b_in_a: place_a.inverse() * *place_b,
                tolerances,
            };
            if let Some((kind, touch)) = pair.touch() {
                let surfaces = [a.faces[leaf.face].surface, b.faces[other.face].surface];
                found
                    .entry(([leaf.part, other.part], surfaces, kind))
                    .or_default()
                    .push(touch);
            }
        }
    }
    found
        .into_iter()
        .filter_map(|((parts, surfaces, kind), touches)| {
            let [a, b] = parts.map(|p| at(&Leaf { part: p, face: 0 }));
            Some(contact(kind, parts, surfaces, touches, [a.0?, b.0?], a.1))
        })
        .collect()
}

/// A face of a part: index into [`Prepared::faces`].
struct Leaf {
    part: usize,
    face: usize,
}

/// A shape with its surfaces merged and its faces tiled.
struct Prepared<'a> {
    tiles: ShapeTiles<'a>,
    merged: Vec<MergedSurface>,
    faces: Vec<PreparedFace>,
}

struct PreparedFace {
    id: u32,
    /// Index into [`Prepared::merged`], and the patch there.
    surface: usize,
    patch: u32,
    tiles: FaceTiles,
}

impl<'a> Prepared<'a> {
    fn new(shape: &'a Shape, tolerances: &Tolerances) -> Self {
        let tiles = ShapeTiles::new(shape);
        let merged = merge(shape, tolerances);
        let mut faces = Vec::new();
        for (surface, m) in merged.iter().enumerate() {
            for (&id, &patch) in m.faces.iter().zip(&m.patches) {
                faces.push(PreparedFace {
                    id,
                    surface,
                    patch,
                    tiles: tiles.face(id),
                });
            }
        }
        Self { tiles, merged, faces }
    }
}

impl PreparedFace {
    /// Box of the placed face, enlarged by `margin`.
    fn reach(&self, placement: &DAffine3, margin: f64) -> (DVec3, DVec3) {
        let (low, high) = (self.tiles.low, self.tiles.high);
        let m = placement.matrix3;
        let half = (high - low) / 2.0;
        let reach = m.x_axis.abs() * half.x + m.y_axis.abs() * half.y + m.z_axis.abs() * half.z + margin;
        let center = placement.transform_point3((low + high) / 2.0);
        (center - reach, center + reach)
    }
}

/// Two faces that touch.
struct Touch {
    faces: [u32; 2],
    patches: [u32; 2],
    area: f64,
    length: f64,
    /// Middle of the common region, in the first part's frame.
    middle: DVec3,
    /// Direction of the bore of a ball in a bore, in the first part's frame.
    along: Option<DVec3>,
}

/// Two faces whose boxes overlap.
struct Pair<'a> {
    a: &'a Prepared<'a>,
    b: &'a Prepared<'a>,
    faces: [usize; 2],
    b_in_a: DAffine3,
    tolerances: &'a Tolerances,
}

impl Pair<'_> {
    fn touch(&self) -> Option<(ContactKind, Touch)> {
        let (fa, fb) = (&self.a.faces[self.faces[0]], &self.b.faces[self.faces[1]]);
        let (ma, mb) = (&self.a.merged[fa.surface], &self.b.merged[fb.surface]);
        let theirs = moved(&mb.surface, &self.b_in_a);
        let kind = kind(ma, mb, &theirs)?;
        let margin = self.tolerances.linear_mm;
        let (low, high) = fb.reach(&self.b_in_a, margin);
        let (low, high) = (low.max(fa.tiles.low - margin), high.min(fa.tiles.high + margin));
        if low.cmpgt(high).any() {
            return None;
        }
        let ball = Ball {
            center: (low + high) / 2.0,
            radius: low.distance(high) / 2.0,
        };
        let fit = ma.fit_mm + mb.fit_mm;
        if kind == ContactKind::Annular {
            return self.ring(ma, &theirs, fit).map(|touch| (kind, touch));
        }
        let apart = difference(&ma.surface, &theirs, ball)?;
        if apart.linear > self.tolerances.linear_mm + fit || apart.angular > self.tolerances.angular_rad {
            return None;
        }
        let share = |a: &Tiles, b: &Tiles| match (ma.surface, Chart::new(&ma.surface)) {
            (_, Some(chart)) => {
                let mine = chart.draw(a, &DAffine3::IDENTITY);
                let (area, middle) = chart.common(&mine, &chart.draw(b, &self.b_in_a));
                (area, chart.point(middle))
            }
            (Surface::Sphere { frame, radius }, None) => {
                let mine = SphereDrawing::new(a, &DAffine3::IDENTITY, frame.origin);
                let center = sphere_center(&theirs).unwrap_or(frame.origin);
                let area = mine.common(&SphereDrawing::new(b, &self.b_in_a, center)) * radius * radius;
                (area, frame.origin)
            }
            _ => (0.0, DVec3::ZERO),
        };
        let (mut area, mut middle) = share(&fa.tiles.coarse, &fb.tiles.coarse);
        let back = self.b_in_a.inverse();
        let ((coarse_a, fine_a), (coarse_b, fine_b)) = (fa.tiles.slack(low, high), {
            let (center, half) = ((low + high) / 2.0, (high - low) / 2.0);
            let m = back.matrix3;
            let reach = m.x_axis.abs() * half.x + m.y_axis.abs() * half.y + m.z_axis.abs() * half.z;
            let center = back.transform_point3(center);
            fb.tiles.slack(center - reach, center + reach)
        });
        let (coarse, fine) = (coarse_a + coarse_b, fine_a + fine_b);
        let least = self.tolerances.min_area_mm2;
        if area + coarse <= least {
            return None;
        }
        if coarse > AREA_ERROR * area && fine < coarse {
            (area, middle) = share(&self.a.tiles.fine(fa.id), &self.b.tiles.fine(fb.id));
        }
        if area <= least.max(fine) {
            return None;
        }
        let touch = Touch {
            faces: [fa.id, fb.id],
            patches: [fa.patch, fb.patch],
            area,
            length: 0.0,
            middle,
            along: None,
        };
        Some((kind, touch))
    }

    /// Contact of a ball in a bore, in either order of the parts.
    fn ring(&self, ma: &MergedSurface, theirs: &Surface, fit: f64) -> Option<Touch> {
        let (fa, fb) = (&self.a.faces[self.faces[0]], &self.b.faces[self.faces[1]]);
        let ((ball, ball_tiles, ball_place), (bore, bore_tiles, bore_place)) = {
            let a = (ma.surface, &fa.tiles.coarse, DAffine3::IDENTITY);
            let b = (*theirs, &fb.tiles.coarse, self.b_in_a);
            if matches!(ma.surface, Surface::Sphere { .. }) {
                (a, b)
            } else {
                (b, a)
            }
        };
        let (
            Surface::Sphere {
                frame: center,
                radius: r,
            },
            Surface::Cylinder { frame, radius },
        ) = (ball, bore)
        else {
            return None;
        };
        let offset = center.origin - frame.origin;
        let apart = offset.reject_from_normalized(frame.z).length() + (r - radius).abs();
        if apart > self.tolerances.linear_mm + fit {
            return None;
        }
        let chart = Chart::new(&bore)?;
        let bore_drawing = chart.draw(bore_tiles, &bore_place);
        let ball_drawing = SphereDrawing::new(ball_tiles, &ball_place, center.origin);
        let height = offset.dot(frame.z);
        let length = annular::length(&chart, &bore_drawing, &ball_drawing, &frame, radius, height);
        (length > 0.0).then_some(Touch {
            faces: [fa.id, fb.id],
            patches: [fa.patch, fb.patch],
            area: 0.0,
            length,
            middle: center.origin,
            along: Some(frame.z),
        })
    }
}

fn sphere_center(surface: &Surface) -> Option<DVec3> {
    match surface {
        Surface::Sphere { frame, .. } => Some(frame.origin),
        _ => None,
    }
}

/// Kind of contact that two surfaces can make; `theirs` is the second surface in the frame of the first.
fn kind(a: &MergedSurface, b: &MergedSurface, theirs: &Surface) -> Option<ContactKind> {
    let facing = [a.side, b.side] == [Side::Convex, Side::Concave]
        || [a.side, b.side] == [Side::Concave, Side::Convex];
    match (&a.surface, theirs) {
        (Surface::Plane { frame: f }, Surface::Plane { frame: g }) => {
            (f.z.dot(g.z) < 0.0).then_some(ContactKind::Planar)
        }
        (Surface::Cylinder { .. }, Surface::Cylinder { .. }) => facing.then_some(ContactKind::Cylindrical),
        (Surface::Cone { .. }, Surface::Cone { .. }) => facing.then_some(ContactKind::Conical),
        (Surface::Sphere { .. }, Surface::Sphere { .. }) => facing.then_some(ContactKind::Spherical),
        (Surface::Sphere { .. }, Surface::Cylinder { .. }) => {
            (facing && a.side == Side::Convex).then_some(ContactKind::Annular)
        }
        (Surface::Cylinder { .. }, Surface::Sphere { .. }) => {
            (facing && b.side == Side::Convex).then_some(ContactKind::Annular)
        }
        _ => None,
    }
}

fn contact(
    kind: ContactKind,
    parts: [usize; 2],
    surfaces: [usize; 2],
    touches: Vec<Touch>,
    [a, b]: [&Prepared<'_>; 2],
    placement: &DAffine3,
) -> Contact {
    let (mine, theirs) = (&a.merged[surfaces[0]], &b.merged[surfaces[1]]);
    let weight = |t: &Touch| t.area + t.length;
    let total: f64 = touches.iter().map(weight).sum();
    let middle = touches.iter().map(|t| t.middle * weight(t)).sum::<DVec3>() / total;
    let mut patches: Vec<[u32; 2]> = touches.iter().map(|t| t.patches).collect();
    patches.sort_unstable();
    patches.dedup();
    let (direction, radius_mm, half_angle_rad) = match mine.surface {
        Surface::Cylinder { frame, radius } => (frame.z, Some(radius), None),
        Surface::Cone {
            frame,
            radius,
            half_angle,
        } => {
            let here = radius + (middle - frame.origin).dot(frame.z) * half_angle.tan();
            (frame.z, Some(here), Some(half_angle))
        }
        Surface::Sphere { radius, .. } => (touches[0].along.unwrap_or(DVec3::Z), Some(radius), None),
        Surface::Plane { frame } => (frame.z, None, None),
        Surface::Torus { .. } | Surface::Spline => (DVec3::Z, None, None),
    };
    Contact {
        kind,
        parts,
        surfaces,
        count: patches.len(),
        axis: Axis {
            origin: placement.transform_point3(middle),
            direction: placement.transform_vector3(direction),
        },
        radius_mm,
        half_angle_rad,
        area_mm2: touches.iter().map(|t| t.area).sum(),
        length_mm: touches.iter().map(|t| t.length).sum(),
        fit_mm: mine.fit_mm.max(theirs.fit_mm),
        faces: touches.into_iter().map(|t| t.faces).collect(),
    }
}
