//! `mortise assemble --play`: the steps of an assembly as a simulated hand felt them.

use std::ops::ControlFlow;

use mortise_bake::{Grabbable, Request};
use mortise_output::lines;
use mortise_rig::{Client, RigSpec};
use mortise_scenario::ScenarioError;
use mortise_scenario::insertions::{AssemblyScene, Inserted, Manner, play_insertions};
use mortise_task::Assembly;
use mortise_task::insertion::insertions;
use mortise_task::report::SequenceReport;
use mortise_task::sequence::Sequence;
use serde::Serialize;

/// Steps that a simulated hand has done.
#[derive(Serialize)]
pub struct Played {
    rig: String,
    insertions: Vec<Inserted>,
    /// A sentence on each step of the sequence, in the order of assembly.
    #[serde(skip)]
    felt: Vec<String>,
}

/// A sequence, and how a simulated hand felt it.
#[derive(Serialize)]
struct Report<'a> {
    #[serde(flatten)]
    sequence: &'a SequenceReport<'a>,
    played: &'a Played,
}

/// Connects to a rig with a simulated hand, in lockstep. A search of a minute is not for a rig that has none.
pub fn connect(rig: &RigSpec) -> anyhow::Result<Client> {
    if matches!(rig, RigSpec::Serial { .. }) {
        return Err(ScenarioError::NeedsSimulatedHand {
            rig: rig.to_string(),
            scenario: "steps of an assembly".into(),
        }
        .into());
    }
    Ok(Client::connect(&rig.lockstep())?)
}

/// Plays the steps with a simulated hand; each is printed once it is known, or none with `json`.
pub fn play(assembly: &Assembly, found: &Sequence, client: &Client, json: bool) -> anyhow::Result<Played> {
    let steps = insertions(assembly, found);
    let mut inserted = Vec::new();
    if !steps.is_empty() {
        let request = Request {
            grabbable: Grabbable::All,
            ..Request::default()
        };
        let planned = mortise_bake::plan(&assembly.model, &request, &|_| ControlFlow::Continue(()))?;
        let scene = AssemblyScene {
            model: &assembly.model,
            image: &planned.image,
            report: &planned.plan.report,
        };
        let mut printed = Ok(());
        play_insertions(client, &scene, &steps, &Manner::default(), &mut |one| {
            if !json && printed.is_ok() {
                printed = lines::text(&one.words());
            }
            inserted.push(one);
        })?;
        printed?;
    }
    Ok(Played {
        rig: client.name().to_owned(),
        felt: inserted.iter().map(Inserted::words).collect(),
        insertions: inserted,
    })
}

impl Played {
    /// Whether every part and group went in.
    pub fn all_in(&self) -> bool {
        self.insertions.iter().all(|inserted| inserted.in_place)
    }

    /// A sentence on each step of the sequence, in the order of assembly.
    pub fn felt(&self) -> &[String] {
        &self.felt
    }

    /// Prints one JSON object with the sequence, or what the steps came to.
    pub fn print(&self, sequence: &SequenceReport<'_>, json: bool) -> anyhow::Result<()> {
        if json {
            lines::json(&Report {
                sequence,
                played: self,
            })?;
        } else {
            lines::text(&self.words())?;
        }
        Ok(())
    }

    fn words(&self) -> String {
        if self.insertions.is_empty() {
            return "nothing to play: no step was found".into();
        }
        let put_in = (self.insertions.iter())
            .filter(|inserted| inserted.in_place)
            .count();
        let force = (self.insertions.iter()).fold(0.0, |most: f64, inserted| most.max(inserted.peak.force_n));
        let missed: u32 = self.insertions.iter().map(|inserted| inserted.missed_ticks).sum();
        format!(
            "by a simulated hand on {}: {put_in} of {} in, at most {force:.2} N, {missed} ticks missed",
            self.rig,
            self.insertions.len(),
        )
    }
}
