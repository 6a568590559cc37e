//! Encoder resolution against dry friction: the largest stiffness at which a pressed wall lets the handle rest.
//!
//! An encoder of step Δ turns a wall K into a staircase whose force jumps by K·Δ. Pressed with a force half-way between two stairs, the handle has no
//! equilibrium unless dry friction f_c holds the remaining half step, K·Δ/2. With viscous friction b against the sampled wall the whole condition is
//!
//! K ≤ min(2·b/T, 2·f_c/Δ)
//!
//! (J. J. Abbott and A. M. Okamura, *Effects of position quantization and sampling rate on virtual-wall passivity*, IEEE T-RO 21(5), 2005; N.
//! Diolaiti, G. Niemeyer, F. Barbagli and J. K. Salisbury, *Stability of haptic rendering: discretization, quantization, time delay, and Coulomb
//! effects*, IEEE T-RO 22(2), 2006). The second bound is sharp, as the experiment shows; beyond the first one dry friction still damps small motions,
//! so that the marks may lie above it.

use mortise_protocol::image::SceneImage;
use serde::Serialize;

use super::bench::{Bench, HandCommand, Rig};
use super::boundary::settings;
use super::oracle::{COARSE, Law, Wall, limit};
use super::sensor::Sensor;
use super::slab::Slab;
use crate::chart::{Axis, Chart, Line, Look, Point, Series};
use crate::error::LabError;
use crate::variant::Variant;

/// Mass of the handle, kg, its damping, N s/m, and the period, s.
const MASS_KG: f64 = 0.15;
const VISCOUS: f64 = 1.0;
const PERIOD_S: f64 = 1e-3;
/// Dry friction of the handle, N.
const COULOMB_N: [f64; 3] = [0.01, 0.03, 0.1];
/// Steps of the encoder, m.
const FINEST_M: f64 = 2e-6;
const COARSEST_M: f64 = 200e-6;
const STEPS: u32 = 8;
/// Approximate press force, N, adjusted to the fraction of a stair under test.
const PRESS_N: f64 = 5.0;
/// Fractions of a stair; a half is the worst case.
const FRACTIONS: [f64; 3] = [0.0, 0.25, 0.5];
/// Speed of the flick after the handle lies still, m/s.
const FLICK_M_PER_S: f64 = 0.05;
/// Duration of the observation, s, in the last part of which nothing may move.
const WATCH_S: f64 = 4.0;
const STILL_S: f64 = 0.5;
/// Start of the search as a fraction of the closed form. Not 1/n with odd n: there f_c is a whole number of half stairs, and the handle creeps
/// for ever.
const LEAST: f64 = 0.37;
/// Upper limit of the search, N/m.
const MOST_N_PER_M: f64 = 8e3;

/// One boundary.
#[derive(Clone, Debug, Serialize)]
pub struct Rest {
    /// f_c, N.
    pub coulomb_n: f64,
    /// Δ, µm.
    pub resolution_um: f64,
    /// Largest stiffness at which the handle comes to rest, N/m.
    pub experiment_n_per_m: f64,
    /// min(2·b/T, 2·f_c/Δ), N/m.
    pub formula_n_per_m: f64,
}

impl std::fmt::Display for Rest {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "encoder of {:.1} µm, dry friction {} N: rests up to {:.0} N/m, by the closed form {:.0} N/m",
            self.resolution_um, self.coulomb_n, self.experiment_n_per_m, self.formula_n_per_m
        )
    }
}

/// min(2·b/T, 2·f_c/Δ), N/m; the second bound is infinite for an exact encoder.
pub fn restful_stiffness(viscous: f64, period_s: f64, coulomb_n: f64, resolution_m: f64) -> f64 {
    (2.0 * viscous / period_s).min(2.0 * coulomb_n / resolution_m)
}

/// True if the handle, pressed on the support of part `part`, comes to rest on a wall of `stiffness` N/m at every tested fraction of a stair.
pub fn rests(scene: &SceneImage<'_>, part: u16, stiffness: f64, coulomb_n: f64, resolution_m: f64) -> bool {
    let wall = Wall {
        stiffness,
        damping: 0.0,
        filter_s: 0.0,
        period_s: PERIOD_S,
        delay_ticks: 0,
    };
    let (settings, sensor) = settings(Law::Wall, &wall, stiffness);
    let stair = stiffness * resolution_m;
    FRACTIONS.iter().all(|fraction| {
        let press = ((PRESS_N / stair).round() + fraction) * stair;
        let mut rig = Rig::bare(MASS_KG, VISCOUS);
        rig.coulomb_n = coulomb_n;
        rig.sensor = Sensor {
            resolution_m,
            ..sensor
        };
        let mut bench = Bench::new(scene, part, settings, rig);
        // Critically damped while it sinks in, with a time constant of √(m/K).
        bench.rig.plant.damping += 2.0 * (stiffness * MASS_KG).sqrt();
        let calm = ((20.0 * (MASS_KG / stiffness).sqrt()).max(0.2) / PERIOD_S) as u32;
        for i in 0..calm {
            let push = -press * f64::from(2 * i).min(f64::from(calm)) / f64::from(calm);
            bench.step(&HandCommand {
                push,
                ..HandCommand::default()
            });
        }
        bench.rig.plant.damping = VISCOUS;
        bench.speed += FLICK_M_PER_S;
        let command = HandCommand {
            push: -press,
            ..HandCommand::default()
        };
        let (watch, still) = ((WATCH_S / PERIOD_S) as u32, (STILL_S / PERIOD_S) as u32);
        for _ in 0..watch - still {
            bench.step(&command);
        }
        let at = bench.position;
        // A handle held by dry friction does not move at all.
        (0..still).all(|_| {
            bench.step(&command);
            bench.position == at
        })
    })
}

/// The boundary for each friction and encoder; passes each to `out`.
///
/// # Errors
/// Anything that prevents the scene from being baked.
pub fn sweep(quick: bool, out: &mut dyn FnMut(&Rest)) -> Result<Vec<Rest>, LabError> {
    let slab = Slab::bake(&Variant::board(1.0), 10.0, 0.0)?;
    let scene = slab.scene()?;
    let mut found = Vec::new();
    for coulomb_n in COULOMB_N {
        let steps = if quick { 2 } else { STEPS };
        for i in 0..steps {
            let resolution_m = FINEST_M * (COARSEST_M / FINEST_M).powf(f64::from(i) / f64::from(steps - 1));
            let formula = restful_stiffness(VISCOUS, PERIOD_S, coulomb_n, resolution_m);
            let experiment = limit(LEAST * formula, MOST_N_PER_M, COARSE, |stiffness| {
                rests(&scene, slab.part, stiffness, coulomb_n, resolution_m)
            });
            let rest = Rest {
                coulomb_n,
                resolution_um: 1e6 * resolution_m,
                experiment_n_per_m: experiment,
                formula_n_per_m: formula,
            };
            out(&rest);
            found.push(rest);
        }
    }
    Ok(found)
}

/// Largest stiffness over the encoder's step.
pub fn chart(found: &[Rest]) -> Chart {
    const LINE_POINTS: u32 = 80;
    let mut series = Vec::new();
    for (index, coulomb_n) in COULOMB_N.into_iter().enumerate() {
        series.push(Series {
            name: format!("dry friction {coulomb_n} N"),
            look: Look::nth(index),
            line: Line::None,
            points: (found.iter().filter(|rest| rest.coulomb_n == coulomb_n))
                .map(|rest| Point {
                    x: rest.resolution_um,
                    y: rest.experiment_n_per_m,
                    label: String::new(),
                    at_least: rest.experiment_n_per_m >= MOST_N_PER_M,
                })
                .collect(),
        });
        series.push(Series {
            name: if index == 0 {
                "min(2·b/T, 2·f_c/Δ)".into()
            } else {
                String::new()
            },
            look: Look::Black,
            line: Line::Trace,
            points: (0..LINE_POINTS)
                .map(|i| {
                    let share = f64::from(i) / f64::from(LINE_POINTS - 1);
                    let resolution_m = FINEST_M * (COARSEST_M / FINEST_M).powf(share);
                    Point {
                        x: 1e6 * resolution_m,
                        y: restful_stiffness(VISCOUS, PERIOD_S, coulomb_n, resolution_m),
                        ..Point::default()
                    }
                })
                .collect(),
        });
    }
    Chart {
        title: "Largest stiffness at which a pressed handle rests, over the encoder's step".into(),
        note: "Handle 0.15 kg, 1 N s/m, 1 kHz, wall K·x; pressed with 5 N to any place between two steps, and flicked. Lines: Abbott and Okamura 2005.".into(),
        x: Axis::new("step of the encoder at the handle Δ, µm"),
        y: Axis::new("largest stiffness that rests, N/m"),
        series,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Half-way between two stairs only dry friction holds: the closed form is the limit of that, approached from either side.
    #[test]
    fn dry_friction_holds_half_a_stair_and_no_more() {
        let slab = Slab::bake(&Variant::board(1.0), 10.0, 0.0).expect("baked");
        let scene = slab.scene().expect("sound");
        let formula = restful_stiffness(VISCOUS, PERIOD_S, 0.03, 100e-6);
        assert_eq!(formula, 600.0);
        assert!(rests(&scene, slab.part, 0.9 * formula, 0.03, 100e-6));
        assert!(!rests(&scene, slab.part, 1.1 * formula, 0.03, 100e-6));
    }
}
