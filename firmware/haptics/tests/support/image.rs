//! Scene-image writer for analytic solids: exact distances sampled into 16-bit bricks, or voxels classified by them, and points under a median-split
//! tree.

use bytemuck::{Pod, Zeroable, bytes_of, cast_slice};
use mortise_protocol::image::*;

use super::solids::{Solid, SurfacePoint};

/// Width of the band in which distances are stored, cells.
const BAND_CELLS: f64 = 4.0;
const LEAF_POINTS: usize = 8;

/// An image under construction.
pub struct Writer {
    /// Cell edge, m.
    cell: f64,
    /// Voxmaps instead of distance fields.
    voxmaps: bool,
    /// Exact surfaces of faces, where solids have them.
    surfaces: bool,
    parts: Vec<PartRecord>,
    shapes: Vec<ShapeRecord>,
    fields: Vec<FieldRecord>,
    nodes: Vec<NodeRecord>,
    points: Vec<PointRecord>,
    faces: Vec<FaceRecord>,
    bricks: Vec<BrickRecord>,
    palette: Vec<u16>,
    grid: Vec<u16>,
    blob: Vec<u8>,
}

/// Finished bytes, aligned to 4.
pub struct Image(Vec<u32>);

/// A geometric energy: its record, whose numbers of nodes and charges the image states, and its arrays.
#[derive(Clone)]
pub struct EnergyParts {
    pub record: EnergyRecord,
    pub charges: Vec<ChargeRecord>,
    pub nodes: Vec<[i8; 2]>,
}

impl Image {
    /// The image as written to flash.
    pub fn bytes(&self) -> &[u8] {
        cast_slice(&self.0)
    }

    /// The image with these geometric energies behind it, and the rest as it is.
    pub fn with_energies(&self, energies: &[EnergyParts]) -> Self {
        let mut bytes = self.bytes().to_vec();
        let (mut records, mut charges, mut nodes) = (Vec::new(), Vec::new(), Vec::new());
        for energy in energies {
            records.push(EnergyRecord {
                first_node: nodes.len() as u32,
                first_charge: charges.len() as u32,
                charge_count: energy.charges.len() as u32,
                ..energy.record
            });
            charges.extend_from_slice(&energy.charges);
            nodes.extend_from_slice(&energy.nodes);
        }
        let at = bytes.len();
        bytes.resize(at + size_of::<EnergyBlock>(), 0);
        let block = EnergyBlock {
            energies: section(&mut bytes, &records),
            charges: section(&mut bytes, &charges),
            nodes: section(&mut bytes, &nodes),
        };
        bytes[at..at + size_of::<EnergyBlock>()].copy_from_slice(bytes_of(&block));
        pad(&mut bytes);
        let mut header = *self.open().header();
        header.energies = at as u32;
        Self::seal(bytes, header)
    }

    /// With this header, its length and its checksum.
    fn seal(mut bytes: Vec<u8>, mut header: Header) -> Self {
        header.length = bytes.len() as u32;
        bytes[..size_of::<Header>()].copy_from_slice(bytes_of(&header));
        header.crc = CRC.checksum(&bytes[20..]);
        bytes[..size_of::<Header>()].copy_from_slice(bytes_of(&header));
        let words = bytes.chunks_exact(4);
        Self(words.map(|b| u32::from_le_bytes(b.try_into().unwrap())).collect())
    }

    pub fn open(&self) -> SceneImage<'_> {
        SceneImage::open(cast_slice(&self.0)).expect("the writer makes valid images")
    }
}

impl Writer {
    /// Writer of distance fields with cells of this edge, m.
    pub fn new(cell: f64) -> Self {
        Self {
            cell,
            voxmaps: false,
            surfaces: false,
            parts: Vec::new(),
            shapes: Vec::new(),
            fields: Vec::new(),
            nodes: Vec::new(),
            points: Vec::new(),
            faces: Vec::new(),
            bricks: Vec::new(),
            palette: Vec::new(),
            grid: Vec::new(),
            blob: Vec::new(),
        }
    }

    /// Writer of voxmaps with voxels of this edge, m.
    pub fn voxmaps(cell: f64) -> Self {
        Self {
            voxmaps: true,
            ..Self::new(cell)
        }
    }

    /// Writer of distance fields with exact surfaces, which cells name where they are nearest.
    pub fn exact(cell: f64) -> Self {
        Self {
            surfaces: true,
            ..Self::new(cell)
        }
    }

    /// Adds a shape. Returns its index.
    pub fn shape(&mut self, solid: &dyn Solid) -> u32 {
        let field = if self.voxmaps {
            self.voxmap(solid)
        } else {
            self.field(solid)
        };
        let mut points = solid.points();
        let first_node = self.nodes.len() as u32;
        let first_point = self.points.len() as u32;
        let mut nodes = Vec::new();
        tree(&mut points, 0, &mut nodes);
        self.nodes.extend(&nodes);
        self.points.extend(points.iter().map(|p| PointRecord {
            position: p.position.map(|x| x as f32),
            normal: oct_encode(p.normal.map(|x| x as f32)),
            face: p.face,
            edge_face: p.edge_face.unwrap_or(NO_FACE),
            span: NO_SPAN,
            reserved: 0,
        }));
        let first_face = self.faces.len() as u32;
        let surfaces = self.surfaces;
        self.faces.extend((0..solid.face_count()).map(|face| {
            let surface = solid.surface(face as u16).filter(|_| surfaces);
            surface.unwrap_or_else(FaceRecord::zeroed)
        }));
        let half = solid.half_size();
        let mass = solid.mass_properties();
        self.shapes.push(ShapeRecord {
            field,
            flags: 0,
            first_node,
            node_count: nodes.len() as u32,
            first_point,
            point_count: points.len() as u32,
            first_face,
            face_count: solid.face_count(),
            first_patch: 0,
            patch_count: 0,
            center: [0.0; 3],
            radius: norm(half) as f32,
            volume: mass.0 as f32,
            center_of_mass: [0.0; 3],
            inertia: [
                mass.1[0] as f32,
                mass.1[1] as f32,
                mass.1[2] as f32,
                0.0,
                0.0,
                0.0,
            ],
            ..ShapeRecord::zeroed()
        });
        self.shapes.len() as u32 - 1
    }

    /// Places a shape. Returns the part's index.
    pub fn part(&mut self, shape: u32, grabbable: bool, position: [f32; 3], orientation: [f32; 4]) -> u16 {
        self.parts.push(PartRecord {
            shape,
            flags: if grabbable { PART_GRABBABLE } else { 0 },
            position,
            orientation,
        });
        self.parts.len() as u16 - 1
    }

    fn field(&mut self, solid: &dyn Solid) -> u32 {
        let half = solid.half_size();
        let cell = self.cell;
        let band = BAND_CELLS * cell;
        let brick = cell * BRICK_CELLS as f64;
        let dims = half.map(|h| (2.0 * (h + band) / brick).ceil() as usize);
        let origin = core::array::from_fn::<_, 3, _>(|a| -0.5 * brick * dims[a] as f64);
        let scale = band / 32767.0;
        let first_brick = self.bricks.len() as u32;
        let first_grid = self.grid.len() as u32;
        for index in 0..dims[0] * dims[1] * dims[2] {
            let b = [
                index % dims[0],
                index / dims[0] % dims[1],
                index / dims[0] / dims[1],
            ];
            let at = |c: [f64; 3]| -> [f64; 3] {
                core::array::from_fn(|a| origin[a] + cell * (c[a] + (b[a] * BRICK_CELLS) as f64))
            };
            let samples: Vec<f64> = (0..SAMPLES_PER_BRICK)
                .map(|i| {
                    let (n, n2) = (BRICK_SAMPLES, BRICK_SAMPLES * BRICK_SAMPLES);
                    solid.distance(at([(i % n) as f64, (i / n % n) as f64, (i / n2) as f64]))
                })
                .collect();
            let nearest = samples.iter().fold(f64::MAX, |m, d| m.min(d.abs()));
            let entry = if nearest <= band {
                self.brick(solid, &samples, scale, at);
                GridEntry::Brick((self.bricks.len() as u32 - 1 - first_brick) as u16)
            } else {
                // Any place in the brick is within half a cell's diagonal of a sample.
                GridEntry::Empty {
                    inside: samples[0] < 0.0,
                    cells: (nearest / cell - 0.87).floor().max(0.0) as u16,
                }
            };
            self.grid.push(entry.to_bits());
        }
        self.fields.push(FieldRecord {
            origin: origin.map(|x| x as f32),
            cell: cell as f32,
            scale: scale as f32,
            band: band as f32,
            brick_dims: dims.map(|d| d as u16),
            format: FORMAT_I16,
            first_grid,
            first_brick,
            brick_count: self.bricks.len() as u32 - first_brick,
        });
        self.fields.len() as u32 - 1
    }

    /// Every brick of the box is stored: culling uses the bricks and the box.
    fn voxmap(&mut self, solid: &dyn Solid) -> u32 {
        let cell = self.cell;
        let voxmap = Voxmap::of(solid, cell);
        let dims = voxmap.size.map(|n| n / BRICK_CELLS);
        let (first_brick, first_grid) = (self.bricks.len() as u32, self.grid.len() as u32);
        for index in 0..dims[0] * dims[1] * dims[2] {
            let b = [
                index % dims[0],
                index / dims[0] % dims[1],
                index / dims[0] / dims[1],
            ];
            pad(&mut self.blob);
            let samples = self.blob.len();
            let indices = samples + VOXEL_BRICK_BYTES;
            self.blob.resize(indices + CELLS_PER_BRICK / 2, 0);
            for i in 0..CELLS_PER_BRICK {
                let (n, n2) = (BRICK_CELLS, BRICK_CELLS * BRICK_CELLS);
                let at = [i % n + n * b[0], i / n % n + n * b[1], i / n2 + n * b[2]];
                self.blob[samples + i / 4] |= (voxmap.at(at) as u8) << (2 * (i % 4));
                let center: [f64; 3] =
                    std::array::from_fn(|a| voxmap.origin[a] + (at[a] as f64 + 0.5) * cell);
                // The nearest face; the last entry of the palette is none.
                let face = match voxmap.at(at) {
                    Voxel::Surface => solid.face(center) as u8,
                    _ => 15,
                };
                self.blob[indices + i / 2] |= face << (4 * (i % 2));
            }
            self.grid.push(GridEntry::Brick(index as u16).to_bits());
            self.bricks.push(BrickRecord {
                samples: samples as u32,
                indices: indices as u32,
                palette: self.palette.len() as u32,
                palette_len: 16,
                index_bits: 4,
                coarse: 0,
            });
        }
        self.palette.extend(0..15);
        self.palette.push(NO_FACE);
        self.fields.push(FieldRecord {
            origin: voxmap.origin.map(|x| x as f32),
            cell: cell as f32,
            scale: cell as f32,
            band: cell as f32,
            brick_dims: dims.map(|d| d as u16),
            format: FORMAT_OCCUPANCY,
            first_grid,
            first_brick,
            brick_count: self.bricks.len() as u32 - first_brick,
        });
        self.fields.len() as u32 - 1
    }

    fn brick(&mut self, solid: &dyn Solid, samples: &[f64], scale: f64, at: impl Fn([f64; 3]) -> [f64; 3]) {
        pad(&mut self.blob);
        let offset = self.blob.len() as u32;
        for d in samples {
            let q = (d / scale).round().clamp(-32767.0, 32767.0) as i16;
            self.blob.extend(q.to_le_bytes());
        }
        pad(&mut self.blob);
        let indices = self.blob.len() as u32;
        let mut entries: Vec<u16> = Vec::new();
        for i in 0..CELLS_PER_BRICK {
            let (n, n2) = (BRICK_CELLS, BRICK_CELLS * BRICK_CELLS);
            let center = [(i % n) as f64, (i / n % n) as f64, (i / n2) as f64].map(|c| c + 0.5);
            let face = solid.face(at(center));
            if !self.surfaces {
                self.blob.push(face as u8);
                continue;
            }
            let entry = match solid.surface(face) {
                Some(surface) if exact_in_cell(solid, &surface, center, &at) => Nearby::Face(face),
                _ => Nearby::Roughly(face),
            };
            let known = entries.iter().position(|&e| e == entry.to_bits(0));
            self.blob.push(known.unwrap_or(entries.len()) as u8);
            if known.is_none() {
                entries.push(entry.to_bits(0));
            }
        }
        let palette = self.palette.len() as u32;
        // Few entries are packed, as the baker does.
        let packed = self.surfaces && entries.len() <= 16;
        let (index_bits, values) = if packed { (4, 16) } else { (8, 256) };
        if packed {
            let wide = self.blob.split_off(indices as usize);
            self.blob
                .extend(wide.chunks_exact(2).map(|pair| pair[0] | pair[1] << 4));
        }
        let palette_len = if self.surfaces { entries.len() as u16 } else { 256 };
        entries.extend(entries.len() as u16..values);
        self.palette.extend(entries);
        self.bricks.push(BrickRecord {
            samples: offset,
            indices,
            palette,
            palette_len,
            index_bits,
            coarse: 0,
        });
    }

    pub fn finish(self) -> Image {
        let mut bytes = vec![0u8; size_of::<Header>()];
        let mut header = Header {
            magic: MAGIC,
            layout: LAYOUT_VERSION,
            ..Header::zeroed()
        };
        header.parts = section(&mut bytes, &self.parts);
        header.shapes = section(&mut bytes, &self.shapes);
        header.fields = section(&mut bytes, &self.fields);
        header.nodes = section(&mut bytes, &self.nodes);
        header.points = section(&mut bytes, &self.points);
        header.faces = section(&mut bytes, &self.faces);
        header.patches = section::<PatchRecord>(&mut bytes, &[]);
        header.bricks = section(&mut bytes, &self.bricks);
        header.palette = section(&mut bytes, &self.palette);
        header.grid = section(&mut bytes, &self.grid);
        header.blob = section(&mut bytes, &self.blob);
        header.edges = section::<EdgeRecord>(&mut bytes, &[]);
        header.spans = section::<SpanRecord>(&mut bytes, &[]);
        pad(&mut bytes);
        Image::seal(bytes, header)
    }
}

/// Voxels of a solid, in double precision.
pub struct Voxmap {
    /// Corner of voxel (0, 0, 0), m.
    pub origin: [f64; 3],
    pub cell: f64,
    /// Voxels along x, y, z: whole bricks.
    pub size: [usize; 3],
    voxels: Vec<Voxel>,
}

impl Voxmap {
    /// Classifies all voxels. A voxel is crossed when the distance changes its sign among 5³ places in it, corners included.
    pub fn of(solid: &dyn Solid, cell: f64) -> Self {
        const STEPS: usize = 5;
        let half = solid.half_size();
        let brick = cell * BRICK_CELLS as f64;
        let dims = half.map(|h| (2.0 * (h + 3.0 * cell) / brick).ceil() as usize);
        let size = dims.map(|d| d * BRICK_CELLS);
        let origin = core::array::from_fn::<_, 3, _>(|a| -0.5 * brick * dims[a] as f64);
        let place = |i: usize| [i % size[0], i / size[0] % size[1], i / size[0] / size[1]];
        let mut voxels: Vec<Voxel> = (0..size.iter().product())
            .map(|i| {
                let (mut low, mut high) = (f64::MAX, f64::MIN);
                for k in 0..STEPS.pow(3) {
                    let step = [k % STEPS, k / STEPS % STEPS, k / STEPS / STEPS];
                    let d = solid.distance(core::array::from_fn(|a| {
                        origin[a] + cell * (place(i)[a] as f64 + step[a] as f64 / (STEPS - 1) as f64)
                    }));
                    low = low.min(d);
                    high = high.max(d);
                }
                match (low < 0.0, high > 0.0) {
                    (true, true) => Voxel::Surface,
                    (true, false) => Voxel::Interior,
                    _ => Voxel::Free,
                }
            })
            .collect();
        let crossed: Vec<bool> = voxels.iter().map(|&v| v == Voxel::Surface).collect();
        let index = |at: [usize; 3]| at[0] + size[0] * (at[1] + size[1] * at[2]);
        for (i, voxel) in voxels.iter_mut().enumerate() {
            let at = place(i);
            let near = (0..27).any(|k| {
                let step = [k % 3, k / 3 % 3, k / 9];
                let other = core::array::from_fn(|a| (at[a] + step[a]).wrapping_sub(1));
                (0..3).all(|a| other[a] < size[a]) && crossed[index(other)]
            });
            if *voxel == Voxel::Free && near {
                *voxel = Voxel::Proximity;
            }
        }
        Self {
            origin,
            cell,
            size,
            voxels,
        }
    }

    /// Kind of a voxel; free beyond the box.
    pub fn at(&self, at: [usize; 3]) -> Voxel {
        if (0..3).any(|a| at[a] >= self.size[a]) {
            return Voxel::Free;
        }
        self.voxels[at[0] + self.size[0] * (at[1] + self.size[1] * at[2])]
    }

    /// The voxel at `p` (m, shape frame), and its centre.
    pub fn look_up(&self, p: [f64; 3]) -> (Voxel, [f64; 3]) {
        let g: [f64; 3] = core::array::from_fn(|a| ((p[a] - self.origin[a]) / self.cell).floor());
        let center = core::array::from_fn(|a| self.origin[a] + self.cell * (g[a] + 0.5));
        if g.iter().any(|&x| x < 0.0) {
            return (Voxel::Free, center);
        }
        (self.at(g.map(|x| x as usize)), center)
    }
}

/// Whether `surface` has the solid's distance at all corners of the cell with this centre.
fn exact_in_cell(
    solid: &dyn Solid,
    surface: &FaceRecord,
    center: [f64; 3],
    at: &impl Fn([f64; 3]) -> [f64; 3],
) -> bool {
    (0..8).all(|corner| {
        let p = at(core::array::from_fn(|a| {
            center[a] + f64::from(corner >> a & 1) - 0.5
        }));
        let from: [f64; 3] = core::array::from_fn(|a| p[a] - f64::from(surface.origin[a]));
        let along: f64 = (0..3).map(|a| from[a] * f64::from(surface.axis[a])).sum();
        let natural = match surface.kind {
            surface_kind::PLANE => along,
            surface_kind::CYLINDER => {
                (from.iter().map(|x| x * x).sum::<f64>() - along * along).sqrt() - f64::from(surface.radius)
            }
            _ => return false,
        };
        (natural * f64::from(surface.sense) - solid.distance(p)).abs() < 1e-8
    })
}

fn section<T: Pod>(bytes: &mut Vec<u8>, records: &[T]) -> Section {
    pad(bytes);
    let offset = bytes.len() as u32;
    bytes.extend_from_slice(cast_slice(records));
    Section {
        offset,
        count: records.len() as u32,
    }
}

fn pad(bytes: &mut Vec<u8>) {
    while !bytes.len().is_multiple_of(4) {
        bytes.push(0);
    }
}

/// Appends the preorder tree of `points` (whose first has index `first` in the shape), reordering them.
fn tree(points: &mut [SurfacePoint], first: usize, nodes: &mut Vec<NodeRecord>) {
    let low: [f64; 3] =
        core::array::from_fn(|a| points.iter().map(|p| p.position[a]).fold(f64::MAX, f64::min));
    let high: [f64; 3] =
        core::array::from_fn(|a| points.iter().map(|p| p.position[a]).fold(f64::MIN, f64::max));
    let center: [f64; 3] = core::array::from_fn(|a| 0.5 * (low[a] + high[a]));
    let radius = points
        .iter()
        .map(|p| norm(core::array::from_fn(|a| p.position[a] - center[a])))
        .fold(0.0, f64::max);
    let own = nodes.len();
    nodes.push(NodeRecord {
        center: center.map(|x| x as f32),
        // Covers the rounding of centre and points to single precision.
        radius: (radius * (1.0 + 1e-6) + 1e-8) as f32,
        first_point: first as u32,
        point_count: points.len() as u32,
        skip: 0,
    });
    if points.len() > LEAF_POINTS {
        let axis = (0..3)
            .max_by(|&a, &b| (high[a] - low[a]).total_cmp(&(high[b] - low[b])))
            .unwrap();
        points.sort_by(|p, q| p.position[axis].total_cmp(&q.position[axis]));
        let (left, right) = points.split_at_mut(points.len() / 2);
        let middle = first + left.len();
        tree(left, first, nodes);
        tree(right, middle, nodes);
    }
    nodes[own].skip = nodes.len() as u32;
}

fn norm(v: [f64; 3]) -> f64 {
    (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt()
}
