//! Both velocity estimators on the same motions and in the same sampled loop: noise, delay, and the stiffest wall at which each is stable.
//!
//! `cargo test -p mortise-mechanism --test velocity -- --ignored --nocapture` prints the whole table.

use mortise_mechanism::interface::TICK_S;
use mortise_mechanism::velocity::{AdaptiveWindow, Estimator, LowPass, low_pass};
use std::f64::consts::{PI, SQRT_2, TAU};

/// T, s.
const PERIOD: f64 = TICK_S as f64;
/// τ of the low-pass, s.
const FILTER: f64 = low_pass::VELOCITY_FILTER_S as f64;

/// Speeds in counts a tick, of positions in counts that the encoder rounds.
fn estimates<E: Estimator>(positions: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut estimator = E::AT_REST;
    let mut last = 0;
    positions
        .map(|position| {
            let count = position.round() as i32;
            let moved = count - last;
            last = count;
            f64::from(estimator.update(moved, 1.0)) * PERIOD
        })
        .collect()
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0u32), |(sum, count), value| {
        (sum + value * value, count + 1)
    });
    (sum / f64::from(count)).sqrt()
}

/// Pseudo-random bits (xorshift), the same on every run.
struct Bits(u32);

impl Bits {
    fn next(&mut self) -> bool {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        self.0 & 1 == 1
    }
}

/// Noise at rest on the edge of a count: each reading is randomly one of two counts. rms, counts a tick.
fn noise_at_rest<E: Estimator>() -> f64 {
    let mut bits = Bits(20_261_123);
    let found = estimates::<E>((0..40_000).map(|_| f64::from(u8::from(bits.next()))));
    rms(found.into_iter().skip(100))
}

/// Error at constant speeds from 0 to 2 counts a tick. rms, counts a tick.
fn noise_in_motion<E: Estimator>() -> f64 {
    let speeds = (1..200).map(|i| 0.01 * f64::from(i) + 0.001 * (f64::from(i) * PI).sin());
    rms(speeds.flat_map(|speed| {
        let found = estimates::<E>((0..400).map(move |tick| speed * f64::from(tick)));
        found.into_iter().skip(200).map(move |estimate| estimate - speed)
    }))
}

/// Gain and delay (s) of the estimate of a motion of `amplitude` counts at `hz`: its component at that frequency.
fn response<E: Estimator>(amplitude: f64, hz: f64) -> (f64, f64) {
    let step = TAU * hz * PERIOD;
    let (settle, ticks) = (2_000u32, 20_000u32);
    let found = estimates::<E>((0..ticks).map(|tick| amplitude * (step * f64::from(tick)).sin()));
    let (mut along, mut across) = (0.0, 0.0);
    for tick in settle..ticks {
        let estimate = found[tick as usize];
        along += estimate * (step * f64::from(tick)).cos();
        across += estimate * (step * f64::from(tick)).sin();
    }
    let scale = 2.0 / f64::from(ticks - settle);
    let (along, across) = (along * scale, across * scale);
    // True speed: amplitude·step·cos.
    let gain = along.hypot(across) / (amplitude * step);
    (gain, across.atan2(along) / (TAU * hz))
}

/// A handle pressed on a sampled wall.
#[derive(Clone, Copy)]
struct Wall {
    /// K, N/m.
    stiffness: f64,
    /// Damping on the estimate, N·s/m.
    damping: f64,
    /// Encoder's step, m.
    step: f64,
    /// Delay from reading to force, ticks.
    delay: usize,
    /// Hand on the handle: stiffness N/m, damping N·s/m.
    hand: [f64; 2],
}

/// Handle, kg and N·s/m: the lab's bare handle.
const MASS: f64 = 0.15;
const VISCOUS: f64 = 1.0;

struct Loop<E> {
    wall: Wall,
    estimator: E,
    count: i32,
    x: f64,
    v: f64,
    under_way: Vec<f64>,
}

impl<E: Estimator> Loop<E> {
    fn new(wall: Wall) -> Self {
        Self {
            wall,
            estimator: E::AT_REST,
            count: 0,
            x: 0.0,
            v: 0.0,
            under_way: vec![0.0; wall.delay],
        }
    }

    /// One tick and the period after it, about the equilibrium of the press and the wall; returns the wall's force.
    fn tick(&mut self) -> f64 {
        let Wall {
            stiffness,
            damping,
            step,
            hand,
            ..
        } = self.wall;
        let count = (self.x / step).round() as i32;
        let moved = count - self.count;
        self.count = count;
        let speed = f64::from(self.estimator.update(moved, step as f32));
        self.under_way
            .push(-stiffness * f64::from(count) * step - damping * speed);
        let force = self.under_way.remove(0);
        const SUBSTEPS: u32 = 4;
        let h = PERIOD / f64::from(SUBSTEPS);
        for _ in 0..SUBSTEPS {
            let rate = |x: f64, v: f64| (v, (force - hand[0] * x - (hand[1] + VISCOUS) * v) / MASS);
            let a = rate(self.x, self.v);
            let b = rate(self.x + 0.5 * h * a.0, self.v + 0.5 * h * a.1);
            let c = rate(self.x + 0.5 * h * b.0, self.v + 0.5 * h * b.1);
            let d = rate(self.x + h * c.0, self.v + h * c.1);
            self.x += h / 6.0 * (a.0 + 2.0 * b.0 + 2.0 * c.0 + d.0);
            self.v += h / 6.0 * (a.1 + 2.0 * b.1 + 2.0 * c.1 + d.1);
        }
        force
    }
}

/// Displaced by 20 counts or set off at 2 mm/s, the handle comes to rest within 4 s: the remaining trembling is below two counts, which the encoder
/// cannot distinguish from rest.
fn dies_out<E: Estimator>(wall: Wall) -> bool {
    let mut tried = Loop::<E>::new(wall);
    let frequency = (wall.stiffness / MASS).sqrt();
    let flick = (20.0 * wall.step * frequency).max(2e-3);
    tried.v = flick;
    let mut last = 0.0f64;
    for tick in 0..4_000 {
        tried.tick();
        if tick >= 3_200 {
            last = last.max(tried.x.abs());
        }
        if tried.x.abs() > 100.0 * flick / frequency {
            return false;
        }
    }
    last < 2.0 * wall.step
}

/// Largest K at which the disturbance dies out, N/m, within 1 %, at most 40 kN/m; the wall's damping is `damping(K)`.
fn stiffness_limit<E: Estimator>(damping: impl Fn(f64) -> f64, wall: Wall) -> f64 {
    const LEAST: f64 = 100.0;
    const MOST: f64 = 40_000.0;
    let stable = |stiffness: f64| {
        dies_out::<E>(Wall {
            stiffness,
            damping: damping(stiffness),
            ..wall
        })
    };
    let at = |i: u32| LEAST * (MOST / LEAST).powf(f64::from(i) / 24.0);
    let Some(first) = (0..=24).find(|&i| !stable(at(i))) else {
        return MOST;
    };
    if first == 0 {
        return 0.0;
    }
    let (mut low, mut high) = (at(first - 1), at(first));
    while high / low > 1.01 {
        let middle = (low * high).sqrt();
        if stable(middle) {
            low = middle
        } else {
            high = middle
        }
    }
    (low * high).sqrt()
}

const BARE: Wall = Wall {
    stiffness: 0.0,
    damping: 0.0,
    step: 5e-6,
    delay: 0,
    hand: [0.0; 2],
};

/// The product's coupling looks a period ahead: K·x + (b_T + T·K)·v, b_T = 20 N·s/m.
fn coupling(stiffness: f64) -> f64 {
    20.0 + PERIOD * stiffness
}

/// Largest stable stiffness of the coupling on a bare handle with an encoder of 5 µm, `delay` ticks late, kN/m.
fn bare_limit<E: Estimator>(delay: usize) -> f64 {
    1e-3 * stiffness_limit::<E>(coupling, Wall { delay, ..BARE })
}

fn assert_near(found: f64, expected: f64, tolerance: f64, what: &str) {
    assert!(
        (found - expected).abs() <= tolerance * expected,
        "{what}: {found}, not {expected}"
    );
}

/// White noise of σ = 1/2 on each reading. Low-pass H = g·(1 − z⁻¹)/(1 − ρ·z⁻¹), ρ = 1 − g: variance g²·σ²·2/(1 + ρ). A window of n ticks, full
/// because no chord leaves its count: the difference of two readings over n, σ·√2/n. 40,000 samples leave 1 % of a variance.
#[test]
fn noise_at_rest_is_the_closed_form() {
    let gain = PERIOD / (FILTER + PERIOD);
    let low_pass = gain * 0.5 * (2.0 / (2.0 - gain)).sqrt();
    assert_near(noise_at_rest::<LowPass>(), low_pass, 0.01, "low-pass");
    let window = |ticks: f64| 0.5 * SQRT_2 / ticks;
    assert_near(
        noise_at_rest::<AdaptiveWindow<16>>(),
        window(16.0),
        0.01,
        "16 ticks",
    );
    assert_near(noise_at_rest::<AdaptiveWindow<6>>(), window(6.0), 0.01, "6 ticks");
}

/// Slow motion delays a low-pass by τ, and any difference over n ticks by n·h/2; the low-pass differentiates over one.
#[test]
fn delay_of_slow_motion_is_the_closed_form() {
    let (gain, delay) = response::<LowPass>(1e5, 1.0);
    assert_near(gain, 1.0, 1e-3, "gain");
    assert_near(delay, FILTER + 0.5 * PERIOD, 1e-3, "low-pass");
    // Five counts at 5 Hz: no chord of 16 ticks leaves its count.
    let (_, delay) = response::<AdaptiveWindow<16>>(5.0, 5.0);
    assert_near(delay, 8.0 * PERIOD, 1e-3, "16 ticks");
    // At 200 counts and 20 Hz the window is a tick or two long.
    let (gain, delay) = response::<AdaptiveWindow<16>>(200.0, 20.0);
    assert_near(gain, 1.0, 0.01, "gain");
    assert!((0.5 * PERIOD..1.0 * PERIOD).contains(&delay), "{delay}");
}

/// A step of speed to v: the low-pass has v·(1 − ρᵏ) after k ticks; the window excludes samples that no chord reaches within a count.
#[test]
fn a_step_of_speed_is_the_closed_form() {
    let found = estimates::<LowPass>((0..20).map(|tick| 30.0 * f64::from(tick)));
    for (tick, estimate) in found.into_iter().enumerate() {
        let expected = 30.0 * (1.0 - 0.75f64.powi(tick as i32));
        assert!((estimate - expected).abs() < 1e-4, "{tick}: {estimate}");
    }
    let found = estimates::<AdaptiveWindow<16>>((0..20).map(|tick| 3.0 * f64::from(tick)));
    assert!(found[1..].iter().all(|&estimate| (estimate - 3.0).abs() < 1e-5));
}

/// Steady speeds of 0 to 2 counts a tick.
#[test]
fn noise_in_motion_is_as_measured() {
    assert_near(noise_in_motion::<LowPass>(), 0.0773, 0.02, "low-pass");
    assert_near(noise_in_motion::<AdaptiveWindow<16>>(), 0.0256, 0.02, "16 ticks");
    assert_near(noise_in_motion::<AdaptiveWindow<6>>(), 0.0682, 0.02, "6 ticks");
}

/// The stiffest coupling on which a bare handle comes to rest: with delay the low-pass allows more than 16 ticks do; 6 ticks allow as much with delay
/// and more without.
#[test]
fn the_stiffest_wall_is_as_measured() {
    assert_near(bare_limit::<LowPass>(0), 17.3, 0.05, "low-pass");
    assert_near(bare_limit::<LowPass>(1), 5.94, 0.05, "low-pass, late");
    assert_near(bare_limit::<AdaptiveWindow<16>>(0), 19.3, 0.05, "16 ticks");
    assert_near(bare_limit::<AdaptiveWindow<16>>(1), 3.72, 0.05, "16 ticks, late");
    assert_near(bare_limit::<AdaptiveWindow<6>>(0), 23.3, 0.05, "6 ticks");
    assert_near(bare_limit::<AdaptiveWindow<6>>(1), 5.80, 0.05, "6 ticks, late");
    // A wall of 40 N·s/m, a tick late.
    let late = Wall { delay: 1, ..BARE };
    let low_pass = 1e-3 * stiffness_limit::<LowPass>(|_| 40.0, late);
    assert_near(low_pass, 6.08, 0.05, "low-pass, damped and late");
    let window = 1e-3 * stiffness_limit::<AdaptiveWindow<16>>(|_| 40.0, late);
    assert!(window < 0.3, "16 ticks, damped and late: {window}");
}

fn column<E: Estimator>(name: &str) {
    println!("{name}");
    println!(
        "  noise, rms counts/tick: {:.4} at rest, {:.4} in motion",
        noise_at_rest::<E>(),
        noise_in_motion::<E>()
    );
    for (amplitude, hz) in [
        (5.0, 5.0),
        (200.0, 5.0),
        (5.0, 20.0),
        (20.0, 20.0),
        (200.0, 20.0),
        (20.0, 50.0),
    ] {
        let (gain, delay) = response::<E>(amplitude, hz);
        println!(
            "  {amplitude} counts at {hz} Hz: gain {gain:.3}, delay {:.2} ms",
            1e3 * delay
        );
    }
    for (hand, who) in [([0.0, 0.0], "nobody"), ([400.0, 4.0], "hand of 400 N/m")] {
        for (step, delay) in [(5e-6, 0), (5e-6, 1), (64e-6, 0), (64e-6, 1)] {
            let wall = Wall {
                step,
                delay,
                hand,
                ..BARE
            };
            let of = |damping: f64| stiffness_limit::<E>(|_| damping, wall);
            println!(
                "  {who}, {:.0} µm, {delay} late: coupling {:.0}; wall of B = 0, 5, 10, 20, 40: {:.0} {:.0} {:.0} {:.0} {:.0} N/m",
                step * 1e6,
                stiffness_limit::<E>(coupling, wall),
                of(0.0),
                of(5.0),
                of(10.0),
                of(20.0),
                of(40.0),
            );
        }
    }
}

#[test]
#[ignore = "a table to read"]
fn whole_table() {
    column::<LowPass>("low-pass of 3 ms");
    column::<AdaptiveWindow<16>>("adaptive window of 16 ticks");
    column::<AdaptiveWindow<8>>("adaptive window of 8 ticks");
    column::<AdaptiveWindow<6>>("adaptive window of 6 ticks");
    column::<AdaptiveWindow<4>>("adaptive window of 4 ticks");
}
