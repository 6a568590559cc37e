//! Where a wall becomes unstable, found by experiment on the product's own tick.
//!
//! The hand presses the part on a slab until it lies still, lets go of all damping of its own but the plant's, and flicks the handle. Whether the
//! trembling that follows dies out or grows is what is looked at: linear theory's own question, asked of the whole loop with its encoder, its
//! coupling and its contacts.

use mortise_haptics::Settings;
use mortise_protocol::image::SceneImage;

use super::bench::{Bench, Rig, Sensor, Wish};
use super::oracle::{Law, Search, Wall, limit};

/// Pressed with this force, N.
const PRESS_N: f64 = 5.0;
/// Damping of the hand while it presses, N s/m at the most, and how long that takes, s.
const CALM_N_S_PER_M: f64 = 20.0;
const CALM_S: f64 = 1.0;
/// The flick, m/s.
const FLICK_M_PER_S: f64 = 2e-3;
/// How long trembling is watched, s, and the parts of it at its beginning and end that are compared.
const WATCH_S: f64 = 8.0;
const PART: f64 = 0.2;
/// Trembling beyond this multiple of what the flick gave ends the watch: it has grown.
const GROWN: f64 = 20.0;

/// A wall rendered by the product's coupling, its object pinned by contact, without the valve: settings, and what the sensor tells of the speed.
///
/// The coupling looks a period ahead: it gives K·x + (b_T + T·K)·v̂. A textbook's wall of damping B is one with b_T = 0 that is told B/(T·K) of the
/// speed.
pub fn settings(law: Law, wall: &Wall, stiffness: f64) -> (Settings, Sensor) {
    let mut settings = open(wall.period_s);
    settings.coupling.k_t_n_per_m = stiffness as f32;
    let (damping, share) = match law {
        Law::Wall => (0.0, wall.damping / (wall.period_s * stiffness)),
        Law::Coupling => (wall.damping, 1.0),
    };
    settings.coupling.b_t = damping as f32;
    let sensor = Sensor {
        filter_s: wall.filter_s,
        share,
        ..Sensor::EXACT
    };
    (settings, sensor)
}

/// Default settings at another period with every limit out of the way, and contacts that give way by less than a thousandth of what a wall here does.
pub fn open(period_s: f64) -> Settings {
    let mut settings = Settings {
        period_s: period_s as f32,
        ..Settings::default()
    };
    settings.coupling.force_max_n = 100.0;
    settings.contact.stiffness_n_per_m = 10e6;
    settings.contact.total_stiffness_n_per_m = 1e9;
    settings.limits.force_n = 100.0;
    settings.limits.force_slew_n_per_s = 1e6;
    settings.passivity.tank_j = 0.0;
    settings
}

/// What a flick led to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flick {
    /// Largest deviation at the beginning and at the end, m.
    pub first_m: f64,
    /// See `first_m`.
    pub last_m: f64,
    /// Deviation of the flick in a linear loop without damping, v·√(m/K), m: trembling that has grown to what limits it may fall again, but not so
    /// far.
    pub linear_m: f64,
}

impl Flick {
    /// Whether the trembling died out.
    pub fn dies_out(&self) -> bool {
        self.last_m < self.first_m && self.last_m < 2.0 * self.linear_m
    }
}

/// Presses part `part` on what it stands on, flicks, and watches.
pub fn flick(scene: &SceneImage<'_>, part: u16, settings: &Settings, rig: &Rig) -> Flick {
    let mut bench = Bench::new(scene, part, *settings, *rig);
    let ticks = |s: f64| (s / f64::from(settings.period_s)).round() as u32;
    let calm = ticks(CALM_S);
    // No more than critical: an overdamped handle on a soft wall would still be creeping.
    let critical = 2.0 * (f64::from(settings.coupling.k_t_n_per_m) * rig.plant.mass_kg).sqrt();
    bench.rig.plant.damping += critical.min(CALM_N_S_PER_M);
    // The push grows in half of that time.
    for i in 0..calm {
        let push = -PRESS_N * f64::from(2 * i).min(f64::from(calm)) / f64::from(calm);
        bench.step(&Wish {
            push,
            ..Wish::default()
        });
    }
    let press = Wish {
        push: -PRESS_N,
        ..Wish::default()
    };
    bench.rig.plant.damping = rig.plant.damping;
    let rest = bench.position;
    bench.speed += FLICK_M_PER_S;
    let watch = ticks(WATCH_S);
    let part = (PART * f64::from(watch)) as u32;
    let (mut first_m, mut last_m) = (0.0f64, 0.0f64);
    for i in 0..watch {
        bench.step(&press);
        let off = (bench.position - rest).abs();
        if i < part {
            first_m = first_m.max(off);
        } else if i >= watch - part || off > GROWN * first_m {
            last_m = last_m.max(off);
            if off > GROWN * first_m {
                break;
            }
        }
    }
    Flick {
        first_m,
        last_m,
        linear_m: FLICK_M_PER_S * (rig.plant.mass_kg / f64::from(settings.coupling.k_t_n_per_m)).sqrt(),
    }
}

/// Largest stiffness, N/m, at which the flick dies out, with a wall that is otherwise `wall`; looked for around `near`.
pub fn stiffness_limit(
    scene: &SceneImage<'_>,
    part: u16,
    rig: &Rig,
    law: Law,
    wall: &Wall,
    near: f64,
    search: Search,
) -> f64 {
    let around = if search.steps > 10 { 4.0 } else { 2.0 };
    limit(near / around, near * around, search, |stiffness| {
        let (settings, told) = settings(law, wall, stiffness);
        let rig = Rig {
            sensor: Sensor {
                resolution_m: rig.sensor.resolution_m,
                ..told
            },
            delay_ticks: wall.delay_ticks,
            ..*rig
        };
        let flick = flick(scene, part, &settings, &rig);
        // What is smaller than the encoder tells is not seen, and no trembling.
        flick.dies_out() || flick.last_m < 2.0 * rig.sensor.resolution_m
    })
}
