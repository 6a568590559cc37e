//! Results as CSV: one line a row, names of the fields first.

use std::path::Path;

use serde::Serialize;

use crate::error::LabError;

/// Makes `folder` where there is none and sees that files can be made in it, so that a sweep of half an hour does not end in nothing.
///
/// # Errors
/// `Unwritable`.
pub fn prepare_folder(folder: &Path) -> Result<(), LabError> {
    let probe = folder.join(format!(".mortise-{}", std::process::id()));
    let made = std::fs::create_dir_all(folder)
        .and_then(|()| std::fs::File::create(&probe))
        .and_then(|_| std::fs::remove_file(&probe));
    made.map_err(|source| LabError::Unwritable {
        path: folder.to_path_buf(),
        source,
    })
}

/// Writes rows, plain structs of numbers, words and booleans, to `NAME.csv` in `folder`; what is absent is an empty cell.
///
/// # Errors
/// `Unwritable`.
pub fn write_csv<T: Serialize>(rows: &[T], folder: &Path, name: &str) -> Result<(), LabError> {
    let path = folder.join(format!("{name}.csv"));
    let write = || -> std::io::Result<()> {
        let mut writer = csv::Writer::from_path(&path)?;
        for row in rows {
            writer.serialize(row)?;
        }
        writer.flush()
    };
    write().map_err(|source| LabError::Unwritable {
        path: path.clone(),
        source,
    })
}

/// `value` with so many digits behind the point: what a table shows, and no more than was measured.
pub fn rounded(value: f64, digits: i32) -> f64 {
    let unit = 10f64.powi(digits);
    (value * unit).round() / unit
}
