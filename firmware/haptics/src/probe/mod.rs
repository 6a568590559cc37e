//! Probe: gap and contacts at one pose, without motion or budget. For measurement, not for the tick.

mod convex;
mod epa;
mod gjk;
pub(crate) mod nearest;
mod nearest_voxel;
pub(crate) mod prober;
mod support;
