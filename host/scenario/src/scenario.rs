//! Scenarios as data: a scene, an operator model, and bounds.
//!
//! Lengths in a scenario file are millimetres, angles degrees, forces newtons, times seconds; field names carry the units. The hand takes hold of the
//! part at `grip_mm` and moves relative to that point.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mortise_bake::{Method, PointshellKind};
use mortise_firmware::parameters::Parameters;
use mortise_haptics::Settings;
use mortise_protocol::limits::MAX_KEYFRAMES;
use mortise_protocol::parameter::{PARAMETERS, ParameterId};
use mortise_rig::Faults;
use serde::Deserialize;

use crate::error::ScenarioError;
use crate::outcome::{Bounds, QUANTITIES, Quantity};

/// A scenario.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// Short name.
    pub name: String,
    /// One sentence for people.
    pub what: String,
    /// The scene.
    pub scene: Scene,
    /// Integrator of the object: `implicit` or `explicit`; the board's default when absent. The same as the parameter `Integrator`, in words.
    pub integrator: Option<Integrator>,
    /// Parameters that differ from their defaults, by name.
    #[serde(default)]
    pub parameters: BTreeMap<String, f32>,
    /// The operator model.
    pub hand: Hand,
    /// Duration and settings of the run.
    pub run: Run,
    /// Measurement of depth, where it is measured.
    pub depth: Option<Depth>,
    /// Press direction, where the hand presses.
    pub press: Option<Press>,
    /// Faults of the link and of inputs while the hand moves.
    pub faults: Option<Faults>,
    /// Bounds: a measured quantity's name and its range; see [`QUANTITIES`].
    pub holds: BTreeMap<String, Bounds>,
}

/// A scene.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// STEP file, relative to the scenario's file.
    pub step: PathBuf,
    /// Name of the part to grab.
    pub part: String,
    /// Edge of the field's cells, mm; the baker's choice when absent.
    pub cell_mm: Option<f64>,
    /// `distance-field` or `occupancy`.
    #[serde(default)]
    pub method: Method,
    /// `error-bounded` or `classic`.
    #[serde(default)]
    pub shell: Shell,
    /// Distance by which points of a classic shell are moved inward, percent of a voxel.
    #[serde(default)]
    pub shrink_percent: f64,
}

/// Kind of the pointshells.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Shell {
    /// Points where an error bound requires them.
    #[default]
    ErrorBounded,
    /// A point for each surface voxel, voxels as large as cells.
    Classic,
}

impl Scene {
    /// The shell in the baker's terms.
    pub fn pointshell(&self) -> PointshellKind {
        match self.shell {
            Shell::ErrorBounded => PointshellKind::ErrorBounded,
            Shell::Classic => PointshellKind::Classic {
                voxel_mm: None,
                shrink_percent: self.shrink_percent,
            },
        }
    }
}

/// Integrator of the object.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Integrator {
    /// Backward Euler.
    Implicit,
    /// Explicit Newton–Euler step, as in the textbook.
    Explicit,
}

impl Integrator {
    /// Value of the parameter [`ParameterId::Integrator`].
    pub fn value(self) -> f32 {
        match self {
            Self::Implicit => 0.0,
            Self::Explicit => 1.0,
        }
    }
}

/// The simulated hand: a spring-damper that follows keyframes.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hand {
    /// Stiffness, N/m.
    pub stiffness_n_per_m: f32,
    /// Damping, N·s/m.
    pub damping_n_s_per_m: f32,
    /// Angular stiffness, N·m/rad.
    pub angular_stiffness_n_m_per_rad: f32,
    /// Angular damping, N·m·s/rad.
    pub angular_damping_n_m_s_per_rad: f32,
    /// Amplitude of the tremor, mm.
    #[serde(default)]
    pub tremor_mm: f64,
    /// Frequency of the tremor, Hz.
    #[serde(default)]
    pub tremor_hz: f32,
    /// Position where the handle takes hold, world, mm.
    pub grip_mm: [f64; 3],
    /// Motion of the hand: times ascending, at most [`MAX_KEYFRAMES`].
    pub keyframes: Vec<Key>,
}

/// One keyframe of the hand.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Key {
    /// Time since the part was grabbed, s.
    pub t_s: f64,
    /// Offset from the grip point, mm.
    #[serde(default)]
    pub offset_mm: [f64; 3],
    /// Rotation vector about the grip point, world axes, degrees.
    #[serde(default)]
    pub turn_deg: [f64; 3],
    /// Force added to the spring's, N.
    #[serde(default)]
    pub push_n: [f32; 3],
}

/// Duration and settings of a run.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Run {
    /// Virtual time after grabbing, s.
    pub duration_s: f64,
    /// Ticks between telemetry samples (the source of every figure but the board's own counters).
    #[serde(default = "five")]
    pub telemetry_every_ticks: u16,
    /// Ticks between answers to samples, several samples at once; each sample is answered when absent.
    pub heed_every_ticks: Option<u16>,
    /// Ticks between parameter messages, for load; none are sent when absent.
    pub parameter_every_ticks: Option<u32>,
    /// True if the desktop recognises constraints from telemetry and sends them.
    #[serde(default)]
    pub guidance: bool,
    /// Length of the run's end that counts as settled, s.
    #[serde(default = "half")]
    pub settled_s: f64,
}

fn five() -> u16 {
    5
}

fn half() -> f64 {
    0.5
}

/// Measurement of depth: distance of the moving part's farthest point along `axis` from the fixed part's first point.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Depth {
    /// Name of the part with the hole; its extent along the axis is the hole's depth.
    pub fixed: String,
    /// Direction of insertion, world.
    pub axis: [f64; 3],
    /// A point on the hole's axis, world, mm.
    pub through_mm: [f64; 3],
}

/// Press of the hand.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Press {
    /// Direction, world.
    pub direction: [f64; 3],
}

impl Scenario {
    /// Settings of the force law on a board that accepted the parameters; the defaults if it refused one.
    pub fn settings(&self) -> Settings {
        let taken = (self.parameters.iter()).try_fold(Parameters::default(), |set, (name, &value)| {
            set.with(parameter_named(name)?, value).ok()
        });
        let settings = taken.and_then(|set| set.settings().ok());
        settings.map_or_else(Settings::default, |settings| settings.law)
    }

    /// Reads a scenario file.
    ///
    /// # Errors
    /// `Unreadable`, `Scenario`.
    pub fn load(path: &Path) -> Result<Self, ScenarioError> {
        let text = std::fs::read_to_string(path).map_err(|source| ScenarioError::Unreadable {
            path: path.to_owned(),
            source,
        })?;
        let mut scenario = Self::parse(&text, &path.display().to_string())?;
        if let Some(folder) = path.parent() {
            scenario.scene.step = folder.join(&scenario.scene.step);
        }
        Ok(scenario)
    }

    /// Reads a scenario's text; `name` is used in messages. The STEP file's path stays as written.
    ///
    /// # Errors
    /// `Scenario`.
    pub fn parse(text: &str, name: &str) -> Result<Self, ScenarioError> {
        let scenario: Self = toml::from_str(text).map_err(|error| ScenarioError::Scenario {
            name: name.to_owned(),
            what: error.to_string(),
        })?;
        scenario.check(name)?;
        Ok(scenario)
    }

    /// The sample insertion: the thesis pair with 1 mm clearance, the hand starting 0.2 mm and 0.5° off. `step` is the path of its STEP file.
    ///
    /// # Errors
    /// `Scenario`, never with the text that comes with the program (tested).
    pub fn insertion(step: &Path) -> Result<Self, ScenarioError> {
        let text = include_str!("../../../hil-tests/scenarios/insertion.toml");
        let mut scenario = Self::parse(text, "insertion")?;
        scenario.scene.step = step.to_owned();
        Ok(scenario)
    }

    fn check(&self, name: &str) -> Result<(), ScenarioError> {
        let wrong = |what: String| {
            Err(ScenarioError::Scenario {
                name: name.to_owned(),
                what,
            })
        };
        if self.holds.is_empty() {
            return wrong("[holds] is empty: a scenario that cannot fail shows nothing".into());
        }
        for (quantity, bounds) in &self.holds {
            let ordered = bounds.min <= bounds.max;
            // NaN is unordered.
            if !ordered {
                return wrong(format!(
                    "holds.{quantity}: min {} is above max {}",
                    bounds.min, bounds.max
                ));
            }
            if Quantity::named(quantity).is_none() {
                let known: Vec<&str> = QUANTITIES.iter().map(|known| known.name).collect();
                return wrong(format!(
                    "holds.{quantity} is not measured; measured are {}",
                    known.join(", ")
                ));
            }
        }
        if let Some(Err(what)) = self.faults.as_ref().map(Faults::check) {
            return wrong(format!("faults.{what}"));
        }
        for parameter in self.parameters.keys() {
            if parameter_named(parameter).is_none() {
                let known: Vec<&str> = PARAMETERS.iter().map(|row| row.name).collect();
                return wrong(format!("parameters.{parameter} is none of {}", known.join(", ")));
            }
        }
        if self.integrator.is_some() && self.parameters.contains_key(ParameterId::Integrator.row().name) {
            return wrong("the integrator is given twice: as `integrator` and among the parameters".into());
        }
        if self.scene.shell == Shell::ErrorBounded && self.scene.shrink_percent != 0.0 {
            return wrong(
                "scene.shrink_percent is for the classic shell only; set shell = \"classic\"".into(),
            );
        }
        let count = self.hand.keyframes.len();
        if count == 0 || count > MAX_KEYFRAMES {
            return wrong(format!(
                "hand.keyframes has {count} entries, 1 to {MAX_KEYFRAMES} are possible"
            ));
        }
        let ascending = self
            .hand
            .keyframes
            .windows(2)
            .all(|pair| pair[0].t_s < pair[1].t_s);
        if !ascending || self.hand.keyframes[0].t_s < 0.0 {
            return wrong("hand.keyframes: times must ascend from 0".into());
        }
        let duration = self.run.duration_s;
        if !(duration > 0.0 && duration <= 7200.0) {
            return wrong(format!(
                "run.duration_s is {duration}, more than 0 and at most 7200 is possible"
            ));
        }
        if self.run.telemetry_every_ticks == 0 {
            return wrong(
                "run.telemetry_every_ticks must be at least 1: the figures come from telemetry".into(),
            );
        }
        Ok(())
    }
}

/// The parameter with this name.
pub(crate) fn parameter_named(name: &str) -> Option<ParameterId> {
    PARAMETERS.iter().find(|row| row.name == name).map(|row| row.id)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sample_insertion_reads() {
        let scenario = Scenario::insertion(Path::new("pair.step")).expect("comes with the program");
        assert_eq!(scenario.scene.step, Path::new("pair.step"));
    }

    #[test]
    fn what_is_wrong_is_said_with_its_place() {
        let good = include_str!("../../../hil-tests/scenarios/insertion.toml");
        let said = |from: &str, to: &str| {
            assert!(good.contains(from), "{from}");
            Scenario::parse(&good.replacen(from, to, 1), "test")
                .expect_err(to)
                .to_string()
        };
        assert!(said("[holds.inserted_mm]", "[holds.depth_of_feeling]").contains("depth_of_feeling"));
        assert!(
            said("telemetry_every_ticks = 5", "telemetry_every_ticks = 0").contains("telemetry_every_ticks")
        );
        assert!(said("[hand]", "[parameters]\nSpring = 3.0\n[hand]").contains("Spring"));
        assert!(said("[hand]", "[faults]\ndrop = 2\n[hand]").contains("faults.drop"));
        assert!(said("part =", "piece =").contains("piece"));
        assert!(said("part =", "method = \"voxels\"\npart =").contains("occupancy"));
        let twice = "integrator = \"explicit\"\n[parameters]\nIntegrator = 1.0\n[scene]";
        assert!(said("[scene]", twice).contains("twice"));
        assert!(said("part =", "shrink_percent = 5\npart =").contains("classic"));
    }
}
