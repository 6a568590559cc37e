//! The scene image: all scene data of the board, read in place from flash.
//!
//! Little-endian, SI units, every array aligned to 4 bytes, no pointers: offsets count from the image's first byte. [`SceneImage::open`] checks every
//! offset, index and number once; after that the accessors cannot go out of bounds, for any input bytes. `docs/scene-image.md` is the specification.
//!
//! ```text
//! header | parts | shapes | fields | nodes | points | faces | patches | bricks | palette | grid | blob | edges | spans | energies
//! ```
//!
//! A **shape** is geometry in its own frame: a signed-distance **field** or voxmap (dense grid of bricks, sparse brick
//! data), a **pointshell** (points under a preorder sphere tree of nodes) and its B-rep **faces**, those without closed form with
//! local **patches**, and its sharp convex **edges** in pieces under a tree of their own. A **part** places a shape. An **energy** of two parts is
//! what draws the one to where it fits the other; most images have none.

mod edge;
mod energy;
mod error;
mod field;
mod nearby;
mod occupancy;
mod open;
mod records;
mod region;
mod surfaces;

pub use edge::{EdgeRecord, NO_SPAN, SpanRecord};
pub use energy::{ChargeRecord, ENERGY_DEPTHS, Energy, EnergyBlock, EnergyRecord};
pub use error::ImageError;
pub use field::{COARSE_UNITS, Cell, EDGE_ERROR_CELLS, Field, FieldSample, Lookup, Place};
pub use nearby::{Group, MOST_LEVELS, Nearby};
pub use occupancy::{VOXEL_BRICK_BYTES, Voxel, VoxelSample};
pub use open::{CRC, SceneImage, Shape};
pub use records::*;
pub use surfaces::{Surface, Surfaces};
