//! Which faces of which parts fit together, after Iacob, Mitrouchev & Léon, "Contact identification for assembly–disassembly
//! simulation with a haptic device", The Visual Computer 24 (2008).
//!
//! 1. [`merge`]: faces of a shape that lie on one surface become one ([`MergedSurface`]), however the modeller split it.
//! 2. Boxes of faces in a tree find the pairs that may touch, part against other part.
//! 3. Two surfaces mate when they are the same within tolerance over their common region, and turn their outsides to each
//!    other: planes face each other, a shaft is in a bore.
//! 4. A contact needs a common area ([`MIN_AREA_MM2`](Tolerances::min_area_mm2)): the trimmed faces overlap, in the plane
//!    or on the unrolled cylinder, cone or sphere. A sphere in a cylinder touches along a circle (linear annular contact).
//!
//! Lengths are millimetres, angles radians; shapes are in their own frame, contacts in the assembly's.

mod annular;
mod clip;
mod contact;
mod identify;
mod merge;
mod overlap;
pub mod recognise;
mod same;
mod sphere;
mod tiles;
mod tolerances;

pub use contact::{Axis, Contact, ContactKind};
pub use identify::identify;
pub use merge::{MergedSurface, Side, merge};
pub use tolerances::Tolerances;
