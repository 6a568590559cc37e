//! Jamming and wedging: how far to the side a hand may push a peg that still goes in. Contact here has no friction.
//!
//! A peg of diameter d stands l deep in a hole of diameter D, leans, and touches twice: its side at the hole's rim, its tip's edge at the opposite
//! wall. A hand pushes a point on its axis sideways with F_x and in with F_z and leaves it free to turn. References, both for a rigid peg in the
//! plane of the tilt:
//!
//! * with dry friction μ at the walls it **jams** where F_x/F_z > 1/(μ·(1 + 2·(h − μ·d/2)/l)), h the height of the push above the rim: two-point
//!   contact of the classical diagram, F_x/F_z against M/(r·F_z) with λ = l/(2·r·μ), for this push (D. E. Whitney, *Quasi-static assembly of
//!   compliantly supported rigid parts*, J. Dyn. Sys. Meas. Control 104(1), 1982);
//! * without friction the work of the push decides: D·cos θ − l·sin θ = d relates depth to tilt, and the peg goes in where F_z·dz > F_x·dx. With a
//!   wide gap even a frictionless peg is pushed out by a hand that tilts it.
//!
//! **Wedging**, two-point contact that holds without a push, needs μ > l/d. Contact here has no friction, so a peg must come out again however it was
//! pushed in.

use mortise_bake::Grabbable;
use mortise_protocol::message::{HandScript, Keyframe, ToDevice, WirePose};
use mortise_protocol::parameter::ParameterId;
use mortise_rig::{Client, Event, RigSpec};
use mortise_scenario::measure::depth;
use mortise_scenario::wire::pose_mm;
use mortise_scenario::{Depth, PreparedScene, Scenario};
use serde::Serialize;

use super::oracle::{COARSE, limit};
use crate::chart::{Axis, Chart, Line, Look, Point, Series};
use crate::error::LabError;
use crate::fit::Fit;
use crate::variant::Variant;

/// Diametral clearances, mm; 0 is an exact fit.
const CLEARANCES_MM: [f64; 8] = [1.0, 0.7, 0.5, 0.3, 0.2, 0.1, 0.02, 0.0];
/// Position of an exact fit on the logarithmic axis, mm.
const EXACT_AT_MM: f64 = 0.005;
/// Depth of the peg at the start, mm, and the change of depth that counts as going in or coming out.
const ENGAGED_MM: f64 = 10.0;
const MOVED_MM: f64 = 3.0;
/// Height of the push above the block, mm.
const HEIGHT_MM: f64 = 40.0;
/// Magnitude of the push, N.
const PUSH_N: f64 = 2.0;
/// Smallest and largest F_x/F_z tried.
const LEAST: f64 = 0.05;
const MOST: f64 = 10.0;
/// Friction coefficients of the reference lines.
const FRICTIONS: [f64; 3] = [0.05, 0.1, 0.3];
/// Contact stiffness, N/m: high, because the reference's peg is rigid.
const STIFFNESS_N_PER_M: f32 = 2e6;
/// Damping of the hand, N s/m and N m s/rad: it lets the peg move at 0.1 m/s.
const DAMPING: f32 = 20.0;
const ANGULAR_DAMPING: f32 = 0.02;
/// Stiffness of the spring that holds the handle while the part is grabbed, N/m, and how long it holds, ticks.
const HOLD_N_PER_M: f32 = 2000.0;
const HOLD_TICKS: u32 = 600;
/// Lean beyond two-point contact during that hold, mm: 0.3 N through the hold and the coupling in series.
const LEAN_MM: f64 = 0.5;
/// Duration of the push, s.
const LAST_S: f64 = 1.0;
/// Duration of the push in the wedging test, s, which leaves the peg in the hole, and force of the pull that follows, N.
const WEDGE_S: f64 = 0.25;
const PULL_N: f64 = 0.2;

/// Models of the scene.
const METHODS: [(&str, Variant); 2] = [
    ("field (ours)", Variant::board(0.5)),
    ("voxmap 0.5 mm (textbook)", Variant::textbook(0.5)),
];

/// Result at one clearance.
#[derive(Clone, Debug, Serialize)]
pub struct Push {
    /// Model of the scene.
    pub method: &'static str,
    /// Hole's diameter minus the peg's, mm.
    pub clearance_mm: f64,
    /// Largest F_x/F_z at which it goes in; 0: not even with a straight push.
    pub experiment: f64,
    /// Limit without friction, by work; not drawn above the largest ratio tried.
    pub slippery: f64,
    /// Limit with friction 0.1, beyond which it jams.
    pub friction_0_1: f64,
    /// True if the peg comes out again when pulled after being pushed down and sideways alike: it does not wedge.
    pub comes_out: bool,
}

impl std::fmt::Display for Push {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{}, clearance {} mm: goes in up to F_x/F_z = {:.2} (slippery {:.2}, μ = 0.1 {:.2}), {}",
            self.method,
            self.clearance_mm,
            self.experiment,
            self.slippery,
            self.friction_0_1,
            if self.comes_out { "comes out" } else { "wedged" }
        )
    }
}

/// F_x/F_z beyond which a peg jams; depth, height of the push above the rim, and diameter in one unit.
pub fn jams_beyond(friction: f64, depth: f64, height: f64, diameter: f64) -> f64 {
    1.0 / (friction * (1.0 + 2.0 * (height - 0.5 * friction * diameter) / depth))
}

/// Tilt of a peg in two-point contact at `depth`, rad: D·cos θ − l·sin θ = d.
fn tilt(hole: f64, peg: f64, depth: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if hole * f64::cos(middle) - depth * f64::sin(middle) > peg {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// Distance of the push from the hole's axis at that tilt, found from the wall at which the tip's edge touches.
fn aside(hole: f64, peg: f64, depth: f64, height: f64) -> f64 {
    let (sin, cos) = tilt(hole, peg, depth).sin_cos();
    -0.5 * hole + 0.5 * peg * cos + (depth + height) * sin
}

/// F_x/F_z beyond which a frictionless peg is pushed out; diameters, depth, and height of the push above the rim in one unit.
pub fn pushed_out_beyond(hole: f64, peg: f64, depth: f64, height: f64) -> f64 {
    if hole <= peg {
        return f64::INFINITY;
    }
    let (sin, cos) = tilt(hole, peg, depth).sin_cos();
    // Distance from the tip's centre to the push, along the axis.
    let arm = depth + height;
    let deeper = -hole - depth * cos / sin;
    let down = -deeper - 0.5 * peg * cos - arm * sin;
    let aside = -0.5 * peg * sin + arm * cos;
    down / aside
}

/// A peg in its hole with a hand above it.
struct Stage {
    scene: PreparedScene,
    depth: Depth,
}

impl Stage {
    fn new(variant: &Variant, fit: &Fit) -> Result<Self, LabError> {
        let file = fit.file()?;
        let scenario = Scenario::insertion(file.path())?;
        let options = variant.options(Grabbable::Named(vec![scenario.scene.part.clone()]));
        Ok(Self {
            scene: PreparedScene::with(&scenario, &options)?,
            depth: Depth {
                fixed: "block".into(),
                axis: [0.0, 0.0, -1.0],
                through_mm: [0.0; 3],
            },
        })
    }

    /// Depth of the peg, mm, after it has been leant by `aside_mm` and then pushed (duration, s, and force, N, of each push); `None` when it took the
    /// handle out of the workspace.
    fn pushed(&self, aside_mm: f64, pushes: &[(f64, [f64; 3])]) -> Result<Option<f64>, LabError> {
        let client = Client::connect(&RigSpec::Simulated { realtime: false })?;
        client.upload(&self.scene.image, &mut |_| {})?;
        let id = ParameterId::ContactStiffness;
        client.request(ToDevice::SetParameter {
            id,
            value: STIFFNESS_N_PER_M,
        })?;
        // Held and leant at first, then only pushed and damped.
        let held = |x_mm| ToDevice::SimulatedHand(hand(HOLD_N_PER_M, x_mm, &[(0.0, [0.0; 3])]));
        client.request(held(0.0))?;
        client.run(HOLD_TICKS)?;
        client.request(ToDevice::Arm)?;
        client.request(ToDevice::Grab {
            part: self.scene.part,
        })?;
        client.request(held(aside_mm))?;
        client.run(HOLD_TICKS)?;
        client.request(ToDevice::SetTelemetry { every_ticks: 50 })?;
        let (mut keys, mut t) = (Vec::new(), 0.0);
        for &(last, push) in pushes {
            keys.push((t, push));
            t += last;
            keys.push((t - 0.01, push));
        }
        client.request(ToDevice::SimulatedHand(hand(0.0, 0.0, &keys)))?;
        let mut last = None;
        let mut left = (1e3 * t) as u32;
        while left > 0 {
            let batch = left.min(500);
            client.run(batch)?;
            left -= batch;
            for event in client.events().try_iter() {
                match event {
                    Event::Telemetry(sample) => last = Some(sample),
                    Event::Fault { .. } => return Ok(None),
                    _ => {}
                }
            }
        }
        let pose = last.and_then(|sample| sample.object.map(|(_, pose)| pose_mm(&pose)));
        Ok(pose.and_then(|pose| depth(&self.scene, &self.depth, &pose).map(|(deep, ..)| deep)))
    }
}

/// A hand at the height of the push, offset by `aside_mm`, with a spring of `stiffness` N/m and pushes, N, at times, s.
fn hand(stiffness: f32, aside_mm: f64, pushes: &[(f64, [f64; 3])]) -> HandScript {
    HandScript {
        stiffness,
        damping: DAMPING,
        angular_stiffness: 0.0,
        angular_damping: ANGULAR_DAMPING,
        tremor: 0.0,
        tremor_hz: 0.0,
        // At most four keyframes.
        keyframes: (pushes.iter())
            .map(|&(t, push)| Keyframe {
                tick: (1e3 * t) as u32,
                pose: WirePose {
                    position: [1e-3 * aside_mm as f32, 0.0, 1e-3 * HEIGHT_MM as f32],
                    orientation: [0.0, 0.0, 0.0, 1.0],
                },
                push: push.map(|n| n as f32),
            })
            .collect(),
    }
}

/// Plays all clearances; passes each result to `out`.
///
/// # Errors
/// Anything that prevents a push from being played.
pub fn sweep(quick: bool, out: &mut dyn FnMut(&Push)) -> Result<Vec<Push>, LabError> {
    let mut found = Vec::new();
    for (method, variant) in METHODS {
        let clearances = if quick {
            &CLEARANCES_MM[..2]
        } else {
            &CLEARANCES_MM[..]
        };
        for &clearance_mm in clearances {
            let push = measure(method, &variant, clearance_mm)?;
            out(&push);
            found.push(push);
        }
    }
    Ok(found)
}

fn measure(method: &'static str, variant: &Variant, clearance_mm: f64) -> Result<Push, LabError> {
    let fit = Fit::thesis(clearance_mm).engaged(ENGAGED_MM);
    let stage = Stage::new(variant, &fit)?;
    let askew = |ratio: f64| {
        let down = PUSH_N / f64::hypot(1.0, ratio);
        [ratio * down, 0.0, -down]
    };
    let leant = aside(fit.hole_mm, fit.peg_mm, ENGAGED_MM, HEIGHT_MM) + LEAN_MM;
    let mut failed = None;
    let experiment = limit(LEAST, MOST, COARSE, |ratio| {
        match stage.pushed(leant, &[(LAST_S, askew(ratio))]) {
            Ok(depth) => depth.is_some_and(|depth| depth > ENGAGED_MM + MOVED_MM),
            Err(error) => {
                failed.get_or_insert(error);
                false
            }
        }
    });
    if let Some(error) = failed {
        return Err(error);
    }
    // Sideways and in alike, then out; leaving the workspace counts as out of the hole.
    let wedge = [(WEDGE_S, askew(1.0)), (LAST_S, [0.0, 0.0, PULL_N])];
    let before = stage.pushed(leant, &wedge[..1])?;
    let after = stage.pushed(leant, &wedge)?;
    let comes_out = (before.zip(after)).is_none_or(|(before, after)| after < before - MOVED_MM);
    Ok(Push {
        method,
        clearance_mm,
        experiment,
        slippery: pushed_out_beyond(fit.hole_mm, fit.peg_mm, ENGAGED_MM, HEIGHT_MM),
        friction_0_1: jams_beyond(0.1, ENGAGED_MM, HEIGHT_MM, fit.peg_mm),
        comes_out,
    })
}

/// Largest ratio over the clearance.
pub fn chart(found: &[Push]) -> Chart {
    const LINE_POINTS: u32 = 80;
    let drawn = |clearance: f64| clearance.max(EXACT_AT_MM);
    let mut series: Vec<Series> = (METHODS.iter().zip([Look::BlueDisc, Look::VermilionSquare]))
        .map(|((method, _), look)| Series {
            name: (*method).into(),
            look,
            line: Line::None,
            points: (found.iter().filter(|push| push.method == *method))
                .map(|push| Point {
                    x: drawn(push.clearance_mm),
                    y: push.experiment.max(LEAST),
                    label: match (push.experiment > 0.0, push.comes_out) {
                        (false, _) => "stuck".into(),
                        (true, false) => "wedged".into(),
                        (true, true) => String::new(),
                    },
                    at_least: push.experiment >= MOST,
                })
                .collect(),
        })
        .collect();
    let (least, most) = (EXACT_AT_MM, CLEARANCES_MM[0]);
    let line = |name: String, line: Line, at: &dyn Fn(f64) -> f64| Series {
        name,
        look: Look::Black,
        line,
        points: (0..LINE_POINTS)
            .map(|i| least * (most / least).powf(f64::from(i) / f64::from(LINE_POINTS - 1)))
            .map(|x| Point {
                x,
                y: at(x),
                ..Point::default()
            })
            .filter(|point| point.y <= MOST)
            .collect(),
    };
    let fit = Fit::thesis(0.0);
    series.push(line(
        "without friction, by work".into(),
        Line::Trace,
        &|clearance| pushed_out_beyond(fit.hole_mm, fit.hole_mm - clearance, ENGAGED_MM, HEIGHT_MM),
    ));
    let names = ["jams with friction 0.05, 0.1, 0.3 (Whitney)", "", ""];
    for (friction, name) in FRICTIONS.into_iter().zip(names) {
        series.push(line(name.into(), Line::DashedTrace, &|_| {
            jams_beyond(friction, ENGAGED_MM, HEIGHT_MM, fit.hole_mm)
        }));
    }
    Chart {
        title: "How far to the side a peg may be pushed and still goes in".into(),
        note: "Peg ø18.75 mm, 10 mm deep, pushed with 2 N 40 mm above the rim, free to turn; contact has no friction. Arrows: at the largest ratio tried. Leftmost: exact fit.".into(),
        x: Axis::new("diametral clearance, mm"),
        y: Axis::new("largest force sideways over force in"),
        series,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The closed form is a point of the classical diagram: M/(r·F_z) = λ + μ·(1 + λ)·F_x/F_z at the tip, λ = l/(2·r·μ), for M = F_x·(h + l).
    #[test]
    fn the_jam_limit_lies_on_the_classical_diagram() {
        for (friction, depth, height, diameter) in [(0.1, 10.0, 40.0, 18.75), (0.3, 20.0, 30.0, 10.0)] {
            let ratio = jams_beyond(friction, depth, height, diameter);
            let radius = 0.5 * diameter;
            let lambda = depth / (2.0 * radius * friction);
            let moment = ratio * (height + depth) / radius;
            let line = lambda + friction * (1.0 + lambda) * ratio;
            assert!((moment / line - 1.0).abs() < 1e-12, "{moment} {line}");
        }
    }

    /// To first order in the clearance c the tilt is c/l, and the push, h + l from the tip, moves back by (h + l)·c/l² per step of depth.
    #[test]
    fn a_slippery_peg_is_pushed_out_by_leverage_alone() {
        let (hole, clearance, depth, height) = (18.75, 1e-3, 10.0, 40.0);
        let ratio = pushed_out_beyond(hole, hole - clearance, depth, height);
        let first_order = depth * depth / (clearance * (height + depth));
        assert!((ratio / first_order - 1.0).abs() < 2e-3, "{ratio} {first_order}");
    }

    /// Mortise's peg goes in where the rigid, frictionless peg does, comes out again, and is independent of how tight the fit is.
    #[test]
    fn the_product_follows_the_slippery_peg() {
        let push = measure(METHODS[0].0, &METHODS[0].1, 1.0).expect("played");
        println!("{push}");
        assert!((push.experiment / push.slippery - 1.0).abs() < 0.1, "{push}");
        assert!(push.comes_out);
    }
}
