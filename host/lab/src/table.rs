//! Results as CSV: one line a row, field names first.

use serde::Serialize;

/// A table of rows, which are plain structs of numbers, words and booleans; an absent value is an empty cell.
///
/// # Errors
/// For rows that do not form a table.
pub fn csv<T: Serialize>(rows: &[T]) -> Result<Vec<u8>, csv::Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for row in rows {
        writer.serialize(row)?;
    }
    writer.into_inner().map_err(|error| error.into_error().into())
}

/// `value` with this many decimals: a table shows no more digits than were measured.
pub fn rounded(value: f64, digits: i32) -> f64 {
    let unit = 10f64.powi(digits);
    (value * unit).round() / unit
}
