//! Playing a scenario on a rig.

use mortise_guide::GuideSettings;
use mortise_protocol::image::CRC;
use mortise_protocol::message::{
    Capabilities, CostUnit, DeviceState, Fault, FromDevice, Statistics, Telemetry, ToDevice,
};
use mortise_protocol::parameter::ParameterId;
use mortise_rig::{Client, Event, FaultCounts, FaultLine, Ran, RigSpec, describe};

use crate::error::ScenarioError;
use crate::hand::{REACH_TICKS, REST_TICKS, TICK_HZ, reach, script};
use crate::measure::Felt;
use crate::outcome::Outcome;
use crate::scenario::{Scenario, parameter_named};
use crate::scene::PreparedScene;
use crate::{measure, overlap, truth, wire};

/// Ticks requested at once: bounds the telemetry that waits, and the delay until a fault is seen.
const BATCH_TICKS: u32 = 500;
/// Ticks after disarming in which the wrench fades out.
pub(crate) const FADE_TICKS: u32 = 150;

/// Reads, bakes and plays `scenario` on the rig `spec`, in lockstep, and measures.
///
/// # Errors
/// Everything [`ScenarioError`] lists but `NoSuchFigures`. A bound that does not hold is not an error: see [`Outcome::verdicts`].
pub fn run(scenario: &Scenario, spec: &RigSpec) -> Result<Outcome, ScenarioError> {
    let scene = PreparedScene::of(scenario)?;
    let client = connect_with_scene(scenario, spec, &scene)?;
    run_on(&client, scenario, &scene)
}

/// As [`connect`]; an emulated board starts with the scene, which [`run_on`] then need not send. The line is free of faults.
///
/// # Errors
/// `Rig`.
pub fn connect_with_scene(
    scenario: &Scenario,
    spec: &RigSpec,
    scene: &PreparedScene,
) -> Result<Client, ScenarioError> {
    match scenario.faults {
        Some(_) => connect(scenario, spec),
        None => Ok(Client::connect_with_scene(&spec.lockstep(), &scene.image)?),
    }
}

/// Connects to the rig `spec` in lockstep, over a faulty line if `scenario` has faults.
///
/// # Errors
/// `Rig`.
pub fn connect(scenario: &Scenario, spec: &RigSpec) -> Result<Client, ScenarioError> {
    let spec = spec.lockstep();
    Ok(match scenario.faults {
        Some(_) => Client::connect_with_faults(&spec)?,
        None => Client::connect(&spec)?,
    })
}

/// Plays `scenario` on a rig that is already connected and in lockstep ([`connect`]), with a scene prepared before.
///
/// # Errors
/// As [`run`].
pub fn run_on(client: &Client, scenario: &Scenario, scene: &PreparedScene) -> Result<Outcome, ScenarioError> {
    if !scenario.run.guidance {
        return Ok(record(client, scenario, scene, None)?.outcome);
    }
    let mut guide = scene.guide(GuideSettings::default());
    let mut listener = |sample: &Telemetry| guide.hear(sample);
    Ok(record(client, scenario, scene, Some(&mut listener))?.outcome)
}

/// Receives each sample that the link lets through, before the next tick; returns the messages to send.
pub type Listener<'l> = dyn FnMut(&Telemetry) -> Vec<ToDevice> + 'l;

/// A run and its telemetry.
#[derive(Clone, Debug)]
pub struct Recording {
    /// Its measurements.
    pub outcome: Outcome,
    /// Every sample that the board sent from the hand's start on, including those lost on a faulty link.
    pub samples: Vec<Telemetry>,
    /// Handle and wrench of each sample: the true motion where [`Outcome::energy_exact`], else the encoder readings.
    pub felt: Vec<Felt>,
    /// Counts of the link's faults.
    pub faults: FaultCounts,
}

/// As [`run_on`], with the caller's listener instead of the scenario's guidance.
///
/// # Errors
/// As [`run`].
pub fn record(
    client: &Client,
    scenario: &Scenario,
    scene: &PreparedScene,
    listener: Option<&mut Listener<'_>>,
) -> Result<Recording, ScenarioError> {
    let capabilities = client.capabilities();
    if !capabilities.simulated {
        return Err(ScenarioError::NeedsSimulatedHand {
            rig: client.name().to_owned(),
            scenario: scenario.name.clone(),
        });
    }
    let expected = (scenario.faults.as_ref()).is_some_and(|faults| !faults.inputs.is_empty());
    let mut play = Play {
        expected,
        ..Play::new(client)
    };
    play.prepare(scenario, scene)?;
    let line = line_of(client, scenario)?;
    let before = client.fault_line().map(FaultLine::counts).unwrap_or_default();
    let ran = play.perform(scenario, line, listener)?;
    let mut faults = FaultCounts::default();
    if let Some(line) = line {
        // Waits for frames still on the line.
        client.run(0)?;
        play.listen()?;
        play.overheard(line)?;
        faults = line.counts().since(&before);
        line.end();
    }
    let statistics = client.statistics(false)?;
    client.request(ToDevice::SetTelemetry { every_ticks: 0 })?;
    // The last sample may arrive after the answer to the last run, but not after these answers.
    play.listen()?;
    if play.expected {
        // Clears the input faults for the next user of the rig.
        client.request(ToDevice::SimulatedInputs(heapless::Vec::new()))?;
    }
    client.request(ToDevice::Disarm)?;
    client.run(FADE_TICKS)?;
    let before = (&reach(&scenario.hand), REACH_TICKS + REST_TICKS);
    let replayed = truth::replay(before, &script(&scenario.hand), &play.samples);
    let exact = replayed.is_some();
    let felt = replayed.unwrap_or_else(|| play.samples.iter().map(Felt::reported).collect());
    Ok(Recording {
        outcome: outcome(scenario, scene, client, &play, &statistics, ran, (&felt, exact)),
        samples: play.samples,
        felt,
        faults,
    })
}

/// The line to which the scenario's faults apply.
fn line_of<'c>(client: &'c Client, scenario: &Scenario) -> Result<Option<&'c FaultLine>, ScenarioError> {
    match (&scenario.faults, client.fault_line()) {
        (Some(_), None) => Err(ScenarioError::Scenario {
            name: scenario.name.clone(),
            what: "it has [faults], but the connection is one without: connect with faults".into(),
        }),
        (Some(_), line) => Ok(line),
        (None, _) => Ok(None),
    }
}

/// A rig while it plays.
pub(crate) struct Play<'c> {
    pub client: &'c Client,
    /// Samples heard so far.
    pub samples: Vec<Telemetry>,
    messages: u32,
    /// Tick in which the hand began.
    begun: u32,
    /// True if the scenario makes inputs fail.
    expected: bool,
    /// The first fault, with its tick.
    fault: Option<(u32, Fault)>,
}

impl<'c> Play<'c> {
    pub fn new(client: &'c Client) -> Self {
        Self {
            client,
            samples: Vec::new(),
            messages: 0,
            begun: 0,
            expected: false,
            fault: None,
        }
    }

    /// Takes the board's samples, including lost ones, and its fault reports.
    fn overheard(&mut self, line: &FaultLine) -> Result<(), ScenarioError> {
        self.samples.clear();
        for reported in line.overheard() {
            match reported {
                FromDevice::Telemetry(sample) => self.samples.push(sample),
                FromDevice::Fault { tick, fault } => self.faulted(tick, fault)?,
                _ => {}
            }
        }
        Ok(())
    }

    /// A fault is an error unless the scenario provokes it.
    fn faulted(&mut self, tick: u32, fault: Fault) -> Result<(), ScenarioError> {
        if !self.expected {
            let what = describe(fault);
            return Err(ScenarioError::Fault { tick, what });
        }
        self.fault.get_or_insert((tick, fault));
        Ok(())
    }

    /// Uploads the scene, sets parameters, moves the handle to the grip point and grabs the part.
    fn prepare(&mut self, scenario: &Scenario, scene: &PreparedScene) -> Result<(), ScenarioError> {
        let client = self.client;
        // An earlier run may have left the board stopped.
        if matches!(client.state(), DeviceState::Stopped | DeviceState::Fault(_)) {
            client.request(ToDevice::ClearFault)?;
        }
        if client.refresh_capabilities()?.scene != Some(CRC.checksum(&scene.image)) {
            client.upload(&scene.image, &mut |_| {})?;
        }
        for (name, &value) in &scenario.parameters {
            if let Some(id) = parameter_named(name) {
                client.request(ToDevice::SetParameter { id, value })?;
            }
        }
        if let Some(integrator) = scenario.integrator {
            let (id, value) = (ParameterId::Integrator, integrator.value());
            client.request(ToDevice::SetParameter { id, value })?;
        }
        client.request(ToDevice::ResetScene)?;
        client.request(ToDevice::SimulatedHand(reach(&scenario.hand)))?;
        self.run(REACH_TICKS + REST_TICKS)?;
        client.request(ToDevice::Arm)?;
        client.request(ToDevice::Grab { part: scene.part })?;
        Ok(())
    }

    fn perform(
        &mut self,
        scenario: &Scenario,
        line: Option<&FaultLine>,
        listener: Option<&mut Listener<'_>>,
    ) -> Result<Ran, ScenarioError> {
        let client = self.client;
        client.statistics(true)?;
        let every_ticks = scenario.run.telemetry_every_ticks;
        client.request(ToDevice::SetTelemetry { every_ticks })?;
        client.request(ToDevice::SimulatedHand(script(&scenario.hand)))?;
        let faulty = scenario.faults.is_some();
        if let (Some(line), Some(faults)) = (line, &scenario.faults) {
            if self.expected {
                self.begun = client.run(0)?.tick;
                let inputs = faults.input_message().map_err(|what| ScenarioError::Scenario {
                    name: scenario.name.clone(),
                    what: format!("faults.{what}"),
                })?;
                client.request(inputs)?;
            }
            line.begin(faults);
        }
        let ticks = (scenario.run.duration_s * TICK_HZ).round() as u32;
        match (listener, scenario.run.parameter_every_ticks) {
            (Some(listener), _) => {
                let every = scenario.run.heed_every_ticks.unwrap_or(every_ticks);
                self.heeding(listener, ticks, u32::from(every.max(1)), faulty)
            }
            (None, Some(every)) => self.loaded(scenario, ticks, every.max(1)),
            (None, None) => self.run(ticks),
        }
    }

    /// Sends a parameter every `every` ticks.
    fn loaded(&mut self, scenario: &Scenario, ticks: u32, every: u32) -> Result<Ran, ScenarioError> {
        let client = self.client;
        // The limit alternates well above the forces that occur, so that each message changes a setting and none changes the outcome.
        let id = ParameterId::ForceLimit;
        let start = (scenario.parameters.get(id.row().name).copied()).unwrap_or(id.row().default);
        let mut value = start;
        let mut left = ticks;
        let ran = loop {
            value = if value == start { id.row().max } else { start };
            client.send(ToDevice::SetParameter { id, value })?;
            self.messages += 1;
            let batch = left.min(every);
            let ran = self.run(batch)?;
            left -= batch;
            if left == 0 {
                break ran;
            }
        };
        if scenario.faults.is_some() {
            return Ok(ran);
        }
        // Messages are handled in order: if the last one arrived, all did.
        let found = client.parameter(id)?;
        if found != value {
            return Err(ScenarioError::Scenario {
                name: scenario.name.clone(),
                what: format!(
                    "ForceLimit is {found} after {} messages, the last said {value}",
                    self.messages
                ),
            });
        }
        Ok(ran)
    }

    /// Runs `every` ticks at a time and sends the listener's answers to their samples.
    pub fn heeding(
        &mut self,
        listener: &mut Listener<'_>,
        ticks: u32,
        every: u32,
        faulty: bool,
    ) -> Result<Ran, ScenarioError> {
        let mut left = ticks;
        loop {
            let batch = left.min(every);
            let heard = self.samples.len();
            let ran = self.run(batch)?;
            // The sample may arrive after the answer to the run, but not after this answer: reception must not depend on timing.
            self.client.run(0)?;
            self.listen()?;
            for sample in &self.samples[heard..] {
                for message in listener(sample) {
                    // On a faulty link an answer may be lost, so none is awaited.
                    if faulty {
                        self.client.send(message)?;
                    } else {
                        self.client.request(message)?;
                    }
                }
            }
            left -= batch;
            if left == 0 {
                return Ok(ran);
            }
        }
    }

    /// Runs ticks in batches and takes the board's messages meanwhile.
    pub fn run(&mut self, ticks: u32) -> Result<Ran, ScenarioError> {
        let mut left = ticks;
        loop {
            let batch = left.min(BATCH_TICKS);
            let ran = self.client.run(batch)?;
            self.listen()?;
            left -= batch;
            if left == 0 {
                return Ok(ran);
            }
        }
    }

    pub fn listen(&mut self) -> Result<(), ScenarioError> {
        let client = self.client;
        for event in client.events().try_iter() {
            match event {
                Event::Telemetry(sample) => self.samples.push(*sample),
                Event::Fault { tick, fault } => self.faulted(tick, fault)?,
                Event::State { .. } | Event::Log(_) | Event::LinkLost(_) => {}
            }
        }
        Ok(())
    }
}

fn outcome(
    scenario: &Scenario,
    scene: &PreparedScene,
    client: &Client,
    play: &Play<'_>,
    statistics: &Statistics,
    ran: Ran,
    (felt, energy_exact): (&[Felt], bool),
) -> Outcome {
    let capabilities: &Capabilities = client.capabilities();
    let samples = play.samples.as_slice();
    let settled_count =
        (scenario.run.settled_s * TICK_HZ / f64::from(scenario.run.telemetry_every_ticks)).ceil();
    let settled = &samples[samples.len().saturating_sub(settled_count as usize)..];
    let last = samples.iter().rev().find_map(|sample| sample.object.as_ref());
    let depth = (scenario.depth.as_ref().zip(last))
        .and_then(|(depth, (_, pose))| measure::depth(scene, depth, &wire::pose_mm(pose)));
    let press = scenario
        .press
        .as_ref()
        .and_then(|press| measure::press(press, settled));
    let (energy_given_mj, energy_passed_mj) = measure::energy(scene, &scenario.settings(), samples, felt);
    let object = measure::object_energy(scene, samples);
    let impulse = measure::impulse(samples);
    let counted = capabilities.cost_unit == CostUnit::Instructions;
    Outcome {
        scenario: scenario.name.clone(),
        rig: client.name().to_owned(),
        board: capabilities.board.to_string(),
        inserted_mm: depth.map(|(inserted, _, _)| inserted),
        hole_mm: depth.map(|(_, hole, _)| hole),
        lateral_mm: depth.map(|(_, _, lateral)| lateral),
        ticks: statistics.ticks,
        missed_ticks: statistics.missed_ticks,
        instructions_per_tick_max: counted.then_some(statistics.cost_max),
        instructions_per_tick_mean: (counted && statistics.ticks > 0)
            .then(|| statistics.cost_sum as f64 / f64::from(statistics.ticks)),
        instructions_per_tick_budget: counted.then_some(capabilities.cost_budget),
        points_per_tick_max: statistics.points_max,
        peak_force_n: f64::from(statistics.peak_force),
        peak_torque_nm: f64::from(statistics.peak_torque),
        press_handle_n: press.map(|(handle, _)| handle),
        press_hand_n: press.map(|(_, hand)| hand),
        press_error_percent: press.map(|(handle, hand)| 100.0 * (handle - hand).abs() / hand.abs().max(1e-9)),
        penetration_mm: overlap::penetration_mm(scene, samples),
        board_penetration_mm: measure::board_deepest(samples),
        contact_impulse_ns: impulse.contact_ns,
        peak_contact_n: impulse.contact_peak_n,
        impulse_lost_ns: impulse.lost_ns,
        energy_given_mj,
        energy_passed_mj,
        energy_exact,
        contact_given_mj: object.contact_mj,
        constraint_given_mj: object.constraint_mj,
        samples: samples.len() as u32,
        dropped_samples: statistics.dropped,
        bad_frames: statistics.bad_frames,
        parameter_messages: play.messages,
        flags: samples.iter().fold(0, |flags, sample| flags | sample.flags),
        degraded_percent: measure::left_out_percent(samples),
        fault: play.fault.map(|(_, fault)| describe(fault)),
        fault_at_ms: play
            .fault
            .map(|(tick, _)| f64::from(tick.wrapping_sub(play.begun))),
        force_after_fault_n: play.fault.map(|(tick, _)| measure::force_after(samples, tick)),
        image_bytes: scene.image.len(),
        stack_bytes_max: statistics.stack_max,
        state_hash: format!("{:016x}", ran.state_hash),
    }
}
