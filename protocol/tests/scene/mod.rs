//! A tiny hand-made scene: every record, both sample formats, all three widths of palette index.

// Each test binary uses its part of it.
#![allow(dead_code)]

use bytemuck::{Pod, Zeroable, bytes_of, cast_slice};
use mortise_protocol::image::*;

/// Bytes at an address aligned to 4, as in flash.
pub struct Aligned(Vec<u32>, usize);

impl Aligned {
    pub fn new(bytes: &[u8]) -> Self {
        let mut words = vec![0u32; bytes.len().div_ceil(4)];
        bytemuck::cast_slice_mut::<u32, u8>(&mut words)[..bytes.len()].copy_from_slice(bytes);
        Self(words, bytes.len())
    }

    pub fn bytes(&self) -> &[u8] {
        &cast_slice(&self.0)[..self.1]
    }

    pub fn bytes_mut(&mut self) -> &mut [u8] {
        &mut bytemuck::cast_slice_mut(&mut self.0)[..self.1]
    }

    /// Writes the matching checksum.
    pub fn seal(&mut self) {
        let crc = CRC.checksum(&self.bytes()[20..]);
        self.bytes_mut()[16..20].copy_from_slice(&crc.to_le_bytes());
    }
}

/// The scene's bytes.
///
/// Shape 0: the half-space z < 4 mm in one 16-bit brick of 1 mm cells, under an empty one; face 0 for x < 4 mm, face 1 beyond.
/// Shape 1: a plane at x = 2 mm in two 8-bit bricks, one with a single face, one with a byte for each cell; beyond them a brick without samples, in
/// which a cylinder answers.
/// Three parts: two place shape 0, one of them turned a quarter about z and grabbable; one places shape 1.
pub fn bytes() -> Vec<u8> {
    let mut blob = Vec::new();
    let mut bricks = Vec::new();
    let samples = append(&mut blob, |blob| {
        each(BRICK_SAMPLES, |_, _, z| {
            blob.extend(((z as i16 - 4) * 4096).to_le_bytes());
        });
    });
    let indices = append(&mut blob, |blob| {
        let mut cells = Vec::new();
        each(BRICK_CELLS, |x, _, _| cells.push(u8::from(x >= 4)));
        blob.extend(cells.chunks_exact(2).map(|c| c[0] | c[1] << 4));
    });
    bricks.push(BrickRecord {
        samples,
        indices,
        palette: 0,
        palette_len: 2,
        index_bits: 4,
        coarse: 0,
    });
    for number in 0..2i32 {
        let samples = append(&mut blob, |blob| {
            each(BRICK_SAMPLES, |x, _, _| {
                let cells = x as i32 + 8 * number - 2;
                blob.push((cells * 10).clamp(-127, 127) as i8 as u8);
            });
        });
        let indices = append(&mut blob, |blob| {
            if number == 1 {
                blob.extend((0..CELLS_PER_BRICK).map(|i| (i % 3) as u8));
            }
        });
        bricks.push(BrickRecord {
            samples,
            indices: if number == 1 { indices } else { 0 },
            palette: if number == 1 { 2 } else { 5 },
            palette_len: if number == 1 { 3 } else { 1 },
            index_bits: if number == 1 { 8 } else { 0 },
            coarse: 0,
        });
    }
    bricks.push(BrickRecord {
        samples: NO_SAMPLES,
        indices: 0,
        palette: 5,
        palette_len: 1,
        index_bits: 0,
        coarse: 0,
    });
    let mut palette = vec![0, 1, 0, 1, NO_FACE, 1];
    palette.resize(6 + 256, NO_FACE);
    let empty = GridEntry::Empty {
        inside: false,
        cells: 4,
    };
    let grid = [
        GridEntry::Brick(0),
        empty,
        GridEntry::Brick(0),
        GridEntry::Brick(1),
        GridEntry::Brick(2),
    ]
    .map(GridEntry::to_bits);
    let field = |format: u16, scale: f32, band: f32, dims: [u16; 3], first: u32, count: u32| FieldRecord {
        origin: [0.0; 3],
        cell: 0.001,
        scale,
        band,
        brick_dims: dims,
        format,
        first_grid: 2 * first,
        first_brick: first,
        brick_count: count,
    };
    let fields = [
        field(FORMAT_I16, 0.001 / 4096.0, 0.0079, [1, 1, 2], 0, 1),
        field(FORMAT_I8, 0.0001, 0.0127, [3, 1, 1], 1, 3),
    ];
    let point = |position: [f32; 3], face: u16, edge_face: u16| PointRecord {
        position,
        normal: oct_encode([0.0, 0.0, 1.0]),
        face,
        edge_face,
        span: NO_SPAN,
        reserved: 0,
    };
    let points = [
        point([0.001, 0.001, 0.004], 0, NO_FACE),
        point([0.007, 0.001, 0.004], 1, NO_FACE),
        // The middle half of the edge.
        PointRecord {
            span: 0,
            ..point([0.004, 0.0, 0.004], 0, 1)
        },
        point([0.002, 0.0, 0.0], 0, 1),
    ];
    let node = |center: [f32; 3], radius: f32, first_point: u32, point_count: u32, skip: u32| NodeRecord {
        center,
        radius,
        first_point,
        point_count,
        skip,
    };
    let nodes = [
        node([0.004, 0.001, 0.004], 0.0031, 0, 3, 3),
        node([0.001, 0.001, 0.004], 0.0001, 0, 1, 2),
        node([0.0045, 0.001, 0.004], 0.0028, 1, 2, 3),
        node([0.002, 0.0, 0.0], 0.0001, 0, 1, 1),
        node([0.004, 0.0, 0.004], 0.0041, 0, 1, 1),
    ];
    let edge = EdgeRecord {
        center: [0.004, 0.0, 0.004],
        half: [0.004, 0.0, 0.0],
        bend: [0.0; 3],
        normals: [oct_encode([0.0, 0.0, 1.0]), oct_encode([0.0, -1.0, 0.0])],
        faces: [0, 1],
        thickness: 0.004,
        edge: 0,
        radius: 0.004_001,
    };
    let span = SpanRecord {
        along: [0.002, 0.0, 0.0],
        ..SpanRecord::zeroed()
    };
    let plane = |origin: [f32; 3], axis: [f32; 3]| FaceRecord {
        kind: surface_kind::PLANE,
        sense: 1.0,
        origin,
        axis,
        radius: 0.0,
        second: 0.0,
    };
    let faces = [
        plane([0.0, 0.0, 0.004], [0.0, 0.0, 1.0]),
        plane([0.004, 0.0, 0.004], [0.0, 0.0, 1.0]),
        plane([0.002, 0.0, 0.0], [1.0, 0.0, 0.0]),
        FaceRecord {
            kind: surface_kind::CYLINDER,
            sense: -1.0,
            origin: [0.01, 0.0, 0.0],
            axis: [0.0, 1.0, 0.0],
            radius: 0.003,
            second: 0.0,
        },
    ];
    let patches = [PatchRecord {
        origin: [0.002, 0.0, 0.0],
        x: [0.0, 1.0, 0.0],
        normal: [1.0, 0.0, 0.0],
        height: [0.0, 0.0, 0.0, 4.0, 0.0, -2.0, 0.0, 8.0, 0.0, 16.0],
        radius: 0.003,
        face: 1,
        kind: patch_kind::HEIGHT,
    }];
    let shapes = [
        ShapeRecord {
            field: 0,
            flags: 0,
            first_node: 0,
            node_count: 3,
            first_point: 0,
            point_count: 3,
            first_face: 0,
            face_count: 2,
            first_patch: 0,
            patch_count: 0,
            center: [0.004, 0.004, 0.002],
            radius: 0.01,
            volume: 2.56e-7,
            center_of_mass: [0.004, 0.004, 0.002],
            inertia: [1e-12, 2e-12, 3e-12, 0.0, 0.0, 0.0],
            first_edge_node: 4,
            edge_node_count: 1,
            first_edge: 0,
            edge_count: 1,
            first_span: 0,
            span_count: 1,
        },
        ShapeRecord {
            field: 1,
            flags: SHAPE_LEAKY,
            first_node: 3,
            node_count: 1,
            first_point: 3,
            point_count: 1,
            first_face: 2,
            face_count: 2,
            patch_count: 1,
            radius: 0.02,
            ..ShapeRecord::zeroed()
        },
    ];
    let part = |shape: u32, flags: u32, position: [f32; 3], orientation: [f32; 4]| PartRecord {
        shape,
        flags,
        position,
        orientation,
    };
    let half = core::f32::consts::FRAC_1_SQRT_2;
    let parts = [
        part(0, 0, [0.0; 3], [0.0, 0.0, 0.0, 1.0]),
        part(0, PART_GRABBABLE, [0.1, -0.2, 0.3], [0.0, 0.0, half, half]),
        part(1, PART_GRABBABLE, [0.0, 0.0, 0.05], [0.0, 0.0, 0.0, 1.0]),
    ];

    Sections {
        parts: &parts,
        shapes: &shapes,
        fields: &fields,
        nodes: &nodes,
        points: &points,
        faces: &faces,
        patches: &patches,
        bricks: &bricks,
        palette: &palette,
        grid: &grid,
        blob: &blob,
        edges: &[edge],
        spans: &[span],
    }
    .image()
}

/// A scene with a voxmap: the half-space z < 4.5 mm on voxels of 1 mm, in one brick under an empty one, over an empty one inside; one part.
pub fn occupancy_bytes() -> Vec<u8> {
    let mut voxels = [0u8; VOXEL_BRICK_BYTES];
    let mut cell = 0;
    each(BRICK_CELLS, |_, _, z| {
        let voxel = match z {
            0..4 => Voxel::Interior,
            4 => Voxel::Surface,
            5 => Voxel::Proximity,
            _ => Voxel::Free,
        };
        voxels[cell / 4] |= (voxel as u8) << (2 * (cell % 4));
        cell += 1;
    });
    let empty = |inside, cells| GridEntry::Empty { inside, cells };
    let grid = [
        empty(true, 4),
        GridEntry::Brick(0),
        empty(false, 3),
        empty(false, 3),
    ]
    .map(GridEntry::to_bits);
    let field = FieldRecord {
        origin: [0.0, 0.0, -0.008],
        cell: 0.001,
        scale: 0.001,
        band: 0.001,
        brick_dims: [1, 1, 3],
        format: FORMAT_OCCUPANCY,
        first_grid: 0,
        first_brick: 0,
        brick_count: 1,
    };
    let brick = BrickRecord {
        palette_len: 1,
        ..BrickRecord::zeroed()
    };
    let part = PartRecord {
        orientation: [0.0, 0.0, 0.0, 1.0],
        ..PartRecord::zeroed()
    };
    let shape = ShapeRecord {
        face_count: 1,
        radius: 0.02,
        ..ShapeRecord::zeroed()
    };
    Sections {
        parts: &[part],
        shapes: &[shape],
        fields: &[field],
        nodes: &[],
        points: &[],
        faces: &[FaceRecord {
            kind: surface_kind::PLANE,
            sense: 1.0,
            origin: [0.0, 0.0, 0.0045],
            axis: [0.0, 0.0, 1.0],
            ..FaceRecord::zeroed()
        }],
        patches: &[],
        bricks: &[brick],
        palette: &[0],
        grid: &grid,
        blob: &voxels,
        edges: &[],
        spans: &[],
    }
    .image()
}

/// A scene with finer bricks: the half-space z < 2.3 mm on one brick of 1 mm cells, one coarse finer brick over its cell (3, 2, 2), one more over the cell
/// (7, 0, 2) of that. All cells are interpolated.
pub fn finer_bytes() -> Vec<u8> {
    let mut blob = Vec::new();
    // Units of a sample in a brick whose cells are 1/8^level mm.
    let units = |level: i32, low: f64, k: usize| {
        let cell = 0.125f64.powi(level);
        ((low + k as f64 * cell - 2.3) / cell * 4096.0)
            .clamp(-32767.0, 32767.0)
            .round()
    };
    let exact = |level: i32, low: f64| {
        move |blob: &mut Vec<u8>| {
            each(BRICK_SAMPLES, |_, _, k| {
                blob.extend((units(level, low, k) as i16).to_le_bytes());
            });
        }
    };
    // The finest covers z from 2.25 to 2.375 mm.
    let finest = append(&mut blob, exact(2, 2.25));
    let middle = append(&mut blob, |blob| {
        each(BRICK_SAMPLES, |_, _, k| {
            blob.push((units(1, 2.0, k) / 256.0).round().clamp(-127.0, 127.0) as i8 as u8);
        });
    });
    let coarsest = append(&mut blob, exact(0, 0.0));
    let over = |blob: &mut Vec<u8>, finer: [usize; 3]| {
        append(blob, |blob| {
            let mut cells = [0u8; CELLS_PER_BRICK];
            cells[finer[0] | finer[1] << 3 | finer[2] << 6] = 1;
            blob.extend(cells.chunks_exact(2).map(|pair| pair[0] | pair[1] << 4));
        })
    };
    let in_middle = over(&mut blob, [7, 0, 2]);
    let in_coarsest = over(&mut blob, [3, 2, 2]);
    // Palettes: the face; the face and the finer brick 0; the face and the finer brick 1.
    let roughly = Nearby::Roughly(0).to_bits(0);
    let mut palette = vec![roughly];
    for number in 0..2 {
        palette.extend([roughly, Nearby::finer_bits(2), number]);
    }
    palette.resize(palette.len() + 256, NO_FACE);
    let brick = |samples: u32, coarse: u8, palette: u32, indices: Option<u32>| BrickRecord {
        samples,
        indices: indices.unwrap_or(0),
        palette,
        palette_len: if indices.is_some() { 2 } else { 1 },
        index_bits: if indices.is_some() { 4 } else { 0 },
        coarse,
    };
    let field = FieldRecord {
        origin: [0.0; 3],
        cell: 0.001,
        scale: 0.001 / 4096.0,
        band: 0.006,
        brick_dims: [1; 3],
        format: FORMAT_I16,
        first_grid: 0,
        first_brick: 0,
        brick_count: 3,
    };
    Sections {
        parts: &[PartRecord {
            orientation: [0.0, 0.0, 0.0, 1.0],
            ..PartRecord::zeroed()
        }],
        shapes: &[ShapeRecord {
            face_count: 1,
            radius: 0.02,
            ..ShapeRecord::zeroed()
        }],
        fields: &[field],
        nodes: &[],
        points: &[],
        faces: &[FaceRecord {
            kind: surface_kind::PLANE,
            sense: 1.0,
            origin: [0.0, 0.0, 0.0023],
            axis: [0.0, 0.0, 1.0],
            ..FaceRecord::zeroed()
        }],
        patches: &[],
        bricks: &[
            brick(finest, 0, 0, None),
            brick(middle, 1, 1, Some(in_middle)),
            brick(coarsest, 0, 4, Some(in_coarsest)),
        ],
        palette: &palette,
        grid: &[GridEntry::Brick(2).to_bits()],
        blob: &blob,
        edges: &[],
        spans: &[],
    }
    .image()
}

/// The scene of [`bytes`] with two geometric energies behind it: [`energies`].
pub fn energy_bytes() -> Vec<u8> {
    let (records, charges, nodes) = energies();
    let mut bytes = bytes();
    let at = bytes.len();
    bytes.resize(at + size_of::<EnergyBlock>(), 0);
    let block = EnergyBlock {
        energies: section(&mut bytes, &records),
        charges: section(&mut bytes, &charges),
        nodes: section(&mut bytes, &nodes),
    };
    bytes[at..at + size_of::<EnergyBlock>()].copy_from_slice(bytes_of(&block));
    let length = bytes.len() as u32;
    let header: &mut Header = bytemuck::from_bytes_mut(&mut bytes[..size_of::<Header>()]);
    (header.energies, header.length) = (at as u32, length);
    let crc = CRC.checksum(&bytes[20..]);
    bytes[16..20].copy_from_slice(&crc.to_le_bytes());
    bytes
}

/// Part 1 in a lattice of 4 × 3 × 2 nodes of part 0, 2 mm apart, with three charges; part 2 in the same lattice's first two layers, with none.
pub fn energies() -> (Vec<EnergyRecord>, Vec<ChargeRecord>, Vec<[i8; 2]>) {
    let first = EnergyRecord {
        moving: 1,
        fixed: 0,
        first_node: 0,
        first_charge: 0,
        charge_count: 3,
        origin: [-0.001, 0.002, 0.004],
        step: 0.002,
        size: [4, 3, 2],
        reserved: 0,
        largest_force: 250.0,
        way: [0.0, 0.6, 0.8],
        across: core::array::from_fn(|i| 1e5 * i as f32),
        along: core::array::from_fn(|i| 1e4 * i as f32 + 7.0),
        turning: core::array::from_fn(|i| 10.0 + i as f32),
    };
    let second = EnergyRecord {
        moving: 2,
        first_charge: 3,
        charge_count: 0,
        size: [2, 2, 2],
        ..first
    };
    let charge = |at: [f32; 3], charge: [f32; 2]| ChargeRecord { at, charge };
    let charges = vec![
        charge([0.0, 0.001, 0.002], [0.01, 0.0]),
        charge([-0.003, 0.0, 0.0], [0.0, -0.02]),
        charge([0.0, 0.0, 0.005], [0.003, 0.004]),
    ];
    // No two nodes are equal, both ends of i8 among them.
    let nodes = (0..24i32)
        .map(|i| [(11 * i - 128).min(127) as i8, (127 - 7 * i) as i8])
        .collect();
    (vec![first, second], charges, nodes)
}

struct Sections<'a> {
    parts: &'a [PartRecord],
    shapes: &'a [ShapeRecord],
    fields: &'a [FieldRecord],
    nodes: &'a [NodeRecord],
    points: &'a [PointRecord],
    faces: &'a [FaceRecord],
    patches: &'a [PatchRecord],
    bricks: &'a [BrickRecord],
    palette: &'a [u16],
    grid: &'a [u16],
    blob: &'a [u8],
    edges: &'a [EdgeRecord],
    spans: &'a [SpanRecord],
}

impl Sections<'_> {
    fn image(&self) -> Vec<u8> {
        let mut bytes = vec![0u8; size_of::<Header>()];
        let mut header = Header {
            magic: MAGIC,
            layout: LAYOUT_VERSION,
            parts: section(&mut bytes, self.parts),
            shapes: section(&mut bytes, self.shapes),
            fields: section(&mut bytes, self.fields),
            nodes: section(&mut bytes, self.nodes),
            points: section(&mut bytes, self.points),
            faces: section(&mut bytes, self.faces),
            patches: section(&mut bytes, self.patches),
            bricks: section(&mut bytes, self.bricks),
            palette: section(&mut bytes, self.palette),
            grid: section(&mut bytes, self.grid),
            blob: section(&mut bytes, self.blob),
            edges: section(&mut bytes, self.edges),
            spans: section(&mut bytes, self.spans),
            ..Header::zeroed()
        };
        header.length = bytes.len() as u32;
        bytes[..size_of::<Header>()].copy_from_slice(bytes_of(&header));
        let crc = CRC.checksum(&bytes[20..]);
        bytes[16..20].copy_from_slice(&crc.to_le_bytes());
        bytes
    }
}

fn each(n: usize, mut visit: impl FnMut(usize, usize, usize)) {
    for z in 0..n {
        for y in 0..n {
            for x in 0..n {
                visit(x, y, z);
            }
        }
    }
}

fn append(blob: &mut Vec<u8>, write: impl FnOnce(&mut Vec<u8>)) -> u32 {
    blob.resize(blob.len().next_multiple_of(4), 0);
    let at = blob.len() as u32;
    write(blob);
    at
}

fn section<T: Pod>(bytes: &mut Vec<u8>, records: &[T]) -> Section {
    let section = Section {
        offset: bytes.len() as u32,
        count: records.len() as u32,
    };
    bytes.extend_from_slice(cast_slice(records));
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    section
}
