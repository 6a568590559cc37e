//! Sessions recorded and replayed: the same bits, the first other bit named, and nothing lost of a killed program but the last half second.

use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitCode, Stdio};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use libtest_mimic::{Arguments, Failed, Trial};
use mortise_protocol::message::{ToDevice, WirePose};
use mortise_protocol::parameter::ParameterId;
use mortise_record::{EntryKind, RecordError, Recorder, Recording, Replayed, Written, replay};
use mortise_rig::{Client, RigSpec};
use mortise_scenario::{PreparedScene, Scenario, run_on};

/// Names the file to record to in the program that is killed.
const VICTIM: &str = "MORTISE_RECORD_TO";
/// Programs killed, see [`killed`], and how many run at a time.
const KILLED: usize = 100;
const AT_A_TIME: usize = 5;
/// Largest loss, s.
const LOSS_S: f64 = 0.5;

fn main() -> ExitCode {
    // First, because STEP files are read in a child process that is this same program.
    mortise_brep::child::init();
    if let Ok(path) = std::env::var(VICTIM) {
        return match record_for_ever(Path::new(&path)) {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => {
                eprintln!("{error}");
                ExitCode::FAILURE
            }
        };
    }
    let trials = vec![
        Trial::test("a_minute_replays_to_the_bit_and_is_small", minute),
        Trial::test("another_parameter_differs_where_two_runs_do", other_parameter),
        Trial::test("a_session_in_real_time_replays_to_the_bit", real_time),
        Trial::test("a_killed_program_loses_half_a_second_at_most", killed),
        Trial::test("an_upload_makes_the_state_known", upload),
        Trial::test("what_is_no_recording_is_refused_in_words", refused),
    ];
    libtest_mimic::run(&Arguments::from_args(), trials).exit_code()
}

fn scenario(name: &str) -> Result<(Scenario, PreparedScene), Failed> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../hil-tests/scenarios");
    let scenario = Scenario::load(&folder.join(name).with_extension("toml"))?;
    let scene = PreparedScene::of(&scenario)?;
    Ok((scenario, scene))
}

/// Plays a scenario and records it, with a parameter message every so many ticks.
fn recorded(name: &str, parameter_every_ticks: Option<u32>, path: &Path) -> Result<Written, Failed> {
    let (mut scenario, scene) = scenario(name)?;
    scenario.run.parameter_every_ticks = parameter_every_ticks;
    let client = Client::connect(&RigSpec::Simulated { realtime: false })?;
    let recorder = Recorder::start(&client, path)?;
    recorder.scene(&scene.image);
    run_on(&client, &scenario, &scene)?;
    Ok(recorder.finish(Some(&client))?)
}

fn same_bits(replayed: &Replayed, at_least: u64) -> Result<(), Failed> {
    println!("    {replayed:?}");
    if replayed.difference.is_some() || !replayed.left_out.is_empty() || replayed.compared < at_least {
        return Err(format!("{replayed:?}").into());
    }
    Ok(())
}

/// A minute of motion and contact without a pause: 1 kHz inputs, 200 Hz telemetry.
fn minute() -> Result<(), Failed> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("minute.mcap");
    let written = recorded("load", None, &path)?;
    assert_eq!((written.lost_ticks, written.lost_messages), (0, 0), "{written:?}");
    let bytes = std::fs::metadata(&path)?.len();
    let recording = Recording::open(&path)?;
    assert!(recording.complete());
    let samples = (recording.entries())
        .filter(|entry| matches!(entry.kind, EntryKind::Telemetry(_)))
        .count();
    // 60 s at 200 Hz.
    assert!((11_990..=12_010).contains(&samples), "{samples} samples");
    let replayed = replay(&recording, &[])?;
    assert_eq!(replayed.recorded, written.ticks);
    same_bits(&replayed, 60_000)?;
    if let Ok(copy) = std::env::var("KEEP") {
        std::fs::copy(&path, copy)?;
    }
    let hour_mb = bytes as f64 / written.ticks as f64 * 3.6;
    println!(
        "    {bytes} bytes for {} ticks: {hour_mb:.0} MB an hour",
        written.ticks
    );
    assert!(hour_mb <= 150.0, "{hour_mb:.0} MB an hour");
    Ok(())
}

/// The first tick that differs is the first in which two boards with these parameters differ.
fn other_parameter() -> Result<(), Failed> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("run.mcap");
    recorded("press_wall_1n", Some(10), &path)?;
    let recording = Recording::open(&path)?;
    same_bits(&replay(&recording, &[])?, 500)?;
    let stiffness = (ParameterId::ContactStiffness, 1234.0);
    let changed = replay(&recording, &[stiffness])?;
    let difference = changed
        .difference
        .ok_or("contact of another stiffness gave the same bits")?;
    println!("    {difference:?}");
    // Contact stiffness changes nothing before something touches: the first telemetry with contact is at or after the tick.
    let touches = recording.entries().find_map(|entry| match entry.kind {
        EntryKind::Telemetry(sample) if sample.contact.force != [0.0; 3] => Some(sample.tick),
        _ => None,
    });
    let touches = touches.ok_or("nothing touched")?;
    assert!(
        (touches.saturating_sub(10)..=touches).contains(&difference.tick),
        "differs at {}, touches at {touches}",
        difference.tick
    );
    Ok(())
}

/// Messages that come at any time between ticks.
fn real_time() -> Result<(), Failed> {
    let (_, scene) = scenario("load")?;
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("session.mcap");
    let client = Client::connect(&RigSpec::Simulated { realtime: true })?;
    let recorder = Recorder::start(&client, &path)?;
    recorder.scene(&scene.image);
    client.upload(&scene.image, &mut |_| {})?;
    client.request(ToDevice::SetTelemetry { every_ticks: 5 })?;
    let mut random = fastrand::Rng::with_seed(7);
    for round in 0..6 {
        client.request(ToDevice::Arm)?;
        client.request(ToDevice::Grab { part: scene.part })?;
        for _ in 0..8 {
            pause(random.u64(1..60));
            let value = random.f32() * 200.0 + 300.0;
            let id = ParameterId::CouplingStiffness;
            client.request(ToDevice::SetParameter { id, value })?;
        }
        match round % 3 {
            0 => client.request(ToDevice::Release)?,
            1 => {
                client.stop()?;
                pause(30);
                client.request(ToDevice::ClearFault)?;
            }
            _ => {}
        }
        client.request(ToDevice::Disarm)?;
        pause(150);
        client.request(ToDevice::ResetScene)?;
        // The next round begins with the part elsewhere.
        let [x, y, z] = (1e-3 * scene.placement().translation).as_vec3().to_array();
        client.request(ToDevice::Place {
            part: scene.part,
            pose: WirePose {
                position: [x, y, z + 1e-3 * random.f32()],
                orientation: [0.0, 0.0, 0.0, 1.0],
            },
        })?;
    }
    let written = recorder.finish(Some(&client))?;
    let replayed = replay(&Recording::open(&path)?, &[])?;
    // A busy computer may lose ticks on the link; they are then left out, and said.
    assert_eq!(
        replayed.left_out.is_empty(),
        written.lost_ticks == 0,
        "{written:?}"
    );
    assert!(replayed.difference.is_none(), "{replayed:?}");
    assert!(replayed.compared > 1000, "{replayed:?}");
    Ok(())
}

/// What happens in a scene that the recording does not hold is left out; an upload of one that it holds begins the replay.
fn upload() -> Result<(), Failed> {
    let (scenario, scene) = scenario("press_wall_1n")?;
    let other = Scenario {
        scene: mortise_scenario::Scene {
            cell_mm: Some(1.0),
            ..scenario.scene.clone()
        },
        ..scenario.clone()
    };
    let other_scene = PreparedScene::of(&other)?;
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("two.mcap");
    let client = Client::connect(&RigSpec::Simulated { realtime: false })?;
    client.upload(&other_scene.image, &mut |_| {})?;
    let recorder = Recorder::start(&client, &path)?;
    recorder.scene(&scene.image);
    run_on(&client, &other, &other_scene)?;
    let unknown = client.run(0)?.tick;
    run_on(&client, &scenario, &scene)?;
    let last = client.run(0)?.tick;
    recorder.finish(Some(&client))?;
    let replayed = replay(&Recording::open(&path)?, &[])?;
    println!("    {replayed:?}");
    assert_eq!(replayed.difference, None);
    assert_eq!(replayed.compared, u64::from(last - unknown));
    assert!(replayed.compared < replayed.recorded);
    Ok(())
}

fn pause(ms: u64) {
    std::thread::sleep(Duration::from_millis(ms));
}

/// Records a simulated rig in real time until it is killed; writes the recorded time to its output.
fn record_for_ever(path: &Path) -> Result<(), RecordError> {
    let client = Client::connect(&RigSpec::Simulated { realtime: true })?;
    let _recorder = Recorder::start(&client, path)?;
    client.request(ToDevice::SetTelemetry { every_ticks: 5 })?;
    println!("recording");
    loop {
        pause(1000);
    }
}

/// A program that records, and when it began.
struct Victim {
    child: Child,
    path: PathBuf,
    began: SystemTime,
    killed_after: Duration,
}

impl Victim {
    fn start(folder: &Path, number: usize, random: &mut fastrand::Rng) -> Result<Self, Failed> {
        let path = folder.join(format!("{number}.mcap"));
        let mut child = Command::new(std::env::current_exe()?)
            .env(VICTIM, &path)
            .stdout(Stdio::piped())
            .spawn()?;
        let mut said = [0; 9];
        child.stdout.as_mut().ok_or("no output")?.read_exact(&mut said)?;
        Ok(Self {
            child,
            path,
            began: SystemTime::now(),
            killed_after: Duration::from_millis(random.u64(0..2000)),
        })
    }

    /// Kills it; what it has recorded ends at most [`LOSS_S`] earlier.
    fn kill(mut self) -> Result<f64, Failed> {
        std::thread::sleep(self.killed_after);
        let killed = SystemTime::now();
        self.child.kill()?;
        self.child.wait()?;
        let recording = Recording::open(&self.path)?;
        assert!(!recording.complete(), "it was killed");
        let last = recording.entries().last().map_or(0, |entry| entry.at_ns);
        // Killed before the first chunk, it loses what it recorded since it began.
        let last = (UNIX_EPOCH + Duration::from_nanos(last)).max(self.began);
        Ok(killed.duration_since(last).unwrap_or_default().as_secs_f64())
    }
}

fn killed() -> Result<(), Failed> {
    let folder = tempfile::tempdir()?;
    let mut random = fastrand::Rng::with_seed(11);
    let begun = Instant::now();
    let mut losses = Vec::new();
    for batch in 0..KILLED / AT_A_TIME {
        let mut victims = Vec::new();
        for number in 0..AT_A_TIME {
            victims.push(Victim::start(
                folder.path(),
                batch * AT_A_TIME + number,
                &mut random,
            )?);
        }
        // All wait at once: each is killed at its own time.
        let killed: Vec<_> = (victims.into_iter())
            .map(|victim| std::thread::spawn(move || victim.kill().map_err(|why| format!("{why:?}"))))
            .collect();
        for thread in killed {
            losses.push(thread.join().map_err(|_| "a thread failed")??);
        }
    }
    let worst = losses.iter().copied().fold(0.0, f64::max);
    println!(
        "    {KILLED} killed in {:.0} s: at most {worst:.2} s lost",
        begun.elapsed().as_secs_f64()
    );
    assert!(worst <= LOSS_S, "{losses:?}");
    Ok(())
}

fn refused() -> Result<(), Failed> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("none.mcap");
    let words = |path: &Path| Recording::open(path).err().map(|error| error.to_string());
    assert!(words(&path).is_some_and(|words| words.contains("could not be read")));
    for bytes in [
        &b""[..],
        b"solid",
        &[0x89, 0x4d, 0x43, 0x41, 0x50, 0x30, 0x0d, 0x0a],
    ] {
        std::fs::write(&path, bytes)?;
        assert!(
            words(&path).is_some_and(|words| words.contains("is not a recording")),
            "{bytes:?}"
        );
    }
    // A recording is never replaced.
    let client = Client::connect(&RigSpec::Simulated { realtime: false })?;
    let kept = std::fs::read(&path)?;
    assert!(Recorder::start(&client, &path).is_err());
    assert_eq!(std::fs::read(&path)?, kept);
    // Damage anywhere leads to an error or a shorter recording, never to a panic.
    let whole = folder.path().join("whole.mcap");
    recorded("press_flat_1n", None, &whole)?;
    let bytes = std::fs::read(&whole)?;
    let mut random = fastrand::Rng::with_seed(3);
    for _ in 0..200 {
        let mut damaged = bytes.clone();
        match random.u8(0..3) {
            0 => damaged.truncate(random.usize(0..bytes.len())),
            _ => {
                for _ in 0..random.usize(1..4) {
                    damaged[random.usize(0..bytes.len())] = random.u8(..);
                }
            }
        }
        std::fs::write(&path, &damaged)?;
        if let Ok(recording) = Recording::open(&path) {
            let entries = recording.entries().count();
            assert!(entries < 100_000);
        }
    }
    Ok(())
}
