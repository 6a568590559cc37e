//! Tells an encoder that is dead from a hand that holds still.
//!
//! Counts that do not change prove nothing: a hand that rests on a part, or a mouse that is not moved, gives none for minutes. A sound encoder follows
//! its own motor, though. While a part is felt, an axis that has shown no sign of life for [`STILL_TICKS`] and either pushes or has reason to have moved
//! is **probed**: its motor's effort goes linearly towards zero (of an axis that does not push, to alternate sides) and back, until the encoder answers.
//! An encoder that stays silent through the whole probe is dead.
//!
//! There *and back*: a hand whose force changes at the rate of a single ramp, d = s, would cancel it within the dry friction, and the joint would stand.
//! On one of two ramps of opposite slopes ±s the sum changes by (|d| + s)·T ≥ s·T, the amplitude, whatever the steady rate d.
//!
//! The probe ends with the answer, so what the hand feels is set by the encoder and not by the probe's amplitude: [`ALIVE_COUNTS`] counts of motion, at
//! most every [`STILL_TICKS`], by a change of force of k·2.5 counts and twice the dry friction, k the hand's stiffness. The full amplitude is reached
//! only where nothing moves, that is before a fault. It is chosen so that a hand of [`STIFFEST_HAND`] still answers.
//!
//! *Sign of life*: the counts since the last one span [`ALIVE_COUNTS`]. One count is none: an encoder with one of its two channels broken counts one up
//! and one down as it turns. *Reason to have moved*: any axis of the mechanism went [`FAR_COUNTS`] since this one last answered a probe. A mechanism at
//! rest that does not push is therefore left alone, once every axis has answered: one that was dead before the part was grabbed is found so.
//!
//! What a probe itself moves is no reason to move, or probes ask for probes without end: friction leaves a handle anywhere within f/k of its rest, and
//! each probe may take it to the other side. A rig states how far its handle swings ([`EncoderWatch::swinging`]). While an axis may still
//! swing, only a larger displacement counts as motion, and what remains of the swing afterwards does not.
//!
//! From the last sign of life to the verdict: [`STILL_TICKS`] + 2·[`RAMP_TICKS`] + [`LISTEN_TICKS`] = [`VERDICT_TICKS`] at the most, since an earlier probe
//! is over by then: it returns twice as fast as it rose. Cost: some 20 integer operations an axis and tick. No allocation, total.

/// Ticks without a sign of life after which a probe may begin.
pub const STILL_TICKS: u16 = 70;
/// Ticks in which a probe reaches its amplitude, and in which it goes back.
pub const RAMP_TICKS: u16 = 50;
/// Ticks after a probe in which an answer still counts: time for a handle to follow. A hand of 400 N/m and 4 N·s/m follows with 10 ms.
pub const LISTEN_TICKS: u16 = 20;
/// Ticks from the last sign of life of an encoder that is probed at once to the verdict.
pub const VERDICT_TICKS: u16 = STILL_TICKS + 2 * RAMP_TICKS + LISTEN_TICKS;
/// Counts from one side to the other that are a sign of life.
pub const ALIVE_COUNTS: i32 = 2;
/// Counts any axis goes, after which every other has a reason to have moved.
pub const FAR_COUNTS: i32 = 4;
/// Share of what a motor can give from which on its axis is always watched.
pub const LOADED: f32 = 0.05;
/// Stiffest hand whose free handle a probe moves, N/m: more than twice the stiffest grip of a tensed arm.
pub const STIFFEST_HAND: f32 = 10_000.0;
/// Likewise about an axis, N·m/rad.
pub const STIFFEST_WRIST: f32 = 25.0;

/// Amplitude of a probe: moves `stiffness` (of the hand, at this axis) by what is a sign of life and half a count more, against `friction`, which may
/// have to be turned round from one side to the other. All in one system of units, force or torque.
pub const fn amplitude(stiffness: f32, count: f32, friction: f32) -> f32 {
    2.0 * friction + stiffness * (ALIVE_COUNTS as f32 + 0.5) * count
}

/// `effort` of a motor with a probe of `amplitude` in it, `share` from [`EncoderWatch::share`]: never more than the larger of the two.
pub fn probed(effort: f32, amplitude: f32, share: f32) -> f32 {
    let most = effort.abs().max(amplitude);
    (effort + share * amplitude).clamp(-most, most)
}

/// One axis in one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisTick {
    /// Counts since the last tick.
    pub moved: i32,
    /// What its motor was driven with, as a share of what it can, signed; without the probe.
    pub effort: f32,
    /// A probe would move it: it has a motor that is stronger than its friction, and is not at a stop.
    pub able: bool,
}

/// All encoders of a mechanism.
#[derive(Clone, Copy, Debug)]
pub struct EncoderWatch<const N: usize> {
    axes: [Axis; N],
    /// As [`FAR_COUNTS`], of an axis that may still swing from a probe.
    swing_counts: i32,
}

#[derive(Clone, Copy, Debug)]
struct Axis {
    /// Counts since the last sign of life, and the range they spanned.
    place: i32,
    low: i32,
    high: i32,
    /// Ticks since then.
    still: u16,
    /// Counts since the axis last went far, without what a probe left behind.
    travel: i32,
    /// It had a reason to move since it last answered a probe.
    owes_answer: bool,
    probe: Probe,
}

/// The probe of one axis.
#[derive(Clone, Copy, Debug)]
struct Probe {
    phase: Phase,
    /// In parts of [`RAMP_TICKS`].
    level: u16,
    /// Towards larger efforts, else smaller ones.
    up: bool,
    /// Ticks since it was over.
    listened: u16,
    /// Ticks for which the axis may still swing.
    swings: u16,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// No probe.
    Rest,
    /// Away.
    Rise,
    /// And back.
    Fall,
    /// Over, without an answer so far.
    Listen,
    /// Answered: back to zero.
    Return,
}

impl<const N: usize> Default for EncoderWatch<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> EncoderWatch<N> {
    /// Nothing seen yet; every encoder has to answer once.
    pub const fn new() -> Self {
        Self::swinging(FAR_COUNTS)
    }

    /// Likewise, of axes that a probe may swing by less than `counts` with a hand at rest: less is then no reason to move.
    pub const fn swinging(counts: i32) -> Self {
        Self {
            axes: [Axis::NEW; N],
            swing_counts: counts,
        }
    }

    /// One reading while a part is felt; the first axis that is dead. When no part is felt call [`Self::rest`] instead.
    pub fn update(&mut self, ticks: &[AxisTick; N]) -> Option<u8> {
        let mut far = false;
        for (axis, tick) in self.axes.iter_mut().zip(ticks) {
            far |= axis.goes_far(tick.moved, self.swing_counts);
        }
        let mut dead = None;
        for (number, (axis, tick)) in self.axes.iter_mut().zip(ticks).enumerate() {
            axis.owes_answer |= far;
            if axis.update(tick) && dead.is_none() {
                dead = Some(number as u8);
            }
        }
        dead
    }

    /// No part is felt: no probes.
    pub fn rest(&mut self) {
        self.axes = [Axis::NEW; N];
    }

    /// Share of the probe's amplitude to add to an axis, −1 to 1; 0 for an axis that is not there.
    pub fn share(&self, axis: usize) -> f32 {
        self.axes.get(axis).map_or(0.0, |axis| axis.probe.share())
    }
}

impl Axis {
    const NEW: Self = Self {
        place: 0,
        low: 0,
        high: 0,
        still: 0,
        travel: 0,
        owes_answer: true,
        probe: Probe {
            phase: Phase::Rest,
            level: 0,
            up: false,
            listened: 0,
            swings: 0,
        },
    };

    fn goes_far(&mut self, moved: i32, swing_counts: i32) -> bool {
        self.travel = self.travel.saturating_add(moved);
        let most = if self.probe.swings > 0 {
            swing_counts
        } else {
            FAR_COUNTS
        };
        let far = self.travel.unsigned_abs() >= most as u32;
        if far {
            self.travel = 0;
        }
        far
    }

    fn shows_life(&mut self, moved: i32) -> bool {
        self.place = self.place.saturating_add(moved);
        self.low = self.low.min(self.place);
        self.high = self.high.max(self.place);
        let alive = self.high.saturating_sub(self.low) >= ALIVE_COUNTS;
        if alive {
            (self.place, self.low, self.high) = (0, 0, 0);
        }
        alive
    }

    /// Whether it is dead.
    fn update(&mut self, tick: &AxisTick) -> bool {
        let alive = self.shows_life(tick.moved);
        if alive || !tick.able {
            self.still = 0;
            if alive && self.probe.asks() {
                self.owes_answer = false;
            }
            self.probe.end();
        } else {
            self.still = self.still.saturating_add(1);
        }
        let pushes = tick.effort.abs() > LOADED;
        if self.still >= STILL_TICKS && (self.owes_answer || pushes) {
            self.probe.begin(tick.effort);
        }
        let swung = self.probe.swings > 0;
        self.probe.advance();
        if swung && self.probe.swings == 0 && self.travel.unsigned_abs() >= FAR_COUNTS as u32 {
            self.travel = 0;
        }
        self.probe.listened >= LISTEN_TICKS
    }
}

impl Probe {
    /// Towards zero effort; from none to the side that was not the last.
    fn begin(&mut self, effort: f32) {
        if self.phase == Phase::Rest {
            self.up = if effort == 0.0 { !self.up } else { effort < 0.0 };
            self.phase = Phase::Rise;
        }
    }

    /// It waits for an answer.
    fn asks(&self) -> bool {
        matches!(self.phase, Phase::Rise | Phase::Fall | Phase::Listen)
    }

    fn end(&mut self) {
        self.listened = 0;
        if self.asks() {
            self.phase = Phase::Return;
        }
    }

    fn advance(&mut self) {
        self.swings = if self.phase == Phase::Rest {
            self.swings.saturating_sub(1)
        } else {
            STILL_TICKS
        };
        match self.phase {
            Phase::Rest => {}
            Phase::Rise => {
                self.level += 1;
                if self.level >= RAMP_TICKS {
                    self.phase = Phase::Fall;
                }
            }
            Phase::Fall => {
                self.level = self.level.saturating_sub(1);
                if self.level == 0 {
                    self.phase = Phase::Listen;
                }
            }
            Phase::Listen => self.listened = self.listened.saturating_add(1),
            Phase::Return => {
                self.level = self.level.saturating_sub(2);
                if self.level == 0 {
                    self.phase = Phase::Rest;
                }
            }
        }
    }

    fn share(&self) -> f32 {
        let share = f32::from(self.level) / f32::from(RAMP_TICKS);
        if self.up { share } else { -share }
    }
}

// An earlier probe is back before the next may begin.
const _: () = assert!(RAMP_TICKS / 2 < STILL_TICKS && VERDICT_TICKS < 200);

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use std::vec::Vec;

    use super::*;

    fn tick(moved: i32, effort: f32) -> AxisTick {
        AxisTick {
            moved,
            effort,
            able: true,
        }
    }

    #[test]
    fn a_motion_that_stops_dead_is_found_within_200_ticks_and_not_before_the_probe_is_full() {
        let mut watch = EncoderWatch::<2>::new();
        for _ in 0..1_000 {
            assert_eq!(watch.update(&[tick(3, 0.0), tick(1, 0.0)]), None);
            assert_eq!([watch.share(0), watch.share(1)], [0.0; 2]);
        }
        let mut farthest = 0.0f32;
        let found = (1..400u16).find(|_| {
            let dead = watch.update(&[tick(3, 0.0), tick(0, 0.0)]);
            farthest = farthest.max(watch.share(1).abs());
            dead == Some(1)
        });
        // The first still tick counts as one.
        assert_eq!(found, Some(VERDICT_TICKS - 1));
        assert_eq!(farthest, 1.0);
    }

    #[test]
    fn one_channel_that_is_broken_counts_up_and_down_and_is_dead() {
        let mut watch = EncoderWatch::<2>::new();
        let found = (1..400u16).find(|t| {
            let flicker = if t % 2 == 0 { 1 } else { -1 };
            watch.update(&[tick(5, 0.0), tick(flicker, 0.0)]) == Some(1)
        });
        assert_eq!(found, Some(VERDICT_TICKS - 1));
    }

    #[test]
    fn a_mechanism_at_rest_is_left_alone_once_every_axis_has_answered() {
        let mut watch = EncoderWatch::<1>::new();
        let mut probes = 0;
        for _ in 0..10_000 {
            let was = watch.share(0);
            // The encoder answers in the middle of a probe, and comes back with it.
            let answer = if was.abs() == 0.2 { ALIVE_COUNTS } else { 0 };
            assert_eq!(watch.update(&[tick(answer, 0.0)]), None);
            probes += u32::from(was == 0.0 && watch.share(0) != 0.0);
        }
        assert_eq!(probes, 1);
    }

    #[test]
    fn an_axis_at_its_stop_or_without_a_motor_is_not_judged() {
        let mut watch = EncoderWatch::<1>::new();
        for _ in 0..10_000 {
            let stands = AxisTick {
                moved: 0,
                effort: 0.9,
                able: false,
            };
            assert_eq!(watch.update(&[stands]), None);
            assert_eq!(watch.share(0), 0.0);
        }
    }

    proptest! {
        /// Whatever an encoder did before: once it stands still, pushing, the verdict comes in time; a probe never adds to a push.
        #[test]
        fn a_dead_encoder_is_found_in_time_after_any_history(
            history in prop::collection::vec((-4i32..=4, -1.0f32..1.0, prop::bool::weighted(0.9)), 0..600),
            effort in prop_oneof![-1.0f32..-0.06, 0.06f32..1.0],
        ) {
            let mut watch = EncoderWatch::<1>::new();
            for (moved, effort, able) in history {
                watch.update(&[AxisTick { moved, effort, able }]);
                prop_assert!(watch.share(0).abs() <= 1.0);
            }
            let found: Vec<_> = (0..VERDICT_TICKS).map(|_| watch.update(&[tick(0, effort)])).collect();
            prop_assert_eq!(found.last(), Some(&Some(0)), "not found in time");
        }

        /// Never more than the motor was to give, or the amplitude where that is more; towards zero never through it by more than the amplitude.
        #[test]
        fn a_probe_never_adds_to_a_push(effort in -20.0f32..20.0, amplitude in 0.0f32..2.0, share in -1.0f32..1.0) {
            let out = probed(effort, amplitude, share);
            prop_assert!(out.abs() <= effort.abs().max(amplitude));
            prop_assert!((out - effort).abs() <= amplitude * 1.000_001 + 2e-6);
        }

        /// Any numbers: no panic, no share beyond one.
        #[test]
        fn any_numbers(ticks in prop::collection::vec((any::<i32>(), any::<f32>(), any::<bool>()), 0..300)) {
            let mut watch = EncoderWatch::<1>::new();
            for (moved, effort, able) in ticks {
                watch.update(&[AxisTick { moved, effort, able }]);
                prop_assert!(watch.share(0).abs() <= 1.0);
            }
        }
    }
}
