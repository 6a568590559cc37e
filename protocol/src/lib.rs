//! What host and board share by wire: the [`message`] table, [`frame`]s, [`parameter`]s, the [`rig`]'s description, and the layout
//! of the [`image`] a scene is stored in. No I/O, no allocation; the only crate both sides know.
#![no_std]

#[cfg(target_endian = "big")]
compile_error!("scene images are read in place and are little-endian");

pub mod frame;
pub mod image;
pub mod limits;
pub mod message;
pub mod parameter;
pub mod rig;
