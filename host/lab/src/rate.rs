//! The update rate that a tick allows over an insertion: collision only, guided by a known target, and guided by recognised ones, on the emulated
//! board.
//!
//! Fig. 35 of Faas 2010 shows the update rate over an insertion: it falls from 800 Hz to 100 Hz when constraints are evaluated. Here the board counts
//! the instructions of each tick; the rate they allow is the clock over the slowest tick, at one instruction a clock cycle of a Cortex-M7 at 480 MHz.
//! The result is headroom, not loop rate: the loop always runs at 1 kHz. Recognition runs on the desktop, so the board does the same work whether a
//! target is recognised or known.

use std::fmt;

use mortise_bake::Grabbable;
use mortise_guide::GuideSettings;
use mortise_protocol::message::{Telemetry, ToDevice};
use mortise_protocol::parameter::ParameterId;
use mortise_scenario::measure::{depth, left_out_percent};
use mortise_scenario::wire::pose_mm;
use mortise_scenario::{PreparedScene, Recording, Scenario};
use serde::Serialize;

use crate::LabError;
use crate::chart::{Axis, Chart, Line, Look, Point, Series};
use crate::experiment::{Experiment, Findings, Form, Report};
use crate::fit::Fit;
use crate::guided::{emulated, inserted, key, known_target, play_to, refreshed};
use crate::table::rounded;
use crate::variant::Variant;

/// Clock of the board, Hz, and instructions a cycle.
const CLOCK_HZ: f64 = 480e6;
const INSTRUCTIONS_PER_CYCLE: f64 = 1.0;
/// Ticks of a window; its slowest tick is reported.
const WINDOW_TICKS: usize = 10;
/// Rate before constraints are evaluated and while they are, Hz: Faas 2010, fig. 35.
const THESIS_HZ: [f64; 2] = [800.0, 100.0];
/// The loop's own rate, Hz.
const LOOP_HZ: f64 = 1000.0;

/// Offset of the hand: a share of the radial clearance, and degrees.
const OFF: f64 = 0.8;
const TILT_DEG: f64 = 0.5;
/// Time until the hand is off the axis, shortest time of the push, and time at the end, s; and largest speed of the push, mm/s.
const COMES_S: f64 = 0.2;
const PUSHES_S: f64 = 1.0;
const ENDS_S: f64 = 0.2;
const MM_PER_S: f64 = 250.0;

/// Ticks between answers to telemetry.
const HEED_TICKS: u16 = 10;

/// Guidance during an insertion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mode {
    /// Collision only.
    Collision,
    /// Collision and a target that is known from the start.
    Guided,
    /// Collision and the targets that the desktop recognises.
    Recognised,
}

/// All modes.
pub const MODES: [Mode; 3] = [Mode::Collision, Mode::Guided, Mode::Recognised];

/// A pair of parts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// Name in the chart's file name.
    pub name: &'static str,
    /// Description.
    pub what: &'static str,
    fit: Fit,
    cell_mm: f64,
}

/// The pairs: the thesis' 18.75 mm pair, the same with the smallest clearance that also goes in unguided, and the large pair (table 6).
pub const PAIRS: [Pair; 3] = [
    Pair {
        name: "rate",
        what: "peg in a hole of 18.75 mm, 0.2 mm clearance, cells of 0.5 mm",
        fit: Fit::thesis(0.2),
        cell_mm: 0.5,
    },
    Pair {
        name: "rate-close",
        what: "peg in a hole of 18.75 mm, 0.02 mm clearance, cells of 0.5 mm",
        fit: Fit::thesis(0.02),
        cell_mm: 0.5,
    },
    Pair {
        name: "rate-large",
        what: "peg of 690 mm in a hole of 700 mm, cells of 10 mm",
        fit: Fit::large(690.0),
        cell_mm: 10.0,
    },
];

/// A window of consecutive ticks.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Window {
    /// Name of the pair.
    pub pair: &'static str,
    /// Guidance.
    pub mode: Mode,
    /// Time since the hand began to move, s.
    pub t_s: f64,
    /// Depth of the peg, mm; negative above the hole.
    pub depth_mm: f64,
    /// Instructions of the mean tick.
    pub instructions_mean: f64,
    /// Instructions of the slowest tick.
    pub instructions_max: u32,
    /// Ticks that left out points, %.
    pub left_out_percent: f64,
    /// The rate that the slowest tick allows, Hz.
    pub rate_hz: f64,
    /// Targets in force at the end.
    pub targets: u8,
}

/// An insertion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Course {
    /// Name of the pair.
    pub pair: &'static str,
    /// Guidance.
    pub mode: Mode,
    /// Final depth of the peg, mm.
    pub depth_mm: f64,
    /// Hole's depth, mm.
    pub hole_mm: f64,
    /// Instructions of the mean tick.
    pub instructions_mean: f64,
    /// Instructions of the slowest tick.
    pub instructions_max: u32,
    /// The rate that this tick allows, Hz.
    pub slowest_hz: f64,
    /// Ticks that left out points, %.
    pub left_out_percent: f64,
    /// Missed ticks on the emulated board.
    pub missed_ticks: u32,
    /// All windows.
    #[serde(skip)]
    pub windows: Vec<Window>,
}

/// Number of pairs that the shorter form plays.
pub const QUICK: usize = 2;

/// Plays every mode with every pair; `quick` takes the first [`QUICK`] pairs only. Passes each course to `out`.
///
/// # Errors
/// Anything that prevents an insertion from being played.
pub fn sweep(quick: bool, out: &mut dyn FnMut(&Course)) -> Result<Vec<Course>, LabError> {
    let pairs = if quick { &PAIRS[..QUICK] } else { &PAIRS[..] };
    played(pairs, &MODES, out)
}

/// Plays these modes with these pairs.
pub(crate) fn played(
    pairs: &[Pair],
    modes: &[Mode],
    out: &mut dyn FnMut(&Course),
) -> Result<Vec<Course>, LabError> {
    let mut courses = Vec::new();
    for pair in pairs {
        let fit = pair.fit;
        let file = fit.file()?;
        let scenario = scenario(&fit, file.path())?;
        let options = Variant::field(pair.cell_mm).options(Grabbable::Named(vec!["peg".into()]));
        let scene = PreparedScene::with(&scenario, &options)?;
        for &mode in modes {
            let course = course(pair, mode, &scenario, &scene)?;
            out(&course);
            courses.push(course);
        }
    }
    Ok(courses)
}

/// From 1 mm engaged through the hole; the hand trembles and is off by four fifths of the clearance and half a degree, so that the peg also goes in
/// without guidance and touches on the way.
fn scenario(fit: &Fit, step: &std::path::Path) -> Result<Scenario, LabError> {
    let mut scenario = Scenario::insertion(step)?;
    scenario.hand.tremor_mm = 0.1;
    scenario.hand.tremor_hz = 10.0;
    scenario.hand.grip_mm = [0.0, 0.0, 0.5 * fit.length_mm - fit.engaged_mm];
    let through = fit.height_mm - fit.engaged_mm + 2.0;
    let arrives = COMES_S + (through / MM_PER_S).max(PUSHES_S);
    let aside = OFF * 0.5 * fit.clearance_mm();
    scenario.hand.keyframes = vec![
        key(0.0, [0.0; 3], [0.0; 3]),
        key(COMES_S, [aside, 0.0, 0.0], [0.0, TILT_DEG, 0.0]),
        key(arrives, [aside, 0.0, -through], [0.0, TILT_DEG, 0.0]),
    ];
    scenario.run.duration_s = arrives + ENDS_S;
    scenario.run.telemetry_every_ticks = 1;
    // As often as the window answers.
    scenario.run.heed_every_ticks = Some(HEED_TICKS);
    Ok(scenario)
}

fn course(pair: &Pair, mode: Mode, scenario: &Scenario, scene: &PreparedScene) -> Result<Course, LabError> {
    let mut scenario = scenario.clone();
    let recording = match mode {
        Mode::Collision => {
            let name = ParameterId::Guidance.row().name.to_owned();
            scenario.parameters.insert(name, 0.0);
            play_to(&scenario, scene, &emulated(), &mut |_| Vec::new())?
        }
        Mode::Guided => {
            let mut listener = refreshed(known_target(&scenario, scene)?);
            play_to(&scenario, scene, &emulated(), &mut listener)?
        }
        Mode::Recognised => {
            let mut guide = scene.guide(GuideSettings::default());
            let mut listener = |sample: &Telemetry| -> Vec<ToDevice> { guide.hear(sample) };
            play_to(&scenario, scene, &emulated(), &mut listener)?
        }
    };
    let Some(most) = recording.outcome.instructions_per_tick_max else {
        return Err(LabError::Input {
            name: recording.outcome.rig.clone(),
            what: "it counts no instructions; an emulated board that does is needed".into(),
        });
    };
    if recording.outcome.dropped_samples > 0 {
        return Err(LabError::Input {
            name: recording.outcome.rig.clone(),
            what: format!(
                "{} ticks were not reported: the link is too slow",
                recording.outcome.dropped_samples
            ),
        });
    }
    let seen = inserted(&scenario, scene, &recording.samples);
    Ok(Course {
        pair: pair.name,
        mode,
        depth_mm: rounded(seen.depth_mm, 3),
        hole_mm: rounded(seen.hole_mm, 3),
        instructions_mean: rounded(
            recording.outcome.instructions_per_tick_mean.unwrap_or(f64::NAN),
            0,
        ),
        instructions_max: most,
        slowest_hz: allowed_hz(most),
        left_out_percent: rounded(recording.outcome.degraded_percent, 1),
        missed_ticks: recording.outcome.missed_ticks,
        windows: windows(pair, mode, &scenario, scene, &recording),
    })
}

/// The rate that ticks with this many instructions allow, Hz.
fn allowed_hz(instructions: u32) -> f64 {
    rounded(
        CLOCK_HZ * INSTRUCTIONS_PER_CYCLE / f64::from(instructions.max(1)),
        0,
    )
}

fn windows(
    pair: &Pair,
    mode: Mode,
    scenario: &Scenario,
    scene: &PreparedScene,
    recording: &Recording,
) -> Vec<Window> {
    let first = recording.samples.first().map_or(0, |sample| sample.tick);
    (recording.samples.chunks(WINDOW_TICKS))
        .filter_map(|ticks| {
            let last = ticks.last()?;
            let (_, pose) = last.object.as_ref()?;
            let (deep, ..) = depth(scene, scenario.depth.as_ref()?, &pose_mm(pose))?;
            let most = ticks.iter().map(|sample| sample.cost).max()?;
            let sum: f64 = ticks.iter().map(|sample| f64::from(sample.cost)).sum();
            Some(Window {
                pair: pair.name,
                mode,
                t_s: rounded(1e-3 * f64::from(last.tick - first), 3),
                depth_mm: rounded(deep, 3),
                instructions_mean: rounded(sum / ticks.len() as f64, 0),
                instructions_max: most,
                left_out_percent: rounded(left_out_percent(ticks), 1),
                rate_hz: allowed_hz(most),
                targets: last.guidance.active,
            })
        })
        .collect()
}

/// The allowed rate over the insertion of one pair, with the thesis' figures.
pub fn chart(pair: &Pair, courses: &[Course]) -> Chart {
    let of: Vec<&Course> = courses.iter().filter(|course| course.pair == pair.name).collect();
    let end =
        (of.iter().flat_map(|course| &course.windows)).fold(0.0, |end: f64, window| end.max(window.t_s));
    let mut series: Vec<Series> = (of
        .iter()
        .zip([Look::Black, Look::BlueDisc, Look::VermilionSquare]))
    .map(|(course, look)| Series {
        name: course.mode.name().into(),
        look,
        line: if course.mode == Mode::Recognised {
            Line::DashedTrace
        } else {
            Line::Trace
        },
        points: (course.windows.iter())
            .map(|window| Point {
                x: window.t_s,
                y: window.rate_hz,
                ..Point::default()
            })
            .collect(),
    })
    .collect();
    let level = |name: String, look, line, y| Series {
        name,
        look,
        line,
        points: [0.0, end]
            .map(|x| Point {
                x,
                y,
                ..Point::default()
            })
            .to_vec(),
    };
    series.push(level(
        "our loop's pace, 1 kHz".into(),
        Look::GreenTriangle,
        Line::Trace,
        LOOP_HZ,
    ));
    let when = ["before constraints", "constraints evaluated"];
    for ((hz, when), look) in THESIS_HZ
        .into_iter()
        .zip(when)
        .zip([Look::SkyRing, Look::OrangeCross])
    {
        let name = format!("Faas 2010, fig. 35: {when}, {hz} Hz");
        series.push(level(name, look, Line::DashedTrace, hz));
    }
    Chart {
        title: format!("Rate that a tick allows: {}", pair.what),
        note: format!(
            "Emulated Cortex-M7, slowest of {WINDOW_TICKS} ticks; assumed: 480 MHz, one instruction a cycle. The thesis' rates are those of its PC."
        ),
        x: Axis::new("time, s").linear(),
        y: Axis::new("rate, Hz"),
        series,
    }
}

impl Mode {
    /// Description.
    pub fn name(self) -> &'static str {
        match self {
            Self::Collision => "collision only",
            Self::Guided => "guided, target known",
            Self::Recognised => "guided, target recognised on the desktop",
        }
    }
}

impl fmt::Display for Course {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}, {}: {:.1} mm in of {:.0}; mean {} and at most {} instructions a tick, which allows {} Hz; {} % of ticks left out points, {} ticks missed",
            self.pair,
            self.mode.name(),
            self.depth_mm,
            self.hole_mm,
            self.instructions_mean,
            self.instructions_max,
            self.slowest_hz,
            self.left_out_percent,
            self.missed_ticks
        )
    }
}

/// The experiment `rate`.
pub struct Rate;

impl Experiment for Rate {
    fn name(&self) -> &'static str {
        "rate"
    }

    fn about(&self) -> &'static str {
        "Show the rate that a tick allows over an insertion: collision only, guided, guided with recognition; emulated board"
    }

    fn quick(&self) -> &'static str {
        "the first two pairs"
    }

    fn rows(&self) -> Vec<String> {
        ["rate"].map(String::from).into()
    }

    fn charts(&self) -> Vec<String> {
        PAIRS.map(|pair| pair.name.to_owned()).into()
    }

    fn run(&self, form: Form<'_>, report: &mut Report<'_>) -> Result<Findings, LabError> {
        let courses = sweep(form.quick, &mut |course| report(course))?;
        let windows: Vec<&Window> = courses.iter().flat_map(|course| &course.windows).collect();
        let mut findings = Findings::default().rows("rate", &windows)?;
        for pair in &PAIRS {
            if courses.iter().any(|course| course.pair == pair.name) {
                findings = findings.chart(pair.name, chart(pair, &courses));
            }
        }
        Ok(findings)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_a_million_instructions_allow_a_kilohertz() {
        assert_eq!(allowed_hz(480_000), LOOP_HZ);
        assert_eq!(allowed_hz(600_000), THESIS_HZ[0]);
    }
}
