//! Where closed loops become unstable, by theory and by experiment, and where each method fails.
//!
//! [`mod@bench`] closes a loop round the product's tick on one axis; [`oracle`] says what the linear loop must do; [`boundary`] finds what the whole one does.
//! [`limits`] and [`quantisation`] are the maps that hold the two together, [`press`], [`impact`], [`shell`] and [`jam`] are those where methods are compared;
//! [`lapses`] is about targets that are late or lost.

pub mod bench;
pub mod boundary;
pub mod impact;
pub mod jam;
pub mod lapses;
pub mod limits;
pub mod oracle;
pub mod press;
pub mod quantisation;
pub mod shell;
pub mod slab;

use std::path::Path;

use serde::Serialize;

use crate::chart::{Chart, write_stack};
use crate::error::LabError;
use crate::table::write_csv;

/// Names of the maps.
pub const NAMES: [&str; 10] = [
    "stability-z-width",
    "stability-rate",
    "stability-mass",
    "stability-hand",
    "stability-encoder",
    "stability-jam",
    "stability-contacts",
    "stability-impact",
    "stability-shell",
    "stability-lapses",
];

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
    /// Of [`quantisation`].
    Rest(quantisation::Rest),
    /// Of [`jam`].
    Push(jam::Push),
    /// Of [`lapses`].
    Held(lapses::Held),
}

impl std::fmt::Display for Trial {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Limit(trial) => trial.fmt(f),
            Self::Press(trial) => trial.fmt(f),
            Self::Blow(trial) => trial.fmt(f),
            Self::Felt(trial) => trial.fmt(f),
            Self::Rest(trial) => trial.fmt(f),
            Self::Push(trial) => trial.fmt(f),
            Self::Held(trial) => trial.fmt(f),
        }
    }
}

/// A map that was made.
pub struct Map {
    /// Name of its files.
    pub name: &'static str,
    trials: Vec<Trial>,
    /// Above one another.
    charts: Vec<Chart>,
}

impl Map {
    fn new<T: Clone>(name: &'static str, trials: &[T], kind: fn(T) -> Trial, charts: Vec<Chart>) -> Self {
        Self {
            name,
            trials: trials.iter().cloned().map(kind).collect(),
            charts,
        }
    }

    /// Writes table (CSV) and chart (SVG and PNG).
    ///
    /// # Errors
    /// `Unwritable`.
    pub fn write(&self, folder: &Path) -> Result<(), LabError> {
        write_csv(&self.trials, folder, self.name)?;
        write_stack(&self.charts, folder, self.name)
    }
}

/// Makes every map, or the one of that name; each experiment goes to `out`.
///
/// # Errors
/// `NoSuchFigures`; anything that keeps a scene from being baked.
pub fn maps(quick: bool, only: Option<&str>, out: &mut dyn FnMut(&Trial)) -> Result<Vec<Map>, LabError> {
    let mut maps = Vec::new();
    let wanted = |name: &str| only.is_none_or(|only| only == name);
    for map in limits::all() {
        if wanted(map.name) {
            let found = map.run(quick, &mut |trial| out(&Trial::Limit(trial.clone())))?;
            maps.push(Map::new(map.name, &found, Trial::Limit, vec![map.chart(&found)]));
        }
    }
    // Name, experiment, its kind of trial, its charts.
    macro_rules! map {
        ($name:literal, $module:ident, $kind:path, $charts:expr) => {
            if wanted($name) {
                let found = $module::sweep(quick, &mut |trial| out(&$kind(trial.clone())))?;
                maps.push(Map::new($name, &found, $kind, $charts(&found)));
            }
        };
    }
    map!("stability-encoder", quantisation, Trial::Rest, |f: &_| vec![
        quantisation::chart(f)
    ]);
    map!("stability-jam", jam, Trial::Push, |f: &_| vec![jam::chart(f)]);
    map!("stability-contacts", press, Trial::Press, |f: &_| vec![
        press::chart(f)
    ]);
    map!("stability-impact", impact, Trial::Blow, |f: &_| vec![
        impact::chart(f)
    ]);
    map!("stability-shell", shell, Trial::Felt, |f: &_| vec![shell::chart(
        f
    )]);
    map!("stability-lapses", lapses, Trial::Held, lapses::charts);
    if maps.is_empty() {
        return Err(LabError::NoSuchFigures {
            name: only.unwrap_or_default().to_owned(),
            known: NAMES.join(", "),
        });
    }
    Ok(maps)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_that_is_not_there_is_refused_with_those_that_are() {
        for map in limits::all() {
            assert!(NAMES.contains(&map.name), "{}", map.name);
        }
        let refused = maps(true, Some("stability-moon"), &mut |_| {}).map(|_| ());
        let said = refused.expect_err("no such map").to_string();
        assert!(
            said.contains("stability-moon") && said.contains("stability-jam"),
            "{said}"
        );
    }
}
