//! What an instruction asks of a connection.

use glam::DVec3;

use crate::lexicon::{Place, Relation};
use crate::phrase::Amount;
use crate::port::Port;
use crate::reference::direction;

/// Cosine between the side asked for and the way out: within 45°.
const AGREES: f64 = 0.7;

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

impl Manner {
    /// Whether a way out leads to the side from which the part is to come.
    pub fn agrees(&self, way: DVec3) -> bool {
        self.from.is_none_or(|place| direction(place).dot(way) > AGREES)
    }
}
