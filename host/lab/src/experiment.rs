//! The interface of an experiment: a name, a full and a quick run, and the rows and charts that a run finds.

use std::fmt;

use mortise_output::Folder;
use serde::Serialize;

use crate::chart::{Chart, write_stack};
use crate::error::LabError;
use crate::table::csv;

/// An experiment of `mortise-lab`. [`crate::experiments::ALL`] lists them.
pub trait Experiment: Sync {
    /// Name of its command, and the start of its files' names.
    fn name(&self) -> &'static str;

    /// Its result in one line.
    fn about(&self) -> &'static str;

    /// Scope of the quick form, one line.
    fn quick(&self) -> &'static str;

    /// Names of the tables that a run may write, without extension.
    fn rows(&self) -> Vec<String>;

    /// Names of the charts, without extension.
    fn charts(&self) -> Vec<String>;

    /// Parts that can be run alone, each named as its one table and its one chart; empty where it has no parts.
    fn parts(&self) -> Vec<&'static str> {
        Vec::new()
    }

    /// Runs it; calls `report` with each result as soon as it is measured.
    ///
    /// # Errors
    /// Anything that prevents a trial.
    fn run(&self, form: Form<'_>, report: &mut Report<'_>) -> Result<Findings, LabError>;
}

/// Scope of a run.
#[derive(Clone, Copy, Debug, Default)]
pub struct Form<'f> {
    /// The quick form.
    pub quick: bool,
    /// One of the experiment's parts alone.
    pub only: Option<&'f str>,
}

/// Receives results as they are measured.
pub type Report<'r> = dyn FnMut(&dyn Line) + 'r;

/// One result: text for a person, JSON for a program.
pub trait Line: fmt::Display {
    /// One JSON object.
    ///
    /// # Errors
    /// Never for a struct of numbers, words and booleans.
    fn json(&self) -> serde_json::Result<String>;
}

impl<T: Serialize + fmt::Display> Line for T {
    fn json(&self) -> serde_json::Result<String> {
        serde_json::to_string(self)
    }
}

/// Results of a run: tables, and charts of one panel or several stacked ones.
#[derive(Debug, Default)]
pub struct Findings {
    rows: Vec<(String, Vec<u8>)>,
    charts: Vec<(String, Vec<Chart>)>,
}

impl Findings {
    /// Adds a table of plain structs, as CSV.
    ///
    /// # Errors
    /// `Input` for rows that do not form a table.
    pub fn rows<T: Serialize>(mut self, name: impl Into<String>, rows: &[T]) -> Result<Self, LabError> {
        let name = name.into();
        let table = csv(rows).map_err(|error| LabError::Input {
            name: format!("{name}.csv"),
            what: error.to_string(),
        })?;
        self.rows.push((name, table));
        Ok(self)
    }

    /// Adds a chart.
    pub fn chart(self, name: impl Into<String>, chart: Chart) -> Self {
        self.stack(name, vec![chart])
    }

    /// Adds stacked charts in one file, the first on top.
    pub fn stack(mut self, name: impl Into<String>, charts: Vec<Chart>) -> Self {
        self.charts.push((name.into(), charts));
        self
    }

    /// Writes tables as CSV, charts as SVG and PNG.
    ///
    /// # Errors
    /// `Output`, `Unwritable`; `Input` for a chart without a point.
    pub fn write(&self, folder: &Folder) -> Result<(), LabError> {
        for (name, table) in &self.rows {
            folder.write(format!("{name}.csv"), table)?;
        }
        for (name, charts) in &self.charts {
            write_stack(charts, folder, name)?;
        }
        Ok(())
    }
}

/// Names of the files that a run may write; of one part alone if `only` names one.
pub fn files(experiment: &dyn Experiment, only: Option<&str>) -> Vec<String> {
    let wanted = |name: &String| only.is_none_or(|only| only == name);
    let tables = (experiment.rows().into_iter().filter(wanted)).map(|name| format!("{name}.csv"));
    let charts = (experiment.charts().into_iter().filter(wanted))
        .flat_map(|name| ["svg", "png"].map(|kind| format!("{name}.{kind}")));
    tables.chain(charts).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Two;

    impl Experiment for Two {
        fn name(&self) -> &'static str {
            "two"
        }

        fn about(&self) -> &'static str {
            "Two parts"
        }

        fn quick(&self) -> &'static str {
            "Both"
        }

        fn rows(&self) -> Vec<String> {
            self.parts().into_iter().map(str::to_owned).collect()
        }

        fn charts(&self) -> Vec<String> {
            vec!["two-b".into()]
        }

        fn parts(&self) -> Vec<&'static str> {
            vec!["two-a", "two-b"]
        }

        fn run(&self, _: Form<'_>, _: &mut Report<'_>) -> Result<Findings, LabError> {
            Ok(Findings::default())
        }
    }

    #[test]
    fn files_are_tables_then_charts_of_what_is_run() {
        assert_eq!(
            files(&Two, None),
            ["two-a.csv", "two-b.csv", "two-b.svg", "two-b.png"]
        );
        assert_eq!(files(&Two, Some("two-a")), ["two-a.csv"]);
    }
}
