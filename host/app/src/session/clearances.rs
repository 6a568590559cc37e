//! The list of gaps and clashes between the parts where they are now: searched on request, beside the window's thread.

use std::sync::mpsc::{Receiver, TryRecvError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};

use glam::{DAffine3, DVec3};
use mortise_brep::CadModel;
use mortise_inspect::{Solid, TOUCH_MM, clearances};
use mortise_task::Placed;

use super::document::Document;
use super::threads::spawn;

/// Two near parts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Near {
    /// Indices of the parts, the lower one first.
    pub parts: [usize; 2],
    /// Gap, or minus the deepest overlap, mm.
    pub distance_mm: f64,
    /// Where, mm.
    pub place: DVec3,
}

impl Near {
    /// Whether the parts overlap.
    pub fn clashes(&self) -> bool {
        self.distance_mm < -TOUCH_MM
    }

    /// The gap or overlap in words.
    pub fn words(&self) -> String {
        words(self.distance_mm)
    }
}

/// A signed distance of two parts in words.
pub fn words(distance_mm: f64) -> String {
    let um = 1e3 * distance_mm;
    if distance_mm < -TOUCH_MM {
        format!("overlap {:.1} µm", -um)
    } else if distance_mm <= TOUCH_MM {
        "touching".to_owned()
    } else {
        format!("gap {um:.1} µm")
    }
}

/// What a search found.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// Number of the document.
    pub generation: u64,
    /// Poses at which the parts were, mm.
    pub poses: Vec<DAffine3>,
    /// Largest gap listed, mm.
    pub within_mm: f64,
    /// The pairs, deepest overlap first, then by gap.
    pub pairs: Vec<Near>,
}

/// Solids with samples, by shape, of one document.
#[derive(Default)]
struct Kept {
    generation: Option<u64>,
    solids: Vec<Option<Solid>>,
}

/// Searches on request.
#[derive(Default)]
pub struct Search {
    running: Option<Receiver<Found>>,
    found: Option<Found>,
    failed: bool,
    /// The samples of a document, which take most of the time, are kept for the next search.
    kept: Arc<Mutex<Kept>>,
}

impl Search {
    /// Starts a search for pairs closer than `within_mm`, unless one is under way. `wake` is called when it is finished.
    pub fn start(&mut self, document: &Document, within_mm: f64, wake: Arc<dyn Fn() + Send + Sync>) {
        if self.is_busy() {
            return;
        }
        let (outbox, inbox) = sync_channel(1);
        let kept = Arc::clone(&self.kept);
        let (model, poses, generation) = (
            Arc::clone(&document.model),
            document.poses.clone(),
            document.generation,
        );
        (self.running, self.failed) = (Some(inbox), false);
        spawn("mortise-clearances", move || {
            let found = {
                let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
                search(&mut kept, &model, poses, generation, within_mm)
            };
            // The window may have been closed.
            _ = outbox.send(found);
            wake();
        });
    }

    /// Takes in a finished search. Call it before each frame.
    pub fn poll(&mut self) {
        let Some(running) = &self.running else { return };
        match running.try_recv() {
            Ok(found) => (self.running, self.found) = (None, Some(found)),
            Err(TryRecvError::Empty) => {}
            Err(TryRecvError::Disconnected) => (self.running, self.failed) = (None, true),
        }
    }

    /// Whether a search is under way.
    pub fn is_busy(&self) -> bool {
        self.running.is_some()
    }

    /// Whether the last search ended without a result.
    pub fn has_failed(&self) -> bool {
        self.failed
    }

    /// What was found in this document.
    pub fn found(&self, document: &Document) -> Option<&Found> {
        self.found
            .as_ref()
            .filter(|found| found.generation == document.generation)
    }

    /// Whether parts have moved since the search.
    pub fn is_outdated(&self, document: &Document) -> bool {
        self.found(document)
            .is_some_and(|found| found.poses != document.poses)
    }
}

fn search(kept: &mut Kept, model: &CadModel, poses: Vec<DAffine3>, generation: u64, within_mm: f64) -> Found {
    if kept.generation != Some(generation) {
        kept.solids = model.shapes.iter().map(Solid::sampled).collect();
        kept.generation = Some(generation);
    }
    // Parts without triangles are near to nothing.
    let (parts, placed): (Vec<usize>, Vec<Placed<'_>>) = (model.parts.iter().zip(&poses).enumerate())
        .filter_map(|(index, (part, &pose))| {
            let body = kept.solids.get(part.shape)?.as_ref()?.body()?;
            Some((index, Placed { body, pose }))
        })
        .unzip();
    let pairs = (clearances(&placed, within_mm).iter())
        .map(|pair| Near {
            parts: pair.parts.map(|part| parts[part]),
            distance_mm: pair.least.distance_mm,
            place: pair.least.point,
        })
        .collect();
    Found {
        generation,
        poses,
        within_mm,
        pairs,
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;
    use std::time::{Duration, Instant};

    use super::*;

    fn wait(search: &mut Search) {
        let begun = Instant::now();
        while search.is_busy() && begun.elapsed().as_secs() < 120 {
            search.poll();
            std::thread::sleep(Duration::from_millis(5));
        }
        assert!(!search.is_busy() && !search.has_failed());
    }

    /// The sample's peg of 17.75 mm, moved into its bore of 18.75 mm: a gap of half a millimetre; 0.75 mm aside an overlap of 0.25 mm.
    #[test]
    fn the_peg_s_gap_and_overlap_are_those_of_its_diameters() {
        let mut document = Document::sample(4, &|_| ControlFlow::Continue(())).expect("the sample");
        let mut search = Search::default();
        // The peg begins 20 mm above the block, which is 40 mm high.
        document.poses[1].translation.z -= 55.0;
        for (aside, want) in [(0.0, 0.5), (0.75, -0.25)] {
            document.poses[1].translation.x = document.model.parts[1].placement.translation.x + aside;
            search.start(&document, 1.0, Arc::new(|| {}));
            wait(&mut search);
            let found = search.found(&document).expect("found");
            let [pair] = found.pairs.as_slice() else {
                panic!("{found:?}")
            };
            assert!((pair.distance_mm - want).abs() < 1e-3, "{pair:?}");
            assert_eq!(pair.clashes(), want < 0.0);
            assert!(!search.is_outdated(&document));
        }
        document.poses[1].translation.x += 1.0;
        assert!(search.is_outdated(&document));
    }

    #[test]
    fn words_name_what_is_the_case() {
        let near = |distance_mm| Near {
            parts: [0, 1],
            distance_mm,
            place: DVec3::ZERO,
        };
        assert_eq!(near(0.0123).words(), "gap 12.3 µm");
        assert_eq!(near(-0.25).words(), "overlap 250.0 µm");
        assert_eq!(near(5e-5).words(), "touching");
    }
}
