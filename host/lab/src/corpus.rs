//! The shared test parts: every file is read, every real assembly is baked and one of its parts moved.
//!
//! The environment variable `MORTISE_SHARED` names the folder; without it the folder is `shared` beside the repository. Without the folder nothing is
//! measured, and the caller reports so.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::DVec3;
use mortise_bake::Method;
use mortise_brep::{BrepError, CadModel, load_step};
use mortise_rig::RigSpec;
use serde::Deserialize;

pub(crate) mod truths;
pub(crate) mod written;
use mortise_scenario::{Bounds, Hand, Key, Run, Scenario, ScenarioError, Scene, Shell};

use self::written::Written;
use crate::LabError;

/// How far the hand moves a part along each axis, mm.
const SWEEP_MM: f64 = 30.0;

/// The shared parts' `cad` folder, if it exists.
pub fn folder() -> Option<PathBuf> {
    let shared = match std::env::var_os("MORTISE_SHARED") {
        Some(named) => PathBuf::from(named),
        None => Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared"),
    };
    Some(shared.join("cad")).filter(|cad| cad.is_dir())
}

/// Result of reading one file.
#[derive(Clone, Debug)]
pub struct Import {
    /// Path below the folder.
    pub file: String,
    /// Difference from the expected result; `None` when there is none.
    pub wrong: Option<String>,
}

impl Import {
    /// Text that the refusal must contain, where the file must be refused.
    pub fn refusal(&self) -> Option<&'static str> {
        match written::of(&self.file)? {
            Written::Refused(why) => Some(why),
            Written::Parts(_) => None,
        }
    }
}

/// Entry of `expected.json` for one file.
#[derive(Deserialize)]
struct Expected {
    parts: Vec<String>,
}

/// Reads every STEP file below `cad` and compares it with `expected.json`, parts by name, or with the results listed in `corpus/written.rs`. A file
/// without an expected result fails, and so does a listed file that is missing.
///
/// # Errors
/// `Unreadable` when the folder or `expected.json` cannot be read.
pub fn imports(cad: &Path) -> Result<Vec<Import>, LabError> {
    let list = cad.join("expected.json");
    let text = std::fs::read_to_string(&list).map_err(|source| LabError::Unreadable {
        path: list.clone(),
        source,
    })?;
    let mut expected: BTreeMap<String, Expected> =
        serde_json::from_str(&text).map_err(|error| LabError::Unreadable {
            path: list,
            source: error.into(),
        })?;
    // The kernel that made the list reads nothing from this spelling of the motor.
    if let Some(flat) = expected
        .get("05_motor/motor_flat.step")
        .map(|flat| flat.parts.clone())
        && let Some(odd) = expected.get_mut("08_hard/ok_comments_before_equals.step")
        && odd.parts.is_empty()
    {
        odd.parts = flat;
    }
    let mut imports = Vec::new();
    for path in step_files(cad)? {
        let file = path.strip_prefix(cad).unwrap_or(&path).display().to_string();
        let wrong = judge(&file, expected.get(&file), load_step(&path));
        imports.push(Import { file, wrong });
    }
    let listed = expected.keys().map(String::as_str);
    for file in listed.chain(written::WRITTEN.iter().map(|(file, _)| *file)) {
        if !cad.join(file).is_file() {
            imports.push(Import {
                file: file.to_owned(),
                wrong: Some("is not there".into()),
            });
        }
    }
    Ok(imports)
}

fn judge(file: &str, expected: Option<&Expected>, read: Result<CadModel, BrepError>) -> Option<String> {
    let refused = |error: &BrepError| Some(format!("was refused: {error}"));
    if let Some(expected) = expected {
        let model = match read {
            Ok(model) => model,
            Err(error) => return refused(&error),
        };
        let names: Vec<&str> = model.parts.iter().map(|part| part.name.as_str()).collect();
        let same = names.len() == expected.parts.len()
            && names
                .iter()
                .zip(&expected.parts)
                .all(|(name, wanted)| is_named(name, wanted));
        return (!same).then(|| format!("has parts {names:?}, expected {:?}", expected.parts));
    }
    match (written::of(file), read) {
        (None, _) => Some("has nothing written about it".into()),
        (Some(Written::Parts(wanted)), Ok(model)) => {
            let found = model.parts.len();
            (found != wanted).then(|| format!("has {found} parts, expected {wanted}"))
        }
        (Some(Written::Parts(_)), Err(error)) => refused(&error),
        (Some(Written::Refused(why)), Ok(_)) => Some(format!("was read, expected a refusal: {why}")),
        (Some(Written::Refused(why)), Err(error)) => {
            let words = error.to_string();
            (!words.contains(why) || words.contains('\n'))
                .then(|| format!("was refused by other words than \"{why}\": {words}"))
        }
    }
}

/// True if a part's `name` is the `wanted` one. The list joins the tree's levels with slashes, and its kernel substitutes a number for a name without
/// ASCII letters.
fn is_named(name: &str, wanted: &str) -> bool {
    let wanted = wanted.rsplit('/').next().unwrap_or(wanted);
    let numbered = wanted.chars().all(|c| c.is_ascii_digit());
    name == wanted || (numbered && !name.is_ascii())
}

/// Result of baking a real assembly and moving one of its parts.
#[derive(Clone, Debug)]
pub struct Moved {
    /// File name.
    pub file: String,
    /// The part moved, and the image's size in bytes; or why the file cannot be used.
    pub outcome: Result<(String, usize), String>,
    /// True after a fault, a panic of the rig or the like, none of which may happen.
    pub failed: bool,
}

/// Opens every assembly of two parts or more in `cad/real`, bakes it, and moves its smallest part against the others for
/// `seconds` of virtual time in the in-process rig.
///
/// # Errors
/// `Unreadable` when the folder cannot be read.
pub fn assemblies(cad: &Path, seconds: f64) -> Result<Vec<Moved>, LabError> {
    let mut moved = Vec::new();
    for path in step_files(&cad.join("real"))? {
        let Ok(model) = load_step(&path) else {
            continue;
        };
        if model.parts.len() < 2 {
            continue;
        }
        let file = path
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        let spec = RigSpec::Simulated { realtime: false };
        let (scenario, part) = sweep(&path, &model, seconds);
        let (outcome, failed) = match mortise_scenario::run(&scenario, &spec) {
            Ok(outcome) => (Ok((part, outcome.image_bytes)), outcome.missed_ticks > 0),
            Err(error @ ScenarioError::Bake { .. }) => {
                (Err(error.to_string()), error.to_string().contains('\n'))
            }
            Err(error) => (Err(error.to_string()), true),
        };
        moved.push(Moved {
            file,
            outcome,
            failed,
        });
    }
    Ok(moved)
}

/// Scenario whose hand moves the smallest part with a volume to and fro along each axis.
fn sweep(path: &Path, model: &CadModel, seconds: f64) -> (Scenario, String) {
    let volume = |index: usize| {
        let volume = model.shapes[model.parts[index].shape].volume_mm3;
        if volume > 0.0 { volume } else { f64::INFINITY }
    };
    let smallest = (0..model.parts.len())
        .min_by(|&a, &b| volume(a).total_cmp(&volume(b)))
        .unwrap_or(0);
    let part = &model.parts[smallest];
    let grip = part
        .placement
        .transform_point3(model.shapes[part.shape].center_of_mass);
    let turns = [
        DVec3::X,
        DVec3::Y,
        DVec3::Z,
        -DVec3::X,
        -DVec3::Y,
        -DVec3::Z,
        DVec3::ZERO,
    ];
    let step_s = seconds / turns.len() as f64;
    let still = Key {
        t_s: 0.0,
        offset_mm: [0.0; 3],
        turn_deg: [0.0; 3],
        push_n: [0.0; 3],
    };
    let keys = turns.iter().enumerate().map(|(i, &direction)| Key {
        t_s: step_s * (i + 1) as f64,
        offset_mm: (direction * SWEEP_MM).to_array(),
        turn_deg: (direction * 20.0).to_array(),
        ..still.clone()
    });
    let scenario = Scenario {
        name: "sweep".into(),
        what: "A part of a real assembly is moved against the others".into(),
        integrator: None,
        scene: Scene {
            step: path.to_owned(),
            part: part.name.clone(),
            cell_mm: None,
            method: Method::default(),
            shell: Shell::default(),
            shrink_percent: 0.0,
        },
        parameters: BTreeMap::new(),
        hand: Hand {
            stiffness_n_per_m: 400.0,
            damping_n_s_per_m: 4.0,
            angular_stiffness_n_m_per_rad: 2.0,
            angular_damping_n_m_s_per_rad: 0.02,
            tremor_mm: 0.1,
            tremor_hz: 10.0,
            grip_mm: grip.to_array(),
            keyframes: std::iter::once(still.clone()).chain(keys).collect(),
        },
        run: Run {
            duration_s: seconds,
            telemetry_every_ticks: 20,
            heed_every_ticks: None,
            guidance: false,
            parameter_every_ticks: None,
            settled_s: 0.5,
        },
        depth: None,
        press: None,
        faults: None,
        holds: BTreeMap::from([(
            "missed_ticks".into(),
            Bounds {
                min: 0.0,
                max: 0.0,
                only_on: None,
            },
        )]),
    };
    (scenario, part.name.clone())
}

/// Every STEP file below `folder`, sorted.
pub(crate) fn step_files(folder: &Path) -> Result<Vec<PathBuf>, LabError> {
    let unreadable = |path: &Path| {
        let path = path.to_owned();
        move |source| LabError::Unreadable { path, source }
    };
    let mut files = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).map_err(unreadable(&folder))? {
            let path = entry.map_err(unreadable(&folder))?.path();
            let step = path
                .extension()
                .is_some_and(|e| e.eq_ignore_ascii_case("step") || e.eq_ignore_ascii_case("stp"));
            if path.is_dir() {
                folders.push(path);
            } else if step {
                files.push(path);
            }
        }
    }
    files.sort();
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_answer_is_reported() {
        let read = |parts: usize| {
            let part = mortise_brep::Part {
                name: "part".into(),
                path: Vec::new(),
                shape: 0,
                placement: glam::DAffine3::IDENTITY,
                color: None,
            };
            Ok(CadModel {
                parts: vec![part; parts],
                ..CadModel::default()
            })
        };
        let empty = || Err(BrepError::Empty { path: "x".into() });
        assert_eq!(judge("real/as1-oc-214.stp", None, read(18)), None);
        assert_eq!(judge("08_hard/broken_empty.step", None, empty()), None);
        let named = Expected {
            parts: vec!["sub/part".into()],
        };
        assert_eq!(judge("any.step", Some(&named), read(1)), None);
        for (file, expected, read) in [
            ("real/as1-oc-214.stp", None, read(17)),
            ("real/as1-oc-214.stp", None, empty()),
            ("08_hard/broken_empty.step", None, read(1)),
            ("08_hard/broken_missing_ref.step", None, empty()),
            ("nobody.step", None, read(1)),
            ("nobody.step", None, empty()),
            ("any.step", Some(&named), read(2)),
            ("any.step", Some(&named), empty()),
        ] {
            assert!(judge(file, expected, read).is_some(), "{file}");
        }
    }
}
