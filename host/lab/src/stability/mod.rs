//! Where closed loops become unstable, by theory and by experiment, and where each method fails.
//!
//! [`mod@bench`] closes a loop around the product's tick on one axis; [`oracle`] predicts the behaviour of the linear loop; [`boundary`] measures
//! that of the whole loop. The maps of [`limits`] and [`quantisation`] compare the two; those of [`press`], [`impact`], [`shell`] and [`jam`] compare
//! methods; [`estimators`] chooses the estimator of speeds; [`lapses`] concerns targets that are late or lost.

pub mod bench;
pub mod boundary;
pub mod estimators;
pub mod impact;
pub mod jam;
pub mod lapses;
pub mod limits;
pub mod oracle;
pub mod press;
pub mod quantisation;
pub mod sensor;
pub mod shell;
pub mod slab;

use std::rc::Rc;

use serde::Serialize;

use crate::chart::Chart;
use crate::error::LabError;
use crate::experiment::{Experiment, Findings, Form, Report};

/// One experiment of any map.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
pub enum Trial {
    /// Result of [`limits`].
    Limit(limits::Limit),
    /// Result of [`press`].
    Press(press::Press),
    /// Result of [`impact`].
    Blow(impact::Blow),
    /// Result of [`shell`].
    Felt(shell::Felt),
    /// Result of [`quantisation`].
    Rest(quantisation::Rest),
    /// Result of [`estimators`].
    Bound(estimators::Bound),
    /// Result of [`jam`].
    Push(jam::Push),
    /// Result of [`lapses`].
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
            Self::Bound(trial) => trial.fmt(f),
            Self::Push(trial) => trial.fmt(f),
            Self::Held(trial) => trial.fmt(f),
        }
    }
}

/// A finished map.
pub struct Map {
    /// Name of its files.
    pub name: &'static str,
    /// Its trials.
    pub trials: Vec<Trial>,
    /// Its charts, stacked.
    pub charts: Vec<Chart>,
}

/// Receives each experiment when it is finished.
type Out<'a> = &'a mut dyn FnMut(&Trial);

/// Makes a map; true for the shorter form.
type Make = Box<dyn Fn(bool, Out<'_>) -> Result<Map, LabError>>;

/// A map's name and its recipe: a sweep, the kind of its trials, and their charts.
fn recipe<T: Clone + 'static>(
    name: &'static str,
    sweep: impl Fn(bool, &mut dyn FnMut(&T)) -> Result<Vec<T>, LabError> + 'static,
    kind: fn(T) -> Trial,
    charts: impl Fn(&[T]) -> Vec<Chart> + 'static,
) -> (&'static str, Make) {
    let make = move |quick: bool, out: Out<'_>| {
        let found = sweep(quick, &mut |trial| out(&kind(trial.clone())))?;
        Ok(Map {
            name,
            charts: charts(&found),
            trials: found.into_iter().map(kind).collect(),
        })
    };
    (name, Box::new(make))
}

/// Recipes of all maps.
fn recipes() -> Vec<(&'static str, Make)> {
    let mut all: Vec<_> = (limits::all().into_iter().map(Rc::new))
        .map(|map| {
            let drawn = Rc::clone(&map);
            let sweep = move |quick: bool, out: &mut dyn FnMut(&limits::Limit)| map.run(quick, out);
            recipe(drawn.name, sweep, Trial::Limit, move |f| vec![drawn.chart(f)])
        })
        .collect();
    all.extend([
        recipe("stability-encoder", quantisation::sweep, Trial::Rest, |f| {
            vec![quantisation::chart(f)]
        }),
        recipe("stability-estimator", estimators::sweep, Trial::Bound, |f| {
            vec![estimators::chart(f)]
        }),
        recipe("stability-jam", jam::sweep, Trial::Push, |f| vec![jam::chart(f)]),
        recipe("stability-contacts", press::sweep, Trial::Press, |f| {
            vec![press::chart(f)]
        }),
        recipe("stability-impact", impact::sweep, Trial::Blow, |f| {
            vec![impact::chart(f)]
        }),
        recipe("stability-shell", shell::sweep, Trial::Felt, |f| {
            vec![shell::chart(f)]
        }),
        recipe("stability-lapses", lapses::sweep, Trial::Held, lapses::charts),
    ]);
    all
}

/// Names of all maps.
pub fn names() -> Vec<&'static str> {
    recipes().into_iter().map(|(name, _)| name).collect()
}

/// Makes every map, or the one named `only`; passes each experiment to `out`.
///
/// # Errors
/// `NoSuchFigures`; anything that prevents a scene from being baked.
pub fn maps(quick: bool, only: Option<&str>, out: &mut dyn FnMut(&Trial)) -> Result<Vec<Map>, LabError> {
    if let Some(name) = only.filter(|only| !names().contains(only)) {
        return Err(LabError::NoSuchFigures {
            name: name.to_owned(),
            known: names().join(", "),
        });
    }
    (recipes().into_iter())
        .filter(|(name, _)| only.is_none_or(|only| only == *name))
        .map(|(_, make)| make(quick, out))
        .collect()
}

/// The experiment `stability`.
pub struct Stability;

impl Experiment for Stability {
    fn name(&self) -> &'static str {
        "stability"
    }

    fn about(&self) -> &'static str {
        "Find where closed loops become unstable, theory drawn beside"
    }

    fn quick(&self) -> &'static str {
        "fewer points of each map"
    }

    fn rows(&self) -> Vec<String> {
        names().into_iter().map(String::from).collect()
    }

    fn charts(&self) -> Vec<String> {
        self.rows()
    }

    fn parts(&self) -> Vec<&'static str> {
        names()
    }

    fn run(&self, form: Form<'_>, report: &mut Report<'_>) -> Result<Findings, LabError> {
        let maps = maps(form.quick, form.only, &mut |trial| report(trial))?;
        maps.into_iter().try_fold(Findings::default(), |findings, map| {
            Ok(findings.rows(map.name, &map.trials)?.stack(map.name, map.charts))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_that_is_not_there_is_refused_with_those_that_are() {
        let refused = maps(true, Some("stability-moon"), &mut |_| {}).map(|_| ());
        let said = refused.expect_err("no such map").to_string();
        assert!(
            said.contains("stability-moon") && names().iter().all(|name| said.contains(name)),
            "{said}"
        );
    }
}
