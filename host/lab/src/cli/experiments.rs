//! A command for each experiment of the table.

use std::fmt;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Arg, ArgAction, ArgMatches, Command, FromArgMatches, Subcommand, value_parser};
use mortise_lab::experiment::{Experiment, Form, files};
use mortise_lab::experiments::ALL;
use mortise_output::{Existing, Folder, lines};

/// The chosen experiment, its form, and its output folder.
pub struct Chosen {
    experiment: &'static dyn Experiment,
    quick: bool,
    json: bool,
    only: Option<String>,
    out: Option<PathBuf>,
    force: bool,
}

impl Chosen {
    /// Runs it.
    pub fn run(&self) -> anyhow::Result<ExitCode> {
        let only = self.only.as_deref();
        // Before the first trial, so that a sweep of half an hour does not end in an unwritable folder.
        let folder = |path| {
            Folder::new(
                path,
                Existing::from_force(self.force),
                &files(self.experiment, only),
            )
        };
        let folder = self.out.as_ref().map(folder).transpose()?;
        let form = Form {
            quick: self.quick,
            only,
        };
        let mut written = Ok(());
        let findings = self.experiment.run(form, &mut |line| {
            if written.is_ok() {
                written = if self.json {
                    line.json()
                        .map_err(Into::into)
                        .and_then(|json| lines::text(&json))
                } else {
                    lines::text(&line.to_string())
                };
            }
        })?;
        written?;
        if let Some(folder) = &folder {
            findings.write(folder)?;
        }
        Ok(ExitCode::SUCCESS)
    }
}

impl fmt::Debug for Chosen {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct(self.experiment.name()).finish_non_exhaustive()
    }
}

/// The command of `experiment`.
fn command(experiment: &dyn Experiment) -> Command {
    let flag = |name: &'static str| Arg::new(name).long(name).action(ArgAction::SetTrue);
    let mut command = Command::new(experiment.name())
        .about(experiment.about())
        .arg(flag("quick").help(format!("The quick form: {}", experiment.quick())))
        .arg(flag("json").help("One JSON object a trial"))
        .arg(
            Arg::new("out")
                .long("out")
                .value_name("FOLDER")
                .value_parser(value_parser!(PathBuf))
                .help("Folder for tables (CSV) and charts (SVG and PNG); created if absent"),
        )
        .arg(
            flag("force")
                .requires("out")
                .help("Replace existing tables and charts"),
        );
    let parts = experiment.parts();
    if !parts.is_empty() {
        let parts = clap::builder::PossibleValuesParser::new(parts);
        command = command.arg(
            Arg::new("map")
                .long("map")
                .value_name("MAP")
                .value_parser(parts)
                .help("Make only the map of this name, which is also the name of its files"),
        );
    }
    command
}

impl FromArgMatches for Chosen {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let (experiment, matches) = matches
            .subcommand()
            .and_then(|(name, matches)| Some((*ALL.iter().find(|known| known.name() == name)?, matches)))
            .ok_or_else(|| clap::Error::new(clap::error::ErrorKind::MissingSubcommand))?;
        let text = |name: &str| {
            let value = matches.try_get_one::<String>(name).ok().flatten();
            value.cloned()
        };
        Ok(Self {
            experiment,
            quick: matches.get_flag("quick"),
            json: matches.get_flag("json"),
            only: text("map"),
            out: matches.get_one("out").cloned(),
            force: matches.get_flag("force"),
        })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

impl Subcommand for Chosen {
    fn augment_subcommands(cli: Command) -> Command {
        cli.subcommands(ALL.iter().map(|experiment| command(*experiment)))
    }

    fn augment_subcommands_for_update(cli: Command) -> Command {
        Self::augment_subcommands(cli)
    }

    fn has_subcommand(name: &str) -> bool {
        ALL.iter().any(|experiment| experiment.name() == name)
    }
}
