//! Stability boundary of a wall, found by experiment with the product's own tick.
//!
//! The hand presses the part on a slab until it lies still, drops all damping but the plant's own, and flicks the handle. The criterion is whether
//! the vibration that follows decays or grows: the question of linear theory, applied to the whole loop with its encoder, coupling and contacts.

use mortise_haptics::Settings;
use mortise_protocol::image::SceneImage;

use super::bench::{Bench, HandCommand, Rig};
use super::oracle::{Law, Search, Wall, limit};
use super::sensor::{Sensor, Speed};

/// Press force, N.
const PRESS_N: f64 = 5.0;
/// Largest damping of the hand while it presses, N s/m, and duration of the press, s.
const CALM_N_S_PER_M: f64 = 20.0;
const CALM_S: f64 = 1.0;
/// Speed of the flick, m/s.
const FLICK_M_PER_S: f64 = 2e-3;
/// Duration of the observation, s, and the intervals at its beginning and end that are compared.
const WATCH_S: f64 = 8.0;
const PART: f64 = 0.2;
/// Vibration beyond this multiple of the flick's ends the observation: it has grown.
const GROWN: f64 = 20.0;

/// A wall rendered by the product's coupling, its object pinned by contact, without the valve: settings, and the sensor with the share of the speed
/// that the tick receives.
///
/// The coupling predicts one period ahead: it renders K·x + (b_T + T·K)·v̂. A textbook's wall of damping B is one with b_T = 0 that receives B/(T·K)
/// of the speed.
pub fn settings(law: Law, wall: &Wall, stiffness: f64) -> (Settings, Sensor) {
    let mut settings = open(wall.period_s);
    settings.coupling.k_t_n_per_m = stiffness as f32;
    let (damping, share) = match law {
        Law::Wall => (0.0, wall.damping / (wall.period_s * stiffness)),
        Law::Coupling => (wall.damping, 1.0),
    };
    settings.coupling.b_t = damping as f32;
    let sensor = Sensor {
        speed: Speed::Filtered {
            filter_s: wall.filter_s,
        },
        share,
        ..Sensor::EXACT
    };
    (settings, sensor)
}

/// Default settings at another period with all limits disabled, and contacts that deflect by less than a thousandth of a wall's deflection here.
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

/// Response to a flick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flick {
    /// Largest deviation at the beginning, m.
    pub first_m: f64,
    /// Largest deviation at the end, m.
    pub last_m: f64,
    /// Half of the range in which the handle moves at the end, m, wherever it came to rest; infinite when it has grown.
    pub ripple_m: f64,
    /// Deviation after the flick in a linear loop without damping, v·√(m/K), m: a vibration that has grown until limits saturate it may shrink again,
    /// but not as far as this.
    pub linear_m: f64,
}

impl Flick {
    /// True if the vibration decayed.
    pub fn dies_out(&self) -> bool {
        self.last_m < self.first_m && self.last_m < 2.0 * self.linear_m
    }
}

/// Presses part `part` on its support, flicks, and observes.
pub fn flick(scene: &SceneImage<'_>, part: u16, settings: &Settings, rig: &Rig) -> Flick {
    let mut bench = Bench::new(scene, part, *settings, *rig);
    let ticks = |s: f64| (s / f64::from(settings.period_s)).round() as u32;
    let calm = ticks(CALM_S);
    // At most critical damping: an overdamped handle on a soft wall would still be creeping.
    let critical = 2.0 * (f64::from(settings.coupling.k_t_n_per_m) * rig.plant.mass_kg).sqrt();
    bench.rig.plant.damping += critical.min(CALM_N_S_PER_M);
    // The push grows during half of that time.
    for i in 0..calm {
        let push = -PRESS_N * f64::from(2 * i).min(f64::from(calm)) / f64::from(calm);
        bench.step(&HandCommand {
            push,
            ..HandCommand::default()
        });
    }
    let press = HandCommand {
        push: -PRESS_N,
        ..HandCommand::default()
    };
    bench.rig.plant.damping = rig.plant.damping;
    let rest = bench.position;
    bench.speed += FLICK_M_PER_S;
    let watch = ticks(WATCH_S);
    let part = (PART * f64::from(watch)) as u32;
    let (mut first_m, mut last_m) = (0.0f64, 0.0f64);
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for i in 0..watch {
        bench.step(&press);
        let off = (bench.position - rest).abs();
        if i < part {
            first_m = first_m.max(off);
        } else if i >= watch - part || off > GROWN * first_m {
            last_m = last_m.max(off);
            low = low.min(bench.position);
            high = high.max(bench.position);
            if off > GROWN * first_m {
                high = f64::INFINITY;
                break;
            }
        }
    }
    Flick {
        first_m,
        last_m,
        ripple_m: 0.5 * (high - low),
        linear_m: FLICK_M_PER_S * (rig.plant.mass_kg / f64::from(settings.coupling.k_t_n_per_m)).sqrt(),
    }
}

/// Largest stiffness, N/m, at which the flick decays, with a wall that is otherwise `wall`; searched around `near`.
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
        let (settings, reported) = settings(law, wall, stiffness);
        let rig = Rig {
            sensor: Sensor {
                resolution_m: rig.sensor.resolution_m,
                ..reported
            },
            delay_ticks: wall.delay_ticks,
            ..*rig
        };
        let flick = flick(scene, part, &settings, &rig);
        // Motion below the encoder's resolution is invisible and not counted as vibration.
        flick.dies_out() || flick.last_m < 2.0 * rig.sensor.resolution_m
    })
}
