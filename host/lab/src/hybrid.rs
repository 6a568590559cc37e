//! The hybrid method of Faas 2010, chapter 8, on voxmaps: table 6 and fig. 35, and which of the two pegs is assembled by which of the three methods.
//!
//! Voxels of 10 mm, a hole of 0.7 m, pegs of 0.65 and 0.69 m. The thesis' methods: voxmap and pointshell alone; the hybrid method without constraint
//! evaluation, in which the contacts of voxels of faces that can form a constraint are softened; and with it, in which the constraint also pulls
//! (eqs. 13–19). The text does not state by how much contacts are softened without evaluation; here it is the same x (eq. 15). Constraints are
//! recognised from the faces that voxels in contact name, each tenth tick, as in the thesis. A fourth method, for comparison: the distance field with
//! the default guidance.
//!
//! The course is that of section 8.5: the peg is pressed on the planar face beside the hole, lifted and moved over the hole, and inserted. There the
//! hand is off the axis by half of the radial clearance, until the peg is deep enough to rest on the wall above and below the grip; from there on the
//! hand pulls it against the wall, so that any peg touches, whatever its clearance.
//!
//! The other lengths of block and pegs are not printed. Lengths of 1 m throughout reproduce the thesis' numbers of voxels within a few percent
//! ([`counts`]), so they are used here.
//!
//! Update rates are those that the time of a tick allows, in-process on one core of this computer: like the thesis', a figure of a computer, not of a
//! board.

mod script;

use std::collections::BTreeSet;
use std::fmt;

use mortise_bake::{Grabbable, Method, bake};
use mortise_brep::load_step;
use mortise_guide::GuideSettings;
use mortise_protocol::image::{BRICK_CELLS, Field, NO_FACE, SceneImage, Voxel};
use mortise_protocol::message::{Telemetry, ToDevice};
use mortise_protocol::parameter::ParameterId;
use mortise_scenario::measure::depth;
use mortise_scenario::wire::pose_mm;
use mortise_scenario::{PreparedScene, Scenario, ScenarioError};
use serde::Serialize;

use crate::LabError;
use crate::chart::{Axis, Chart, Line, Look, Point, Series};
use crate::experiment::{Experiment, Findings, Form, Report};
use crate::guided::{SIM, inserted, play_to};
use crate::study::faas::{FIG_35_HZ, TABLE_6};
use crate::table::rounded;
use crate::variant::Variant;

pub use script::{CASES, Case, PEGS_MM};
use script::{PRESSED_S, fit, inserts_s, lifted_s, scenario};

/// Voxels, mm.
const VOXEL_MM: f64 = 10.0;
/// Ticks of a window; its median tick is reported.
const WINDOW_TICKS: usize = 20;

/// Method of contact and guidance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Condition {
    /// Voxmap and pointshell alone.
    Voxels,
    /// The hybrid method with softened contacts and no pull.
    HybridWithoutEvaluation,
    /// The hybrid method with the constraint's pull.
    Hybrid,
    /// Distance field and default guidance.
    DistanceField,
}

/// All methods, the thesis' first.
pub const CONDITIONS: [Condition; 4] = [
    Condition::Voxels,
    Condition::HybridWithoutEvaluation,
    Condition::Hybrid,
    Condition::DistanceField,
];

/// A window of consecutive ticks.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Window {
    /// Name of the case.
    pub case: &'static str,
    /// Method of contact and guidance.
    pub condition: Condition,
    /// Diameter of the peg, mm.
    pub peg_mm: f64,
    /// Time since the hand began to move, s.
    pub t_s: f64,
    /// Depth of the peg, mm; negative above the hole.
    pub depth_mm: f64,
    /// Distance of its middle from the hole's axis, mm.
    pub off_axis_mm: f64,
    /// Force on the handle, N.
    pub handle_n: f64,
    /// Largest contact force on the peg, N.
    pub contact_n: f64,
    /// Targets in force.
    pub targets: u8,
    /// Time of the median tick, µs.
    pub tick_us: f64,
    /// The rate that this time allows, Hz.
    pub rate_hz: f64,
}

/// An insertion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Course {
    /// Name of the case.
    pub case: &'static str,
    /// Method of contact and guidance.
    pub condition: Condition,
    /// Diameter of the peg, mm.
    pub peg_mm: f64,
    /// True if the thesis' peg was assembled; absent for methods that the thesis does not have.
    pub faas_through: Option<bool>,
    /// True if the peg came through here.
    pub through: bool,
    /// Final depth, mm; the hole is 1 m deep.
    pub depth_mm: f64,
    /// Largest force on the handle, N.
    pub peak_n: f64,
    /// Median contact force on the peg while it is pressed on the face, N; absent if it is not.
    pub face_n: Option<f64>,
    /// Names of the constraints recognised until it is lifted off the face.
    pub recognised_on_face: String,
    /// Ticks of the insertion in which the peg touches, %: from the hand's way down on.
    pub touching_percent: f64,
    /// Largest contact force on the peg in the insertion, N.
    pub wall_n: f64,
    /// Distance of its middle from the hole's axis at the end, mm.
    pub off_axis_mm: f64,
    /// Names of the constraints recognised after that.
    pub recognised: String,
    /// Faces of peg and block in contact at the end.
    pub touching: String,
    /// The thesis' lowest update rate in the low-clearance case, Hz: “above 800”, “not below 800”, “dropped to 100”.
    pub faas_lowest_hz: Option<f64>,
    /// Rate allowed by the median tick of the slowest window, Hz.
    pub lowest_hz: f64,
    /// All windows.
    #[serde(skip)]
    pub windows: Vec<Window>,
}

/// Numbers of voxels of a part in the thesis and here.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Count {
    /// Part.
    pub part: &'static str,
    /// Number printed in table 6.
    pub faas: u32,
    /// Surface voxels here.
    pub ours: u32,
    /// Difference of the latter from the former, %.
    pub off_percent: f64,
}

/// Table 6: surface voxels of the block and of both pegs.
///
/// # Errors
/// Anything that prevents a part from being baked.
pub fn counts() -> Result<Vec<Count>, LabError> {
    let mut found = Vec::new();
    for (number, &peg) in PEGS_MM.iter().enumerate() {
        let file = fit(peg, CASES[0].engaged_mm).file()?;
        let model = load_step(file.path())?;
        let options = Variant::textbook(VOXEL_MM).options(Grabbable::Named(vec!["peg".into()]));
        let named = |source| ScenarioError::Bake {
            step: "the pair of table 6".into(),
            source,
        };
        let baked = bake(&model, &options, &|_| std::ops::ControlFlow::Continue(())).map_err(named)?;
        let aligned: Vec<u32> = (baked.image.chunks(4))
            .map(|bytes| {
                let mut word = [0; 4];
                word[..bytes.len()].copy_from_slice(bytes);
                u32::from_ne_bytes(word)
            })
            .collect();
        let scene = SceneImage::open(bytemuck::cast_slice(&aligned)).map_err(|error| LabError::Input {
            name: "the pair of table 6".into(),
            what: error.to_string(),
        })?;
        for (shape, part) in baked.report.shapes.iter().enumerate() {
            let row = if part.name == "block" { 0 } else { 1 + number };
            if row == 0 && number > 0 {
                continue;
            }
            let (part, faas) = TABLE_6[row];
            let ours = surface_voxels(&scene.shape(shape).field);
            found.push(Count {
                part,
                faas,
                ours,
                off_percent: rounded(100.0 * (f64::from(ours) / f64::from(faas) - 1.0), 2),
            });
        }
    }
    Ok(found)
}

fn surface_voxels(field: &Field<'_>) -> u32 {
    let record = field.record();
    let [w, h, d] = record.brick_dims.map(|n| u32::from(n) * BRICK_CELLS as u32);
    let at = |axis: usize, i: u32| record.origin[axis] + (i as f32 + 0.5) * record.cell;
    let mut count = 0;
    for z in 0..d {
        for y in 0..h {
            for x in 0..w {
                let voxel = field.voxel([at(0, x), at(1, y), at(2, z)]).voxel;
                count += u32::from(voxel == Voxel::Surface);
            }
        }
    }
    count
}

/// Plays every method with the high-clearance peg in the first two cases and the low-clearance peg in all; `quick` plays the latter in the first case
/// only. Passes each course to `out`.
///
/// # Errors
/// Anything that prevents an insertion from being played.
pub fn sweep(quick: bool, out: &mut dyn FnMut(&Course)) -> Result<Vec<Course>, LabError> {
    let high = CASES[..2].iter().map(|&case| (PEGS_MM[0], case));
    let low = CASES.iter().map(|&case| (PEGS_MM[1], case));
    let plays: Vec<(f64, Case)> = if quick {
        low.take(1).collect()
    } else {
        high.chain(low).collect()
    };
    let mut courses = Vec::new();
    for (peg, case) in plays {
        let fit = fit(peg, case.engaged_mm);
        let file = fit.file()?;
        let scenario = scenario(&fit, &case, file.path())?;
        let mut made: Option<(Method, PreparedScene)> = None;
        for condition in CONDITIONS {
            let variant = condition.variant();
            if made.as_ref().is_none_or(|(method, _)| *method != variant.method) {
                let options = variant.options(Grabbable::Named(vec!["peg".into()]));
                made = Some((variant.method, PreparedScene::with(&scenario, &options)?));
            }
            if let Some((_, scene)) = &made {
                let course = course((case.name, condition, peg), &scenario, scene)?;
                out(&course);
                courses.push(course);
            }
        }
    }
    Ok(courses)
}

fn course(
    (case, condition, peg_mm): (&'static str, Condition, f64),
    scenario: &Scenario,
    scene: &PreparedScene,
) -> Result<Course, LabError> {
    let mut scenario = scenario.clone();
    let mut guidance = |choice: f32| {
        let name = ParameterId::Guidance.row().name.to_owned();
        scenario.parameters.insert(name, choice);
    };
    let mut settings = GuideSettings::default();
    match condition {
        Condition::Voxels => guidance(0.0),
        Condition::HybridWithoutEvaluation => {
            guidance(2.0);
            (settings.force_cap_n, settings.torque_cap_nm) = (0.0, 0.0);
        }
        Condition::Hybrid => guidance(2.0),
        Condition::DistanceField => guidance(1.0),
    }
    let mut guide = scene.guide(settings);
    // Until the peg is lifted off the face, and after.
    let mut recognised = [BTreeSet::new(), BTreeSet::new()];
    let lifted_s = lifted_s(&scenario);
    let mut begins = None;
    let mut listener = |sample: &Telemetry| {
        let t_s = 1e-3 * f64::from(sample.tick - *begins.get_or_insert(sample.tick));
        let messages = guide.hear(sample);
        for message in &messages {
            if let ToDevice::SetTarget(target) = message {
                recognised[usize::from(t_s >= lifted_s)]
                    .insert(format!("{:?} {:?}", target.kind, target.faces).to_lowercase());
            }
        }
        messages
    };
    let recording = play_to(&scenario, scene, &SIM, &mut listener)?;
    let [recognised_on_face, recognised] =
        recognised.map(|names| names.into_iter().collect::<Vec<_>>().join("; "));
    let seen = inserted(&scenario, scene, &recording.samples);
    let first = recording.samples.first().map_or(0, |sample| sample.tick);
    let begun = |at_s: f64| {
        (recording.samples).partition_point(|sample| 1e-3 * f64::from(sample.tick - first) < at_s)
    };
    let pressed = &recording.samples[..begun(lifted_s)];
    let wall: Vec<f64> = recording.samples[begun(inserts_s(&scenario))..]
        .iter()
        .map(contact_n)
        .collect();
    let touching = wall.iter().filter(|&&force| force > 0.0).count();
    let windows: Vec<Window> = (recording.samples.chunks_exact(WINDOW_TICKS))
        .filter_map(|ticks| {
            let last = ticks.last()?;
            let (deep, _, off) = depth(
                scene,
                scenario.depth.as_ref()?,
                &pose_mm(&last.object.as_ref()?.1),
            )?;
            let mut costs: Vec<u32> = ticks.iter().map(|sample| sample.cost).collect();
            costs.sort_unstable();
            let tick_us = 1e-3 * f64::from(costs[costs.len() / 2].max(1));
            let force = glam::DVec3::from_array(last.wrench.force.map(f64::from)).length();
            Some(Window {
                case,
                condition,
                peg_mm,
                t_s: rounded(1e-3 * f64::from(last.tick - first), 3),
                depth_mm: rounded(deep, 3),
                off_axis_mm: rounded(off, 3),
                handle_n: rounded(force, 3),
                contact_n: rounded(ticks.iter().map(contact_n).fold(0.0, f64::max), 3),
                targets: last.guidance.active,
                tick_us: rounded(tick_us, 1),
                rate_hz: rounded(1e6 / tick_us, 0),
            })
        })
        .collect();
    let place = CONDITIONS.iter().position(|of| *of == condition).unwrap_or(0);
    let touching_at_end = recording.samples.last().map(|sample| {
        let pairs = sample.pairs.iter();
        let named = pairs.map(|p| {
            let of = |faces: [u16; 2]| match faces {
                [face, NO_FACE] => format!("{face}"),
                [face, edge] => format!("{face}+{edge}"),
            };
            let [moving, fixed] = [
                [p.moving_face, p.moving_edge_face],
                [p.static_face, p.static_edge_face],
            ]
            .map(of);
            format!("{moving} on {fixed} ({}×)", p.count)
        });
        named.collect::<Vec<_>>().join("; ")
    });
    Ok(Course {
        case,
        condition,
        peg_mm,
        faas_through: condition.faas_through(peg_mm),
        through: seen.depth_mm >= seen.hole_mm,
        depth_mm: rounded(seen.depth_mm, 3),
        peak_n: rounded(recording.outcome.peak_force_n, 3),
        face_n: pressed_n(pressed),
        recognised_on_face,
        touching_percent: rounded(100.0 * touching as f64 / wall.len().max(1) as f64, 1),
        wall_n: rounded(wall.iter().copied().fold(0.0, f64::max), 3),
        off_axis_mm: windows.last().map_or(f64::NAN, |window| window.off_axis_mm),
        recognised,
        touching: touching_at_end.unwrap_or_default(),
        faas_lowest_hz: FIG_35_HZ.get(place).copied().filter(|_| peg_mm == PEGS_MM[1]),
        lowest_hz: windows
            .iter()
            .map(|window| window.rate_hz)
            .fold(f64::INFINITY, f64::min),
        windows,
    })
}

fn contact_n(sample: &Telemetry) -> f64 {
    glam::DVec3::from_array(sample.contact.force.map(f64::from)).length()
}

/// Median contact force of the ticks in which the hand holds the peg on the face, N.
fn pressed_n(before: &[Telemetry]) -> Option<f64> {
    let held = &before[before.len().saturating_sub((1e3 * PRESSED_S) as usize)..];
    let mut forces: Vec<f64> = held.iter().map(contact_n).collect();
    forces.sort_by(f64::total_cmp);
    forces.get(forces.len() / 2).map(|&force| rounded(force, 3))
}

impl Condition {
    fn variant(self) -> Variant {
        match self {
            Self::DistanceField => Variant::board(VOXEL_MM),
            _ => Variant::textbook(VOXEL_MM),
        }
    }

    /// Section 8.2: without evaluation both pegs were assembled; with it the low-clearance one was not, because the update rate was too low.
    fn faas_through(self, peg_mm: f64) -> Option<bool> {
        let high = peg_mm == PEGS_MM[0];
        match self {
            Self::Voxels | Self::Hybrid => Some(high),
            Self::HybridWithoutEvaluation => Some(true),
            Self::DistanceField => None,
        }
    }

    /// Description.
    pub fn name(self) -> &'static str {
        match self {
            Self::Voxels => "voxels alone",
            Self::HybridWithoutEvaluation => "hybrid without evaluation",
            Self::Hybrid => "hybrid with evaluation",
            Self::DistanceField => "distance field, default guidance",
        }
    }
}

/// Fig. 35: the update rate that ticks allow over the insertion of the low-clearance peg, with the thesis' rates.
pub fn chart(courses: &[Course]) -> Chart {
    let of: Vec<&Course> = courses
        .iter()
        .filter(|course| course.peg_mm == PEGS_MM[1] && course.case == CASES[0].name)
        .collect();
    let end =
        (of.iter().flat_map(|course| &course.windows)).fold(0.0, |end: f64, window| end.max(window.t_s));
    let looks = [
        Look::VermilionSquare,
        Look::BlueDisc,
        Look::GreenTriangle,
        Look::Black,
    ];
    let mut series: Vec<Series> = (of.iter().zip(looks))
        .map(|(course, look)| Series {
            name: format!("{}: {:.0} mm in", course.condition.name(), course.depth_mm),
            look,
            line: Line::Trace,
            points: (course.windows.iter())
                .map(|window| Point {
                    x: window.t_s,
                    y: window.rate_hz,
                    ..Point::default()
                })
                .collect(),
        })
        .collect();
    let hers = [
        "Faas 2010, fig. 35: lowest, voxels and hybrid without evaluation",
        "the same with evaluation",
    ];
    for ((name, hz), look) in hers
        .iter()
        .zip([FIG_35_HZ[0], FIG_35_HZ[2]])
        .zip([Look::SkyRing, Look::OrangeCross])
    {
        series.push(Series {
            name: (*name).into(),
            look,
            line: Line::DashedTrace,
            points: [0.0, end]
                .map(|x| Point {
                    x,
                    y: hz,
                    ..Point::default()
                })
                .to_vec(),
        });
    }
    Chart {
        title: "Update rate over the course of Faas 2010: peg of 0.69 m, hole of 0.7 m, voxels of 10 mm"
            .into(),
        note: format!(
            "On the face beside the hole, over the hole, into it. Median tick of {WINDOW_TICKS}, in-process on one core of this computer; those of Faas 2010 are of a computer of that time."
        ),
        x: Axis::new("time, s").linear(),
        y: Axis::new("rate that a tick allows, Hz"),
        series,
    }
}

impl fmt::Display for Course {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let went = |through| if through { "through" } else { "stuck" };
        write!(
            f,
            "peg {} mm, {}, {}: ",
            self.peg_mm,
            self.case,
            self.condition.name()
        )?;
        if let Some(through) = self.faas_through {
            write!(f, "Faas {}; ", went(through))?;
        }
        write!(
            f,
            "ours {}, {:.1} mm in, at most {:.2} N, ",
            went(self.through),
            self.depth_mm,
            self.peak_n,
        )?;
        let named = |names: &str| {
            if names.is_empty() {
                "nothing".to_owned()
            } else {
                names.to_owned()
            }
        };
        if let Some(force) = self.face_n {
            write!(
                f,
                "pressed on the face with {force:.2} N, where {} is recognised; ",
                named(&self.recognised_on_face)
            )?;
        }
        write!(
            f,
            "touches in {} % of the insertion's ticks with at most {:.2} N, {:.2} mm off the axis at the end, {} recognised; ticks allow {} Hz at least",
            self.touching_percent,
            self.wall_n,
            self.off_axis_mm,
            named(&self.recognised),
            self.lowest_hz
        )?;
        if let Some(hz) = self.faas_lowest_hz {
            write!(f, " (Faas {hz} Hz)")?;
        }
        if self.touching.is_empty() {
            return Ok(());
        }
        write!(f, "; touching at the end, peg on block: {}", self.touching)
    }
}

impl fmt::Display for Count {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "table 6, {}: Faas {} voxels, ours {} ({:+.2} %)",
            self.part, self.faas, self.ours, self.off_percent
        )
    }
}

/// The experiment `hybrid`.
pub struct Hybrid;

impl Experiment for Hybrid {
    fn name(&self) -> &'static str {
        "hybrid"
    }

    fn about(&self) -> &'static str {
        "The thesis' hybrid method on voxmaps: its three methods on its two pegs, beside table 6 and fig. 35"
    }

    fn quick(&self) -> &'static str {
        "the low-clearance peg in the first case"
    }

    fn rows(&self) -> Vec<String> {
        ["hybrid", "hybrid-rate", "hybrid-table-6"]
            .map(String::from)
            .into()
    }

    fn charts(&self) -> Vec<String> {
        ["hybrid"].map(String::from).into()
    }

    fn run(&self, form: Form<'_>, report: &mut Report<'_>) -> Result<Findings, LabError> {
        let counts = counts()?;
        counts.iter().for_each(|count| report(count));
        let courses = sweep(form.quick, &mut |course| report(course))?;
        // Of the thesis' case alone: the others are a megabyte.
        let windows: Vec<&Window> = (courses.iter())
            .filter(|course| course.case == CASES[0].name)
            .flat_map(|course| &course.windows)
            .collect();
        Ok(Findings::default()
            .rows("hybrid-table-6", &counts)?
            .rows("hybrid", &courses)?
            .rows("hybrid-rate", &windows)?
            .chart("hybrid", chart(&courses)))
    }
}
