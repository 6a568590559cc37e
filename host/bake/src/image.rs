//! Assembly of the scene image.

use bytemuck::{Pod, Zeroable, bytes_of, cast_slice};
use glam::{DAffine3, DVec3};
use mortise_brep::{Face, Shape, Surface};
use mortise_protocol::image::{
    BrickRecord, CRC, EdgeRecord, FaceRecord, FieldRecord, Header, LAYOUT_VERSION, MAGIC, NO_FACE,
    NO_SAMPLES, NO_SPAN, NodeRecord, PART_GRABBABLE, PartRecord, PatchRecord, PointRecord, SHAPE_CONVEX,
    SHAPE_LEAKY, Section, ShapeRecord, SpanRecord, oct_encode, surface_kind,
};

use crate::edges::EdgePiece;
use crate::field::BakedField;
use crate::grid::bounding_box;
use crate::report::ByteCount;
use crate::shell::Pointshell;
use crate::tree::{build_edge_tree, build_tree, edge_node_count, round_up};

/// Placement of a part in the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PartPlacement {
    /// Number of its shape, in the order in which shapes were added.
    pub shape: u32,
    /// Shape to world, mm.
    pub placement: DAffine3,
    /// Whether it may be grabbed.
    pub grabbable: bool,
}

/// Collects shapes and parts, then writes the image. Takes millimetres, writes metres.
#[derive(Default)]
pub struct ImageBuilder {
    parts: Vec<PartRecord>,
    shapes: Vec<ShapeRecord>,
    fields: Vec<FieldRecord>,
    nodes: Vec<NodeRecord>,
    points: Vec<PointRecord>,
    faces: Vec<FaceRecord>,
    patches: Vec<PatchRecord>,
    bricks: Vec<BrickRecord>,
    palette: Vec<u16>,
    grid: Vec<u16>,
    blob: Vec<u8>,
    edges: Vec<EdgeRecord>,
    spans: Vec<SpanRecord>,
}

/// Padding after the palettes: the last palette runs must cover every value their indices can take.
pub(crate) const PALETTE_PADDING: usize = 256;

/// Bytes of this many pieces of edges and of the tree over them.
pub(crate) fn edge_bytes(pieces: usize) -> usize {
    pieces * size_of::<EdgeRecord>() + edge_node_count(pieces) * size_of::<NodeRecord>()
}

/// Bytes of a pointshell, without the tree over it.
pub(crate) fn shell_bytes(shell: &Pointshell) -> usize {
    let spans = shell.points.iter().filter(|p| p.span.is_some()).count();
    shell.points.len() * size_of::<PointRecord>() + spans * size_of::<SpanRecord>()
}

impl ImageBuilder {
    /// An image with nothing in it.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a shape with its field, pointshell and edges, and whether it is convex; returns its number and the bytes it takes.
    pub(crate) fn add_shape(
        &mut self,
        shape: &Shape,
        field: BakedField,
        shell: &Pointshell,
        edges: &[EdgePiece],
        convex: bool,
    ) -> (u32, ByteCount) {
        let meters = |p: DVec3| (p / 1000.0).as_vec3().to_array();
        let positions: Vec<[f32; 3]> = shell.points.iter().map(|p| meters(p.position)).collect();
        let offsets: Vec<f32> = shell.offsets.iter().map(|mm| (mm / 1000.0) as f32).collect();
        let hulls: Vec<_> = shell.points.iter().map(|p| p.hull().map(meters)).collect();
        let tree = build_tree(&hulls, &offsets);
        let hulls: Vec<_> = edges.iter().map(EdgePiece::hull).collect();
        let edge_tree = build_edge_tree(&hulls);
        let (lo, hi) = bounding_box(shape);
        let center = ((lo + hi) / 2000.0).as_vec3();
        // Half the diagonal contains the tessellation; the exact surface can bulge past it, by less than the grid's own margin of a cell.
        let radius = tree
            .nodes
            .first()
            .map_or(0.0, |n| f64::from(n.radius))
            .max((hi - lo).length() / 2000.0)
            + f64::from(field.record.cell);
        let i = shape.inertia_mm5;
        // mm⁵ to m⁵.
        let inertia = [i[0][0], i[1][1], i[2][2], i[0][1], i[0][2], i[1][2]].map(|v| (v * 1e-15) as f32);
        let number = self.shapes.len() as u32;
        self.shapes.push(ShapeRecord {
            field: self.fields.len() as u32,
            flags: if shape.closed { 0 } else { SHAPE_LEAKY } | if convex { SHAPE_CONVEX } else { 0 },
            first_node: self.nodes.len() as u32,
            node_count: tree.nodes.len() as u32,
            first_point: self.points.len() as u32,
            point_count: positions.len() as u32,
            first_face: self.faces.len() as u32,
            face_count: shape.faces.len() as u32,
            first_patch: self.patches.len() as u32,
            patch_count: field.patches.len() as u32,
            center: center.to_array(),
            radius: round_up(radius),
            volume: (shape.volume_mm3 * 1e-9) as f32,
            center_of_mass: meters(shape.center_of_mass),
            inertia,
            first_edge_node: (self.nodes.len() + tree.nodes.len()) as u32,
            edge_node_count: edge_tree.nodes.len() as u32,
            first_edge: self.edges.len() as u32,
            edge_count: edges.len() as u32,
            first_span: self.spans.len() as u32,
            span_count: shell.points.iter().filter(|p| p.span.is_some()).count() as u32,
        });
        let bytes = ByteCount {
            samples: field.sample_bytes,
            indices: field.blob.len() - field.sample_bytes,
            grid: field.grid.len() * 2,
            bricks: field.bricks.len() * size_of::<BrickRecord>(),
            palette: field.palette.len() * 2,
            points: shell_bytes(shell),
            nodes: tree.nodes.len() * size_of::<NodeRecord>(),
            faces: shape.faces.len() * size_of::<FaceRecord>(),
            edges: edge_bytes(edges.len()),
            patches: field.patches.len() * size_of::<PatchRecord>(),
            records: size_of::<ShapeRecord>() + size_of::<FieldRecord>(),
        };
        self.nodes.extend(tree.nodes);
        self.nodes.extend(edge_tree.nodes);
        self.edges
            .extend(edge_tree.order.iter().map(|&old| edges[old as usize].record()));
        let first_span = self.spans.len();
        for &old in &tree.order {
            let p = &shell.points[old as usize];
            let span = p.span.map(|span| {
                self.spans.push(SpanRecord {
                    along: meters(span.along),
                    bend: meters(span.bend),
                    round: span.round.min(1.0) as f32,
                });
                (self.spans.len() - 1 - first_span) as u16
            });
            self.points.push(PointRecord {
                position: positions[old as usize],
                normal: oct_encode(p.normal.as_vec3().to_array()),
                face: p.face,
                edge_face: p.edge_face,
                span: span.unwrap_or(NO_SPAN),
                reserved: 0,
            });
        }
        self.faces
            .extend(shape.faces.iter().map(|face| face_record(face, (lo, hi))));
        self.patches.extend(&field.patches);
        self.add_field(field);
        (number, bytes)
    }

    fn add_field(&mut self, field: BakedField) {
        self.blob.resize(self.blob.len().next_multiple_of(4), 0);
        let blob_at = self.blob.len() as u32;
        let palette_at = self.palette.len() as u32;
        self.fields.push(FieldRecord {
            first_grid: self.grid.len() as u32,
            first_brick: self.bricks.len() as u32,
            ..field.record
        });
        self.bricks.extend(field.bricks.iter().map(|b| BrickRecord {
            samples: match b.samples {
                NO_SAMPLES => NO_SAMPLES,
                at => at + blob_at,
            },
            indices: if b.index_bits == 0 { 0 } else { b.indices + blob_at },
            palette: b.palette + palette_at,
            ..*b
        }));
        self.grid.extend(field.grid);
        self.palette.extend(field.palette);
        self.blob.extend(field.blob);
    }

    /// Adds a part.
    pub fn add_part(&mut self, part: &PartPlacement) {
        let (_, rotation, translation) = part.placement.to_scale_rotation_translation();
        let q = rotation.normalize();
        self.parts.push(PartRecord {
            shape: part.shape,
            flags: if part.grabbable { PART_GRABBABLE } else { 0 },
            position: (translation / 1000.0).as_vec3().to_array(),
            orientation: [q.x as f32, q.y as f32, q.z as f32, q.w as f32],
        });
    }

    /// Bytes the image will have.
    pub fn len(&self) -> u64 {
        let padded = |bytes: usize| bytes.next_multiple_of(4) as u64;
        size_of::<Header>() as u64
            + padded(size_of_val(self.parts.as_slice()))
            + padded(size_of_val(self.shapes.as_slice()))
            + padded(size_of_val(self.fields.as_slice()))
            + padded(size_of_val(self.nodes.as_slice()))
            + padded(size_of_val(self.points.as_slice()))
            + padded(size_of_val(self.faces.as_slice()))
            + padded(size_of_val(self.patches.as_slice()))
            + padded(size_of_val(self.bricks.as_slice()))
            + padded(2 * (self.palette.len() + PALETTE_PADDING))
            + padded(size_of_val(self.grid.as_slice()))
            + padded(self.blob.len())
            + padded(size_of_val(self.edges.as_slice()))
            + padded(size_of_val(self.spans.as_slice()))
    }

    /// Whether the image has no shapes and no parts.
    pub fn is_empty(&self) -> bool {
        self.parts.is_empty() && self.shapes.is_empty()
    }

    /// Returns the image. The caller ensures that [`Self::len`] fits 32 bits.
    pub fn finish(mut self) -> Vec<u8> {
        self.palette.extend([NO_FACE; PALETTE_PADDING]);
        let mut bytes = vec![0; size_of::<Header>()];
        let mut header = Header {
            magic: MAGIC,
            layout: LAYOUT_VERSION,
            parts: append(&mut bytes, &self.parts),
            shapes: append(&mut bytes, &self.shapes),
            fields: append(&mut bytes, &self.fields),
            nodes: append(&mut bytes, &self.nodes),
            points: append(&mut bytes, &self.points),
            faces: append(&mut bytes, &self.faces),
            patches: append(&mut bytes, &self.patches),
            bricks: append(&mut bytes, &self.bricks),
            palette: append(&mut bytes, &self.palette),
            grid: append(&mut bytes, &self.grid),
            blob: append(&mut bytes, &self.blob),
            edges: append(&mut bytes, &self.edges),
            spans: append(&mut bytes, &self.spans),
            ..Header::zeroed()
        };
        header.length = bytes.len() as u32;
        bytes[..size_of::<Header>()].copy_from_slice(bytes_of(&header));
        header.crc = CRC.checksum(&bytes[20..]);
        bytes[..size_of::<Header>()].copy_from_slice(bytes_of(&header));
        bytes
    }
}

// Records are written as they lie in memory; the image is little-endian.
const _: () = assert!(cfg!(target_endian = "little"), "scene images are little-endian");

fn append<T: Pod>(bytes: &mut Vec<u8>, records: &[T]) -> Section {
    let section = Section {
        offset: bytes.len() as u32,
        count: records.len() as u32,
    };
    bytes.extend_from_slice(cast_slice(records));
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    section
}

/// Record of the exact surface of a face, in metres. `sense` is the B-rep's; `bounds` are the corners of the shape's bounding box, mm.
fn face_record(face: &Face, bounds: (DVec3, DVec3)) -> FaceRecord {
    let sense = if face.reversed { -1.0 } else { 1.0 };
    let of = |kind: u32, frame: &mortise_brep::Frame, radius: f64, second: f64| FaceRecord {
        kind,
        sense,
        origin: (frame.origin / 1000.0).as_vec3().to_array(),
        axis: frame.z.as_vec3().to_array(),
        radius: radius as f32,
        second: second as f32,
    };
    match near_the_shape(face.surface, bounds) {
        Surface::Plane { frame } => of(surface_kind::PLANE, &frame, 0.0, 0.0),
        Surface::Cylinder { frame, radius } => of(surface_kind::CYLINDER, &frame, radius / 1000.0, 0.0),
        Surface::Cone {
            frame,
            radius,
            half_angle,
        } => of(surface_kind::CONE, &frame, radius / 1000.0, half_angle),
        Surface::Sphere { frame, radius } => of(surface_kind::SPHERE, &frame, radius / 1000.0, 0.0),
        Surface::Torus { frame, major, minor } => {
            of(surface_kind::TORUS, &frame, major / 1000.0, minor / 1000.0)
        }
        Surface::Spline => FaceRecord {
            sense,
            ..FaceRecord::zeroed()
        },
    }
}

/// The same surface with its origin beside the shape, where the file's is farther from the shape's middle than the shape is long. The board computes
/// in single precision, of which an origin half a kilometre away leaves no tenth of a millimetre; files with such planes and axes exist.
fn near_the_shape(mut surface: Surface, (low, high): (DVec3, DVec3)) -> Surface {
    let middle = (low + high) / 2.0;
    let far = |origin: DVec3| origin.distance(middle) > (high - low).length();
    match &mut surface {
        Surface::Plane { frame } if far(frame.origin) => {
            frame.origin = middle - frame.z * (middle - frame.origin).dot(frame.z);
        }
        Surface::Cylinder { frame, .. } if far(frame.origin) => {
            frame.origin += frame.z * (middle - frame.origin).dot(frame.z);
        }
        Surface::Cone {
            frame,
            radius,
            half_angle,
        } if far(frame.origin) => {
            let along = (middle - frame.origin).dot(frame.z);
            frame.origin += frame.z * along;
            *radius += along * half_angle.tan();
        }
        _ => {}
    }
    surface
}
