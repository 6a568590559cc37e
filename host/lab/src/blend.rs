//! Force and engagement over an insertion: the blend of the thesis beside the default guidance.
//!
//! An operator model, 1 mm and 2° off and trembling, moves a peg from above its hole through it; contacts are recognised and targets sent as in the
//! window. Each tick reports the force on the handle, the force of the constraint, its engagement, and the peg's distance from the axis. The thesis'
//! blend (Faas 2010, eqs. 13–19) pulls with x·0.8·k_T; its weight x is computed from the force that the board reports, |f|/(0.8·k_T·d).

use std::fmt;

use glam::DVec3;
use mortise_bake::Grabbable;
use mortise_guide::GuideSettings;
use mortise_protocol::message::{ConstraintTarget, Telemetry, ToDevice};
use mortise_protocol::parameter::ParameterId;
use mortise_scenario::measure::depth;
use mortise_scenario::wire::pose_mm;
use mortise_scenario::{PreparedScene, Recording, Scenario};
use serde::Serialize;

use crate::LabError;
use crate::chart::{Axis, Chart, Line, Look, Point, Series};
use crate::experiment::{Experiment, Findings, Form, Report};
use crate::fit::Fit;
use crate::guided::{SIM, inserted, insertion, largest_step, play_to};
use crate::table::rounded;
use crate::variant::Variant;

/// Clearances, mm, one chart each: one at which any operator succeeds, and one at which none does.
pub const CLEARANCES_MM: [f64; 2] = [1.0, 0.02];
/// Cell of the field, mm: d₀ of the thesis.
const CELL_MM: f64 = 0.5;
/// Stiffness of the thesis' constraint spring as a share of the coupling's.
const THESIS_SHARE: f64 = 0.8;
/// Smallest distance from the axis, mm, at which the thesis' weight is computed from a force: single precision resolves nanometres there.
const LEAST_OFF_MM: f64 = 0.01;
/// Table and chart keep one tick of this many.
const KEPT_TICKS: usize = 5;

/// How a part is guided.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Guided {
    /// Saturating spring: stiff up to a cap.
    Default,
    /// The blend of Faas 2010.
    Thesis,
}

/// Both, the default first.
pub const METHODS: [Guided; 2] = [Guided::Default, Guided::Thesis];

/// One kept tick of an insertion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Moment {
    /// How it is guided.
    pub guided: Guided,
    /// Hole's diameter less the peg's, mm.
    pub clearance_mm: f64,
    /// Time since the hand began to move, s.
    pub t_s: f64,
    /// Depth of the peg in the hole, mm; negative above it.
    pub depth_mm: f64,
    /// Distance of the peg's centre of mass from the hole's axis, mm.
    pub off_axis_mm: f64,
    /// Force on the handle, N.
    pub handle_n: f64,
    /// Force of the constraint, N.
    pub pull_n: f64,
    /// Engagement a, 0 to 1.
    pub engagement: f64,
    /// Weight of the constraint: the engagement, times x of the thesis where its blend guides; absent where it cannot be determined.
    pub weight: Option<f64>,
}

/// An insertion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Course {
    /// How it is guided.
    pub guided: Guided,
    /// Hole's diameter less the peg's, mm.
    pub clearance_mm: f64,
    /// Final depth of the peg, mm; the hole is 40 mm deep.
    pub depth_mm: f64,
    /// Time at which the peg was through, s; absent when it never was.
    pub through_s: Option<f64>,
    /// Largest force on the handle, N.
    pub peak_n: f64,
    /// Largest change of that force between two ticks, N, landing included.
    pub step_n: f64,
    /// Largest change of the torque on the handle between two ticks, mN m, landing included.
    pub step_mnm: f64,
    /// Largest distance from the axis once guidance has settled, µm; absent when it never did.
    pub off_axis_um: Option<f64>,
    /// The kept ticks.
    #[serde(skip)]
    pub moments: Vec<Moment>,
}

/// Plays both methods at every clearance; `quick` takes the first clearance only. Passes each course to `out`.
///
/// # Errors
/// Anything that prevents an insertion from being played.
pub fn sweep(quick: bool, out: &mut dyn FnMut(&Course)) -> Result<Vec<Course>, LabError> {
    let clearances = &CLEARANCES_MM[..if quick { 1 } else { CLEARANCES_MM.len() }];
    let mut courses = Vec::new();
    for &clearance in clearances {
        let fit = Fit::thesis(clearance).engaged(-20.0);
        let file = fit.file()?;
        let mut scenario = insertion(&fit, file.path())?;
        scenario.run.telemetry_every_ticks = 1;
        let options = Variant::field(CELL_MM).options(Grabbable::Named(vec![scenario.scene.part.clone()]));
        let scene = PreparedScene::with(&scenario, &options)?;
        for guided in METHODS {
            let course = play(&scenario, &scene, guided, clearance)?;
            out(&course);
            courses.push(course);
        }
    }
    Ok(courses)
}

fn play(
    scenario: &Scenario,
    scene: &PreparedScene,
    guided: Guided,
    clearance_mm: f64,
) -> Result<Course, LabError> {
    let mut scenario = scenario.clone();
    if guided == Guided::Thesis {
        let name = ParameterId::Guidance.row().name.to_owned();
        scenario.parameters.insert(name, 2.0);
    }
    let mut guide = scene.guide(GuideSettings::default());
    let mut target = None;
    let mut listener = |sample: &Telemetry| {
        let messages = guide.hear(sample);
        for message in &messages {
            if let ToDevice::SetTarget(sent) = message {
                target.get_or_insert_with(|| sent.clone());
            }
        }
        messages
    };
    let recording = play_to(&scenario, scene, &SIM, &mut listener)?;
    let seen = inserted(&scenario, scene, &recording.samples);
    let (step_n, step_nm) = largest_step(&recording.samples);
    let known = |value: f64| value.is_finite().then_some(value);
    Ok(Course {
        guided,
        clearance_mm,
        depth_mm: seen.depth_mm,
        through_s: known(seen.after_s),
        peak_n: recording.outcome.peak_force_n,
        step_n,
        step_mnm: 1e3 * step_nm,
        off_axis_um: known(1e3 * seen.off_axis_mm),
        moments: moments(
            &scenario,
            scene,
            &recording,
            guided,
            clearance_mm,
            target.as_ref(),
        ),
    })
}

fn moments(
    scenario: &Scenario,
    scene: &PreparedScene,
    recording: &Recording,
    guided: Guided,
    clearance_mm: f64,
    target: Option<&ConstraintTarget>,
) -> Vec<Moment> {
    let length = |v: [f32; 3]| DVec3::from_array(v.map(f64::from)).length();
    let coupling = f64::from(ParameterId::CouplingStiffness.row().default);
    let first = recording.samples.first().map_or(0, |sample| sample.tick);
    let moment = |sample: &Telemetry| {
        let (_, pose) = sample.object.as_ref()?;
        let (deep, _, off) = depth(scene, scenario.depth.as_ref()?, &pose_mm(pose))?;
        let engagement = f64::from(sample.guidance.engagement);
        let pull_n = length(sample.guidance.wrench.force);
        let weight = match guided {
            Guided::Default => Some(engagement),
            Guided::Thesis if engagement == 0.0 => Some(0.0),
            Guided::Thesis => target
                .map(|target| off_target_mm(target, scene, sample))
                .filter(|&off| off > LEAST_OFF_MM)
                .map(|off| pull_n / (THESIS_SHARE * coupling * 1e-3 * off)),
        };
        Some(Moment {
            guided,
            clearance_mm,
            t_s: rounded(1e-3 * f64::from(sample.tick - first), 3),
            depth_mm: rounded(deep, 4),
            off_axis_mm: rounded(off, 5),
            handle_n: rounded(length(sample.wrench.force), 4),
            pull_n: rounded(pull_n, 4),
            engagement: rounded(engagement, 4),
            weight: weight.map(|weight| rounded(weight, 4)),
        })
    };
    (recording.samples.iter().step_by(KEPT_TICKS))
        .filter_map(moment)
        .collect()
}

/// Distance of the moving point from the fixed axis of a concentric target, mm: d of the thesis.
fn off_target_mm(target: &ConstraintTarget, scene: &PreparedScene, sample: &Telemetry) -> f64 {
    let vector = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
    let fixed = scene.report.parts[usize::from(target.static_part)].model_part;
    let placement = scene.model.parts[fixed].placement;
    let Some((_, pose)) = &sample.object else {
        return f64::NAN;
    };
    let axis = placement.transform_vector3(vector(target.fixed.direction));
    let from = pose_mm(pose).transform_point3(1e3 * vector(target.moving.point))
        - placement.transform_point3(1e3 * vector(target.fixed.point));
    from.reject_from_normalized(axis.normalize()).length()
}

/// Panels of one clearance, stacked: force on the handle, weight of the constraint, distance from the axis.
fn charts(courses: &[&Course]) -> Vec<Chart> {
    let clearance = courses.first().map_or(f64::NAN, |course| course.clearance_mm);
    type Quantity = fn(&Moment) -> Option<f64>;
    let panels: [(&str, Quantity, Option<&[f64]>); 3] = [
        ("force on handle, N", |m| Some(m.handle_n), None),
        ("weight of constraint", |m| m.weight, Some(&[0.0, 0.5, 1.0])),
        ("off the axis, mm", |m| Some(m.off_axis_mm), None),
    ];
    let last = panels.len() - 1;
    (panels.iter().enumerate())
        .map(|(i, (title, quantity, ticks))| {
            let y = Axis::new(*title).linear();
            Chart {
                title: if i == 0 {
                    format!("An insertion with {clearance} mm clearance, guided")
                } else {
                    String::new()
                },
                note: if i == last {
                    "Peg ø18.75 mm, hand 1 mm and 2° off with 0.2 mm tremor at 10 Hz. Weight: engagement; thesis: times its x, read off the force.".into()
                } else {
                    String::new()
                },
                x: Axis::new(if i == last { "time, s" } else { "" }).linear(),
                y: match ticks {
                    Some(ticks) => y.with_ticks(ticks),
                    None => y,
                },
                series: (courses.iter().zip([Look::BlueDisc, Look::VermilionSquare]))
                    .map(|(course, look)| Series {
                        name: if i == 0 { course.guided.name().into() } else { String::new() },
                        look,
                        line: Line::Trace,
                        points: (course.moments.iter())
                            .filter_map(|moment| {
                                Some(Point {
                                    x: moment.t_s,
                                    y: quantity(moment)?,
                                    ..Point::default()
                                })
                            })
                            .collect(),
                    })
                    .collect(),
            }
        })
        .collect()
}

/// Name of the chart of a clearance.
fn chart_name(clearance_mm: f64) -> String {
    format!("blend-{clearance_mm}mm")
}

impl Guided {
    fn name(self) -> &'static str {
        match self {
            Self::Default => "default guidance: stiff up to a cap of 3 N",
            Self::Thesis => "blend of the thesis (Faas 2010, eqs. 13–19)",
        }
    }
}

impl fmt::Display for Course {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} mm clearance, {}: ", self.clearance_mm, self.guided.name())?;
        match self.through_s {
            Some(after) => write!(f, "through after {after:.2} s")?,
            None => write!(f, "stuck {:.2} mm deep", self.depth_mm)?,
        }
        write!(
            f,
            "; at most {:.2} N, steps of {:.3} N and {:.2} mN m",
            self.peak_n, self.step_n, self.step_mnm
        )?;
        match self.off_axis_um {
            Some(off) => write!(f, "; settled, {off:.1} µm off the axis"),
            None => write!(f, "; guidance never settled"),
        }
    }
}

/// The experiment `blend`.
pub struct Blend;

impl Experiment for Blend {
    fn name(&self) -> &'static str {
        "blend"
    }

    fn about(&self) -> &'static str {
        "Show force and engagement over an insertion, the thesis' blend beside the default guidance"
    }

    fn quick(&self) -> &'static str {
        "the first clearance"
    }

    fn rows(&self) -> Vec<String> {
        ["blend"].map(String::from).into()
    }

    fn charts(&self) -> Vec<String> {
        CLEARANCES_MM.map(chart_name).into()
    }

    fn run(&self, form: Form<'_>, report: &mut Report<'_>) -> Result<Findings, LabError> {
        let courses = sweep(form.quick, &mut |course| report(course))?;
        let moments: Vec<&Moment> = courses.iter().flat_map(|course| &course.moments).collect();
        let mut findings = Findings::default().rows("blend", &moments)?;
        for clearance in CLEARANCES_MM {
            let of: Vec<&Course> = (courses.iter())
                .filter(|course| course.clearance_mm == clearance)
                .collect();
            if !of.is_empty() {
                findings = findings.stack(chart_name(clearance), charts(&of));
            }
        }
        Ok(findings)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The weight computed from the force is the thesis': with the cell as d₀ and the peg upright, x is at least ½ + ½e^(−d/d₀) where θ is small. At
    /// least k_T/(k_T + x·0.8·k_T), about half, of the hand's 1 mm offset remains.
    #[test]
    fn the_thesis_stays_off_and_the_default_does_not() {
        let courses = sweep(true, &mut |_| {}).expect("played");
        let [default, thesis] = &courses[..] else {
            panic!("{} courses", courses.len())
        };
        assert!(default.off_axis_um.expect("settled") < 5.0);
        assert!(thesis.off_axis_um.expect("settled") > 300.0);
        let mut weights = 0;
        for moment in &thesis.moments {
            let Some(weight) = moment.weight else { continue };
            assert!((0.0..=1.001).contains(&weight), "{moment:?}");
            if moment.engagement == 1.0 && moment.depth_mm > 5.0 {
                // e^(−d/d₀) of the offset that remains at this weight; θ adds at most as much again.
                let least = 0.5 * (-moment.off_axis_mm / CELL_MM).exp();
                assert!(weight > 0.8 * least, "{moment:?}, at least {least}");
                weights += 1;
            }
        }
        assert!(weights > 50, "{weights}");
    }
}
