//! Maps of the largest stable stiffness on one axis: theory as lines, experiments with the product's tick as marks.

use serde::Serialize;

use super::bench::Rig;
use super::boundary::stiffness_limit;
use super::oracle::{self, COARSE, Law, Wall};
use super::slab::Slab;
use crate::chart::{Axis, Chart, Line, Look, Point, Series};
use crate::error::LabError;
use crate::variant::Variant;

/// Upper limit of the search, N/m.
const MOST_N_PER_M: f64 = 1e5;
/// Points on a line.
const FINE_POINTS: u32 = 60;

/// A map: one quantity varied, one line for each condition.
pub struct Map {
    /// Name of its table and charts.
    pub name: &'static str,
    title: &'static str,
    note: &'static str,
    across: &'static str,
    from: f64,
    to: f64,
    /// Experiments on a line.
    points: u32,
    conditions: Vec<Condition>,
}

/// A bound in closed form.
type Formula = fn(&Rig, &Wall) -> f64;

/// Builds the loop for a value of the varied quantity.
type Build = Box<dyn Fn(f64) -> (Rig, Wall)>;

struct Condition {
    name: String,
    law: Law,
    build: Build,
    /// A closed form drawn as another line, with its name.
    formula: Option<(&'static str, Formula)>,
}

/// One experiment.
#[derive(Clone, Debug, Serialize)]
pub struct Limit {
    /// Name of the map.
    pub map: &'static str,
    /// Condition.
    pub condition: String,
    /// Varied quantity.
    pub across: &'static str,
    /// Its value.
    pub value: f64,
    /// Largest stable stiffness found, N/m.
    pub experiment_n_per_m: f64,
    /// By the spectral radius of the linear loop, N/m.
    pub theory_n_per_m: f64,
    /// By the closed form, N/m.
    pub formula_n_per_m: Option<f64>,
}

impl std::fmt::Display for Limit {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{}: {}, {} = {:.4}: {:.0} N/m, by the spectral radius {:.0} N/m",
            self.map, self.condition, self.across, self.value, self.experiment_n_per_m, self.theory_n_per_m
        )
    }
}

fn wall(damping: f64, period_s: f64, filter_s: f64, delay_ticks: usize) -> Wall {
    Wall {
        stiffness: 0.0,
        damping,
        filter_s,
        period_s,
        delay_ticks,
    }
}

fn colgate(rig: &Rig, wall: &Wall) -> f64 {
    oracle::passive_stiffness(rig.plant.damping, wall)
}

/// The textbook's wall without damping, and the product's coupling with its default 20 N s/m and a speed filtered by 3 ms; `rig_of` builds the rig
/// for the varied quantity.
fn both(rig_of: fn(f64) -> (Rig, f64)) -> Vec<Condition> {
    vec![
        Condition {
            name: "wall K·x".into(),
            law: Law::Wall,
            build: Box::new(move |x| {
                let (rig, period) = rig_of(x);
                (rig, wall(0.0, period, 0.0, 0))
            }),
            formula: Some(("Colgate–Schenkel", colgate)),
        },
        Condition {
            name: "our coupling, b_T = 20 N s/m".into(),
            law: Law::Coupling,
            build: Box::new(move |x| {
                let (rig, period) = rig_of(x);
                (rig, wall(20.0, period, 3e-3, 0))
            }),
            formula: None,
        },
    ]
}

/// All maps.
pub fn all() -> Vec<Map> {
    let delays = (0..3).map(|delay| Condition {
        name: format!("{delay} ticks late"),
        law: Law::Wall,
        build: Box::new(move |damping| (Rig::bare(0.1, 0.5), wall(damping, 1e-3, 0.0, delay))),
        formula: None,
    });
    vec![
        Map {
            name: "stability-z-width",
            title: "Z-width: largest stable wall over its damping",
            note: "Handle 0.1 kg, 0.5 N s/m, 1 kHz. Marks: the product's tick pressed and flicked. Lines: spectral radius of the linear loop.",
            across: "damping of the wall B, N s/m",
            from: 0.05,
            to: 60.0,
            points: 9,
            conditions: delays.collect(),
        },
        Map {
            name: "stability-rate",
            title: "Largest stable stiffness over the rate",
            note: "Handle 0.15 kg, 1 N s/m, nobody holding it. Marks: experiment. Solid: spectral radius. Dashed: Colgate–Schenkel.",
            across: "rate, Hz",
            from: 100.0,
            to: 4000.0,
            points: 7,
            conditions: both(|rate| (Rig::bare(0.15, 1.0), 1.0 / rate)),
        },
        Map {
            name: "stability-mass",
            title: "Largest stable stiffness over the handle's mass",
            note: "1 N s/m, 1 kHz, nobody holding it. Marks: experiment. Solid: spectral radius. Dashed: Colgate–Schenkel.",
            across: "mass of the handle, kg",
            from: 0.05,
            to: 1.0,
            points: 7,
            conditions: both(|mass| (Rig::bare(mass, 1.0), 1e-3)),
        },
        Map {
            name: "stability-hand",
            title: "Largest stable stiffness, hand loose to tight",
            note: "Handle 0.15 kg, 1 N s/m, 1 kHz; a hand damps with a hundredth of a second of its stiffness. Solid: spectral radius. Dashed: Colgate–Schenkel.",
            across: "stiffness of the hand, N/m",
            from: 10.0,
            to: 3000.0,
            points: 7,
            conditions: both(|stiffness| {
                let mut rig = Rig::bare(0.15, 1.0 + 0.01 * stiffness);
                rig.plant.stiffness = stiffness;
                rig.hand_damping = 0.01 * stiffness;
                (rig, 1e-3)
            }),
        },
    ]
}

/// `count` values from `from` to `to`, at a constant ratio.
fn spread(from: f64, to: f64, count: u32) -> impl Iterator<Item = f64> {
    (0..count).map(move |i| from * (to / from).powf(f64::from(i) / f64::from(count - 1)))
}

impl Map {
    /// Runs its experiments; passes each to `out`.
    ///
    /// # Errors
    /// Anything that prevents the scene from being baked.
    pub fn run(&self, quick: bool, out: &mut dyn FnMut(&Limit)) -> Result<Vec<Limit>, LabError> {
        let slab = Slab::bake(&Variant::board(1.0), 10.0, 0.0)?;
        let scene = slab.scene()?;
        let mut limits = Vec::new();
        for condition in &self.conditions {
            for value in spread(self.from, self.to, if quick { 2 } else { self.points }) {
                let (rig, wall) = (condition.build)(value);
                let theory = oracle::stiffness_limit(&rig.plant, condition.law, &wall, MOST_N_PER_M);
                let near = if theory > 0.0 { theory } else { 100.0 };
                let found = stiffness_limit(&scene, slab.part, &rig, condition.law, &wall, near, COARSE);
                let limit = Limit {
                    map: self.name,
                    condition: condition.name.clone(),
                    across: self.across,
                    value,
                    experiment_n_per_m: found,
                    theory_n_per_m: theory,
                    formula_n_per_m: condition.formula.map(|(_, formula)| formula(&rig, &wall)),
                };
                out(&limit);
                limits.push(limit);
            }
        }
        Ok(limits)
    }

    /// Its chart.
    pub fn chart(&self, limits: &[Limit]) -> Chart {
        let mut series = Vec::new();
        for (index, condition) in self.conditions.iter().enumerate() {
            let look = Look::nth(index);
            let line = |name: String, line: Line, at: &dyn Fn(f64) -> f64| Series {
                name,
                look: Look::Black,
                line,
                points: (spread(self.from, self.to, FINE_POINTS))
                    .map(|x| Point {
                        x,
                        y: at(x),
                        ..Point::default()
                    })
                    .collect(),
            };
            series.push(Series {
                name: condition.name.clone(),
                look,
                line: Line::None,
                points: (limits.iter().filter(|limit| limit.condition == condition.name))
                    .map(|limit| Point {
                        x: limit.value,
                        y: limit.experiment_n_per_m,
                        ..Point::default()
                    })
                    .collect(),
            });
            let theory = |x: f64| {
                let (rig, wall) = (condition.build)(x);
                oracle::stiffness_limit(&rig.plant, condition.law, &wall, MOST_N_PER_M)
            };
            series.push(line(String::new(), Line::Trace, &theory));
            if let Some((name, formula)) = condition.formula {
                let at = |x: f64| {
                    let (rig, wall) = (condition.build)(x);
                    formula(&rig, &wall)
                };
                series.push(line(
                    format!("{name}, {}", condition.name),
                    Line::DashedTrace,
                    &at,
                ));
            }
        }
        Chart {
            title: self.title.into(),
            note: self.note.into(),
            x: Axis::new(self.across),
            y: Axis::new("largest stable stiffness, N/m"),
            series,
        }
    }
}
