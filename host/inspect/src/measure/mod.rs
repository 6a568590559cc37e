//! Measuring: what a vertex, edge, axis or face of a part is, and how two of them lie to each other, from the exact surfaces and curves.
//!
//! - [`Entity::of`]: one feature of a shape, prepared once; [`Entity::about`]: its length, radius, area or place.
//! - [`compare()`]: least distance of two placed entities, with both ends; angle; distance of axes and of parallel planes; difference of the radii of
//!   coaxial cylinders.
//!
//! Lengths are mm, angles radians. The tessellation only says where a search begins and how far a face reaches, as in
//! [`mortise_bake::ExactSurface`]; no number is taken from it. Two points, lines or axes have closed forms. Otherwise the two ends are projected on each
//! other's entity until they rest, from the nearest of several hundred places, so a least distance is exact to the rounding of the last projection,
//! but a narrower place between two entities that are near in many places can be missed where it is smaller than the spacing of those.

mod compare;
mod entity;
mod least;
mod line;

pub use compare::{Angle, Comparison, Radial, compare};
pub use entity::{About, Entity, Feature, Round};
pub use least::{Least, Placed, least};
pub use line::AxisLine;
