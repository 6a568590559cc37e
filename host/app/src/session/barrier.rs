//! Where a part that is dragged meets another one: computed beside the window's thread, one stretch of the drag at a time.
//!
//! A stretch is the motion from where the part is to where the pointer has it: its middle goes on a straight line while the part turns about one axis. It ends at
//! the first place at which a sample of either surface would be deeper in the other part than [`ALLOWED_MM`], or than it was before the drag where parts
//! overlap already ([`mortise_task::free_share`]: exact distances, samples in contact checked every [`STEP_MM`]). Poses are mm.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, sync_channel};

use glam::{DAffine3, DVec3};
use mortise_brep::CadModel;
use mortise_task::{Body, Limits, Motion, Placed, free_share, gap};

use super::pose::rigid;
use crate::display::extent::Extent;

/// Overlap that counts as contact, mm: as for instructions in words.
const ALLOWED_MM: f64 = 2e-3;
/// Travel between two checks of a sample that stays in contact, mm.
const STEP_MM: f64 = 0.25;
/// Halvings of a stretch up to contact: a metre to 4 nm.
const HALVINGS: u32 = 28;

/// A stretch of a drag.
#[derive(Clone, Debug)]
pub struct Stretch {
    /// Number of the drag.
    pub drag: u64,
    /// Its parts and shapes.
    pub model: Arc<CadModel>,
    /// Bounding spheres of the shapes.
    pub extents: Vec<Extent>,
    /// Where the parts are.
    pub poses: Vec<DAffine3>,
    /// The part that moves.
    pub part: usize,
    /// Where the pointer has it.
    pub to: DAffine3,
}

/// How far a part has come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reached {
    /// Number of the drag.
    pub drag: u64,
    /// Where the part is.
    pub pose: DAffine3,
    /// The part that stops it there.
    pub stopped_by: Option<usize>,
}

struct Link {
    requests: SyncSender<Stretch>,
    found: Receiver<Reached>,
}

/// The near end of the thread. The thread starts with the first stretch and ends with this.
#[derive(Default)]
pub struct Barrier {
    link: Option<Link>,
    busy: bool,
}

impl Barrier {
    /// Whether a stretch is being computed.
    pub fn is_busy(&self) -> bool {
        self.busy
    }

    /// Sends a stretch, unless one is being computed. `wake` is called by the thread when it is done.
    pub fn ask(&mut self, stretch: Stretch, wake: impl FnOnce() -> Arc<dyn Fn() + Send + Sync>) {
        if self.busy {
            return;
        }
        if self.link.is_none() {
            self.link = start(wake());
        }
        self.busy = (self.link.as_ref()).is_some_and(|link| link.requests.try_send(stretch).is_ok());
    }

    /// Takes in how far the part has come.
    pub fn poll(&mut self) -> Option<Reached> {
        let result = self.link.as_ref()?.found.try_recv();
        match result {
            Ok(reached) => {
                self.busy = false;
                Some(reached)
            }
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => {
                // Begun anew with the next stretch.
                (self.link, self.busy) = (None, false);
                None
            }
        }
    }
}

fn start(wake: Arc<dyn Fn() + Send + Sync>) -> Option<Link> {
    let (requests, inbox) = sync_channel::<Stretch>(1);
    let (outbox, found) = sync_channel(1);
    let work = move || {
        let mut known = Known::default();
        for stretch in inbox {
            if outbox.send(known.reached(&stretch)).is_err() {
                return;
            }
            wake();
        }
    };
    let thread = std::thread::Builder::new().name("mortise-drag".to_owned());
    thread.spawn(work).ok()?;
    Some(Link { requests, found })
}

/// Samples of the shapes met so far, and overlaps before the drag.
#[derive(Default)]
struct Known {
    model: Option<Arc<CadModel>>,
    bodies: BTreeMap<usize, Option<Body>>,
    drag: u64,
    /// Overlap with another part when the drag first came near it, mm.
    overlaps: BTreeMap<usize, f64>,
}

impl Known {
    fn reached(&mut self, stretch: &Stretch) -> Reached {
        let is_known = |model: &Arc<CadModel>| Arc::ptr_eq(model, &stretch.model);
        if !self.model.as_ref().is_some_and(is_known) {
            self.bodies.clear();
            self.model = Some(Arc::clone(&stretch.model));
        }
        if std::mem::replace(&mut self.drag, stretch.drag) != stretch.drag {
            self.overlaps.clear();
        }
        let from = stretch.poses[stretch.part];
        let (center, near) = near(stretch);
        let motion = Motion::between(&from, &stretch.to, center);
        let shape = |part: usize| stretch.model.parts[part].shape;
        for part in near.iter().copied().chain([stretch.part]) {
            let mesh = stretch.model.shapes.get(shape(part));
            self.bodies
                .entry(shape(part))
                .or_insert_with(|| mesh.and_then(Body::new));
        }
        let placed = |part: usize| {
            let body = self.bodies.get(&shape(part))?.as_ref()?;
            let pose = stretch.poses[part];
            Some(Placed { body, pose })
        };
        let (mut share, mut stopped_by) = (1.0, None);
        for other in near {
            let (Some(a), Some(b)) = (placed(stretch.part), placed(other)) else {
                continue;
            };
            let before = *(self.overlaps.entry(other))
                .or_insert_with(|| gap(a, b, 0.0).map_or(0.0, |gap| -gap.distance_mm));
            let limits = Limits {
                allow_mm: ALLOWED_MM.max(before + ALLOWED_MM),
                step_mm: STEP_MM,
                coarse: false,
            };
            let way = motion.until(share);
            let free = clear_share(a, b, &way, &limits);
            if free < 1.0 {
                share *= free;
                stopped_by = Some(other);
            }
        }
        let pose = match stopped_by {
            None => stretch.to,
            Some(_) => rigid(&(motion.at(share) * from)),
        };
        Reached {
            drag: stretch.drag,
            pose,
            stopped_by,
        }
    }
}

/// Share of a motion of `a`, 0 to 1, at whose end no sample is deeper than allowed: before the first contact that [`free_share`] finds, whose steps are too
/// long for the depth there, by halving.
fn clear_share(a: Placed<'_>, b: Placed<'_>, motion: &Motion, limits: &Limits) -> f64 {
    let is_clear = |share: f64| {
        let pose = motion.at(share) * a.pose;
        let depth = gap(Placed { body: a.body, pose }, b, 0.0).map_or(0.0, |gap| -gap.distance_mm);
        depth <= limits.allow_mm
    };
    let free = free_share(a, b, motion, limits);
    if is_clear(free) {
        return free;
    }
    let (mut clear, mut deep) = (0.0, free);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (clear + deep);
        *(if is_clear(middle) { &mut clear } else { &mut deep }) = middle;
    }
    clear
}

/// The middle of the part where it is, and the parts whose bounding spheres the part's one meets on its way.
fn near(stretch: &Stretch) -> (DVec3, Vec<usize>) {
    let sphere = |part: usize| {
        let shape = stretch.model.parts[part].shape;
        stretch.extents.get(shape).copied().unwrap_or_default()
    };
    let own = sphere(stretch.part);
    let from = stretch.poses[stretch.part].transform_point3(own.center);
    let along = stretch.to.transform_point3(own.center) - from;
    let met = (0..stretch.poses.len()).filter(|&other| {
        let sphere = sphere(other);
        let to = stretch.poses[other].transform_point3(sphere.center) - from;
        let t = (to.dot(along) / along.length_squared().max(1e-12)).clamp(0.0, 1.0);
        other != stretch.part && to.distance(t * along) <= own.radius + sphere.radius
    });
    (from, met.collect())
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::*;
    use crate::session::document::Document;

    /// The sample's peg of 17.75 mm stands 20 mm above the block, over its bore of 18.75 mm.
    #[test]
    fn a_part_stops_where_it_meets_another() {
        let document = Document::sample(1, &|_| ControlFlow::Continue(())).expect("the sample");
        let mut known = Known::default();
        let mut reached = |poses: &[DAffine3], by: DVec3| {
            let mut to = poses[1];
            to.translation += by;
            let stretch = Stretch {
                drag: 1,
                model: Arc::clone(&document.model),
                extents: document.extents.clone(),
                poses: poses.to_vec(),
                part: 1,
                to,
            };
            let found = known.reached(&stretch);
            (found.pose.translation - poses[1].translation, found.stopped_by)
        };
        let start = document.poses.clone();
        // Into the bore, which is free.
        let (by, stopped) = reached(&start, -55.0 * DVec3::Z);
        assert!(
            (by + 55.0 * DVec3::Z).length() < 1e-9 && stopped.is_none(),
            "{by}"
        );
        let mut inside = start.clone();
        inside[1].translation += by;
        // To the wall of the bore: half a millimetre.
        let (by, stopped) = reached(&inside, 8.0 * DVec3::X);
        assert!(
            (by.x - 0.5).abs() < 0.02 && by.y == 0.0 && stopped == Some(0),
            "{by}"
        );
        // And away from it again.
        let mut touching = inside.clone();
        touching[1].translation += by;
        let (by, stopped) = reached(&touching, -0.4 * DVec3::X);
        assert!((by.x + 0.4).abs() < 1e-9 && stopped.is_none(), "{by}");
        // Beside the bore it stops on the block.
        let mut beside = start;
        beside[1].translation.x += 15.0;
        let (by, stopped) = reached(&beside, -40.0 * DVec3::Z);
        assert!((by.z + 20.0).abs() < 2.1e-3 && stopped == Some(0), "{by}");
    }
}
