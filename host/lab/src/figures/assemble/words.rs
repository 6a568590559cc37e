//! The motor of 18 parts taken apart and put together by instructions in words.

use std::path::Path;
use std::time::Instant;

use glam::{DAffine3, DVec3};
use mortise_words::{Outcome, Session};

use super::refused;
use crate::LabError;
use crate::figures::Row;

const MOTOR: &str = "05_motor/motor_flat.step";
/// Instructions: everything apart, and together again.
const SCRIPT: &[&str] = &[
    "unscrew all four screws",
    "take off the rear cover",
    "remove the rear bearing",
    "remove the seal",
    "take off the front cover",
    "remove the front bearing",
    "take the stator out of the body",
    "remove the front rotor",
    "remove the magnets",
    "remove the rear rotor",
    "put the rear rotor onto the axle",
    "put the magnets onto the rear rotor",
    "put the front rotor onto the axle",
    "put the stator into the body",
    "put the front bearing onto the axle",
    "put the front cover onto the body",
    "push the seal into the front cover",
    "put the rear bearing onto the axle",
    "put the rear cover onto the body",
    "put all four screws into the rear cover",
];
/// Largest distance of a part from its designed place, µm, and longest step, ms.
const OFF_UM: f64 = 1.0;
const STEP_MS: f64 = 100.0;
/// Points of a part whose places are compared, mm from its origin.
const LEVER_MM: f64 = 50.0;

pub(super) fn measure(cad: &Path, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let file = cad.join(MOTOR);
    let model = mortise_brep::load_step(&file)?;
    let designed: Vec<DAffine3> = model.parts.iter().map(|part| part.placement).collect();
    let mut session = Session::new(model).map_err(|error| refused(&file, &error))?;
    let (mut done, mut longest, mut farthest_apart) = (0, 0.0f64, 0.0f64);
    for instruction in SCRIPT {
        let start = Instant::now();
        let turn = session.say(instruction);
        let acts = turn.acts.len().max(1) as f64;
        let ms = 1e3 * start.elapsed().as_secs_f64() / acts;
        longest = longest.max(ms);
        eprintln!("{instruction}: {:?}, {ms:.0} ms an act", turn.outcome);
        if turn.outcome == Outcome::Done {
            done += 1;
        } else {
            eprintln!("{:?}", turn.reason);
        }
        farthest_apart = farthest_apart.max(off_mm(&session, &designed));
    }
    let what = |what: &str| {
        format!(
            "motor of {} parts apart and together by words: {what}",
            designed.len()
        )
    };
    out(Row::exactly(
        what("instructions done"),
        f64::from(done),
        "instructions",
        SCRIPT.len() as f64,
    ));
    out(Row::within(
        what("farthest of a part from its designed place on the way"),
        farthest_apart,
        "mm",
        LEVER_MM,
        f64::INFINITY,
    ));
    out(Row::at_most(
        what("farthest of a part from its designed place at the end"),
        1e3 * off_mm(&session, &designed),
        "µm",
        OFF_UM,
    ));
    out(Row::at_most(what("longest act"), longest, "ms", STEP_MS).varies());
    Ok(())
}

/// Farthest of any part from its designed place, mm, against the body.
fn off_mm(session: &Session, designed: &[DAffine3]) -> f64 {
    let base = session
        .parts()
        .iter()
        .position(|part| part.name == "body")
        .unwrap_or(0);
    let back = designed[base] * session.parts()[base].placement.inverse();
    let points = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    (session.parts().iter().zip(designed))
        .flat_map(|(part, wanted)| {
            let now = back * part.placement;
            points.map(|p| {
                let p = LEVER_MM * p;
                now.transform_point3(p).distance(wanted.transform_point3(p))
            })
        })
        .fold(0.0, f64::max)
}
