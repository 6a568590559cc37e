//! Computing a recorded run again: its recorded readings and messages pass through the force law once more by the simulation, and every tick is compared bit by
//! bit, with the parameters as they were or with another value of one.

use std::ops::ControlFlow;
use std::path::Path;

use mortise_record::{RecordError, Recording, Replayed, replay_with};

use super::notes::Severity;
use super::outbox::Update;
use super::recomputed::{Recomputation, RecomputeUpdate, Recomputed, Recomputing};
use super::state::Session;
use super::threads::{Cancel, spawn};

impl Session {
    /// Computes a run again on a thread of its own.
    pub(super) fn recompute(&mut self, run: usize, what: Recomputing) {
        let Some(shown) = self.playback.as_mut().and_then(|p| p.shown_mut(run)) else {
            return;
        };
        let (path, cancel, outbox) = (shown.run.path.clone(), Cancel::default(), self.outbox.clone());
        shown.recomputation = Some(Recomputation {
            what,
            done: 0.0,
            cancel: cancel.clone(),
        });
        spawn("mortise-recompute", move || {
            let progress = |share: f64| {
                outbox.offer(Update::Recompute(cancel.clone(), RecomputeUpdate::Done(share)));
                match cancel.is_set() {
                    true => ControlFlow::Break(()),
                    false => ControlFlow::Continue(()),
                }
            };
            if let Some(ended) = computed_again(&path, what, &progress) {
                outbox.send(Update::Recompute(cancel, RecomputeUpdate::Ended(ended)));
            }
        });
    }

    /// Ends every computation under way.
    pub(super) fn cancel_recompute(&mut self) {
        for shown in self.playback.iter_mut().flat_map(|p| p.all_mut()) {
            shown.recomputation = None;
        }
    }

    /// Takes a report in of the computation that this flag ends; one that was cancelled is not known any more.
    pub(super) fn recompute_update(&mut self, of: &Cancel, update: RecomputeUpdate) {
        let all = self.playback.iter_mut().flat_map(|p| p.all_mut());
        for shown in all {
            let under_way = shown.recomputation.as_mut();
            let Some(under_way) = under_way.filter(|under_way| under_way.cancel.is(of)) else {
                continue;
            };
            let what = under_way.what;
            match update {
                RecomputeUpdate::Done(share) => under_way.done = share,
                RecomputeUpdate::Ended(ended) => {
                    shown.recomputation = None;
                    match ended {
                        Ok(replayed) => {
                            shown.recomputed =
                                Some(Recomputed::new(replayed, what, |tick| shown.run.time_of(tick)));
                        }
                        Err(why) => self.notes.add(Severity::Error, why),
                    }
                }
            }
            return;
        }
    }
}

/// The result, or `None` when it was cancelled.
fn computed_again(
    path: &Path,
    what: Recomputing,
    progress: &dyn Fn(f64) -> ControlFlow<()>,
) -> Option<Result<Replayed, String>> {
    let changes: Vec<_> = what.into_iter().collect();
    let replayed = Recording::open(path).and_then(|recording| replay_with(&recording, &changes, progress));
    match replayed {
        Err(RecordError::Cancelled) => None,
        result => Some(result.map_err(|error| error.to_string())),
    }
}
