//! The assembly as it stands during a session: placements, ports, connections, and free travel by the exact distance.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use glam::{DAffine3, DVec3};
use mortise_brep::{CadModel, Shape};
use mortise_mating::PlaneRegion;
use mortise_task::{Assembly, Clearance, Motion, Moved, TaskError};
use rayon::prelude::*;

use crate::flange::{self, Flat, flats};
use crate::plane_port::{laid, regions};
use crate::port::{Port, ports};

/// Distance within which two placements are the same, mm at the corners of the part's box: well below the micrometre promised.
const SAME_MM: f64 = 1e-4;
/// Gap up to which the file has two parts together, mm: the clearance of a ring in its groove.
const NEAR_MM: f64 = 0.35;
/// Travel between two checks of samples that stay in contact, mm; others are bounded without a gap.
const STEP_MM: f64 = 0.5;
/// The same for questions whether a way is free, which are long.
const COARSE_MM: f64 = 1.0;
/// Travel that is tried first, mm.
const START_MM: f64 = 0.25;
/// Relative difference up to which volumes, areas and moments are equal.
const EQUAL_SHARE: f64 = 1e-7;
/// Room around a part that has left the others, mm.
pub const ROOM_MM: f64 = 5.0;

/// Connection of two ports, placed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// Port of the first part.
    pub port: Port,
    /// Port of the second.
    pub other: Port,
    /// Common interval on the first port's axis, mm from its origin.
    pub common: (f64, f64),
    /// The second part.
    pub with: usize,
}

/// An assembly with movable parts. Lengths mm, assembly frame.
pub struct World {
    assembly: Assembly,
    /// Placements in the file.
    home: Vec<DAffine3>,
    ports: Vec<Arc<[Port]>>,
    flats: Vec<Arc<[Flat]>>,
    regions: Vec<Arc<[PlaneRegion]>>,
    /// Number of the first equal shape.
    kinds: Vec<usize>,
    /// Pairs together in the file: in contact, a shaft in a bore, or within [`NEAR_MM`].
    joined: Vec<Vec<bool>>,
    diagonal: f64,
    /// Of pairs that were near: the second's place in the first's frame, and whether they are connected there.
    known: Mutex<HashMap<[usize; 2], (DAffine3, bool)>>,
    /// A part, and the parts that move with it, while they are attached to it.
    attached: Option<(usize, Vec<usize>)>,
}

impl World {
    /// Prepares `model`.
    ///
    /// # Errors
    /// [`TaskError`]: fewer than two parts, or a part without a surface.
    ///
    /// Cost: as [`Assembly::new`], and the fits of each pair.
    pub fn new(model: CadModel) -> Result<Self, TaskError> {
        let of_shapes: Vec<Arc<[Port]>> = model.shapes.iter().map(|shape| ports(shape).into()).collect();
        let kinds = model.parts.iter().map(|p| kind(&model.shapes, p.shape)).collect();
        let assembly = Assembly::new(model)?;
        let count = assembly.count();
        let home: Vec<DAffine3> = (0..count).map(|p| assembly.placement(p)).collect();
        let all: Vec<usize> = (0..count).collect();
        let (low, high) = assembly.bounds_of(&all, DAffine3::IDENTITY);
        let ports = assembly
            .model
            .parts
            .iter()
            .map(|p| of_shapes[p.shape].clone())
            .collect();
        let flats = (0..count).map(|p| flats(assembly.surfaces(p)).into()).collect();
        // Once for each shape.
        let mut of_shape: HashMap<usize, Arc<[PlaneRegion]>> = HashMap::new();
        let regions = (0..count)
            .map(|p| {
                let shape = assembly.model.parts[p].shape;
                let prepare = || regions(&assembly.model.shapes[shape], assembly.surfaces(p)).into();
                of_shape.entry(shape).or_insert_with(prepare).clone()
            })
            .collect();
        let mut world = Self {
            assembly,
            home,
            ports,
            flats,
            regions,
            kinds,
            joined: vec![vec![false; count]; count],
            diagonal: low.distance(high),
            known: Mutex::default(),
            attached: None,
        };
        for contact in world.assembly.contacts.clone() {
            world.join(contact.parts);
        }
        for a in 0..count {
            for b in a + 1..count {
                let near = world.assembly.are_within(a, b, NEAR_MM);
                if near || !world.fits_between(a, b).is_empty() {
                    world.join([a, b]);
                }
            }
        }
        Ok(world)
    }

    fn join(&mut self, [a, b]: [usize; 2]) {
        self.joined[a][b] = true;
        self.joined[b][a] = true;
    }

    /// The prepared assembly.
    pub fn assembly(&self) -> &Assembly {
        &self.assembly
    }

    /// Number of parts.
    pub fn count(&self) -> usize {
        self.home.len()
    }

    /// Name of a part.
    pub fn name(&self, part: usize) -> &str {
        self.assembly.name(part)
    }

    /// Placement of a part now.
    pub fn placement(&self, part: usize) -> DAffine3 {
        self.assembly.placement(part)
    }

    /// Placement of a part in the file.
    pub fn home(&self, part: usize) -> DAffine3 {
        self.home[part]
    }

    /// Places a part, and with it those that are attached to it.
    pub fn set_placement(&mut self, part: usize, placement: DAffine3) {
        if let Some((leader, with)) = &self.attached
            && *leader == part
        {
            let by = placement * self.placement(part).inverse();
            for &other in with {
                let there = by * self.placement(other);
                self.assembly.model.parts[other].placement = there;
            }
        }
        self.assembly.model.parts[part].placement = placement;
    }

    /// Attaches to `part` what is connected with it, directly or by others, until [`Self::detach`]: the aggregate that moves when the part is put onto `into`
    /// (Jung 2003, fig. 5). Where `into` belongs to it already, the part moves alone.
    ///
    /// Cost: the fits of each part of the aggregate with all others.
    pub fn attach(&mut self, part: usize, into: usize) {
        let mut with = vec![part];
        let mut next = 0;
        while next < with.len() {
            let found = self.connections(with[next]);
            if found.contains(&into) {
                return;
            }
            with.extend(
                found
                    .into_iter()
                    .filter(|other| !with.contains(other))
                    .collect::<Vec<_>>(),
            );
            next += 1;
        }
        with.remove(0);
        self.attached = (!with.is_empty()).then_some((part, with));
    }

    /// Ends what [`Self::attach`] began.
    pub fn detach(&mut self) {
        self.attached = None;
    }

    /// `moving`, and what is attached to them.
    fn all_moving(&self, moving: &[usize]) -> Vec<usize> {
        let mut all = moving.to_vec();
        if let Some((leader, with)) = &self.attached
            && moving.contains(leader)
        {
            all.extend(with.iter().filter(|other| !moving.contains(other)));
        }
        all
    }

    /// All placements now.
    pub fn placements(&self) -> Vec<DAffine3> {
        (0..self.count()).map(|p| self.placement(p)).collect()
    }

    /// Number of a part's kind: parts of equal shape in equal frames have the same, however often a file writes the shape.
    pub fn kind(&self, part: usize) -> usize {
        self.kinds[part]
    }

    /// Ports of a part, in its own frame.
    pub fn ports(&self, part: usize) -> &[Port] {
        &self.ports[part]
    }

    /// The larger flats of a part, in its own frame.
    pub fn flats(&self, part: usize) -> &[Flat] {
        &self.flats[part]
    }

    /// The larger flats of a part with their regions, in its own frame, largest first.
    pub fn regions(&self, part: usize) -> &[PlaneRegion] {
        &self.regions[part]
    }

    /// Size of the assembly in the file, mm.
    pub fn diagonal(&self) -> f64 {
        self.diagonal
    }

    /// Whether the file has the two parts connected.
    pub fn joined_at_home(&self, a: usize, b: usize) -> bool {
        self.joined[a][b]
    }

    /// Whether a part placed at `x` is where it would be at `y`.
    pub fn same(&self, part: usize, x: &DAffine3, y: &DAffine3) -> bool {
        let (low, high) = self.assembly.body(part).bounds();
        [
            low,
            high,
            DVec3::new(low.x, high.y, low.z),
            DVec3::new(high.x, low.y, low.z),
        ]
        .into_iter()
        .all(|p| x.transform_point3(p).distance(y.transform_point3(p)) < SAME_MM)
    }

    /// Connected ports of two parts as placed now.
    pub fn fits_between(&self, a: usize, b: usize) -> Vec<Fit> {
        let (pa, pb) = (self.placement(a), self.placement(b));
        let mut out = Vec::new();
        for port in self.ports(a) {
            let port = port.placed(&pa);
            for other in self.ports(b) {
                let other = other.placed(&pb);
                if let Some(common) = port.connected(&other) {
                    out.push(Fit {
                        port,
                        other,
                        common,
                        with: b,
                    });
                }
            }
        }
        out
    }

    /// Connected ports of a part with all others, the longest common interval first.
    pub fn fits(&self, a: usize) -> Vec<Fit> {
        let mut fits: Vec<Fit> = (0..self.count())
            .filter(|&b| b != a && self.assembly.boxes_are_near(a, b, NEAR_MM))
            .flat_map(|b| self.fits_between(a, b))
            .collect();
        let area = |f: &Fit| (f.common.1 - f.common.0) * f.port.radius;
        fits.sort_by(|f, g| area(g).total_cmp(&area(f)));
        fits
    }

    /// The normal of a flat of `a` that lies on a flat of `b` now, with bores in line.
    pub fn flange(&self, a: usize, b: usize) -> Option<DVec3> {
        let of = |part: usize| (self.flats(part), self.ports(part), self.placement(part));
        flange::joined(of(a), of(b))
    }

    /// The normal of a flat of `a` that lies on a flat of `b` now.
    pub fn laid(&self, a: usize, b: usize) -> Option<DVec3> {
        let of = |part: usize| (self.regions(part), self.placement(part));
        laid(of(a), of(b))
    }

    /// Whether two parts are connected now: ports in one another, a flange, a flat on a flat, or placed to each other as in a file that has them in contact.
    pub fn connected(&self, a: usize, b: usize) -> bool {
        if !self.assembly.boxes_are_near(a, b, NEAR_MM) {
            return false;
        }
        let place = self.placement(a).inverse() * self.placement(b);
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((there, connected)) = known.get(&[a, b])
            && *there == place
        {
            return *connected;
        }
        let connected = self.are_connected(a, b);
        known.insert([a, b], (place, connected));
        connected
    }

    fn are_connected(&self, a: usize, b: usize) -> bool {
        let as_at_home = self.joined[a][b] && {
            let wanted = self.placement(b) * self.home[b].inverse() * self.home[a];
            self.same(a, &self.placement(a), &wanted)
        };
        as_at_home
            || !self.fits_between(a, b).is_empty()
            || self.flange(a, b).is_some()
            || self.laid(a, b).is_some()
    }

    /// Parts connected to `a` now.
    pub fn connections(&self, a: usize) -> Vec<usize> {
        (0..self.count())
            .filter(|&b| b != a && self.connected(a, b))
            .collect()
    }

    /// Box of a part now.
    pub fn bounds(&self, part: usize) -> (DVec3, DVec3) {
        self.assembly.bounds(part, DAffine3::IDENTITY)
    }

    /// Middle of a part's box now.
    pub fn center(&self, part: usize) -> DVec3 {
        let (low, high) = self.bounds(part);
        (low + high) / 2.0
    }

    /// All parts but `moving` and what is attached to them.
    pub fn others(&self, moving: &[usize]) -> Vec<usize> {
        let moving = self.all_moving(moving);
        (0..self.count()).filter(|p| !moving.contains(p)).collect()
    }

    /// Travel of `moving` along the unit vector `direction`, at most `limit` mm, until it meets another part; and the pair that meets. Found to a
    /// micrometre.
    pub fn travel(&self, moving: &[usize], direction: DVec3, limit: f64) -> (f64, Option<[usize; 2]>) {
        let group = Moved {
            parts: &self.all_moving(moving),
            by: DAffine3::IDENTITY,
        };
        let (share, pair) = self.assembly.touch_share_by_cores(
            &group,
            &self.others(moving),
            &Motion::slide(direction * limit),
            STEP_MM,
        );
        (share * limit, pair)
    }

    /// As [`Self::travel`], found to `COARSE_MM` only: for questions whether a way is free. A way blocked at its start costs little, and has no free travel.
    pub fn free(&self, moving: &[usize], direction: DVec3, limit: f64) -> (f64, Option<[usize; 2]>) {
        let group = Moved {
            parts: &self.all_moving(moving),
            by: DAffine3::IDENTITY,
        };
        let start = START_MM.min(limit);
        let started = Moved {
            by: DAffine3::from_translation(direction * start),
            ..group
        };
        let others = self.others(moving);
        if let Some((_, pair)) = self.assembly.excess(&started, &others, 0.0) {
            return (0.0, Some(pair));
        }
        let step = COARSE_MM.min(limit / 2.0);
        let motion = Motion::slide(direction * limit);
        let (share, pair) = (self.assembly).free_share_by_cores(&group, &others, &motion, step);
        (share * limit, pair)
    }

    /// Travel of `moving` along the unit vector `direction`, from `from` to at most `limit` mm, until its box meets that of another part.
    pub fn room_mm(&self, moving: &[usize], direction: DVec3, from: f64, limit: f64) -> f64 {
        let own = self
            .assembly
            .bounds_of(&self.all_moving(moving), DAffine3::IDENTITY);
        (self.others(moving).into_iter())
            .filter_map(|other| meeting(own, self.bounds(other), direction))
            .filter(|(_, end)| *end > from)
            .map(|(start, _)| start.max(from))
            .fold(limit, f64::min)
    }

    /// Share of a motion that `part` makes before it meets another part, and the pair.
    pub fn share(&self, part: usize, motion: &Motion) -> (f64, Option<[usize; 2]>) {
        let moving = self.all_moving(&[part]);
        let group = Moved {
            parts: &moving,
            by: DAffine3::IDENTITY,
        };
        self.assembly
            .touch_share_by_cores(&group, &self.others(&moving), motion, STEP_MM)
    }

    /// The deepest overlap of `part` and what moves with it where they are now, however small.
    pub fn overlap(&self, part: usize) -> Option<Clearance> {
        let moving = self.all_moving(&[part]);
        let group = Moved {
            parts: &moving,
            by: DAffine3::IDENTITY,
        };
        self.assembly.clearance(&group, &self.others(&moving), 0.0, false)
    }

    /// A part that overlaps `part`, or what moves with it, by more than contact where they are now.
    pub fn blocker(&self, part: usize) -> Option<usize> {
        let moving = self.all_moving(&[part]);
        let group = Moved {
            parts: &moving,
            by: DAffine3::IDENTITY,
        };
        let blocks = |&other: &usize| self.assembly.excess(&group, &[other], 0.0).is_some();
        self.others(&moving).into_par_iter().find_first(blocks)
    }

    /// Shortest travel along `direction` at which the box of `moving` is apart from the boxes of `from`, mm.
    pub fn exit_mm(&self, moving: &[usize], from: &[usize], direction: DVec3) -> f64 {
        let (low, high) = self
            .assembly
            .bounds_of(&self.all_moving(moving), DAffine3::IDENTITY);
        // Stretches of the travel in which the boxes meet.
        let mut meets: Vec<(f64, f64)> = Vec::new();
        for &other in from {
            meets.extend(meeting((low, high), self.bounds(other), direction).filter(|(_, end)| *end > 0.0));
        }
        meets.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut at = 0.0;
        for (start, end) in meets {
            if start > at {
                break;
            }
            at = f64::max(at, end);
        }
        at
    }

    /// Directions in which a part may leave: axes of its connected ports, normals and axes of its contacts, normals of
    /// its flanges and of flats that lie on each other, and the file's axes; both ways.
    pub fn ways(&self, part: usize) -> Vec<DVec3> {
        let mut ways: Vec<DVec3> = Vec::new();
        let mut add = |d: DVec3| {
            for d in [d, -d] {
                if !ways.iter().any(|w| w.dot(d) > 0.999_999) {
                    ways.push(d);
                }
            }
        };
        for fit in self.fits(part) {
            add(fit.port.direction);
        }
        for contact in self.assembly.contacts.iter().filter(|c| c.parts.contains(&part)) {
            let [a, b] = contact.parts;
            if self.connected(a, b) {
                let turned = self.placement(a) * self.home[a].inverse();
                add(turned
                    .transform_vector3(contact.axis.direction)
                    .normalize_or_zero());
            }
        }
        for other in (0..self.count()).filter(|&other| other != part) {
            if self.assembly.boxes_are_near(part, other, NEAR_MM) {
                let normal = self.flange(part, other).or_else(|| self.laid(part, other));
                normal.map(&mut add);
            }
        }
        for axis in DVec3::AXES {
            add(axis);
        }
        ways.retain(|w| w.is_normalized());
        ways
    }

    /// Moves parts by a translation.
    pub fn shift(&mut self, parts: &[usize], by: DVec3) {
        for &part in parts {
            let moved = DAffine3::from_translation(by) * self.placement(part);
            self.set_placement(part, moved);
        }
    }
}

/// Stretch of the travel of a box along `direction` in which it meets another box; `None` where it never does.
fn meeting((low, high): (DVec3, DVec3), (l, h): (DVec3, DVec3), direction: DVec3) -> Option<(f64, f64)> {
    let (mut start, mut end) = (f64::NEG_INFINITY, f64::INFINITY);
    for axis in 0..3 {
        let d = direction[axis];
        let (gap_low, gap_high) = (l[axis] - high[axis], h[axis] - low[axis]);
        if d.abs() < 1e-9 {
            if gap_low > 0.0 || gap_high < 0.0 {
                return None;
            }
        } else {
            let (a, b) = (gap_low / d, gap_high / d);
            start = f64::max(start, a.min(b));
            end = f64::min(end, a.max(b));
        }
    }
    (end > start).then_some((start, end))
}

/// The first shape that is equal to shape `index` in its own frame: same faces, volume, area and centre of mass.
fn kind(shapes: &[Shape], index: usize) -> usize {
    let this = &shapes[index];
    let close = |a: f64, b: f64| (a - b).abs() <= EQUAL_SHARE * a.abs().max(b.abs());
    let equal = |other: &Shape| {
        other.faces.len() == this.faces.len()
            && other.edges.len() == this.edges.len()
            && close(other.volume_mm3, this.volume_mm3)
            && close(other.area_mm2, this.area_mm2)
            && other.center_of_mass.distance(this.center_of_mass) < SAME_MM
            && (0..3).all(|i| close(other.inertia_mm5[i][i], this.inertia_mm5[i][i]))
    };
    shapes.iter().position(equal).unwrap_or(index)
}
