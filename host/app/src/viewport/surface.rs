//! The renderer's texture as an image of the window.

use std::sync::Arc;

use eframe::egui_wgpu::RenderState;
use eframe::wgpu;
use egui::TextureId;

use super::picture::Picture;
use super::renderer::Renderer;
use crate::display::mesh::ShapeMesh;

/// Draws pictures into a texture that the window displays; an unchanged picture is not drawn again.
pub struct Surface {
    state: RenderState,
    renderer: Renderer,
    texture: Option<TextureId>,
    meshes: Option<Arc<Vec<ShapeMesh>>>,
    last: Option<Picture>,
}

impl Surface {
    /// A surface on the window's device.
    pub fn new(state: &RenderState) -> Self {
        Self {
            renderer: Renderer::new(&state.device, &state.queue),
            state: state.clone(),
            texture: None,
            meshes: None,
            last: None,
        }
    }

    /// The texture of the picture, `size` pixels large.
    pub fn show(
        &mut self,
        meshes: &Arc<Vec<ShapeMesh>>,
        picture: Picture,
        size: [u32; 2],
    ) -> Option<TextureId> {
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
            let mut window = self.state.renderer.write();
            let filter = wgpu::FilterMode::Linear;
            match self.texture {
                Some(id) => {
                    window.update_egui_texture_from_wgpu_texture(&self.state.device, view, filter, id);
                }
                None => {
                    self.texture = Some(window.register_native_texture(&self.state.device, view, filter));
                }
            }
        }
        if fresh || !same_meshes || self.last.as_ref() != Some(&picture) {
            self.renderer.render(&picture);
            self.last = Some(picture);
        }
        self.texture
    }
}
