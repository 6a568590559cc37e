//! Velocity estimators side by side in the product's own loop: the largest coupling stiffness at which a flicked handle comes to rest, over the
//! encoder's step, with forces in time and late.
//!
//! The estimator feeds the coupling's damping, (b_T + T·K)·v̂: delay and rounding in v̂ destabilise the loop. The handle is bare, without dry
//! friction: the worst case. It counts as at rest when its remaining motion is below two steps of the encoder, which the encoder cannot tell from
//! rest.

use mortise_protocol::image::SceneImage;
use serde::Serialize;

use super::bench::Rig;
use super::boundary::{flick, settings};
use super::oracle::{COARSE, Law, Wall, limit};
use super::sensor::{Counted, Sensor, Speed};
use super::slab::Slab;
use crate::chart::{Axis, Chart, Line, Look, Point, Series};
use crate::error::LabError;
use crate::variant::Variant;

/// Mass of the handle, kg, its damping, N s/m, and the tick, s.
const MASS_KG: f64 = 0.15;
const VISCOUS: f64 = 1.0;
const TICK_S: f64 = 1e-3;
/// b_T, N s/m: the default.
const DAMPING: f64 = 20.0;
/// Encoder steps at the handle, m: the finest and the coarsest, and their number.
const FINEST_M: f64 = 1e-6;
const COARSEST_M: f64 = 50e-6;
const STEPS: u32 = 6;
/// Delays from reading to force, ticks.
pub const DELAYS: [usize; 3] = [0, 1, 2];
/// Range of the search, N/m.
const LEAST_N_PER_M: f64 = 500.0;
const MOST_N_PER_M: f64 = 40e3;

/// One boundary.
#[derive(Clone, Debug, Serialize)]
pub struct Bound {
    /// Name of the estimator.
    pub estimator: &'static str,
    /// Delay from reading to force.
    pub delay_ticks: usize,
    /// Δ, µm.
    pub resolution_um: f64,
    /// Largest stiffness at which the handle comes to rest, N/m; 0: none that was tried.
    pub stiffness_n_per_m: f64,
}

impl std::fmt::Display for Bound {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{}, force {} ticks late, encoder of {:.1} µm: rests up to {:.0} N/m",
            self.estimator, self.delay_ticks, self.resolution_um, self.stiffness_n_per_m
        )
    }
}

/// The boundary for each estimator, delay and encoder; passes each to `out`.
///
/// # Errors
/// Anything that prevents the scene from being baked.
pub fn sweep(quick: bool, out: &mut dyn FnMut(&Bound)) -> Result<Vec<Bound>, LabError> {
    let slab = Slab::bake(&Variant::board(1.0), 10.0, 0.0)?;
    let scene = slab.scene()?;
    let steps = if quick { 2 } else { STEPS };
    let mut found = Vec::new();
    for delay_ticks in DELAYS {
        for counted in Counted::ALL {
            for i in 0..steps {
                let resolution_m =
                    FINEST_M * (COARSEST_M / FINEST_M).powf(f64::from(i) / f64::from(steps - 1));
                let stiffness_n_per_m = largest(&scene, slab.part, counted, delay_ticks, resolution_m);
                let bound = Bound {
                    estimator: counted.name(),
                    delay_ticks,
                    resolution_um: 1e6 * resolution_m,
                    stiffness_n_per_m,
                };
                out(&bound);
                found.push(bound);
            }
        }
    }
    Ok(found)
}

/// Geometric mean over the encoders of the stiffness that an estimator bears, N/m.
pub fn geometric_mean(found: &[Bound], estimator: &str, delay_ticks: usize) -> f64 {
    let logarithms: Vec<f64> = (found.iter())
        .filter(|bound| bound.estimator == estimator && bound.delay_ticks == delay_ticks)
        .map(|bound| bound.stiffness_n_per_m.ln())
        .collect();
    (logarithms.iter().sum::<f64>() / logarithms.len() as f64).exp()
}

/// Largest stiffness (N/m) at which part `part`, pressed on its support and flicked, comes to rest; 0: none that was tried.
fn largest(
    scene: &SceneImage<'_>,
    part: u16,
    counted: Counted,
    delay_ticks: usize,
    resolution_m: f64,
) -> f64 {
    limit(LEAST_N_PER_M, MOST_N_PER_M, COARSE, |stiffness| {
        let wall = Wall {
            stiffness,
            damping: DAMPING,
            filter_s: 0.0,
            period_s: TICK_S,
            delay_ticks,
        };
        let (settings, sensor) = settings(Law::Coupling, &wall, stiffness);
        let rig = Rig {
            sensor: Sensor {
                resolution_m,
                speed: Speed::Counted(counted),
                ..sensor
            },
            delay_ticks,
            ..Rig::bare(MASS_KG, VISCOUS)
        };
        flick(scene, part, &settings, &rig).ripple_m < 2.0 * resolution_m
    })
}

/// Largest stiffness over the encoder's step: a line for each estimator and delay, with the delay at an end.
pub fn chart(found: &[Bound]) -> Chart {
    let mut series = Vec::new();
    for (index, counted) in Counted::ALL.iter().enumerate() {
        for delay_ticks in DELAYS {
            let of_line =
                |bound: &&Bound| bound.estimator == counted.name() && bound.delay_ticks == delay_ticks;
            let mut points: Vec<Point> = (found.iter().filter(of_line))
                .filter(|bound| bound.stiffness_n_per_m > 0.0)
                .map(|bound| Point {
                    x: bound.resolution_um,
                    y: bound.stiffness_n_per_m,
                    label: String::new(),
                    at_least: bound.stiffness_n_per_m >= MOST_N_PER_M,
                })
                .collect();
            // The second estimator's late lines lie among those of the others.
            let labelled = match index {
                0 => points.last_mut(),
                1 if delay_ticks > 0 => points.first_mut(),
                _ => None,
            };
            if let Some(point) = labelled {
                point.label = match delay_ticks {
                    0 => "force in time".into(),
                    1 => "1 tick late".into(),
                    ticks => format!("{ticks} ticks late"),
                };
            }
            series.push(Series {
                name: if delay_ticks == DELAYS[0] {
                    counted.name().into()
                } else {
                    String::new()
                },
                look: Look::nth(index),
                line: Line::Solid,
                points,
            });
        }
    }
    Chart {
        title: "Velocity estimators: largest stiffness at which the handle comes to rest".into(),
        note: "Handle 0.15 kg, 1 N s/m, nobody holding it, no dry friction, 1 kHz; our coupling, b_T = 20 N s/m; pressed with 5 N and flicked.".into(),
        x: Axis::new("step of the encoder at the handle Δ, µm"),
        y: Axis::new("largest stiffness that rests, N/m"),
        series,
    }
}
