//! Numbers of a description as people write them.

/// Rounds to six significant digits, the precision that remains after single precision and a change of unit.
pub(super) fn significant(value: f32) -> f64 {
    let text = format!("{:.5e}", f64::from(value));
    text.parse().unwrap_or(f64::from(value))
}
