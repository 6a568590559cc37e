//! Motions whose ticks are counted: a peg pressed to the wall of its hole and slid along it, and one moved where nothing is.

use std::ops::ControlFlow;

use mortise_bake::{BakeReport, Grabbable, bake};
use mortise_brep::load_step;
use mortise_protocol::parameter::ParameterId;
use mortise_rig::{Client, RigSpec};
use mortise_scenario::{Bounds, Key, Outcome, PreparedScene, Press, Scenario, ScenarioError, run_on};

use crate::error::LabError;
use crate::fit::Fit;
use crate::variant::Variant;

const PRESSED: &str = include_str!("../data/pressed.toml");

/// How long the press grows, s.
const PRESSED_S: f64 = 0.3;
/// Farthest it slides either way, mm.
const SLIDE_MM: f64 = 40.0;
/// A slide's shortest time either way, s.
const SLIDE_S: f64 = 0.25;
/// Slides.
const SLIDES: usize = 4;

/// Tilt of the peg on its rim, and how far the hand pushes on from where it touches: 2 N through 286 N/m.
const RIM_DEG: f64 = 10.0;
const RIM_PRESS_MM: f64 = 7.0;

/// What the peg does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion {
    /// In its hole, pulled to the wall with 5 N and slid along it at so many mm/s.
    Pressed {
        /// mm/s.
        mm_per_s: f64,
    },
    /// 20 mm and more above the block, moved at 100 mm/s.
    Free,
    /// Ten degrees tilted, set down with its lower rim on the block's top, 2 N, and slid along it: it touches at a point.
    Rim,
}

/// The fit, placed for a motion, and the motion's scenario; its STEP file is not yet named.
pub(crate) fn script(fit: &Fit, motion: Motion) -> Result<(Fit, Scenario), LabError> {
    let mut scenario = Scenario::parse(PRESSED, "pressed")?;
    let key = |t_s: f64, offset_mm: [f64; 3]| Key {
        t_s,
        offset_mm,
        turn_deg: [0.0; 3],
        push_n: [0.0; 3],
    };
    match motion {
        Motion::Pressed { mm_per_s } => {
            // As far out below as above, so that both rims press the peg's side.
            let over = 0.5 * (fit.length_mm - fit.height_mm);
            let fit = fit.engaged(fit.height_mm + over);
            scenario.hand.grip_mm = [0.0, 0.0, -0.5 * fit.height_mm];
            let (gap, press) = (0.5 * fit.clearance_mm(), scenario.hand.keyframes[1].offset_mm[0]);
            // Both rims stay at the peg's side, whichever way.
            let slide = (mm_per_s * SLIDE_S).min(SLIDE_MM).min(0.8 * over);
            // To the wall no faster than along it.
            let mut t = (gap / mm_per_s).max(0.01);
            scenario.hand.keyframes.truncate(1);
            scenario.hand.keyframes.push(key(t, [gap, 0.0, 0.0]));
            t += PRESSED_S;
            scenario.hand.keyframes.push(key(t, [gap + press, 0.0, 0.0]));
            for i in 0..SLIDES {
                let z = if i % 2 == 0 { slide } else { -slide };
                // The first slide is half as long as the others.
                t += if i == 0 { slide } else { 2.0 * slide } / mm_per_s;
                (scenario.hand.keyframes).push(key(t, [gap + press, 0.0, z]));
            }
            scenario.run.duration_s = t + 0.2;
            Ok((fit, scenario))
        }
        Motion::Rim => {
            let fit = fit.engaged(-5.0);
            scenario.hand.grip_mm = [0.0, 0.0, 5.0 + 0.5 * fit.length_mm];
            // Outwards along the diagonal, where the top is whole, and lowest there.
            let over = |t: f64, aside: f64, z: f64| Key {
                turn_deg: [-RIM_DEG / f64::sqrt(2.0), RIM_DEG / f64::sqrt(2.0), 0.0],
                ..key(t, [aside, aside, z])
            };
            let (sin, cos) = RIM_DEG.to_radians().sin_cos();
            let lowest = 5.0 + 0.5 * fit.length_mm * (1.0 - cos) - 0.5 * fit.peg_mm * sin;
            scenario.hand.keyframes = vec![
                key(0.0, [0.0; 3]),
                over(0.3, 14.0, 0.0),
                over(0.6, 14.0, -lowest - RIM_PRESS_MM),
                over(0.9, 11.0, -lowest - RIM_PRESS_MM),
                over(1.2, 14.0, -lowest - RIM_PRESS_MM),
            ];
            scenario.run.duration_s = 1.4;
            scenario.press = Some(Press {
                direction: [0.0, 0.0, -1.0],
            });
            let felt = Bounds {
                min: 1.0,
                max: 3.0,
                only_on: None,
            };
            scenario.holds.insert("press_hand_n".into(), felt);
            Ok((fit, scenario))
        }
        Motion::Free => {
            let fit = fit.engaged(-20.0);
            scenario.hand.grip_mm = [0.0, 0.0, 20.0 + 0.5 * fit.length_mm];
            scenario.hand.keyframes = [
                (0.0, [0.0, 0.0, 0.0]),
                (0.3, [30.0, 0.0, 0.0]),
                (0.6, [30.0, 30.0, 0.0]),
                (0.9, [0.0, 30.0, 20.0]),
                (1.2, [0.0, 0.0, 0.0]),
            ]
            .map(|(t, offset)| key(t, offset))
            .to_vec();
            scenario.run.duration_s = 1.3;
            scenario.press = None;
            scenario.holds.remove("press_hand_n");
            Ok((fit, scenario))
        }
    }
}

/// Plays `motion` on the rig `spec`, with look-ups for at most `point_budget` points a tick if that is said. What the scenario itself asks (it does
/// press; no tick is missed) is the caller's to look at: the second of what is given says what did not hold.
///
/// # Errors
/// Anything that keeps it from being played, a fault of the board too.
pub fn play(
    variant: &Variant,
    fit: &Fit,
    motion: Motion,
    point_budget: Option<f32>,
    spec: &RigSpec,
) -> Result<(Outcome, Vec<String>), LabError> {
    let (fit, mut scenario) = script(fit, motion)?;
    let budget = point_budget.map(|budget| (ParameterId::PointBudget.row().name.to_owned(), budget));
    scenario.parameters.extend(budget);
    let file = fit.file()?;
    scenario.scene.step = file.path().to_owned();
    let options = variant.options(Grabbable::Named(vec![scenario.scene.part.clone()]));
    let scene = PreparedScene::with(&scenario, &options)?;
    let outcome = run_on(&Client::connect(&spec.lockstep())?, &scenario, &scene)?;
    let broken = (outcome.verdicts(&scenario.holds).iter())
        .filter(|verdict| !verdict.holds)
        .map(ToString::to_string)
        .collect();
    Ok((outcome, broken))
}

/// What baking a fit makes.
///
/// # Errors
/// As [`play`], but nothing is played.
pub fn report(variant: &Variant, fit: &Fit) -> Result<BakeReport, LabError> {
    let file = fit.file()?;
    let model = load_step(file.path())?;
    let options = variant.options(Grabbable::Named(vec!["peg".into()]));
    let baked =
        bake(&model, &options, &|_| ControlFlow::Continue(())).map_err(|source| ScenarioError::Bake {
            step: file.path().display().to_string(),
            source,
        })?;
    Ok(baked.report)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Press and slide do what their names say: the peg stays in the hole, at the wall, and a force is felt; free of it, nothing is.
    #[test]
    fn pressed_is_at_the_wall_and_free_is_nowhere() {
        let simulated = RigSpec::Simulated { realtime: false };
        let played = |fit: Fit, motion| {
            let (outcome, broken) =
                play(&Variant::field(1.0), &fit, motion, None, &simulated).expect("played");
            assert_eq!(broken, [""; 0]);
            outcome
        };
        let pressed = played(Fit::thesis(0.5), Motion::Pressed { mm_per_s: 10.0 });
        assert!((4.5..5.5).contains(&pressed.press_hand_n.expect("measured")));
        assert!(pressed.board_penetration_mm > 0.0);
        let rim = played(Fit::thesis(0.5), Motion::Rim);
        assert!((1.5..2.5).contains(&rim.press_hand_n.expect("measured")));
        assert!(rim.board_penetration_mm > 0.0);
        let free = played(Fit::thesis(0.5), Motion::Free);
        assert_eq!((free.board_penetration_mm, free.penetration_mm), (0.0, 0.0));
    }
}
