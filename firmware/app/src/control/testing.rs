//! The test of a single motor: a short pulse of a small force, and what the encoders make of it.
//!
//! The push rises to its peak and falls to zero within [`PUSH_TICKS`]; what moved by then is the result. The same curve, run backward with half its
//! force, then takes most of the speed away again, whichever way the motor pushes: braking by the measured speed would need the sense that is being
//! tested. The motors stay on without current until [`TEST_TICKS`], and go off. A light handle of 0.08 kg gets 0.2 m/s from 1 N; the push ends early when
//! the handle has moved [`TRAVEL_M`]. Everything that turns driven motors off ends the test too.

use mortise_protocol::limits::MAX_ENCODERS;
use mortise_protocol::message::{MotorTest, Readings, Refusal};

use super::ControlPlane;
use super::parts::Test;
use crate::board::{Clock, Drive, Mechanism};
use crate::channel::Reply;
use crate::safety::{Action, Event as SafetyEvent, Safety};
use crate::wire::driver_to_wire;

/// Ticks of the push: as many to rise as to fall.
pub const PUSH_TICKS: u16 = 30;
/// Force of the way back, as a share of the push.
pub const BACK: f32 = 0.5;
/// Ticks of a test.
pub const TEST_TICKS: u16 = 100;
/// Motion of the handle at which the push ends, m.
pub const TRAVEL_M: f32 = 0.005;

impl<M: Mechanism, C: Clock> ControlPlane<'_, '_, M, C> {
    /// Readings of the last tick.
    pub(super) fn readings(&self) -> Readings {
        Readings {
            tick: self.tick,
            counts: self.mechanism.counts(),
            currents: self.mechanism.currents(),
            referenced: self.sensed.referenced,
            stop_open: self.sensed.stop_open,
            supply_low: self.sensed.supply_low,
            driver: self.sensed.driver_fault.map(driver_to_wire),
        }
    }

    /// Begins a test.
    pub(super) fn test_motor(&mut self, seq: u16, joint: u8, force: f32) -> Result<(), Refusal> {
        if self.host.restarting {
            return Err(Refusal::Busy);
        }
        let motors = self.mechanism.motors();
        if joint >= motors {
            return Err(Refusal::NoSuchMotor { motors });
        }
        let event = SafetyEvent::Test {
            referenced: self.sensed.referenced,
        };
        if let (_, Action::Refuse(reason)) = self.safety.step(event) {
            return Err(reason);
        }
        if !self.ends.shared.claim_motors() {
            return Err(Refusal::Busy);
        }
        self.request(event)?;
        self.testing.test = Some(Test {
            origin: (seq, self.host.session),
            joint,
            force,
            ticks: 0,
            pushed: None,
            far: false,
            moved: [0; MAX_ENCODERS],
            start: (self.sensed.handle.position, self.mechanism.counts()),
        });
        Ok(())
    }

    /// The drive command of this tick of the test.
    pub(super) fn pulse(&mut self) -> Drive {
        let (handle, counts) = (self.sensed.handle.position, self.mechanism.counts());
        let Some(test) = &mut self.testing.test else {
            return Drive::Off;
        };
        let (start, before) = test.start;
        if test.pushed.is_none() {
            test.moved = core::array::from_fn(|encoder| counts[encoder].wrapping_sub(before[encoder]));
            test.far = (handle - start).length_squared() > TRAVEL_M * TRAVEL_M;
            if test.far || test.ticks >= PUSH_TICKS {
                test.pushed = Some(test.ticks);
            }
        }
        let share = match test.pushed {
            None => share(test.ticks),
            Some(pushed) => -BACK * (2 * pushed).checked_sub(test.ticks).map_or(0.0, share),
        };
        test.ticks = test.ticks.saturating_add(1);
        Drive::Joint {
            joint: test.joint,
            force: test.force * share,
        }
    }

    /// Ends the test when it is over.
    pub(super) fn end_test(&mut self) {
        let over = match &self.testing.test {
            Some(test) => test.ticks >= TEST_TICKS,
            // A test without its data cannot go on.
            None => self.safety == Safety::Testing,
        };
        if !over {
            return;
        }
        if let Some(test) = self.testing.test.take() {
            let (moved, far) = (test.moved, test.far);
            let found = MotorTest { moved, far };
            self.testing.answer = Some((test.origin, Reply::Tested(found)));
        }
        self.apply(SafetyEvent::TestOver);
    }

    /// Sends the answer of a test that has ended, when there is space.
    pub(super) fn answer_test(&mut self) {
        if self.ends.events.ready()
            && let Some(((seq, session), reply)) = self.testing.answer.take()
        {
            self.reply(seq, session, reply);
        }
    }
}

/// Share of the peak in a tick of the push.
fn share(tick: u16) -> f32 {
    let half = f32::from(PUSH_TICKS / 2);
    let from_peak = (f32::from(tick) - half).abs();
    (1.0 - from_peak / half).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_push_begins_and_ends_at_zero_and_has_half_the_impulse_of_its_peak() {
        assert_eq!(
            (share(0), share(PUSH_TICKS / 2), share(PUSH_TICKS)),
            (0.0, 1.0, 0.0)
        );
        let sum: f32 = (0..TEST_TICKS).map(share).sum();
        assert!((sum - 0.5 * f32::from(PUSH_TICKS)).abs() < 1e-3, "{sum}");
    }
}
