//! `mortise rig`: the description of a rig, checked, sent, shown.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Subcommand;
use mortise_output::lines;
use mortise_protocol::message::{DeviceState, ToDevice};
use mortise_rig::{Abilities, Client, RigSpec, abilities, load_rig, write_rig};

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Say what is wrong with a description, or what the rig will be able to do
    Check {
        /// Description (TOML; see docs/rigs.md)
        file: PathBuf,
        /// One JSON object
        #[arg(long)]
        json: bool,
    },
    /// Check a description, send it to a board, restart the board, and see that it is in use
    Send {
        /// Description (TOML; see docs/rigs.md)
        file: PathBuf,
        /// sim, emulated, or a serial port
        #[arg(long, value_parser = super::rig)]
        rig: RigSpec,
    },
    /// Print the description a board keeps, as a file
    Show {
        /// sim, emulated, or a serial port
        #[arg(long, value_parser = super::rig)]
        rig: RigSpec,
    },
}

/// Runs it.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    match &args.action {
        Action::Check { file, json } => {
            let rig = load_rig(file)?;
            // A description that was read can be asked: reading builds the same model.
            let Ok(found) = abilities(&rig) else {
                anyhow::bail!("{}: cannot work in its home pose", file.display());
            };
            if *json {
                lines::json(&found)?;
            } else {
                tell(&found)?;
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
                _ => anyhow::bail!("the board does not use what was sent: send it again"),
            }
        }
        Action::Show { rig: spec } => {
            let client = Client::connect(spec)?;
            match client.rig()? {
                (Some(rig), _) => lines::text(write_rig(&rig).trim_end())?,
                (None, _) if forgets(spec) => anyhow::bail!(
                    "{} keeps no description: it lives in this program and ends with it, so what `mortise rig send` gave it is gone; a serial port keeps its own",
                    client.name()
                ),
                (None, _) => anyhow::bail!(
                    "{} keeps no description (or a damaged one): its mechanism is the firmware's own; send one with `mortise rig send`",
                    client.name()
                ),
            }
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// A rig of this program's own, in-process or emulated: what it keeps is gone when the program ends.
fn forgets(spec: &RigSpec) -> bool {
    matches!(spec, RigSpec::Simulated { .. } | RigSpec::Emulated { .. })
}

fn sent(spec: &RigSpec, client: &Client, name: &str) -> String {
    if forgets(spec) {
        format!(
            "{} took `{name}` and drove it until this program ended; being part of the program it keeps nothing, a serial port does",
            client.name()
        )
    } else {
        format!("{} keeps `{name}` and drives it", client.name())
    }
}

fn tell(found: &Abilities) -> anyhow::Result<()> {
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
        format!("  one count: at most {:.4} mm at the handle", found.resolution_mm),
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
