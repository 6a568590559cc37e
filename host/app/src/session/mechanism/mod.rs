//! A described mechanism as it is drawn: its links in any posture, and the reach of its handle. Pure.

pub mod extremes;
pub mod links;
pub mod reach;
pub mod region;
pub mod words;

use mortise_protocol::rig::{Rig, RigFault};

use self::links::Links;
use self::reach::Reach;

/// A described mechanism with its reach.
#[derive(Clone, Debug)]
pub struct Mechanism {
    /// Its links.
    pub links: Links,
    /// Where its handle can be.
    pub reach: Reach,
}

impl Mechanism {
    /// The mechanism of a description. Cost: about 20,000 postures.
    ///
    /// # Errors
    /// See [`mortise_mechanism::kinematics::Model::new`].
    pub fn new(rig: &Rig) -> Result<Self, RigFault> {
        let links = Links::new(rig)?;
        let reach = Reach::new(&links);
        Ok(Self { links, reach })
    }
}
