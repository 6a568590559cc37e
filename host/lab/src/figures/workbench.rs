//! Recordings: their size and cost, whether they compute again to the bit, and whether the first tick that another constant changes is named.

use std::path::{Path, PathBuf};

use mortise_protocol::parameter::ParameterId;
use mortise_record::{EntryKind, RecordError, Recorder, Recording, Replayed, Written, replay};
use mortise_rig::{EmulatedMode, RigSpec};
use mortise_scenario::{PreparedScene, Scenario, connect, run_on};

use super::{Plan, Row};
use crate::LabError;

/// Recordings replayed from each rig, in the full and in the shorter form.
const RUNS: usize = 25;
const RUNS_QUICK: usize = 3;
/// Recordings replayed with another constant.
const CHANGED: usize = 10;
const CHANGED_QUICK: usize = 3;
/// Largest size of an hour, MB, and largest share of a processor.
const HOUR_MB: f64 = 150.0;
const SHARE: f64 = 3.0;
/// Parameter that is changed: it has no effect before a part touches another.
const CONSTANT: ParameterId = ParameterId::ContactStiffness;

/// Measures every row.
pub(super) fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let folder = tempfile::tempdir().map_err(|source| LabError::Unwritable {
        path: std::env::temp_dir(),
        source,
    })?;
    let mut sessions = Sessions {
        folder: folder.path().to_owned(),
        number: 0,
    };
    let mut scenario = Scenario::insertion(plan.pair)?;
    let scene = PreparedScene::of(&scenario)?;
    size(&mut sessions, &scenario, &scene, out)?;
    let runs = if plan.quick { RUNS_QUICK } else { RUNS };
    let rigs = [
        ("sim", RigSpec::Simulated { realtime: false }),
        (
            "emulated",
            RigSpec::Emulated {
                mode: EmulatedMode::Lockstep,
                firmware: None,
            },
        ),
    ];
    let mut random = fastrand::Rng::with_seed(20);
    for (name, spec) in rigs {
        let (mut same, mut ticks) = (0, 0);
        for _ in 0..runs {
            wander(&mut scenario, &mut random);
            let replayed = sessions.replayed(&scenario, &scene, &spec)?;
            ticks += replayed.compared;
            let whole = replayed.compared == replayed.recorded && replayed.left_out.is_empty();
            same += usize::from(whole && replayed.difference.is_none());
        }
        out(Row::exactly(
            format!("{runs} recordings of random motions, {name}: replayed to the same bits"),
            same as f64,
            "recordings",
            runs as f64,
        ));
        out(Row::reported(
            format!("{runs} recordings of random motions, {name}: ticks compared"),
            ticks as f64,
            "ticks",
        ));
    }
    let changed = if plan.quick { CHANGED_QUICK } else { CHANGED };
    let mut named = 0;
    for _ in 0..changed {
        wander(&mut scenario, &mut random);
        named += usize::from(sessions.first_named(&scenario, &scene)?);
    }
    out(Row::exactly(
        format!(
            "{changed} recordings replayed with another contact stiffness: first tick named, as two boards differ"
        ),
        named as f64,
        "recordings",
        changed as f64,
    ));
    Ok(())
}

/// Size and cost of a minute of motion and contact.
fn size(
    sessions: &mut Sessions,
    scenario: &Scenario,
    scene: &PreparedScene,
    out: &mut dyn FnMut(Row),
) -> Result<(), LabError> {
    let mut scenario = scenario.clone();
    scenario.run.telemetry_every_ticks = 5;
    scenario.run.duration_s = 60.0;
    scenario.hand.tremor_mm = 0.05;
    scenario.hand.tremor_hz = 10.0;
    // In, around the wall of the hole, half out and in again, without a rest.
    let path = [
        [0.0, 0.0, 0.0],
        [0.0, 0.0, -60.0],
        [3.0, 0.0, -60.0],
        [-3.0, 1.0, -60.0],
        [0.0, 3.0, -40.0],
        [0.0, -3.0, -60.0],
    ];
    for (at, key) in scenario.hand.keyframes.iter_mut().enumerate() {
        let last = path.len() - 1;
        key.offset_mm = path[at.min(last)];
        key.t_s = 60.0 * at as f64 / last as f64;
    }
    let (path, written, busy_s) =
        sessions.record(&scenario, scene, &RigSpec::Simulated { realtime: false })?;
    let bytes = std::fs::metadata(&path).map_or(0, |file| file.len()) as f64;
    let seconds = written.ticks as f64 * 1e-3;
    let what = "a minute of motion and contact, inputs at 1 kHz, telemetry at 200 Hz";
    out(Row::at_most(
        format!("{what}: size of an hour"),
        bytes / seconds * 3600.0 * 1e-6,
        "MB",
        HOUR_MB,
    ));
    out(Row::at_most(
        format!("{what}: time of the recording's thread"),
        100.0 * busy_s / seconds,
        "% of a core",
        SHARE,
    )
    .varies());
    let lost = written.lost_ticks + written.lost_messages;
    out(Row::exactly(
        format!("{what}: ticks and messages lost"),
        lost as f64,
        "",
        0.0,
    ));
    Ok(())
}

/// Another motion of the hand, about the hole, and other settings.
fn wander(scenario: &mut Scenario, random: &mut fastrand::Rng) {
    let mut between = |least: f64, most: f64| least + (most - least) * random.f64();
    for key in scenario.hand.keyframes.iter_mut().skip(1) {
        key.offset_mm = [between(-3.0, 3.0), between(-3.0, 3.0), between(-62.0, -10.0)];
    }
    scenario.hand.tremor_mm = between(0.0, 0.3);
    scenario.hand.tremor_hz = between(4.0, 12.0) as f32;
    scenario.run.guidance = random.bool();
    // Messages between ticks.
    scenario.run.parameter_every_ticks = random.bool().then_some(10);
}

/// Recorded sessions, each in its file.
struct Sessions {
    folder: PathBuf,
    number: usize,
}

impl Sessions {
    /// Plays and records; the third value is the time that the recording's thread was busy, s.
    fn record(
        &mut self,
        scenario: &Scenario,
        scene: &PreparedScene,
        spec: &RigSpec,
    ) -> Result<(PathBuf, Written, f64), LabError> {
        self.number += 1;
        let path = self.folder.join(format!("{}.mcap", self.number));
        let client = connect(scenario, spec)?;
        let recorder = Recorder::start(&client, &path).map_err(failed)?;
        recorder.scene(&scene.image);
        run_on(&client, scenario, scene)?;
        let busy_s = busy_s();
        let written = recorder.finish(Some(&client)).map_err(failed)?;
        Ok((path, written, busy_s))
    }

    fn replayed(
        &mut self,
        scenario: &Scenario,
        scene: &PreparedScene,
        spec: &RigSpec,
    ) -> Result<Replayed, LabError> {
        let (path, ..) = self.record(scenario, scene, spec)?;
        let recording = Recording::open(&path).map_err(failed)?;
        replay(&recording, &[]).map_err(failed)
    }

    /// Whether a replay with another constant names the tick in which two boards that differ in it differ first.
    fn first_named(&mut self, scenario: &Scenario, scene: &PreparedScene) -> Result<bool, LabError> {
        let spec = RigSpec::Simulated { realtime: false };
        let (path, ..) = self.record(scenario, scene, &spec)?;
        let other = 1.5e5;
        let mut changed = scenario.clone();
        changed.parameters.insert(format!("{CONSTANT:?}"), other);
        let (other_path, ..) = self.record(&changed, scene, &spec)?;
        let recording = Recording::open(&path).map_err(failed)?;
        let first = hashes(&recording);
        let second = hashes(&Recording::open(&other_path).map_err(failed)?);
        let differ = first.iter().zip(&second).position(|(a, b)| a.1 != b.1);
        let replayed = replay(&recording, &[(CONSTANT, other)]).map_err(failed)?;
        let named = replayed.difference.map(|difference| difference.tick);
        Ok(named == differ.map(|at| first[at].0))
    }
}

/// Number and hash of every tick.
fn hashes(recording: &Recording) -> Vec<(u32, u32)> {
    let mut all = Vec::new();
    for entry in recording.entries() {
        if let EntryKind::Inputs(ticks) = entry.kind {
            let numbered = ticks.inputs.iter().zip(ticks.first_tick..);
            all.extend(numbered.map(|(input, tick)| (tick, input.hash)));
        }
    }
    all
}

/// Processor time of the recording's thread, s; 0 where the system does not say.
fn busy_s() -> f64 {
    /// Ticks of the system's clock in a second, as Linux counts them for programs.
    const CLOCK_HZ: f64 = 100.0;
    let Ok(threads) = std::fs::read_dir("/proc/self/task") else {
        return 0.0;
    };
    let of = |thread: &Path| {
        let name = std::fs::read_to_string(thread.join("comm")).ok()?;
        (name.trim() == "mortise-record").then_some(())?;
        let stat = std::fs::read_to_string(thread.join("stat")).ok()?;
        // Behind the name, which is in brackets: state is the first, times in user and system mode are the 12th and 13th.
        let mut fields = stat.rsplit_once(')')?.1.split_whitespace().skip(11);
        let mut clock = || fields.next()?.parse::<f64>().ok();
        Some((clock()? + clock()?) / CLOCK_HZ)
    };
    (threads.flatten()).filter_map(|thread| of(&thread.path())).sum()
}

fn failed(error: RecordError) -> LabError {
    match error {
        RecordError::Rig(error) => error.into(),
        error => LabError::Input {
            name: "recording".into(),
            what: error.to_string(),
        },
    }
}
