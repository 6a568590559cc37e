//! Motions whose ticks are measured: a peg pressed to the wall of its hole and slid along it, and one moved in free air.

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

/// Time in which the press force grows, s.
const PRESSED_S: f64 = 0.3;
/// Largest slide in either direction, mm.
const SLIDE_MM: f64 = 40.0;
/// Shortest time of a slide in one direction, s.
const SLIDE_S: f64 = 0.25;
/// Number of slides.
const SLIDES: usize = 4;

/// Tilt of the peg on its rim, degrees, and how far the hand pushes on from first contact: 2 N through 286 N/m.
const RIM_DEG: f64 = 10.0;
const RIM_PRESS_MM: f64 = 7.0;

/// Motion of the peg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion {
    /// In its hole, pulled to the wall with 5 N and slid along it.
    Pressed {
        /// Speed of the slide, mm/s.
        mm_per_s: f64,
    },
    /// 20 mm and more above the block, moved at 100 mm/s.
    Free,
    /// Tilted by ten degrees, its lower rim set down on the block's top with 2 N and slid along it: contact at one point.
    Rim,
}

/// The fit, placed for a motion, and the motion's scenario, whose STEP file is not yet set.
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
            // Extends as far below the block as above, so that both rims press the peg's side.
            let over = 0.5 * (fit.length_mm - fit.height_mm);
            let fit = fit.engaged(fit.height_mm + over);
            scenario.hand.grip_mm = [0.0, 0.0, -0.5 * fit.height_mm];
            let (gap, press) = (0.5 * fit.clearance_mm(), scenario.hand.keyframes[1].offset_mm[0]);
            // Both rims stay at the peg's side in both directions.
            let slide = (mm_per_s * SLIDE_S).min(SLIDE_MM).min(0.8 * over);
            // The approach to the wall is no faster than the slide.
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
            // Outwards along the diagonal, where the top has no hole, and lowest there.
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

/// Plays `motion` on the rig `spec`, with field queries for at most `point_budget` points a tick if it is given. The caller must check the scenario's
/// own conditions (the peg presses, no tick is missed): the second returned value describes those that failed.
///
/// # Errors
/// Anything that prevents the motion from being played, including a fault of the board.
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

/// Report on baking a fit.
///
/// # Errors
/// As [`play`], except that nothing is played.
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

    /// Checks that the motions match their names: pressed, the peg stays in the hole, at the wall, with a force on the handle; free, there is no
    /// force.
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
