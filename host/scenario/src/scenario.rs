//! Scenarios: a scene, a hand that moves in it, and what must hold, as data.
//!
//! Lengths in a scenario file are millimetres, angles degrees, forces newtons, times seconds; the names say so. The hand takes hold of the
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
    /// What is on the table.
    pub scene: Scene,
    /// How the object is moved: `implicit` or `explicit`; the board's default when absent. The same as the parameter `Integrator`, in words.
    pub integrator: Option<Integrator>,
    /// Parameters that differ from their defaults, by name.
    #[serde(default)]
    pub parameters: BTreeMap<String, f32>,
    /// Who moves.
    pub hand: Hand,
    /// How long, and what else goes on.
    pub run: Run,
    /// How depth is measured, where it matters.
    pub depth: Option<Depth>,
    /// Where the hand presses, where that matters.
    pub press: Option<Press>,
    /// What goes wrong on the link while the hand moves.
    pub faults: Option<Faults>,
    /// What must hold: a measured quantity's name and its bounds; see [`QUANTITIES`].
    pub holds: BTreeMap<String, Bounds>,
}

/// What is on the table.
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
    /// How far points of a classic shell are moved inward, percent of a voxel.
    #[serde(default)]
    pub shrink_percent: f64,
}

/// What the pointshells are made of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Shell {
    /// Points where an error bound needs them.
    #[default]
    ErrorBounded,
    /// A point for each voxel of the surface, voxels as large as cells.
    Classic,
}

impl Scene {
    /// The shell as the baker knows it.
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

/// How the object is moved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Integrator {
    /// Backward Euler.
    Implicit,
    /// Newton–Euler, the textbook's.
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

/// The simulated hand: a spring-damper, and where it goes.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hand {
    /// N/m.
    pub stiffness_n_per_m: f32,
    /// N·s/m.
    pub damping_n_s_per_m: f32,
    /// N·m/rad.
    pub angular_stiffness_n_m_per_rad: f32,
    /// N·m·s/rad.
    pub angular_damping_n_m_s_per_rad: f32,
    /// Tremor's amplitude, mm.
    #[serde(default)]
    pub tremor_mm: f64,
    /// Tremor's frequency, Hz.
    #[serde(default)]
    pub tremor_hz: f32,
    /// Where the handle takes hold, world.
    pub grip_mm: [f64; 3],
    /// Where it goes, times ascending, at most [`MAX_KEYFRAMES`].
    pub keyframes: Vec<Key>,
}

/// One point of the hand's way.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Key {
    /// Since the part was grabbed.
    pub t_s: f64,
    /// From the grip.
    #[serde(default)]
    pub offset_mm: [f64; 3],
    /// Rotation vector about the grip, world axes.
    #[serde(default)]
    pub turn_deg: [f64; 3],
    /// Added to the spring's force.
    #[serde(default)]
    pub push_n: [f32; 3],
}

/// How long, and what else goes on.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Run {
    /// Virtual time after grabbing.
    pub duration_s: f64,
    /// Ticks between telemetry samples (every figure but the board's own counters comes from them).
    #[serde(default = "five")]
    pub telemetry_every_ticks: u16,
    /// Ticks after which samples are answered, those of several at once; each when absent.
    pub heed_every_ticks: Option<u16>,
    /// Ticks between parameter messages, for load; none when absent.
    pub parameter_every_ticks: Option<u32>,
    /// Whether the desktop recognises constraints from telemetry and sends them.
    #[serde(default)]
    pub guidance: bool,
    /// The last so much of the run counts as settled.
    #[serde(default = "half")]
    pub settled_s: f64,
}

fn five() -> u16 {
    5
}

fn half() -> f64 {
    0.5
}

/// How depth is measured: how far the moving part's farthest point along `axis` lies beyond the fixed part's first.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Depth {
    /// Name of the part with the hole; its extent along the axis is the hole's depth.
    pub fixed: String,
    /// Way in, world.
    pub axis: [f64; 3],
    /// A point of the hole's axis, world, mm.
    pub through_mm: [f64; 3],
}

/// Where the hand presses.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Press {
    /// Direction, world.
    pub direction: [f64; 3],
}

impl Scenario {
    /// What the force law is set to on a board that took the parameters; the defaults where it refuses one.
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

    /// Reads a scenario's text; `name` is for messages. The STEP file's path stays as written.
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

    /// The sample insertion: the thesis pair with 1 mm clearance, the hand starting 0.2 mm and 0.5° off. `step` is where its STEP file lies.
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
            // NaN is not.
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

/// The parameter of this name.
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
