//! An assembly prepared for questions about contact, freedom and removal.

use std::sync::atomic::AtomicU64;
use std::sync::{Arc, OnceLock};

use glam::{DAffine3, DVec3};
use mortise_brep::CadModel;
use mortise_mating::{Contact, MergedSurface, Tolerances, identify, merge};
use rayon::prelude::*;

use crate::body::Body;
use crate::clearance::{
    Gap, Limits, Placed, WHOLE, each_near, free_share, free_share_by_cores, gap, gap_until, least_over,
    refined,
};
use crate::error::TaskError;
use crate::motion::Motion;
use crate::profile::{Profile, profiles};
use crate::skeleton::{Skeleton, skeleton};
use crate::stated::Stated;
use crate::work::work;

/// Overlap accepted beyond the one that the file's placements already have, mm: twice the default distance of a contact
/// ([`Tolerances::linear_mm`]), so that resting faces slide.
pub const ALLOWED_MM: f64 = 2e-3;
/// Travel between two checks of samples in contact while searching, mm.
pub const SEARCH_STEP_MM: f64 = 0.4;
/// Work of a pair whose boxes show that it does not meet: that of a sweep, which visits the root of either tree.
const FARTHER: u64 = 2;

/// An assembly: its parts as placed in the file, prepared for queries. Lengths mm, poses from part to assembly.
pub struct Assembly {
    /// The file's content.
    pub model: CadModel,
    /// Contacts of the parts as placed in the file.
    pub contacts: Vec<Contact>,
    /// What a catalogue states of its parts.
    pub stated: Stated,
    bodies: Vec<Option<Arc<Body>>>,
    /// Of each shape its inside as a graph, made when first needed.
    skeletons: Vec<OnceLock<Skeleton>>,
    /// Of each shape its profiles, found when first needed.
    profiles: Vec<OnceLock<Vec<Profile>>>,
    merged: Vec<Vec<MergedSurface>>,
    /// Overlap of each pair as placed, mm: allowed of it on every path.
    pressed_mm: Vec<f64>,
}

/// A group of parts that move together, and how far they have moved.
#[derive(Clone, Debug, PartialEq)]
pub struct Moved<'a> {
    /// Parts of the group.
    pub parts: &'a [usize],
    /// Rigid motion of the group from where the file places it.
    pub by: DAffine3,
}

/// Least distance of a group from others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clearance {
    /// Its distance and place; `away` is for the group's part.
    pub gap: Gap,
    /// Part of the group, and the other.
    pub pair: [usize; 2],
}

impl Assembly {
    /// Prepares `model`. Cost: samples of each shape, and the overlap of each pair of parts whose boxes meet.
    ///
    /// # Errors
    /// [`TaskError::OnePart`], [`TaskError::Empty`].
    pub fn new(model: CadModel) -> Result<Self, TaskError> {
        if model.parts.len() < 2 {
            return Err(TaskError::OnePart);
        }
        let tolerances = Tolerances::default();
        let mut used = vec![false; model.shapes.len()];
        for part in &model.parts {
            if let Some(slot) = used.get_mut(part.shape) {
                *slot = true;
            }
        }
        let bodies: Vec<Option<Arc<Body>>> = (model.shapes.par_iter().zip(used).with_max_len(1))
            .map(|(shape, used)| used.then(|| Body::new(shape).map(Arc::new)).flatten())
            .collect();
        for part in &model.parts {
            if !matches!(bodies.get(part.shape), Some(Some(_))) {
                return Err(TaskError::Empty {
                    name: part.name.clone(),
                });
            }
        }
        let contacts = identify(&model, &tolerances);
        let merged = model
            .shapes
            .iter()
            .map(|shape| merge(shape, &tolerances))
            .collect();
        let count = model.parts.len();
        let mut assembly = Self {
            model,
            contacts,
            stated: Stated::default(),
            profiles: bodies.iter().map(|_| OnceLock::new()).collect(),
            skeletons: bodies.iter().map(|_| OnceLock::new()).collect(),
            bodies,
            merged,
            pressed_mm: vec![0.0; count * count],
        };
        let boxes: Vec<(DVec3, DVec3)> = (0..count)
            .map(|part| assembly.bounds(part, DAffine3::IDENTITY))
            .collect();
        let meet = |a: usize, b: usize| {
            let ((al, ah), (bl, bh)) = (boxes[a], boxes[b]);
            (al - bh).max(bl - ah).max_element() <= 0.0
        };
        let pairs = (0..count).flat_map(|a| (a + 1..count).map(move |b| (a, b)));
        let pairs: Vec<(usize, usize)> = pairs.filter(|&(a, b)| meet(a, b)).collect();
        let depths: Vec<f64> = (pairs.par_iter().with_max_len(1))
            .map(|&(a, b)| assembly.pair_gap(a, b, 0.0).map_or(0.0, |gap| -gap.distance_mm))
            .collect();
        for ((a, b), depth) in pairs.into_iter().zip(depths) {
            assembly.pressed_mm[a * count + b] = depth;
            assembly.pressed_mm[b * count + a] = depth;
        }
        Ok(assembly)
    }

    /// Number of parts.
    pub fn count(&self) -> usize {
        self.model.parts.len()
    }

    /// Name of a part.
    pub fn name(&self, part: usize) -> &str {
        self.model.parts.get(part).map_or("", |p| p.name.as_str())
    }

    /// The part of this name: its full name, or the only one that ends with `/name`, regardless of case.
    ///
    /// # Errors
    /// [`TaskError::NoSuchPart`], [`TaskError::Ambiguous`].
    pub fn part(&self, name: &str) -> Result<usize, TaskError> {
        if let Some(exact) = (0..self.count()).find(|&i| self.name(i) == name) {
            return Ok(exact);
        }
        let lower = name.to_lowercase();
        let like: Vec<usize> = (0..self.count())
            .filter(|&i| {
                let full = self.name(i).to_lowercase();
                full == lower || full.ends_with(&format!("/{lower}"))
            })
            .collect();
        match like[..] {
            [one] => Ok(one),
            [] => Err(TaskError::NoSuchPart {
                name: name.to_owned(),
                known: (0..self.count())
                    .map(|i| self.name(i))
                    .collect::<Vec<_>>()
                    .join(", "),
            }),
            _ => Err(TaskError::Ambiguous {
                name: name.to_owned(),
                count: like.len(),
            }),
        }
    }

    /// Some parts with those that they are permanently connected to, and all others.
    pub fn with_joined(&self, group: &[usize]) -> (Vec<usize>, Vec<usize>) {
        let all: Vec<usize> = (0..self.count()).collect();
        let units = self.stated.units(&all).into_iter();
        let is_moved = |unit: &Vec<usize>| unit.iter().any(|part| group.contains(part));
        let (moved, others): (Vec<_>, Vec<_>) = units.partition(is_moved);
        (moved.concat(), others.concat())
    }

    /// The prepared shape of a part.
    ///
    /// # Panics
    /// For a part that is not in the assembly.
    pub fn body(&self, part: usize) -> &Body {
        let shape = self.model.parts[part].shape;
        self.bodies[shape]
            .as_deref()
            .unwrap_or_else(|| unreachable!("checked when the assembly was made"))
    }

    /// The inside of a part's shape as a graph, in its frame.
    pub(crate) fn skeleton(&self, part: usize) -> &Skeleton {
        self.skeletons[self.model.parts[part].shape].get_or_init(|| skeleton(self.body(part)))
    }

    /// Profiles of a part's shape, in its frame.
    pub fn profiles(&self, part: usize) -> &[Profile] {
        self.profiles[self.model.parts[part].shape]
            .get_or_init(|| profiles(self.body(part).surface().shape()))
    }

    /// Merged surfaces of a part's shape, in its frame: the indices of [`Contact::surfaces`].
    pub fn surfaces(&self, part: usize) -> &[MergedSurface] {
        self.model
            .parts
            .get(part)
            .and_then(|p| self.merged.get(p.shape))
            .map_or(&[], Vec::as_slice)
    }

    /// Placement of a part in the file.
    pub fn placement(&self, part: usize) -> DAffine3 {
        self.model
            .parts
            .get(part)
            .map_or(DAffine3::IDENTITY, |p| p.placement)
    }

    /// Places a part elsewhere. [`Self::contacts`] and [`Self::pressed_mm`] stay those of the file.
    pub fn set_placement(&mut self, part: usize, placement: DAffine3) {
        if let Some(part) = self.model.parts.get_mut(part) {
            part.placement = placement;
        }
    }

    /// Overlap of two parts as placed in the file, mm; 0 where they do not overlap.
    pub fn pressed_mm(&self, a: usize, b: usize) -> f64 {
        self.pressed_mm.get(a * self.count() + b).copied().unwrap_or(0.0)
    }

    /// Depth of overlap that is accepted of two parts on a path, mm.
    pub fn allowed_mm(&self, a: usize, b: usize) -> f64 {
        let stated = [a, b].map(|p| self.body(p).surface().surface_error_mm());
        self.pressed_mm(a, b) + ALLOWED_MM + stated[0] + stated[1]
    }

    /// A part moved by `by` from its placement.
    pub fn placed(&self, part: usize, by: DAffine3) -> Placed<'_> {
        Placed {
            body: self.body(part),
            pose: by * self.placement(part),
        }
    }

    /// Box of a part moved by `by`: low and high corner in the assembly's frame.
    pub fn bounds(&self, part: usize, by: DAffine3) -> (DVec3, DVec3) {
        let (low, high) = self.body(part).bounds();
        let pose = by * self.placement(part);
        let half = (high - low) / 2.0;
        let m = pose.matrix3;
        let reach = m.x_axis.abs() * half.x + m.y_axis.abs() * half.y + m.z_axis.abs() * half.z;
        let center = pose.transform_point3((low + high) / 2.0);
        (center - reach, center + reach)
    }

    /// Box of several parts in place.
    pub fn bounds_of(&self, parts: &[usize], by: DAffine3) -> (DVec3, DVec3) {
        parts
            .iter()
            .map(|&p| self.bounds(p, by))
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), (l, h)| {
                (low.min(l), high.max(h))
            })
    }

    /// A box in which several parts moved by `by` stay on a motion.
    pub(crate) fn swept(&self, parts: &[usize], by: DAffine3, motion: &Motion) -> (DVec3, DVec3) {
        let (low, high) = self.bounds_of(parts, by);
        if motion.angle == 0.0 {
            return (low.min(low + motion.slide), high.max(high + motion.slide));
        }
        let reach = motion.speed(motion.arm((low + high) / 2.0) + low.distance(high) / 2.0);
        (low - reach, high + reach)
    }

    /// Whether the boxes of two parts as placed are at most `mm` apart.
    pub fn boxes_are_near(&self, a: usize, b: usize, mm: f64) -> bool {
        let [(al, ah), (bl, bh)] = [a, b].map(|part| self.bounds(part, DAffine3::IDENTITY));
        (al - bh).max(bl - ah).max_element() <= mm
    }

    /// Whether two parts as placed are less than `mm` apart. Cost: ends with the first sample that is.
    pub fn are_within(&self, a: usize, b: usize, mm: f64) -> bool {
        let [p, q] = [a, b].map(|part| self.placed(part, DAffine3::IDENTITY));
        self.boxes_are_near(a, b, mm) && gap_until(p, q, mm, mm).is_some()
    }

    /// Least distance of two parts as placed where it is below `within`.
    pub fn pair_gap(&self, a: usize, b: usize, within: f64) -> Option<Gap> {
        if !self.boxes_are_near(a, b, within) {
            return None;
        }
        gap(
            self.placed(a, DAffine3::IDENTITY),
            self.placed(b, DAffine3::IDENTITY),
            within,
        )
    }

    /// Least distance of a moved group from `others` (at their placements) where it is below `within` mm, by samples; `exact` adds the descent between
    /// samples.
    pub fn clearance(
        &self,
        group: &Moved<'_>,
        others: &[usize],
        within: f64,
        exact: bool,
    ) -> Option<Clearance> {
        let mut best = within;
        let mut found = None;
        for (a, b) in self.pairs(group, others, within) {
            let (pa, pb) = (self.placed(a, group.by), self.placed(b, DAffine3::IDENTITY));
            let gap = if exact {
                refined(pa, pb, best)
            } else {
                gap(pa, pb, best)
            };
            if let Some(gap) = gap.filter(|gap| gap.distance_mm < best) {
                best = gap.distance_mm;
                found = Some(Clearance { gap, pair: [a, b] });
            }
        }
        found
    }

    /// Whether a moved group overlaps none of `others` by more than is allowed of the pair.
    pub fn clear(&self, group: &Moved<'_>, others: &[usize]) -> bool {
        self.excess(group, others, 0.0).is_none()
    }

    /// The first pair found of a moved group and `others` that overlaps by more than is allowed of it.
    pub fn blocker(&self, group: &Moved<'_>, others: &[usize]) -> Option<Clearance> {
        self.pairs(group, others, 0.0).find_map(|(a, b)| {
            let gap = gap(
                self.placed(a, group.by),
                self.placed(b, DAffine3::IDENTITY),
                -self.allowed_mm(a, b),
            )?;
            Some(Clearance { gap, pair: [a, b] })
        })
    }

    /// Depth by which a moved group overlaps one of `others` beyond what is allowed of the pair, mm, and the pair; `None` when it is clear. The deepest pair,
    /// or the first found that is at least `enough` deep.
    pub fn excess(&self, group: &Moved<'_>, others: &[usize], enough: f64) -> Option<(f64, [usize; 2])> {
        let mut found: Option<(f64, [usize; 2])> = None;
        for (a, b) in self.pairs(group, others, 0.0) {
            let allowed = self.allowed_mm(a, b);
            let most = found.map_or(0.0, |(depth, _)| depth);
            let within = -allowed - most;
            let Some(gap) = gap_until(
                self.placed(a, group.by),
                self.placed(b, DAffine3::IDENTITY),
                within,
                -allowed - enough,
            ) else {
                continue;
            };
            let depth = -gap - allowed;
            found = Some((depth, [a, b]));
            if depth >= enough {
                break;
            }
        }
        found
    }

    /// Some samples of a moved group and `others` within `within` mm beyond what is allowed of the pair; their distances count from there.
    pub(crate) fn near(&self, group: &Moved<'_>, others: &[usize], within: f64, found: &mut Vec<Gap>) {
        for (a, b) in self.pairs(group, others, within) {
            let allowed = self.allowed_mm(a, b);
            let (pa, pb) = (self.placed(a, group.by), self.placed(b, DAffine3::IDENTITY));
            each_near(pa, pb, within - allowed, true, &mut |gap| {
                found.push(Gap {
                    distance_mm: gap.distance_mm + allowed,
                    ..gap
                });
            });
        }
    }

    /// Pairs of a moved group and `others` whose boxes are within `within`.
    pub(crate) fn pairs<'a>(
        &'a self,
        group: &Moved<'a>,
        others: &'a [usize],
        within: f64,
    ) -> impl Iterator<Item = (usize, usize)> + 'a {
        let by = group.by;
        group.parts.iter().flat_map(move |&a| {
            let (al, ah) = self.bounds(a, by);
            others.iter().filter_map(move |&b| {
                let (bl, bh) = self.bounds(b, DAffine3::IDENTITY);
                ((al - bh).max(bl - ah).max_element() <= within).then_some((a, b))
            })
        })
    }

    /// Share of a motion, 0 to 1, that a moved group makes before it meets one of `others`, and the pair that meets.
    pub fn free_share(
        &self,
        group: &Moved<'_>,
        others: &[usize],
        motion: &Motion,
        step_mm: f64,
    ) -> (f64, Option<[usize; 2]>) {
        self.free_share_beyond(group, others, motion, step_mm, 0.0, false)
    }

    /// As [`Self::free_share`], by all cores, with all pairs over the same stretches. Of several pairs that meet at the same share, the first is stated.
    pub fn free_share_by_cores(
        &self,
        group: &Moved<'_>,
        others: &[usize],
        motion: &Motion,
        step_mm: f64,
    ) -> (f64, Option<[usize; 2]>) {
        let mut pairs: Vec<[usize; 2]> = Vec::new();
        for &a in group.parts {
            let (al, ah) = self.swept(&[a], group.by, motion);
            pairs.extend(others.iter().map(|&b| [a, b]).filter(|&[_, b]| {
                let (bl, bh) = self.bounds(b, DAffine3::IDENTITY);
                (al - bh).max(bl - ah).max_element() <= 0.0
            }));
        }
        let earliest = AtomicU64::new(WHOLE);
        let share = |&[a, b]: &[usize; 2]| {
            let limits = Limits {
                allow_mm: self.allowed_mm(a, b),
                step_mm,
                coarse: false,
            };
            let (a, b) = (self.placed(a, group.by), self.placed(b, DAffine3::IDENTITY));
            free_share_by_cores(a, b, motion, &limits, &earliest)
        };
        let shares: Vec<f64> = pairs.par_iter().with_max_len(1).map(share).collect();
        let first = shares.iter().zip(&pairs).min_by(|(s, _), (t, _)| s.total_cmp(t));
        match first {
            Some((&share, &pair)) if share < 1.0 => (share, Some(pair)),
            _ => (1.0, None),
        }
    }

    /// As [`Self::free_share`], up to where the distance falls below `margin` mm beyond what is allowed; `coarse`: by few samples.
    pub(crate) fn free_share_beyond(
        &self,
        group: &Moved<'_>,
        others: &[usize],
        motion: &Motion,
        step_mm: f64,
        margin: f64,
        coarse: bool,
    ) -> (f64, Option<[usize; 2]>) {
        let mut motion = *motion;
        let mut share = 1.0;
        let mut pair = None;
        for &a in group.parts {
            let (al, ah) = self.swept(&[a], group.by, &motion);
            for &b in others {
                let allow_mm = self.allowed_mm(a, b) - margin;
                let (bl, bh) = self.bounds(b, DAffine3::IDENTITY);
                if (al - bh).max(bl - ah).max_element() > (-allow_mm).max(0.0) {
                    work(FARTHER);
                    continue;
                }
                let limits = Limits {
                    allow_mm,
                    step_mm,
                    coarse,
                };
                let free = free_share(
                    self.placed(a, group.by),
                    self.placed(b, DAffine3::IDENTITY),
                    &motion,
                    &limits,
                );
                if free < 1.0 {
                    share *= free;
                    motion = motion.until(free);
                    pair = Some([a, b]);
                    if share <= 0.0 {
                        return (0.0, pair);
                    }
                }
            }
        }
        (share, pair)
    }

    /// As [`Self::free_share`] with the place where the motion ends found to within a micrometre of travel: the group is clear there.
    pub fn touch_share(
        &self,
        group: &Moved<'_>,
        others: &[usize],
        motion: &Motion,
        step_mm: f64,
    ) -> (f64, Option<[usize; 2]>) {
        let coarse = self.free_share(group, others, motion, step_mm);
        self.touch_near(group, others, motion, step_mm, coarse)
    }

    /// As [`Self::touch_share`], by all cores.
    pub fn touch_share_by_cores(
        &self,
        group: &Moved<'_>,
        others: &[usize],
        motion: &Motion,
        step_mm: f64,
    ) -> (f64, Option<[usize; 2]>) {
        let coarse = self.free_share_by_cores(group, others, motion, step_mm);
        self.touch_near(group, others, motion, step_mm, coarse)
    }

    fn touch_near(
        &self,
        group: &Moved<'_>,
        others: &[usize],
        motion: &Motion,
        step_mm: f64,
        (share, pair): (f64, Option<[usize; 2]>),
    ) -> (f64, Option<[usize; 2]>) {
        let Some(pair) = pair else {
            return (share, None);
        };
        let (low, high) = self.bounds_of(group.parts, group.by);
        let length = motion
            .speed(motion.arm((low + high) / 2.0) + low.distance(high) / 2.0)
            .max(1e-9);
        let clear = |t: f64| {
            self.clear(
                &Moved {
                    parts: group.parts,
                    by: motion.at(t) * group.by,
                },
                others,
            )
        };
        let back = step_mm / length;
        let (mut free, mut met) = (share, (share + back).min(1.0));
        while free > 0.0 && !clear(free) {
            met = free;
            free = (free - back).max(0.0);
        }
        while (met - free) * length > 1e-3 {
            let middle = (free + met) / 2.0;
            if clear(middle) {
                free = middle
            } else {
                met = middle
            }
        }
        (free, Some(pair))
    }

    /// Least distance of a group over a motion from `others` where it is below `within`: share of the motion, and the distance.
    pub fn least_over(
        &self,
        group: &Moved<'_>,
        others: &[usize],
        motion: &Motion,
        step_mm: f64,
        within: f64,
    ) -> Option<(f64, Clearance)> {
        let mut best = within;
        let mut found = None;
        for &a in group.parts {
            for &b in others {
                let least = least_over(
                    self.placed(a, group.by),
                    self.placed(b, DAffine3::IDENTITY),
                    motion,
                    step_mm,
                    best,
                );
                if let Some((t, gap)) = least.filter(|(_, gap)| gap.distance_mm < best) {
                    best = gap.distance_mm;
                    found = Some((t, Clearance { gap, pair: [a, b] }));
                }
            }
        }
        found
    }
}
