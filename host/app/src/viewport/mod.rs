//! The 3D view. Camera and picking are pure; one file draws with wgpu, another connects the view to the window.

pub mod camera;
pub mod compose;
pub mod gesture;
pub mod gizmo;
pub mod handles;
pub mod hold;
mod kept;
pub mod measure;
pub mod outline;
pub mod pick;
pub mod picture;
mod pipelines;
pub mod renderer;
pub mod screen;
mod shown;
pub mod six_axis;
pub mod snap;
mod solids;
mod steer;
pub mod surface;
mod turn;
