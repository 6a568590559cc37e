//! Fields tried for one shape, from coarse to fine, and the smallest of them that is as accurate as required.
//!
//! Where exact surfaces answer, large cells may do: they are tried first, and accepted by their measured error ([`crate::field_error`]). The cells of
//! interpolation alone follow in closed form ([`crate::choice`]) and are tried last. What was tried is kept: a coarser accuracy costs little after a
//! finer one.
//!
//! Work is counted in triangles that distance queries examine ([`ExactSurface::work`]). A shape has a share of it, and each accuracy a part of that
//! ([`Trials::begin`]), so that work is left for a coarser accuracy; when the part is used up, the most accurate field found so far is taken. A field that
//! exceeds the part is not used, however much of it was done, and one from the cache counts as when it was baked. So the result depends on the model
//! alone, not on the machine, unless the clock ends the planning: that is the last resort. Whatever ends it, only fields whose errors were measured
//! completely are used.

use std::ops::ControlFlow;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use crate::cache::{Cache, KeptField, field_name};
use crate::choice::{Choice, Demand, PATCH_SHARE};
use crate::distance::ExactSurface;
use crate::error::BakeError;
use crate::field::BakedField;
use crate::field_error::{FaceError, field_errors};
use crate::made::field_bytes;
use crate::options::{BakeOptions, Progress};
use crate::scene::Scene;

/// Bytes of a field grow at least with this power of the inverse cell: the bricks of a prism repeat along it.
const LEAST_GROWTH: f64 = 1.0;
/// Attempts with a cell finer than interpolation needs, where the measured error is larger than expected, and the factor between their cells.
const FINER_CELLS: usize = 5;
const FINER: f64 = 0.7;
/// Least improvement for which a still finer cell is tried.
const HELPS: f64 = 0.9;
/// A field with finer bricks of more than this share of the image is kept without them, too.
const LARGE_SHARE: u64 = 4;
/// Most work of a shape's first field over its share: with more of it the accuracy is out of reach.
const FIRST_PART: f64 = 0.35;
/// Accuracy of the patches of a shape's first field over the one asked, where that takes too much work.
const STOPGAP: f64 = 25.0;
/// Smallest cell tried, mm.
const LEAST_CELL_MM: f64 = 1e-3;

/// What the trials of all shapes share.
pub(crate) struct Bench<'a> {
    pub scene: &'a Scene,
    pub cache: &'a dyn Cache,
    pub progress: &'a (dyn Fn(Progress) -> ControlFlow<()> + Sync),
    /// Tolerance of local patches at the requested accuracy, mm.
    pub tolerance_mm: f64,
    pub clock: Clock,
    /// Bytes of the image.
    pub room: u64,
}

/// The end of planning by time, the last resort.
#[derive(Clone, Copy)]
pub(crate) struct Clock {
    /// Never without one.
    until: Option<Instant>,
}

impl Clock {
    /// Ends after this time.
    pub fn new(most: Duration) -> Self {
        Self {
            until: Instant::now().checked_add(most),
        }
    }

    /// Ends after this part of the time that is left.
    pub fn part(self, part: f64) -> Self {
        let now = Instant::now();
        let left = |until: Instant| until.saturating_duration_since(now).mul_f64(part);
        Self {
            until: self.until.map(|until| now + left(until)),
        }
    }

    /// Whether it has ended.
    pub fn is_over(self) -> bool {
        self.until.is_some_and(|until| Instant::now() >= until)
    }
}

impl Bench<'_> {
    /// Tolerance of local patches for an accuracy, mm: one of few, so that fields can be used again.
    fn tolerance(&self, accuracy_mm: f64) -> f64 {
        let doublings = (PATCH_SHARE * accuracy_mm / self.tolerance_mm).log2() + 1e-9;
        self.tolerance_mm * 2f64.powf(doublings.floor())
    }
}

/// A field with its errors.
#[derive(Clone)]
pub(crate) struct Fielded {
    pub choice: Choice,
    /// Tolerance of its local patches, mm.
    tolerance_mm: f64,
    /// Reach of the places at which its errors were measured, mm.
    reach_mm: f64,
    /// Whether it was made because there was no other.
    is_stopgap: bool,
    /// Whether it was taken into a mix, whatever its error.
    pub is_mixed: bool,
    pub errors: Arc<Vec<FaceError>>,
    pub baked: Arc<BakedField>,
}

impl Fielded {
    /// Bytes in the image.
    pub fn bytes(&self) -> u64 {
        field_bytes(&self.baked)
    }

    /// Measures its errors anew where they do not reach this far from the surface.
    fn measure_to(&mut self, surface: &ExactSurface, reach_mm: f64) {
        if self.reach_mm < reach_mm {
            self.errors = Arc::new(field_errors(surface, &self.baked, reach_mm));
            self.reach_mm = reach_mm;
        }
    }
}

/// A field found for a shape.
#[derive(Clone, Copy)]
pub(crate) struct Rated {
    /// Its number among those found.
    pub number: usize,
    pub bytes: u64,
    /// Its error over what an accuracy allows.
    pub excess: f64,
}

/// Result for an accuracy.
pub(crate) enum Found {
    /// The smallest field found that is accurate enough.
    Met(Fielded),
    /// The most accurate one found: finer cells do not help.
    Best(Fielded),
    /// The most accurate one found before the share of work or the time ended.
    Ended(Fielded, End),
    /// The steps allowed do not suffice.
    Pending,
    /// It would take more bytes than there are; with the most accurate field that does not, if any.
    TooLarge(Option<Fielded>),
}

/// What ended the trials of a shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum End {
    /// Its share of work is used up.
    Work,
    /// The clock.
    Time,
}

/// The trials of one shape.
pub(crate) struct Trials {
    number: usize,
    pub surface: ExactSurface,
    pub demand: Demand,
    /// Name of its geometry in the cache.
    name: Option<String>,
    known: Vec<Fielded>,
    /// Most work of all accuracies.
    share: u64,
    /// Most work of a stopgap, which may exceed the share.
    stopgap: u64,
    /// Count of work at which the trials of the present accuracy end.
    limit: u64,
    /// What ended them, if anything has.
    pub ended: Option<End>,
}

impl Trials {
    pub fn new(
        number: usize,
        surface: ExactSurface,
        demand: Demand,
        name: Option<String>,
        [share, stopgap]: [u64; 2],
    ) -> Self {
        Self {
            number,
            surface,
            demand,
            name,
            known: Vec::new(),
            share,
            stopgap,
            limit: share,
            ended: None,
        }
    }

    /// Begins the trials of an accuracy, with this part of the work that is left.
    pub fn begin(&mut self, part: f64) {
        let used = self.surface.work().so_far().min(self.share);
        self.limit = used + (part * (self.share - used) as f64) as u64;
        self.ended = None;
    }

    /// Ends the trials of an accuracy. The count does not depend on how far the work went that is not used.
    fn end(&mut self, end: End) {
        if end == End::Work {
            self.surface.work().at_most(self.limit);
        }
        self.ended = Some(end);
    }

    /// The smallest field found that is as accurate as `accuracy_mm` requires, of at most about `room` bytes, within so many steps from coarse to fine.
    pub fn find(
        &mut self,
        bench: &Bench<'_>,
        accuracy_mm: f64,
        room: u64,
        steps: usize,
    ) -> Result<Found, BakeError> {
        let finest = self.demand.choose(accuracy_mm);
        let mut tried: Vec<Fielded> = Vec::new();
        for choice in self.demand.coarser(&finest) {
            if tried.len() >= steps {
                return Ok(Found::Pending);
            }
            if is_hopeless(tried.last(), choice.cell_mm, room) {
                return Ok(Found::TooLarge(self.best(accuracy_mm, tried, room)));
            }
            let Some(field) = self.tried(bench, &choice, accuracy_mm)? else {
                return Ok(self.unfinished(accuracy_mm, tried, room));
            };
            let is_met = self.excess(accuracy_mm, &field) <= 1.0;
            if let Some(coarser) = tried.last().filter(|f| self.excess(accuracy_mm, f) <= 1.0) {
                let smaller = is_met && field.bytes() < coarser.bytes();
                return Ok(Found::Met(if smaller { field } else { coarser.clone() }));
            }
            // Where bytes grow already, the next field would be larger, and takes as long as all before.
            if is_met
                && tried
                    .last()
                    .is_some_and(|coarser| coarser.bytes() <= field.bytes())
            {
                return Ok(Found::Met(field));
            }
            tried.push(field);
        }
        if let Some(field) = tried.last().filter(|f| self.excess(accuracy_mm, f) <= 1.0) {
            return Ok(Found::Met(field.clone()));
        }
        if tried.len() >= steps {
            return Ok(Found::Pending);
        }
        self.finest(bench, accuracy_mm, room, finest, tried)
    }

    /// The field of interpolation alone, or finer ones where its measured error needs them.
    fn finest(
        &mut self,
        bench: &Bench<'_>,
        accuracy_mm: f64,
        room: u64,
        finest: Choice,
        mut tried: Vec<Fielded>,
    ) -> Result<Found, BakeError> {
        if is_hopeless(tried.last(), finest.cell_mm, room) {
            return Ok(Found::TooLarge(self.best(accuracy_mm, tried, room)));
        }
        let Some(mut field) = self.tried(bench, &finest, accuracy_mm)? else {
            return Ok(self.unfinished(accuracy_mm, tried, room));
        };
        for _ in 0..FINER_CELLS {
            let error = self.excess_away(accuracy_mm, &field);
            if error <= 1.0 {
                return Ok(self.least_at_edges(accuracy_mm, field, tried, room));
            }
            tried.push(field.clone());
            // Bytes grow at most with the inverse square of the cell.
            if field.bytes() as f64 > FINER * FINER * room as f64 {
                return Ok(Found::TooLarge(self.best(accuracy_mm, tried, room)));
            }
            let choice = Choice {
                cell_mm: field.choice.cell_mm * FINER,
                why: "the error measured at its faces".to_owned(),
                ..field.choice.clone()
            };
            let Some(finer) = self.tried(bench, &choice, accuracy_mm)? else {
                return Ok(self.unfinished(accuracy_mm, tried, room));
            };
            let helped = self.excess_away(accuracy_mm, &finer) <= HELPS * error;
            field = finer;
            if !helped {
                break;
            }
        }
        if self.excess_away(accuracy_mm, &field) <= 1.0 {
            return Ok(self.least_at_edges(accuracy_mm, field, tried, room));
        }
        tried.push(field);
        Ok(match self.best(accuracy_mm, tried, room) {
            Some(best) => Found::Best(best),
            None => Found::TooLarge(None),
        })
    }

    /// `field`, accurate enough away from edges, or one of those tried that errs less everywhere: where surfaces answer at edges and are nearly accurate
    /// enough.
    fn least_at_edges(&self, accuracy_mm: f64, field: Fielded, mut tried: Vec<Fielded>, room: u64) -> Found {
        let own = self.excess(accuracy_mm, &field);
        tried.retain(|other| self.excess(accuracy_mm, other) < own);
        match self.best(accuracy_mm, tried, room) {
            Some(best) if own > 1.0 => Found::Best(best),
            _ => Found::Met(field),
        }
    }

    /// All fields found, the smallest first, each with its bytes and its error over what an accuracy allows; cells larger than those that [`Self::find`]
    /// tries are tried as well. None where the layout cannot hold any.
    pub fn rated(&mut self, bench: &Bench<'_>, accuracy_mm: f64) -> Result<Vec<Rated>, BakeError> {
        let finest = self.demand.choose(accuracy_mm);
        for choice in self.demand.coarsest(&finest) {
            self.tried(bench, &choice, accuracy_mm)?;
        }
        let mut rated: Vec<Rated> = (self.known.iter().enumerate())
            .map(|(number, field)| Rated {
                number,
                bytes: field.bytes(),
                excess: self.excess(accuracy_mm, field),
            })
            .collect();
        rated.sort_by(|a, b| a.bytes.cmp(&b.bytes).then(a.excess.total_cmp(&b.excess)));
        Ok(rated)
    }

    /// One of the fields found, stated for an accuracy.
    pub fn taken(&self, number: usize, accuracy_mm: f64) -> Option<Fielded> {
        let finest = self.demand.choose(accuracy_mm);
        let field = self.known.get(number)?.clone();
        // Its shell resolves no more than its cells, so that it has few points.
        let resolution_mm = field.choice.cell_mm.max(finest.resolution_mm);
        Some(self.restated(
            field,
            Choice {
                resolution_mm,
                ..finest
            },
        ))
    }

    /// A known field, stated for another accuracy with the errors near enough for it.
    fn restated(&self, mut field: Fielded, finest: Choice) -> Fielded {
        field.is_mixed = true;
        field.choice.resolution_mm = finest.resolution_mm;
        field.choice.edges = finest.edges;
        let reach_mm = field.choice.reach_mm();
        field.measure_to(&self.surface, reach_mm);
        field
    }

    /// The most accurate of the fields tried.
    fn best(&self, accuracy_mm: f64, tried: Vec<Fielded>, room: u64) -> Option<Fielded> {
        tried
            .into_iter()
            .filter(|field| field.bytes() <= room)
            .min_by(|a, b| {
                self.excess(accuracy_mm, a)
                    .total_cmp(&self.excess(accuracy_mm, b))
            })
    }

    fn unfinished(&self, accuracy_mm: f64, tried: Vec<Fielded>, room: u64) -> Found {
        match (self.best(accuracy_mm, tried, room), self.ended) {
            (Some(best), Some(end)) => Found::Ended(best, end),
            (best, _) => Found::TooLarge(best),
        }
    }

    /// Largest error over what an accuracy allows, edges included.
    fn excess(&self, accuracy_mm: f64, field: &Fielded) -> f64 {
        let [away, at_edges] = self.excesses(accuracy_mm, field);
        away.max(at_edges)
    }

    /// The same away from edges, for cells of interpolation, which never give the distance at edges.
    fn excess_away(&self, accuracy_mm: f64, field: &Fielded) -> f64 {
        self.excesses(accuracy_mm, field)[0]
    }

    fn excesses(&self, accuracy_mm: f64, field: &Fielded) -> [f64; 2] {
        (self.demand).excess(accuracy_mm, &field.choice, &field.errors, &field.baked.free_form)
    }

    /// The field by this choice and its errors; `None` when the layout cannot hold it, or there is no work left for it.
    fn tried(
        &mut self,
        bench: &Bench<'_>,
        choice: &Choice,
        accuracy_mm: f64,
    ) -> Result<Option<Fielded>, BakeError> {
        let tolerance_mm = bench.tolerance(accuracy_mm);
        let has_ended = self.ended.is_some();
        let same = |field: &&mut Fielded| {
            let is_as_fine = field.tolerance_mm == tolerance_mm || !field.baked.has_local_patches();
            let may_be_finer = field.is_stopgap && field.baked.finer_bricks == 0;
            field.choice.cell_mm == choice.cell_mm
                && field.choice.format == choice.format
                && (is_as_fine && !may_be_finer || field.is_stopgap && has_ended)
        };
        if let Some(known) = self.known.iter_mut().find(same) {
            known.measure_to(&self.surface, choice.reach_mm());
            return Ok(Some(Fielded {
                choice: choice.clone(),
                ..known.clone()
            }));
        }
        if choice.cell_mm < LEAST_CELL_MM {
            return Ok(None);
        }
        let is_first = self.known.is_empty();
        if !is_first && self.ended.is_some() {
            return Ok(None);
        }
        let (made, tolerance_mm) = if is_first {
            self.first(bench, choice, accuracy_mm)?
        } else {
            (self.within_limit(bench, choice, tolerance_mm)?, tolerance_mm)
        };
        let Some(made) = made else { return Ok(None) };
        let is_stopgap = is_first && self.ended.is_some();
        let bytes = field_bytes(&made.field);
        let mut found = vec![made];
        // Where finer bricks take much, the same field without them may be what fits beside the other shapes.
        if found[0].field.finer_bricks > 0 && bytes > bench.room / LARGE_SHARE {
            found.extend(self.kept_or_made(bench, choice, (tolerance_mm, None), false)?);
            if bytes > bench.room {
                found.remove(0);
            }
        }
        if !is_first && self.surface.work().so_far() > self.limit {
            self.end(End::Work);
            return Ok(None);
        }
        let fields = found.into_iter().map(|made| Fielded {
            choice: choice.clone(),
            tolerance_mm,
            reach_mm: choice.reach_mm(),
            is_stopgap,
            is_mixed: false,
            errors: Arc::new(made.errors),
            baked: Arc::new(made.field),
        });
        let first = self.known.len();
        self.known.extend(fields);
        Ok(self.known.get(first).cloned())
    }

    /// A shape's first field and the tolerance of its patches, mm: with finer bricks if it takes no more than its part of the work; else a stopgap, with
    /// patches and finer bricks for a coarse accuracy; else without finer bricks, whatever the work, so that there is one.
    fn first(
        &mut self,
        bench: &Bench<'_>,
        choice: &Choice,
        accuracy_mm: f64,
    ) -> Result<(Option<KeptField>, f64), BakeError> {
        let mut tolerance_mm = bench.tolerance(accuracy_mm);
        let whole = self.limit;
        self.limit = whole.min((FIRST_PART * self.share as f64) as u64);
        let mut made = self.within_limit(bench, choice, tolerance_mm)?;
        if self.ended.is_some() {
            tolerance_mm = bench.tolerance(STOPGAP * accuracy_mm);
            self.limit += self.stopgap;
            made = self.within_limit(bench, choice, tolerance_mm)?;
        }
        self.limit = whole;
        let fits = |made: &KeptField| field_bytes(&made.field) <= bench.room;
        if !made.as_ref().is_some_and(fits) {
            let plain = self.kept_or_made(bench, choice, (tolerance_mm, None), true)?;
            made = plain.or(made);
        }
        Ok((made, tolerance_mm))
    }

    /// The field with finer bricks, unless it takes more work than there is.
    fn within_limit(
        &mut self,
        bench: &Bench<'_>,
        choice: &Choice,
        tolerance_mm: f64,
    ) -> Result<Option<KeptField>, BakeError> {
        let factors = self.demand.factors();
        let made = self.kept_or_made(bench, choice, (tolerance_mm, Some(&factors)), false)?;
        if self.surface.work().so_far() > self.limit {
            self.end(End::Work);
            return Ok(None);
        }
        Ok(made)
    }

    /// The field with its errors from the cache, or made, if need be `regardless` of work and time; `None` as for [`Self::tried`].
    fn kept_or_made(
        &mut self,
        bench: &Bench<'_>,
        choice: &Choice,
        (tolerance_mm, finer): (f64, Option<&[f64]>),
        regardless: bool,
    ) -> Result<Option<KeptField>, BakeError> {
        let name = field_name(self.name.as_ref(), choice, tolerance_mm, finer);
        let faces = self.surface.shape().faces.len();
        let kept = (name.as_ref())
            .and_then(|name| bench.cache.get(name))
            .and_then(|bytes| KeptField::from_bytes(&bytes, faces));
        if let Some(kept) = kept {
            self.surface.work().add(kept.work);
            if kept.by_winding {
                self.surface.set_sign_by_winding();
            }
            return Ok(Some(kept));
        }
        let made = self.made(bench, choice, (tolerance_mm, finer), regardless)?;
        if let Some((name, bytes)) = name.zip(made.as_ref().and_then(KeptField::to_bytes)) {
            bench.cache.put(&name, &bytes);
        }
        Ok(made)
    }

    /// Bakes the field and measures its errors; `None` as for [`Self::tried`].
    fn made(
        &mut self,
        bench: &Bench<'_>,
        choice: &Choice,
        (tolerance_mm, finer): (f64, Option<&[f64]>),
        regardless: bool,
    ) -> Result<Option<KeptField>, BakeError> {
        if !regardless && bench.clock.is_over() {
            self.end(End::Time);
            return Ok(None);
        }
        let options = BakeOptions {
            cell_mm: Some(choice.cell_mm),
            band_cells: choice.band_cells,
            format: choice.format,
            patch_tolerance_mm: tolerance_mm,
            ..BakeOptions::default()
        };
        let (work, limit) = (self.surface.work(), self.limit);
        let before = work.so_far();
        let stopped = Mutex::new(None);
        let progress = |progress: Progress| {
            (bench.progress)(progress)?;
            if regardless {
                return ControlFlow::Continue(());
            }
            let end = if work.so_far() > limit {
                End::Work
            } else if bench.clock.is_over() {
                End::Time
            } else {
                return ControlFlow::Continue(());
            };
            if let Ok(mut stopped) = stopped.lock() {
                stopped.get_or_insert(end);
            }
            ControlFlow::Break(())
        };
        let mut cell_mm = choice.cell_mm;
        let baked = bench.scene.field(
            self.number,
            &mut self.surface,
            &mut cell_mm,
            (&options, finer),
            &progress,
        );
        let field = match baked {
            Err(BakeError::CellTooSmall { .. }) => return Ok(None),
            Err(BakeError::Cancelled) => {
                let Some(end) = stopped.lock().ok().and_then(|end| *end) else {
                    return Err(BakeError::Cancelled);
                };
                self.end(end);
                return Ok(None);
            }
            done => done?,
        };
        let errors = field_errors(&self.surface, &field, choice.reach_mm());
        Ok(Some(KeptField {
            errors,
            work: work.so_far() - before,
            field,
            by_winding: self.surface.sign_by_winding(),
        }))
    }
}

/// Whether a field with this cell takes more than `room` bytes, to judge by the field of a larger one.
fn is_hopeless(coarser: Option<&Fielded>, cell_mm: f64, room: u64) -> bool {
    let bytes = |field: &Fielded| field.bytes() as f64 * (field.choice.cell_mm / cell_mm).powf(LEAST_GROWTH);
    coarser.is_some_and(|field| bytes(field) > room as f64)
}
