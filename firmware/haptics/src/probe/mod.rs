//! Gap and contacts at one pose, without motion or budget: for measuring, not for the tick.

pub(crate) mod nearest;
mod nearest_voxel;
pub(crate) mod prober;
