//! Pairs of parts, poses of the moving one, and the true distance at each.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use glam::{DQuat, DVec3};
use mortise_scenario::probe::NamedPose;
use serde::Deserialize;
use tempfile::{Builder, NamedTempFile};

use crate::error::LabError;
use crate::scene_p::{self, Case};

/// Crossing bars 200 × 5 × 5 mm and poses of the upper one; distances by separating axes, the depth of an overlap the least translation that separates.
const BARS: (&str, &str) = (
    include_str!("../../data/bars_s05.step"),
    include_str!("../../data/bars_s05.poses.csv"),
);
/// Variable that names the folder of shared test parts.
const SHARED: &str = "MORTISE_SHARED";
/// Its folder of pairs with true distances.
const FREE_FORM: &str = "cad/09_free_form";

/// A scene.
#[derive(Debug)]
pub struct Scene {
    /// Name.
    pub name: String,
    /// Name of the fixed part.
    pub fixed: &'static str,
    /// Name of the moving part.
    pub moving: &'static str,
    /// Poses and true distances.
    pub cases: Vec<Case>,
    file: File,
}

#[derive(Debug)]
enum File {
    Temporary(NamedTempFile),
    Kept(PathBuf),
}

impl Scene {
    /// Its STEP file.
    pub fn step(&self) -> &Path {
        match &self.file {
            File::Temporary(file) => file.path(),
            File::Kept(path) => path,
        }
    }

    /// Beyond every distance of its poses, mm: twice the largest, and at least 10.
    pub fn farthest_mm(&self) -> f64 {
        (self.cases.iter()).fold(10.0, |most, case| f64::max(most, 2.0 * case.exact_mm))
    }
}

/// Scene P.
///
/// # Errors
/// `Unwritable`.
pub fn thesis_pair() -> Result<Scene, LabError> {
    Ok(Scene {
        name: "scene P".into(),
        fixed: "block",
        moving: "peg",
        cases: scene_p::cases(),
        file: File::Temporary(scene_p::file()?),
    })
}

/// Two bars of 5 mm laid crosswise.
///
/// # Errors
/// `Unwritable`; `Input` if the poses cannot be read.
pub fn crossing_bars() -> Result<Scene, LabError> {
    let (step, poses) = BARS;
    let write = || {
        let mut file = Builder::new().prefix("mortise-").suffix(".step").tempfile()?;
        file.write_all(step.as_bytes())?;
        Ok(file)
    };
    let file = write().map_err(|source| LabError::Unwritable {
        path: std::env::temp_dir(),
        source,
    })?;
    Ok(Scene {
        name: "bars_s05".into(),
        fixed: "fixed",
        moving: "moving",
        cases: cases("bars_s05.poses.csv", poses)?,
        file: File::Temporary(file),
    })
}

/// Pairs of the shared test parts, except the bars that are part of the sources; `None` where this machine has none.
///
/// # Errors
/// `Unreadable`; `Input` if a file of poses cannot be read.
pub fn shared_pairs() -> Result<Option<Vec<Scene>>, LabError> {
    let shared = std::env::var_os(SHARED).map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared"),
        PathBuf::from,
    );
    let Ok(entries) = std::fs::read_dir(shared.join(FREE_FORM)) else {
        return Ok(None);
    };
    let mut steps: Vec<PathBuf> = (entries.flatten().map(|entry| entry.path()))
        .filter(|path| path.extension().is_some_and(|ending| ending == "step"))
        .filter(|path| path.file_stem().is_none_or(|name| name != "bars_s05"))
        .collect();
    steps.sort();
    let scene = |step: PathBuf| {
        let path = step.with_extension("poses.csv");
        let unreadable = |source| LabError::Unreadable {
            path: path.clone(),
            source,
        };
        let text = std::fs::read_to_string(&path).map_err(unreadable)?;
        Ok(Scene {
            name: step
                .file_stem()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned(),
            fixed: "fixed",
            moving: "moving",
            cases: cases(&path.display().to_string(), &text)?,
            file: File::Kept(step),
        })
    };
    steps
        .into_iter()
        .map(scene)
        .collect::<Result<_, LabError>>()
        .map(Some)
}

/// A line of a file of poses.
#[derive(Deserialize)]
struct Line {
    name: String,
    x: f64,
    y: f64,
    z: f64,
    qw: f64,
    qx: f64,
    qy: f64,
    qz: f64,
    distance_mm: f64,
}

fn cases(name: &str, text: &str) -> Result<Vec<Case>, LabError> {
    let case = |line: Result<Line, csv::Error>| {
        line.map(|line| Case {
            pose: NamedPose {
                name: line.name,
                position_mm: DVec3::new(line.x, line.y, line.z),
                orientation: DQuat::from_xyzw(line.qx, line.qy, line.qz, line.qw).normalize(),
            },
            exact_mm: line.distance_mm,
        })
        .map_err(|error| LabError::Input {
            name: name.to_owned(),
            what: error.to_string(),
        })
    };
    csv::Reader::from_reader(text.as_bytes())
        .deserialize()
        .map(case)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_are_read_with_their_distances() {
        let bars = crossing_bars().expect("part of the sources");
        let near = bars.cases.iter().find(|case| case.pose.name == "near_0.01");
        let near = near.expect("a pose of the file");
        assert_eq!(near.exact_mm, 0.01);
        assert_eq!(near.pose.position_mm, DVec3::new(0.0, 0.0, -0.99));
        assert!(
            bars.cases
                .iter()
                .all(|case| case.pose.orientation.is_normalized())
        );
        assert!(bars.cases.iter().any(|case| case.exact_mm < 0.0));
    }

    #[test]
    fn a_line_without_a_distance_is_named() {
        let error = cases("x.csv", "name,x,y,z,qw,qx,qy,qz,distance_mm\na,0,0,0,1,0,0,0,\n");
        let error = error.expect_err("no distance").to_string();
        assert!(
            error.starts_with("x.csv: ") && error.contains("line: 2"),
            "{error}"
        );
    }
}
