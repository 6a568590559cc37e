//! Where closed loops become unstable, by theory and by experiment, and where each method fails.
//!
//! [`mod@bench`] closes a loop round the product's tick on one axis; [`oracle`] says what the linear loop must do; [`boundary`] finds what the whole one does.
//! [`limits`] is the maps that hold the two together, [`press`], [`impact`] and [`shell`] are those where methods are compared.

pub mod bench;
pub mod boundary;
pub mod impact;
pub mod limits;
pub mod oracle;
pub mod press;
pub mod shell;
pub mod slab;

use std::path::Path;

use serde::Serialize;

use crate::chart::Chart;
use crate::error::LabError;
use crate::table::write_csv;

/// One experiment of any map.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
pub enum Trial {
    /// Of [`limits`].
    Limit(limits::Limit),
    /// Of [`press`].
    Press(press::Press),
    /// Of [`impact`].
    Blow(impact::Blow),
    /// Of [`shell`].
    Felt(shell::Felt),
}

impl std::fmt::Display for Trial {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Limit(trial) => trial.fmt(f),
            Self::Press(trial) => trial.fmt(f),
            Self::Blow(trial) => trial.fmt(f),
            Self::Felt(trial) => trial.fmt(f),
        }
    }
}

/// A map that was made.
pub struct Map {
    /// Name of its files.
    pub name: &'static str,
    trials: Vec<Trial>,
    chart: Chart,
}

impl Map {
    fn new<T: Clone>(name: &'static str, trials: &[T], kind: fn(T) -> Trial, chart: Chart) -> Self {
        Self {
            name,
            trials: trials.iter().cloned().map(kind).collect(),
            chart,
        }
    }

    /// Writes table (CSV) and chart (SVG and PNG).
    ///
    /// # Errors
    /// `Unwritable`.
    pub fn write(&self, folder: &Path) -> Result<(), LabError> {
        write_csv(&self.trials, folder, self.name)?;
        self.chart.write(folder, self.name)
    }
}

/// Makes every map; each experiment goes to `out`.
///
/// # Errors
/// Anything that keeps a scene from being baked.
pub fn maps(quick: bool, out: &mut dyn FnMut(&Trial)) -> Result<Vec<Map>, LabError> {
    let mut maps = Vec::new();
    for map in limits::all() {
        let found = map.run(quick, &mut |trial| out(&Trial::Limit(trial.clone())))?;
        maps.push(Map::new(map.name, &found, Trial::Limit, map.chart(&found)));
    }
    let presses = press::sweep(quick, &mut |trial| out(&Trial::Press(trial.clone())))?;
    maps.push(Map::new(
        "stability-contacts",
        &presses,
        Trial::Press,
        press::chart(&presses),
    ));
    let blows = impact::sweep(quick, &mut |trial| out(&Trial::Blow(trial.clone())))?;
    maps.push(Map::new(
        "stability-impact",
        &blows,
        Trial::Blow,
        impact::chart(&blows),
    ));
    let felt = shell::sweep(quick, &mut |trial| out(&Trial::Felt(trial.clone())))?;
    maps.push(Map::new(
        "stability-shell",
        &felt,
        Trial::Felt,
        shell::chart(&felt),
    ));
    Ok(maps)
}
