//! What counts and pushes say about encoders and motors.

use std::time::{Duration, Instant};

use mortise_protocol::limits::MAX_ENCODERS;
use mortise_protocol::message::MotorTest;
use mortise_protocol::rig::Rig;

use crate::client::Client;
use crate::error::RigError;

/// Angle that the operator turns a joint, at least, rad: far beyond backlash and the motion of a hand that rests on the joint.
pub const TURN: f32 = 10.0 * std::f32::consts::PI / 180.0;
/// Counts below which an encoder is considered still: the noise of a quadrature encoder at an edge, and one more.
const STILL_COUNTS: i32 = 3;
/// Factor by which another joint must have turned more, for the two to have been mixed up. Links that carry each other move together, but not so much.
const MIXED_UP: f32 = 4.0;
/// Angle that a push must move a joint, rad: a tenth of a millimetre at a lever of 0.2 m.
const PUSHED: f32 = 5e-4;
/// Counts between two readings of a mechanism at rest.
const REST_COUNTS: i32 = 1;
/// Interval of these readings, and how many in a row are a rest.
const REST_INTERVAL: Duration = Duration::from_millis(40);
const REST_READINGS: usize = 4;
/// Longest wait for a rest.
const REST_WAIT: Duration = Duration::from_secs(4);
/// Excess over the described range, and margin of a corrected one, rad.
const MARGIN: f32 = 1.0 * std::f32::consts::PI / 180.0;
/// Share of its range that a joint should reach.
const SHARE: f32 = 0.7;

/// What was seen of a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sense {
    /// As described.
    Forward,
    /// The other way round.
    Backward,
    /// Nothing moved.
    Still,
    /// Another joint (from 0) moved in its place.
    Other(u8),
    /// It was turned too little to tell, or moved the same way whichever way it was pushed.
    Unclear,
}

/// Judges an encoder by the counts since the operator began to turn its joint forward.
pub fn encoder_sense(rig: &Rig, joint: u8, counts: &[i32; MAX_ENCODERS]) -> Sense {
    let own = usize::from(joint);
    let turned = turned(rig, counts);
    match farthest(&turned) {
        Some((other, far))
            if other != own && far.abs() >= TURN && far.abs() > MIXED_UP * turned[own].abs() =>
        {
            Sense::Other(other as u8)
        }
        _ if counts[own].abs() <= STILL_COUNTS => Sense::Still,
        _ if turned[own].abs() < TURN => Sense::Unclear,
        _ if turned[own] > 0.0 => Sense::Forward,
        _ => Sense::Backward,
    }
}

/// Judges a motor by two pushes of the same size, first forward, then backward.
pub fn motor_sense(rig: &Rig, joint: u8, tests: &[MotorTest; 2]) -> Sense {
    let own = usize::from(joint);
    let [forth, back] = tests.map(|test| turned(rig, &test.moved));
    let differences: [f32; 3] = std::array::from_fn(|joint| forth[joint] - back[joint]);
    let pushed = |joint: usize| {
        let counts = tests[0].moved[joint].abs().max(tests[1].moved[joint].abs());
        counts > STILL_COUNTS && differences[joint].abs() > PUSHED
    };
    match farthest(&differences) {
        Some((other, far))
            if other != own && pushed(other) && far.abs() > MIXED_UP * differences[own].abs() =>
        {
            Sense::Other(other as u8)
        }
        _ if !pushed(own) => Sense::Still,
        // Gravity or a hand moves it the same way in both.
        _ if forth[own] * back[own] > 0.0 => Sense::Unclear,
        _ if differences[own] > 0.0 => Sense::Forward,
        _ => Sense::Backward,
    }
}

/// Angle by which each joint has turned, rad; 0 for an absent one.
fn turned(rig: &Rig, counts: &[i32; MAX_ENCODERS]) -> [f32; 3] {
    std::array::from_fn(|joint| {
        let described = rig.joints.get(joint);
        described.map_or(0.0, |described| {
            counts[joint] as f32 * described.radians_per_count()
        })
    })
}

/// The joint that has turned most.
fn farthest(turned: &[f32; 3]) -> Option<(usize, f32)> {
    turned
        .iter()
        .copied()
        .enumerate()
        .max_by(|(_, a), (_, b)| a.abs().total_cmp(&b.abs()))
}

/// How far a joint's range was reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reached {
    /// As described.
    Whole,
    /// A share of it.
    Part(f32),
    /// Farther than described.
    Beyond,
}

/// The range that holds what was reached, and how it compares with the described one.
pub fn range(described: [f32; 2], reached: [f32; 2]) -> ([f32; 2], Reached) {
    let [from, to] = described;
    let beyond = reached[0] < from - MARGIN || reached[1] > to + MARGIN;
    if beyond {
        let wider = |value: f32, end: f32, sign: f32| {
            if sign * (value - end) > MARGIN {
                value + sign * MARGIN
            } else {
                end
            }
        };
        return (
            [wider(reached[0], from, -1.0), wider(reached[1], to, 1.0)],
            Reached::Beyond,
        );
    }
    let share = (reached[1] - reached[0]) / (to - from);
    let found = if share < SHARE {
        Reached::Part(share)
    } else {
        Reached::Whole
    };
    (described, found)
}

/// Waits until the mechanism rests; whether it does within some seconds.
fn at_rest(client: &Client) -> Result<bool, RigError> {
    let begun = Instant::now();
    let mut before = client.readings()?.counts;
    let mut still = 0;
    while begun.elapsed() < REST_WAIT {
        std::thread::sleep(REST_INTERVAL);
        let now = client.readings()?.counts;
        let moved = now.iter().zip(&before).map(|(now, before)| (now - before).abs());
        still = if moved.max().unwrap_or(0) <= REST_COUNTS {
            still + 1
        } else {
            0
        };
        if still >= REST_READINGS {
            return Ok(true);
        }
        before = now;
    }
    Ok(false)
}

/// Tests a motor forward, then backward, each from rest. `None`: the mechanism does not come to rest.
///
/// # Errors
/// As [`Client::test_motor`].
pub fn both_ways(client: &Client, joint: u8, force: f32) -> Result<Option<[MotorTest; 2]>, RigError> {
    if !at_rest(client)? {
        return Ok(None);
    }
    let forth = client.test_motor(joint, force)?;
    if !at_rest(client)? {
        return Ok(None);
    }
    let back = client.test_motor(joint, -force)?;
    Ok(Some([forth, back]))
}
