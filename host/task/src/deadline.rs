//! When a search ends: at a time, or earlier when its caller no longer wants it.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// The end of a search.
#[derive(Clone, Debug)]
pub struct Deadline {
    at: Instant,
    stop: Option<Arc<AtomicBool>>,
}

impl Deadline {
    /// Ends earlier, too, once `stop` is true. A search that is stopped so says that its time ran out.
    pub fn or_stopped(self, stop: Arc<AtomicBool>) -> Self {
        let stop = Some(stop);
        Self { stop, ..self }
    }

    /// Whether the search is to end.
    pub fn is_over(&self) -> bool {
        self.is_stopped() || Instant::now() >= self.at
    }

    /// Time left, none when it is over.
    pub fn left(&self) -> Duration {
        if self.is_over() {
            return Duration::ZERO;
        }
        self.at.saturating_duration_since(Instant::now())
    }

    /// The end of a part of a search, which takes this share of the time left.
    pub fn share(&self, share: f64) -> Self {
        Self {
            at: Instant::now() + self.left().mul_f64(share),
            stop: self.stop.clone(),
        }
    }

    /// Whether the time ended longer ago than `time`, or the search was stopped.
    pub(crate) fn is_over_by(&self, time: Duration) -> bool {
        self.is_stopped() || self.at.elapsed() > time
    }

    fn is_stopped(&self) -> bool {
        (self.stop.as_ref()).is_some_and(|stop| stop.load(Ordering::Relaxed))
    }
}

impl From<Duration> for Deadline {
    /// Ends after this time from now.
    fn from(time: Duration) -> Self {
        Self {
            at: Instant::now() + time,
            stop: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_over_at_its_time_or_when_it_is_stopped() {
        let stop = Arc::new(AtomicBool::new(false));
        let hour = Deadline::from(Duration::from_secs(3600)).or_stopped(Arc::clone(&stop));
        let half = hour.share(0.5);
        assert!(!hour.is_over() && !half.is_over());
        assert!((1799..=1800).contains(&half.left().as_secs()));
        assert!(Deadline::from(Duration::ZERO).is_over());
        assert!(!Deadline::from(Duration::ZERO).is_over_by(Duration::from_secs(3600)));
        stop.store(true, Ordering::Relaxed);
        for part in [&hour, &half] {
            assert!(part.is_over() && part.left().is_zero() && part.is_over_by(Duration::from_secs(3600)));
        }
    }
}
