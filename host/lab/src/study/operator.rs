//! A simulated operator, who moves a peg from just above its hole and pushes it through, with a hand that is slightly off and trembles.
//!
//! Every trial draws a hand of its own from a seed: off the axis by up to half of the clearance, tilted by up to half a degree, both in any
//! direction.

use std::f64::consts::TAU;

use mortise_bake::Grabbable;
use mortise_protocol::parameter::ParameterId;
use mortise_rig::Client;
use mortise_scenario::{PreparedScene, Scenario, ScenarioError, run_on};
use tempfile::NamedTempFile;

use crate::LabError;
use crate::fit::Fit;
use crate::guided::{SIM, key};
use crate::variant::Variant;

const SCENARIO: &str = include_str!("../../data/tight_insertion.toml");

/// Height of the peg's start above its hole, and distance of its end beyond, mm.
const ABOVE_MM: f64 = 5.0;
const BEYOND_MM: f64 = 2.0;
/// Time to reach the hole's axis, shortest time of the push, and time at the end, s; and speed of the push, mm/s.
const COMES_S: f64 = 0.3;
const PUSHES_S: f64 = 1.5;
const ENDS_S: f64 = 0.3;
const MM_PER_S: f64 = 50.0;
/// Largest tilt, degrees, and largest offset as a share of the radial clearance.
const TILT_DEG: f64 = 0.5;
const OFF: f64 = 0.5;

/// Errors of a hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hand {
    /// Offset from the axis, as a share of the radial clearance.
    pub off: [f64; 2],
    /// Rotation vector perpendicular to the axis, degrees.
    pub tilt_deg: [f64; 2],
}

/// Result of a trial.
#[derive(Clone, Debug, PartialEq)]
pub struct Went {
    /// True if the peg came through its hole.
    pub through: bool,
    /// Depth that it reached, mm; absent where the board faulted.
    pub inserted_mm: Option<f64>,
    /// Largest force on the handle, N, likewise.
    pub peak_n: Option<f64>,
    /// Share of ticks that could not query all points, %, likewise.
    pub degraded_percent: Option<f64>,
}

/// A fit, baked, with the part in hand above its hole.
pub struct Task {
    fit: Fit,
    scenario: Scenario,
    scene: PreparedScene,
    _file: NamedTempFile,
}

impl Hand {
    /// The worst hand of the distribution: largest offset and largest tilt, both in one plane.
    pub const WORST: Self = Self {
        off: [OFF, 0.0],
        tilt_deg: [0.0, TILT_DEG],
    };

    /// The hand drawn from this seed.
    pub fn of(seed: u64) -> Self {
        let mut random = fastrand::Rng::with_seed(seed);
        // Uniform over the area, not over the radius.
        let mut any = |most: f64| {
            let (radius, angle) = (most * random.f64().sqrt(), TAU * random.f64());
            [radius * angle.cos(), radius * angle.sin()]
        };
        Self {
            off: any(OFF),
            tilt_deg: any(TILT_DEG),
        }
    }
}

impl Task {
    /// Bakes the fit as `variant` specifies. The tick gets the whole budget of points: the textbook's shells have many.
    ///
    /// # Errors
    /// As [`PreparedScene::with`].
    pub fn new(fit: &Fit, variant: &Variant) -> Result<Self, LabError> {
        Self::with(fit, variant, None)
    }

    /// Bakes the fit for the textbook's method, with separate voxel sizes for peg and hole, mm.
    ///
    /// # Errors
    /// As [`PreparedScene::with`].
    pub fn voxels(fit: &Fit, peg_mm: f64, hole_mm: f64) -> Result<Self, LabError> {
        Self::with(fit, &Variant::textbook(hole_mm), Some(peg_mm))
    }

    fn with(fit: &Fit, variant: &Variant, peg_cell_mm: Option<f64>) -> Result<Self, LabError> {
        let fit = fit.engaged(-ABOVE_MM);
        let file = fit.file()?;
        let mut scenario = Scenario::parse(SCENARIO, "operator")?;
        scenario.scene.step = file.path().to_owned();
        let budget = ParameterId::PointBudget.row();
        scenario.parameters.insert(budget.name.to_owned(), budget.max);
        let mut options = variant.options(Grabbable::Named(vec![scenario.scene.part.clone()]));
        let own = peg_cell_mm.map(|cell| (scenario.scene.part.clone(), cell));
        options.part_cells_mm.extend(own);
        let scene = PreparedScene::with(&scenario, &options)?;
        Ok(Self {
            fit,
            scenario,
            scene,
            _file: file,
        })
    }

    /// Bytes of the scene image.
    pub fn image_bytes(&self) -> usize {
        self.scene.image.len()
    }

    /// Plays one trial in-process, with points moved inward by this share of the peg's voxel.
    ///
    /// # Errors
    /// Anything that prevents playing it, except a fault of the board, which means that the operator pushed until it gave up.
    pub fn tried(&self, hand: &Hand, shrinking: f64) -> Result<Went, LabError> {
        let mut scenario = self.scenario.clone();
        let name = ParameterId::Shrinking.row().name.to_owned();
        scenario.parameters.insert(name, shrinking as f32);
        let (fit, play) = (&self.fit, 0.5 * self.fit.clearance_mm());
        let through = ABOVE_MM + fit.height_mm + BEYOND_MM;
        scenario.hand.grip_mm = [0.0, 0.0, ABOVE_MM + 0.5 * fit.length_mm];
        let at = |t_s: f64, down: f64| {
            let [x, y] = hand.off.map(|off| off * play);
            key(t_s, [x, y, -down], [hand.tilt_deg[0], hand.tilt_deg[1], 0.0])
        };
        let ends = COMES_S + PUSHES_S.max(through / MM_PER_S);
        scenario.hand.keyframes = vec![key(0.0, [0.0; 3], [0.0; 3]), at(COMES_S, 0.0), at(ends, through)];
        scenario.run.duration_s = ends + ENDS_S;
        match run_on(&Client::connect(&SIM.lockstep())?, &scenario, &self.scene) {
            Ok(outcome) => Ok(Went {
                through: outcome.inserted_mm.is_some_and(|deep| deep >= fit.height_mm),
                inserted_mm: outcome.inserted_mm,
                peak_n: Some(outcome.peak_force_n),
                degraded_percent: Some(outcome.degraded_percent),
            }),
            Err(ScenarioError::Fault { .. }) => Ok(Went {
                through: false,
                inserted_mm: None,
                peak_n: None,
                degraded_percent: None,
            }),
            Err(error) => Err(error.into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Hands differ, stay within bounds, and are reproducible.
    #[test]
    fn hands_are_drawn() {
        for seed in 0..200 {
            let hand = Hand::of(seed);
            let length = |[x, y]: [f64; 2]| x.hypot(y);
            assert!(length(hand.off) <= OFF && length(hand.tilt_deg) <= TILT_DEG);
            assert_eq!(hand, Hand::of(seed));
            assert_ne!(hand, Hand::of(seed + 1));
        }
    }

    /// Voxels as wide as the clearance stick; a field on cells as wide goes in.
    #[test]
    fn an_operator_gets_in_where_there_is_room() {
        let fit = Fit::thesis(1.0);
        let through = |variant: Variant| {
            let task = Task::new(&fit, &variant).expect("baked");
            task.tried(&Hand::WORST, 0.0).expect("played").through
        };
        assert!(!through(Variant::textbook(2.0)));
        assert!(through(Variant::field(2.0)));
    }
}
