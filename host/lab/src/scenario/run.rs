//! Playing a scenario on a rig.

use glam::{DQuat, DVec3};
use mortise_guide::GuideSettings;
use mortise_protocol::message::{
    Capabilities, CostUnit, DeviceState, Fault, Flags, FromDevice, HandScript, Keyframe, Statistics,
    Telemetry, ToDevice, WirePose,
};
use mortise_protocol::parameter::ParameterId;
use mortise_rig::{Client, Event, FaultCounts, FaultLine, Ran, RigSpec, describe};

use super::measure::Felt;
use super::outcome::Outcome;
use super::scene::PreparedScene;
use super::{Hand, Key, Scenario, measure, overlap, parameter_named, truth};
use crate::error::LabError;

/// Ticks in a second of every simulated rig.
const TICK_HZ: f64 = 1000.0;
/// Ticks in which the hand brings the handle to the grip, and in which it comes to rest there.
pub(super) const REACH_TICKS: u32 = 300;
pub(super) const REST_TICKS: u32 = 200;
/// Ticks asked for at once: bounds the telemetry that waits, and the time until a fault is seen.
const BATCH_TICKS: u32 = 500;
/// Ticks after disarming in which the wrench fades out.
const FADE_TICKS: u32 = 150;

/// Reads, bakes and plays `scenario` on the rig `spec`, in lockstep, and measures.
///
/// # Errors
/// Everything [`LabError`] lists but `NoSuchFigures`. A bound that does not hold is not an error: see [`Outcome::verdicts`].
pub fn run(scenario: &Scenario, spec: &RigSpec) -> Result<Outcome, LabError> {
    let scene = PreparedScene::of(scenario)?;
    let client = connect(scenario, spec)?;
    run_on(&client, scenario, &scene)
}

/// Connects to the rig `spec` in lockstep, through a line that can fail where `scenario` has faults.
///
/// # Errors
/// `Rig`.
pub fn connect(scenario: &Scenario, spec: &RigSpec) -> Result<Client, LabError> {
    let spec = spec.lockstep();
    Ok(match scenario.faults {
        Some(_) => Client::connect_with_faults(&spec)?,
        None => Client::connect(&spec)?,
    })
}

/// Plays `scenario` on a rig that is connected already and in lockstep ([`connect`]), with a scene prepared before.
///
/// # Errors
/// As [`run`].
pub fn run_on(client: &Client, scenario: &Scenario, scene: &PreparedScene) -> Result<Outcome, LabError> {
    if !scenario.run.guidance {
        return Ok(record(client, scenario, scene, None)?.outcome);
    }
    let mut guide = scene.guide(GuideSettings::default());
    let mut listener = |sample: &Telemetry| guide.hear(sample);
    Ok(record(client, scenario, scene, Some(&mut listener))?.outcome)
}

/// Hears each sample the link lets through, before the next tick; says what to send.
pub type Listener<'l> = dyn FnMut(&Telemetry) -> Vec<ToDevice> + 'l;

/// A run and all that was heard.
#[derive(Clone, Debug)]
pub struct Recording {
    /// What it measured.
    pub outcome: Outcome,
    /// Every sample the board sent from the hand's start on, also those a faulty link lost.
    pub samples: Vec<Telemetry>,
    /// The same handle and wrench for each: of its true motion where [`Outcome::energy_exact`], else as the board tells it.
    pub(crate) felt: Vec<Felt>,
    /// What the link did to the frames.
    pub faults: FaultCounts,
}

/// As [`run_on`], with a listener of the caller's instead of the scenario's guidance.
///
/// # Errors
/// As [`run`].
pub fn record(
    client: &Client,
    scenario: &Scenario,
    scene: &PreparedScene,
    listener: Option<&mut Listener<'_>>,
) -> Result<Recording, LabError> {
    let capabilities = client.capabilities();
    if !capabilities.simulated {
        return Err(LabError::NeedsSimulatedHand {
            rig: client.name().to_owned(),
            scenario: scenario.name.clone(),
        });
    }
    let expected = (scenario.faults.as_ref()).is_some_and(|faults| !faults.inputs.is_empty());
    let mut play = Play {
        client,
        samples: Vec::new(),
        messages: 0,
        begun: 0,
        expected,
        fault: None,
    };
    play.prepare(scenario, scene)?;
    let line = line_of(client, scenario)?;
    let before = client.fault_line().map(FaultLine::counts).unwrap_or_default();
    let ran = play.perform(scenario, line, listener)?;
    let mut faults = FaultCounts::default();
    if let Some(line) = line {
        // Anything still on its way.
        client.run(0)?;
        play.listen()?;
        play.overheard(line)?;
        faults = line.counts().since(&before);
        line.end();
    }
    let statistics = client.statistics(false)?;
    client.request(ToDevice::SetTelemetry { every_ticks: 0 })?;
    // The last sample may come behind the answer to the last run, but not behind these.
    play.listen()?;
    if play.expected {
        // Sound inputs for whoever comes next.
        client.request(ToDevice::SimulatedInputs(heapless::Vec::new()))?;
    }
    client.request(ToDevice::Disarm)?;
    client.run(FADE_TICKS)?;
    let before = (&reach(&scenario.hand), REACH_TICKS + REST_TICKS);
    let replayed = truth::replay(before, &script(&scenario.hand), &play.samples);
    let exact = replayed.is_some();
    let felt = replayed.unwrap_or_else(|| play.samples.iter().map(Felt::told).collect());
    Ok(Recording {
        outcome: outcome(scenario, scene, client, &play, &statistics, ran, (&felt, exact)),
        samples: play.samples,
        felt,
        faults,
    })
}

/// The line the scenario's faults are for.
fn line_of<'c>(client: &'c Client, scenario: &Scenario) -> Result<Option<&'c FaultLine>, LabError> {
    match (&scenario.faults, client.fault_line()) {
        (Some(_), None) => Err(LabError::Scenario {
            name: scenario.name.clone(),
            what: "it has [faults], but the connection is one without: connect with faults".into(),
        }),
        (Some(_), line) => Ok(line),
        (None, _) => Ok(None),
    }
}

struct Play<'c> {
    client: &'c Client,
    samples: Vec<Telemetry>,
    messages: u32,
    /// Tick in which the hand began.
    begun: u32,
    /// The scenario lets inputs fail.
    expected: bool,
    /// The first fault, with its tick.
    fault: Option<(u32, Fault)>,
}

impl Play<'_> {
    /// Takes the samples the board sent, whatever became of them, and faults it told of.
    fn overheard(&mut self, line: &FaultLine) -> Result<(), LabError> {
        self.samples.clear();
        for told in line.overheard() {
            match told {
                FromDevice::Telemetry(sample) => self.samples.push(sample),
                FromDevice::Fault { tick, fault } => self.faulted(tick, fault)?,
                _ => {}
            }
        }
        Ok(())
    }

    /// A fault is an error unless the scenario makes it.
    fn faulted(&mut self, tick: u32, fault: Fault) -> Result<(), LabError> {
        if !self.expected {
            let what = describe(fault);
            return Err(LabError::Fault { tick, what });
        }
        self.fault.get_or_insert((tick, fault));
        Ok(())
    }

    /// Scene on the board, parameters set, handle at the grip, part in hand.
    fn prepare(&mut self, scenario: &Scenario, scene: &PreparedScene) -> Result<(), LabError> {
        let client = self.client;
        // An earlier run may have left it stopped.
        if matches!(client.state(), DeviceState::Stopped | DeviceState::Fault(_)) {
            client.request(ToDevice::ClearFault)?;
        }
        client.upload(&scene.image, &mut |_| {})?;
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
    ) -> Result<Ran, LabError> {
        let client = self.client;
        client.statistics(true)?;
        let every_ticks = scenario.run.telemetry_every_ticks;
        client.request(ToDevice::SetTelemetry { every_ticks })?;
        client.request(ToDevice::SimulatedHand(script(&scenario.hand)))?;
        let faulty = scenario.faults.is_some();
        if let (Some(line), Some(faults)) = (line, &scenario.faults) {
            if self.expected {
                self.begun = client.run(0)?.tick;
                let inputs = faults.input_message().map_err(|what| LabError::Scenario {
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

    /// Sends a parameter each `every` ticks.
    fn loaded(&mut self, scenario: &Scenario, ticks: u32, every: u32) -> Result<Ran, LabError> {
        let client = self.client;
        // The limit goes to and fro well above the forces that occur, so that each message changes a setting and none the outcome.
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
        // All of them arrived when the last did: they are taken in order.
        let found = client.parameter(id)?;
        if found != value {
            return Err(LabError::Scenario {
                name: scenario.name.clone(),
                what: format!(
                    "ForceLimit is {found} after {} messages, the last said {value}",
                    self.messages
                ),
            });
        }
        Ok(ran)
    }

    /// Lets `every` ticks run at a time, answering the samples with what the listener makes of them.
    fn heeding(
        &mut self,
        listener: &mut Listener<'_>,
        ticks: u32,
        every: u32,
        faulty: bool,
    ) -> Result<Ran, LabError> {
        let mut left = ticks;
        loop {
            let batch = left.min(every);
            let heard = self.samples.len();
            let ran = self.run(batch)?;
            // The sample may come behind the answer to the run, but not behind this one: what is heard when must not depend on timing.
            self.client.run(0)?;
            self.listen()?;
            for sample in &self.samples[heard..] {
                for message in listener(sample) {
                    // An answer may be lost too: nobody waits for one then.
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

    /// Lets ticks run, in batches, and takes what the board says meanwhile.
    fn run(&mut self, ticks: u32) -> Result<Ran, LabError> {
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

    fn listen(&mut self) -> Result<(), LabError> {
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

fn wire_pose(position_mm: DVec3, orientation: DQuat) -> WirePose {
    WirePose {
        position: (1e-3 * position_mm).as_vec3().to_array(),
        orientation: orientation.as_quat().to_array(),
    }
}

fn with_keyframes(hand: &Hand, keyframes: impl Iterator<Item = Keyframe>) -> HandScript {
    HandScript {
        stiffness: hand.stiffness_n_per_m,
        damping: hand.damping_n_s_per_m,
        angular_stiffness: hand.angular_stiffness_n_m_per_rad,
        angular_damping: hand.angular_damping_n_m_s_per_rad,
        tremor: (1e-3 * hand.tremor_mm) as f32,
        tremor_hz: hand.tremor_hz,
        keyframes: keyframes.collect(),
    }
}

/// From where a simulated handle starts (the world's origin) to the grip, without tremor.
pub(super) fn reach(hand: &Hand) -> HandScript {
    let keyframe = |tick, position_mm| Keyframe {
        tick,
        pose: wire_pose(position_mm, DQuat::IDENTITY),
        push: [0.0; 3],
    };
    let way = [
        keyframe(0, DVec3::ZERO),
        keyframe(REACH_TICKS, DVec3::from_array(hand.grip_mm)),
    ];
    HandScript {
        tremor: 0.0,
        ..with_keyframes(hand, way.into_iter())
    }
}

pub(super) fn script(hand: &Hand) -> HandScript {
    let grip = DVec3::from_array(hand.grip_mm);
    let keyframe = |key: &Key| Keyframe {
        tick: (key.t_s * TICK_HZ).round() as u32,
        pose: wire_pose(
            grip + DVec3::from_array(key.offset_mm),
            DQuat::from_scaled_axis(DVec3::from_array(key.turn_deg.map(f64::to_radians))),
        ),
        push: key.push_n,
    };
    with_keyframes(hand, hand.keyframes.iter().map(keyframe))
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
        .and_then(|(depth, (_, pose))| measure::depth(scene, depth, &measure::pose_mm(pose)));
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
        penetration_mm: overlap::deepest(scene, samples),
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
        degraded_percent: {
            let mut incomplete = Flags::BUDGET;
            incomplete.insert(Flags::CONTACTS);
            let degraded = (samples.iter()).filter(|s| Flags::from_bits(s.flags).intersects(incomplete));
            100.0 * degraded.count() as f64 / samples.len().max(1) as f64
        },
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
