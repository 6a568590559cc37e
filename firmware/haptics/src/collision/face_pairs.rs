//! Touching face pairs: the contacts of a tick gathered by face pair.
//!
//! A point on an edge belongs to two faces. The one that touches is the one that faces the other part's surface: the wall of a hole where its rim
//! meets a peg's side, the top of a block where it meets the peg's end. It is chosen at the deepest point of those that share their faces.

use glam::Vec3;
use heapless::Vec;
use mortise_protocol::image::{NO_FACE, SceneImage, Surfaces, surface_kind};
use mortise_protocol::limits::MAX_PAIRS;

use crate::collision::contact::{Contact, Phase};
use crate::collision::exact_surface::on_surface_of;
use crate::collision::placement::Placed;
use crate::io::{FacePair, FacePairs};
use crate::math::pose::Pose;

/// Pairs gathered before the deepest [`MAX_PAIRS`] are reported; contacts of further pairs are not counted.
const MAX_GATHERED: usize = 2 * MAX_PAIRS;

/// Placements at which the contacts were found.
pub(crate) struct Scenery<'a, 'i> {
    pub scene: &'a SceneImage<'i>,
    pub parts: &'a [Placed],
    /// Index and placement of the held part.
    pub held: u16,
    pub object: Pose,
    /// Its centre of mass, world, m.
    pub center: Vec3,
    pub period_s: f32,
}

/// Contacts between the same faces, and their extent along an axis.
#[derive(Clone, Debug)]
struct Gathered {
    pair: FacePair,
    /// Direction that pushes the held part away at the deepest point, world.
    push: Vec3,
    /// Axis of the round face, world; zero where neither face is round.
    axis: Vec3,
    from: f32,
    to: f32,
}

/// Adds the face pairs of all pushing contacts to the empty `pairs`, deepest first (by depth at the step's end); among equals the first found comes
/// first.
///
/// Contacts come in tree order, so the last pair is tried first. Cost: 30 instructions per contact, 200 per pair, and 1000 for each of the deepest [`MAX_PAIRS`].
pub(crate) fn touching_faces(contacts: &[Contact], at: &Scenery<'_, '_>, pairs: &mut FacePairs) {
    let mut parts = HeldAndOther::new(at);
    let mut gathered: Vec<Gathered, MAX_GATHERED> = Vec::new();
    let mut last = 0;
    for c in contacts.iter().filter(|c| c.phase != Phase::Free) {
        let same = |g: &Gathered| {
            let p = &g.pair;
            (p.moving_face, p.static_part, p.static_face) == (c.moving_face, c.leaf.part(), c.static_face)
                && (p.moving_edge_face, p.static_edge_face) == (c.moving_edge_face, c.static_edge_face)
        };
        let found = match gathered.get(last) {
            Some(g) if same(g) => Some(last),
            _ => gathered.iter().position(same),
        };
        match found {
            Some(i) => last = i,
            None if gathered.push(Gathered::new(c, parts.of(c.leaf.part()))).is_ok() => {
                last = gathered.len() - 1
            }
            None => continue,
        }
        if let Some(g) = gathered.get_mut(last) {
            g.add(c, at);
        }
    }
    // What follows is done for the deepest alone.
    let mut deepest: Vec<u8, MAX_GATHERED> = (0..gathered.len() as u8).collect();
    let depth_m = |place: u8| gathered.get(usize::from(place)).map_or(0.0, |g| g.pair.depth_m);
    deepest.sort_unstable_by(|a, b| depth_m(*b).total_cmp(&depth_m(*a)).then(a.cmp(b)));
    deepest.truncate(MAX_PAIRS);
    let mut merged: Vec<Gathered, MAX_PAIRS> = Vec::new();
    for &place in &deepest {
        let Some(g) = gathered.get_mut(usize::from(place)) else {
            continue;
        };
        g.face(parts.of(g.pair.static_part));
        match merged.iter_mut().find(|m| m.is_like(g)) {
            Some(m) => m.merge(g),
            // Never exceeds the number of the deepest.
            None => drop(merged.push(g.clone())),
        }
    }
    report(&merged, pairs);
}

/// Adds the pairs to those reported, deepest first.
fn report(merged: &[Gathered], pairs: &mut FacePairs) {
    // Insertion into a sorted list of bounded length: at most MAX_GATHERED · MAX_PAIRS comparisons.
    for g in merged {
        let p = FacePair {
            insertion_m: g.to - g.from,
            ..g.pair
        };
        let place = pairs
            .iter()
            .position(|q| p.depth_m > q.depth_m)
            .unwrap_or(pairs.len());
        if pairs.is_full() && place < pairs.len() {
            let _ = pairs.pop();
        }
        if place <= pairs.len() {
            let _ = pairs.insert(place, p);
        }
    }
}

impl Gathered {
    /// Pair of the faces of a contact, which is not added yet.
    fn new(c: &Contact, parts: [Option<&PlacedSurfaces<'_>>; 2]) -> Self {
        let (moving, fixed) = (
            [c.moving_face, c.moving_edge_face],
            [c.static_face, c.static_edge_face],
        );
        let axis = axis_of(parts, &moving, &fixed);
        let along = c.arm.dot(axis);
        Self {
            pair: FacePair {
                moving_face: c.moving_face,
                static_part: c.leaf.part(),
                static_face: c.static_face,
                moving_edge_face: c.moving_edge_face,
                static_edge_face: c.static_edge_face,
                depth_m: f32::NEG_INFINITY,
                ..FacePair::default()
            },
            push: Vec3::ZERO,
            axis,
            from: along,
            to: along,
        }
    }

    fn add(&mut self, c: &Contact, at: &Scenery<'_, '_>) {
        let depth_m = -(c.gap + at.period_s * c.rate);
        let p = &mut self.pair;
        p.count = p.count.saturating_add(1);
        if depth_m > p.depth_m {
            p.depth_m = depth_m;
            p.point = at.center + c.arm;
            self.push = Vec3::new(c.row[0], c.row[1], c.row[2]);
        }
        let along = c.arm.dot(self.axis);
        if along < self.from {
            self.from = along;
        } else if along > self.to {
            self.to = along;
        }
    }

    /// Puts first, of two faces at an edge, the one that faces the other part.
    fn face(&mut self, parts: [Option<&PlacedSurfaces<'_>>; 2]) {
        let p = &mut self.pair;
        if p.moving_edge_face == NO_FACE && p.static_edge_face == NO_FACE {
            return;
        }
        let [held, other] = parts;
        let moving = [p.moving_face, p.moving_edge_face];
        let fixed = [p.static_face, p.static_edge_face];
        [p.moving_face, p.moving_edge_face] = faces_along(held, moving, p.point, -self.push);
        [p.static_face, p.static_edge_face] = faces_along(other, fixed, p.point, self.push);
        if axis_of(parts, &[p.moving_face], &[p.static_face]) == Vec3::ZERO {
            // The axis belonged to the face beyond the edge.
            (self.from, self.to) = (0.0, 0.0);
        }
    }

    fn is_like(&self, other: &Self) -> bool {
        let faces = |p: &FacePair| (p.moving_face, p.static_part, p.static_face);
        faces(&self.pair) == faces(&other.pair)
    }

    /// Adds the contacts of another entry for the same faces.
    fn merge(&mut self, other: &Self) {
        let count = self.pair.count.saturating_add(other.pair.count);
        if other.pair.depth_m > self.pair.depth_m {
            self.pair = other.pair;
        }
        self.pair.count = count;
        // The axes belong to the same face, or to faces about the same axis, in either sense.
        let (from, to) = if self.axis.dot(other.axis) < 0.0 {
            (-other.to, -other.from)
        } else {
            (other.from, other.to)
        };
        if from < self.from {
            self.from = from;
        }
        if to > self.to {
            self.to = to;
        }
    }
}

/// Exact surfaces of a part, and its placement.
struct PlacedSurfaces<'a> {
    surfaces: Surfaces<'a>,
    pose: Pose,
    /// World to part.
    back: Pose,
}

/// The held part and another one: the last that was asked for, since contacts come by parts.
struct HeldAndOther<'s, 'a, 'i> {
    at: &'s Scenery<'a, 'i>,
    held: Option<PlacedSurfaces<'a>>,
    part: u16,
    other: Option<PlacedSurfaces<'a>>,
}

impl<'s, 'a, 'i> HeldAndOther<'s, 'a, 'i> {
    fn new(at: &'s Scenery<'a, 'i>) -> Self {
        Self {
            at,
            held: at.placed_surfaces(at.held),
            part: at.held,
            other: None,
        }
    }

    /// The held part and this one.
    fn of(&mut self, part: u16) -> [Option<&PlacedSurfaces<'a>>; 2] {
        if part != self.part || self.other.is_none() {
            self.part = part;
            self.other = self.at.placed_surfaces(part);
        }
        [self.held.as_ref(), self.other.as_ref()]
    }
}

impl<'a> Scenery<'a, '_> {
    fn placed_surfaces(&self, part: u16) -> Option<PlacedSurfaces<'a>> {
        let index = usize::from(part);
        let pose = if part == self.held {
            self.object
        } else {
            self.parts.get(index)?.pose
        };
        (index < self.scene.parts().len()).then(|| PlacedSurfaces {
            surfaces: self.scene.surfaces_of_part(index),
            pose,
            back: pose.inverse(),
        })
    }
}

/// Axis (world) of the first of these static faces that is a cylinder or cone, else of the first such moving face, else zero.
fn axis_of([held, other]: [Option<&PlacedSurfaces<'_>>; 2], moving: &[u16], fixed: &[u16]) -> Vec3 {
    let of = |part: Option<&PlacedSurfaces<'_>>, face: u16| {
        let part = part?;
        let face = part.surfaces.faces.get(usize::from(face))?;
        let round = matches!(face.kind, surface_kind::CYLINDER | surface_kind::CONE);
        round.then(|| part.pose.transform_vector(Vec3::from_array(face.axis)))
    };
    (fixed.iter().find_map(|&face| of(other, face)))
        .or_else(|| moving.iter().find_map(|&face| of(held, face)))
        .unwrap_or(Vec3::ZERO)
}

/// Orders the two faces at an edge: first the one whose outward normal at `point` (world) points more along `direction`. Both need a closed form.
fn faces_along(
    part: Option<&PlacedSurfaces<'_>>,
    [a, b]: [u16; 2],
    point: Vec3,
    direction: Vec3,
) -> [u16; 2] {
    let Some(part) = part.filter(|_| b != NO_FACE) else {
        return [a, b];
    };
    let (point, direction) = (
        part.back.transform_point(point),
        part.back.transform_vector(direction),
    );
    let along = |face: u16| Some(on_surface_of(part.surfaces, face, point)?.normal.dot(direction));
    match along(a).zip(along(b)) {
        Some((first, second)) if second > first => [b, a],
        _ => [a, b],
    }
}
