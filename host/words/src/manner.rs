//! What an instruction asks of a connection.

use crate::lexicon::{Place, Relation};
use crate::phrase::Amount;
use crate::port::Port;

/// The manner in which one part is to be put together with another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Manner {
    /// Into, onto, or either.
    pub relation: Relation,
    /// Side from which the part comes.
    pub from: Option<Place>,
    /// How far in.
    pub extent: Amount,
    /// The bore of `b`, placed.
    pub hole: Option<Port>,
}
