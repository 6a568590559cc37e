//! Where along a leg another motion opens, and by how much it is missed where it does not.

use std::time::Duration;

use glam::{DAffine3, DVec3};

use crate::assembly::{Moved, SEARCH_STEP_MM};
use crate::leg::{Kind, Missed, Opening, carry, same_axis};
use crate::motion::Motion;
use crate::search::Search;
use crate::way::Blocked;

/// Smallest step between tested places, mm of travel, and most places of a scan.
const SCAN_MM: f64 = 0.008;
const MOST_SCANS: usize = 300;
/// Overlap that is as good as any deeper one for the next place, mm.
const DEEP_MM: f64 = 3.0;
/// Overlap that is worth a push aside, mm; pushes, and the distance each leaves, mm.
const COMPLY_MM: f64 = 0.6;
const PUSHES: usize = 40;
const PUSH_MM: f64 = 5e-3;
/// Missed openings that are kept, the part of a leg around one that is searched for the place with the least overlap, and steps of its motion, mm.
const MOST_MISSED: usize = 12;
const NEAR_MM: f64 = 0.2;
const NEEDED_STEP_MM: f64 = 0.1;
/// Time after the end of a search for the question by how much the group is held.
const HELD_TIME: Duration = Duration::from_secs(4);

/// Least overlap on a leg: where, mm along it; how deep, mm; of which pair.
type Least = (f64, f64, [usize; 2]);

impl Search<'_> {
    /// Where along leg `p` motion `q`, possible at its start, is possible again behind a stretch on which it is not: a key turns before a ward and behind it.
    pub fn reopening(&mut self, group: &Moved<'_>, p: &Kind, reach: f64, q: &Kind) -> Option<Opening> {
        if same_axis(p, q) {
            return None;
        }
        let (start, end) = self
            .clear_stretch(group, p, [0.0, reach], q, self.opening_mm)
            .ok()?;
        let blocked = end + SCAN_MM;
        if start > 0.0 || blocked >= reach {
            return None;
        }
        self.opening(group, p, [blocked, reach], q, 0.0)
    }

    /// Where along leg `p`, within `within` mm of its travel, motion `q` goes beyond its `range` by at least the displacement of an opening.
    pub fn opening(
        &mut self,
        group: &Moved<'_>,
        p: &Kind,
        within: [f64; 2],
        q: &Kind,
        range: f64,
    ) -> Option<Opening> {
        if same_axis(p, q) {
            return None;
        }
        let [mut low, mut high] = within;
        let mut found = None;
        let mut gain = self.opening_mm;
        // The displacement doubles while there is a clear stretch.
        let most = self.most(group, q);
        while range + gain <= most {
            let travel = range + gain;
            let (at, shift) = match self.clear_stretch(group, p, [low, high], q, travel) {
                Ok((from, to)) => {
                    (low, high) = (from, to);
                    ((from + to) / 2.0, None)
                }
                Err(least) => {
                    if let Some((at, excess, pair)) = least {
                        self.note(Missed {
                            by: group.by,
                            leg: *p,
                            at,
                            motion: *q,
                            most,
                            excess,
                            pair,
                        });
                    }
                    // A wider opening that was found before is as good.
                    if found.is_some() {
                        break;
                    }
                    let (at, ..) = least.filter(|&(_, excess, _)| excess <= COMPLY_MM)?;
                    (at, Some(self.comply(group, p, at, q, travel)?))
                }
            };
            let opening = Opening { at, shift, gain };
            let leg = p.over(at);
            let mut by = leg.at(1.0) * group.by;
            if let Some(shift) = shift {
                // The shift must be free where the leg ends.
                if self
                    .assembly
                    .free_share(
                        &Moved {
                            parts: self.parts,
                            by,
                        },
                        self.others,
                        &Motion::slide(shift),
                        SEARCH_STEP_MM,
                    )
                    .0
                    < 1.0
                {
                    break;
                }
                by = opening.shift() * by;
            }
            // The motion itself, not its end alone, must be free.
            let carried = carry(q, &leg).shifted(shift.unwrap_or(DVec3::ZERO));
            if self
                .assembly
                .free_share(
                    &Moved {
                        parts: self.parts,
                        by,
                    },
                    self.others,
                    &carried.over(travel),
                    SEARCH_STEP_MM,
                )
                .0
                < 1.0
            {
                break;
            }
            found = Some(opening);
            gain *= 2.0;
            if shift.is_some() || high - low <= 4.0 * SCAN_MM {
                break;
            }
        }
        found
    }

    /// A small slide after which the group, at `at` of leg `p` and displaced by `q`, is clear: pushed out of its deepest overlap again and again.
    fn comply(&self, group: &Moved<'_>, p: &Kind, at: f64, q: &Kind, travel: f64) -> Option<DVec3> {
        let leg = p.over(at);
        let displaced = carry(q, &leg).over(travel).at(1.0) * leg.at(1.0) * group.by;
        let moved = |shift: DVec3| Moved {
            parts: self.parts,
            by: DAffine3::from_translation(shift) * displaced,
        };
        let mut shift = DVec3::ZERO;
        for _ in 0..PUSHES {
            let Some(met) = self.assembly.blocker(&moved(shift), self.others) else {
                // Beyond contact the middle of the play is better than its end.
                let gap = |s: DVec3| {
                    self.assembly
                        .clearance(&moved(s), self.others, 1.0, false)
                        .map_or(1.0, |c| c.gap.distance_mm)
                };
                let further = (0..=8).map(|i| shift + shift.normalize_or_zero() * (0.05 * f64::from(i)));
                return further
                    .map(|s| (gap(s), s))
                    .max_by(|a, b| a.0.total_cmp(&b.0))
                    .map(|(_, s)| s);
            };
            shift += met.gap.away * (PUSH_MM - met.gap.distance_mm);
            // Pushed back along the motion itself nothing is gained.
            let back = matches!(q, Kind::Slide(d) if shift.dot(*d) < -0.5 * shift.length());
            if back || shift.length() > 4.0 * COMPLY_MM {
                return None;
            }
        }
        None
    }

    /// Keeps an opening that was missed by the overlap `excess`: from each start of a leg, of a pair of a leg and a motion the one that was missed by the
    /// least; those from the place of the group itself first, as what holds it is most often found there.
    fn note(&mut self, missed: Missed) {
        let same = |m: &Missed| {
            m.by == missed.by && same_axis(&m.leg, &missed.leg) && same_axis(&m.motion, &missed.motion)
        };
        if let Some(known) = self.missed.iter().position(same) {
            if self.missed[known].excess <= missed.excess {
                return;
            }
            self.missed.remove(known);
        }
        let rank = |m: &Missed| (m.by != DAffine3::IDENTITY, m.excess);
        let at = (self.missed).partition_point(|m| rank(m) <= rank(&missed));
        self.missed.insert(at, missed);
        self.missed.truncate(MOST_MISSED);
    }

    /// What holds the group: of the missed openings the one that needs the least overlap all along its motion.
    pub fn held(&self) -> Blocked {
        self.missed_least().unwrap_or_else(|| Blocked {
            pair: self.nearest_pair(),
            overlap_mm: None,
            proof: None,
        })
    }

    fn missed_least(&self) -> Option<Blocked> {
        let mut best: Option<Blocked> = None;
        for missed in &self.missed {
            // The place along the leg where the least is needed, by ternary search.
            let (mut low, mut high) = (missed.at - NEAR_MM, missed.at + NEAR_MM);
            let mut found = self.needed(missed, missed.at);
            while high - low > SCAN_MM {
                let (l, h) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
                let (at_l, at_h) = (self.needed(missed, l), self.needed(missed, h));
                for (depth, pair) in [at_l, at_h] {
                    if depth < found.0 {
                        found = (depth, pair);
                    }
                }
                if at_l.0 < at_h.0 {
                    high = h
                } else {
                    low = l
                }
                if found.0 >= DEEP_MM {
                    break;
                }
            }
            let (depth, pair) = found;
            // A turn that is free all the way does not lead out.
            if depth > 1e-3 && depth <= 1.0 && best.is_none_or(|b| b.overlap_mm.is_none_or(|mm| depth < mm)) {
                best = Some(Blocked {
                    pair,
                    overlap_mm: Some(depth),
                    proof: None,
                });
            }
        }
        best
    }

    /// Largest overlap of the missed motion from `at` on its leg to its end, mm, and of which pair; stops at [`DEEP_MM`].
    fn needed(&self, missed: &Missed, at: f64) -> (f64, [usize; 2]) {
        let leg = missed.leg.over(at);
        let by = leg.at(1.0) * missed.by;
        let motion = carry(&missed.motion, &leg);
        let mut most = (0.0, missed.pair);
        let mut travel = 0.0;
        while travel < missed.most {
            if self.clock.budget.until.is_over_by(HELD_TIME) {
                return (DEEP_MM, missed.pair);
            }
            let moved = Moved {
                parts: self.parts,
                by: motion.over(travel).at(1.0) * by,
            };
            let depth = self.assembly.excess(&moved, self.others, DEEP_MM);
            if let Some((excess, pair)) = depth {
                let full = excess + self.assembly.allowed_mm(pair[0], pair[1]);
                if full > most.0 {
                    most = (full, pair);
                }
                if most.0 >= 1.0 {
                    return (DEEP_MM, pair);
                }
            }
            travel += NEEDED_STEP_MM;
        }
        most
    }

    /// The first stretch of leg `p` within `low`..`high` along which the group displaced by `q` is clear; else the least overlap found.
    fn clear_stretch(
        &self,
        group: &Moved<'_>,
        p: &Kind,
        [low, high]: [f64; 2],
        q: &Kind,
        travel: f64,
    ) -> Result<(f64, f64), Option<Least>> {
        let depth = |s: f64| {
            let leg = p.over(s);
            let by = carry(q, &leg).over(travel).at(1.0) * leg.at(1.0) * group.by;
            self.assembly.excess(
                &Moved {
                    parts: self.parts,
                    by,
                },
                self.others,
                DEEP_MM,
            )
        };
        // A group displaced sideways has a longer arm.
        let scale = if matches!((p, q), (Kind::Turn(..), _)) {
            1.3
        } else {
            1.0
        };
        let mut least: Option<Least> = None;
        let mut s = low;
        let mut start = None;
        for _ in 0..MOST_SCANS {
            match depth(s) {
                None => {
                    start = Some(s);
                    break;
                }
                Some((excess, pair)) => {
                    if excess < DEEP_MM && least.is_none_or(|(_, e, _)| excess < e) {
                        least = Some((s, excess, pair));
                    }
                    if s >= high {
                        break;
                    }
                    s = (s + (excess / scale).max(SCAN_MM)).min(high);
                }
            }
        }
        let Some(start) = start else { return Err(least) };
        // The end of the stretch: steps that grow, then halving.
        let (mut clear, mut step) = (start, 2.0 * SCAN_MM);
        loop {
            let next = (clear + step).min(high);
            if next <= clear {
                return Ok((start, high));
            }
            if depth(next).is_some() {
                let mut met = next;
                while met - clear > SCAN_MM / 2.0 {
                    let middle = (met + clear) / 2.0;
                    if depth(middle).is_none() {
                        clear = middle
                    } else {
                        met = middle
                    }
                }
                return Ok((start, clear));
            }
            clear = next;
            step = (2.0 * step).min(1.0);
        }
    }
}
