//! Work outside the window's thread: reading, baking, listing rigs. Each job has its own thread and reports by messages.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::Instant;

use mortise_bake::{
    BakeError, BakeOptions, BakeReport, Baked, Cache, NoCache, Planned, Progress, Request, Stage,
    bake as bake_as_described, plan_with,
};
use mortise_brep::CadModel;

use super::document::Document;
use super::grouped::Grouped;
use super::outbox::{CollisionModel, Imported, Outbox, Update};
use super::saved::Saved;
use super::threads::{Cancel, spawn};
use crate::folder_cache::FolderCache;
use crate::kept::StateFolder;

/// What a bake is to give.
#[derive(Clone, Debug)]
pub enum Wanted {
    /// The model that a plan chooses for a request.
    Planned(Request),
    /// A model as described.
    Described(BakeOptions),
}

/// Sends the progress of a job, which it ends when it is cancelled.
struct Reports<'a> {
    outbox: &'a Outbox,
    generation: u64,
    cancel: &'a Cancel,
    /// Time and fraction of the last report.
    last: Mutex<(Instant, f32)>,
}

impl<'a> Reports<'a> {
    fn new(outbox: &'a Outbox, generation: u64, cancel: &'a Cancel) -> Self {
        Self {
            outbox,
            generation,
            cancel,
            last: Mutex::new((Instant::now(), 0.0)),
        }
    }

    /// At most some thirty reports a second are sent: a job may produce thousands.
    fn send(&self, fraction: f32, doing: impl FnOnce() -> Option<String>) -> ControlFlow<()> {
        if self.cancel.is_set() {
            return ControlFlow::Break(());
        }
        if let Ok(mut last) = self.last.try_lock()
            && last.0.elapsed().as_millis() > 30
        {
            let fraction = fraction.max(last.1);
            *last = (Instant::now(), fraction);
            self.outbox.offer(Update::Working {
                generation: self.generation,
                doing: doing(),
                fraction,
            });
        }
        ControlFlow::Continue(())
    }
}

/// Reads a file (`None`: the sample), and what saved itself for it in `folder`. When cancelled, the reading process ends without a report.
pub fn import(
    outbox: &Outbox,
    path: Option<PathBuf>,
    generation: u64,
    folder: Option<StateFolder>,
    cancel: Cancel,
) {
    let outbox = outbox.clone();
    spawn("mortise-import", move || {
        let reports = Reports::new(&outbox, generation, &cancel);
        let progress = |fraction: f64| reports.send(fraction as f32, || None);
        let read = match &path {
            Some(path) => Document::read(path, generation, &progress),
            None => Document::sample(generation, &progress),
        };
        if cancel.is_set() {
            return;
        }
        let imported = read.map(|document| {
            let saved = folder.as_ref().map(|folder| Saved::of(folder, &document));
            let saved = saved.unwrap_or(Saved::None);
            Box::new(Imported { document, saved })
        });
        let result = imported.map_err(|error| format!("{error:#}"));
        outbox.send(Update::Imported { generation, result });
    });
}

/// Bakes a model, each group as one part; `cache` has and keeps results of other bakes.
pub fn bake(
    outbox: &Outbox,
    grouped: Arc<Grouped>,
    generation: u64,
    wanted: Wanted,
    cache: Option<Arc<FolderCache>>,
    cancel: Cancel,
) {
    let outbox = outbox.clone();
    spawn("mortise-bake", move || {
        let reports = Reports::new(&outbox, generation, &cancel);
        let progress = |progress: Progress| reports.send(overall(&progress), || Some(doing(&progress)));
        let (model, numbers) = grouped.bodies();
        let result = match collision_model(&model, &numbers, &wanted, cache.as_deref(), &progress) {
            Err(BakeError::Cancelled) => return,
            Err(error) => Err(error.to_string()),
            Ok(result) => result,
        };
        outbox.send(Update::Baked {
            generation,
            of: grouped,
            result,
        });
    });
}

/// The model wanted, or one line with the reason why none fits. Its report has the `numbers` of the parts in place of those in `model`.
fn collision_model(
    model: &CadModel,
    numbers: &[usize],
    wanted: &Wanted,
    cache: Option<&FolderCache>,
    progress: &(dyn Fn(Progress<'_>) -> ControlFlow<()> + Sync),
) -> Result<Result<CollisionModel, String>, BakeError> {
    let of_document = |mut report: BakeReport| {
        for part in &mut report.parts {
            part.model_part = numbers[part.model_part];
        }
        report
    };
    let request = match wanted {
        Wanted::Described(options) => {
            let Baked { image, report } = bake_as_described(model, options, progress)?;
            let report = of_document(report);
            return Ok(Ok(CollisionModel {
                baked: Arc::new(Baked { image, report }),
                reached: None,
            }));
        }
        Wanted::Planned(request) => request,
    };
    let kept: &dyn Cache = cache.map_or(&NoCache, |cache| cache);
    let planned = plan_with(model, request, kept, progress)?;
    let reached = planned.reached(request);
    if !planned.fits {
        return Ok(Err(reached));
    }
    let Planned { plan, image, .. } = planned;
    let mut report = of_document(plan.report);
    report
        .warnings
        .extend(cache.iter().flat_map(|cache| cache.finish()));
    Ok(Ok(CollisionModel {
        baked: Arc::new(Baked { image, report }),
        reached: Some(reached),
    }))
}

/// Progress over all stages, 0 to 1: the pointshell has a small share, the field nearly all of the rest.
fn overall(progress: &Progress<'_>) -> f32 {
    let (index, count) = progress.shape;
    let share = (index as f64 + progress.fraction) / count.max(1) as f64;
    let all = match progress.stage {
        Stage::Pointshell => 0.15 * share,
        Stage::Field => 0.15 + 0.83 * share,
        Stage::Image => 1.0,
    };
    all.clamp(0.0, 1.0) as f32
}

fn doing(progress: &Progress<'_>) -> String {
    match progress.stage {
        Stage::Pointshell => format!("Sampling the surface of {}", progress.part),
        Stage::Field => format!("Measuring distances around {}", progress.part),
        Stage::Image => "Assembling the collision model".to_owned(),
    }
}

/// Lists the available rigs.
pub fn list_rigs(outbox: &Outbox) {
    let outbox = outbox.clone();
    spawn("mortise-rigs", move || {
        outbox.send(Update::Rigs(mortise_rig::list()));
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cancelled_bake_ends_without_a_report() {
        let document = Document::sample(1, &|_| ControlFlow::Continue(())).expect("the sample");
        for (cancelled, reports) in [(true, 0), (false, 1)] {
            let (outbox, updates) = Outbox::new(Arc::new(|| {}));
            let cancel = Cancel::default();
            if cancelled {
                cancel.set();
            }
            let wanted = Wanted::Described(BakeOptions {
                cell_mm: Some(4.0),
                ..BakeOptions::default()
            });
            bake(&outbox, Arc::clone(&document.grouped), 1, wanted, None, cancel);
            drop(outbox);
            let baked = updates
                .iter()
                .filter(|update| matches!(update, Update::Baked { .. }));
            assert_eq!(baked.count(), reports);
        }
    }

    #[test]
    fn a_bake_reports_rising_progress() {
        let document = Document::sample(1, &|_| ControlFlow::Continue(())).expect("the sample");
        let (outbox, updates) = Outbox::new(Arc::new(|| {}));
        let wanted = Wanted::Described(BakeOptions {
            cell_mm: Some(1.0),
            ..BakeOptions::default()
        });
        bake(
            &outbox,
            Arc::clone(&document.grouped),
            1,
            wanted,
            None,
            Cancel::default(),
        );
        drop(outbox);
        let reported: Vec<f32> = (updates.iter())
            .filter_map(|update| match update {
                Update::Working { fraction, .. } => Some(fraction),
                _ => None,
            })
            .collect();
        assert!(reported.is_sorted(), "{reported:?}");
        assert!(reported.iter().any(|&f| f > 0.15 && f < 1.0), "{reported:?}");
    }
}
