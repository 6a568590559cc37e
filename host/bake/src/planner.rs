//! The coarsest scene image that meets a request, the choices made with their reasons, and its cost.
//!
//! For each shape the cells of interpolation alone follow from the requested accuracy in closed form ([`crate::accuracy`], [`crate::choice`]). Where
//! exact surfaces answer, larger cells may do: they are tried from coarse to fine, and the first whose measured error ([`crate::field_error`]) is
//! within the bounds is compared with the next. When the image does not fit the flash, or the worst-case tick exceeds its budget, the accuracy is
//! lowered until both fit; at last the coarsest fields are taken, whatever their error. The result is reported as the best possible. Cost: a bake of
//! each cell tried, the finest of which takes most of the time.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use glam::DAffine3;
use mortise_brep::{CadModel, Surface};
use mortise_haptics::LEAST_CROSSING_SINE;
use rayon::prelude::*;

use crate::bake::{Baked, Made, field_bytes};
use crate::choice::{Choice, Demand, FIELD_SHARE, PATCH_SHARE};
use crate::cost::TickCost;
use crate::distance::ExactSurface;
use crate::error::BakeError;
use crate::field::BakedField;
use crate::field_error::{FaceError, field_errors};
use crate::fits::{Fit, fits};
use crate::options::{BakeOptions, Progress};
use crate::placed_fits::placed_fits;
use crate::plan::{PartTick, Plan, Planned, Request, ShapePlan};
use crate::scene::Scene;
use crate::shell::Pointshell;
use crate::voids::{others, without_hollows};

/// Attempts to find an accuracy that fits, and then one between that and the last that did not fit.
const ATTEMPTS: usize = 12;
const REFINEMENTS: usize = 3;
/// Bytes of a field grow at least with this power of the inverse cell: the bricks of a prism repeat along it.
const LEAST_GROWTH: f64 = 1.0;
/// Number of times the bound of crossings may be quadrupled.
const COARSER_CROSSINGS: usize = 4;
/// Most pairs of placed parts in which the fits of two shapes are looked for.
const MOST_PLACEMENTS: usize = 16;
/// Attempts with a finer cell for a shape with free-form faces, and the factor between their cells.
const FINER_CELLS: usize = 5;
const FINER: f64 = 0.7;
/// Smallest cell tried, mm.
const LEAST_CELL_MM: f64 = 1e-3;
/// Coarsest accuracy tried.
const COARSEST_MM: f64 = 2.0;

/// Plans and bakes `model`. `progress` as for [`crate::bake`]; it restarts with each attempt.
///
/// # Errors
/// See [`BakeError`]. A request that cannot be met is not an error.
pub fn plan(
    model: &CadModel,
    request: &Request,
    progress: &(dyn Fn(Progress) -> ControlFlow<()> + Sync),
) -> Result<Planned, BakeError> {
    if !(request.accuracy_mm >= 1e-5 && request.accuracy_mm <= 100.0) {
        return Err(BakeError::Option {
            option: "accuracy",
            value: request.accuracy_mm,
            expected: "0.01 µm to 100 mm",
        });
    }
    let mut planner = Planner::new(model, request, progress)?;
    let (mut failed, mut accuracy) = (request.accuracy_mm, request.accuracy_mm);
    let (mut best, mut last) = (None, None);
    for _ in 0..=ATTEMPTS {
        let attempt = planner.attempt(accuracy)?;
        let over = attempt.as_ref().map_or(HOPELESS, |a| planner.over(a));
        if over.fits() {
            best = attempt;
            break;
        }
        last = attempt.or(last);
        if accuracy > COARSEST_MM {
            break;
        }
        failed = accuracy;
        accuracy *= over.coarser();
    }
    for _ in 0..REFINEMENTS {
        if best.is_none() || accuracy < 1.1 * failed {
            break;
        }
        let between = (accuracy * failed).sqrt();
        let attempt = planner.attempt(between)?;
        if attempt.as_ref().is_some_and(|a| planner.over(a).fits()) {
            (accuracy, best) = (between, attempt);
        } else {
            failed = between;
        }
    }
    if best.is_none() {
        let smallest = planner.smallest(COARSEST_MM)?;
        if smallest.as_ref().is_some_and(|a| planner.over(a).fits()) {
            best = smallest;
        } else {
            last = smallest.or(last);
        }
    }
    let fits = best.is_some();
    let reported = best.or(last).ok_or(BakeError::TooLarge {
        bytes: u64::from(u32::MAX),
        limit: request.flash_bytes,
        enough_mm: accuracy,
    })?;
    let met = fits && reported.plan.meets(request.accuracy_mm);
    Ok(reported.into_planned(met, fits))
}

/// Size and cost of an attempt as multiples of their limits.
#[derive(Clone, Copy)]
struct Over {
    bytes: f64,
    instructions: f64,
}

/// Excess assumed for an attempt that the layout itself cannot hold.
const HOPELESS: Over = Over {
    bytes: 4.0,
    instructions: 1.0,
};

impl Over {
    fn fits(self) -> bool {
        self.bytes <= 1.0 && self.instructions <= 1.0
    }

    /// Factor by which to lower the accuracy: bytes grow at most with its inverse, points with the square root of its inverse.
    fn coarser(self) -> f64 {
        (1.05 * self.bytes)
            .max(1.1 * self.instructions * self.instructions)
            .clamp(1.25, 8.0)
    }
}

/// State that does not change between attempts.
struct Planner<'a> {
    model: &'a CadModel,
    request: &'a Request,
    progress: &'a (dyn Fn(Progress) -> ControlFlow<()> + Sync),
    scene: Scene,
    prepared: Vec<ExactSurface>,
    demands: Vec<Demand>,
    /// Fields baked so far of each shape.
    known: Vec<Vec<Fielded>>,
    /// Fits of shapes that can meet.
    fits: Vec<((usize, usize), Vec<Fit>)>,
}

/// A field with its errors.
#[derive(Clone)]
struct Fielded {
    choice: Choice,
    /// Tolerance of its local patches, mm.
    tolerance_mm: f64,
    /// Reach of the places at which its errors were measured, mm.
    reach_mm: f64,
    errors: Vec<FaceError>,
    baked: BakedField,
}

impl Fielded {
    fn bytes(&self) -> u64 {
        field_bytes(&self.baked)
    }
}

/// Whether a field with this cell takes more than `room` bytes, to judge by the field of a larger one.
fn is_hopeless(coarser: Option<&Fielded>, cell_mm: f64, room: u64) -> bool {
    let bytes = |field: &Fielded| field.bytes() as f64 * (field.choice.cell_mm / cell_mm).powf(LEAST_GROWTH);
    coarser.is_some_and(|field| bytes(field) > room as f64)
}

struct Attempt {
    baked: Baked,
    plan: Plan,
}

impl Attempt {
    fn into_planned(self, met: bool, fits: bool) -> Planned {
        Planned {
            met,
            fits,
            plan: self.plan,
            image: self.baked.image,
        }
    }
}

impl<'a> Planner<'a> {
    fn new(
        model: &'a CadModel,
        request: &'a Request,
        progress: &'a (dyn Fn(Progress) -> ControlFlow<()> + Sync),
    ) -> Result<Self, BakeError> {
        let options = BakeOptions {
            grabbable: request.grabbable.clone(),
            ..BakeOptions::default()
        };
        let mut scene = Scene::new(model, &options)?;
        let reached: Vec<(ExactSurface, Vec<u32>)> = (0..scene.shapes.len())
            .into_par_iter()
            .map(|number| {
                let shape = &model.shapes[scene.shapes[number]];
                let beside = || {
                    let own = scene.parts.iter().filter(|part| part.1 == number);
                    own.flat_map(|part| others(model, part.0)).collect()
                };
                match without_hollows(shape, beside) {
                    Some((filled, left_out)) => (ExactSurface::new(&filled), left_out),
                    None => (ExactSurface::new(shape), Vec::new()),
                }
            })
            .collect();
        let (prepared, left_out): (Vec<_>, Vec<_>) = reached.into_iter().unzip();
        scene.find_partners(&prepared);
        scene.find_edges(&prepared, &options);
        let mut all = Vec::new();
        for a in 0..prepared.len() {
            for b in scene.met_by(a) {
                let mut found = fits(&prepared[a], &prepared[b]);
                for to_b in placements(model, &scene, a, b) {
                    for fit in placed_fits(&prepared[a], &prepared[b], &to_b) {
                        if !found.iter().any(|other| other.faces == fit.faces) {
                            found.push(fit);
                        }
                    }
                }
                if !found.is_empty() {
                    all.push(((a, b), found));
                }
            }
        }
        let demands = (left_out.into_iter().enumerate())
            .map(|(i, left_out)| {
                let own: Vec<(u32, f64, String)> = all
                    .iter()
                    .filter(|((a, _), _)| *a == i)
                    .flat_map(|((_, b), found)| {
                        let name = &scene.names[*b];
                        found
                            .iter()
                            .map(move |fit| (fit.faces[0], fit.difference, name.clone()))
                    })
                    .collect();
                Demand::new(&scene.names[i], &prepared[i], &own, left_out)
            })
            .collect();
        Ok(Self {
            model,
            request,
            progress,
            scene,
            known: vec![Vec::new(); prepared.len()],
            prepared,
            demands,
            fits: all,
        })
    }

    /// Bakes for `accuracy_mm`; `None` when the layout or the flash cannot hold the result.
    fn attempt(&mut self, accuracy_mm: f64) -> Result<Option<Attempt>, BakeError> {
        let mut fields: Vec<Fielded> = Vec::new();
        for shape in 0..self.prepared.len() {
            let used: u64 = fields.iter().map(Fielded::bytes).sum();
            let room = self.request.flash_bytes.saturating_sub(used);
            match self.field(shape, accuracy_mm, room)? {
                Some(field) => fields.push(field),
                None => return Ok(None),
            }
        }
        self.assemble(accuracy_mm, fields)
    }

    /// The smallest field found of each shape, whatever its error.
    fn smallest(&mut self, accuracy_mm: f64) -> Result<Option<Attempt>, BakeError> {
        let mut fields = Vec::new();
        for shape in 0..self.prepared.len() {
            let finest = self.demands[shape].choose(accuracy_mm);
            let mut smallest: Option<Fielded> = None;
            for choice in self.demands[shape].coarser(&finest) {
                let Some(next) = self.tried(shape, &choice, accuracy_mm)? else {
                    break;
                };
                if smallest.as_ref().is_none_or(|s| next.bytes() < s.bytes()) {
                    smallest = Some(next);
                }
            }
            match smallest {
                Some(field) => fields.push(field),
                None => return Ok(None),
            }
        }
        self.assemble(accuracy_mm, fields)
    }

    /// The smallest field of a shape found that is as accurate as `accuracy_mm` requires; `None` when it would take more than `room` bytes.
    fn field(&mut self, shape: usize, accuracy_mm: f64, room: u64) -> Result<Option<Fielded>, BakeError> {
        let finest = self.demands[shape].choose(accuracy_mm);
        let met = |planner: &Self, field: &Fielded| {
            planner.demands[shape].is_met(accuracy_mm, &field.choice, &field.errors, &field.baked.free_form)
        };
        let mut before: Option<Fielded> = None;
        for choice in self.demands[shape].coarser(&finest) {
            if is_hopeless(before.as_ref(), choice.cell_mm, room) {
                return Ok(None);
            }
            let Some(field) = self.tried(shape, &choice, accuracy_mm)? else {
                return Ok(None);
            };
            if let Some(coarser) = before.take().filter(|coarser| met(self, coarser)) {
                let smaller = field.bytes() < coarser.bytes() && met(self, &field);
                return Ok(Some(if smaller { field } else { coarser }));
            }
            before = Some(field);
        }
        if let Some(coarser) = before.as_ref().filter(|coarser| met(self, coarser)) {
            return Ok(Some(coarser.clone()));
        }
        if is_hopeless(before.as_ref(), finest.cell_mm, room) {
            return Ok(None);
        }
        let Some(mut field) = self.tried(shape, &finest, accuracy_mm)? else {
            return Ok(None);
        };
        for _ in 0..FINER_CELLS {
            // Bytes grow at most with the inverse square of the cell.
            let full = field.bytes() as f64 > FINER * FINER * room as f64;
            if full || field.baked.free_form.worst_mm() <= FIELD_SHARE * accuracy_mm {
                break;
            }
            let choice = Choice {
                cell_mm: field.choice.cell_mm * FINER,
                why: "its free-form faces".to_owned(),
                ..field.choice.clone()
            };
            match self.tried(shape, &choice, accuracy_mm)? {
                Some(finer) => field = finer,
                None => break,
            }
        }
        Ok(Some(field))
    }

    /// The field of a shape by this choice and its errors; `None` when the layout cannot hold it.
    fn tried(
        &mut self,
        shape: usize,
        choice: &Choice,
        accuracy_mm: f64,
    ) -> Result<Option<Fielded>, BakeError> {
        let tolerance_mm = PATCH_SHARE * accuracy_mm;
        let reach_mm = choice.reach_mm();
        let same = |field: &&mut Fielded| {
            field.choice.cell_mm == choice.cell_mm
                && field.choice.format == choice.format
                && (field.tolerance_mm == tolerance_mm || field.baked.patches.is_empty())
        };
        if let Some(known) = self.known[shape].iter_mut().find(same) {
            if known.reach_mm < reach_mm {
                known.errors = field_errors(&self.prepared[shape], &known.baked, reach_mm);
                known.reach_mm = reach_mm;
            }
            return Ok(Some(Fielded {
                choice: choice.clone(),
                ..known.clone()
            }));
        }
        if choice.cell_mm < LEAST_CELL_MM {
            return Ok(None);
        }
        let options = BakeOptions {
            cell_mm: Some(choice.cell_mm),
            band_cells: choice.band_cells,
            format: choice.format,
            patch_tolerance_mm: tolerance_mm,
            ..BakeOptions::default()
        };
        let surface = &mut self.prepared[shape];
        let mut cell_mm = choice.cell_mm;
        let baked = match self
            .scene
            .field(shape, surface, &mut cell_mm, &options, self.progress)
        {
            Err(BakeError::CellTooSmall { .. }) => return Ok(None),
            done => done?,
        };
        let field = Fielded {
            choice: choice.clone(),
            tolerance_mm,
            reach_mm,
            errors: field_errors(surface, &baked, reach_mm),
            baked,
        };
        self.known[shape].push(field.clone());
        Ok(Some(field))
    }

    /// The image with these fields, and shells as fine as the fields leave room for; `None` when the layout cannot hold it.
    fn assemble(&self, accuracy_mm: f64, fielded: Vec<Fielded>) -> Result<Option<Attempt>, BakeError> {
        let mut shapes: Vec<ShapePlan> = (self.demands.iter().zip(&fielded))
            .map(|(demand, field)| {
                demand.state(accuracy_mm, &field.choice, &field.errors, &field.baked.free_form)
            })
            .collect();
        let mut each: Vec<BakeOptions> = shapes.iter().map(|shape| self.options(shape)).collect();
        let sizes: Vec<f64> = fielded.iter().map(|field| field.choice.resolution_mm).collect();
        let mut made = Made {
            fields: fielded.into_iter().map(|field| field.baked).collect(),
            shells: Vec::new(),
        };
        self.scene.shells_again(&each, &self.prepared, &sizes, &mut made);
        let mut ticks = self.ticks(&made);
        // Points inside cylinders and cones serve crossed shafts only, and are most of the points in a fit: they are reduced first.
        for _ in 0..COARSER_CROSSINGS {
            if ticks
                .first()
                .is_none_or(|t| t.cost.instructions <= self.request.tick_instructions.unwrap_or(u64::MAX))
            {
                break;
            }
            for (shape, options) in shapes.iter_mut().zip(&mut each) {
                shape.crossing_epsilon_mm *= 4.0;
                options.crossing_epsilon_mm = Some(shape.crossing_epsilon_mm);
            }
            self.scene.shells_again(&each, &self.prepared, &sizes, &mut made);
            ticks = self.ticks(&made);
        }
        let baked = match self.scene.assemble(self.model, &each, &self.prepared, made) {
            Err(BakeError::TooLarge { .. }) => return Ok(None),
            baked => baked?,
        };
        self.scene.done(self.progress);
        let plan = Plan {
            accuracy_mm,
            shapes,
            ticks,
            report: baked.report.clone(),
        };
        Ok(Some(Attempt { baked, plan }))
    }

    fn options(&self, shape: &ShapePlan) -> BakeOptions {
        BakeOptions {
            cell_mm: Some(shape.cell_mm),
            band_cells: shape.band_cells,
            format: shape.format,
            epsilon_mm: Some(shape.epsilon_mm),
            crossing_epsilon_mm: Some(shape.crossing_epsilon_mm),
            // Halfway between two points, an edge that crosses at less than this angle is off by half of their distance times its sine.
            max_spacing_mm: Some(2.0 * shape.epsilon_mm / f64::from(LEAST_CROSSING_SINE)),
            grabbable: self.request.grabbable.clone(),
            ..BakeOptions::default()
        }
    }

    fn over(&self, attempt: &Attempt) -> Over {
        let worst = attempt.plan.ticks.first().map_or(0, |t| t.cost.instructions);
        let allowed = self.request.tick_instructions;
        Over {
            bytes: attempt.baked.image.len() as f64 / self.request.flash_bytes.max(1) as f64,
            instructions: allowed.map_or(0.0, |most| worst as f64 / most.max(1) as f64),
        }
    }

    /// Worst-case tick of each part that may be grabbed: it sits in everything it fits into, or lies flat, whichever has more points near.
    fn ticks(&self, made: &Made) -> Vec<PartTick> {
        let scene = &self.scene;
        let mut ticks: Vec<PartTick> = (0..scene.parts.len())
            .filter(|&i| scene.grabbable[i])
            .map(|i| {
                let (part, own) = scene.parts[i];
                let met: Vec<usize> = (0..scene.parts.len())
                    .filter(|&j| j != i)
                    .map(|j| scene.parts[j].1)
                    .collect();
                // On a larger flat at most as much of its border is near as of the smaller one's.
                let flat = self.flats(made, own);
                let flats = met
                    .iter()
                    .map(|&other| 2 * flat.min(self.flats(made, other)))
                    .max();
                let all = made.shells[own].points.len()
                    + met.iter().map(|&o| made.shells[o].points.len()).sum::<usize>();
                let near = self.fitted(made, own, &met).max(flats.unwrap_or(0)).min(all);
                PartTick {
                    name: self.model.parts[part].name.clone(),
                    cost: TickCost::of(near as u64, all as u64),
                }
            })
            .collect();
        ticks.sort_by_key(|t| std::cmp::Reverse(t.cost.instructions));
        ticks
    }

    /// Number of points near when a part of shape `own` sits in all of the parts of shapes `met` that it fits: each bore holds one pin; a pin may be
    /// in a bore of each other part.
    fn fitted(&self, made: &Made, own: usize, met: &[usize]) -> usize {
        // For each own face, whether it is hollow, and the point count of the largest matching face of each partner.
        let mut held: BTreeMap<u32, (bool, Vec<usize>)> = BTreeMap::new();
        for &other in met {
            let fits = self.fits.iter().find(|(pair, _)| *pair == (own, other));
            let mut most: BTreeMap<u32, (bool, usize)> = BTreeMap::new();
            for fit in fits.map_or(&[][..], |(_, fits)| fits) {
                let points = points_on(&made.shells[other], fit.faces[1]);
                let entry = most.entry(fit.faces[0]).or_insert((fit.hollow, 0));
                entry.1 = entry.1.max(points);
            }
            for (face, (hollow, points)) in most {
                held.entry(face).or_insert((hollow, Vec::new())).1.push(points);
            }
        }
        let near = |(face, (hollow, theirs)): (u32, (bool, Vec<usize>))| {
            let own = points_on(&made.shells[own], face);
            if hollow {
                own + theirs.iter().max().unwrap_or(&0)
            } else {
                theirs.len() * own + theirs.iter().sum::<usize>()
            }
        };
        held.into_iter().map(near).sum()
    }

    /// Number of points around the flat that has most.
    fn flats(&self, made: &Made, shape: usize) -> usize {
        let faces = self.prepared[shape].shape().faces.iter().enumerate();
        let flats = faces.filter(|(_, f)| matches!(f.surface, Surface::Plane { .. }));
        flats
            .map(|(i, _)| points_on(&made.shells[shape], i as u32))
            .max()
            .unwrap_or(0)
    }
}

/// Transforms from parts of shape `a` to parts of shape `b` as placed in the model.
fn placements(model: &CadModel, scene: &Scene, a: usize, b: usize) -> Vec<DAffine3> {
    let of = |shape: usize| scene.parts.iter().filter(move |part| part.1 == shape);
    (of(a).flat_map(|own| of(b).map(move |other| (own.0, other.0))))
        .filter(|(own, other)| own != other)
        .take(MOST_PLACEMENTS)
        .map(|(own, other)| model.parts[other].placement.inverse() * model.parts[own].placement)
        .collect()
}

fn points_on(shell: &Pointshell, face: u32) -> usize {
    let of = |f: u16| u32::from(f) == face;
    shell
        .points
        .iter()
        .filter(|p| of(p.face) || of(p.edge_face))
        .count()
}
