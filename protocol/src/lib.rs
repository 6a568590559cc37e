//! The interface between host and board: the [`message`] table, [`frame`]s, [`parameter`]s, the [`rig`]'s description, and the layout of the scene
//! [`image`]. No I/O, no allocation; the only crate that both sides share.
#![no_std]

#[cfg(target_endian = "big")]
compile_error!("scene images are read in place and are little-endian");

pub mod frame;
pub mod image;
pub mod label;
pub mod limits;
pub mod message;
pub mod parameter;
pub mod rig;
