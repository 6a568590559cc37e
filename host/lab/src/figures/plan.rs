//! How a table is measured.

use std::path::Path;

use crate::row::Row;

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

impl Plan<'_> {
    /// A time: judged in the full form alone, since the shorter one runs beside other programs.
    pub(crate) fn timed(&self, what: String, seconds: f64, most: f64) -> Row {
        if self.quick {
            Row::reported(what, seconds, "s").varies()
        } else {
            Row::at_most(what, seconds, "s", most).varies()
        }
    }
}
