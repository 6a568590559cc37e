//! What is claimed of contact.

/// Cells of the accuracy that is claimed, mm.
pub const CELL_MM: f64 = 0.5;
/// The tightest fit asked for, mm.
pub const TIGHT_MM: f64 = 0.02;
