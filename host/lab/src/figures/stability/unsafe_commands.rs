//! Random inputs to the tick, with a check of every force command.
//!
//! A command is unsafe if it is not finite, exceeds the limits in force, or delivers power into a wall: the peg is pressed onto the slab, the handle
//! is beyond it and moves further, and the force points the same way. That last count excludes ticks in which the slew limit still reduces an earlier
//! force, and those in which the peg does not touch or moves ahead of the handle. One input in twenty is absurd (not a number, infinite, of absurd
//! magnitude, not a rotation); limits and gains change at random every 500 inputs. The tick uses the implicit step, the board's default.

use std::thread;

use fastrand::Rng;
use mortise_haptics::{Flags, Input, Pose, Quat, Settings, State, Twist, Vec3, tick};
use mortise_protocol::image::SceneImage;

use crate::LabError;
use crate::figures::{Plan, Row};
use crate::stability::slab::Slab;
use crate::variant::Variant;

/// Number of inputs, in the full and in the shorter form.
const INPUTS: u64 = 10_000_000;
const QUICK: u64 = 200_000;
/// Threads; each draws inputs of its own.
const SHARES: u64 = 2;
/// Inputs from one grab to the next.
const EPISODE: u64 = 500;
/// Ticks from one velocity of the hand to the next.
const STROKE: u64 = 20;
/// Force of the slab on the peg above which the peg counts as touching, N.
const TOUCHING_N: f32 = 0.5;
/// Distance of the handle beyond the wall above which it counts as beyond, m: far more than the peg sinks in.
const BEYOND_M: f32 = 0.5e-3;
/// Smallest force into the wall that counts, N: a thousandth of the smallest limit.
const LEAST_N: f32 = 2e-3;
/// Tolerance of the limit: rounding of the vector's length.
const ROUNDING: f32 = 1.000_001;

/// Counts of unsafe commands.
#[derive(Clone, Copy, Debug, Default)]
struct Unsafe {
    inputs: u64,
    /// Inputs while the peg was pressed into the slab.
    at_wall: u64,
    /// Inputs whose command was not zero.
    felt: u64,
    not_finite: u64,
    beyond: u64,
    into_wall: u64,
}

/// Three rows that must be 0, and the number of inputs behind them.
///
/// # Errors
/// Anything that prevents the scene from being baked.
pub fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let inputs = if plan.quick { QUICK } else { INPUTS };
    let slab = Slab::bake(&Variant::board(1.0), 10.0, 0.0)?;
    let scene = slab.scene()?;
    let mut sum = Unsafe::default();
    thread::scope(|scope| {
        let shares: Vec<_> = (0..SHARES)
            .map(|share| {
                let (scene, part) = (&scene, slab.part);
                scope.spawn(move || share_of(scene, part, inputs / SHARES, share))
            })
            .collect();
        for share in shares {
            // A panic of the tick is the failure under test: propagate it.
            let found = share
                .join()
                .unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            sum.inputs += found.inputs;
            sum.at_wall += found.at_wall;
            sum.felt += found.felt;
            sum.not_finite += found.not_finite;
            sum.beyond += found.beyond;
            sum.into_wall += found.into_wall;
        }
    });
    let form = if plan.quick { ", shorter form" } else { "" };
    let what = format!("random inputs to the tick{form}");
    out(Row::within(
        format!("{what}: how many"),
        sum.inputs as f64,
        "",
        inputs as f64,
        f64::INFINITY,
    ));
    // Without forces the zeros below would prove nothing.
    out(Row::within(
        format!("{what}: share with a force"),
        share(sum.felt, sum.inputs),
        "%",
        50.0,
        100.0,
    ));
    out(Row::within(
        format!("{what}: share pressed into the wall"),
        share(sum.at_wall, sum.inputs),
        "%",
        10.0,
        90.0,
    ));
    for (unsafe_one, count) in [
        ("not finite", sum.not_finite),
        ("beyond the limit", sum.beyond),
        ("into the wall", sum.into_wall),
    ] {
        out(Row::exactly(
            format!("{what}: commands {unsafe_one}"),
            count as f64,
            "",
            0.0,
        ));
    }
    Ok(())
}

fn share(part: u64, all: u64) -> f64 {
    100.0 * part as f64 / all.max(1) as f64
}

/// Random numbers, the same in every run.
struct Random(Rng);

impl Random {
    fn even(&mut self, from: f32, to: f32) -> f32 {
        from + (to - from) * self.0.f32()
    }

    fn vector(&mut self, size: f32) -> Vec3 {
        Vec3::new(
            self.even(-size, size),
            self.even(-size, size),
            self.even(-size, size),
        )
    }

    fn one_in(&mut self, n: u64) -> bool {
        self.0.u64(..n) == 0
    }

    fn absurd(&mut self) -> f32 {
        const ABSURD: [f32; 10] = [
            f32::NAN,
            f32::INFINITY,
            f32::NEG_INFINITY,
            f32::MAX,
            f32::MIN,
            f32::MIN_POSITIVE,
            1e-42,
            -0.0,
            1e20,
            -99.9,
        ];
        ABSURD[self.0.usize(..ABSURD.len())]
    }
}

/// Inputs of one thread.
fn share_of(scene: &SceneImage<'_>, part: u16, inputs: u64, share: u64) -> Unsafe {
    let mut random = Random(Rng::with_seed(0x5afe ^ share));
    let mut state = Box::new(State::new());
    let mut found = Unsafe::default();
    let mut settings = Settings::default();
    let mut hand = Hand::at_rest();
    while found.inputs < inputs {
        if found.inputs.is_multiple_of(EPISODE) {
            state.load_scene(scene);
            // The peg stands on the slab; the handle grabs it at the world's origin. It can be grabbed: the baker made it so.
            let grabbed = state.grab(scene, part, &Pose::IDENTITY);
            debug_assert!(grabbed.is_ok(), "{grabbed:?}");
            hand = Hand::at_rest();
            settings = some_settings(&mut random);
        }
        if found.inputs.is_multiple_of(STROKE) {
            hand.turn(&mut random);
        }
        let absurd = random.one_in(20);
        let input = if absurd {
            hand.absurd(&mut random)
        } else {
            hand.moved()
        };
        let output = tick(&mut state, scene, &settings, &input);
        found.inputs += 1;
        let (force, torque) = (output.handle.force, output.handle.torque);
        if !(force.is_finite() && torque.is_finite()) {
            found.not_finite += 1;
            continue;
        }
        found.felt += u64::from(force.length() > 0.0);
        let limits = &settings.limits;
        if force.length() > limits.force_n * ROUNDING || torque.length() > limits.torque_nm * ROUNDING {
            found.beyond += 1;
        }
        let taking_back = output.work.flags.intersects(Flags::FORCE_SLEW);
        let into = input.handle.position.z < -BEYOND_M && input.handle_twist.linear.z < 0.0;
        // Speed of the peg's point under the handle; `object` is about the peg's own frame, the twist about its centre of mass. A peg that falls flat
        // onto the slab from its rim may run ahead of the handle and drags it along as a body does; the wall does not cause that.
        let peg = output.object_twist;
        let arm = input.handle.position - output.object.position;
        let ahead = (peg.linear + peg.angular.cross(arm)).z < input.handle_twist.linear.z;
        if !absurd && !taking_back && !ahead && into && output.contact.force.z > TOUCHING_N {
            found.at_wall += 1;
            found.into_wall += u64::from(force.z < -LEAST_N);
        }
    }
    found
}

/// A hand that wanders over the slab and into it.
struct Hand {
    position: Vec3,
    linear: Vec3,
    turn: Vec3,
    angular: Vec3,
}

impl Hand {
    fn at_rest() -> Self {
        Self {
            position: Vec3::ZERO,
            linear: Vec3::ZERO,
            turn: Vec3::ZERO,
            angular: Vec3::ZERO,
        }
    }

    /// Draws another velocity, back when the hand is too far out. Within 8 mm the peg stays over the slab.
    fn turn(&mut self, random: &mut Random) {
        self.linear = random.vector(0.4);
        self.angular = random.vector(1.0);
        let (low, high) = (Vec3::new(-0.008, -0.008, -0.010), Vec3::new(0.008, 0.008, 0.001));
        for axis in 0..3 {
            if self.position[axis] < low[axis] {
                self.linear[axis] = self.linear[axis].abs();
            } else if self.position[axis] > high[axis] {
                self.linear[axis] = -self.linear[axis].abs();
            }
            if self.turn[axis].abs() > 0.1 {
                self.angular[axis] = -self.angular[axis].abs() * self.turn[axis].signum();
            }
        }
    }

    /// Moves on by one tick.
    fn moved(&mut self) -> Input {
        const TICK_S: f32 = 1e-3;
        self.position += self.linear * TICK_S;
        self.turn += self.angular * TICK_S;
        Input {
            handle: Pose::new(self.position, Quat::from_scaled_axis(self.turn)),
            handle_twist: Twist {
                linear: self.linear,
                angular: self.angular,
            },
            enabled: true,
        }
    }

    /// The same input with one absurd number.
    fn absurd(&self, random: &mut Random) -> Input {
        let number = random.absurd();
        let mut position = self.position;
        let mut orientation = Quat::from_scaled_axis(self.turn).to_array();
        let (mut linear, mut angular) = (self.linear, self.angular);
        let axis = random.0.usize(..3);
        match random.0.u8(..4) {
            0 => position[axis] = number,
            1 => orientation[axis] = number,
            2 => linear[axis] = number,
            _ => angular[axis] = number,
        }
        Input {
            handle: Pose::new(position, Quat::from_array(orientation)),
            handle_twist: Twist { linear, angular },
            enabled: true,
        }
    }
}

/// Gains and limits that an operator can set.
fn some_settings(random: &mut Random) -> Settings {
    let mut settings = Settings::default();
    settings.coupling.k_t_n_per_m = random.even(200.0, 2000.0);
    settings.coupling.b_t = random.even(1.0, 20.0);
    settings.contact.stiffness_n_per_m = random.even(2e4, 2e6);
    settings.limits.force_n = random.even(2.0, 20.0);
    settings.limits.torque_nm = random.even(0.05, 1.0);
    settings.limits.force_slew_n_per_s = random.even(2_000.0, 20_000.0);
    settings
}
