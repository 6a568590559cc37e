//! What is claimed of contact.

/// Cells of the accuracy that is claimed, mm.
pub const CELL_MM: f64 = 0.5;
/// The tightest fit asked for, mm.
pub const TIGHT_MM: f64 = 0.02;
/// Why a row of shared parts is skipped.
pub const ABSENT: &str = "the shared parts are not there; set MORTISE_SHARED to their folder";
