//! `mortise rig`: checks, sends and shows the description of a rig, and writes its firmware.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Subcommand;
use mortise_flash::{Firmware, Prober};
use mortise_output::lines;
use mortise_protocol::message::{DeviceState, ToDevice};
use mortise_rig::{Abilities, Client, RigSpec, abilities, load_rig, write_rig};

use super::units;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Report the errors of a description, or what the rig will be able to do
    Check {
        /// Description (TOML; see docs/rigs.md)
        file: PathBuf,
        /// One JSON object
        #[arg(long)]
        json: bool,
    },
    /// Check a description, send it to a board, restart the board, and verify that it is in use
    Send {
        /// Description (TOML; see docs/rigs.md)
        file: PathBuf,
        /// sim, emulated, or a serial port
        #[arg(long, value_parser = units::rig)]
        rig: RigSpec,
    },
    /// Write firmware to a board through its debug probe (by the program probe-rs), and read it back
    Flash {
        /// Firmware: the file that `cargo xtask firmware` builds
        file: PathBuf,
        /// Debug probe, if there are several: its serial number, or vendor, product and serial number
        #[arg(long)]
        probe: Option<String>,
        /// Only look at the file and for the probe
        #[arg(long)]
        check: bool,
    },
    /// Print the description stored on a board, as a file
    Show {
        /// sim, emulated, or a serial port
        #[arg(long, value_parser = units::rig)]
        rig: RigSpec,
    },
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    match &args.action {
        Action::Check { file, json } => {
            let rig = load_rig(file)?;
            // Does not fail after a successful reading, which builds the same model.
            let Ok(found) = abilities(&rig) else {
                anyhow::bail!("{}: cannot work in its home pose", file.display());
            };
            if *json {
                lines::json(&found)?;
            } else {
                print(&found)?;
            }
        }
        Action::Send { file, rig: spec } => {
            let rig = load_rig(file)?;
            let client = Client::connect(spec)?;
            if !matches!(client.state(), DeviceState::Idle | DeviceState::Homing) {
                anyhow::bail!("the board is not idle: disarm it, or clear its stop or fault first");
            }
            client.request(ToDevice::SetRig(rig.clone()))?;
            let client = client.restart()?;
            match client.rig()? {
                (Some(kept), true) if kept == rig => {
                    lines::text(&sent(spec, &client, &rig.name))?;
                }
                _ => anyhow::bail!("the board does not use the description that was sent: send it again"),
            }
        }
        Action::Flash { file, probe, check } => flash(file, probe.as_deref(), *check)?,
        Action::Show { rig: spec } => {
            let client = Client::connect(spec)?;
            match client.rig()? {
                (Some(rig), _) => lines::text(write_rig(&rig).trim_end())?,
                (None, _) if is_volatile(spec) => anyhow::bail!(
                    "{} keeps no description: it runs inside this program and ends with it, so a description from `mortise rig send` is lost; a rig on a serial port keeps its own",
                    client.name()
                ),
                (None, _) => anyhow::bail!(
                    "{} keeps no description (or a damaged one): it uses the firmware's built-in mechanism; send one with `mortise rig send`",
                    client.name()
                ),
            }
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Writes firmware; the steps that `probe-rs` names go to standard error.
fn flash(file: &Path, probe: Option<&str>, check: bool) -> anyhow::Result<()> {
    let firmware = Firmware::read(file)?;
    lines::text(&format!("{}: {}", file.display(), firmware.words()))?;
    let prober = Prober::find()?;
    let probe = prober.choose(probe)?;
    lines::text(&format!("debug probe: {probe}"))?;
    if check {
        return Ok(());
    }
    let mut say = |line: &str| eprintln!("  {line}");
    prober.write(&firmware, &probe, &mut say, &mut || false)?;
    lines::text(&format!(
        "{} has its firmware and has started again; `mortise ports` lists it",
        firmware.board()
    ))?;
    Ok(())
}

/// Whether the rig runs inside this program, in-process or emulated: it loses its description when the program ends.
fn is_volatile(spec: &RigSpec) -> bool {
    matches!(spec, RigSpec::Simulated { .. } | RigSpec::Emulated { .. })
}

fn sent(spec: &RigSpec, client: &Client, name: &str) -> String {
    if is_volatile(spec) {
        format!(
            "{} used `{name}` until this program ended; a simulated rig stores no description, a rig on a serial port does",
            client.name()
        )
    } else {
        format!("{} keeps `{name}` and uses it", client.name())
    }
}

fn print(found: &Abilities) -> anyhow::Result<()> {
    let sensed = if found.senses_orientation {
        "position and orientation"
    } else {
        "position"
    };
    let [x, y, z] = found.home_mm;
    for line in [
        format!("{}: {} motors, senses {sensed}", found.name, found.joints),
        format!(
            "  home: {x:.1}, {y:.1}, {z:.1} mm from the world's origin, isotropy {:.2}",
            found.isotropy
        ),
        format!(
            "  resolution: one count is at most {:.4} mm at the handle",
            found.resolution_mm
        ),
        format!(
            "  force: {:.2} N in the weakest direction, {:.2} N in the strongest",
            found.force_weakest_n, found.force_strongest_n
        ),
        format!("  friction: at most {:.2} N at the handle", found.friction_n),
        format!("  fastest encoder: {:.0} counts in a tick", found.counts_per_tick),
    ] {
        lines::text(&line)?;
    }
    Ok(())
}
