//! Joints: what a target keeps apart needs no looking at.
//!
//! A target that is fully engaged keeps the part on its axis, and its mating faces, which make room for each other there ([`crate::guidance`]),
//! cannot touch: coaxial cylinders of radii R and r are R − r apart, less what the part is off the axis. As long as
//!
//! e + θ·l + 2·Δ + slack ≤ (R − r) + room
//!
//! (e, θ: offset and angle left; l: lever from the axis' point to the part's farthest; Δ: what the motion so far, or that without contacts, adds in a
//! tick) no point of one face can become a contact with the other. Then the target is a *joint*, and leaves of the sphere tree whose points meet
//! nothing but the other face are passed over until the object has travelled to where that may end. What is felt is the same to the bit
//! with and without: a joint forms and ends without a step because it changes the work and nothing else.
//!
//! Whether a leaf's points meet nothing else is asked of the field, as seldom as the field is asked about nodes: of all of them at once by what the
//! bricks about them have to do with, or of each by the cells next to it. What is read is counted in the budget for what it takes, and a tick begins
//! no more once it has spent a twelfth of its budget so: leaves not asked about are looked at as ever.
//!
//! R − r is taken from the scene's own exact surfaces, not from the target: faces that are not what the target says stay in the work. So do
//! conical and flat ones, which have a stop of their own along the axis, and all others of both parts: a bolt's head still lands.

use glam::Vec3;
use heapless::Vec;
use mortise_protocol::image::{EDGE_ERROR_CELLS, FaceRecord, PointRecord, Shape, surface_kind};
use mortise_protocol::limits::MAX_TARGETS;
use mortise_protocol::message::{ConstraintKind, ConstraintTarget, Feature};

use crate::guidance::holds;
use crate::job::Job;
use crate::limits::length;
use crate::proximity::{LOOKUP, Walk};

/// Pairs of joints to one part; of more, the rest stay in the work.
const MAX_JOINED: usize = 2 * MAX_TARGETS;
/// Around a leaf's points, cells that must hold the mating face and no other: half a brick, or else the next.
const FAR_CELLS: f32 = 4.0;
const NEXT_CELLS: f32 = 1.0;
/// A way shorter than this is not worth remembering.
const LEAST_CLEAR_CELLS: f32 = 0.5;
/// Read for one answer, at most: what 8 points take that each lie in a corner of bricks which hold other faces too.
const MOST_READS: u32 = 1000;

/// What asking about a leaf counts in the budget before anything is read.
const CLEARING: u32 = 4 * LOOKUP;
/// So many reads of the field's bricks and cells count in the budget as one [`LOOKUP`].
const CLEARING_READS: u32 = 14;
/// A tick asks about no further leaf once asking has counted one part in so many of its budget of look-ups, each [`LOOKUP`].
const CLEARING_SHARE: u32 = 12;

/// Face pairs that joints to one part keep apart: of the tree's shape, of the field's.
pub(crate) type Joined = Vec<[u16; 2], MAX_JOINED>;

/// How mating faces fit when their target is met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Fit {
    /// Which of the target's pairs are kept apart, by bit.
    pub pairs: u8,
    /// The smallest gap between those, m; negative for a press fit.
    pub gap_m: f32,
    /// No point of the moving part is farther from its feature, m.
    pub lever_m: f32,
}

impl Fit {
    /// Of a target's pairs, by the exact surfaces of both shapes. About 150 instructions a pair; once a target.
    pub fn of(target: &ConstraintTarget, moving: &Shape<'_>, fixed: &Shape<'_>) -> Self {
        let lever = |shape: &Shape<'_>, feature: &Feature| {
            let center = Vec3::from_array(shape.record.center);
            length(Vec3::from_array(feature.point) - center) + shape.record.radius
        };
        let (own, other) = (lever(moving, &target.moving), lever(fixed, &target.fixed));
        let mut fit = Self {
            pairs: 0,
            gap_m: f32::INFINITY,
            lever_m: own,
        };
        for (i, &(m, s)) in target.faces.iter().enumerate() {
            let faces = (moving.faces.get(usize::from(m)), fixed.faces.get(usize::from(s)));
            let (Some(m), Some(s)) = faces else { continue };
            if !mate(target.kind, m, s) {
                continue;
            }
            let misfit = misfit(m, &target.moving, own) + misfit(s, &target.fixed, other);
            let gap = -(m.sense * m.radius + s.sense * s.radius) - misfit;
            fit.pairs |= 1 << i;
            if gap < fit.gap_m {
                fit.gap_m = gap;
            }
        }
        fit
    }
}

/// Whether these surfaces are kept apart by a target of this kind: one round, the other round about it.
fn mate(kind: ConstraintKind, moving: &FaceRecord, fixed: &FaceRecord) -> bool {
    use surface_kind::{CYLINDER, SPHERE};
    let kinds = (moving.kind, fixed.kind);
    let round = match kind {
        ConstraintKind::Concentric => kinds == (CYLINDER, CYLINDER),
        ConstraintKind::Spherical => kinds == (SPHERE, SPHERE),
        ConstraintKind::Annular => kinds == (SPHERE, CYLINDER),
        ConstraintKind::AnnularBore => kinds == (CYLINDER, SPHERE),
        ConstraintKind::Conical | ConstraintKind::Coplanar => false,
    };
    round && moving.sense * fixed.sense < 0.0
}

/// How far a surface is from where the feature has it, within `lever` of the feature's point, m.
fn misfit(face: &FaceRecord, feature: &Feature, lever: f32) -> f32 {
    let from = Vec3::from_array(face.origin) - Vec3::from_array(feature.point);
    if face.kind == surface_kind::SPHERE {
        return length(from);
    }
    let (axis, direction) = (Vec3::from_array(face.axis), Vec3::from_array(feature.direction));
    length(from.cross(axis)) + length(axis.cross(direction)) * lever
}

impl Walk<'_, '_, '_> {
    /// How far the object may travel before a point of the leaf at `points` could touch anything but what joints keep it from, m; none when that is
    /// not known, or hardly any way, or enough leaves were asked about in this tick.
    pub(crate) fn joined(&mut self, job: &Job<'_>, points: &[PointRecord]) -> Option<f32> {
        let common = mates(job, points)?;
        if !self.may_clear() {
            return None;
        }
        let cell = job.field.record().cell;
        let mut left = MOST_READS;
        let mut only = |[low, high]: [Vec3; 2], reach: f32, mates: &[u16]| {
            let (low, high) = ((low - reach).to_array(), (high + reach).to_array());
            (job.field).only(low, high, &mut left, |face| mates.contains(&face))
        };
        // All of them at once by what bricks say, or else each by the cells about it.
        if !common.is_empty() && only(bounds(job, points)?, FAR_CELLS, &common) {
            self.count_clearing(0, MOST_READS - left, 0);
            return Some(FAR_CELLS * cell);
        }
        let (mut clear, mut looked_up) = (NEXT_CELLS, 0);
        let (mut mates, mut last) = (common, None);
        for point in points {
            if last.replace(own(point)) != Some(own(point)) {
                mates = mates_of(job, point);
            }
            let at = Vec3::from_array(job.in_cells(point));
            if !mates.is_empty() && only([at; 2], NEXT_CELLS, &mates) {
                continue;
            }
            // Not a mating face's, or near another: as far as it is from everything.
            looked_up += 1;
            let far = job.distance(point.position) / cell - EDGE_ERROR_CELLS;
            if far < clear {
                clear = far;
            }
            if clear < LEAST_CLEAR_CELLS {
                break;
            }
        }
        self.count_clearing(points.len() as u32, MOST_READS - left, looked_up);
        (clear >= LEAST_CLEAR_CELLS).then_some(clear * cell)
    }

    /// Whether this tick may still ask what joints keep apart. A leaf not asked about is looked at, which is felt the same, and asked about again
    /// before long.
    fn may_clear(&self) -> bool {
        self.clearing < LOOKUP * self.search.budget / CLEARING_SHARE
    }

    /// The surroundings of a leaf were looked at: so many points by themselves, so much read, and so many points looked up, at two look-ups each.
    fn count_clearing(&mut self, one_by_one: u32, reads: u32, looked_up: u32) {
        let spent = CLEARING + LOOKUP * (one_by_one + 2 * looked_up) + LOOKUP * reads / CLEARING_READS;
        self.clearing += spent;
        self.spent += spent;
    }
}

/// The faces that a point lies on.
fn own(point: &PointRecord) -> [u16; 2] {
    [point.face, point.edge_face]
}

/// Faces of the field's shape that joints keep the point from.
fn mates_of(job: &Job<'_>, point: &PointRecord) -> Vec<u16, MAX_JOINED> {
    (job.joined.iter())
        .filter(|[tree, _]| holds(own(point), *tree))
        .map(|&[_, field]| field)
        .collect()
}

/// Those that joints keep every one of the points from; `None` where they keep none of them from any.
fn mates(job: &Job<'_>, points: &[PointRecord]) -> Option<Vec<u16, MAX_JOINED>> {
    let (mut common, mut any) = (None::<Vec<u16, MAX_JOINED>>, false);
    let mut last = None;
    for point in points {
        // Points that follow each other mostly have the same faces.
        if last.replace(own(point)) == Some(own(point)) {
            continue;
        }
        let mates = mates_of(job, point);
        any |= !mates.is_empty();
        match &mut common {
            Some(common) => common.retain(|face| mates.contains(face)),
            None => common = Some(mates),
        }
    }
    common.filter(|_| any)
}

/// Least and largest of the points' coordinates, in cells of the field.
fn bounds(job: &Job<'_>, points: &[PointRecord]) -> Option<[Vec3; 2]> {
    let mut all = points.iter().map(|point| Vec3::from_array(job.in_cells(point)));
    let first = all.next()?;
    Some(all.fold([first; 2], |[low, high], at| [low.min(at), high.max(at)]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cylinder(sense: f32, radius: f32) -> FaceRecord {
        FaceRecord {
            kind: surface_kind::CYLINDER,
            sense,
            origin: [0.0, 0.0, 0.01],
            axis: [0.0, 0.0, -1.0],
            radius,
            second: 0.0,
        }
    }

    #[test]
    fn only_a_shaft_in_a_bore_mates() {
        let (shaft, bore) = (cylinder(1.0, 0.01), cylinder(-1.0, 0.011));
        assert!(mate(ConstraintKind::Concentric, &shaft, &bore));
        assert!(mate(ConstraintKind::Concentric, &bore, &shaft));
        assert!(!mate(ConstraintKind::Concentric, &shaft, &shaft));
        assert!(!mate(ConstraintKind::Annular, &shaft, &bore));
        let plane = FaceRecord {
            kind: surface_kind::PLANE,
            ..bore
        };
        assert!(!mate(ConstraintKind::Concentric, &shaft, &plane));
    }

    #[test]
    fn misfit_is_how_far_the_surface_is_off() {
        let feature = |point, direction| Feature { point, direction };
        let shaft = cylinder(1.0, 0.01);
        assert_eq!(misfit(&shaft, &feature([0.0; 3], [0.0, 0.0, 1.0]), 0.1), 0.0);
        let aside = misfit(&shaft, &feature([3e-5, 0.0, 0.05], [0.0, 0.0, 1.0]), 0.1);
        assert!((aside - 3e-5).abs() < 1e-9);
        let tilted = misfit(&shaft, &feature([0.0; 3], [1e-3, 0.0, 1.0]), 0.1);
        assert!((tilted - 1e-4).abs() < 1e-6, "{tilted}");
    }
}
