//! The geometric energy of two solids, for any shapes: low where the skeleton of one lies on the skeleton of the space outside the other.
//!
//! Source: M. Behandish, H. Ilieş, *Peg-in-Hole Revisited: A Generic Force Model for Haptic Assembly*, JCISE 15(4), 2015. A solid has a complex *skeletal
//! density* at every point off its surface ([`density`], eqs. 1 to 3), large where much of the surface is nearly as near as its nearest point. The
//! *score* of a pose is the real part of the integral of the product of both densities over space (eq. 8), the *energy* its negative (eq. 11), and force
//! and torque the negative gradient of the energy (eqs. 12 and 13; [`pair`]).
//!
//! It finds and does not hold: the minimum is tens of micrometres off a close fit, and above a mouth flat faces draw each other aside (`mortise-lab energy`).
//! A scene image takes another form of it, whose charges are fitted along a way ([`BakedEnergy`]); what is held to micrometres is guided by exact surfaces.
//!
//! Units: millimetres, radians; energy in the unit of the scale that the caller gives.

mod attach;
mod bake;
mod baked;
mod charges;
pub mod density;
mod faults;
pub mod field;
mod flat;
mod kernel;
mod lattice;
mod minimum;
mod normal;
mod of_fit;
pub mod pair;
mod pose;
mod stiffness;

pub use attach::{AttachError, Placed, attach, bytes};
pub use bake::bake;
pub use baked::{BakedEnergy, Cost, Way};
pub use density::Density;
pub use field::Field;
pub use kernel::Kernel;
pub use of_fit::of_fit;
pub use pair::{Felt, Pair, Sample};
pub use pose::moved;
