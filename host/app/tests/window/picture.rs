//! The 3D view's renderer on any available graphics device, including a software one, without a window.

use std::ops::ControlFlow;
use std::sync::Arc;

use eframe::wgpu;
use glam::DVec3;
use mortise::cut::areas::Cutter;
use mortise::display::mesh::meeting;
use mortise::session::document::Document;
use mortise::viewport::camera::{Camera, Projection, View};
use mortise::viewport::picture::{Areas, Arrow, Cutaway, Fill, Ground, Item, Picture};
use mortise::viewport::renderer::Renderer;
use mortise_inspect::CutPlane;

const SIZE: [u32; 2] = [320, 240];

/// A graphics device, or `None` with a message; in CI its absence is a failure.
fn device() -> Option<(wgpu::Device, wgpu::Queue)> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
    let opened = pollster::block_on(async {
        let adapter = instance
            .request_adapter(&wgpu::RequestAdapterOptions::default())
            .await
            .ok()?;
        adapter
            .request_device(&wgpu::DeviceDescriptor::default())
            .await
            .ok()
    });
    if opened.is_none() {
        assert!(
            std::env::var_os("CI").is_none(),
            "no graphics device, not even a software one: install mesa-vulkan-drivers"
        );
        eprintln!("skipped: no graphics device, not even a software one (mesa-vulkan-drivers)");
    }
    opened
}

/// Red, green, blue, alpha of each pixel, rows from the top.
fn read(device: &wgpu::Device, queue: &wgpu::Queue, texture: &wgpu::Texture) -> Vec<[u8; 4]> {
    let row = 4 * SIZE[0];
    assert!(row.is_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT));
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: u64::from(row * SIZE[1]),
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    encoder.copy_texture_to_buffer(
        texture.as_image_copy(),
        wgpu::TexelCopyBufferInfo {
            buffer: &buffer,
            layout: wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(row),
                rows_per_image: None,
            },
        },
        texture.size(),
    );
    queue.submit([encoder.finish()]);
    let slice = buffer.slice(..);
    slice.map_async(wgpu::MapMode::Read, |mapped| mapped.expect("mapped"));
    device.poll(wgpu::PollType::wait_indefinitely()).expect("done");
    let bytes = slice.get_mapped_range().expect("mapped").to_vec();
    bytes.chunks_exact(4).map(|p| [p[0], p[1], p[2], p[3]]).collect()
}

fn picture(document: &Document, camera: Camera) -> Picture {
    let items = (document.model.parts.iter().zip(&document.poses).enumerate())
        .map(|(index, (part, pose))| Item {
            shape: part.shape,
            pose: *pose,
            color: if index == 0 {
                [0.2, 0.4, 0.9]
            } else {
                [0.9, 0.8, 0.1]
            },
            opacity: 1.0,
            tint: [0.0; 4],
            line: [0.0, 0.0, 0.0, 1.0],
            lit: Vec::new(),
            lit_edges: Vec::new(),
            mates: Vec::new(),
        })
        .collect();
    Picture {
        camera,
        extent: document.extent,
        ground: Ground::Dark,
        items,
        cut: None,
        glow: None,
        arrows: Vec::new(),
        line_width: 1.5,
    }
}

fn pixel(pixels: &[[u8; 4]], x: u32, y: u32) -> [i32; 3] {
    let [r, g, b, _] = pixels[(y * SIZE[0] + x) as usize];
    [r, g, b].map(i32::from)
}

#[test]
fn parts_are_where_the_camera_looks_in_their_colours() {
    for projection in [Projection::Perspective, Projection::Orthographic] {
        parts_drawn(projection);
    }
}

fn parts_drawn(projection: Projection) {
    let Some((device, queue)) = device() else { return };
    let document = Document::sample(1, &|_| ControlFlow::Continue(())).expect("the sample opens");
    let mut renderer = Renderer::new(&device, &queue);
    renderer.set_shapes(&document.meshes);
    assert!(renderer.resize(SIZE));
    assert!(!renderer.resize(SIZE), "the same size keeps its texture");
    let aspect = f64::from(SIZE[0]) / f64::from(SIZE[1]);
    let mut camera = Camera {
        projection,
        ..Camera::default()
    };
    camera.look(View::Front);
    camera.fit(document.extent, aspect);
    let at = |point: DVec3| {
        let ndc = camera.project(point, aspect).expect("in front");
        let x = 0.5 * (ndc.x + 1.0) * f64::from(SIZE[0]);
        let y = 0.5 * (1.0 - ndc.y) * f64::from(SIZE[1]);
        (x as u32, y as u32)
    };

    renderer.render(&picture(&document, camera));
    let (texture, _) = renderer.texture().expect("resized");
    let pixels = read(&device, &queue, texture);
    // The block is below z = 0, the peg above: the front of each has its own hue; the corner is background.
    let (x, y) = at(DVec3::new(0.0, -25.0, -20.0));
    let [r, _, b] = pixel(&pixels, x, y);
    assert!(b > r + 60, "the block is blue: {r} {b}");
    let (x, y) = at(DVec3::new(0.0, -8.875, 50.0));
    let [r, g, b] = pixel(&pixels, x, y);
    assert!(r > b + 60 && g > b + 60, "the peg is yellow: {r} {g} {b}");
    let [r, g, b] = pixel(&pixels, 2, 2);
    assert!(r.max(g).max(b) < 60, "the corner is background: {r} {g} {b}");
    assert!(pixels.iter().all(|p| p[3] == 255), "the picture is opaque");

    // A highlighted face is red, a ghost is transparent, an arrow is drawn over everything.
    let mut scene = picture(&document, camera);
    let front = face_at(&document, DVec3::new(0.0, -25.0, -20.0));
    scene.items[0].lit = vec![front];
    scene.items[1].opacity = 0.3;
    scene.arrows.push(Arrow {
        tail: DVec3::new(-20.0, 0.0, 60.0),
        vector: DVec3::new(0.0, 0.0, 30.0),
        thickness: 4.0,
        color: [0.0, 1.0, 0.0, 1.0],
    });
    renderer.render(&scene);
    let (texture, _) = renderer.texture().expect("resized");
    let pixels = read(&device, &queue, texture);
    let (x, y) = at(DVec3::new(0.0, -25.0, -20.0));
    let [r, _, b] = pixel(&pixels, x, y);
    assert!(r > b + 60, "the lit face is red: {r} {b}");
    let (x, y) = at(DVec3::new(-20.0, 0.0, 68.0));
    let [r, g, _] = pixel(&pixels, x, y);
    assert!(g > r + 60, "the arrow is green: {r} {g}");

    // A face that fits is striped green unless it touches.
    let (x, y) = at(DVec3::new(0.0, -25.0, -20.0));
    scene.items[0].lit = Vec::new();
    scene.items[0].mates = vec![front];
    renderer.render(&scene);
    let (texture, _) = renderer.texture().expect("resized");
    let pixels = read(&device, &queue, texture);
    let along: Vec<[i32; 3]> = (x - 12..x + 12).map(|x| pixel(&pixels, x, y)).collect();
    assert!(
        along.iter().all(|[r, g, _]| g > r),
        "the face that fits is green: {along:?}"
    );
    let blue = |[_, g, b]: &[i32; 3]| b - g;
    let (low, high) = (along.iter().map(blue).min(), along.iter().map(blue).max());
    assert!(high > low.map(|low| low + 30), "striped: {along:?}");
    scene.items[0].lit = vec![front];
    renderer.render(&scene);
    let (texture, _) = renderer.texture().expect("resized");
    let [r, _, b] = pixel(&read(&device, &queue, texture), x, y);
    assert!(r > b + 60, "touching comes first: {r} {b}");
}

/// The edge between the block's front and top, seen from in front of and above the block's corner.
#[test]
fn an_edge_that_touches_stands_out_and_no_other_does() {
    for projection in [Projection::Perspective, Projection::Orthographic] {
        edges_drawn(projection);
    }
}

fn edges_drawn(projection: Projection) {
    let Some((device, queue)) = device() else { return };
    let document = Document::sample(1, &|_| ControlFlow::Continue(())).expect("the sample opens");
    let mut renderer = Renderer::new(&device, &queue);
    renderer.set_shapes(&document.meshes);
    renderer.resize(SIZE);
    let aspect = f64::from(SIZE[0]) / f64::from(SIZE[1]);
    let mut camera = Camera {
        projection,
        ..Camera::default()
    };
    camera.look(View::Front);
    camera.fit(document.extent, aspect);
    // Number of nearly white pixels around a point.
    let mut white_at = |lit_edges: Vec<[u32; 2]>, point: DVec3| {
        let mut scene = picture(&document, camera);
        scene.items[0].lit_edges = lit_edges;
        renderer.render(&scene);
        let (texture, _) = renderer.texture().expect("resized");
        let pixels = read(&device, &queue, texture);
        let ndc = camera.project(point, aspect).expect("in front");
        let x = (0.5 * (ndc.x + 1.0) * f64::from(SIZE[0])) as u32;
        let y = (0.5 * (1.0 - ndc.y) * f64::from(SIZE[1])) as u32;
        let white = |y: u32| pixel(&pixels, x, y).into_iter().all(|c| c > 200);
        (y - 4..y + 4).filter(|&y| white(y)).count()
    };
    let front = face_at(&document, DVec3::new(0.0, -25.0, -20.0));
    let shape = &document.model.shapes[document.model.parts[0].shape];
    let pose = document.poses[0];
    let (above, below) = (DVec3::new(-20.0, -25.0, 0.0), DVec3::new(-20.0, -25.0, -40.0));
    let edges = |z: f64| -> Vec<[u32; 2]> {
        (shape.edges.iter())
            .filter(|edge| {
                edge.faces.contains(&front)
                    && edge
                        .polyline
                        .iter()
                        .all(|&p| (pose.transform_point3(p).z - z).abs() < 1e-6)
            })
            .map(|edge| meeting(&edge.faces))
            .collect()
    };
    let (top, bottom) = (edges(0.0), edges(-40.0));
    assert!(top.len() == 1 && bottom.len() == 1, "{top:?} {bottom:?}");
    assert_eq!(white_at(Vec::new(), above), 0, "an edge is dark");
    assert!(
        white_at(top.clone(), above) >= 3,
        "the edge that touches is bright and wide"
    );
    assert_eq!(white_at(top, below), 0, "the other is as it was");
    assert!(white_at(bottom, below) >= 3);
}

/// Face of the block under a point of its surface.
fn face_at(document: &Document, point: DVec3) -> u32 {
    let hit = mortise::viewport::pick::pick(
        &document.model,
        &document.extents,
        &document.poses,
        &[],
        None,
        point - 100.0 * DVec3::Y,
        DVec3::Y,
    );
    hit.and_then(|hit| hit.face).expect("on the block")
}

/// The sample cut through its middle, seen from in front: the block has a bore.
#[test]
fn a_cut_block_shows_its_area_and_its_bore() {
    for projection in [Projection::Perspective, Projection::Orthographic] {
        cut_drawn(projection);
    }
}

fn cut_drawn(projection: Projection) {
    let Some((device, queue)) = device() else { return };
    let document = Document::sample(1, &|_| ControlFlow::Continue(())).expect("the sample opens");
    let mut renderer = Renderer::new(&device, &queue);
    renderer.set_shapes(&document.meshes);
    renderer.resize(SIZE);
    let aspect = f64::from(SIZE[0]) / f64::from(SIZE[1]);
    let mut camera = Camera {
        projection,
        ..Camera::default()
    };
    camera.look(View::Front);
    camera.fit(document.extent, aspect);
    let plane = CutPlane::new(DVec3::ZERO, -DVec3::Y).expect("a plane");
    let cut = Arc::new(Cutter::default().cut(1, &document.model, &document.poses, plane, 1e-3));
    let fill = |area: usize, color| Fill {
        area,
        color,
        tint: [0.0; 4],
        line: [0.0; 4],
        hatch: 0.8,
    };
    let mut scene = picture(&document, camera);
    scene.cut = Some(Cutaway {
        plane,
        areas: Some(Areas(Arc::clone(&cut))),
        // Green and magenta: no surface has these.
        fills: vec![
            fill(0, [0.0, 1.0, 0.0]),
            fill(1, [1.0, 0.0, 1.0]),
            fill(9, [1.0; 3]),
        ],
    });
    // Colours of a column around a point, longer than the distance of two lines of the hatching.
    let mut around = |scene: &Picture, point: DVec3| -> Vec<[i32; 3]> {
        renderer.render(scene);
        let (texture, _) = renderer.texture().expect("resized");
        let pixels = read(&device, &queue, texture);
        let ndc = camera.project(point, aspect).expect("in front");
        let x = (0.5 * (ndc.x + 1.0) * f64::from(SIZE[0])) as u32;
        let y = (0.5 * (1.0 - ndc.y) * f64::from(SIZE[1])) as u32;
        (y - 20..y + 20).map(|y| pixel(&pixels, x, y)).collect()
    };
    let green = |[r, g, b]: &[i32; 3]| *g > r + 80 && *g > b + 80;
    // The bore reaches from x = -9.375 to 9.375, the block to 25.
    let block = around(&scene, DVec3::new(17.0, 0.0, -20.0));
    assert!(block.iter().all(green), "{block:?}");
    let (dark, bright) = (block.iter().map(|p| p[1]).min(), block.iter().map(|p| p[1]).max());
    assert!(bright > dark.map(|dark| dark + 60), "hatched: {block:?}");
    let bore = around(&scene, DVec3::new(0.0, 0.0, -20.0));
    assert!(
        bore.iter().all(|[r, g, b]| b > r && b > g),
        "the bore's wall is blue: {bore:?}"
    );
    let peg = around(&scene, DVec3::new(0.0, 0.0, 50.0));
    assert!(
        peg.iter().all(|[r, g, b]| r > g && b > g),
        "the peg's area: {peg:?}"
    );
    // Without areas the inside of the block's back shows; without a section its front.
    if let Some(cut) = &mut scene.cut {
        (cut.areas, cut.fills) = (None, Vec::new());
    }
    let inside = around(&scene, DVec3::new(17.0, 0.0, -20.0));
    assert!(inside.iter().all(|[r, _, b]| *b > r + 40), "{inside:?}");
    // From the other side nothing is cut away but what lies behind.
    if let Some(cut) = &mut scene.cut {
        cut.plane = CutPlane::new(DVec3::ZERO, DVec3::Y).expect("a plane");
    }
    let front = around(&scene, DVec3::new(17.0, -25.0, -20.0));
    assert!(front.iter().all(|[r, _, b]| *b > r + 60), "{front:?}");
}

/// From any side, closed parts look the same whether the backs of their triangles are drawn or not.
#[test]
fn the_backs_of_closed_parts_are_not_missed() {
    let Some((device, queue)) = device() else { return };
    let document = Document::sample(0, &|_| ControlFlow::Continue(())).expect("the sample");
    assert!(document.meshes.iter().all(|mesh| mesh.closed));
    let mut both_sides = document.meshes.to_vec();
    both_sides.iter_mut().for_each(|mesh| mesh.closed = false);
    let mut renderer = Renderer::new(&device, &queue);
    renderer.resize(SIZE);
    for view in [View::Front, View::Right, View::Top, View::Iso] {
        let mut camera = Camera::default();
        camera.look(view);
        let picture = picture(&document, camera);
        let drawn = [&document.meshes[..], &both_sides].map(|meshes| {
            renderer.set_shapes(meshes);
            renderer.render(&picture);
            read(&device, &queue, renderer.texture().expect("resized").0)
        });
        let [without, with] = &drawn;
        let differ = without.iter().zip(with).filter(|(a, b)| a != b).count();
        assert_eq!(differ, 0, "{view:?}");
    }
}

#[test]
fn nothing_to_draw_is_no_trouble() {
    let Some((device, queue)) = device() else { return };
    let mut renderer = Renderer::new(&device, &queue);
    renderer.render(&Picture {
        camera: Camera::default(),
        extent: Default::default(),
        ground: Ground::Dark,
        items: vec![],
        cut: None,
        glow: None,
        arrows: vec![],
        line_width: 1.0,
    });
    renderer.set_shapes(&Arc::new(vec![Default::default()]));
    renderer.resize([0, 0]);
    renderer.render(&Picture {
        camera: Camera::default(),
        extent: Default::default(),
        ground: Ground::Dark,
        items: vec![
            Item {
                shape: 0,
                pose: glam::DAffine3::IDENTITY,
                color: [1.0; 3],
                opacity: 1.0,
                tint: [0.0; 4],
                line: [1.0; 4],
                lit: vec![],
                lit_edges: vec![],
                mates: vec![],
            },
            Item {
                shape: 7,
                pose: glam::DAffine3::IDENTITY,
                color: [1.0; 3],
                opacity: 1.0,
                tint: [0.0; 4],
                line: [1.0; 4],
                lit: vec![],
                lit_edges: vec![],
                mates: vec![],
            },
        ],
        cut: None,
        glow: None,
        arrows: vec![],
        line_width: 1.0,
    });
}
