//! The renderer's picture as a part of the window.

use std::sync::Arc;

use eframe::egui_wgpu::RenderState;
use egui::{PaintCallback, Rect};

use super::picture::Picture;
use super::renderer::Renderer;
use super::shown::Shown;
use crate::display::mesh::ShapeMesh;

/// Draws pictures into a texture that the window displays; an unchanged picture is not drawn again.
pub struct Surface {
    renderer: Renderer,
    shown: Shown,
    meshes: Option<Arc<Vec<ShapeMesh>>>,
    last: Option<Picture>,
}

impl Surface {
    /// A surface on the window's device.
    pub fn new(state: &RenderState) -> Self {
        Self {
            renderer: Renderer::new(&state.device, &state.queue),
            shown: Shown::new(&state.device, state.target_format),
            meshes: None,
            last: None,
        }
    }

    /// Draws the picture, and returns what shows it over `rect`, which is `size` pixels large.
    pub fn show(
        &mut self,
        meshes: &Arc<Vec<ShapeMesh>>,
        picture: Picture,
        rect: Rect,
        size: [u32; 2],
    ) -> Option<PaintCallback> {
        let same_meshes = self
            .meshes
            .as_ref()
            .is_some_and(|known| Arc::ptr_eq(known, meshes));
        if !same_meshes {
            self.renderer.set_shapes(meshes);
            self.meshes = Some(Arc::clone(meshes));
        }
        let fresh = self.renderer.resize(size);
        if fresh {
            let (_, view) = self.renderer.texture()?;
            self.shown.set(view);
        }
        if fresh || !same_meshes || self.last.as_ref() != Some(&picture) {
            self.renderer.render(&picture);
            self.last = Some(picture);
        }
        self.shown.over(rect)
    }
}
