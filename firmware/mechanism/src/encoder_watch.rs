//! Detection of dead encoders, which must be distinguished from a hand that holds still.
//!
//! Unchanging counts are no evidence: a hand resting on a part, or a mouse at rest, produces none for minutes. A sound encoder, however, follows its
//! own motor. While a part is rendered, an axis without a sign of life for [`STILL_TICKS`] that either pushes or has reason to have moved is
//! **probed**: its motor's effort ramps linearly towards zero (for an axis that does not push, to alternate sides) and back, until the encoder
//! answers. An encoder that stays silent through the whole probe is dead.
//!
//! The probe ramps there *and back*: a hand whose force changes at the rate of a single ramp, d = s, would cancel it within the dry friction, and the
//! joint would not move. On one of two ramps of opposite slopes ±s the sum changes by (|d| + s)·T ≥ s·T, the amplitude, for any steady rate d.
//!
//! The probe ends with the answer, so the encoder rather than the probe's amplitude determines what the operator feels: [`ALIVE_COUNTS`] counts of
//! motion, at most every [`STILL_TICKS`], by a change of force of k·2.5 counts plus twice the dry friction, with k the hand's stiffness. The full
//! amplitude is reached only where nothing moves, that is before a fault. It is chosen so that the handle still answers in a hand of
//! [`STIFFEST_HAND`].
//!
//! *Sign of life*: the counts since the last one span [`ALIVE_COUNTS`]. A single count is not sufficient: an encoder with one of its two channels
//! broken counts one up and one down as it turns. *Reason to have moved*: any axis of the mechanism moved by [`FAR_COUNTS`] since this one last
//! answered a probe. A mechanism at rest that does not push is therefore not probed once every axis has answered; this first round finds an encoder
//! that was dead before the part was grabbed.
//!
//! Motion caused by a probe is no reason to have moved, or probes would trigger further probes without end: friction leaves a handle anywhere within
//! f/k of its rest, and each probe may move it to the other side. A rig states how far its handle swings ([`EncoderWatch::swinging`]). While an axis
//! may still swing, only a larger displacement counts as motion, and the remainder of the swing afterwards does not.
//!
//! From the last sign of life to the verdict: at most [`STILL_TICKS`] + 2·[`RAMP_TICKS`] + [`LISTEN_TICKS`] = [`VERDICT_TICKS`], since an earlier
//! probe has ended by then: it returns twice as fast as it rose. Cost: some 20 integer operations per axis and tick. No allocation, total.

/// Ticks without a sign of life after which a probe may begin.
pub const STILL_TICKS: u16 = 70;
/// Ticks in which a probe rises to its amplitude, and in which it returns.
pub const RAMP_TICKS: u16 = 50;
/// Ticks after a probe in which an answer is still accepted: time for a handle to follow. In a hand of 400 N/m and 4 N·s/m it follows with a time
/// constant of 10 ms.
pub const LISTEN_TICKS: u16 = 20;
/// Ticks from the last sign of life of an encoder that is probed at once to the verdict.
pub const VERDICT_TICKS: u16 = STILL_TICKS + 2 * RAMP_TICKS + LISTEN_TICKS;
/// Counts between the extremes of a motion that is a sign of life.
pub const ALIVE_COUNTS: i32 = 2;
/// Motion of any axis, in counts, that gives every other axis a reason to have moved.
pub const FAR_COUNTS: i32 = 4;
/// Share of a motor's largest effort from which its axis is always watched.
pub const LOADED: f32 = 0.05;
/// Stiffest hand in which a probe moves a free handle, N/m: more than twice the stiffest grip of a tensed arm.
pub const STIFFEST_HAND: f32 = 10_000.0;
/// The same about an axis, N·m/rad.
pub const STIFFEST_WRIST: f32 = 25.0;

/// Amplitude of a probe: moves the axis against the hand's `stiffness` by a sign of life plus half a count, and against `friction`, which may have to
/// be reversed from one side to the other. All in one system of units, force or torque.
pub const fn amplitude(stiffness: f32, count: f32, friction: f32) -> f32 {
    2.0 * friction + stiffness * (ALIVE_COUNTS as f32 + 0.5) * count
}

/// `effort` of a motor with a probe of `amplitude` added, `share` from [`EncoderWatch::share`]: never more than the larger of the two.
pub fn probed(effort: f32, amplitude: f32, share: f32) -> f32 {
    let most = effort.abs().max(amplitude);
    (effort + share * amplitude).clamp(-most, most)
}

/// One axis in one tick, input of the watch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisTick {
    /// Counts since the last tick.
    pub moved: i32,
    /// Effort of its motor as a share of its largest, signed; without the probe.
    pub effort: f32,
    /// Whether a probe would move it: it has a motor stronger than its friction, and is not at a stop.
    pub able: bool,
}

/// All encoders of a mechanism.
#[derive(Clone, Copy, Debug)]
pub struct EncoderWatch<const N: usize> {
    axes: [Axis; N],
    /// Like [`FAR_COUNTS`], for an axis that may still swing from a probe.
    swing_counts: i32,
}

#[derive(Clone, Copy, Debug)]
struct Axis {
    /// Counts since the last sign of life, and their range.
    place: i32,
    low: i32,
    high: i32,
    /// Ticks since the last sign of life.
    still: u16,
    /// Counts since the axis last moved far, without displacement left by a probe.
    travel: i32,
    /// Whether it had a reason to move since it last answered a probe.
    owes_answer: bool,
    probe: Probe,
}

/// The probe of one axis.
#[derive(Clone, Copy, Debug)]
struct Probe {
    phase: Phase,
    /// Level of the probe, in units of 1/[`RAMP_TICKS`].
    level: u16,
    /// Direction: towards larger efforts, else smaller ones.
    up: bool,
    /// Ticks since the probe ended.
    listened: u16,
    /// Ticks for which the axis may still swing.
    swings: u16,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// No probe.
    Rest,
    /// Rising to the amplitude.
    Rise,
    /// Returning to zero.
    Fall,
    /// Ended, without an answer so far.
    Listen,
    /// Answered: returning to zero.
    Return,
}

impl<const N: usize> Default for EncoderWatch<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> EncoderWatch<N> {
    /// Initial state, in which every encoder has to answer once.
    pub const fn new() -> Self {
        Self::swinging(FAR_COUNTS)
    }

    /// The same, for axes that a probe may swing by less than `counts` in a hand at rest: smaller motion is no reason to move.
    pub const fn swinging(counts: i32) -> Self {
        Self {
            axes: [Axis::NEW; N],
            swing_counts: counts,
        }
    }

    /// Processes one reading while a part is rendered; returns the first dead axis. When no part is rendered call [`Self::rest`] instead.
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

    /// Ends all probes: no part is rendered.
    pub fn rest(&mut self) {
        self.axes = [Axis::NEW; N];
    }

    /// Share of the probe's amplitude to add to an axis, −1 to 1; 0 for an axis that does not exist.
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

    /// Processes one tick; returns whether the encoder is dead.
    fn update(&mut self, tick: &AxisTick) -> bool {
        let alive = self.shows_life(tick.moved);
        if alive || !tick.able {
            self.still = 0;
            if alive && self.probe.awaits_answer() {
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
    /// Starts a probe towards zero effort, or without effort to the side opposite to the last.
    fn begin(&mut self, effort: f32) {
        if self.phase == Phase::Rest {
            self.up = if effort == 0.0 { !self.up } else { effort < 0.0 };
            self.phase = Phase::Rise;
        }
    }

    /// Whether it awaits an answer.
    fn awaits_answer(&self) -> bool {
        matches!(self.phase, Phase::Rise | Phase::Fall | Phase::Listen)
    }

    fn end(&mut self) {
        self.listened = 0;
        if self.awaits_answer() {
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

// An earlier probe has returned before the next may begin.
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
            // The encoder answers in the middle of a probe, and returns with it.
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
        /// For any history: once an encoder stands still while pushing, the verdict comes in time; a probe never adds to a push.
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

        /// Never exceeds the motor's effort, or the amplitude where that is larger; towards zero it never overshoots by more than the amplitude.
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
