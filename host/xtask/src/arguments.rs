//! The command line: every command of `cargo xtask` and its options.

use clap::{Args, CommandFactory as _, Parser, Subcommand};

/// Set-up, demo, tests, figures
#[derive(Debug, Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask")]
pub struct Arguments {
    #[command(subcommand)]
    pub command: Command,
}

/// A command.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Check what is missing on this machine and install only that
    Setup(Installing),
    /// Run the sample insertion, in a window or with --headless
    Demo(Demo),
    /// Everything CI runs, in order; stops at the first failing step
    Test(Test),
    /// Measure the figures NAME and write them to docs/figures/NAME.md
    Figures(Figures),
    /// Time and error of a distance query beside other libraries, which are installed below target/
    Peers(Peers),
    /// Random bytes, guided by coverage, for what reads frames, scenes, rigs and STEP files
    Fuzz(Fuzz),
    /// Build the firmware of every board, or of BOARD, and print its flash and RAM use
    Firmware(Firmware),
    /// Make a Debian package and an archive of the program in target/package
    Package(Package),
    /// Make the pages of docs a book of web pages with a search, in target/book
    Book(Book),
    /// Check that docs name what exists, that files are short, that layers hold and that no modules need each other
    Tidy,
}

/// What is asked before something is installed.
#[derive(Clone, Copy, Debug, Default, Args)]
pub struct Installing {
    /// Install what is missing without a question (CI=true says the same, and so does a missing terminal)
    #[arg(long, short)]
    pub yes: bool,
    /// Install nothing: say what is missing and stop
    #[arg(long)]
    pub no_install: bool,
}

/// Arguments of `demo`.
#[derive(Clone, Debug, Default, Args)]
pub struct Demo {
    #[command(flatten)]
    pub installing: Installing,
    /// Without a window: print the result
    #[arg(long)]
    pub headless: bool,
    /// Print the result as one JSON object
    #[arg(long)]
    pub json: bool,
    /// sim, emulated or a serial port [default: emulated where QEMU is there, else sim]
    #[arg(long)]
    pub rig: Option<String>,
    /// STEP file with a peg before a hole [default: the sample]
    pub file: Option<String>,
    /// Further arguments of `mortise demo`
    #[arg(last = true)]
    pub further: Vec<String>,
}

/// Arguments of `test`.
#[derive(Clone, Debug, Default, Args)]
pub struct Test {
    #[command(flatten)]
    pub installing: Installing,
    /// Name the steps and stop
    #[arg(long)]
    pub list: bool,
    /// Run these steps alone
    #[arg(long, value_name = "STEP,...", value_delimiter = ',', conflicts_with = "from")]
    pub only: Vec<String>,
    /// Start at this step
    #[arg(long, value_name = "STEP")]
    pub from: Option<String>,
}

/// Arguments of `figures`.
#[derive(Clone, Debug, Default, Args)]
pub struct Figures {
    #[command(flatten)]
    pub installing: Installing,
    /// The table; with --renew and --record any of docs/figures
    #[arg(value_name = "NAME")]
    pub names: Vec<String>,
    /// The quick form that CI runs
    #[arg(long, conflicts_with_all = ["check", "renew", "record"])]
    pub quick: bool,
    /// Claim what is measured; else claims are kept, and only those of new rows added
    #[arg(long, conflicts_with_all = ["check", "record"])]
    pub claim: bool,
    /// Compare what README and docs say with the quick form
    #[arg(long, conflicts_with_all = ["names", "renew", "record"])]
    pub check: bool,
    /// Make anew what is stale in docs/figures, or NAMEs of it, and say how long each took
    #[arg(long, conflicts_with = "record")]
    pub renew: bool,
    /// Take NAMEs in docs/figures, made by hand, for what is made now
    #[arg(long, requires = "names")]
    pub record: bool,
}

/// Arguments of `peers`.
#[derive(Clone, Debug, Default, Args)]
pub struct Peers {
    #[command(flatten)]
    pub installing: Installing,
    /// Two scenes on one mesh each
    #[arg(long)]
    pub quick: bool,
    /// Print one JSON object for each method and scene, instead of the table
    #[arg(long)]
    pub json: bool,
    /// Write docs/figures/peers.md, its table and its charts
    #[arg(long)]
    pub write: bool,
}

/// Arguments of `fuzz`.
#[derive(Clone, Debug, Args)]
pub struct Fuzz {
    /// One target [default: all of them]
    pub target: Option<String>,
    /// How long each runs
    #[arg(long, value_name = "N", default_value_t = 1.0)]
    pub minutes: f64,
    /// Print the result as rows of figures
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `firmware`.
#[derive(Clone, Debug, Default, Args)]
pub struct Firmware {
    #[command(flatten)]
    pub installing: Installing,
    /// One board, or several [default: all of them]
    #[arg(value_name = "BOARD")]
    pub boards: Vec<String>,
}

/// Arguments of `package`.
#[derive(Clone, Copy, Debug, Default, Args)]
pub struct Package {
    #[command(flatten)]
    pub installing: Installing,
}

/// Arguments of `book`.
#[derive(Clone, Copy, Debug, Default, Args)]
pub struct Book {
    #[command(flatten)]
    pub installing: Installing,
}

/// Help of `cargo xtask`, or of its command `name`; `None` if there is no such command.
pub fn help(name: Option<&str>) -> Option<String> {
    let mut all = Arguments::command();
    // Fills in how each command is called.
    all.build();
    match name {
        None => Some(all.render_long_help().to_string()),
        Some(name) => {
            let command = all.find_subcommand_mut(name)?;
            Some(command.render_long_help().to_string())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_sound_and_help_names_every_option() {
        Arguments::command().debug_assert();
        assert!(help(None).unwrap().contains("figures"));
        assert!(help(Some("demo")).unwrap().contains("--no-install"));
        assert_eq!(help(Some("dance")), None);
    }

    #[test]
    fn figures_are_checked_renewed_or_measured_but_not_two_at_once() {
        let read =
            |words: &str| Arguments::try_parse_from(format!("xtask figures {words}").split_whitespace());
        for sound in [
            "contact --quick --claim",
            "--check",
            "--renew",
            "--renew contact rate",
            "--record window",
        ] {
            assert!(read(sound).is_ok(), "{sound}");
        }
        for wrong in [
            "--check contact",
            "--check --renew",
            "--record",
            "--renew --quick",
        ] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
    }
}
