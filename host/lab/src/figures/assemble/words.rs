//! The motor of 18 parts taken apart and put together by instructions in words, and put together from the file that shows its parts scattered.

use std::io::Write as _;
use std::path::Path;
use std::time::Instant;

use glam::{DAffine3, DVec3};
use mortise_brep::{LoadOptions, Part};
use mortise_words::{Outcome, Session};

use super::assembly_file::refused;
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
/// The same parts scattered, and instructions that put them together: by amounts where no surface states how far.
const SCATTERED: &str = "05_motor/motor_exploded.step";
const TOGETHER: &[&str] = &[
    "insert the stator into the body",
    "insert the rear bearing into the rear cover",
    "put the rear cover onto the body",
    "put the rear rotor onto the axle",
    "move the rear rotor down by 8.5 mm",
    "put the magnets onto the rear rotor",
    "put the front rotor onto the axle from above",
    "insert the front bearing into the front cover",
    "pull the front bearing out by 1 mm",
    "insert the seal into the front cover",
    "pull the seal out by 1 mm",
    "insert the axle into the front bearing from below",
    "put the front cover onto the body",
    "put all four screws into the front cover",
];
/// After [`SCRIPT`]'s first half, which takes everything off the axle: together again, in another order.
const TOGETHER_AGAIN: &[&str] = &[
    "put the rear rotor onto the axle",
    "move the rear rotor down by 8.5 mm",
    "put the magnets onto the rear rotor",
    "put the front rotor onto the axle from above",
    "insert the stator into the body",
    "put the front bearing onto the axle from above",
    "put the front cover onto the body",
    "insert the seal into the front cover",
    "pull the seal out by 1 mm",
    "insert the rear bearing into the rear cover",
    "put the rear cover onto the body",
    "put all four screws into the front cover",
];
/// Largest distance of a part from its designed place, µm, and longest step, ms.
const OFF_UM: f64 = 1.0;
const STEP_MS: f64 = 100.0;
/// Least distance of the farthest part when all are apart, mm.
const APART_MM: f64 = 50.0;
/// Points of a part whose places are compared, mm from its origin.
const LEVER_MM: f64 = 50.0;

pub(super) fn measure(cad: &Path, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let file = cad.join(MOTOR);
    let model = mortise_brep::load_step(&file)?;
    let designed = model.parts.clone();
    let mut session = Session::new(model).map_err(|error| refused(&file, &error))?;
    let half = SCRIPT.len() / 2;
    let mut spoken = say(&mut session, &SCRIPT[..half]);
    let what = |what: &str| {
        format!(
            "motor of {} parts apart and together by words: {what}",
            designed.len()
        )
    };
    out(Row::within(
        what("farthest of a part from its designed place when apart"),
        farthest_mm(session.parts(), &designed),
        "mm",
        APART_MM,
        f64::INFINITY,
    ));
    let again = read_again(&file, session.parts())?;
    out(Row::at_most(
        what("written then and read again, farthest of a part from where it was"),
        1e3 * farthest_mm(session.parts(), &again),
        "µm",
        OFF_UM,
    ));
    spoken = spoken.and(say(&mut session, &SCRIPT[half..]));
    out(Row::exactly(
        what("instructions done"),
        spoken.done as f64,
        "instructions",
        SCRIPT.len() as f64,
    ));
    out(Row::at_most(
        what("farthest of a part from its designed place at the end"),
        1e3 * farthest_mm(session.parts(), &designed),
        "µm",
        OFF_UM,
    ));
    out(Row::at_most(what("longest act"), spoken.longest_ms, "ms", STEP_MS).varies());

    scattered(&cad.join(SCATTERED), &designed, half, out)
}

/// Rows of the file that has the parts scattered.
fn scattered(file: &Path, designed: &[Part], half: usize, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let model = mortise_brep::load_step(file)?;
    let mut session = Session::new(model).map_err(|error| refused(file, &error))?;
    let what = |what: &str| {
        format!(
            "motor of {} parts from its parts scattered, by words: {what}",
            designed.len()
        )
    };
    let mut in_place = |session: &Session, name: &str| {
        let off = distances_mm(session.parts(), designed);
        for (name, mm) in off.iter().filter(|(_, mm)| 1e3 * mm > OFF_UM) {
            eprintln!("{name}: {mm:.3} mm from its designed place");
        }
        let placed = off.iter().filter(|(_, mm)| 1e3 * mm <= OFF_UM).count();
        out(Row::exactly(
            what(name),
            placed as f64,
            "parts",
            designed.len() as f64,
        ));
    };
    let mut spoken = say(&mut session, TOGETHER);
    in_place(&session, "parts at their designed places");
    spoken = spoken.and(say(&mut session, &SCRIPT[..half]));
    spoken = spoken.and(say(&mut session, TOGETHER_AGAIN));
    in_place(
        &session,
        "taken apart and put together again, parts at their designed places",
    );
    out(Row::exactly(
        what("instructions done"),
        spoken.done as f64,
        "instructions",
        (TOGETHER.len() + half + TOGETHER_AGAIN.len()) as f64,
    ));
    out(Row::at_most(what("longest act"), spoken.longest_ms, "ms", STEP_MS).varies());
    Ok(())
}

/// What instructions came to.
#[derive(Default)]
struct Spoken {
    done: usize,
    longest_ms: f64,
}

impl Spoken {
    fn and(self, other: Self) -> Self {
        Self {
            done: self.done + other.done,
            longest_ms: self.longest_ms.max(other.longest_ms),
        }
    }
}

/// Carries out instructions; the time of each counts by its acts.
fn say(session: &mut Session, script: &[&str]) -> Spoken {
    let mut spoken = Spoken::default();
    for instruction in script {
        let start = Instant::now();
        let turn = session.say(instruction);
        let ms = 1e3 * start.elapsed().as_secs_f64() / turn.acts.len().max(1) as f64;
        let reason = turn
            .reason
            .map_or_else(String::new, |reason| format!(", {}", reason.words));
        eprintln!("{instruction}: {:?}, {ms:.0} ms an act{reason}", turn.outcome);
        spoken = spoken.and(Spoken {
            done: usize::from(turn.outcome == Outcome::Done),
            longest_ms: ms,
        });
    }
    spoken
}

/// The parts of the file that is written with these, read again.
fn read_again(file: &Path, parts: &[Part]) -> Result<Vec<Part>, LabError> {
    let text = mortise_brep::write::step_text(file, &LoadOptions::default(), parts)?;
    let unwritable = |source| LabError::Unwritable {
        path: std::env::temp_dir(),
        source,
    };
    let mut written = (tempfile::Builder::new().suffix(".step").tempfile()).map_err(unwritable)?;
    written.write_all(&text).map_err(unwritable)?;
    Ok(mortise_brep::load_step(written.path())?.parts)
}

/// Farthest of any part from where `others` have it, mm, against the body.
fn farthest_mm(parts: &[Part], others: &[Part]) -> f64 {
    let all = distances_mm(parts, others);
    // A part that is missing is nowhere.
    let farthest = if all.len() == others.len() {
        0.0
    } else {
        f64::INFINITY
    };
    all.into_iter().map(|(_, mm)| mm).fold(farthest, f64::max)
}

/// How far each part is from where the part of the same name is among `others`, mm, against the body.
fn distances_mm(parts: &[Part], others: &[Part]) -> Vec<(String, f64)> {
    let place = |parts: &[Part], name: &str| {
        let part = parts.iter().find(|part| part.name == name);
        part.map(|part| part.placement)
    };
    let against = |parts: &[Part], name: &str| Some(place(parts, "body")?.inverse() * place(parts, name)?);
    let points = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    let distance = |now: DAffine3, wanted: DAffine3| {
        let at = points.map(|p| LEVER_MM * p);
        at.map(|p| now.transform_point3(p).distance(wanted.transform_point3(p)))
            .into_iter()
            .fold(0.0, f64::max)
    };
    (parts.iter())
        .filter_map(|part| {
            let mm = distance(against(parts, &part.name)?, against(others, &part.name)?);
            Some((part.name.clone(), mm))
        })
        .collect()
}
