//! The renderer's picture within the window, pixel for pixel.
//!
//! Not by the window library's own shader: it filters a texture in two ways and chooses between them, and a software renderer computes both in every
//! pixel. With this, and panels that fill nothing, a window of 1280 × 800 pixels takes 23 ms a frame on two cores instead of 82 ms
//! (`docs/notes/2026-11-29-frames-without-a-graphics-card.md`).

use eframe::egui_wgpu::{Callback, CallbackResources, CallbackTrait};
use eframe::wgpu;
use egui::{PaintCallback, PaintCallbackInfo, Rect};

/// Draws a texture over a rectangle of the window.
pub struct Shown {
    device: wgpu::Device,
    layout: wgpu::BindGroupLayout,
    pipeline: wgpu::RenderPipeline,
    group: Option<wgpu::BindGroup>,
}

impl Shown {
    /// For a window of this format.
    pub fn new(device: &wgpu::Device, window: wgpu::TextureFormat) -> Self {
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("shown"),
            source: wgpu::ShaderSource::Wgsl(include_str!("shown.wgsl").into()),
        });
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("shown"),
            entries: &[wgpu::BindGroupLayoutEntry {
                binding: 0,
                visibility: wgpu::ShaderStages::FRAGMENT,
                ty: wgpu::BindingType::Texture {
                    sample_type: wgpu::TextureSampleType::Float { filterable: false },
                    view_dimension: wgpu::TextureViewDimension::D2,
                    multisampled: false,
                },
                count: None,
            }],
        });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("shown"),
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        // A window of sRGB encodes what it is given.
        let fragment = match window.is_srgb() {
            true => "decoded_fragment",
            false => "fragment",
        };
        let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("shown"),
            layout: Some(&pipeline_layout),
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("vertex"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: None,
            multisample: wgpu::MultisampleState::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some(fragment),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                targets: &[Some(window.into())],
            }),
            multiview_mask: None,
            cache: None,
        });
        Self {
            device: device.clone(),
            layout,
            pipeline,
            group: None,
        }
    }

    /// Replaces the texture.
    pub fn set(&mut self, texture: &wgpu::TextureView) {
        let group = self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("shown"),
            layout: &self.layout,
            entries: &[wgpu::BindGroupEntry {
                binding: 0,
                resource: wgpu::BindingResource::TextureView(texture),
            }],
        });
        self.group = Some(group);
    }

    /// What draws the texture over `rect`; `None` before [`Self::set`].
    pub fn over(&self, rect: Rect) -> Option<PaintCallback> {
        let (pipeline, group) = (self.pipeline.clone(), self.group.clone()?);
        Some(Callback::new_paint_callback(rect, Draw { pipeline, group }))
    }
}

struct Draw {
    pipeline: wgpu::RenderPipeline,
    group: wgpu::BindGroup,
}

impl CallbackTrait for Draw {
    fn paint(
        &self,
        _info: PaintCallbackInfo,
        pass: &mut wgpu::RenderPass<'static>,
        _resources: &CallbackResources,
    ) {
        // The window library has set the rectangle as the pass's viewport.
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.group, &[]);
        pass.draw(0..3, 0..1);
    }
}
