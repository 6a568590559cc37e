//! The search: candidates, refinement, what is kept, and in which order.

use std::f64::consts::{PI, TAU};

use glam::{DAffine3, DQuat, DVec3};
use mortise_brep::CadModel;
use nalgebra::Vector6;
use rayon::prelude::*;

use crate::error::FitError;
use crate::frames;
use crate::gaps::{Gap, Pair};
use crate::mobility::Cone;
use crate::path::{Path, PathKind, way_in};
use crate::refine::{Frame, Refined, refine, refine_roughly};
use crate::rotations::rotations;
use crate::screen::Screen;
use crate::solid::Solid;
use crate::translations::{Candidate, translations};

/// Samples of a solid, about.
const SAMPLES: usize = 1500;
/// Candidates refined: of walls, and of free-form faces roughly and then fully.
const MOST_OF_WALLS: usize = 72;
const MOST_OF_FRAMES: [usize; 2] = [96, 20];
/// Smallest rating by samples for which a candidate is refined.
const LEAST_RATE: f64 = 0.01;
/// Share of all directions that may be free in a fit: less than a corner leaves.
const MOST_FREE: f64 = 0.1;
/// Share of the best score below which a fit is not reported.
const LEAST_SCORE: f64 = 0.35;

/// Weight of a seat's area in the score.
const SEAT: f64 = 0.3;
/// Fits from which symmetries are taken, and rounds of that.
const MOST_ALIKE: usize = 7;
const SYMMETRY_ROUNDS: usize = 2;

/// Motion along the normals of the mating faces below which two fits are one, mm, beside a tenth of their clearance.
const SAME_MM: f64 = 5e-3;

/// What is a fit, and how much is returned.
#[derive(Clone, Copy, Debug)]
pub struct FitOptions {
    /// Overlap that is tolerated, mm: rounding and recognised surfaces. Default: 1 µm.
    pub overlap_mm: f64,
    /// Fits returned at most. Default: 64.
    pub most: usize,
    /// Fits whose way in is searched, the best first. Default: 16.
    pub most_paths: usize,
    /// Whether poses of the assembly alone are tried: its own, and those of equal parts. Tens of milliseconds instead of seconds. Default: no.
    pub only_placed: bool,
}

impl Default for FitOptions {
    fn default() -> Self {
        Self {
            overlap_mm: 1e-3,
            most: 64,
            most_paths: 16,
            only_placed: false,
        }
    }
}

/// Gaps over the samples of the mating faces, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clearance {
    /// Smallest distance of any sample or edge point of either part from the other, negative where they overlap.
    pub min_mm: f64,
    /// Median over the mating area.
    pub median_mm: f64,
    /// Largest over the mating area.
    pub max_mm: f64,
}

/// A pose at which the parts fit.
#[derive(Clone, Debug)]
pub struct Fit {
    /// Placement of the moving part in the assembly's frame; the other part stays where the file has it.
    pub placement: DAffine3,
    /// Rank: mating area as a share of the smaller surface, less for seats, for loose fits and for motions that stay free.
    pub score: f64,
    /// Area of the mating faces, mm²: the larger of both parts' samples.
    pub area_mm2: f64,
    /// Gaps.
    pub clearance: Clearance,
    /// Root mean square deviation of the mating gaps from their common value (0 at seats), mm.
    pub residual_mm: f64,
    /// Rigid motions that the mating faces leave free: 0 to 6.
    pub freedom: usize,
    /// Pairs of mating faces: of the moving part and of the other.
    pub faces: Vec<[u32; 2]>,
    /// The way in; `None` where none was found, or none was searched.
    pub path: Option<Path>,
}

/// Result of a search.
#[derive(Clone, Debug, Default)]
pub struct Fits {
    /// Fits, the best first.
    pub fits: Vec<Fit>,
    /// Poses rated by samples, and refined.
    pub rated: usize,
    /// Poses refined.
    pub refined: usize,
}

/// Finds the poses at which part `moving` fits part `against` of `model` (indices into [`CadModel::parts`]).
///
/// Cost: 0.3 to 3 s on two cores for parts of tens of faces; free-form faces take longest.
///
/// # Errors
/// [`FitError::NoSuchPart`], [`FitError::SamePart`], and [`FitError::Open`] where a part has no closed mesh.
pub fn find(model: &CadModel, moving: usize, against: usize, options: &FitOptions) -> Result<Fits, FitError> {
    let part = |index: usize| {
        model.parts.get(index).ok_or_else(|| FitError::NoSuchPart {
            part: index.to_string(),
            known: format!("{} parts", model.parts.len()),
        })
    };
    let (a, b) = (part(moving)?, part(against)?);
    if moving == against {
        return Err(FitError::SamePart { part: a.name.clone() });
    }
    for part in [a, b] {
        if !model.shapes.get(part.shape).is_some_and(|shape| shape.closed) {
            return Err(FitError::Open {
                part: part.name.clone(),
            });
        }
    }
    let (first, second) = rayon::join(
        || Solid::new(&model.shapes[a.shape], SAMPLES),
        || Solid::new(&model.shapes[b.shape], SAMPLES),
    );
    let pair = Pair {
        moving: &first,
        fixed: &second,
    };
    let search = Search {
        pair: &pair,
        window: (0.006 * first.size().min(second.size())).clamp(0.1, 0.6),
        options,
    };
    let placed = placed(model, moving, against);
    let mut out = search.run(&placed, b.placement.inverse() * a.placement);
    for fit in &mut out.fits {
        fit.placement = b.placement * fit.placement;
        if let Some(path) = &mut fit.path {
            let turn = b.placement.matrix3;
            path.direction = turn * path.direction;
            path.corners_mm
                .iter_mut()
                .for_each(|corner| *corner = turn * *corner);
            let screw = path.screw.iter_mut().map(|(point, _)| point);
            for point in screw.chain(&mut path.spin) {
                *point = b.placement.transform_point3(*point);
            }
        }
    }
    Ok(out)
}

/// Index of the part of `model` with this name.
///
/// # Errors
/// [`FitError::NoSuchPart`].
pub fn part_named(model: &CadModel, name: &str) -> Result<usize, FitError> {
    (model.parts.iter().position(|part| part.name == name)).ok_or_else(|| {
        let names: Vec<&str> = model.parts.iter().map(|part| part.name.as_str()).collect();
        FitError::NoSuchPart {
            part: name.to_owned(),
            known: names.join(", "),
        }
    })
}

/// Poses that the assembly itself gives: its own, and those of parts with the same shapes.
fn placed(model: &CadModel, moving: usize, against: usize) -> Vec<DAffine3> {
    let shapes = [moving, against].map(|part| model.parts[part].shape);
    let of = |shape: usize| model.parts.iter().filter(move |part| part.shape == shape);
    let mut out: Vec<DAffine3> = Vec::new();
    for b in of(shapes[1]) {
        for a in of(shapes[0]) {
            let pose = b.placement.inverse() * a.placement;
            if out.len() < 64 && out.iter().all(|known| !known.abs_diff_eq(pose, 1e-6)) {
                out.push(pose);
            }
        }
    }
    out
}

struct Search<'a> {
    pair: &'a Pair<'a>,
    /// Accuracy of candidates, mm.
    window: f64,
    options: &'a FitOptions,
}

/// A refined pose that was found to be a fit.
struct Found {
    refined: Refined,
    score: f64,
    area: f64,
    clearance: Clearance,
}

impl Search<'_> {
    fn run(&self, placed: &[DAffine3], current: DAffine3) -> Fits {
        if self.options.only_placed {
            let found = (placed.par_iter()).filter_map(|&pose| self.fit(pose, 1.5 * self.window));
            let kept = self.best(found.collect());
            return Fits {
                fits: self.reports(&kept),
                rated: placed.len(),
                refined: placed.len(),
            };
        }
        let screen = Screen::new(self.pair);
        let walls = self.of_walls(&screen, placed, current);
        let mut rated = walls.0;
        let mut jobs: Vec<(DAffine3, f64)> = walls.1;
        let free_form = self.of_frames(&screen);
        rated += free_form.0;
        jobs.extend(free_form.1);
        let refined = jobs.len();
        let mut kept = self.best(
            (jobs.par_iter())
                .filter_map(|&(pose, reach)| self.fit(pose, reach))
                .collect(),
        );
        for _ in 0..SYMMETRY_ROUNDS {
            let more = self.symmetric(&screen, &kept);
            if more.is_empty() {
                break;
            }
            let before = kept.len();
            kept.extend(
                (more.into_par_iter())
                    .filter_map(|pose| self.fit(pose, self.window))
                    .collect::<Vec<_>>(),
            );
            kept = self.best(kept);
            if kept.len() == before {
                break;
            }
        }
        let fits = self.reports(&kept);
        Fits { fits, rated, refined }
    }

    /// The distinct ones, the best first.
    fn best(&self, mut found: Vec<Found>) -> Vec<Found> {
        found.sort_by(|a, b| b.score.total_cmp(&a.score));
        let best = found.first().map_or(0.0, |found| found.score);
        let mut kept: Vec<Found> = Vec::new();
        for candidate in found {
            if kept.len() < self.options.most
                && candidate.score > LEAST_SCORE * best
                && kept.iter().all(|known| !same(known, &candidate))
            {
                kept.push(candidate);
            }
        }
        kept
    }

    /// Poses that follow from the symmetry of what was found: where Pᵢ and Pⱼ fit alike, Pᵢ⁻¹Pⱼ may be a symmetry of the moving part, so that PₖPᵢ⁻¹Pⱼ
    /// fits too.
    fn symmetric(&self, screen: &Screen, kept: &[Found]) -> Vec<DAffine3> {
        let best = kept.first().map_or(0.0, |found| found.score);
        let alike: Vec<&Found> = (kept.iter())
            .filter(|found| found.score > 0.9 * best)
            .take(MOST_ALIKE)
            .collect();
        let mut out: Vec<DAffine3> = Vec::new();
        for p in &alike {
            for q in &alike {
                let symmetry = p.refined.pose.inverse() * q.refined.pose;
                for r in &alike {
                    let pose = r.refined.pose * symmetry;
                    let known = kept
                        .iter()
                        .any(|found| follows(pose, &found.refined, self.window / 4.0))
                        || out
                            .iter()
                            .any(|other| self.travel(other, &pose) < self.window / 4.0);
                    let fits = |pose: &DAffine3| {
                        let (gap, window) = (r.refined.common.abs(), self.window);
                        screen.rate(self.pair, pose, gap, window) > LEAST_RATE
                    };
                    if !known && out.len() < MOST_ALIKE * MOST_ALIKE && fits(&pose) {
                        out.push(pose);
                    }
                }
            }
        }
        out
    }

    /// What is returned. The ways in are searched for the best alone, each with the directions that led to the others.
    fn reports(&self, kept: &[Found]) -> Vec<Fit> {
        let mut ways: Vec<DVec3> = Vec::new();
        (kept.iter().enumerate())
            .map(|(rank, found)| {
                let mut fit = report(found);
                if rank < self.options.most_paths {
                    let (min, overlap) = (found.clearance.min_mm, self.overlap_mm());
                    fit.path = way_in(self.pair, &found.refined, min, overlap, &ways);
                }
                if let Some(path) = &fit.path
                    && path.kind == PathKind::Line
                    && ways.iter().all(|way| way.distance(-path.direction) > 1e-3)
                {
                    ways.push(-path.direction);
                }
                fit
            })
            .collect()
    }

    /// Candidates of walls and of the assembly, with the reach of their refinement.
    fn of_walls(
        &self,
        screen: &Screen,
        placed: &[DAffine3],
        current: DAffine3,
    ) -> (usize, Vec<(DAffine3, f64)>) {
        let rotations = rotations(self.pair.moving, self.pair.fixed, current.matrix3);
        let mut candidates: Vec<Candidate> = (rotations.par_iter())
            .flat_map_iter(|&rotation| translations(self.pair.moving, self.pair.fixed, rotation, self.window))
            .collect();
        candidates.extend(placed.iter().map(|&pose| Candidate {
            pose,
            gap: 0.0,
            rating: f64::INFINITY,
        }));
        candidates.sort_by(|a, b| b.rating.total_cmp(&a.rating));
        let rated = self.rate(screen, &candidates, self.window, MOST_OF_WALLS);
        let reach = |candidate: &Candidate| candidate.gap + 1.5 * self.window;
        (
            candidates.len(),
            rated.into_iter().map(|c| (c.pose, reach(&c))).collect(),
        )
    }

    /// Candidates of free-form faces, refined roughly.
    fn of_frames(&self, screen: &Screen) -> (usize, Vec<(DAffine3, f64)>) {
        let candidates = frames::poses(self.pair.moving, self.pair.fixed);
        let window = 3.5 * self.window;
        let best = self.rate(screen, &candidates, window, MOST_OF_FRAMES[0]);
        let rough: Vec<Candidate> = (best.par_iter())
            .filter_map(|candidate| {
                let pose = refine_roughly(self.pair, candidate.pose, 2.0 * window)?;
                Some(Candidate { pose, ..*candidate })
            })
            .collect();
        let best = self.rate(screen, &rough, self.window, MOST_OF_FRAMES[1]);
        (
            candidates.len(),
            best.into_iter().map(|c| (c.pose, self.window)).collect(),
        )
    }

    /// The best `most` of the candidates by samples; of those near each other only the best.
    fn rate(&self, screen: &Screen, candidates: &[Candidate], window: f64, most: usize) -> Vec<Candidate> {
        let mut rated: Vec<(f64, Candidate)> = (candidates.par_iter())
            .map(|c| (screen.rate(self.pair, &c.pose, c.gap, window), *c))
            .filter(|(rate, _)| *rate > LEAST_RATE)
            .collect();
        rated.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut kept: Vec<Candidate> = Vec::new();
        for (_, candidate) in rated {
            if kept.len() == most {
                break;
            }
            let near = |known: &Candidate| self.travel(&known.pose, &candidate.pose) < window;
            if !kept.iter().any(near) {
                kept.push(candidate);
            }
        }
        kept
    }

    /// Largest travel of a corner of the moving solid's box between two poses, mm.
    fn travel(&self, a: &DAffine3, b: &DAffine3) -> f64 {
        let (low, high) = (self.pair.moving.low, self.pair.moving.high);
        (0..8)
            .map(|k| {
                let p = DVec3::select(glam::BVec3::new(k & 1 > 0, k & 2 > 0, k & 4 > 0), high, low);
                a.transform_point3(p).distance(b.transform_point3(p))
            })
            .fold(0.0, f64::max)
    }

    /// Overlap that is tolerated, mm: as asked, and the error of distances.
    fn overlap_mm(&self) -> f64 {
        let error = |solid: &Solid| solid.exact.surface_error_mm();
        self.options.overlap_mm + error(self.pair.moving) + error(self.pair.fixed)
    }

    /// Refines a pose and decides whether it is a fit.
    fn fit(&self, pose: DAffine3, reach: f64) -> Option<Found> {
        let refined = refine(self.pair, pose, reach)?;
        let refined = self.centred(refined);
        let enough = -self.overlap_mm();
        let min = self.pair.least(&refined.pose, 3, 100, enough);
        if min < enough || Cone::new(&refined.mating).share() > MOST_FREE {
            return None;
        }
        let min = min.min(self.pair.least(&refined.pose, 1, 2000, enough));
        if min < enough {
            return None;
        }
        let area = area(&refined.mating);
        let seated: Vec<Gap> = (refined.mating.iter())
            .filter(|g| refined.seats.contains(&g.faces))
            .copied()
            .collect();
        // Plane lies on plane anywhere: a seat says less of a fit than what holds from both sides.
        let telling = area - (1.0 - SEAT) * self::area(&seated);
        let mut gaps: Vec<f64> = refined.mating.iter().map(|g| g.gap).collect();
        gaps.sort_by(f64::total_cmp);
        let (Some(&median), Some(&max)) = (gaps.get(gaps.len() / 2), gaps.last()) else {
            return None;
        };
        let smaller = self.pair.moving.area.min(self.pair.fixed.area);
        let loose = median.max(0.0) / (0.02 * self.pair.moving.size().min(self.pair.fixed.size()));
        // Gaps that differ among themselves: a chance contact.
        let uneven = refined.deviation / (0.2 * refined.common.abs() + 3e-3);
        let held = 1.0 - refined.free.len() as f64 / 6.0;
        Some(Found {
            score: telling / smaller * held / (1.0 + loose) / (1.0 + uneven * uneven),
            area,
            clearance: Clearance {
                min_mm: min,
                median_mm: median,
                max_mm: max,
            },
            refined,
        })
    }

    /// A part that can slide both ways is put to the middle of the faces along which it slides, when the mating area grows or stays.
    fn centred(&self, refined: Refined) -> Refined {
        let cone = Cone::new(&refined.mating);
        let slide = (refined.free.iter())
            .map(|twist| DVec3::new(twist[3], twist[4], twist[5]))
            .filter_map(DVec3::try_normalize)
            .find(|&d| cone.holds(d) && cone.holds(-d));
        let Some(u) = slide else {
            return refined;
        };
        let extent = |solid: &Solid, side: usize, to: &DAffine3| {
            let mut out = [f64::INFINITY, f64::NEG_INFINITY];
            for sample in &solid.samples {
                if refined.mating.iter().any(|g| g.faces[side] == sample.face) {
                    let along = to.transform_point3(sample.p).dot(u);
                    out = [out[0].min(along), out[1].max(along)];
                }
            }
            out
        };
        let ours = extent(self.pair.moving, 0, &refined.pose);
        let theirs = extent(self.pair.fixed, 1, &DAffine3::IDENTITY);
        let by = (theirs[0] + theirs[1] - ours[0] - ours[1]) / 2.0;
        let pose = DAffine3::from_translation(by * u) * refined.pose;
        match refine(self.pair, pose, refined.common.abs() + 0.2 * self.window) {
            Some(there) if area(&there.mating) > 0.98 * area(&refined.mating) => there,
            _ => refined,
        }
    }
}

fn report(found: &Found) -> Fit {
    let refined = &found.refined;
    let mut faces: Vec<[u32; 2]> = refined.mating.iter().map(|g| g.faces).collect();
    faces.sort_unstable();
    faces.dedup();
    Fit {
        placement: refined.pose,
        score: found.score,
        area_mm2: found.area,
        clearance: found.clearance,
        residual_mm: refined.deviation,
        freedom: refined.free.len(),
        faces,
        path: None,
    }
}

/// Mating area, mm²: the larger of what the samples of either solid stand for.
fn area(mating: &[Gap]) -> f64 {
    let of = |moving: bool| -> f64 {
        (mating.iter())
            .filter(|g| g.of_moving == moving)
            .map(|g| g.area)
            .sum()
    };
    of(true).max(of(false))
}

/// Whether the worse of two fits is the better one moved along what its faces leave free.
fn same(better: &Found, worse: &Found) -> bool {
    let near = SAME_MM + 0.1 * worse.refined.common.abs();
    follows(better.refined.pose, &worse.refined, near)
}

/// Whether `pose` is a refined pose moved along what its faces leave free: the root mean square motion along their normals is below `near` mm.
fn follows(pose: DAffine3, refined: &Refined, near: f64) -> bool {
    let step = pose * refined.pose.inverse();
    // The motion between them as a twist about the refined one's centre.
    let (axis, angle) = DQuat::from_mat3(&step.matrix3).normalize().to_axis_angle();
    let angle = if angle > PI { angle - TAU } else { angle };
    let turn = angle * axis;
    let shift = shift_of(step.transform_point3(refined.center) - refined.center, turn);
    let [u, v] = [turn * refined.length, shift];
    let twist = Vector6::new(u.x, u.y, u.z, v.x, v.y, v.z);
    let frame = Frame {
        center: refined.center,
        length: refined.length,
    };
    let square = (refined.mating.iter()).map(|gap| frame.row(gap).dot(&twist).powi(2));
    (square.sum::<f64>() / refined.mating.len() as f64).sqrt() < near
}

/// Linear part of the twist whose exponential moves the centre by `moved` while it turns by `turn`: V(turn)⁻¹·moved (Murray, Li & Sastry 1994, A.12).
fn shift_of(moved: DVec3, turn: DVec3) -> DVec3 {
    let angle = turn.length();
    if angle < 1e-9 {
        return moved;
    }
    let half = angle / 2.0;
    let factor = (1.0 - half / half.tan()) / (angle * angle);
    moved - turn.cross(moved) / 2.0 + factor * turn.cross(turn.cross(moved))
}
