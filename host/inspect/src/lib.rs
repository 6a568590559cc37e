//! Inspection of placed parts: plane sections with filled areas, exact clearances between parts, and measurements of their features.
//!
//! - [`section`]: the closed loops in which a plane cuts a solid, on the exact surfaces, and the area inside them as triangles.
//! - [`clearances`]: for each pair of near parts the least gap or the deepest overlap, and its place.
//! - [`clearance_map`]: exact signed distance to another part at the vertices of a tessellation that is refined where the distance is not linear.
//! - [`measure`]: sizes of vertices, edges, axes and faces, and distances and angles between two of them.
//!
//! Lengths are mm, angles radians. Results depend on neither the number of threads nor random numbers.

mod cap;
mod clearance;
mod curve;
mod map;
pub mod measure;
mod onto;
mod plane;
mod section;
mod shells;
mod solid;
mod trace;

pub use cap::Cap;
pub use clearance::{Pair, TOUCH_MM, clearances};
pub use map::{ClearanceMap, MapOptions, clearance_map};
pub use plane::CutPlane;
pub use section::{Fineness, Loop, Section, section};
pub use solid::Solid;
