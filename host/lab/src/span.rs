//! Points and spans of a scene image's pointshell, in double precision: what the tick's search for a span's deepest place is compared with.

use glam::DVec3;
use mortise_protocol::image::{PointRecord, SpanRecord};
use mortise_scenario::wire::vector;

/// Places at which a span is compared before the search between the neighbours of the deepest.
const PLACES: i32 = 8;
/// Steps of that search, each of which leaves two thirds of the interval.
const STEPS: usize = 40;

/// A stretch of an edge, p(u) = middle + u·along + u²·(1 − round·(1 − u²))·bend for −1 ≤ u ≤ 1, mm; a point has no length.
#[derive(Clone, Copy, Debug)]
pub struct Span {
    middle: DVec3,
    along: DVec3,
    bend: DVec3,
    round: f64,
}

impl Span {
    /// The span of a point of a shape that has these spans.
    pub fn of(point: &PointRecord, spans: &[SpanRecord]) -> Self {
        let span = spans.get(usize::from(point.span)).copied().unwrap_or_default();
        Self {
            middle: 1e3 * vector(point.position),
            along: 1e3 * vector(span.along),
            bend: 1e3 * vector(span.bend),
            round: f64::from(span.round),
        }
    }

    /// The place at `u`, mm.
    pub fn at(&self, u: f64) -> DVec3 {
        self.middle + u * self.along + u * u * (1.0 - self.round * (1.0 - u * u)) * self.bend
    }

    /// Distance from the middle within which it lies, mm.
    pub fn reach(&self) -> f64 {
        self.along.length() + self.bend.length()
    }

    /// Parameter of the place where `gap` is least: the least of some places, then by thirds of the interval about it.
    pub fn deepest(&self, gap: impl Fn(DVec3) -> f64) -> f64 {
        if self.reach() == 0.0 {
            return 0.0;
        }
        let places = (-PLACES..=PLACES).map(|k| f64::from(k) / f64::from(PLACES));
        let least = places.min_by(|&a, &b| gap(self.at(a)).total_cmp(&gap(self.at(b))));
        let least = least.unwrap_or(0.0);
        let step = 1.0 / f64::from(PLACES);
        let (mut from, mut to) = ((least - step).max(-1.0), (least + step).min(1.0));
        for _ in 0..STEPS {
            let third = (to - from) / 3.0;
            if gap(self.at(from + third)) < gap(self.at(to - third)) {
                to -= third;
            } else {
                from += third;
            }
        }
        0.5 * (from + to)
    }
}
