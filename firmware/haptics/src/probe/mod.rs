//! Probe: gap and contacts at one pose, and first touch along a motion, without budget. For measurement, not for the tick.
//!
//! | file | what |
//! |---|---|
//! | `prober` | the queries |
//! | `nearest`, `nearest_voxel` | nearest point of the pointshells, and contacts |
//! | `convex`, `gjk`, `epa`, `support` | distance of two convex shapes, with proven bounds |
//! | `clearance`, `feature_curve`, `face_distance`, `conforming` | gap of two shapes of any form with analytic faces, with proven bounds |
//! | `on_surface` | whether a point is proven inside a shape, or on its surface |
//! | `sweep` | first touch along a motion |

mod clearance;
mod conforming;
mod convex;
mod epa;
mod face_distance;
mod feature_curve;
mod gjk;
pub(crate) mod nearest;
mod nearest_voxel;
mod on_surface;
pub(crate) mod prober;
mod support;
pub(crate) mod sweep;
