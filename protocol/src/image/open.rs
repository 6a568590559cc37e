//! Opening a scene image: all checks are made once, so that later accesses cannot fail.

use bytemuck::{Pod, try_cast_slice};
use crc::{CRC_32_ISO_HDLC, Crc};

use super::edge::{EdgeRecord, NO_SPAN, SpanRecord};
use super::energy::{ChargeRecord, Energy, EnergyBlock, EnergyRecord};
use super::error::ImageError;
use super::field::Field;
use super::nearby::{Group, Nearby};
use super::occupancy::VOXEL_BRICK_BYTES;
use super::records::*;
use super::surfaces::Surfaces;

/// The checksum of images and frames.
pub const CRC: Crc<u32, crc::Table<1>> = Crc::<u32, crc::Table<1>>::new(&CRC_32_ISO_HDLC);

const SECTION_PARTS: u8 = 0;
const SECTION_SHAPES: u8 = 1;
const SECTION_FIELDS: u8 = 2;
const SECTION_NODES: u8 = 3;
const SECTION_POINTS: u8 = 4;
const SECTION_FACES: u8 = 5;
const SECTION_PATCHES: u8 = 6;
const SECTION_BRICKS: u8 = 7;
const SECTION_PALETTE: u8 = 8;
const SECTION_GRID: u8 = 9;
const SECTION_BLOB: u8 = 10;
const SECTION_EDGES: u8 = 11;
const SECTION_SPANS: u8 = 12;
const SECTION_ENERGIES: u8 = 13;
const SECTION_CHARGES: u8 = 14;
const SECTION_ENERGY_NODES: u8 = 15;

/// A scene image, read in place.
#[derive(Clone, Copy, Debug)]
pub struct SceneImage<'a> {
    header: &'a Header,
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
    energies: &'a [EnergyRecord],
    charges: &'a [ChargeRecord],
    energy_nodes: &'a [[i8; 2]],
}

/// One shape of an image with its arrays.
#[derive(Clone, Copy, Debug)]
pub struct Shape<'a> {
    /// Counts and quantities of the whole shape.
    pub record: &'a ShapeRecord,
    /// Pointshell tree, preorder.
    pub nodes: &'a [NodeRecord],
    /// Pointshell.
    pub points: &'a [PointRecord],
    /// B-rep faces.
    pub faces: &'a [FaceRecord],
    /// Tree over the edges, preorder.
    pub edge_nodes: &'a [NodeRecord],
    /// Pieces of sharp convex edges.
    pub edges: &'a [EdgeRecord],
    /// Spans of its points.
    pub spans: &'a [SpanRecord],
    /// Local patches of faces without closed form.
    pub patches: &'a [PatchRecord],
    /// Signed distance.
    pub field: Field<'a>,
}

impl<'a> Shape<'a> {
    /// Surfaces that the field's palettes name.
    #[inline(always)]
    pub fn surfaces(&self) -> Surfaces<'a> {
        Surfaces {
            faces: self.faces,
            patches: self.patches,
        }
    }
}

impl<'a> SceneImage<'a> {
    /// Checks `bytes` (which may be longer than the image) and opens the image in place.
    ///
    /// The time is proportional to the image's size: the checksum reads every byte once. Do not call it in the tick.
    pub fn open(bytes: &'a [u8]) -> Result<Self, ImageError> {
        let got = bytes.len() as u32;
        let head = bytes.get(..size_of::<Header>()).ok_or(ImageError::TooShort {
            needed: size_of::<Header>() as u32,
            got,
        })?;
        let header: &'a Header = bytemuck::try_from_bytes(head).map_err(|_| ImageError::Misaligned)?;
        if header.magic != MAGIC {
            return Err(ImageError::BadMagic);
        }
        if header.layout != LAYOUT_VERSION {
            return Err(ImageError::Layout {
                expected: LAYOUT_VERSION,
                found: header.layout,
            });
        }
        let bytes = bytes
            .get(..header.length as usize)
            .filter(|b| b.len() >= size_of::<Header>())
            .ok_or(ImageError::TooShort {
                needed: header.length.max(size_of::<Header>() as u32),
                got,
            })?;
        let found = CRC.checksum(&bytes[20..]);
        if found != header.crc {
            return Err(ImageError::Crc {
                expected: header.crc,
                found,
            });
        }
        let block = energy_block(bytes, header)?;
        let image = Self {
            header,
            parts: section(bytes, header.parts, SECTION_PARTS)?,
            shapes: section(bytes, header.shapes, SECTION_SHAPES)?,
            fields: section(bytes, header.fields, SECTION_FIELDS)?,
            nodes: section(bytes, header.nodes, SECTION_NODES)?,
            points: section(bytes, header.points, SECTION_POINTS)?,
            faces: section(bytes, header.faces, SECTION_FACES)?,
            patches: section(bytes, header.patches, SECTION_PATCHES)?,
            bricks: section(bytes, header.bricks, SECTION_BRICKS)?,
            palette: section(bytes, header.palette, SECTION_PALETTE)?,
            grid: section(bytes, header.grid, SECTION_GRID)?,
            blob: section(bytes, header.blob, SECTION_BLOB)?,
            edges: section(bytes, header.edges, SECTION_EDGES)?,
            spans: section(bytes, header.spans, SECTION_SPANS)?,
            energies: section(bytes, block.energies, SECTION_ENERGIES)?,
            charges: section(bytes, block.charges, SECTION_CHARGES)?,
            energy_nodes: section(bytes, block.nodes, SECTION_ENERGY_NODES)?,
        };
        image.check()?;
        Ok(image)
    }

    /// The header.
    pub fn header(&self) -> &'a Header {
        self.header
    }

    /// The placed parts.
    pub fn parts(&self) -> &'a [PartRecord] {
        self.parts
    }

    /// Number of shapes.
    pub fn shape_count(&self) -> usize {
        self.shapes.len()
    }

    /// Shape `index`. Panics when `index >= shape_count()`.
    pub fn shape(&self, index: usize) -> Shape<'a> {
        let record = &self.shapes[index];
        let field = &self.fields[record.field as usize];
        let entries = grid_len(field) as usize;
        Shape {
            record,
            nodes: run(self.nodes, record.first_node, record.node_count),
            points: run(self.points, record.first_point, record.point_count),
            faces: run(self.faces, record.first_face, record.face_count),
            edge_nodes: run(self.nodes, record.first_edge_node, record.edge_node_count),
            edges: run(self.edges, record.first_edge, record.edge_count),
            spans: run(self.spans, record.first_span, record.span_count),
            patches: run(self.patches, record.first_patch, record.patch_count),
            field: Field {
                record: field,
                grid: &self.grid[field.first_grid as usize..][..entries],
                bricks: run(self.bricks, field.first_brick, field.brick_count),
                palette: self.palette,
                blob: self.blob,
                inverse_cell: 1.0 / field.cell,
                cells: field.brick_dims.map(|d| f32::from(d) * BRICK_CELLS as f32),
                padding: field.padding(),
            },
        }
    }

    /// The shape that part `index` places. Panics when there is no such part.
    pub fn shape_of_part(&self, index: usize) -> Shape<'a> {
        self.shape(self.parts[index].shape as usize)
    }

    /// Numbers of nodes of that shape: of its pointshell, and of its edges. Panics when there is no such part.
    pub fn nodes_of_part(&self, index: usize) -> [usize; 2] {
        let record = &self.shapes[self.parts[index].shape as usize];
        [record.node_count, record.edge_node_count].map(|count| count as usize)
    }

    /// The surfaces of that shape alone, for a quarter of the instructions. Panics when there is no such part.
    pub fn surfaces_of_part(&self, index: usize) -> Surfaces<'a> {
        let record = &self.shapes[self.parts[index].shape as usize];
        Surfaces {
            faces: run(self.faces, record.first_face, record.face_count),
            patches: run(self.patches, record.first_patch, record.patch_count),
        }
    }

    /// Number of geometric energies.
    pub fn energy_count(&self) -> usize {
        self.energies.len()
    }

    /// Geometric energy `index`; `None` when there is no such one.
    pub fn energy(&self, index: usize) -> Option<Energy<'a>> {
        let record = self.energies.get(index)?;
        Some(Energy {
            record,
            charges: run(self.charges, record.first_charge, record.charge_count),
            nodes: &self.energy_nodes[record.first_node as usize..][..record.node_count() as usize],
        })
    }

    fn check(&self) -> Result<(), ImageError> {
        each(self.parts, SECTION_PARTS, |part| {
            let q = part.orientation;
            let norm2 = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
            (part.shape as usize) < self.shapes.len()
                && finite(&part.position)
                && finite(&q)
                && (norm2 - 1.0).abs() < 1e-3
        })?;
        each(self.shapes, SECTION_SHAPES, |shape| {
            (shape.field as usize) < self.fields.len()
                && fits(shape.first_node, shape.node_count, self.nodes.len())
                && fits(shape.first_point, shape.point_count, self.points.len())
                && fits(shape.first_face, shape.face_count, self.faces.len())
                && fits(shape.first_edge_node, shape.edge_node_count, self.nodes.len())
                && fits(shape.first_edge, shape.edge_count, self.edges.len())
                && fits(shape.first_span, shape.span_count, self.spans.len())
                && shape.face_count <= u32::from(NO_FACE)
                && fits(shape.first_patch, shape.patch_count, self.patches.len())
                && finite(&shape.center)
                && finite(&shape.center_of_mass)
                && finite(&shape.inertia)
                && shape.radius.is_finite()
                && shape.radius >= 0.0
                && shape.volume.is_finite()
        })?;
        each(self.fields, SECTION_FIELDS, |field| {
            finite(&field.origin)
                && field.cell.is_finite()
                && field.cell > 0.0
                && (1.0 / field.cell).is_finite()
                && field.scale.is_finite()
                && field.scale > 0.0
                // No sample and no difference of samples overflows, neither in metres nor per cell.
                && (field.scale * 32768.0).is_finite()
                && (field.scale / field.cell * 131_072.0).is_finite()
                && field.band.is_finite()
                && field.band >= 0.0
                && brick_bytes(field.format).is_some()
                && field.brick_count as usize <= GridEntry::MAX_BRICKS
                && fits(field.first_brick, field.brick_count, self.bricks.len())
                && u32::try_from(grid_len(field)).is_ok_and(|n| fits(field.first_grid, n, self.grid.len()))
                && self.grid[field.first_grid as usize..][..grid_len(field) as usize]
                    .iter()
                    .all(|&bits| match GridEntry::from_bits(bits) {
                        GridEntry::Brick(number) => u32::from(number) < field.brick_count,
                        GridEntry::Empty { .. } => true,
                    })
                && run(self.bricks, field.first_brick, field.brick_count)
                    .iter()
                    .all(|b| {
                        let needs_none = b.samples == NO_SAMPLES && field.format != FORMAT_OCCUPANCY;
                        needs_none
                            || b.samples.is_multiple_of(4)
                                && sample_bytes(field.format, b)
                                    .is_some_and(|n| fits(b.samples, n as u32, self.blob.len()))
                    })
        })?;
        each(self.bricks, SECTION_BRICKS, |brick| {
            let indices_fit = match brick.index_bits {
                0 => true,
                4 => fits(brick.indices, (CELLS_PER_BRICK / 2) as u32, self.blob.len()),
                8 => fits(brick.indices, CELLS_PER_BRICK as u32, self.blob.len()),
                _ => false,
            };
            let indices_fit = indices_fit && brick.coarse <= 1;
            // Indices are not checked one by one: the palette run must cover every value they can take.
            indices_fit
                && fits(brick.palette, 1 << brick.index_bits, self.palette.len())
                && brick.palette_len >= 1
                && u32::from(brick.palette_len) <= 1 << brick.index_bits
        })?;
        for (index, shape) in self.shapes.iter().enumerate() {
            let nodes = run(self.nodes, shape.first_node, shape.node_count);
            let edge_nodes = run(self.nodes, shape.first_edge_node, shape.edge_node_count);
            let good = is_tree(nodes, shape.point_count) && is_tree(edge_nodes, shape.edge_count);
            let points = run(self.points, shape.first_point, shape.point_count);
            let good = good
                && points.iter().all(|p| {
                    finite(&p.position)
                        && u32::from(p.face) < shape.face_count
                        && (p.edge_face == NO_FACE || u32::from(p.edge_face) < shape.face_count)
                        && (p.span == NO_SPAN || u32::from(p.span) < shape.span_count)
                });
            let edges = run(self.edges, shape.first_edge, shape.edge_count);
            let good = good && edges.iter().all(|e| is_edge(e, shape.face_count));
            let patches = run(self.patches, shape.first_patch, shape.patch_count);
            let good = good && patches.iter().all(|p| u32::from(p.face) < shape.face_count);
            if !good {
                return Err(ImageError::Record {
                    section: SECTION_SHAPES,
                    index: index as u32,
                });
            }
            self.check_finer_bricks(shape)?;
            self.check_bricks_without_samples(shape)?;
        }
        each(self.patches, SECTION_PATCHES, |patch| {
            patch.kind <= patch_kind::SIDE
                && finite(&patch.origin)
                && finite(&patch.x)
                && finite(&patch.normal)
                && finite(&patch.height)
                && patch.radius.is_finite()
        })?;
        each(self.spans, SECTION_SPANS, |span| {
            finite(&span.along) && finite(&span.bend) && (0.0..=1.0).contains(&span.round)
        })?;
        self.check_energies()?;
        each(self.faces, SECTION_FACES, |face| {
            face.kind <= surface_kind::TORUS
                && finite(&face.origin)
                && finite(&face.axis)
                && finite(&[face.sense, face.radius, face.second])
        })
    }

    fn check_energies(&self) -> Result<(), ImageError> {
        let parts = self.parts.len();
        each(self.energies, SECTION_ENERGIES, |energy| {
            usize::from(energy.moving) < parts
                && usize::from(energy.fixed) < parts
                && energy.moving != energy.fixed
                && energy.is_usable()
                && fits(energy.first_charge, energy.charge_count, self.charges.len())
                && u32::try_from(energy.node_count())
                    .is_ok_and(|n| fits(energy.first_node, n, self.energy_nodes.len()))
        })?;
        each(self.charges, SECTION_CHARGES, |charge| {
            finite(&charge.at) && finite(&charge.charge)
        })
    }

    /// Whether every finer brick of a shape's field has a smaller number than the one that names it, so that none is within itself.
    fn check_finer_bricks(&self, shape: &ShapeRecord) -> Result<(), ImageError> {
        let field = &self.fields[shape.field as usize];
        let bricks = run(self.bricks, field.first_brick, field.brick_count);
        let is_smaller = |(own, brick): (usize, &BrickRecord)| {
            let palette = &self.palette[brick.palette as usize..];
            let entries = palette.iter().take(usize::from(brick.palette_len));
            (entries.filter_map(|&bits| Nearby::finer(bits, palette))).all(|number| usize::from(number) < own)
        };
        match bricks.iter().enumerate().position(|brick| !is_smaller(brick)) {
            Some(number) => Err(ImageError::Record {
                section: SECTION_BRICKS,
                index: field.first_brick + number as u32,
            }),
            None => Ok(()),
        }
    }

    /// Whether every cell of a brick without samples names surfaces of `shape` that give its distance: faces with a closed form, or patches.
    fn check_bricks_without_samples(&self, shape: &ShapeRecord) -> Result<(), ImageError> {
        let field = &self.fields[shape.field as usize];
        let bricks = run(self.bricks, field.first_brick, field.brick_count);
        let faces = run(self.faces, shape.first_face, shape.face_count);
        let gives = |surface: u16| match faces.get(usize::from(surface)) {
            Some(face) => face.kind != surface_kind::OTHER,
            None => u32::from(surface) - shape.face_count < shape.patch_count,
        };
        for (number, brick) in bricks.iter().enumerate() {
            if brick.samples != NO_SAMPLES {
                continue;
            }
            let palette = &self.palette[brick.palette as usize..];
            let answers = |index: u8| {
                let entry = palette.get(usize::from(index));
                let entry = entry.filter(|_| u16::from(index) < brick.palette_len);
                if entry.is_some_and(|&bits| Nearby::finer(bits, palette).is_some()) {
                    return true;
                }
                let group = |at: u16| Group::read(palette.get(usize::from(at)..)?);
                match entry.map(|&bits| Nearby::from_bits(bits, group)) {
                    Some(Nearby::Face(surface)) => gives(surface),
                    Some(Nearby::Convex(group) | Nearby::Reentrant(group)) => {
                        group.faces().all(|(surface, _)| gives(surface))
                    }
                    Some(Nearby::Unknown | Nearby::Roughly(_)) | None => false,
                }
            };
            let indices = self.blob.get(brick.indices as usize..).unwrap_or(&[]);
            let good = match brick.index_bits {
                0 => answers(0),
                4 => (indices.iter().take(CELLS_PER_BRICK / 2))
                    .all(|pair| answers(pair & 15) && answers(pair >> 4)),
                _ => indices.iter().take(CELLS_PER_BRICK).all(|&index| answers(index)),
            };
            if !good {
                return Err(ImageError::Record {
                    section: SECTION_BRICKS,
                    index: field.first_brick + number as u32,
                });
            }
        }
        Ok(())
    }
}

/// Whether these are the nodes of a tree over `count` items, in preorder.
fn is_tree(nodes: &[NodeRecord], count: u32) -> bool {
    nodes.iter().enumerate().all(|(i, node)| {
        finite(&node.center)
            && node.radius.is_finite()
            && node.radius >= 0.0
            && fits(node.first_point, node.point_count, count as usize)
            && node.skip as usize > i
            && node.skip as usize <= nodes.len()
    })
}

/// Whether the numbers of a piece of an edge are usable.
fn is_edge(edge: &EdgeRecord, faces: u32) -> bool {
    finite(&edge.center)
        && finite(&edge.half)
        && finite(&edge.bend)
        && edge.thickness.is_finite()
        && edge.thickness >= 0.0
        && edge.radius.is_finite()
        && edge.radius >= 0.0
        && edge.faces.iter().all(|&face| u32::from(face) < faces)
}

/// Bytes of this brick's samples; `None` for a format that this side does not know, or that cannot be coarse.
fn sample_bytes(format: u16, brick: &BrickRecord) -> Option<usize> {
    match brick.coarse {
        0 => brick_bytes(format),
        _ => (format == FORMAT_I16).then_some(SAMPLES_PER_BRICK),
    }
}

/// Bytes of a brick's samples; `None` for a format that this side does not know.
fn brick_bytes(format: u16) -> Option<usize> {
    match format {
        FORMAT_I8 => Some(SAMPLES_PER_BRICK),
        FORMAT_I16 => Some(2 * SAMPLES_PER_BRICK),
        FORMAT_OCCUPANCY => Some(VOXEL_BRICK_BYTES),
        _ => None,
    }
}

fn grid_len(field: &FieldRecord) -> u64 {
    field.brick_dims.iter().map(|&d| u64::from(d)).product()
}

/// Where the energies are; empty sections for an image without them.
fn energy_block(bytes: &[u8], header: &Header) -> Result<EnergyBlock, ImageError> {
    if header.energies == 0 {
        let nothing = Section {
            offset: size_of::<Header>() as u32,
            count: 0,
        };
        return Ok(EnergyBlock {
            energies: nothing,
            charges: nothing,
            nodes: nothing,
        });
    }
    let at = Section {
        offset: header.energies,
        count: 1,
    };
    let blocks: &[EnergyBlock] = section(bytes, at, SECTION_ENERGIES)?;
    (blocks.first().copied()).ok_or(ImageError::Section {
        section: SECTION_ENERGIES,
    })
}

fn section<T: Pod>(bytes: &[u8], section: Section, number: u8) -> Result<&[T], ImageError> {
    let bad = ImageError::Section { section: number };
    let offset = section.offset as usize;
    let length = (section.count as usize).checked_mul(size_of::<T>()).ok_or(bad)?;
    let end = offset.checked_add(length).ok_or(bad)?;
    if !section.offset.is_multiple_of(4) || offset < size_of::<Header>() || end > bytes.len() {
        return Err(bad);
    }
    try_cast_slice(&bytes[offset..end]).map_err(|_| ImageError::Misaligned)
}

fn fits(first: u32, count: u32, len: usize) -> bool {
    u64::from(first) + u64::from(count) <= len as u64
}

fn run<T>(all: &[T], first: u32, count: u32) -> &[T] {
    &all[first as usize..][..count as usize]
}

fn finite(values: &[f32]) -> bool {
    values.iter().all(|v| v.is_finite())
}

fn each<T>(records: &[T], section: u8, good: impl Fn(&T) -> bool) -> Result<(), ImageError> {
    match records.iter().position(|r| !good(r)) {
        None => Ok(()),
        Some(index) => Err(ImageError::Record {
            section,
            index: index as u32,
        }),
    }
}
