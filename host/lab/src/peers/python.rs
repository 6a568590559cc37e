//! Peers with a Python package: each is a script of `host/lab/peers` in a process of its own, which a crash of a peer ends alone.
//!
//! The interpreter is named by [`PYTHON`]; `cargo xtask peers` makes its environment and sets it. A script prints one JSON object a line, as
//! `common.py` describes. A method counts only if it answered every pose; anything else is a skip, with its reason in words.

use std::ffi::OsString;
use std::path::Path;
use std::process::{Command, Output};

use mortise_brep::CadModel;
use serde::Deserialize;

use super::method::{Answer, Asked, Kind, Method};
use super::own::write_obj;
use super::scene::Scene;
use crate::error::LabError;

/// Variable that names the interpreter.
pub const PYTHON: &str = "MORTISE_PEERS_PYTHON";
/// Variable that names what could not be installed: lines `PEER: REASON`.
const MISSING: &str = "MORTISE_PEERS_MISSING";
/// Repetitions of a query, of which the shortest counts, as those of our probe.
const REPEATS: usize = 33;
/// Longest time on one pose, s: after it no query is repeated more than once.
const LONGEST_S: f64 = 0.05;
/// Longest time of a peer on a scene for each pose, s: far beyond any use in a loop, and it bounds a run.
const LIMIT_S: usize = 3;

/// Peers, each with its script.
const SCRIPTS: [(&str, &str, &str); 5] = [
    ("coal", "coal_peer.py", include_str!("../../peers/coal_peer.py")),
    ("FCL", "fcl_peer.py", include_str!("../../peers/fcl_peer.py")),
    (
        "Drake",
        "drake_peer.py",
        include_str!("../../peers/drake_peer.py"),
    ),
    (
        "MuJoCo",
        "mujoco_peer.py",
        include_str!("../../peers/mujoco_peer.py"),
    ),
    (
        "Bullet",
        "bullet_peer.py",
        include_str!("../../peers/bullet_peer.py"),
    ),
];
const COMMON: (&str, &str) = ("common.py", include_str!("../../peers/common.py"));

/// A line of a script.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
enum Said {
    /// A method begins.
    Method {
        method: String,
        kind: Kind,
        version: String,
        floor_us: f64,
    },
    /// Its answer at a pose.
    Answer {
        method: String,
        pose: usize,
        overlaps: bool,
        mm: Option<f64>,
        us: f64,
    },
    /// It cannot be had.
    Skipped { method: String, reason: String },
}

/// Asks every peer every pose of the scene, on meshes that deviate from the surfaces by at most `deflection_mm`.
///
/// # Errors
/// `Input`, `Unwritable`. A peer that cannot be had is no error.
pub fn ask(scene: &Scene, model: &CadModel, deflection_mm: f64) -> Result<Vec<Asked>, LabError> {
    let missing = std::env::var(MISSING).unwrap_or_default();
    let Some(python) = std::env::var_os(PYTHON) else {
        let none = "there is no Python environment: start this by `cargo xtask peers`";
        let skip = |(peer, ..): (&str, &str, &str)| {
            skipped(peer, peer, not_installed(&missing, peer).unwrap_or(none).into())
        };
        return Ok(SCRIPTS.map(skip).into());
    };
    let unwritable = |source| LabError::Unwritable {
        path: std::env::temp_dir(),
        source,
    };
    let folder = tempfile::tempdir().map_err(unwritable)?;
    let at = |name: &str| folder.path().join(name);
    let triangles =
        write_obj(model, scene.fixed, &at("fixed.obj"))? + write_obj(model, scene.moving, &at("moving.obj"))?;
    let scripts = SCRIPTS.map(|(_, name, text)| (name, text));
    for (name, text) in scripts.into_iter().chain([COMMON, ("job.json", &job(scene))]) {
        std::fs::write(at(name), text).map_err(unwritable)?;
    }
    let mut all = Vec::new();
    for (peer, script, _) in SCRIPTS {
        if let Some(why) = not_installed(&missing, peer) {
            all.push(skipped(peer, peer, why.into()));
            continue;
        }
        match run(&python, folder.path(), script) {
            Ok(output) => {
                let said = String::from_utf8_lossy(&output.stdout);
                let end = ending(&output);
                let mesh = (deflection_mm, triangles);
                all.extend(read(peer, &said, end.as_deref(), scene.cases.len(), mesh));
            }
            Err(error) => all.push(skipped(peer, peer, format!("Python cannot be started: {error}"))),
        }
    }
    Ok(all)
}

/// Why a peer could not be installed, if it could not.
fn not_installed<'m>(missing: &'m str, peer: &str) -> Option<&'m str> {
    (missing.lines()).find_map(|line| line.strip_prefix(peer)?.strip_prefix(": "))
}

fn job(scene: &Scene) -> String {
    let pose = |case: &crate::scene_p::Case| {
        let ([x, y, z], [qx, qy, qz, qw]) =
            (case.pose.position_mm.to_array(), case.pose.orientation.to_array());
        [x, y, z, qw, qx, qy, qz]
    };
    serde_json::json!({
        "fixed": "fixed.obj",
        "moving": "moving.obj",
        "poses": scene.cases.iter().map(pose).collect::<Vec<_>>(),
        "repeats": REPEATS,
        "longest_s": LONGEST_S,
        "limit_s": LIMIT_S * scene.cases.len(),
        "farthest_mm": scene.farthest_mm(),
    })
    .to_string()
}

fn run(python: &OsString, folder: &Path, script: &str) -> std::io::Result<Output> {
    let mut command = Command::new(python);
    // One thread, as ours.
    for name in ["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"] {
        command.env(name, "1");
    }
    command.current_dir(folder).args([script, "job.json"]).output()
}

/// Why a script ended early; `None` when it ended well.
fn ending(output: &Output) -> Option<String> {
    if output.status.success() {
        return None;
    }
    #[cfg(unix)]
    if let Some(signal) = std::os::unix::process::ExitStatusExt::signal(&output.status) {
        return Some(match signal {
            // SIGALRM on every Unix.
            14 => format!("took longer than {LIMIT_S} s a pose"),
            signal => format!("its process crashed (signal {signal})"),
        });
    }
    let said = String::from_utf8_lossy(&output.stderr);
    let last = said.lines().rfind(|line| !line.trim().is_empty());
    Some(last.map_or_else(|| output.status.to_string(), |line| line.trim().to_owned()))
}

fn skipped(peer: &str, name: &str, reason: String) -> Asked {
    Asked::Skipped {
        peer: peer.into(),
        name: name.into(),
        reason,
    }
}

/// Methods in the lines of a script; `end` is why it ended early.
fn read(peer: &str, said: &str, end: Option<&str>, poses: usize, mesh: (f64, usize)) -> Vec<Asked> {
    let mut all: Vec<Asked> = Vec::new();
    for line in said.lines().filter(|line| line.starts_with('{')) {
        match serde_json::from_str(line) {
            Ok(Said::Method {
                method,
                kind,
                version,
                floor_us,
            }) => all.push(Asked::Answered(Method {
                peer: peer.into(),
                name: method,
                kind,
                version: Some(version),
                floor_us: Some(floor_us),
                mesh: Some(mesh),
                image_bytes: None,
                answers: Vec::new(),
            })),
            Ok(Said::Answer {
                method,
                pose,
                overlaps,
                mm,
                us,
            }) => match all.last_mut() {
                Some(Asked::Answered(last)) if last.name == method && last.answers.len() == pose => {
                    last.answers.push(Answer { overlaps, mm, us });
                }
                _ => all.push(skipped(
                    peer,
                    &method,
                    format!("answered pose {pose} out of turn"),
                )),
            },
            Ok(Said::Skipped { method, reason }) => all.push(skipped(peer, &method, reason)),
            Err(error) => all.push(skipped(peer, peer, format!("`{line}` is no answer: {error}"))),
        }
    }
    if let Some(end) = end {
        let cut = match all.last() {
            Some(Asked::Answered(last)) if last.answers.len() < poses => {
                Some((last.name.clone(), last.answers.len()))
            }
            _ => None,
        };
        all.push(match cut {
            Some((name, answered)) => skipped(
                peer,
                &name,
                format!("{end}: answered {answered} of {poses} poses"),
            ),
            None => skipped(peer, peer, end.to_owned()),
        });
    } else if all.is_empty() {
        all.push(skipped(peer, peer, "said nothing".into()));
    }
    complete(all, poses)
}

/// A method that another line skips, or that lacks answers, is skipped, once.
fn complete(all: Vec<Asked>, poses: usize) -> Vec<Asked> {
    let mut kept: Vec<Asked> = Vec::new();
    for asked in &all {
        let (peer, name) = match asked {
            Asked::Answered(method) => (&method.peer, &method.name),
            Asked::Skipped { peer, name, .. } => (peer, name),
        };
        let known = kept.iter().any(|kept| match kept {
            Asked::Answered(method) => method.name == *name,
            Asked::Skipped { name: known, .. } => known == name,
        });
        if known {
            continue;
        }
        let why = all.iter().find_map(|other| match other {
            Asked::Skipped {
                name: other, reason, ..
            } if other == name => Some(reason.clone()),
            _ => None,
        });
        kept.push(match (asked, why) {
            (_, Some(reason)) => skipped(peer, name, reason),
            (Asked::Answered(method), None) if method.answers.len() < poses => {
                let answered = method.answers.len();
                skipped(peer, name, format!("answered {answered} of {poses} poses"))
            }
            (asked, None) => asked.clone(),
        });
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    const BEGIN: &str = r#"{"method":{"method":"X, hulls","kind":"hulls","version":"1.2","floor_us":0.5}}"#;
    const FIRST: &str = r#"{"answer":{"method":"X, hulls","pose":0,"overlaps":false,"mm":0.25,"us":3.5}}"#;
    const SECOND: &str = r#"{"answer":{"method":"X, hulls","pose":1,"overlaps":true,"mm":null,"us":4.0}}"#;

    fn read_two(lines: &[&str], end: Option<&str>) -> Vec<Asked> {
        read("X", &lines.join("\n"), end, 2, (0.01, 12))
    }

    /// The reasons of all skips; fails if anything counts as answered.
    fn reasons(all: &[Asked]) -> Vec<&str> {
        (all.iter())
            .map(|asked| match asked {
                Asked::Skipped { reason, .. } => reason.as_str(),
                Asked::Answered(method) => panic!("{method:?} counts"),
            })
            .collect()
    }

    #[test]
    fn a_method_that_answered_every_pose_is_read() {
        let all = read_two(&["a banner of the package", BEGIN, FIRST, SECOND], None);
        let [Asked::Answered(method)] = all.as_slice() else {
            panic!("{all:?}");
        };
        assert_eq!((method.name.as_str(), method.kind), ("X, hulls", Kind::Hulls));
        assert_eq!(
            (method.version.as_deref(), method.floor_us),
            (Some("1.2"), Some(0.5))
        );
        let answer = |overlaps, mm, us| Answer { overlaps, mm, us };
        assert_eq!(
            method.answers,
            [answer(false, Some(0.25), 3.5), answer(true, None, 4.0)]
        );
    }

    #[test]
    fn what_is_incomplete_is_skipped_with_its_reason() {
        assert_eq!(reasons(&read_two(&[], None)), ["said nothing"]);
        assert_eq!(
            reasons(&read_two(&[BEGIN, FIRST], None)),
            ["answered 1 of 2 poses"]
        );
        let refused = r#"{"skipped":{"method":"X, hulls","reason":"no volume"}}"#;
        assert_eq!(reasons(&read_two(&[BEGIN, FIRST, refused], None)), ["no volume"]);
        assert!(reasons(&read_two(&[BEGIN, SECOND, FIRST], None))[0].contains("out of turn"));
        assert!(reasons(&read_two(&["{\"dance\":{}}"], None))[0].contains("is no answer"));
    }

    #[test]
    fn what_could_not_be_installed_has_its_reason() {
        let missing = "Drake: no wheel for this machine\nFCL: no network";
        assert_eq!(not_installed(missing, "FCL"), Some("no network"));
        assert_eq!(not_installed(missing, "coal"), None);
    }

    #[test]
    fn a_crash_skips_what_it_cut_short_and_keeps_what_was_complete() {
        let crash = Some("its process crashed (signal 11)");
        assert_eq!(
            reasons(&read_two(&[BEGIN, FIRST], crash)),
            ["its process crashed (signal 11): answered 1 of 2 poses"]
        );
        let all = read_two(&[BEGIN, FIRST, SECOND], crash);
        assert!(
            matches!(&all[..], [Asked::Answered(_), Asked::Skipped { .. }]),
            "{all:?}"
        );
    }
}
