//! Gaps between the faces of two solids at a pose, measured from samples of both on the exact surfaces.

use glam::{DAffine3, DVec3};

use crate::solid::{Hit, Sample, Solid};

/// Cosine of the angle between a sample's normal and the opposite of the normal at its foot above which the faces face each other.
const FACING: f64 = 0.85;

/// Two solids, the first movable.
pub(crate) struct Pair<'a> {
    pub moving: &'a Solid,
    pub fixed: &'a Solid,
}

/// A sample of one solid that faces the other: an item of the fit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Item {
    /// Whether the sample is the moving solid's.
    pub of_moving: bool,
    pub sample: Sample,
}

/// Gap at an item. All in the fixed solid's frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gap {
    /// Point of the moving solid.
    pub at: DVec3,
    /// Direction in which the moving solid's point leaves: the gap's gradient.
    pub away: DVec3,
    /// Gap, mm, negative where they overlap.
    pub gap: f64,
    /// Area of the sample, mm².
    pub area: f64,
    /// Faces of the moving and of the fixed solid.
    pub faces: [u32; 2],
    /// Whether the item is the moving solid's sample.
    pub of_moving: bool,
}

impl Pair<'_> {
    /// The gap at an item, where its faces face each other; `None` where they do not, or where the foot is on an edge.
    pub fn gap(&self, pose: &DAffine3, item: &Item) -> Option<Gap> {
        let Item { of_moving, sample } = *item;
        let (other, to) = if of_moving {
            (self.fixed, *pose)
        } else {
            (self.moving, pose.inverse())
        };
        let n = to.transform_vector3(sample.n);
        let hit = other.hit(to.transform_point3(sample.p))?;
        if n.dot(hit.normal) > -FACING || !self.flat_on(other, &hit) {
            return None;
        }
        let (at, away, faces) = if of_moving {
            (to.transform_point3(sample.p), hit.normal, [sample.face, hit.face])
        } else {
            (
                pose.transform_point3(hit.foot),
                -pose.transform_vector3(hit.normal),
                [hit.face, sample.face],
            )
        };
        Some(Gap {
            at,
            away,
            gap: hit.distance,
            area: sample.area,
            faces,
            of_moving,
        })
    }

    /// Whether the foot is inside its face: there the direction to it is the surface's normal. Free-form faces are not checked.
    fn flat_on(&self, other: &Solid, hit: &Hit) -> bool {
        let surface = &other.exact.shape().faces[hit.face as usize].surface;
        surface
            .distance(hit.foot)
            .is_none_or(|(_, natural)| natural.dot(hit.normal).abs() > 0.9999)
    }

    /// Items of both solids whose gap at `pose` is below `reach` mm in size, from every `stride`-th sample.
    pub fn items(&self, pose: &DAffine3, reach: f64, stride: usize) -> Vec<Item> {
        let back = pose.inverse();
        let near = |of_moving: bool, sample: &Sample| {
            let bound = if of_moving {
                self.fixed.box_distance(pose.transform_point3(sample.p))
            } else {
                self.moving.box_distance(back.transform_point3(sample.p))
            };
            let item = Item {
                of_moving,
                sample: *sample,
            };
            (bound < reach && self.gap(pose, &item).is_some_and(|g| g.gap.abs() < reach)).then_some(item)
        };
        let ours = self.moving.samples.iter().step_by(stride).filter_map(|s| near(true, s));
        let theirs = self.fixed.samples.iter().step_by(stride).filter_map(|s| near(false, s));
        ours.chain(theirs).collect()
    }

    /// Least signed distance of any sample or edge point of either solid from the other, mm, or the first found below `enough`; every `stride`-th
    /// sample is taken.
    pub fn least(&self, pose: &DAffine3, stride: usize, enough: f64) -> f64 {
        let back = pose.inverse();
        let mut least = f64::INFINITY;
        for (of, other, to) in [
            (self.moving, self.fixed, pose),
            (self.fixed, self.moving, &back),
        ] {
            let points = (of.samples.iter().step_by(stride).map(|s| s.p))
                .chain(of.edge_points.iter().step_by(stride).copied());
            for p in points {
                let q = to.transform_point3(p);
                if other.box_distance(q) >= least {
                    continue;
                }
                least = least.min(other.distance(q));
                if least < enough {
                    return least;
                }
            }
        }
        least
    }
}
