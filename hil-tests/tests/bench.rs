//! Runs every scenario and every check on every rig: always on the simulation and the emulated board, and on a real one when `MORTISE_PORT` or
//! `--port NAME` names it.
//!
//! A missing emulator or firmware, or a port that cannot be opened, is a failure: a bench without rigs must not appear to pass.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::{Arc, Mutex, PoisonError};

use libtest_mimic::{Arguments, Completion, Failed, Trial};
use mortise_hil_tests::checks::{CHECKS, Check};
use mortise_hil_tests::{PORT_VARIABLE, scenarios};
use mortise_record::{RecordError, Recorder, Recording, Replayed, replay};
use mortise_rig::{Client, RigSpec, SERIAL_VARIABLE};
use mortise_scenario::ScenarioError;
use mortise_scenario::{Outcome, PreparedScene, Scenario, connect, run_on};

fn main() -> ExitCode {
    // First, because STEP files are read in a child process that is this same program.
    mortise_brep::child::init();
    let mut arguments: Vec<String> = std::env::args().collect();
    let port = match take_port(&mut arguments) {
        Ok(port) => port,
        Err(what) => {
            eprintln!("{what}");
            return ExitCode::from(2);
        }
    };
    match trials(port) {
        Ok(trials) => libtest_mimic::run(&Arguments::from_iter(arguments), trials).exit_code(),
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

/// Removes `--port NAME` or `--port=NAME` from the arguments; without it, the environment's port.
fn take_port(arguments: &mut Vec<String>) -> Result<Option<String>, String> {
    let flag = arguments
        .iter()
        .position(|a| a == "--port" || a.starts_with("--port="));
    let named = match flag {
        None => return Ok(std::env::var(PORT_VARIABLE).ok().filter(|port| !port.is_empty())),
        Some(at) => {
            let flag = arguments.remove(at);
            match flag.strip_prefix("--port=") {
                Some(name) => name.to_owned(),
                None if at < arguments.len() => arguments.remove(at),
                None => String::new(),
            }
        }
    };
    if named.is_empty() {
        return Err("--port needs the name of a serial port".into());
    }
    Ok(Some(named))
}

fn rig(text: &str) -> Result<RigSpec, String> {
    text.parse().map_err(|error| format!("{text}: {error}"))
}

fn trials(port: Option<String>) -> Result<Vec<Trial>, String> {
    let bench = Arc::new(Bench::new().map_err(|error| error.to_string())?);
    let (sim, emulated) = (rig("sim-fast")?, rig("emulated:lockstep")?);
    let mut rigs = vec![("sim", sim.clone()), ("emulated", emulated.clone())];
    if let Some(port) = port {
        rigs.push(("port", RigSpec::Serial { port }));
    }
    // Comparisons come last: one that waits for a run keeps a core from the next run.
    let (mut trials, mut compared) = (Vec::new(), Vec::new());
    for file in scenarios().map_err(|error| error.to_string())? {
        let name = file
            .file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        for (rig_name, spec) in &rigs {
            let (bench, file, spec) = (bench.clone(), file.clone(), spec.clone());
            trials.push(Trial::ignorable_test(format!("{rig_name}::{name}"), move || {
                bench.scenario(&file, &spec)
            }));
        }
        let (bench, sim, emulated) = (bench.clone(), sim.clone(), emulated.clone());
        compared.push(Trial::test(format!("sim_equals_emulated::{name}"), move || {
            bench.equal(&file, &sim, &emulated)
        }));
    }
    for (rig_name, spec) in &rigs {
        for &check in CHECKS {
            let spec = spec.clone();
            trials.push(Trial::test(format!("{rig_name}::{}", check.0), move || {
                run_check(check, &spec)
            }));
        }
    }
    trials.push(Trial::test("emulated_over_tcp::idle_ticks_are_on_time", over_tcp));
    trials.append(&mut compared);
    Ok(trials)
}

/// QEMU over TCP instead, in a separate process because an environment variable selects it.
fn over_tcp() -> Result<(), Failed> {
    let output = std::process::Command::new(std::env::current_exe()?)
        .args(["--exact", "emulated::idle_ticks_are_on_time"])
        .env(SERIAL_VARIABLE, "tcp")
        .output()?;
    let said = String::from_utf8_lossy(&output.stdout);
    if output.status.success() && said.contains("1 passed") {
        Ok(())
    } else {
        Err(said.into_owned().into())
    }
}

fn run_check((name, check): Check, spec: &RigSpec) -> Result<(), Failed> {
    let client = Client::connect(spec)?;
    let seen = check(client)?;
    println!("    {spec} {name}: {seen}");
    Ok(())
}

/// Cache of values: the first caller computes a value and the others wait for it. A failure is not kept.
struct Once<K, V>(Mutex<HashMap<K, Slot<V>>>);

type Slot<V> = Arc<Mutex<Option<V>>>;

impl<K, V> Default for Once<K, V> {
    fn default() -> Self {
        Self(Mutex::default())
    }
}

impl<K: std::hash::Hash + Eq, V: Clone> Once<K, V> {
    fn get<E>(&self, key: K, make: impl FnOnce() -> Result<V, E>) -> Result<V, E> {
        let slot = {
            let mut map = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            map.entry(key).or_default().clone()
        };
        let mut slot = slot.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(value) = &*slot {
            return Ok(value.clone());
        }
        let value = make()?;
        *slot = Some(value.clone());
        Ok(value)
    }
}

/// Baked scenes and measured outcomes, so that comparing two rigs does not measure them again.
struct Bench {
    scenes: Once<String, Arc<PreparedScene>>,
    outcomes: Once<(PathBuf, RigSpec), Outcome>,
    recordings: Recordings,
}

/// Folder of the recordings of all measured runs, removed at the end.
struct Recordings(tempfile::TempDir);

impl Recordings {
    fn path(&self, scenario: &Scenario, spec: &RigSpec) -> PathBuf {
        let rig: String = (spec.to_string().chars())
            .map(|c| if c.is_ascii_alphanumeric() { c } else { '_' })
            .collect();
        self.0.path().join(format!("{rig}-{}.mcap", scenario.name))
    }
}

impl Bench {
    fn new() -> std::io::Result<Self> {
        Ok(Self {
            scenes: Once::default(),
            outcomes: Once::default(),
            recordings: Recordings(tempfile::tempdir()?),
        })
    }
}

impl Bench {
    fn scene(&self, scenario: &Scenario) -> Result<Arc<PreparedScene>, ScenarioError> {
        let key = format!("{:?}", scenario.scene);
        self.scenes.get(key, || PreparedScene::of(scenario).map(Arc::new))
    }

    /// Plays a scenario, and records it to `recording`.
    fn measure(
        &self,
        scenario: &Scenario,
        spec: &RigSpec,
        recording: Option<&Path>,
    ) -> Result<Outcome, ScenarioError> {
        let scene = self.scene(scenario)?;
        let client = connect(scenario, spec)?;
        let failed = |error: RecordError| ScenarioError::Scenario {
            name: scenario.name.clone(),
            what: error.to_string(),
        };
        let start = |path| Recorder::start(&client, path).map_err(failed);
        let recorder = recording.map(start).transpose()?;
        let outcome = run_on(&client, scenario, &scene)?;
        if let Some(recorder) = recorder {
            recorder.scene(&scene.image);
            recorder.finish(Some(&client)).map_err(failed)?;
        }
        Ok(outcome)
    }

    fn outcome(&self, file: &Path, scenario: &Scenario, spec: &RigSpec) -> Result<Outcome, ScenarioError> {
        let key = (file.to_owned(), spec.clone());
        let recording = self.recordings.path(scenario, spec);
        self.outcomes
            .get(key, || self.measure(scenario, spec, Some(&recording)))
    }

    /// The recording of the run computes again to the same bits.
    fn replayed(&self, scenario: &Scenario, spec: &RigSpec) -> Result<Replayed, Failed> {
        let recording = Recording::open(&self.recordings.path(scenario, spec))?;
        let replayed = replay(&recording, &[])?;
        // A line with faults loses inputs too; every other tick is compared.
        let whole = scenario.faults.is_some() || replayed.compared == replayed.recorded;
        if replayed.difference.is_none() && whole && replayed.compared > 0 {
            Ok(replayed)
        } else {
            Err(format!("the recording replays differently: {replayed:?}").into())
        }
    }

    fn scenario(&self, file: &Path, spec: &RigSpec) -> Result<Completion, Failed> {
        let scenario = Scenario::load(file)?;
        let outcome = match self.outcome(file, &scenario, spec) {
            Err(error @ ScenarioError::NeedsSimulatedHand { .. }) => {
                return Ok(Completion::ignored_with(error.to_string()));
            }
            outcome => outcome?,
        };
        let replayed = self.replayed(&scenario, spec)?;
        println!(
            "    {}: {} ticks replay to the bit",
            scenario.name, replayed.compared
        );
        let verdicts = outcome.verdicts(&scenario.holds);
        let lines: Vec<String> = verdicts.iter().map(|verdict| format!("    {verdict}")).collect();
        let text = format!(
            "{} on {spec}, hash {}:\n{}\n    made, every {} ticks seen: at the handle {:.4} of {:.3} mJ, at the object by contacts {:.4} mJ, with targets {:.4} mJ",
            scenario.name,
            outcome.state_hash,
            lines.join("\n"),
            scenario.run.telemetry_every_ticks,
            outcome.energy_given_mj,
            outcome.energy_passed_mj,
            outcome.contact_given_mj,
            outcome.constraint_given_mj,
        );
        if verdicts.iter().all(|verdict| verdict.holds) {
            println!("{text}");
            Ok(Completion::Completed)
        } else {
            Err(format!("{text}\n{outcome:#?}").into())
        }
    }

    /// The board computes the same bits as this computer, and the same again in a second run.
    fn equal(&self, file: &Path, sim: &RigSpec, emulated: &RigSpec) -> Result<(), Failed> {
        let scenario = Scenario::load(file)?;
        let here = self.outcome(file, &scenario, sim)?.state_hash;
        let again = self.measure(&scenario, sim, None)?.state_hash;
        let there = self.outcome(file, &scenario, emulated)?.state_hash;
        println!(
            "{}: sim {here}, sim again {again}, emulated {there}",
            scenario.name
        );
        if here == again && here == there {
            Ok(())
        } else {
            Err(format!("hashes differ: sim {here}, sim again {again}, emulated {there}").into())
        }
    }
}
