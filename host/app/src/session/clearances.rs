//! The list of gaps and clashes between the parts where they are now: searched on request, beside the window's thread.

use std::collections::HashMap;
use std::sync::mpsc::{Receiver, TryRecvError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};

use glam::{DAffine3, DVec3};
use mortise_brep::CadModel;
use mortise_inspect::{Solid, TOUCH_MM, clearances};
use mortise_task::Placed;

use super::document::Document;
use super::threads::spawn;

/// What is said of a search that [`Search::has_failed`].
pub const FAILED: &str = "The search ended without a result";

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

impl Found {
    /// The pairs whose parts can move against one another: not those of one group.
    pub fn loose<'a>(&'a self, document: &'a Document) -> impl Iterator<Item = &'a Near> {
        let groups = document.groups();
        let is_loose = |pair: &&Near| groups.first(pair.parts[0]) != groups.first(pair.parts[1]);
        self.pairs.iter().filter(is_loose)
    }
}

/// Solids with samples, by shape, of one document.
#[derive(Default)]
struct Kept {
    generation: Option<u64>,
    solids: HashMap<usize, Option<Solid>>,
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
        let all = (0..document.model.parts.len()).collect();
        self.begin(document, all, within_mm, wake);
    }

    /// Starts a search for the least gap of two parts, however far apart, unless one is under way.
    pub fn between(&mut self, document: &Document, parts: [usize; 2], wake: Arc<dyn Fn() + Send + Sync>) {
        let spheres = parts.map(|part| {
            let shape = document.model.parts.get(part).map(|part| part.shape);
            let extent = shape.and_then(|shape| document.extents.get(shape)).copied();
            let (extent, pose) = (extent.unwrap_or_default(), document.poses.get(part));
            (
                pose.map_or(DVec3::ZERO, |pose| pose.transform_point3(extent.center)),
                extent.radius,
            )
        });
        // Each sphere is about its part's surface and touches it somewhere.
        let [(c, r), (d, s)] = spheres;
        let within = c.distance(d) + r + s + 1.0;
        let only = Vec::from([parts[0].min(parts[1]), parts[0].max(parts[1])]);
        self.begin(document, only, within, wake);
    }

    fn begin(
        &mut self,
        document: &Document,
        only: Vec<usize>,
        within_mm: f64,
        wake: Arc<dyn Fn() + Send + Sync>,
    ) {
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
                kept.of(generation);
                search(&mut kept, &model, &only, poses, within_mm)
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

impl Kept {
    /// Forgets the solids of another document than that of `generation`.
    fn of(&mut self, generation: u64) {
        if self.generation.replace(generation) != Some(generation) {
            self.solids.clear();
        }
    }
}

/// Searches among the parts `only`; those of one shape share its samples.
fn search(kept: &mut Kept, model: &CadModel, only: &[usize], poses: Vec<DAffine3>, within_mm: f64) -> Found {
    let shape_of = |part: usize| model.parts.get(part).map(|part| part.shape);
    for shape in only.iter().filter_map(|&part| shape_of(part)) {
        let solids = kept.solids.entry(shape);
        solids.or_insert_with(|| model.shapes.get(shape).and_then(Solid::sampled));
    }
    // Parts without triangles are near to nothing.
    let (parts, placed): (Vec<usize>, Vec<Placed<'_>>) = (only.iter())
        .filter_map(|&part| {
            let body = kept.solids.get(&shape_of(part)?)?.as_ref()?.body()?;
            let pose = *poses.get(part)?;
            Some((part, Placed { body, pose }))
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
        generation: kept.generation.unwrap_or_default(),
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
    use crate::session::groups::{Group, Groups};

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

    #[test]
    fn parts_of_one_group_are_no_pair() {
        let sample = Document::sample(1, &|_| ControlFlow::Continue(())).expect("the sample");
        let mut model = CadModel::clone(&sample.model);
        model.parts.push(model.parts[1].clone());
        let mut document = Document::of(model, None, "pegs".into(), 1);
        let near = |parts| Near {
            parts,
            distance_mm: 0.1,
            place: DVec3::ZERO,
        };
        let found = Found {
            generation: 1,
            poses: document.poses.clone(),
            within_mm: 1.0,
            pairs: [[0, 1], [0, 2], [1, 2]].map(near).to_vec(),
        };
        assert_eq!(found.loose(&document).count(), 3);
        let poses = document.poses.clone();
        let group = Group::new("pegs".into(), vec![1, 2], &poses, &poses).expect("two parts");
        document.regroup(Groups::default().with(group));
        let pairs: Vec<[usize; 2]> = found.loose(&document).map(|pair| pair.parts).collect();
        assert_eq!(pairs, [[0, 1], [0, 2]]);
    }
}
