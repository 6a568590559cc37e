//! Refinement of a pose on the exact surfaces: a uniform gap between the mating faces.
//!
//! Minimises Σ wᵢ·(gᵢ − c)² over the pose and the common gap c, where gᵢ is the exact gap at sample i (point to plane, Chen & Medioni 1992, from both
//! sides) and the weights are areas times Tukey's biweight, whose scale falls with the median deviation. Gauss–Newton steps are solved by the
//! eigenvectors of the normal matrix: motions that no face resists stay as they are. Where c cannot be distinguished from a motion (a cone, a plane
//! alone), it is 0. A plane that resists in a direction to which
//! the others are parallel, and against which none pushes back, is a seat: of several the first touches, and the others take no part.
//!
//! Cost: some 10 steps of some hundred exact distances each.

use glam::{DAffine3, DMat3, DQuat, DVec3};
use mortise_brep::Surface;
use nalgebra::{Matrix6, SMatrix, SVector, SymmetricEigen, Vector6};

use crate::gaps::{By, Gap, Item, Pair};
use crate::solid::Solid;

/// Work of a refinement.
#[derive(Clone, Copy, Debug)]
struct Effort {
    /// Gauss–Newton steps at most.
    steps: usize,
    /// Items at most, of one in so many samples.
    items: usize,
    stride: usize,
    by: By,
    /// Factor by which the deviations that count in full shrink from step to step.
    narrowing: f64,
}

impl Effort {
    /// To the bottom.
    const FULL: Self = Self {
        steps: 16,
        items: 240,
        stride: 1,
        by: By::Exact,
        narrowing: 3.0,
    };
    /// Within the error of the tessellation.
    const ROUGH: Self = Self {
        steps: 12,
        items: 300,
        stride: 2,
        by: By::Facets,
        narrowing: 2.0,
    };
}

/// Items at least.
const LEAST_ITEMS: usize = 12;
/// Share of the largest eigenvalue below which a motion is free.
const FREE: f64 = 1e-6;
/// Share below which the common gap and a motion have the same effect on the gaps.
const SAME_EFFECT: f64 = 1e-6;
/// Scale of deviations at least, mm: a few rounding errors of free-form faces.
const SCALE_MM: f64 = 1e-5;

/// A refined pose.
#[derive(Clone, Debug)]
pub(crate) struct Refined {
    pub pose: DAffine3,
    /// Common gap, mm.
    pub common: f64,
    /// Pairs of faces that are seats.
    pub seats: Vec<[u32; 2]>,
    /// Gaps of the mating faces, within a few deviations of the common gap, or seated.
    pub mating: Vec<Gap>,
    /// Root mean square deviation of those gaps from the common gap, mm.
    pub deviation: f64,
    /// Motions that the mating faces leave free, unit twists (ω·L, v) at `center`.
    pub free: Vec<Vector6<f64>>,
    /// The twist that opens all mating gaps as evenly as one can, if any opens them.
    pub opening: Option<Vector6<f64>>,
    /// Point about which twists are taken, and their length L, mm.
    pub center: DVec3,
    pub length: f64,
}

/// Refines `pose` on the exact surfaces; items are taken within `reach` mm. `None` where too few faces face each other.
pub(crate) fn refine(pair: &Pair<'_>, pose: DAffine3, reach: f64) -> Option<Refined> {
    let rough = Refinement::new(pair, pose, reach, &Effort::ROUGH).run(reach)?;
    let error = facets_error(pair);
    let near = rough.common.abs() + 6.0 * rough.scale + 2.0 * error;
    let mut full = Refinement::new(pair, rough.pose, near.min(reach), &Effort::FULL);
    full.common = rough.common;
    full.run(6.0 * rough.scale + 2.0 * error)?.finish()
}

/// The pose refined on the tessellations alone, within their error.
pub(crate) fn refine_roughly(pair: &Pair<'_>, pose: DAffine3, reach: f64) -> Option<DAffine3> {
    (Refinement::new(pair, pose, reach, &Effort::ROUGH).run(reach)).map(|state| state.pose)
}

fn facets_error(pair: &Pair<'_>) -> f64 {
    pair.moving.facets.error_mm().max(pair.fixed.facets.error_mm())
}

struct Refinement<'a> {
    pair: &'a Pair<'a>,
    pose: DAffine3,
    items: Vec<Item>,
    reach: f64,
    common: f64,
    scale: f64,
    seats: Seats,
    fixed_common: bool,
    effort: Effort,
}

impl<'a> Refinement<'a> {
    fn new(pair: &'a Pair<'a>, pose: DAffine3, reach: f64, effort: &Effort) -> Self {
        Self {
            pair,
            pose,
            items: Vec::new(),
            reach,
            common: 0.0,
            scale: reach,
            seats: Seats::default(),
            fixed_common: false,
            effort: *effort,
        }
    }

    /// Steps until nothing moves; deviations of `widest` mm count in full at first, and a share of that after each step (graduated non-convexity,
    /// Blake & Zisserman 1987): a few faces that agree must not win before the others are heard.
    fn run(mut self, mut widest: f64) -> Option<Self> {
        self.take()?;
        for step in 0..self.effort.steps {
            if step == self.effort.steps / 3 {
                self.take()?;
            }
            let moved = self.step(widest)?;
            widest /= self.effort.narrowing;
            if moved < 1e-8 && widest < self.finest() {
                break;
            }
        }
        Some(self)
    }

    fn take(&mut self) -> Option<()> {
        let all = self
            .pair
            .items(&self.pose, self.reach, self.effort.stride, self.effort.by);
        let stride = all.len().div_ceil(self.effort.items).max(1);
        self.items = all.into_iter().step_by(stride).collect();
        (self.items.len() >= LEAST_ITEMS).then_some(())
    }

    fn gaps(&self) -> Vec<Gap> {
        (self.items.iter())
            .filter_map(|item| self.pair.gap(&self.pose, item, 2.0 * self.reach, self.effort.by))
            .collect()
    }

    /// Smallest scale of deviations, mm: no smaller than the error of the distances.
    fn finest(&self) -> f64 {
        match self.effort.by {
            By::Exact => SCALE_MM,
            By::Facets => SCALE_MM.max(facets_error(self.pair)),
        }
    }

    fn target(&self, gap: &Gap) -> f64 {
        if self.seats.touching.contains(&gap.faces) {
            0.0
        } else {
            self.common
        }
    }

    /// One Gauss–Newton step; the largest displacement of a mating point, mm.
    fn step(&mut self, widest: f64) -> Option<f64> {
        let mut gaps = self.gaps();
        self.seats = Seats::of(self.pair, &gaps, (0.1 * widest).max(2e-3));
        gaps.retain(|gap| !self.seats.idle.contains(&gap.faces));
        if gaps.len() < LEAST_ITEMS {
            return None;
        }
        if !self.fixed_common {
            let loose = gaps.iter().filter(|g| !self.seats.touching.contains(&g.faces));
            self.common = weighted_median(loose.map(|g| (g.gap, g.area))).unwrap_or(0.0);
        }
        let deviations: Vec<(f64, f64)> = (gaps.iter())
            .map(|g| ((g.gap - self.target(g)).abs(), g.area))
            .collect();
        self.scale = (1.5 * weighted_median(deviations.iter().copied())?)
            .max(self.finest())
            .max(widest);
        let frame = Frame::of(&gaps);
        let mut normal = SMatrix::<f64, 7, 7>::zeros();
        let mut right = SVector::<f64, 7>::zeros();
        for gap in &gaps {
            let deviation = gap.gap - self.target(gap);
            let seat = self.seats.touching.contains(&gap.faces);
            let weight = gap.area
                * if seat {
                    1.0
                } else {
                    biweight(deviation / (5.0 * self.scale))
                };
            let row = frame.row(gap);
            let mut full = SVector::<f64, 7>::zeros();
            full.fixed_rows_mut::<6>(0).copy_from(&row);
            full[6] = if seat || self.fixed_common { 0.0 } else { -1.0 };
            normal += weight * full * full.transpose();
            right -= weight * deviation * full;
        }
        let eigen = SymmetricEigen::new(normal);
        let largest = eigen.eigenvalues.max();
        if largest <= 0.0 {
            return None;
        }
        let mut solution = SVector::<f64, 7>::zeros();
        for k in 0..7 {
            let vector = eigen.eigenvectors.column(k);
            let weak = eigen.eigenvalues[k] / largest;
            if !self.fixed_common && weak < SAME_EFFECT && vector[6].abs() > 1e-3 {
                // A motion has the same effect as the common gap: the faces touch.
                self.fixed_common = true;
                self.common = 0.0;
                return self.step(widest);
            }
            if weak < FREE {
                continue;
            }
            solution += vector * (vector.dot(&right) / eigen.eigenvalues[k]);
        }
        let twist = Vector6::from_iterator(solution.iter().take(6).copied());
        self.common += if self.fixed_common { 0.0 } else { solution[6] };
        let moved = gaps
            .iter()
            .map(|g| frame.row(g).dot(&twist).abs())
            .fold(0.0, f64::max);
        self.pose = frame.displaced(&twist) * self.pose;
        Some(moved)
    }

    fn finish(self) -> Option<Refined> {
        let mut mating = Vec::new();
        let wide = (8.0 * self.scale).max(1e-3);
        let within = self.common.abs() + wide;
        for item in self.pair.items(&self.pose, within, 1, By::Exact) {
            if let Some(gap) = self.pair.gap(&self.pose, &item, within, By::Exact)
                && (gap.gap - self.target(&gap)).abs() < wide
                && !self.seats.idle.contains(&gap.faces)
            {
                mating.push(gap);
            }
        }
        if mating.len() < LEAST_ITEMS {
            return None;
        }
        let frame = Frame::of(&mating);
        let (mut area, mut square) = (0.0, 0.0);
        let mut normal = Matrix6::<f64>::zeros();
        let mut opened = Vector6::zeros();
        for gap in &mating {
            let row = frame.row(gap);
            opened += gap.area * row;
            normal += gap.area * row * row.transpose();
            area += gap.area;
            square += gap.area * (gap.gap - self.target(gap)).powi(2);
        }
        let eigen = SymmetricEigen::new(normal);
        let largest = eigen.eigenvalues.max();
        let mut opening = Vector6::zeros();
        for k in (0..6).filter(|&k| eigen.eigenvalues[k] >= FREE * largest) {
            let vector = eigen.eigenvectors.column(k);
            opening += vector * (vector.dot(&opened) / eigen.eigenvalues[k]);
        }
        let least = (mating.iter())
            .map(|gap| frame.row(gap).dot(&opening))
            .fold(f64::INFINITY, f64::min);
        let free = (0..6)
            .filter(|&k| eigen.eigenvalues[k] < FREE * largest)
            .map(|k| eigen.eigenvectors.column(k).into_owned())
            .collect();
        Some(Refined {
            pose: self.pose,
            common: self.common,
            seats: self.seats.touching.clone(),
            deviation: (square / area).sqrt(),
            mating,
            free,
            opening: (least > 0.05).then_some(opening),
            center: frame.center,
            length: frame.length,
        })
    }
}

/// Centre and length of twists.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    pub center: DVec3,
    pub length: f64,
}

impl Frame {
    pub fn of(gaps: &[Gap]) -> Self {
        let center = gaps.iter().map(|g| g.at).sum::<DVec3>() / gaps.len() as f64;
        let square = gaps.iter().map(|g| g.at.distance_squared(center)).sum::<f64>() / gaps.len() as f64;
        Self {
            center,
            length: square.sqrt().max(1e-6),
        }
    }

    /// Rate of a gap with the twist (ω·L, v).
    pub fn row(&self, gap: &Gap) -> Vector6<f64> {
        let turn = (gap.at - self.center).cross(gap.away) / self.length;
        Vector6::new(turn.x, turn.y, turn.z, gap.away.x, gap.away.y, gap.away.z)
    }

    /// The rigid motion of a twist.
    pub fn displaced(&self, twist: &Vector6<f64>) -> DAffine3 {
        let turn = DVec3::new(twist[0], twist[1], twist[2]) / self.length;
        let shift = DVec3::new(twist[3], twist[4], twist[5]);
        let rotation = DMat3::from_quat(DQuat::from_scaled_axis(turn));
        DAffine3::from_mat3_translation(rotation, self.center + shift - rotation * self.center)
    }
}

/// Pairs of plane faces that resist alone along a direction to which the others are parallel: those that touch first, and those that do not touch.
#[derive(Clone, Debug, Default)]
struct Seats {
    touching: Vec<[u32; 2]>,
    idle: Vec<[u32; 2]>,
}

impl Seats {
    /// The seats among `gaps`; gaps within `band` mm of each other touch together.
    fn of(solids: &Pair<'_>, gaps: &[Gap], band: f64) -> Self {
        const PARALLEL: f64 = 0.02;
        // Shares of the area that may be inclined, may push back, and must guide.
        const INCLINED: f64 = 0.15;
        const BACK: f64 = 0.02;
        const GUIDES: f64 = 0.01;
        let mut pairs: Vec<PairSum> = Vec::new();
        for gap in gaps {
            let index = match pairs.iter().position(|pair| pair.faces == gap.faces) {
                Some(index) => index,
                None => {
                    pairs.push(PairSum::new(gap.faces));
                    pairs.len() - 1
                }
            };
            pairs[index].add(gap);
        }
        let total: f64 = gaps.iter().map(|g| g.area).sum();
        let mut flat: Vec<(DVec3, f64, [u32; 2])> = (pairs.iter())
            .filter(|pair| pair.is_plane(solids) && pair.normal.length() > 0.9999 * pair.area)
            .map(|pair| {
                (
                    pair.normal / pair.normal.length(),
                    pair.gap / pair.area,
                    pair.faces,
                )
            })
            .filter(|(u, ..)| {
                let share = |counts: &dyn Fn(f64) -> bool| -> f64 {
                    (pairs.iter())
                        .filter(|pair| counts(pair.normal.dot(*u) / pair.area))
                        .map(|pair| pair.area / total)
                        .sum()
                };
                share(&|along| along < PARALLEL - 1.0) < BACK
                    && share(&|along| along.abs() < 1.0 - PARALLEL && along.abs() > PARALLEL) < INCLINED
                    && share(&|along| along.abs() < PARALLEL) > GUIDES
            })
            .collect();
        flat.sort_by(|a, b| a.1.total_cmp(&b.1));
        let mut out = Self::default();
        for &(u, gap, faces) in &flat {
            let first = (flat.iter())
                .filter(|(v, ..)| v.dot(u) > 1.0 - PARALLEL)
                .map(|(_, gap, _)| *gap)
                .fold(f64::INFINITY, f64::min);
            if gap < first + band {
                out.touching.push(faces);
            } else {
                out.idle.push(faces);
            }
        }
        out
    }
}

/// Sums over the gaps of a pair of faces, weighted by area.
struct PairSum {
    faces: [u32; 2],
    normal: DVec3,
    gap: f64,
    area: f64,
}

impl PairSum {
    fn new(faces: [u32; 2]) -> Self {
        Self {
            faces,
            normal: DVec3::ZERO,
            gap: 0.0,
            area: 0.0,
        }
    }

    fn is_plane(&self, solids: &Pair<'_>) -> bool {
        let plane = |solid: &Solid, face: u32| {
            matches!(
                solid.exact.shape().faces[face as usize].surface,
                Surface::Plane { .. }
            )
        };
        plane(solids.moving, self.faces[0]) && plane(solids.fixed, self.faces[1])
    }

    fn add(&mut self, gap: &Gap) {
        self.normal += gap.area * gap.away;
        self.gap += gap.area * gap.gap;
        self.area += gap.area;
    }
}

fn biweight(x: f64) -> f64 {
    let inside = 1.0 - x * x;
    if inside > 0.0 { inside * inside } else { 0.0 }
}

fn weighted_median(values: impl Iterator<Item = (f64, f64)>) -> Option<f64> {
    let mut values: Vec<(f64, f64)> = values.collect();
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let total: f64 = values.iter().map(|(_, weight)| weight).sum();
    let mut sum = 0.0;
    values.into_iter().find_map(|(value, weight)| {
        sum += weight;
        (sum >= total / 2.0).then_some(value)
    })
}
