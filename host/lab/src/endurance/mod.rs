//! Endurance: keeps a board busy for an hour of its own time and checks that nothing degrades.
//!
//! The hour consists of turns of `TURN_S`. Each turn uploads a new random scene (`scenes`), arms, grabs, and lets a random hand push the part about
//! while frames are lost, damaged, repeated, delayed and invented; parameters, constraint targets, releases, garbage and now and then a STOP come in
//! between. The board runs in lockstep and counts instructions, so its time does not depend on this computer's load.
//!
//! No reportable fault is provoked (stop input, encoders and drivers stay intact, and in lockstep the host is never silent), so every reported fault
//! is unexplained. Memory is measured after every turn: its use may not grow after `WARM` of the hour.

mod memory;
mod scenes;

use std::fmt;

use fastrand::Rng;
use mortise_protocol::message::{
    ConstraintKind, ConstraintTarget, DeviceState, Feature, FromDevice, HandScript, Keyframe, ToDevice,
    WirePose,
};
use mortise_protocol::parameter::ParameterId;
use mortise_rig::{Client, Event, FaultLine, Faults, RigSpec, Window, describe};
use mortise_scenario::ScenarioError;
use serde::Serialize;

use crate::LabError;
use crate::row::Row;
use scenes::Scenes;

/// Virtual time of a turn, s.
pub const TURN_S: u32 = 20;
/// Share of the time after which memory and stack may not grow any more.
pub const WARM: f64 = 0.25;
/// Ticks between two scripts for the hand.
const SCRIPT_TICKS: u32 = 5_000;
/// Ticks requested at once: bounds the telemetry that waits.
const BATCH_TICKS: u32 = 500;
/// Largest growth of a program's memory from one quarter to the next, KiB: scenes differ in size, and baking leaves pages with the allocator. A leak
/// of ten bytes a tick would be 9 MiB in a quarter of an hour.
const GROWTH_KIB: f64 = 8_192.0;
const TICKS_PER_S: u32 = 1_000;
/// Ticks in which the handle is moved to the part, and in which motors fade out.
const REACH_TICKS: u32 = 500;
const FADE_TICKS: u32 = 150;
/// Largest distance of the hand from its grip along each axis, m; with at least [`KEY_TICKS`] between keyframes it stays below 0.7 m/s, far below the
/// speed limit.
const ROOM_M: f32 = 0.05;
const KEY_TICKS: u32 = 250;
/// Latest tick of a script's last keyframe, which is at the position of its first one: whichever scripts the link loses or delays, the hand never
/// jumps.
const BACK_TICKS: u32 = 3_900;

/// State after a turn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Turn {
    /// Turns so far.
    pub turn: u32,
    /// Ticks the board has run.
    pub ticks: u32,
    /// Ticks missed since start.
    pub missed_ticks: u32,
    /// Faults reported since start.
    pub faults: u32,
    /// Bytes of the scene on the board.
    pub scene_bytes: usize,
    /// Deepest stack on the board since start, bytes.
    pub stack_bytes: u32,
    /// Memory of this program, KiB; 0 where the operating system does not report it.
    pub host_kib: u64,
    /// Memory of the emulator, KiB; 0 likewise.
    pub emulator_kib: u64,
}

impl fmt::Display for Turn {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "turn {}: {} ticks, {} missed, {} faults, scene {} B, stack {} B, memory {} KiB here, {} KiB emulator",
            self.turn,
            self.ticks,
            self.missed_ticks,
            self.faults,
            self.scene_bytes,
            self.stack_bytes,
            self.host_kib,
            self.emulator_kib
        )
    }
}

/// What an endurance run found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// Virtual time requested, s.
    pub seconds: u32,
    /// Rig.
    pub rig: String,
    /// Ticks run.
    pub ticks: u32,
    /// Ticks missed.
    pub missed_ticks: u32,
    /// Faults that the board reported, in words; none was provoked.
    pub faults: Vec<String>,
    /// Scenes uploaded.
    pub scenes: u32,
    /// Frames lost, damaged, repeated, reordered, delayed or invented on the link.
    pub harmed_frames: u64,
    /// Damaged frames that reached the board and were dropped there.
    pub bad_frames: u32,
    /// Cost of the worst-case tick, in the board's unit.
    pub cost_max: u32,
    /// Largest force commanded, N.
    pub peak_force: f32,
    /// RAM of the firmware's statics, bytes: all RAM that it uses beside the stack, as there is no heap. 0 where there is no firmware file.
    pub static_bytes: u64,
    /// Deepest stack after `WARM` of the time, bytes.
    pub stack_warm_bytes: u32,
    /// Deepest stack at the end.
    pub stack_bytes: u32,
    /// Largest memory of this program in the third and in the last quarter, KiB.
    pub host_kib: [u64; 2],
    /// The emulator's, likewise.
    pub emulator_kib: [u64; 2],
}

impl Report {
    /// The run's figures with their bounds.
    pub fn rows(&self) -> Vec<Row> {
        let run = format!(
            "endurance, {} s of virtual time on {}, {} random scenes ({} harmed frames)",
            self.seconds, self.rig, self.scenes, self.harmed_frames
        );
        for fault in &self.faults {
            eprintln!("{fault}");
        }
        let mut rows = vec![
            Row::within(
                format!("{run}: ticks"),
                f64::from(self.ticks),
                "ticks",
                f64::from(self.seconds) * f64::from(TICKS_PER_S),
                f64::INFINITY,
            ),
            Row::exactly(
                format!("{run}: missed ticks"),
                f64::from(self.missed_ticks),
                "ticks",
                0.0,
            ),
            Row::exactly(
                format!("{run}: unexplained faults"),
                self.faults.len() as f64,
                "faults",
                0.0,
            ),
        ];
        if self.stack_bytes > 0 {
            rows.push(Row::reported(
                format!("{run}: deepest stack"),
                f64::from(self.stack_bytes),
                "B",
            ));
            rows.push(Row::exactly(
                format!("{run}: growth of the deepest stack after the first quarter"),
                f64::from(self.stack_bytes) - f64::from(self.stack_warm_bytes),
                "B",
                0.0,
            ));
        }
        if self.static_bytes > 0 {
            rows.push(Row::reported(
                format!("{run}: the board's memory beside the stack, all of it static"),
                self.static_bytes as f64,
                "B",
            ));
        }
        for (whose, [before, last]) in [
            ("this program's", self.host_kib),
            ("the emulator's", self.emulator_kib),
        ] {
            if last > 0 {
                rows.push(Row::reported(format!("{run}: {whose} memory"), last as f64, "KiB").varies());
                let growth = Row::at_most(
                    format!("{run}: growth of {whose} memory from the third to the last quarter"),
                    last as f64 - before as f64,
                    "KiB",
                    GROWTH_KIB,
                );
                rows.push(growth.varies());
            }
        }
        rows
    }
}

/// Keeps the rig busy for `seconds` of its time; calls `reported` after each turn.
///
/// # Errors
/// `Brep`, `Bake`, `Rig`; `NeedsSimulatedHand` on a real mechanism. Faults of the board and missed ticks are no errors but figures.
pub fn run(
    spec: &RigSpec,
    seconds: u32,
    seed: u64,
    reported: &mut dyn FnMut(&Turn),
) -> Result<Report, LabError> {
    let client = Client::connect_with_faults(&spec.lockstep())?;
    if !client.capabilities().simulated {
        return Err(ScenarioError::NeedsSimulatedHand {
            rig: client.name().to_owned(),
            scenario: "endurance".into(),
        }
        .into());
    }
    let Some(line) = client.fault_line() else {
        return Err(LabError::Input {
            name: client.name().to_owned(),
            what: "its link has no faults to switch on".into(),
        });
    };
    let mut work = Work {
        client: &client,
        line,
        random: Rng::with_seed(seed),
        faults: Vec::new(),
    };
    let mut scenes = Scenes::load()?;
    let mut turns: Vec<Turn> = Vec::new();
    let count = seconds.div_ceil(TURN_S).max(1);
    for number in 1..=count {
        let ticks = TICKS_PER_S * TURN_S.min(seconds - TURN_S * (number - 1)).max(1);
        let scene = scenes.make(&mut work.random)?;
        work.take_up(&scene)?;
        work.endure(ticks, &scene)?;
        work.put_down()?;
        let statistics = client.statistics(false)?;
        let memory = memory::now();
        let turn = Turn {
            turn: number,
            ticks: statistics.ticks,
            missed_ticks: statistics.missed_ticks,
            faults: work.faults.len() as u32,
            scene_bytes: scene.image.len(),
            stack_bytes: statistics.stack_max,
            host_kib: memory.program_kib,
            emulator_kib: memory.emulator_kib,
        };
        reported(&turn);
        turns.push(turn);
    }
    let statistics = client.statistics(false)?;
    let counts = line.counts();
    let last = turns.last().copied().unwrap_or_default();
    // At least the first turn counts as warming up.
    let warm = turns[((WARM * turns.len() as f64) as usize).min(turns.len() - 1)];
    let largest = |part: usize, of: fn(&Turn) -> u64| {
        let quarter = turns.len().div_ceil(4).max(1);
        let quarters: Vec<&[Turn]> = turns.chunks(quarter).collect();
        let place = (quarters.len() + part).saturating_sub(2).min(quarters.len() - 1);
        quarters[place].iter().map(of).max().unwrap_or(0)
    };
    Ok(Report {
        seconds,
        rig: client.name().to_owned(),
        ticks: statistics.ticks,
        missed_ticks: statistics.missed_ticks,
        faults: work.faults,
        scenes: count,
        harmed_frames: counts.lost
            + counts.corrupted
            + counts.repeated
            + counts.reordered
            + counts.late
            + counts.flooded,
        bad_frames: statistics.bad_frames,
        cost_max: statistics.cost_max,
        peak_force: statistics.peak_force,
        static_bytes: memory::statics(spec),
        stack_warm_bytes: warm.stack_bytes,
        stack_bytes: last.stack_bytes,
        host_kib: [largest(0, |turn| turn.host_kib), largest(1, |turn| turn.host_kib)],
        emulator_kib: [
            largest(0, |turn| turn.emulator_kib),
            largest(1, |turn| turn.emulator_kib),
        ],
    })
}

struct Work<'c> {
    client: &'c Client,
    line: &'c FaultLine,
    random: Rng,
    faults: Vec<String>,
}

impl Work<'_> {
    /// Uploads the scene, moves the handle to the part and grabs it; the link is fault-free meanwhile.
    fn take_up(&mut self, scene: &scenes::Scene) -> Result<(), LabError> {
        let client = self.client;
        // The board's reports of its state may have been lost on the link.
        let state = client.refresh_capabilities()?.state;
        if matches!(state, DeviceState::Stopped | DeviceState::Fault(_)) {
            client.request(ToDevice::ClearFault)?;
        }
        client.upload(&scene.image, &mut |_| {})?;
        client.request(ToDevice::ResetScene)?;
        let mut reach = self.script(scene.grip);
        let pose = |position| WirePose {
            position,
            orientation: [0.0, 0.0, 0.0, 1.0],
        };
        let key = |tick, position| Keyframe {
            tick,
            pose: pose(position),
            push: [0.0; 3],
        };
        reach.keyframes.clear();
        // The list holds twelve keyframes.
        let _ = reach.keyframes.push(key(0, [0.0; 3]));
        let _ = reach.keyframes.push(key(REACH_TICKS - 200, scene.grip));
        client.request(ToDevice::SimulatedHand(reach))?;
        self.run(REACH_TICKS)?;
        client.request(ToDevice::Arm)?;
        client.request(ToDevice::Grab { part: scene.part })?;
        client.request(ToDevice::SetTelemetry { every_ticks: 20 })?;
        Ok(())
    }

    /// Lets the hand work on a faulty link.
    fn endure(&mut self, ticks: u32, scene: &scenes::Scene) -> Result<(), LabError> {
        let faults = self.faults(u64::from(ticks));
        self.line.begin(&faults);
        let mut left = ticks;
        let mut script_left = 0;
        while left > 0 {
            if script_left == 0 {
                let script = self.script(scene.grip);
                // Sent without waiting for an answer, which may be lost.
                self.client.send(ToDevice::SimulatedHand(script))?;
                script_left = SCRIPT_TICKS;
            }
            let batch = left.min(script_left).min(BATCH_TICKS);
            self.meddle(scene.part)?;
            self.run(batch)?;
            left -= batch;
            script_left -= batch;
        }
        for reported in self.line.overheard() {
            if let FromDevice::Fault { tick, fault } = reported {
                self.faults.push(format!("tick {tick}: {}", describe(fault)));
            }
        }
        self.line.end();
        // Frames that the link delayed arrive before the answer to this.
        self.client.run(0)?;
        // Already seen on the line; the events repeat them.
        self.client.events().try_iter().for_each(drop);
        Ok(())
    }

    /// Releases the part and comes to rest; the link is fault-free again.
    fn put_down(&mut self) -> Result<(), LabError> {
        self.client.request(ToDevice::SetTelemetry { every_ticks: 0 })?;
        self.client.request(ToDevice::Disarm)?;
        self.run(FADE_TICKS)?;
        for event in self.client.events().try_iter() {
            if let Event::Fault { tick, fault } = event {
                self.faults.push(format!("tick {tick}: {}", describe(fault)));
            }
        }
        Ok(())
    }

    fn run(&mut self, ticks: u32) -> Result<(), LabError> {
        let mut left = ticks;
        while left > 0 {
            let batch = left.min(BATCH_TICKS);
            self.client.run(batch)?;
            left -= batch;
            // Events are only drained here: faults are read from the line, where no frame is lost.
            self.client.events().try_iter().for_each(drop);
        }
        Ok(())
    }

    /// Sends the messages of a busy host, beside the hand's.
    fn meddle(&mut self, part: u16) -> Result<(), LabError> {
        let random = &mut self.random;
        let message = match random.u8(0..40) {
            0 => ToDevice::Release,
            1..=3 => ToDevice::Grab { part },
            4..=9 => {
                let id = match random.u8(0..4) {
                    0 => ParameterId::CouplingStiffness,
                    1 => ParameterId::ContactStiffness,
                    2 => ParameterId::PointBudget,
                    _ => ParameterId::ForceLimit,
                };
                let row = id.row();
                let value = row.default * (0.5 + random.f32());
                ToDevice::SetParameter {
                    id,
                    value: value.clamp(row.min, row.max),
                }
            }
            10..=14 => ToDevice::SetTarget(target(random)),
            15 => ToDevice::ClearTarget { id: random.u16(0..4) },
            16..=17 => {
                let garbage: Vec<u8> = (0..random.usize(1..200)).map(|_| random.u8(..)).collect();
                return Ok(self.client.send_garbage(&garbage)?);
            }
            18 if random.u8(0..10) == 0 => ToDevice::Stop,
            19 => ToDevice::ClearFault,
            20 => ToDevice::Arm,
            _ => return Ok(()),
        };
        self.client.send(message)?;
        Ok(())
    }

    /// A hand of random stiffness that wanders about its grip, turns, pushes, trembles, and returns there.
    fn script(&mut self, grip: [f32; 3]) -> HandScript {
        let random = &mut self.random;
        let mut keyframes = heapless::Vec::new();
        let at_grip = |tick| Keyframe {
            tick,
            pose: WirePose {
                position: grip,
                orientation: [0.0, 0.0, 0.0, 1.0],
            },
            push: [0.0; 3],
        };
        // The first keyframe fits, and one place is kept for the last.
        let _ = keyframes.push(at_grip(0));
        let mut tick = KEY_TICKS;
        while keyframes.len() + 1 < keyframes.capacity() && tick < BACK_TICKS - KEY_TICKS {
            let mut signed = || 2.0 * random.f32() - 1.0;
            let place = grip.map(|x| x + ROOM_M * signed());
            let axis = glam::Vec3::new(signed(), signed(), signed());
            let push = [signed(), signed(), signed()].map(|x| 4.0 * x);
            let turn = glam::Quat::from_scaled_axis(0.5 * axis);
            let keyframe = Keyframe {
                tick,
                pose: WirePose {
                    position: place,
                    orientation: turn.to_array(),
                },
                push: if random.bool() { push } else { [0.0; 3] },
            };
            let _ = keyframes.push(keyframe);
            tick += random.u32(KEY_TICKS..3 * KEY_TICKS);
        }
        let _ = keyframes.push(at_grip(tick.clamp(KEY_TICKS, BACK_TICKS)));
        let stiffness = 200.0 + 1800.0 * random.f32();
        HandScript {
            stiffness,
            damping: 0.01 * stiffness,
            angular_stiffness: 1.0 + 3.0 * random.f32(),
            angular_damping: 0.02,
            tremor: 2e-4 * random.f32(),
            tremor_hz: 6.0 + 6.0 * random.f32(),
            keyframes,
        }
    }

    /// A link with a moderate rate of every fault.
    fn faults(&mut self, ticks: u64) -> Faults {
        let random = &mut self.random;
        let mut window = |longest: u64| Window {
            at_ms: random.u64(0..ticks),
            for_ms: random.u64(1..longest),
        };
        let (stall, disconnect) = (vec![window(800)], vec![window(800)]);
        let share = |random: &mut Rng| 0.1 * random.f64();
        Faults {
            seed: random.u64(..),
            drop: share(random),
            corrupt: share(random),
            repeat: share(random),
            reorder: share(random),
            delay_ms: [0, random.u32(0..40)],
            stall,
            disconnect,
            flood_per_s: random.u32(0..100),
            inputs: Vec::new(),
        }
    }
}

/// A random target, valid or not; the board accepts valid ones and refuses the rest.
fn target(random: &mut Rng) -> ConstraintTarget {
    let mut signed = || 2.0 * random.f32() - 1.0;
    let direction = glam::Vec3::new(signed(), signed(), signed()).normalize_or(glam::Vec3::Z);
    let feature = Feature {
        point: [signed(), signed(), signed()].map(|x| 0.02 * x),
        direction: direction.to_array(),
    };
    let fixed = Feature {
        point: [signed(), signed(), signed()].map(|x| 0.02 * x),
        direction: [0.0, 0.0, 1.0],
    };
    ConstraintTarget {
        id: random.u16(0..4),
        sequence: random.u16(..),
        kind: match random.u8(0..3) {
            0 => ConstraintKind::Concentric,
            1 => ConstraintKind::Coplanar,
            _ => ConstraintKind::Spherical,
        },
        moving: feature,
        static_part: random.u16(0..3),
        fixed,
        stiffness: 1e4 * random.f32(),
        force_cap: 3.0 * random.f32(),
        torque_cap: 0.05 * random.f32(),
        expiry_ticks: random.u16(50..2_000),
        path: None,
        faces: heapless::Vec::new(),
    }
}
