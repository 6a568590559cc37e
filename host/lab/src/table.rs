//! Results as CSV: one line a row, names of the fields first.

use mortise_output::Folder;
use serde::Serialize;

use crate::error::LabError;

/// Writes rows, plain structs of numbers, words and booleans, to `NAME.csv` in `folder`; what is absent is an empty cell.
///
/// # Errors
/// `Output`; `Unwritable` for rows that are no table.
pub fn write_csv<T: Serialize>(rows: &[T], folder: &Folder, name: &str) -> Result<(), LabError> {
    let name = format!("{name}.csv");
    let table = || -> std::io::Result<Vec<u8>> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        for row in rows {
            writer.serialize(row)?;
        }
        writer.into_inner().map_err(csv::IntoInnerError::into_error)
    };
    let table = table().map_err(|source| LabError::Unwritable {
        path: folder.path().join(&name),
        source,
    })?;
    Ok(folder.write(name, &table)?)
}

/// `value` with so many digits behind the point: what a table shows, and no more than was measured.
pub fn rounded(value: f64, digits: i32) -> f64 {
    let unit = 10f64.powi(digits);
    (value * unit).round() / unit
}
