//! The operator model: desired motion of the handle, and the stiffness with which a simulated hand holds it.
//!
//! A [`HandScript`] gives keyframes; between two of them position and push are interpolated linearly and the orientation along the shortest arc at
//! constant rate. Tremor moves the desired position by ±`tremor` along each axis at `tremor_hz`, a third of a turn apart, which is a small circle
//! about (1, 1, 1). All in single precision with no library call in the tick, so that every rig computes the same bits.

use glam::Vec3;
use heapless::Vec;
use mortise_firmware::scripts::check_script;
use mortise_firmware::wire::pose_from_wire;
use mortise_haptics::{Pose, Twist, rotation};
use mortise_mechanism::interface::{TICK_HZ, TICK_S};
use mortise_protocol::limits::MAX_KEYFRAMES;
use mortise_protocol::message::HandScript;

/// Desired motion of the hand in one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandCommand {
    /// Desired pose of the handle.
    pub pose: Pose,
    /// Velocity of that pose.
    pub twist: Twist,
    /// Added to the spring's force, N.
    pub push: Vec3,
}

/// Spring and damper between desired pose and handle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandImpedance {
    /// N/m.
    pub stiffness: f32,
    /// N·s/m.
    pub damping: f32,
    /// N·m/rad.
    pub angular_stiffness: f32,
    /// N·m·s/rad.
    pub angular_damping: f32,
}

impl HandImpedance {
    /// No hand on the handle.
    pub const NONE: Self = Self {
        stiffness: 0.0,
        damping: 0.0,
        angular_stiffness: 0.0,
        angular_damping: 0.0,
    };
}

impl HandCommand {
    /// The desire to stay at `pose`.
    pub const fn at(pose: Pose) -> Self {
        Self {
            pose,
            twist: Twist::ZERO,
            push: Vec3::ZERO,
        }
    }
}

#[derive(Clone, Copy, Debug)]
struct Frame {
    tick: u32,
    pose: Pose,
    push: Vec3,
    /// Rotation vector to the next frame's orientation, world axes, rad.
    turn: Vec3,
}

/// The operator model while it follows a script.
#[derive(Clone, Debug)]
pub struct Hand {
    /// Its springs.
    pub impedance: HandImpedance,
    tremor: f32,
    /// Turns of the tremor in a tick, and so far, in 2⁻³² turns: exact, and wraps without error.
    phase_step: u32,
    phase: u32,
    tick: u32,
    segment: usize,
    frames: Vec<Frame, MAX_KEYFRAMES>,
    last: Option<HandCommand>,
}

impl Hand {
    /// Starts a script whose time begins now; `None` when [`check_script`] would refuse it.
    pub fn new(script: &HandScript) -> Option<Self> {
        check_script(script).ok()?;
        let mut frames = Vec::new();
        for frame in &script.keyframes {
            let pose = pose_from_wire(&frame.pose)?;
            let made = Frame {
                tick: frame.tick,
                pose,
                push: Vec3::from_array(frame.push),
                turn: Vec3::ZERO,
            };
            frames.push(made).ok()?;
        }
        for i in 1..frames.len() {
            let (from, to) = (frames[i - 1].pose.orientation, frames[i].pose.orientation);
            frames[i - 1].turn = rotation::log_continuous(to * from.conjugate(), Vec3::ZERO);
        }
        Some(Self {
            impedance: HandImpedance {
                stiffness: script.stiffness,
                damping: script.damping,
                angular_stiffness: script.angular_stiffness,
                angular_damping: script.angular_damping,
            },
            tremor: script.tremor,
            // At most half a turn a tick; the cast saturates.
            phase_step: (script.tremor_hz * TICK_S * 4_294_967_296.0) as u32,
            phase: 0,
            tick: 0,
            segment: 0,
            frames,
            last: None,
        })
    }

    /// Advances to the next tick and returns its desired motion.
    pub fn advance(&mut self) -> HandCommand {
        let (mut pose, push) = self.scripted();
        let third = u32::MAX / 3;
        pose.position += self.tremor
            * Vec3::new(
                sine_of_turn(self.phase),
                sine_of_turn(self.phase.wrapping_add(third)),
                sine_of_turn(self.phase.wrapping_add(2 * third)),
            );
        let twist = self.last.map_or(Twist::ZERO, |last| Twist {
            linear: (pose.position - last.pose.position) * f32::from(TICK_HZ),
            angular: small_turn(last.pose, pose) * f32::from(TICK_HZ),
        });
        self.tick = self.tick.saturating_add(1);
        self.phase = self.phase.wrapping_add(self.phase_step);
        let command = HandCommand { pose, twist, push };
        self.last = Some(command);
        command
    }

    fn scripted(&mut self) -> (Pose, Vec3) {
        // Advances at most one segment per tick, since the keys' times ascend by whole ticks.
        while self.segment + 1 < self.frames.len() && self.frames[self.segment + 1].tick <= self.tick {
            self.segment += 1;
        }
        let from = &self.frames[self.segment];
        match self.frames.get(self.segment + 1) {
            Some(to) if self.tick > from.tick => {
                let part = (self.tick - from.tick) as f32 / (to.tick - from.tick) as f32;
                let pose = Pose {
                    position: from.pose.position + (to.pose.position - from.pose.position) * part,
                    orientation: rotation::exp(from.turn * part) * from.pose.orientation,
                };
                (pose, from.push + (to.push - from.push) * part)
            }
            _ => (from.pose, from.push),
        }
    }
}

/// Rotation vector from `from` to `to`, world axes, rad, for turns well below one radian: 2·sin(φ/2) instead of φ, 0.1 % at 0.15 rad.
pub(crate) fn small_turn(from: Pose, to: Pose) -> Vec3 {
    let q = to.orientation * from.orientation.conjugate();
    let v = Vec3::new(q.x, q.y, q.z) * 2.0;
    if q.w < 0.0 { -v } else { v }
}

/// Sine of `phase`·2⁻³² turns, error below 2·10⁻⁴ (largest at a quarter turn): sufficient for a tremor, and a library sine would work in double
/// precision, which a Cortex-M7 built for single precision does in software.
fn sine_of_turn(phase: u32) -> f32 {
    // Signed turns·4 in −2..2, folded to −1..1.
    let x = phase as i32 as f32 * (1.0 / 1_073_741_824.0);
    let x = if x > 1.0 {
        2.0 - x
    } else if x < -1.0 {
        -2.0 - x
    } else {
        x
    };
    let x2 = x * x;
    // sin(π/2·x) to x⁵, Taylor.
    let series = 1.570_796_4 - x2 * (0.645_964_1 - x2 * (0.079_692_63 - x2 * 0.004_681_754));
    x * series
}

#[cfg(test)]
mod tests {
    use super::*;
    use mortise_protocol::message::{Keyframe, Refusal, WirePose};

    fn frame(tick: u32, x: f32, angle: f32) -> Keyframe {
        Keyframe {
            tick,
            pose: WirePose {
                position: [x, 0.0, 0.0],
                orientation: [0.0, 0.0, libm::sinf(0.5 * angle), libm::cosf(0.5 * angle)],
            },
            push: [0.0, 0.0, 10.0 * x],
        }
    }

    fn script(frames: &[Keyframe]) -> HandScript {
        HandScript {
            stiffness: 400.0,
            damping: 10.0,
            angular_stiffness: 2.0,
            angular_damping: 0.02,
            tremor: 0.0,
            tremor_hz: 10.0,
            keyframes: Vec::from_slice(frames).unwrap(),
        }
    }

    #[test]
    fn sine_is_close_all_the_way_round() {
        for i in 0..10_000u32 {
            let phase = i * 429_496;
            let angle = f64::from(phase) / 4_294_967_296.0 * core::f64::consts::TAU;
            // First neglected term: (π/2)⁹/9! = 1.6·10⁻⁴.
            assert!(
                (f64::from(sine_of_turn(phase)) - libm::sin(angle)).abs() < 2e-4,
                "{i}"
            );
        }
    }

    #[test]
    fn holds_before_and_after_and_goes_straight_between() {
        let mut hand = Hand::new(&script(&[frame(10, 0.0, 0.0), frame(110, 0.1, 1.0)])).unwrap();
        for tick in 0..200u32 {
            let command = hand.advance();
            let part = (tick.clamp(10, 110) - 10) as f32 / 100.0;
            // Two roundings of 6·10⁻⁸ relative.
            assert!((command.pose.position.x - 0.1 * part).abs() < 2e-8, "{tick}");
            assert!((command.push.z - part).abs() < 2e-7, "{tick}");
            let angle = 2.0 * libm::atan2f(command.pose.orientation.z, command.pose.orientation.w);
            assert!((angle - part).abs() < 2e-6, "{tick}: {angle}");
            let moving = tick > 10 && tick <= 110;
            // Difference of positions near 0.1 with 24 bits, a thousand times.
            let speed = if moving { 1.0 } else { 0.0 };
            assert!(
                (command.twist.linear.x - speed).abs() < 2e-5,
                "{tick}: {:?}",
                command.twist
            );
            // sin instead of angle for 0.01 rad: 2·10⁻⁵ relative; rounding 10⁻⁷ a thousand times.
            let rate = if moving { 10.0 } else { 0.0 };
            assert!(
                (command.twist.angular.z - rate).abs() < 1e-3,
                "{tick}: {:?}",
                command.twist
            );
        }
    }

    #[test]
    fn tremor_is_as_large_as_asked() {
        let mut trembling = script(&[frame(0, 0.0, 0.0)]);
        trembling.tremor = 1e-4;
        let mut hand = Hand::new(&trembling).unwrap();
        let mut largest = Vec3::ZERO;
        for _ in 0..1000 {
            largest = largest.max(hand.advance().pose.position.abs());
        }
        for peak in largest.to_array() {
            // 100 samples per turn: the nearest is at most 1.8° from the crest.
            assert!((0.999e-4..1.001e-4).contains(&peak), "{largest}");
        }
    }

    #[test]
    fn impossible_scripts_are_refused() {
        let good = script(&[frame(0, 0.0, 0.0), frame(5, 0.1, 0.2)]);
        assert_eq!(check_script(&good), Ok(()));
        let mut bad = [const { None }; 9];
        for (i, place) in bad.iter_mut().enumerate() {
            let mut s = good.clone();
            match i {
                0 => s.stiffness = f32::NAN,
                1 => s.damping = -1.0,
                2 => s.angular_stiffness = f32::INFINITY,
                3 => s.tremor = 1.0,
                4 => s.tremor_hz = 600.0,
                5 => s.keyframes.clear(),
                6 => s.keyframes[1].tick = 0,
                7 => s.keyframes[0].pose.orientation = [0.0; 4],
                _ => s.keyframes[1].push[2] = f32::NAN,
            }
            *place = Some(s);
        }
        for s in bad.iter().flatten() {
            assert_eq!(check_script(s), Err(Refusal::BadNumber), "{s:?}");
            assert!(Hand::new(s).is_none());
        }
    }
}
