//! Results as CSV: one line a row, names of the fields first.

use serde::Serialize;

/// Rows, plain structs of numbers, words and booleans, as a table; what is absent is an empty cell.
///
/// # Errors
/// For rows that are no table.
pub fn csv<T: Serialize>(rows: &[T]) -> Result<Vec<u8>, csv::Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for row in rows {
        writer.serialize(row)?;
    }
    writer.into_inner().map_err(|error| error.into_error().into())
}

/// `value` with so many digits behind the point: what a table shows, and no more than was measured.
pub fn rounded(value: f64, digits: i32) -> f64 {
    let unit = 10f64.powi(digits);
    (value * unit).round() / unit
}
