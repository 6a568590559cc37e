//! Draws a [`Picture`] with wgpu into its own texture: colour with four samples, depth, and the resolved picture.
//!
//! Independent of the window: a test uses it on a software device. Cost: per item one draw call for the faces and one for the edges.
//! Matrices are multiplied in double precision, so that a micrometre gap stays visible half a metre from the origin.

use bytemuck::{Pod, Zeroable};
use eframe::wgpu;
use glam::{DAffine3, DMat4, DVec3};
use wgpu::util::DeviceExt as _;

use super::camera::Projection;
use super::picture::{Areas, Cutaway, Fill, Item, MAX_LIT, MAX_LIT_EDGES, Picture, Shells, arrow_poses};
use super::pipelines::{COLOR, DEPTH, Pipelines, SAMPLES};
use super::solids;
use crate::display::mesh::ShapeMesh;

/// Bytes reserved for one item's values; a multiple of every device's alignment for uniform buffers.
const DRAW_STRIDE: u64 = 512;
const _: () = assert!(size_of::<Draw>() as u64 <= DRAW_STRIDE);
/// Fraction of their distance by which lines are drawn nearer, so that faces do not cover them.
const LINE_LIFT: f64 = 6e-4;
/// A value that matches no edge: an edge without faces has [`u32::MAX`] twice.
const NO_EDGE: [u32; 2] = [u32::MAX, 0];

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Globals {
    key: [f32; 4],
    fill: [f32; 4],
    viewer: [f32; 4],
    screen: [f32; 4],
    top: [f32; 4],
    bottom: [f32; 4],
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Draw {
    to_clip: [f32; 16],
    to_world: [f32; 16],
    color: [f32; 4],
    tint: [f32; 4],
    line: [f32; 4],
    lit: [u32; MAX_LIT],
    mates: [u32; MAX_LIT],
    lit_edges: [[u32; 2]; MAX_LIT_EDGES],
    cut: [f32; 4],
    hatch: [f32; 4],
}

/// Distance below the plane of a section from which faces are cut away, in radii of the scene: a face in the plane would flicker through the area there.
/// Edges are drawn up to as much above the plane.
const CUT_SLACK: f64 = 2e-6;
/// A plane above which nothing lies.
const UNCUT: [f32; 4] = [0.0, 0.0, 0.0, -1.0];
/// Least distance of two lines of a hatching, in widths of an edge.
const HATCH_WIDTHS: f64 = 8.0;

/// A shape on the graphics card.
struct Loaded {
    vertices: wgpu::Buffer,
    indices: wgpu::Buffer,
    index_count: u32,
    segments: wgpu::Buffer,
    segment_count: u32,
    closed: bool,
}

struct Targets {
    size: [u32; 2],
    samples: wgpu::TextureView,
    depth: wgpu::TextureView,
    picture: wgpu::Texture,
    view: wgpu::TextureView,
}

/// Pipelines, shapes and textures.
pub struct Renderer {
    device: wgpu::Device,
    queue: wgpu::Queue,
    pipelines: Pipelines,
    globals: wgpu::Buffer,
    globals_group: wgpu::BindGroup,
    draws: wgpu::Buffer,
    draws_group: wgpu::BindGroup,
    shapes: Vec<Loaded>,
    arrow: [Loaded; 2],
    /// Areas of the section drawn last.
    areas: Option<(Areas, Vec<Loaded>)>,
    /// Glow drawn last.
    glow: Option<(Shells, Loaded)>,
    targets: Option<Targets>,
}

impl Renderer {
    /// Creates the renderer on a device and compiles the shaders.
    pub fn new(device: &wgpu::Device, queue: &wgpu::Queue) -> Self {
        let pipelines = Pipelines::new(device, size_of::<Globals>() as u64, size_of::<Draw>() as u64);
        let globals = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("globals"),
            size: size_of::<Globals>() as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let globals_group = pipelines.globals_group(device, &globals);
        let (draws, draws_group) = draw_buffer(device, &pipelines, 64);
        let arrow = [solids::cylinder(), solids::cone()].map(|mesh| load(device, &mesh));
        Self {
            device: device.clone(),
            queue: queue.clone(),
            pipelines,
            globals,
            globals_group,
            draws,
            draws_group,
            shapes: Vec::new(),
            arrow,
            areas: None,
            glow: None,
            targets: None,
        }
    }

    /// Replaces the shapes that items refer to.
    pub fn set_shapes(&mut self, shapes: &[ShapeMesh]) {
        self.shapes = shapes.iter().map(|mesh| load(&self.device, mesh)).collect();
    }

    /// Texture of the picture; `None` before the first [`Self::resize`].
    pub fn texture(&self) -> Option<(&wgpu::Texture, &wgpu::TextureView)> {
        self.targets.as_ref().map(|t| (&t.picture, &t.view))
    }

    /// Sets the texture's size, pixels; returns whether the texture is new.
    pub fn resize(&mut self, size: [u32; 2]) -> bool {
        let limit = self.device.limits().max_texture_dimension_2d;
        let size = size.map(|n| n.clamp(1, limit));
        if self.targets.as_ref().is_some_and(|t| t.size == size) {
            return false;
        }
        self.targets = Some(targets(&self.device, size));
        true
    }

    /// Draws a picture. No effect before [`Self::resize`].
    pub fn render(&mut self, picture: &Picture) {
        let Some(size) = self.targets.as_ref().map(|t| t.size) else {
            return;
        };
        self.load_areas(picture);
        self.load_glow(picture);
        let aspect = f64::from(size[0]) / f64::from(size[1]);
        let to_clip = picture.camera.view_projection(aspect, picture.extent);
        self.queue
            .write_buffer(&self.globals, 0, bytemuck::bytes_of(&globals(picture, size)));

        let items: Vec<&Item> = picture
            .items
            .iter()
            .filter(|i| i.shape < self.shapes.len())
            .collect();
        let (solid, mut seen_through): (Vec<&Item>, Vec<&Item>) =
            items.into_iter().partition(|i| i.opacity >= 1.0);
        let camera = &picture.camera;
        seen_through.sort_by(|a, b| {
            let far = |i: &Item| match camera.projection {
                Projection::Perspective => (i.pose.translation - camera.eye()).length_squared(),
                Projection::Orthographic => -i.pose.translation.dot(camera.backward()),
            };
            far(b).total_cmp(&far(a))
        });
        let pieces: Vec<([DAffine3; 2], [f32; 4])> = picture
            .arrows
            .iter()
            .filter_map(|arrow| Some((arrow_poses(arrow)?, arrow.color)))
            .collect();

        let areas: &[Loaded] = self.areas.as_ref().map_or(&[], |(_, areas)| areas);
        let fills: Vec<(&Cutaway, &Fill)> = (picture.cut.iter())
            .flat_map(|cut| cut.fills.iter().map(move |fill| (cut, fill)))
            .filter(|(_, fill)| fill.area < areas.len())
            .collect();
        let spacing = hatch_spacing(picture, size);

        // Areas follow opaque parts; transparent ones are blended over both.
        let mut draws: Vec<Draw> = Vec::new();
        draws.extend(solid.iter().map(|item| draw_of(item, to_clip, picture)));
        draws.extend((fills.iter()).map(|(cut, fill)| fill_draw(fill, cut, spacing, to_clip)));
        draws.extend(seen_through.iter().map(|item| draw_of(item, to_clip, picture)));
        draws.extend((picture.glow.iter()).map(|glow| coloured(&glow.pose, glow.color, to_clip)));
        for (poses, color) in &pieces {
            draws.extend(poses.iter().map(|pose| coloured(pose, *color, to_clip)));
        }
        self.upload(&draws);

        let mut encoder = self
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor {
                label: Some("viewport"),
            });
        {
            let Some(targets) = &self.targets else { return };
            let mut pass = begin(&mut encoder, targets);
            pass.set_bind_group(0, &self.globals_group, &[]);
            pass.set_bind_group(1, &self.draws_group, &[0]);
            pass.set_pipeline(&self.pipelines.sky);
            pass.draw(0..3, 0..1);
            let mut at = 0u32;
            for item in &solid {
                let shape = &self.shapes[item.shape];
                self.select(&mut pass, at);
                // A section shows the inside, too.
                let outside = shape.closed && picture.cut.is_none();
                let pipeline = if outside {
                    &self.pipelines.outside
                } else {
                    &self.pipelines.solid
                };
                solid_of(&mut pass, pipeline, shape);
                lines_of(&mut pass, &self.pipelines.lines, shape, item.line);
                at += 1;
            }
            for (_, fill) in &fills {
                let Some((_, areas)) = &self.areas else { break };
                self.select(&mut pass, at);
                solid_of(&mut pass, &self.pipelines.area, &areas[fill.area]);
                lines_of(&mut pass, &self.pipelines.lines, &areas[fill.area], fill.line);
                at += 1;
            }
            for item in &seen_through {
                let shape = &self.shapes[item.shape];
                self.select(&mut pass, at);
                solid_of(&mut pass, &self.pipelines.ghost, shape);
                lines_of(&mut pass, &self.pipelines.lines, shape, item.line);
                at += 1;
            }
            if let Some((_, shells)) = &self.glow {
                self.select(&mut pass, at);
                for pipeline in &self.pipelines.glow {
                    solid_of(&mut pass, pipeline, shells);
                }
                at += 1;
            }
            for _ in &pieces {
                for piece in &self.arrow {
                    self.select(&mut pass, at);
                    solid_of(&mut pass, &self.pipelines.arrow, piece);
                    at += 1;
                }
            }
        }
        self.queue.submit([encoder.finish()]);
    }

    /// Brings the areas of the picture's section onto the graphics card, unless they are there.
    fn load_areas(&mut self, picture: &Picture) {
        let wanted = picture.cut.as_ref().and_then(|cut| cut.areas.clone());
        if self.areas.as_ref().map(|(known, _)| known) != wanted.as_ref() {
            self.areas = wanted.map(|areas| {
                let loaded = (areas.0.areas.iter())
                    .map(|area| load(&self.device, &area.mesh))
                    .collect();
                (areas, loaded)
            });
        }
    }

    /// Brings the shells of the picture's glow onto the graphics card, unless they are there.
    fn load_glow(&mut self, picture: &Picture) {
        let wanted = picture.glow.as_ref().map(|glow| &glow.shells);
        if self.glow.as_ref().map(|(known, _)| known) != wanted {
            self.glow = wanted.map(|shells| (shells.clone(), load(&self.device, &shells.0)));
        }
    }

    fn select(&self, pass: &mut wgpu::RenderPass<'_>, index: u32) {
        pass.set_bind_group(1, &self.draws_group, &[index * DRAW_STRIDE as u32]);
    }

    fn upload(&mut self, draws: &[Draw]) {
        let needed = draws.len().max(1) as u64;
        if needed * DRAW_STRIDE > self.draws.size() {
            (self.draws, self.draws_group) =
                draw_buffer(&self.device, &self.pipelines, needed.next_power_of_two());
        }
        let mut bytes = vec![0u8; draws.len() * DRAW_STRIDE as usize];
        for (room, draw) in bytes.chunks_exact_mut(DRAW_STRIDE as usize).zip(draws) {
            room[..size_of::<Draw>()].copy_from_slice(bytemuck::bytes_of(draw));
        }
        self.queue.write_buffer(&self.draws, 0, &bytes);
    }
}

fn globals(picture: &Picture, size: [u32; 2]) -> Globals {
    let camera = &picture.camera;
    let (right, up, viewer) = (camera.right(), camera.up(), camera.backward());
    let (near, far) = camera.depth_range(picture.extent);
    // See `lines_vertex`. Parallel rays have a depth that is linear, and the target's distance for a scale.
    let lift = match camera.projection {
        Projection::Perspective => LINE_LIFT * near * far / (near - far),
        Projection::Orthographic => LINE_LIFT * camera.distance / (near - far),
    };
    let direction = |v: DVec3| v.normalize().as_vec3().extend(0.0).to_array();
    Globals {
        key: direction(viewer + 0.55 * up - 0.45 * right),
        fill: direction(0.4 * viewer - 0.2 * up + right),
        viewer: direction(viewer),
        screen: [size[0] as f32, size[1] as f32, picture.line_width, lift as f32],
        top: picture.ground.sky()[0],
        bottom: picture.ground.sky()[1],
    }
}

fn matrix(m: DMat4) -> [f32; 16] {
    m.as_mat4().to_cols_array()
}

/// Distance of two lines of a hatching, mm: constant while the camera moves a little, for it is a power of two.
fn hatch_spacing(picture: &Picture, size: [u32; 2]) -> f64 {
    let pixel = picture.camera.height_at(picture.camera.target) / f64::from(size[1]);
    (HATCH_WIDTHS * f64::from(picture.line_width) * pixel)
        .log2()
        .ceil()
        .exp2()
}

/// Plane of the section in the frame of `pose`, lower than it is by `slack`, mm.
fn cut_of(cut: Option<&Cutaway>, pose: &DAffine3, slack: f64) -> [f32; 4] {
    cut.map_or(UNCUT, |cut| {
        let plane = cut.plane.seen_from(pose);
        let offset = slack - plane.normal.dot(plane.origin);
        plane.normal.extend(offset).as_vec4().to_array()
    })
}

fn fill_draw(fill: &Fill, cut: &Cutaway, spacing: f64, to_clip: DMat4) -> Draw {
    let world = DMat4::from(crate::cut::areas::pose(&cut.plane));
    let [r, g, b] = fill.color;
    let (sin, cos) = fill.hatch.sin_cos();
    Draw {
        color: [r, g, b, 1.0],
        tint: fill.tint,
        line: fill.line,
        hatch: [cos, sin, spacing as f32, 0.0],
        ..plain(world, to_clip)
    }
}

/// Values of an item without colour, uncut.
fn plain(world: DMat4, to_clip: DMat4) -> Draw {
    Draw {
        to_clip: matrix(to_clip * world),
        to_world: matrix(world),
        color: [0.0; 4],
        tint: [0.0; 4],
        line: [0.0; 4],
        lit: slots(&[], u32::MAX),
        mates: slots(&[], u32::MAX),
        lit_edges: slots(&[], NO_EDGE),
        cut: UNCUT,
        hatch: [0.0, 0.0, 1.0, 0.0],
    }
}

fn draw_of(item: &Item, to_clip: DMat4, picture: &Picture) -> Draw {
    let slack = CUT_SLACK * picture.extent.radius;
    let world = DMat4::from(item.pose);
    let [r, g, b] = item.color;
    Draw {
        color: [r, g, b, item.opacity],
        tint: item.tint,
        line: item.line,
        lit: slots(&item.lit, u32::MAX),
        mates: slots(&item.mates, u32::MAX),
        lit_edges: slots(&item.lit_edges, NO_EDGE),
        cut: cut_of(picture.cut.as_ref(), &item.pose, slack),
        hatch: [0.0, 0.0, 1.0, 2.0 * slack as f32],
        ..plain(world, to_clip)
    }
}

/// The first `N` values, padded with `none`.
fn slots<T: Copy, const N: usize>(all: &[T], none: T) -> [T; N] {
    std::array::from_fn(|i| all.get(i).copied().unwrap_or(none))
}

fn coloured(pose: &DAffine3, color: [f32; 4], to_clip: DMat4) -> Draw {
    Draw {
        color,
        ..plain(DMat4::from(*pose), to_clip)
    }
}

fn load(device: &wgpu::Device, mesh: &ShapeMesh) -> Loaded {
    let buffer = |label, contents: &[u8], usage| {
        // A buffer must not be empty; the count of 0 keeps its contents from being drawn.
        let contents: &[u8] = if contents.is_empty() { &[0; 32] } else { contents };
        device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some(label),
            contents,
            usage,
        })
    };
    Loaded {
        vertices: buffer(
            "vertices",
            bytemuck::cast_slice(&mesh.vertices),
            wgpu::BufferUsages::VERTEX,
        ),
        indices: buffer(
            "indices",
            bytemuck::cast_slice(&mesh.indices),
            wgpu::BufferUsages::INDEX,
        ),
        index_count: mesh.indices.len() as u32,
        segments: buffer(
            "segments",
            bytemuck::cast_slice(&mesh.segments),
            wgpu::BufferUsages::VERTEX,
        ),
        segment_count: mesh.segments.len() as u32,
        closed: mesh.closed,
    }
}

fn draw_buffer(device: &wgpu::Device, pipelines: &Pipelines, count: u64) -> (wgpu::Buffer, wgpu::BindGroup) {
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("draws"),
        size: count * DRAW_STRIDE,
        usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let group = pipelines.draws_group(device, &buffer, size_of::<Draw>() as u64);
    (buffer, group)
}

fn targets(device: &wgpu::Device, size: [u32; 2]) -> Targets {
    let texture = |label, format, samples, usage| {
        device.create_texture(&wgpu::TextureDescriptor {
            label: Some(label),
            size: wgpu::Extent3d {
                width: size[0],
                height: size[1],
                depth_or_array_layers: 1,
            },
            mip_level_count: 1,
            sample_count: samples,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage,
            view_formats: &[],
        })
    };
    let attachment = wgpu::TextureUsages::RENDER_ATTACHMENT;
    let view = |t: &wgpu::Texture| t.create_view(&wgpu::TextureViewDescriptor::default());
    let picture = texture(
        "picture",
        COLOR,
        1,
        attachment | wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_SRC,
    );
    Targets {
        size,
        samples: view(&texture("samples", COLOR, SAMPLES, attachment)),
        depth: view(&texture("depth", DEPTH, SAMPLES, attachment)),
        view: view(&picture),
        picture,
    }
}

fn begin<'e>(encoder: &'e mut wgpu::CommandEncoder, targets: &Targets) -> wgpu::RenderPass<'e> {
    encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        label: Some("viewport"),
        color_attachments: &[Some(wgpu::RenderPassColorAttachment {
            view: &targets.samples,
            depth_slice: None,
            resolve_target: Some(&targets.view),
            ops: wgpu::Operations {
                load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                store: wgpu::StoreOp::Discard,
            },
        })],
        depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
            view: &targets.depth,
            depth_ops: Some(wgpu::Operations {
                load: wgpu::LoadOp::Clear(1.0),
                store: wgpu::StoreOp::Discard,
            }),
            stencil_ops: None,
        }),
        ..Default::default()
    })
}

fn solid_of(pass: &mut wgpu::RenderPass<'_>, pipeline: &wgpu::RenderPipeline, shape: &Loaded) {
    if shape.index_count > 0 {
        pass.set_pipeline(pipeline);
        pass.set_vertex_buffer(0, shape.vertices.slice(..));
        pass.set_index_buffer(shape.indices.slice(..), wgpu::IndexFormat::Uint32);
        pass.draw_indexed(0..shape.index_count, 0, 0..1);
    }
}

fn lines_of(
    pass: &mut wgpu::RenderPass<'_>,
    pipeline: &wgpu::RenderPipeline,
    shape: &Loaded,
    line: [f32; 4],
) {
    if shape.segment_count > 0 && line[3] > 0.0 {
        pass.set_pipeline(pipeline);
        pass.set_vertex_buffer(0, shape.segments.slice(..));
        pass.draw(0..6, 0..shape.segment_count);
    }
}
