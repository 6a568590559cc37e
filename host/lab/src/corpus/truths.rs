//! Shared pairs with true distances: `09_free_form/NAME.step` beside `NAME.poses.csv`, whose columns `distance_mm` and `truth_error_um` follow those of
//! a pose file.

use std::path::{Path, PathBuf};

use mortise_scenario::probe::{NamedPose, read_poses};

use super::step_files;
use crate::LabError;

/// A pair and its poses.
#[derive(Clone, Debug)]
pub(crate) struct TruePair {
    /// Its name.
    pub name: String,
    /// STEP file.
    pub step: PathBuf,
    /// Names of its moving and its fixed part.
    pub parts: [&'static str; 2],
    /// Poses of the moving part in the frame of the fixed one.
    pub cases: Vec<TrueCase>,
}

/// A pose and the distance there.
#[derive(Clone, Debug)]
pub(crate) struct TrueCase {
    /// The pose.
    pub pose: NamedPose,
    /// True signed distance, mm.
    pub distance_mm: f64,
    /// Largest error of that, mm.
    pub error_mm: f64,
}

/// Every pair of the folder `cad` that has poses.
///
/// # Errors
/// `Unreadable`; `Scenario` or `Input` for a pose file that cannot be read.
pub(crate) fn true_pairs(cad: &Path) -> Result<Vec<TruePair>, LabError> {
    let mut pairs = Vec::new();
    for step in step_files(&cad.join("09_free_form"))? {
        let csv = step.with_extension("poses.csv");
        if !csv.is_file() {
            continue;
        }
        pairs.push(TruePair {
            name: step
                .file_stem()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned(),
            parts: ["moving", "fixed"],
            cases: cases(&csv)?,
            step,
        });
    }
    Ok(pairs)
}

fn cases(path: &Path) -> Result<Vec<TrueCase>, LabError> {
    let bad = |what: String| LabError::Input {
        name: path.display().to_string(),
        what,
    };
    let poses = read_poses(path)?;
    let mut reader = csv::Reader::from_path(path).map_err(|error| bad(error.to_string()))?;
    let columns = reader.headers().map_err(|error| bad(error.to_string()))?.clone();
    let column = |name: &str| {
        (columns.iter().position(|column| column == name)).ok_or_else(|| bad(format!("no column `{name}`")))
    };
    let (distance, error) = (column("distance_mm")?, column("truth_error_um")?);
    let mut cases = Vec::new();
    for (pose, record) in poses.into_iter().zip(reader.records()) {
        let record = record.map_err(|error| bad(error.to_string()))?;
        let number = |index: usize| {
            let cell = record.get(index).unwrap_or_default();
            cell.parse::<f64>()
                .map_err(|_| bad(format!("`{cell}` is no number")))
        };
        cases.push(TrueCase {
            pose,
            distance_mm: number(distance)?,
            error_mm: 1e-3 * number(error)?,
        });
    }
    Ok(cases)
}
