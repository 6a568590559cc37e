//! The smallest scene image that meets a request, the choices made with their reasons, and its cost.
//!
//! Each shape gets the smallest field found that is accurate enough ([`crate::trials`]), all shapes at the same time. When the image does not fit the
//! flash, the worst-case tick exceeds its budget, or the work for it ends, a coarser accuracy is tried with the work that is left, and then ones between;
//! at last the best mix of the fields found is taken, whatever their error. The result is reported as the best possible, with what limits it.
//!
//! Cost: a bake of each cell tried, the finest of which takes most of the time; bounded by [`Effort`].

use std::ops::ControlFlow;
use std::time::Duration;

use mortise_brep::CadModel;
use mortise_haptics::LEAST_CROSSING_SINE;
use rayon::prelude::*;

use crate::attempt::{Attempt, HOPELESS, Over, Tried, better};
use crate::cache::{Cache, NoCache, plan_from_bytes, plan_name, plan_to_bytes, shape_name};
use crate::choice::PATCH_SHARE;
use crate::demands::{all_fits, demand, reached_surface};
use crate::distance::ExactSurface;
use crate::error::BakeError;
use crate::field::BakedField;
use crate::fits::Fit;
use crate::made::Made;
use crate::mix::mix;
use crate::options::{BakeOptions, Progress};
use crate::overload::overloads;
use crate::plan::{Limit, PartTick, Plan, Planned, Request, ShapePlan};
use crate::scene::Scene;
use crate::ticks::Ticks;
use crate::trials::{Bench, Clock, End, Fielded, Found, Rated, Trials};

/// Attempts to find an accuracy that fits, and then one between that and the last that did not fit.
const ATTEMPTS: usize = 12;
const REFINEMENTS: usize = 3;
/// Number of times the bound of crossings may be quadrupled.
const COARSER_CROSSINGS: usize = 4;
/// Attempts to find a mix of fields that fits together with what is no field.
const MIXES: usize = 4;
/// Coarsest accuracy tried.
const COARSEST_MM: f64 = 2.0;
/// Part of the work and time that is left which the accuracy asked may take, and then each coarser one.
const PART_OF_ASKED: f64 = 0.75;
const PART_OF_COARSER: f64 = 0.9;
/// A shape's stopgap may take this part of all work, or its share.
const STOPGAP_PART: u64 = 4;
/// Factor by which the accuracy is lowered where work or time ended the search of fields.
const COARSER_WHERE_ENDED: f64 = 5.0;
/// Error reached over the accuracy tried up to which the search goes on from there.
const NEAR: f64 = 2.0;

/// What may be spent on planning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Effort {
    /// Most work of all trials together, in triangles examined. What it ends is the same on any machine.
    pub work: u64,
    /// Time after which no further field is tried: a last resort, as what it ends depends on the machine.
    pub time: Duration,
}

impl Default for Effort {
    /// Work of about 40 s on two cores, and a time that only much slower machines reach.
    fn default() -> Self {
        Self {
            work: 600_000_000,
            time: Duration::from_secs(55),
        }
    }
}

/// Plans and bakes `model`. `progress` as for [`crate::bake`]; it restarts with each attempt.
///
/// # Errors
/// See [`BakeError`]. A request that cannot be met is not an error.
pub fn plan(
    model: &CadModel,
    request: &Request,
    progress: &(dyn Fn(Progress) -> ControlFlow<()> + Sync),
) -> Result<Planned, BakeError> {
    plan_with(model, request, &NoCache, progress)
}

/// As [`plan`], with results of other plans from `cache`, which keeps those of this one.
///
/// # Errors
/// As [`plan`].
pub fn plan_with(
    model: &CadModel,
    request: &Request,
    cache: &dyn Cache,
    progress: &(dyn Fn(Progress) -> ControlFlow<()> + Sync),
) -> Result<Planned, BakeError> {
    plan_within(model, request, Effort::default(), cache, progress)
}

/// As [`plan_with`], with this effort.
///
/// # Errors
/// As [`plan`].
pub fn plan_within(
    model: &CadModel,
    request: &Request,
    effort: Effort,
    cache: &dyn Cache,
    progress: &(dyn Fn(Progress) -> ControlFlow<()> + Sync),
) -> Result<Planned, BakeError> {
    if !(request.accuracy_mm >= 1e-5 && request.accuracy_mm <= 100.0) {
        return Err(BakeError::Option {
            option: "accuracy",
            value: request.accuracy_mm,
            expected: "0.01 µm to 100 mm",
        });
    }
    let shapes: Vec<Option<String>> = model.shapes.par_iter().map(shape_name).collect();
    let name = plan_name(&shapes, model, request, effort.work);
    let kept = (name.as_ref())
        .and_then(|name| cache.get(name))
        .and_then(|bytes| plan_from_bytes(&bytes));
    if let Some(planned) = kept {
        return Ok(planned);
    }
    let (planned, ended) = Planner::new(model, request, effort, cache, progress)?.search()?;
    // A plan that the clock ended may be better in another run, so it is not kept.
    if ended != Some(End::Time)
        && let Some((name, bytes)) = name.zip(plan_to_bytes(&planned))
    {
        cache.put(&name, &bytes);
    }
    Ok(planned)
}

/// State that does not change between attempts.
struct Planner<'a> {
    model: &'a CadModel,
    request: &'a Request,
    progress: &'a (dyn Fn(Progress) -> ControlFlow<()> + Sync),
    cache: &'a dyn Cache,
    clock: Clock,
    /// End of the present accuracy's trials.
    until: Clock,
    /// What ended a search, the clock before the work.
    ended: Option<End>,
    scene: Scene,
    shapes: Vec<Trials>,
    /// Fits of shapes that can meet.
    fits: Vec<((usize, usize), Vec<Fit>)>,
}

impl<'a> Planner<'a> {
    fn new(
        model: &'a CadModel,
        request: &'a Request,
        effort: Effort,
        cache: &'a dyn Cache,
        progress: &'a (dyn Fn(Progress) -> ControlFlow<()> + Sync),
    ) -> Result<Self, BakeError> {
        let clock = Clock::new(effort.time);
        let options = BakeOptions {
            grabbable: request.grabbable.clone(),
            image_limit_bytes: request.flash_bytes,
            ..BakeOptions::default()
        };
        let mut scene = Scene::new(model, &options)?;
        let reached: Vec<(ExactSurface, Vec<u32>)> = (0..scene.shapes.len())
            .into_par_iter()
            .map(|number| reached_surface(model, &scene, number))
            .collect();
        let (prepared, left_out): (Vec<_>, Vec<_>) = reached.into_iter().unzip();
        scene.find_partners(&prepared);
        scene.find_edges(&prepared, &options);
        let fits = all_fits(model, &scene, &prepared);
        let faces: usize = prepared.iter().map(|surface| surface.shape().faces.len()).sum();
        let shapes = (prepared.into_iter().zip(left_out).enumerate())
            .map(|(i, (surface, left_out))| {
                let demand = demand(&scene, i, &surface, &fits, left_out);
                // By the number of faces, and half of an equal share at least.
                let part = surface.shape().faces.len() as f64 / faces.max(1) as f64;
                let part = part.max(0.5 / scene.shapes.len() as f64);
                let name = shape_name(surface.shape());
                let share = (part * effort.work as f64) as u64;
                let stopgap = share.max(effort.work / STOPGAP_PART);
                Trials::new(i, surface, demand, name, [share, stopgap])
            })
            .collect();
        Ok(Self {
            model,
            request,
            progress,
            cache,
            clock,
            until: clock,
            ended: None,
            scene,
            shapes,
            fits,
        })
    }

    /// The best plan found, and what ended the search before its end.
    fn search(mut self) -> Result<(Planned, Option<End>), BakeError> {
        let asked = self.request.accuracy_mm;
        let (mut failed, mut accuracy) = (asked, asked);
        let mut best: Option<Box<Attempt>> = None;
        let mut last: Option<Box<Attempt>> = None;
        let mut over = None;
        let parts = std::iter::once(PART_OF_ASKED).chain([PART_OF_COARSER; ATTEMPTS]);
        for part in parts {
            let tried = self.attempt(accuracy, part)?;
            let found = tried.over();
            match tried {
                Tried::Image(attempt) if found.fits() => {
                    let enough = attempt.limit.is_none();
                    let ended = attempt.is_ended();
                    let reached = attempt.reached_mm();
                    best = better(best, attempt);
                    // Coarser fields can only be smaller, not better, once one of the shapes is what limits it.
                    if enough || NEAR * accuracy >= reached {
                        break;
                    }
                    if ended {
                        failed = accuracy;
                    }
                    accuracy *= if ended { COARSER_WHERE_ENDED } else { 2.0 };
                    if accuracy > COARSEST_MM {
                        break;
                    }
                    continue;
                }
                Tried::Image(attempt) => last = Some(attempt),
                Tried::Over(_) => {}
            }
            if self.shapes.iter().all(|shape| shape.ended.is_none()) {
                over = Some(found.limit());
            }
            if accuracy > COARSEST_MM || best.is_some() {
                break;
            }
            failed = accuracy;
            accuracy *= found.coarser();
        }
        for _ in 0..REFINEMENTS {
            if best.is_none() || accuracy < 1.1 * failed {
                break;
            }
            if self.clock.is_over() {
                self.ended = Some(End::Time);
                break;
            }
            let between = (accuracy * failed).sqrt();
            match self.attempt(between, 1.0)? {
                Tried::Image(attempt) if attempt.over.fits() => {
                    if attempt.reached_mm() <= NEAR * between {
                        accuracy = between;
                    } else {
                        failed = between;
                    }
                    best = better(best, attempt);
                }
                _ => failed = between,
            }
        }
        // Shells for a coarse accuracy take fewer bytes.
        for accuracy in [asked, COARSEST_MM] {
            let is_enough = |best: &Attempt| best.plan.meets(asked) || accuracy > asked;
            if best.as_deref().is_some_and(is_enough) {
                break;
            }
            let Tried::Image(mixed) = self.mixed(accuracy)? else {
                continue;
            };
            if mixed.over.fits() {
                best = better(best, mixed);
            } else if (last.as_ref()).is_none_or(|last| last.baked.image.len() > mixed.baked.image.len()) {
                last = Some(mixed);
            }
        }
        let fits = best.is_some();
        let found = best.or(last).ok_or(BakeError::TooLarge {
            bytes: u64::from(u32::MAX),
            limit: self.request.flash_bytes,
            enough_mm: accuracy,
        })?;
        Ok((self.planned(*found, fits, over), self.ended))
    }

    fn planned(&self, found: Attempt, fits: bool, over: Option<Limit>) -> Planned {
        let met = fits && found.plan.meets(self.request.accuracy_mm);
        let limit = if met {
            Limit::Accuracy
        } else if self.ended == Some(End::Time) {
            Limit::Time
        } else {
            let work = self.ended.map(|_| Limit::Work);
            (over.or(found.limit).or(work)).unwrap_or_else(|| Limit::Shape(found.plan.least_accurate()))
        };
        Planned {
            met,
            fits,
            limit,
            plan: found.plan,
            image: found.baked.image,
        }
    }

    /// Bakes for `accuracy_mm` within this part of the work and time that are left.
    fn attempt(&mut self, accuracy_mm: f64, part: f64) -> Result<Tried, BakeError> {
        self.begin(part);
        let room = self.request.flash_bytes;
        let found = self.find(accuracy_mm)?;
        self.note_end();
        let (mut fields, mut limit, mut too_large) = (Vec::new(), None, false);
        for (found, name) in found.into_iter().zip(&self.scene.names) {
            let field = match found {
                Found::Met(field) => Some(field),
                Found::Best(field) => {
                    limit = limit.or_else(|| Some(Limit::Shape(name.clone())));
                    Some(field)
                }
                Found::Ended(field, end) => {
                    limit = Some(match end {
                        End::Work => Limit::Work,
                        End::Time => Limit::Time,
                    });
                    Some(field)
                }
                Found::TooLarge(field) => {
                    too_large = true;
                    field
                }
                Found::Pending => None,
            };
            fields.extend(field);
        }
        if fields.len() < self.shapes.len() {
            return Ok(Tried::Over(HOPELESS));
        }
        let bytes: u64 = fields.iter().map(Fielded::bytes).sum();
        if bytes > room {
            return Ok(Tried::Over(Over {
                bytes: bytes as f64 / room.max(1) as f64,
                finer: has_finer(&fields),
                ..HOPELESS
            }));
        }
        if too_large {
            limit = Some(Limit::Bytes);
        }
        self.assemble(accuracy_mm, fields, limit)
    }

    /// Begins an accuracy with this part of the work and time that are left.
    fn begin(&mut self, part: f64) {
        self.shapes.iter_mut().for_each(|shape| shape.begin(part));
        // Work is what ends an accuracy; less of the clock is kept for others, as it only ends what much slower machines do.
        self.until = self.clock.part(0.5 * (1.0 + part));
    }

    /// Notes what ended the trials of any shape.
    fn note_end(&mut self) {
        let ends = self.shapes.iter().filter_map(|shape| shape.ended);
        self.ended = (ends.chain(self.ended)).max_by_key(|end| *end == End::Time);
    }

    /// The field of each shape for an accuracy. All shapes take one step after the other from coarse to fine, so that none is left behind when planning
    /// ends early.
    fn find(&mut self, accuracy_mm: f64) -> Result<Vec<Found>, BakeError> {
        let room = self.request.flash_bytes;
        let mut steps = 1;
        loop {
            let found = self.each(|shape, bench| shape.find(bench, accuracy_mm, room, steps))?;
            if !found.iter().any(|found| matches!(found, Found::Pending)) {
                return Ok(found);
            }
            steps += 1;
        }
    }

    /// The best mix of the fields found of all shapes that fits the flash; the smallest one where none does.
    fn mixed(&mut self, accuracy_mm: f64) -> Result<Tried, BakeError> {
        self.begin(1.0);
        let rated = self.each(|shape, bench| shape.rated(bench, accuracy_mm))?;
        self.note_end();
        let flash = self.request.flash_bytes;
        let mut room = flash;
        for _ in 0..MIXES {
            let (tried, bytes) = self.mixed_within(&rated, room, accuracy_mm)?;
            let rest = match &tried {
                Tried::Image(attempt) if attempt.over.bytes <= 1.0 => return Ok(tried),
                Tried::Image(attempt) => (attempt.baked.image.len() as u64).saturating_sub(bytes),
                Tried::Over(_) => 0,
            };
            // What is no field takes the rest.
            room = flash.saturating_sub(rest + rest / 8).min(room - room / 8);
        }
        Ok(self.mixed_within(&rated, 0, accuracy_mm)?.0)
    }

    /// The image of the best mix of fields within `room` bytes, and the bytes of the fields.
    fn mixed_within(
        &self,
        rated: &[Vec<Rated>],
        room: u64,
        accuracy_mm: f64,
    ) -> Result<(Tried, u64), BakeError> {
        let fields: Option<Vec<Fielded>> = mix(rated, room).and_then(|chosen| {
            let each = self.shapes.iter().zip(chosen);
            each.map(|(shape, number)| shape.taken(number, accuracy_mm))
                .collect()
        });
        let Some(fields) = fields else {
            return Ok((Tried::Over(HOPELESS), 0));
        };
        let bytes = fields.iter().map(Fielded::bytes).sum();
        Ok((self.assemble(accuracy_mm, fields, None)?, bytes))
    }

    /// The result of each shape, all at the same time.
    fn each<T: Send>(
        &mut self,
        of: impl Fn(&mut Trials, &Bench<'_>) -> Result<T, BakeError> + Sync,
    ) -> Result<Vec<T>, BakeError> {
        let bench = Bench {
            scene: &self.scene,
            cache: self.cache,
            progress: self.progress,
            tolerance_mm: PATCH_SHARE * self.request.accuracy_mm,
            clock: self.until,
            room: self.request.flash_bytes,
        };
        (self.shapes.par_iter_mut().map(|shape| of(shape, &bench))).collect()
    }

    /// The image with these fields, and shells as fine as the fields leave room for.
    fn assemble(
        &self,
        accuracy_mm: f64,
        fielded: Vec<Fielded>,
        limit: Option<Limit>,
    ) -> Result<Tried, BakeError> {
        let mut shapes: Vec<ShapePlan> = (self.shapes.iter().zip(&fielded))
            .map(|(shape, field)| {
                let found = &field.errors;
                let free_form = &field.baked.free_form;
                // What ended early, or was taken whatever its error, was not refined until its errors were small.
                let ended = shape.ended.is_some() || field.is_mixed;
                let trusted_mm = if ended {
                    self.request.accuracy_mm
                } else {
                    f64::INFINITY
                };
                let measured = (free_form, field.baked.rough_mm);
                (shape.demand).state(accuracy_mm, &field.choice, found, measured, trusted_mm)
            })
            .collect();
        let mut each: Vec<BakeOptions> = shapes.iter().map(|shape| self.options(shape)).collect();
        let sizes: Vec<f64> = fielded.iter().map(|field| field.choice.resolution_mm).collect();
        let surfaces: Vec<&ExactSurface> = self.shapes.iter().map(|shape| &shape.surface).collect();
        let mut made = Made {
            fields: fielded
                .iter()
                .map(|field| BakedField::clone(&field.baked))
                .collect(),
            shells: Vec::new(),
        };
        self.scene.shells_again(&each, &surfaces, &sizes, &mut made);
        let counted = Ticks {
            model: self.model,
            scene: &self.scene,
            surfaces: surfaces.clone(),
            fits: &self.fits,
        };
        let mut ticks = counted.of(&made);
        // Points inside cylinders and cones serve crossed shafts only, and are most of the points in a fit: they are reduced first.
        for _ in 0..COARSER_CROSSINGS {
            if longest(&ticks) <= self.request.tick_instructions.unwrap_or(u64::MAX) {
                break;
            }
            for (shape, options) in shapes.iter_mut().zip(&mut each) {
                shape.crossing_epsilon_mm *= 4.0;
                options.crossing_epsilon_mm = Some(shape.crossing_epsilon_mm);
            }
            self.scene.shells_again(&each, &surfaces, &sizes, &mut made);
            ticks = counted.of(&made);
        }
        let overloaded = overloads(&counted, &ticks, &each, &made);
        let mut baked = match self.scene.assemble(self.model, &each, &surfaces, made) {
            Err(BakeError::TooLarge { .. }) => return Ok(Tried::Over(HOPELESS)),
            baked => baked?,
        };
        baked.report.warnings.extend(overloaded);
        self.scene.done(self.progress);
        let over = self.over(baked.image.len(), longest(&ticks), has_finer(&fielded));
        let plan = Plan {
            accuracy_mm,
            shapes,
            ticks,
            report: baked.report.clone(),
        };
        Ok(Tried::Image(Box::new(Attempt {
            baked,
            plan,
            over,
            limit,
        })))
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

    fn over(&self, bytes: usize, instructions: u64, finer: bool) -> Over {
        let allowed = self.request.tick_instructions;
        Over {
            bytes: bytes as f64 / self.request.flash_bytes.max(1) as f64,
            instructions: allowed.map_or(0.0, |most| instructions as f64 / most.max(1) as f64),
            finer,
        }
    }
}

fn has_finer(fields: &[Fielded]) -> bool {
    fields.iter().any(|field| field.baked.finer_bricks > 0)
}

fn longest(ticks: &[PartTick]) -> u64 {
    ticks.first().map_or(0, |tick| tick.cost.instructions)
}
