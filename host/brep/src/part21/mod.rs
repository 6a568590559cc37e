//! The text of a STEP file (ISO 10303-21, "Part 21"), before the CAD kernel sees it.
//!
//! The kernel is lenient in the wrong places: it drops a solid that refers to nothing, crashes on malformed numbers, and reads nothing at all from
//! some valid texts. So the text is scanned here first: errors are reported with their line ([`check`], [`schema`]), and the kernel gets a plain
//! rendering ([`render`]) without comments, one entity per line, entities numbered 1, 2, …, and with tokens as names of products and occurrences; the
//! text of these names is decoded here ([`text`]).

pub mod check;
pub mod documents;
pub mod exchange;
mod lexer;
mod merge;
pub mod operators;
pub mod pcurves;
mod placements;
pub mod render;
pub mod schema;
pub mod structure;
pub mod text;
pub mod units;

pub use exchange::{Exchange, Part21Error};
pub use lexer::parse;
pub use placements::from_identity;
