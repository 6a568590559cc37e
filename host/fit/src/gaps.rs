//! Gaps between the faces of two solids at a pose, measured from samples of both on the exact surfaces.

use glam::{DAffine3, DVec3};

use crate::hit::Hit;
use crate::solid::{Sample, Solid};

/// Cosine of the angle between a sample's normal and the opposite of the normal at its foot above which the faces face each other.
const FACING: f64 = 0.85;

/// Two solids, the first movable.
pub(crate) struct Pair<'a> {
    pub moving: &'a Solid,
    pub fixed: &'a Solid,
}

/// Which surface distances are taken from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum By {
    /// The tessellation.
    Facets,
    /// The exact surface.
    Exact,
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
    /// The gap at an item within `reach` mm, where its faces face each other; `None` where they do not, or where the foot is on an edge.
    pub fn gap(&self, pose: &DAffine3, item: &Item, reach: f64, by: By) -> Option<Gap> {
        let Item { of_moving, sample } = *item;
        let (other, to) = if of_moving {
            (self.fixed, *pose)
        } else {
            (self.moving, pose.inverse())
        };
        let (p, n) = (to.transform_point3(sample.p), to.transform_vector3(sample.n));
        // Facets first: most samples face nothing.
        let near = other.facets.hit(p, reach + other.facets.error_mm())?;
        let hit = match by {
            By::Facets => near,
            By::Exact => {
                if near.normal.dot(n) > -0.7 {
                    return None;
                }
                other.hit(p)?
            }
        };
        if hit.distance.abs() > reach
            || n.dot(hit.normal) > -FACING
            || by == By::Exact && !inside_face(other, &hit)
        {
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

    /// Items of both solids whose gap at `pose` is below `reach` mm in size, from every `stride`-th sample.
    pub fn items(&self, pose: &DAffine3, reach: f64, stride: usize, by: By) -> Vec<Item> {
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
            (bound < reach && self.gap(pose, &item, reach, by).is_some()).then_some(item)
        };
        let ours = self.moving.samples.iter().step_by(stride);
        let theirs = self.fixed.samples.iter().step_by(stride);
        (ours.filter_map(|s| near(true, s)))
            .chain(theirs.filter_map(|s| near(false, s)))
            .collect()
    }

    /// Least signed distance of samples and edge points of either solid from the other, mm, or one found below `enough`; every `stride`-th point is
    /// taken. Facets order the points; at most `most` that could be nearest are measured on the exact surfaces.
    pub fn least(&self, pose: &DAffine3, stride: usize, most: usize, enough: f64) -> f64 {
        let back = pose.inverse();
        // Lower bound, whether the point is the moving solid's, and the point in the other's frame.
        let mut near: Vec<(f64, bool, DVec3)> = Vec::new();
        let mut upper = f64::INFINITY;
        for (of_moving, of, other, to) in [
            (true, self.moving, self.fixed, pose),
            (false, self.fixed, self.moving, &back),
        ] {
            let error = other.facets.error_mm();
            let points = (of.samples.iter().step_by(stride).map(|s| s.p))
                .chain(of.edge_points.iter().step_by(stride).copied());
            for p in points {
                let q = to.transform_point3(p);
                let within = upper + 2.0 * error;
                if other.box_distance(q) >= within {
                    continue;
                }
                if let Some(hit) = other.facets.hit(q, within.min(f64::MAX)) {
                    near.push((hit.distance - error, of_moving, q));
                    upper = upper.min(hit.distance.abs() + error);
                }
            }
        }
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut least = f64::INFINITY;
        for (bound, of_moving, q) in near.into_iter().take(most) {
            if bound >= least || least < enough {
                break;
            }
            let other = if of_moving { self.fixed } else { self.moving };
            least = least.min(other.distance(q));
        }
        least
    }
}

/// Whether the foot is inside its face: there the direction to it is the surface's normal. Free-form faces are not checked.
fn inside_face(other: &Solid, hit: &Hit) -> bool {
    let surface = &other.exact.shape().faces[hit.face as usize].surface;
    (surface.distance(hit.foot)).is_none_or(|(_, natural)| natural.dot(hit.normal).abs() > 0.9999)
}
