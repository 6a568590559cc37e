//! A scene, an operator model, and a guide that responds to telemetry: the setup of most rows.

use std::io::Write as _;
use std::path::Path;

use glam::DVec3;
use mortise_guide::{Guide, GuideSettings};
use mortise_protocol::message::{ConstraintTarget, Telemetry, ToDevice};
use mortise_rig::{EmulatedMode, RigSpec};
use mortise_scenario::measure::depth;
use mortise_scenario::wire::pose_mm;
use mortise_scenario::{Depth, Key, PreparedScene, Recording, Scenario, connect, record};
use tempfile::{Builder, NamedTempFile};

use crate::LabError;
use crate::exact_fit::ExactFit;
use crate::fit::Fit;

const GUIDED: &str = include_str!("../../../hil-tests/scenarios/guided_fit.toml");

/// The in-process rig.
pub(crate) const SIM: RigSpec = RigSpec::Simulated { realtime: false };

/// The emulated board.
pub(crate) fn emulated() -> RigSpec {
    RigSpec::Emulated {
        mode: EmulatedMode::Lockstep,
        firmware: None,
    }
}

/// `text` as a STEP file, removed when dropped: the CAD kernel reads files only.
pub(crate) fn file(text: &str) -> Result<NamedTempFile, LabError> {
    let write = || {
        let mut file = Builder::new().prefix("mortise-").suffix(".step").tempfile()?;
        file.write_all(text.as_bytes())?;
        Ok(file)
    };
    write().map_err(|source| LabError::Unwritable {
        path: std::env::temp_dir(),
        source,
    })
}

/// One keyframe of the hand.
pub(crate) fn key(t_s: f64, offset_mm: [f64; 3], turn_deg: [f64; 3]) -> Key {
    Key {
        t_s,
        offset_mm,
        turn_deg,
        push_n: [0.0; 3],
    }
}

/// The guided insertion, 1 mm and 2° off with a tremor of 0.2 mm at 10 Hz, its scene not yet set.
pub(crate) fn script(step: &Path) -> Result<Scenario, LabError> {
    let mut scenario = Scenario::parse(GUIDED, "guided-fit")?;
    scenario.scene.step = step.to_owned();
    Ok(scenario)
}

/// The guided insertion of `fit`, from 20 mm above to 2 mm beyond through.
pub(crate) fn insertion(fit: &Fit, step: &Path) -> Result<Scenario, LabError> {
    let mut scenario = script(step)?;
    scenario.hand.grip_mm = [0.0, 0.0, 0.5 * fit.length_mm - fit.engaged_mm];
    let through = fit.height_mm - fit.engaged_mm + 2.0;
    for (key, down) in scenario
        .hand
        .keyframes
        .iter_mut()
        .zip([0.0, -fit.engaged_mm - 3.0, through])
    {
        key.offset_mm[2] = -down;
    }
    scenario.depth = Some(Depth {
        fixed: "block".into(),
        axis: [0.0, 0.0, -1.0],
        through_mm: [0.0; 3],
    });
    Ok(scenario)
}

/// Plays `scenario` with a guide that receives every sample.
pub(crate) fn play(
    scenario: &Scenario,
    scene: &PreparedScene,
    spec: &RigSpec,
) -> Result<Recording, LabError> {
    let mut guide = scene.guide(GuideSettings::default());
    play_with(scenario, scene, spec, &mut guide)
}

/// As [`play`], with a guide of the caller's, whose list can be inspected afterwards.
pub(crate) fn play_with(
    scenario: &Scenario,
    scene: &PreparedScene,
    spec: &RigSpec,
    guide: &mut Guide<'_>,
) -> Result<Recording, LabError> {
    let mut listener = |sample: &Telemetry| guide.hear(sample);
    let client = connect(scenario, spec)?;
    Ok(record(&client, scenario, scene, Some(&mut listener))?)
}

/// Plays `scenario`; `listener` returns the messages to send.
pub(crate) fn play_to(
    scenario: &Scenario,
    scene: &PreparedScene,
    spec: &RigSpec,
    listener: &mut dyn FnMut(&Telemetry) -> Vec<ToDevice>,
) -> Result<Recording, LabError> {
    Ok(record(
        &connect(scenario, spec)?,
        scenario,
        scene,
        Some(listener),
    )?)
}

/// The first target that the guide creates from the contacts when `scenario` is played in-process without any.
pub(crate) fn known_target(scenario: &Scenario, scene: &PreparedScene) -> Result<ConstraintTarget, LabError> {
    let mut guide = scene.guide(GuideSettings::default());
    let mut found = None;
    let mut listener = |sample: &Telemetry| {
        for message in guide.hear(sample) {
            if let ToDevice::SetTarget(target) = message {
                found.get_or_insert(target);
            }
        }
        Vec::new()
    };
    play_to(scenario, scene, &SIM, &mut listener)?;
    found.ok_or_else(|| LabError::Input {
        name: scenario.name.clone(),
        what: "nothing was recognised when the parts touched".into(),
    })
}

/// Sends `target` at once and refreshes it: guidance without recognition.
pub(crate) fn refreshed(target: ConstraintTarget) -> impl FnMut(&Telemetry) -> Vec<ToDevice> {
    const REFRESH_TICKS: u32 = 100;
    const EXPIRY_TICKS: u16 = 300;
    let (mut due, mut sequence) = (None, 0u16);
    move |sample| {
        if due.is_some_and(|due| sample.tick < due) {
            return Vec::new();
        }
        due = Some(sample.tick + REFRESH_TICKS);
        sequence = sequence.wrapping_add(1);
        vec![ToDevice::SetTarget(ConstraintTarget {
            sequence,
            expiry_ticks: EXPIRY_TICKS,
            ..target.clone()
        })]
    }
}

/// Ticks after full engagement until a part is on its axis: 1 mm decays below 1 µm with τ = 20 ms.
const SETTLING_TICKS: u32 = 150;

/// Result of an insertion.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Inserted {
    /// Depth at the end, and depth of the hole, mm.
    pub depth_mm: f64,
    pub hole_mm: f64,
    /// Time at which it was through, from the hand's start, s; NaN: never.
    pub after_s: f64,
    /// Delay behind the time at which the script alone would have the handle through, s: the time lost in contact.
    pub behind_s: f64,
    /// Largest distance from the axis once guidance had settled, mm; NaN: it never did.
    pub off_axis_mm: f64,
}

/// Time at which the script itself has the middle of the part through, s from its start: the hand's path down is straight between keyframes.
fn hand_through_s(scenario: &Scenario, way_mm: f64) -> f64 {
    let down = |key: &Key| -key.offset_mm[2];
    (scenario.hand.keyframes.windows(2))
        .find(|pair| down(&pair[0]) <= way_mm && way_mm <= down(&pair[1]))
        .map_or(f64::NAN, |pair| {
            let share = (way_mm - down(&pair[0])) / (down(&pair[1]) - down(&pair[0]));
            pair[0].t_s + share * (pair[1].t_s - pair[0].t_s)
        })
}

/// Evaluates an insertion's samples.
pub(crate) fn inserted(scenario: &Scenario, scene: &PreparedScene, samples: &[Telemetry]) -> Inserted {
    let mut seen = Inserted {
        depth_mm: f64::NAN,
        hole_mm: f64::NAN,
        after_s: f64::NAN,
        behind_s: f64::NAN,
        off_axis_mm: f64::NAN,
    };
    let first = samples.first().map_or(0, |sample| sample.tick);
    let mut engaged_since = None;
    for sample in samples {
        let Some((_, pose)) = &sample.object else { continue };
        let Some((deep, hole, off)) =
            (scenario.depth.as_ref()).and_then(|of| depth(scene, of, &pose_mm(pose)))
        else {
            continue;
        };
        (seen.depth_mm, seen.hole_mm) = (deep, hole);
        if deep >= hole && seen.after_s.is_nan() {
            let every = u32::from(scenario.run.telemetry_every_ticks);
            seen.after_s = 1e-3 * f64::from(sample.tick - first + every);
            let start = samples.iter().find_map(|sample| sample.object.as_ref());
            let begun = start.and_then(|(_, pose)| depth(scene, scenario.depth.as_ref()?, &pose_mm(pose)));
            let way = begun.map_or(f64::NAN, |(deep, ..)| hole - deep);
            seen.behind_s = seen.after_s - hand_through_s(scenario, way);
        }
        if sample.guidance.engagement < 1.0 {
            engaged_since = None;
        } else if sample.tick - *engaged_since.get_or_insert(sample.tick) > SETTLING_TICKS {
            seen.off_axis_mm = seen.off_axis_mm.max(off);
        }
    }
    seen
}

/// Alignment of a peg once guidance had settled; NaN: it never did.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Course {
    /// Deepest penetration, mm.
    pub penetration_mm: f64,
    /// Largest tilt, degrees, and largest distance of the leading end's middle from the axis, mm.
    pub tilt_deg: f64,
    pub tip_off_mm: f64,
}

/// Evaluates every sample in closed form.
pub(crate) fn course(exact: &ExactFit, samples: &[Telemetry]) -> Course {
    let mut seen = Course {
        penetration_mm: f64::NAN,
        tilt_deg: f64::NAN,
        tip_off_mm: f64::NAN,
    };
    let mut engaged_since = None;
    for sample in samples {
        let Some((_, pose)) = &sample.object else { continue };
        if sample.guidance.engagement < 1.0 {
            engaged_since = None;
        } else if sample.tick - *engaged_since.get_or_insert(sample.tick) > SETTLING_TICKS {
            let (tilt_deg, tip_off_mm) = exact.leaning(&pose_mm(pose));
            seen.penetration_mm = seen.penetration_mm.max(exact.penetration_mm(&pose_mm(pose)));
            seen.tilt_deg = seen.tilt_deg.max(tilt_deg);
            seen.tip_off_mm = seen.tip_off_mm.max(tip_off_mm);
        }
    }
    seen
}

/// Largest change of the handle's force (N) and torque (N m) between two consecutive ticks.
pub(crate) fn largest_step(samples: &[Telemetry]) -> (f64, f64) {
    let of = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
    (samples.windows(2))
        .filter(|pair| pair[1].tick == pair[0].tick + 1)
        .map(|pair| {
            let force = of(pair[1].wrench.force) - of(pair[0].wrench.force);
            let torque = of(pair[1].wrench.torque) - of(pair[0].wrench.torque);
            (force.length(), torque.length())
        })
        .fold((0.0, 0.0), |(a, b), (force, torque)| {
            (a.max(force), b.max(torque))
        })
}
