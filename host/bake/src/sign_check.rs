//! Check of inside and outside against the CAD kernel's own classifier.
//!
//! Random points in a box a tenth larger than the shape, and half as many again close to its surface, are classified three ways: by the kernel, by
//! [`ExactSurface`], and by a field baked from it and queried as on the board. Points so near the surface that the approximation's stated error
//! decides are excluded and counted:
//! - for the exact surface, within its stated error and the model's own accuracy;
//! - for the field, within √3/2 of a cell and half a step. A trilinear sample is Σ wᵢ dᵢ of distances at the corners xᵢ of a cell, and distance is
//!   1-Lipschitz: |Σ wᵢ dᵢ − d(p)| ≤ Σ wᵢ |xᵢ − p| ≤ √Σ wᵢ |xᵢ − p|² = h √Σ t(1 − t) ≤ h √3/2 (Jensen).
//!
//! The kernel's classifier shoots one ray per point, and a ray that grazes an edge can give a wrong answer. So where it differs from ours, points of
//! a ball that contains no surface by the kernel's own distance are classified as well; the kernel's side counts only if more than three quarters of
//! them agree.
//!
//! Cost: one ray of the kernel per point, 10 µs to 5 ms, in batches, each in its own process, as many at once as there are processors. Points not
//! answered in the allowed time are excluded, and the number of answers is reported.

use std::num::NonZero;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use glam::{DAffine3, DVec3};
use mortise_brep::oracle::{Side, classify, nearest};
use mortise_brep::{BrepError, LoadOptions, Shape, child};
use mortise_protocol::image::{Lookup, SceneImage};
use rayon::prelude::*;
use serde::Serialize;

use crate::distance::ExactSurface;
use crate::error::BakeError;
use crate::field::bake_field;
use crate::format::{FieldOptions, SampleFormat, Samples};
use crate::grid::bounding_box;
use crate::image::{ImageBuilder, PartPlacement};
use crate::shell::Pointshell;

/// Customary accuracy of STEP, mm: the uncertainty in the file itself about where its faces meet.
const MODEL_MM: f64 = 1e-3;

/// Distance within which the kernel reports a point as on the surface, mm.
const KERNEL_MM: f64 = 1e-7;
/// Points of a ball by which a doubtful answer of the kernel is checked; a majority of more than three quarters decides.
const BALL: usize = 16;
/// Points of one batch: each batch reads the file again.
const BATCH: usize = 1000;
/// Most points checked in this way: the kernel's rays fail at one in ten thousand, so a larger number is not the kernel's fault.
const MOST_DOUBTED: usize = 200;

/// Extent of the comparison.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SignOptions {
    /// Number of points in the box; half as many more are close to the surface.
    pub points: usize,
    /// Number of field cells along the shape's longest side.
    pub cells: f64,
    /// Time limit of the kernel, seconds: points not reached by then are excluded. Doubtful points get half as much again.
    pub time_limit_s: u64,
}

/// A point on the wrong side.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WrongSide {
    /// Position in the shape's frame, mm.
    pub point: [f64; 3],
    /// Whether the kernel reports it inside.
    pub inside: bool,
    /// Signed distance found, mm.
    pub distance_mm: f64,
    /// Whether the field found it; else the exact surface.
    pub field: bool,
}

/// Comparison of the signs of one shape.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SignCheck {
    /// Whether the shape is closed by its mesh-edge count. For an open one the kernel's answer is as meaningless as ours.
    pub closed: bool,
    /// Whether signs away from the surface come from the winding number.
    pub by_winding: bool,
    /// Number of points to classify.
    pub asked: usize,
    /// Number of them that the kernel decided in time.
    pub points: usize,
    /// Number of points that the kernel could not decide, or reported on the surface.
    pub undecided: usize,
    /// Distance below which the sign of the exact surface is not compared, mm.
    pub tolerance_mm: f64,
    /// Number of points within `tolerance_mm`.
    pub near: usize,
    /// Points at which the kernel contradicts itself: it reports most of a ball about the point, which by its own distance contains no surface, on
    /// the other side. That side is used.
    pub contradictions: usize,
    /// Number of points on the wrong side of the exact surface.
    pub wrong: usize,
    /// Cell of the field, mm.
    pub cell_mm: f64,
    /// Distance below which the sign of the field is not compared, mm.
    pub field_tolerance_mm: f64,
    /// Number of points within `field_tolerance_mm`.
    pub field_near: usize,
    /// Number of those whose sign is wrong nevertheless: next to sharp edges and in walls thinner than a cell.
    pub field_near_wrong: usize,
    /// Number of points farther away on the wrong side of the field.
    pub field_wrong: usize,
    /// The first few of all wrong points.
    pub examples: Vec<WrongSide>,
}

/// Why signs could not be compared.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SignError {
    /// The kernel gave no answer.
    #[error(transparent)]
    Kernel(#[from] BrepError),
    /// The field could not be baked.
    #[error(transparent)]
    Bake(#[from] BakeError),
    /// The field was baked into an image that does not open.
    #[error("the baked field does not open: {0}")]
    Image(String),
}

/// Compares signs of `shape`, which is number `index` in the file at `path` read with `load`.
///
/// # Errors
/// When the kernel gives no answer within the time limit, or the field cannot be baked.
pub fn check_signs(
    path: &Path,
    load: &LoadOptions,
    index: usize,
    shape: &Shape,
    options: &SignOptions,
) -> Result<SignCheck, SignError> {
    let (lo, hi) = bounding_box(shape);
    let longest = (hi - lo).max_element();
    let cell_mm = longest / options.cells;
    let points = sample_points(shape, options.points, 2.0 * cell_mm);
    let asked = points.len();
    let (points, mut sides) = in_batches(path, load, index, &points, options.time_limit_s)?;
    let load = LoadOptions {
        time_limit_s: options.time_limit_s.div_ceil(2),
        ..load.clone()
    };

    let mut surface = ExactSurface::new(shape);
    let field = FieldOptions {
        cell_mm,
        band_cells: 2.0,
        format: SampleFormat::Int16,
        patch_tolerance_mm: 2e-3,
        samples: Samples::Everywhere,
        finer: None,
    };
    let baked = bake_field(&mut surface, &field, "part", &|_, _| ControlFlow::Continue(()))?;
    let cell_mm = f64::from(baked.record.cell) * 1000.0;
    let step_mm = f64::from(baked.record.scale) * 1000.0;
    let mut image = ImageBuilder::new();
    let (number, _) = image.add_shape(shape, baked, &Pointshell::default(), &[], false);
    image.add_part(&PartPlacement {
        shape: number,
        placement: DAffine3::IDENTITY,
        grabbable: true,
    });
    let image = image.finish();
    // Aligned as in flash.
    let mut words = vec![0u32; image.len().div_ceil(4)];
    bytemuck::cast_slice_mut::<u32, u8>(&mut words)[..image.len()].copy_from_slice(&image);
    let image = SceneImage::open(&bytemuck::cast_slice(&words)[..image.len()])
        .map_err(|e| SignError::Image(format!("{e:?}")))?;
    let board = image.shape(0).field;

    let tolerance_mm = MODEL_MM + surface.surface_error_mm();
    let field_tolerance_mm = tolerance_mm + 0.75f64.sqrt() * cell_mm + step_mm;
    let count = |(&p, &side): (&DVec3, &Side)| -> SignCheck {
        let mut one = SignCheck {
            closed: shape.closed,
            by_winding: surface.sign_by_winding(),
            asked: 0,
            points: 1,
            undecided: 0,
            tolerance_mm,
            near: 0,
            contradictions: 0,
            wrong: 0,
            cell_mm,
            field_tolerance_mm,
            field_near: 0,
            field_near_wrong: 0,
            field_wrong: 0,
            examples: Vec::new(),
        };
        let inside = match side {
            Side::In => true,
            Side::Out => false,
            Side::On | Side::Unknown => {
                (one.points, one.undecided) = (0, 1);
                return one;
            }
        };
        let Some(exact) = surface.nearest(p).map(|n| n.distance) else {
            return one;
        };
        let stored = match board.lookup((p / 1000.0).as_vec3().to_array()) {
            Lookup::Near(sample) => f64::from(sample.distance) * 1000.0,
            Lookup::Far { inside, bound } => f64::from(bound) * if inside { -1000.0 } else { 1000.0 },
        };
        let example = |distance_mm, field| WrongSide {
            point: p.to_array(),
            inside,
            distance_mm,
            field,
        };
        if exact.abs() <= tolerance_mm {
            one.near = 1;
        } else if (exact < 0.0) != inside {
            one.wrong = 1;
            one.examples.push(example(exact, false));
        }
        let other = (stored < 0.0 || (stored == 0.0 && exact < 0.0)) != inside;
        if exact.abs() <= field_tolerance_mm {
            one.field_near = 1;
            one.field_near_wrong = usize::from(other);
        } else if other {
            one.field_wrong = 1;
            one.examples.push(example(stored, true));
        }
        one
    };
    let doubted: Vec<usize> = (points.par_iter().zip(&sides).enumerate())
        .filter(|(_, pair)| {
            let one = count(*pair);
            one.wrong + one.field_wrong > 0
        })
        .map(|(i, _)| i)
        .collect();
    let contradictions = doubted.len().min(MOST_DOUBTED);
    let contradictions = reconsider(
        path,
        &load,
        index,
        &points,
        &mut sides,
        &doubted[..contradictions],
    )?;
    let none = || SignCheck {
        points: 0,
        undecided: 0,
        ..count((&DVec3::ZERO, &Side::Unknown))
    };
    let mut all = (points.par_iter().zip(&sides).map(count)).reduce(none, add);
    all.contradictions = contradictions;
    all.asked = asked;
    Ok(all)
}

/// The kernel's answers to as many of `points` as it reaches in `limit_s` seconds, batch by batch, and the points answered.
fn in_batches(
    path: &Path,
    load: &LoadOptions,
    index: usize,
    points: &[DVec3],
    limit_s: u64,
) -> Result<(Vec<DVec3>, Vec<Side>), BrepError> {
    let end = Instant::now() + Duration::from_secs(limit_s);
    let next = AtomicUsize::new(0);
    let batches: Vec<&[DVec3]> = points.chunks(BATCH).collect();
    let ask = || -> Result<Vec<(usize, Vec<Side>)>, BrepError> {
        let mut answers = Vec::new();
        loop {
            let place = next.fetch_add(1, Ordering::Relaxed);
            let left_s = end.saturating_duration_since(Instant::now()).as_secs();
            let Some(&batch) = batches.get(place).filter(|_| left_s > 0) else {
                break;
            };
            let load = LoadOptions {
                time_limit_s: left_s,
                ..load.clone()
            };
            match classify(path, &load, index, batch, KERNEL_MM) {
                Ok(sides) => answers.push((place, sides)),
                Err(BrepError::TimedOut { .. }) => break,
                Err(error) => return Err(error),
            }
        }
        Ok(answers)
    };
    // Plain threads instead of rayon's: these only wait for processes. Without child processes the kernel works in this process, on one thread.
    let processors = std::thread::available_parallelism().map_or(1, NonZero::get);
    let processes = if child::is_ready() { processors } else { 1 };
    let answers = std::thread::scope(|scope| {
        let asking: Vec<_> = (0..processes).map(|_| scope.spawn(ask)).collect();
        let each = asking.into_iter().map(|thread| match thread.join() {
            Ok(answers) => answers,
            Err(panic) => std::panic::resume_unwind(panic),
        });
        each.collect::<Result<Vec<_>, BrepError>>()
    })?;
    let mut answers: Vec<(usize, Vec<Side>)> = answers.into_iter().flatten().collect();
    answers.sort_unstable_by_key(|&(place, _)| place);
    let reached = answers.iter().flat_map(|&(place, _)| batches[place]).copied();
    let reached = reached.collect();
    Ok((
        reached,
        answers.into_iter().flat_map(|(_, sides)| sides).collect(),
    ))
}

/// Queries the kernel again about the points `doubted`, in a ball about each that contains no surface by the kernel's own distance: the whole ball is
/// on one side. Puts the majority's side into `sides` and returns the number of changes.
fn reconsider(
    path: &Path,
    load: &LoadOptions,
    index: usize,
    points: &[DVec3],
    sides: &mut [Side],
    doubted: &[usize],
) -> Result<usize, BrepError> {
    // Each question reads the file again.
    if doubted.is_empty() {
        return Ok(0);
    }
    let centers: Vec<DVec3> = doubted.iter().map(|&i| points[i]).collect();
    let feet = match nearest(path, load, index, &centers) {
        // The first answers stand in that case.
        Err(BrepError::TimedOut { .. }) => return Ok(0),
        feet => feet?,
    };
    let mut random = SplitMix(2);
    let mut around = Vec::with_capacity(doubted.len() * BALL);
    for (&center, foot) in centers.iter().zip(feet) {
        // Points in a cube inside the ball.
        let reach = foot.map_or(0.0, |f| 0.5 * f.distance);
        around.extend(
            (0..BALL).map(|_| center + DVec3::from_array([0; 3].map(|_| 2.0 * random.unit() - 1.0)) * reach),
        );
    }
    let answers = match classify(path, load, index, &around, KERNEL_MM) {
        Err(BrepError::TimedOut { .. }) => return Ok(0),
        answers => answers?,
    };
    let mut changed = 0;
    for (&i, ball) in doubted.iter().zip(answers.chunks(BALL)) {
        for side in [Side::In, Side::Out] {
            let agree = ball.iter().filter(|&&s| s == side).count();
            if 4 * agree > 3 * BALL && sides[i] != side {
                sides[i] = side;
                changed += 1;
            }
        }
    }
    Ok(changed)
}

fn add(mut a: SignCheck, b: SignCheck) -> SignCheck {
    /// Enough to find the cause without flooding a report.
    const EXAMPLES: usize = 8;
    a.asked += b.asked;
    a.points += b.points;
    a.undecided += b.undecided;
    a.near += b.near;
    a.contradictions += b.contradictions;
    a.wrong += b.wrong;
    a.field_near += b.field_near;
    a.field_near_wrong += b.field_near_wrong;
    a.field_wrong += b.field_wrong;
    let room = EXAMPLES.saturating_sub(a.examples.len());
    a.examples.extend(b.examples.into_iter().take(room));
    a
}

/// `count` points in the box a tenth larger than the shape, then half as many up to `reach` mm off the triangles, each triangle weighted by its area.
fn sample_points(shape: &Shape, count: usize, reach: f64) -> Vec<DVec3> {
    let mut random = SplitMix(1);
    let (lo, hi) = bounding_box(shape);
    let (center, half) = ((lo + hi) / 2.0, (hi - lo) * 0.55);
    let mut points: Vec<DVec3> = (0..count)
        .map(|_| center + half * DVec3::from_array([0; 3].map(|_| 2.0 * random.unit() - 1.0)))
        .collect();
    let mesh = &shape.mesh;
    let mut total = 0.0;
    let areas: Vec<f64> = mesh
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|v| mesh.vertices[v as usize]);
            total += (b - a).cross(c - a).length();
            total
        })
        .collect();
    for _ in 0..count / 2 {
        let at = areas.partition_point(|&sum| sum < total * random.unit());
        let Some(t) = mesh.triangles.get(at) else { continue };
        let [a, b, c] = t.map(|v| mesh.vertices[v as usize]);
        let (mut x, mut y) = (random.unit(), random.unit());
        if x + y > 1.0 {
            (x, y) = (1.0 - x, 1.0 - y);
        }
        let normal = (b - a).cross(c - a).normalize_or_zero();
        points.push(a + (b - a) * x + (c - a) * y + normal * reach * (2.0 * random.unit() - 1.0));
    }
    // Shuffled (Fisher and Yates), so that the points the kernel reaches in time are a fair sample.
    for last in (1..points.len()).rev() {
        points.swap(last, ((last + 1) as f64 * random.unit()) as usize);
    }
    points
}

/// Steele, Lea, Flood 2014, "Fast splittable pseudorandom number generators": the same points on every machine.
struct SplitMix(u64);

impl SplitMix {
    /// Next number in [0, 1).
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) as f64 / 2f64.powi(64)
    }
}
