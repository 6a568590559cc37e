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
/// Contacts come in tree order, so the last pair is tried first. Cost: 30 instructions per contact, and 500 per pair that has an edge.
pub(crate) fn touching_faces(contacts: &[Contact], at: &Scenery<'_, '_>, pairs: &mut FacePairs) {
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
            None if gathered.push(Gathered::new(c, at)).is_ok() => last = gathered.len() - 1,
            None => continue,
        }
        if let Some(g) = gathered.get_mut(last) {
            g.add(c, at);
        }
    }
    let mut merged: Vec<Gathered, MAX_GATHERED> = Vec::new();
    for g in &gathered {
        let g = g.facing(at);
        match merged.iter_mut().find(|m| m.is_like(&g)) {
            Some(m) => m.merge(&g),
            // Never exceeds the number gathered.
            None => drop(merged.push(g)),
        }
    }
    // Insertion into a sorted list of bounded length: at most MAX_GATHERED · MAX_PAIRS comparisons.
    for g in &merged {
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
    fn new(c: &Contact, at: &Scenery<'_, '_>) -> Self {
        let (moving, fixed) = (
            [c.moving_face, c.moving_edge_face],
            [c.static_face, c.static_edge_face],
        );
        let axis = at.axis(c.leaf.part(), &fixed, &moving);
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

    /// Copy in which, of two faces at an edge, the one that faces the other part comes first.
    fn facing(&self, at: &Scenery<'_, '_>) -> Self {
        let mut facing = self.clone();
        let p = &mut facing.pair;
        let turned = at.faces_along(at.held, [p.moving_face, p.moving_edge_face], p.point, -self.push);
        [p.moving_face, p.moving_edge_face] = turned;
        let turned = at.faces_along(
            p.static_part,
            [p.static_face, p.static_edge_face],
            p.point,
            self.push,
        );
        [p.static_face, p.static_edge_face] = turned;
        if at.axis(p.static_part, &[p.static_face], &[p.moving_face]) == Vec3::ZERO {
            // The axis belonged to the face beyond the edge.
            (facing.from, facing.to) = (0.0, 0.0);
        }
        facing
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

impl Scenery<'_, '_> {
    /// Exact surfaces and placement of a part.
    fn surfaces(&self, part: u16) -> Option<(Surfaces<'_>, Pose)> {
        let index = usize::from(part);
        let pose = if part == self.held {
            self.object
        } else {
            self.parts.get(index)?.pose
        };
        (index < self.scene.parts().len()).then(|| (self.scene.surfaces_of_part(index), pose))
    }

    /// Axis (world) of the first of these static faces that is a cylinder or cone, else of the first such moving face, else zero.
    fn axis(&self, static_part: u16, fixed: &[u16], moving: &[u16]) -> Vec3 {
        let of = |part: u16, face: u16| {
            let (surfaces, pose) = self.surfaces(part)?;
            let face = surfaces.faces.get(usize::from(face))?;
            let round = matches!(face.kind, surface_kind::CYLINDER | surface_kind::CONE);
            round.then(|| pose.transform_vector(Vec3::from_array(face.axis)))
        };
        (fixed.iter().find_map(|&face| of(static_part, face)))
            .or_else(|| moving.iter().find_map(|&face| of(self.held, face)))
            .unwrap_or(Vec3::ZERO)
    }

    /// Orders the two faces at an edge: first the one whose outward normal at `point` (world) points more along `direction`. Both need a closed form.
    fn faces_along(&self, part: u16, [a, b]: [u16; 2], point: Vec3, direction: Vec3) -> [u16; 2] {
        let along = |face: u16| {
            let (surfaces, pose) = self.surfaces(part)?;
            let back = pose.inverse();
            let normal = on_surface_of(surfaces, face, back.transform_point(point))?.normal;
            Some(normal.dot(back.transform_vector(direction)))
        };
        match (b != NO_FACE).then(|| along(a).zip(along(b))).flatten() {
            Some((first, second)) if second > first => [b, a],
            _ => [a, b],
        }
    }
}
