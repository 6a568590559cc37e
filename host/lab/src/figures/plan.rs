//! How a table is measured.

use std::path::Path;

/// How a table is measured.
#[derive(Clone, Copy, Debug)]
pub struct Plan<'a> {
    /// The shorter form: what takes minutes is done on fewer cases; each row's text says so.
    pub quick: bool,
    /// The program `mortise`, for rows that measure a command of its.
    pub program: &'a Path,
    /// The thesis pair with 1 mm clearance.
    pub pair: &'a Path,
    /// One part of the table alone, where it has parts.
    pub only: Option<&'a str>,
}
