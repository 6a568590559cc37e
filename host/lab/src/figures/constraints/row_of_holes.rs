//! A row of equal holes: a pin carried above it is pulled into none, whether targets engage on contact or near, and goes into the one it touches.

use mortise_guide::{GuideSettings, When};
use mortise_protocol::message::Telemetry;
use mortise_scenario::{Depth, Key, PreparedScene, Scenario};

use crate::LabError;
use crate::figures::Row;
use crate::guided::{SIM, file, key, play, play_with, script};

/// Plate of 15 mm with ten holes of 8.05 mm, 16 mm apart, three of them occupied, and a free pin of 8 × 30 mm.
const STEP: &str = include_str!("../../../data/fixture_row.step");
/// Positions of the three pins, as written in the file.
const TAKEN_X: [&str; 3] = ["-40.", "-24.", "40."];
/// Start of the free pin along the row, and height of its middle, mm.
const START_X: f64 = 15.9;
const START_Z: f64 = 55.0;
/// Height of its middle when its end is on the plate, mm.
const LANDED_Z: f64 = 30.0;
/// Positions of all holes, mm.
const HOLES_X: [f64; 10] = [-72.0, -56.0, -40.0, -24.0, -8.0, 8.0, 24.0, 40.0, 56.0, 72.0];
/// Heights at which the pin is carried, mm: nearer than the distance at which targets engage near, and farther.
const ABOVE_MM: [f64; 2] = [1.0, 2.5];
/// Unoccupied stretches of the row, mm.
const SPANS_X: [(f64, f64); 3] = [(-16.0, 32.0), (-80.0, -48.0), (48.0, 80.0)];

fn prepared(step: &str) -> Result<(Scenario, PreparedScene), LabError> {
    let file = file(step)?;
    let mut scenario = script(file.path())?;
    scenario.scene.part = "pin-free".into();
    scenario.hand.grip_mm = [START_X, 0.0, START_Z];
    scenario.depth = None;
    let scene = PreparedScene::of(&scenario)?;
    Ok((scenario, scene))
}

/// The same plate with those three pins 200 mm above their holes, out of the way.
fn emptied() -> String {
    TAKEN_X.iter().fold(STEP.to_owned(), |text, x| {
        text.replace(&format!("({x},0.,0.5)"), &format!("({x},0.,200.5)"))
    })
}

/// Keyframe at a position along the row and a height above that at which the pin's end meets the plate.
fn at(t_s: f64, x: f64, above: f64) -> Key {
    key(t_s, [x - START_X, 0.0, LANDED_Z + above - START_Z], [0.0; 3])
}

/// Measures both rows.
pub(super) fn measure(out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let (mut scenario, scene) = prepared(STEP)?;
    for when in When::ALL {
        for above in ABOVE_MM {
            carried(&mut scenario, &scene, when, above, out)?;
        }
    }
    let (mut scenario, scene) = prepared(&emptied())?;
    inserted(&mut scenario, &scene, out)
}

fn carried(
    scenario: &mut Scenario,
    scene: &PreparedScene,
    when: When,
    above: f64,
    out: &mut dyn FnMut(Row),
) -> Result<(), LabError> {
    let (mut pulled, mut heard, mut lowest) = (0, 0, f64::INFINITY);
    for (from, to) in SPANS_X {
        // Passes the standing pins at 25 mm, and the free holes at the height under test.
        scenario.hand.keyframes = vec![
            at(0.0, START_X, 25.0),
            at(0.8, from, 25.0),
            at(1.6, from, above + 2.0),
            at(2.0, from, above),
            at(3.0, to, above),
        ];
        scenario.run.duration_s = 3.2;
        let settings = GuideSettings {
            when,
            ..GuideSettings::default()
        };
        let mut guide = scene.guide(settings);
        let samples = play_with(scenario, scene, &SIM, &mut guide)?.samples;
        heard += samples.len();
        pulled += (samples.iter())
            .filter(|sample| sample.guidance.engagement > 0.0)
            .count();
        lowest = (samples.iter().filter_map(|sample| sample.object.as_ref()))
            .map(|(_, pose)| 1e3 * f64::from(pose.position[2]))
            .fold(lowest, f64::min);
    }
    let what = |what: &str| {
        format!(
            "pin carried {above} mm above the free holes of a row of {}, targets taken up {}: {what}",
            HOLES_X.len(),
            when.name()
        )
    };
    let pulls = what("samples in which a target pulled");
    // Below the engagement distance the pin should be aligned with each hole that it passes, but must not be drawn into one.
    out(
        if when == When::Near && above < GuideSettings::default().approach_mm {
            Row::reported(pulls, pulled as f64, &format!("of {heard}"))
        } else {
            Row::exactly(pulls, pulled as f64, &format!("of {heard}"), 0.0)
        },
    );
    out(Row::within(
        what("lowest height of its end over the plate"),
        lowest - 15.0,
        "mm",
        // 0.2 mm of tremor plus the spring's lag.
        above - 0.3,
        above,
    ));
    Ok(())
}

fn inserted(
    scenario: &mut Scenario,
    scene: &PreparedScene,
    out: &mut dyn FnMut(Row),
) -> Result<(), LabError> {
    let mut right = 0;
    for (attempt, x) in HOLES_X.into_iter().enumerate() {
        let side = if attempt % 2 == 0 { 1.0 } else { -1.0 };
        let tilted = |t, above| Key {
            turn_deg: [0.0, 2.0 * side, 0.0],
            ..at(t, x + side, above)
        };
        scenario.hand.keyframes = vec![
            at(0.0, START_X, 25.0),
            tilted(0.4, 25.0),
            tilted(0.6, 3.0),
            tilted(1.8, -13.0),
        ];
        scenario.run.duration_s = 2.2;
        scenario.depth = Some(Depth {
            fixed: "fixture-plate".into(),
            axis: [0.0, 0.0, -1.0],
            through_mm: [x, 0.0, 0.0],
        });
        let recording = play(scenario, scene, &SIM)?;
        let in_it = recording.outcome.inserted_mm.unwrap_or(f64::NAN) > 12.0;
        let on_axis = recording.outcome.lateral_mm.unwrap_or(f64::NAN) < 0.01;
        let engaged = recording
            .samples
            .iter()
            .any(|sample: &Telemetry| sample.guidance.engagement == 1.0);
        if !(in_it && on_axis && engaged) {
            eprintln!(
                "hole at {x} mm: {:?} mm in, {:?} mm off",
                recording.outcome.inserted_mm, recording.outcome.lateral_mm
            );
        }
        right += u32::from(in_it && on_axis && engaged);
    }
    out(Row::exactly(
        "the same pin set down 1 mm and 2° off on each hole of the row, all of them free, in-process: in that hole, on its axis",
        f64::from(right),
        &format!("of {}", HOLES_X.len()),
        HOLES_X.len() as f64,
    ));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_hole_of_the_emptied_row_is_free() {
        let file = file(&emptied()).expect("a temporary file");
        let model = mortise_brep::load_step(file.path()).expect("sound");
        let standing = model
            .parts
            .iter()
            .filter(|part| part.name.starts_with("pin-in-hole"));
        let heights: Vec<f64> = standing.map(|part| part.placement.translation.z).collect();
        assert_eq!(heights, [200.5; 3]);
    }
}
