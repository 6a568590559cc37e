//! The thread that cuts: one request at a time, the newest one next, at most some times a second.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use glam::DAffine3;
use mortise_brep::CadModel;
use mortise_inspect::CutPlane;

use super::areas::{Cut, Cutter};
use super::gaps::Following;

/// Least time between the starts of two cuts: parts in motion are cut ten times a second.
const EVERY: Duration = Duration::from_millis(100);

/// What is to be cut.
#[derive(Clone, Debug)]
pub struct Wanted {
    /// Number of the document.
    pub generation: u64,
    /// Its parts and shapes.
    pub model: Arc<CadModel>,
    /// Pose of each part, mm.
    pub poses: Vec<DAffine3>,
    /// The plane.
    pub plane: CutPlane,
    /// Largest distance of an area's border from the exact curve, mm.
    pub sag_mm: f64,
    /// How gaps are to be followed along the borders, once nothing moves.
    pub gaps: Option<Following>,
}

impl Wanted {
    fn is(&self, other: &Self) -> bool {
        self.generation == other.generation && self.plane == other.plane && self.poses == other.poses
    }
}

struct Link {
    requests: SyncSender<Wanted>,
    cuts: Receiver<Arc<Cut>>,
}

/// The near end of the thread. The thread starts with the first request and ends with this.
#[derive(Default)]
pub struct Slicer {
    link: Option<Link>,
    /// The last request, and when it was sent.
    asked: Option<(Wanted, Instant)>,
    busy: bool,
    failed: bool,
    cut: Option<Arc<Cut>>,
}

impl Slicer {
    /// Takes in a finished cut and sends the next request, as far as it is time. `None`: nothing is to be cut. `wake` is called by the thread whenever a cut is
    /// finished. Returns the time after which this is to be called again, if any.
    pub fn follow(
        &mut self,
        wanted: Option<Wanted>,
        wake: impl FnOnce() -> Arc<dyn Fn() + Send + Sync>,
    ) -> Option<Duration> {
        self.take_in();
        let Some(wanted) = wanted else {
            (self.cut, self.asked) = (None, None);
            return None;
        };
        if self
            .cut
            .as_ref()
            .is_some_and(|cut| cut.generation != wanted.generation)
        {
            self.cut = None;
        }
        if self.failed || self.busy {
            return None;
        }
        let mut wanted = wanted;
        if let Some((asked, at)) = &self.asked {
            let at_rest = asked.is(&wanted);
            if at_rest && asked.gaps == wanted.gaps {
                return None;
            }
            if !at_rest {
                wanted.gaps = None;
            }
            let left = EVERY.saturating_sub(at.elapsed());
            if !left.is_zero() {
                return Some(left);
            }
        }
        if self.asked.is_none() {
            wanted.gaps = None;
        }
        if self.link.is_none() {
            self.link = start(wake());
        }
        let sent = (self.link.as_ref()).is_some_and(|link| link.requests.try_send(wanted.clone()).is_ok());
        (self.busy, self.failed) = (sent, !sent);
        self.asked = Some((wanted, Instant::now()));
        None
    }

    fn take_in(&mut self) {
        let Some(link) = &self.link else { return };
        match link.cuts.try_recv() {
            Ok(cut) => {
                self.busy = false;
                // What was switched off meanwhile is not shown.
                self.cut = self.asked.is_some().then_some(cut);
            }
            Err(TryRecvError::Empty) => {}
            Err(TryRecvError::Disconnected) => (self.busy, self.failed) = (false, true),
        }
    }

    /// The cut last computed.
    pub fn cut(&self) -> Option<&Arc<Cut>> {
        self.cut.as_ref()
    }

    /// Whether a cut is being computed.
    pub fn is_busy(&self) -> bool {
        self.busy
    }

    /// Whether no cut can be computed: the thread could not start, or ended.
    pub fn has_failed(&self) -> bool {
        self.failed
    }
}

fn start(wake: Arc<dyn Fn() + Send + Sync>) -> Option<Link> {
    let (requests, inbox) = sync_channel::<Wanted>(1);
    let (outbox, cuts) = sync_channel(1);
    let work = move || {
        let mut cutter = Cutter::default();
        for wanted in inbox {
            let Wanted {
                generation,
                model,
                poses,
                plane,
                sag_mm,
                gaps,
            } = wanted;
            let mut cut = cutter.cut(generation, &model, &poses, plane, sag_mm);
            cut.gaps = gaps.map(|how| cutter.gaps(&cut, &model, &poses, how));
            if outbox.send(Arc::new(cut)).is_err() {
                return;
            }
            wake();
        }
    };
    let started = thread::Builder::new()
        .name("mortise-section".to_owned())
        .spawn(work);
    started.is_ok().then_some(Link { requests, cuts })
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use glam::DVec3;

    use super::*;
    use crate::session::document::Document;

    #[test]
    fn the_newest_request_is_cut_and_no_call_waits() {
        let document = Document::sample(3, &|_| ControlFlow::Continue(())).expect("the sample");
        let wanted = |y: f64| {
            Some(Wanted {
                generation: 3,
                model: Arc::clone(&document.model),
                poses: document.poses.clone(),
                plane: CutPlane::new(DVec3::Y * y, DVec3::Y).expect("a plane"),
                sag_mm: 0.01,
                gaps: None,
            })
        };
        let mut slicer = Slicer::default();
        let silent = || -> Arc<dyn Fn() + Send + Sync> { Arc::new(|| {}) };
        slicer.follow(wanted(0.0), silent);
        assert!(slicer.is_busy() && slicer.cut().is_none());
        let patience = Instant::now();
        let origin = |slicer: &Slicer| slicer.cut().map(|cut| cut.plane.origin.y);
        while origin(&slicer) != Some(2.0) && patience.elapsed().as_secs() < 60 {
            slicer.follow(wanted(2.0), silent);
            thread::sleep(Duration::from_millis(5));
        }
        assert_eq!(origin(&slicer), Some(2.0));
        assert!(!slicer.has_failed());
        slicer.follow(None, silent);
        assert!(slicer.cut().is_none(), "off");
    }
}
