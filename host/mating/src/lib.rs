//! Recognition of mating faces between parts, after Iacob, Mitrouchev & Léon, "Contact identification for
//! assembly–disassembly simulation with a haptic device", The Visual Computer 24 (2008).
//!
//! 1. [`merge`]: faces of a shape that lie on one surface become one ([`MergedSurface`]), regardless of how the modeller
//!    split it.
//! 2. A tree over the boxes of the faces finds the pairs of different parts that may touch.
//! 3. Two surfaces mate when they are equal within tolerance over their common region and their outsides face each other:
//!    plane to plane, shaft in bore.
//! 4. A contact needs a common area ([`MIN_AREA_MM2`](Tolerances::min_area_mm2)): the trimmed faces overlap, in the plane
//!    or on the unrolled cylinder, cone or sphere. A sphere in a cylinder touches along a circle (linear annular contact).
//!
//! Lengths are in millimetres, angles in radians; shapes are in their own frame, contacts in the assembly's.

mod annular;
mod clip;
mod contact;
mod identify;
mod merge;
mod overlap;
pub mod recognise;
mod region;
mod same;
mod sphere;
mod tiles;
mod tolerances;

pub use contact::{Axis, Contact, ContactKind};
pub use identify::identify;
pub use merge::{MergedSurface, Side, merge};
pub use region::{PlaneRegion, plane_regions};
pub use tolerances::Tolerances;
