//! Parts prepared for display: bounding spheres, and meshes for the graphics card. Pure. The session makes them when a file has been read; the viewport
//! draws them.

pub mod basin;
pub mod extent;
pub mod mesh;
