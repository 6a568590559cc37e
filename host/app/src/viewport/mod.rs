//! The 3D view: camera, picking and meshes are pure; one file draws with wgpu, one ties it to the window.

pub mod camera;
pub mod compose;
pub mod gesture;
pub mod mesh;
pub mod pick;
pub mod picture;
mod pipelines;
pub mod renderer;
mod solids;
pub mod surface;
