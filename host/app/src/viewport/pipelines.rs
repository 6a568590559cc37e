//! Configuration of the graphics card: formats, bindings, and one pipeline per kind of object.

use std::num::NonZeroU64;

use eframe::wgpu;

use crate::display::mesh::{Segment, Vertex};

/// Texture format that the window displays: sRGB values, stored unconverted.
pub const COLOR: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
/// Format of the depth buffer.
pub const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
/// Samples per pixel.
pub const SAMPLES: u32 = 4;

/// One pipeline per kind of object.
pub struct Pipelines {
    /// Background.
    pub sky: wgpu::RenderPipeline,
    /// Opaque parts, both sides of their faces.
    pub solid: wgpu::RenderPipeline,
    /// Closed opaque parts: the outer side of their faces alone, which costs half as much.
    pub outside: wgpu::RenderPipeline,
    /// Areas of a section.
    pub area: wgpu::RenderPipeline,
    /// Transparent parts: blended, without hiding what is behind them.
    pub ghost: wgpu::RenderPipeline,
    /// Glow in front of parts, and behind them.
    pub glow: [wgpu::RenderPipeline; 2],
    /// Arrows, drawn over everything.
    pub arrow: wgpu::RenderPipeline,
    /// Edges.
    pub lines: wgpu::RenderPipeline,
    globals: wgpu::BindGroupLayout,
    draws: wgpu::BindGroupLayout,
}

struct Kind<'a> {
    label: &'a str,
    vertex: &'a str,
    fragment: &'a str,
    buffers: &'a [Option<wgpu::VertexBufferLayout<'a>>],
    cull: Option<wgpu::Face>,
    write_depth: bool,
    compare: wgpu::CompareFunction,
}

impl Pipelines {
    /// Compiles the pipelines. `globals` and `draw` are the sizes of the shader's two uniform structs, bytes.
    pub fn new(device: &wgpu::Device, globals: u64, draw: u64) -> Self {
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("viewport"),
            source: wgpu::ShaderSource::Wgsl(include_str!("shader.wgsl").into()),
        });
        let globals = uniform(device, "globals", false, globals);
        let draws = uniform(device, "draws", true, draw);
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("viewport"),
            bind_group_layouts: &[Some(&globals), Some(&draws)],
            immediate_size: 0,
        });
        let solid = [Some(wgpu::VertexBufferLayout {
            array_stride: size_of::<Vertex>() as u64,
            step_mode: wgpu::VertexStepMode::Vertex,
            attributes: &wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Unorm8x4, 3 => Uint32],
        })];
        let lines = [Some(wgpu::VertexBufferLayout {
            array_stride: size_of::<Segment>() as u64,
            step_mode: wgpu::VertexStepMode::Instance,
            attributes: &wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Uint32x2],
        })];
        let make = |kind: Kind<'_>| pipeline(device, &module, &layout, &kind);
        let solid_parts = |cull| {
            make(Kind {
                label: "solid",
                vertex: "solid_vertex",
                fragment: "solid_fragment",
                buffers: &solid,
                cull,
                write_depth: true,
                compare: wgpu::CompareFunction::Less,
            })
        };
        let glow = |fragment, compare| {
            make(Kind {
                label: "glow",
                vertex: "solid_vertex",
                fragment,
                buffers: &solid,
                cull: None,
                write_depth: false,
                compare,
            })
        };
        Self {
            sky: make(Kind {
                label: "sky",
                vertex: "sky_vertex",
                fragment: "sky_fragment",
                buffers: &[],
                cull: None,
                write_depth: false,
                compare: wgpu::CompareFunction::Always,
            }),
            solid: solid_parts(None),
            outside: solid_parts(Some(wgpu::Face::Back)),
            area: make(Kind {
                label: "area",
                vertex: "solid_vertex",
                fragment: "area_fragment",
                buffers: &solid,
                cull: None,
                write_depth: true,
                compare: wgpu::CompareFunction::Less,
            }),
            ghost: make(Kind {
                label: "ghost",
                vertex: "solid_vertex",
                fragment: "solid_fragment",
                buffers: &solid,
                cull: None,
                write_depth: false,
                compare: wgpu::CompareFunction::Less,
            }),
            glow: [
                glow("glow_fragment", wgpu::CompareFunction::LessEqual),
                glow("hidden_glow_fragment", wgpu::CompareFunction::Greater),
            ],
            arrow: make(Kind {
                label: "arrow",
                vertex: "solid_vertex",
                fragment: "arrow_fragment",
                buffers: &solid,
                cull: Some(wgpu::Face::Back),
                write_depth: false,
                compare: wgpu::CompareFunction::Always,
            }),
            lines: make(Kind {
                label: "lines",
                vertex: "lines_vertex",
                fragment: "lines_fragment",
                buffers: &lines,
                cull: None,
                write_depth: false,
                compare: wgpu::CompareFunction::LessEqual,
            }),
            globals,
            draws,
        }
    }

    /// Binds the buffer of the values that are constant over the picture.
    pub fn globals_group(&self, device: &wgpu::Device, buffer: &wgpu::Buffer) -> wgpu::BindGroup {
        device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("globals"),
            layout: &self.globals,
            entries: &[wgpu::BindGroupEntry {
                binding: 0,
                resource: buffer.as_entire_binding(),
            }],
        })
    }

    /// Binds the buffer of the values of each item; `size` bytes of it are visible per draw call.
    pub fn draws_group(&self, device: &wgpu::Device, buffer: &wgpu::Buffer, size: u64) -> wgpu::BindGroup {
        device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("draws"),
            layout: &self.draws,
            entries: &[wgpu::BindGroupEntry {
                binding: 0,
                resource: wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                    buffer,
                    offset: 0,
                    size: NonZeroU64::new(size),
                }),
            }],
        })
    }
}

fn uniform(device: &wgpu::Device, label: &str, moving: bool, size: u64) -> wgpu::BindGroupLayout {
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some(label),
        entries: &[wgpu::BindGroupLayoutEntry {
            binding: 0,
            visibility: wgpu::ShaderStages::VERTEX_FRAGMENT,
            ty: wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Uniform,
                has_dynamic_offset: moving,
                min_binding_size: NonZeroU64::new(size),
            },
            count: None,
        }],
    })
}

fn pipeline(
    device: &wgpu::Device,
    module: &wgpu::ShaderModule,
    layout: &wgpu::PipelineLayout,
    kind: &Kind<'_>,
) -> wgpu::RenderPipeline {
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(kind.label),
        layout: Some(layout),
        vertex: wgpu::VertexState {
            module,
            entry_point: Some(kind.vertex),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: kind.buffers,
        },
        fragment: Some(wgpu::FragmentState {
            module,
            entry_point: Some(kind.fragment),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &[Some(wgpu::ColorTargetState {
                format: COLOR,
                blend: Some(wgpu::BlendState::ALPHA_BLENDING),
                write_mask: wgpu::ColorWrites::ALL,
            })],
        }),
        primitive: wgpu::PrimitiveState {
            cull_mode: kind.cull,
            ..Default::default()
        },
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH,
            depth_write_enabled: Some(kind.write_depth),
            depth_compare: Some(kind.compare),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState {
            count: SAMPLES,
            ..Default::default()
        },
        multiview_mask: None,
        cache: None,
    })
}
