//! The records of a scene image, as stored in flash.

use bytemuck::{Pod, Zeroable};

/// First eight bytes of every scene image.
pub const MAGIC: [u8; 8] = *b"MORTISE\0";
/// Version of this layout. A change that an older reader would misread increments it; what an older reader passes over does not.
pub const LAYOUT_VERSION: u32 = 5;
/// Cells along a brick's edge.
pub const BRICK_CELLS: usize = 8;
/// Samples along a brick's edge: the last layer repeats the neighbour's first (shared apron).
pub const BRICK_SAMPLES: usize = BRICK_CELLS + 1;
/// Samples in a brick, x fastest.
pub const SAMPLES_PER_BRICK: usize = BRICK_SAMPLES * BRICK_SAMPLES * BRICK_SAMPLES;
/// Cells in a brick, x fastest.
pub const CELLS_PER_BRICK: usize = BRICK_CELLS * BRICK_CELLS * BRICK_CELLS;
/// No face: the second face of an interior point, or a palette entry without a face.
pub const NO_FACE: u16 = u16::MAX;

/// `count` records from byte `offset`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Section {
    /// Bytes from the image's start; a multiple of 4.
    pub offset: u32,
    /// Records (not bytes).
    pub count: u32,
}

/// First bytes of an image.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Header {
    /// [`MAGIC`].
    pub magic: [u8; 8],
    /// [`LAYOUT_VERSION`].
    pub layout: u32,
    /// Bytes in the whole image.
    pub length: u32,
    /// CRC-32/ISO-HDLC over bytes `20..length` (all that follows this field).
    pub crc: u32,
    /// Byte offset of the [`super::EnergyBlock`], a multiple of 4; 0: no energies. A reader that does not know it passes over them.
    pub energies: u32,
    /// [`PartRecord`]s.
    pub parts: Section,
    /// [`ShapeRecord`]s.
    pub shapes: Section,
    /// [`FieldRecord`]s.
    pub fields: Section,
    /// [`NodeRecord`]s.
    pub nodes: Section,
    /// [`PointRecord`]s.
    pub points: Section,
    /// [`FaceRecord`]s.
    pub faces: Section,
    /// [`PatchRecord`]s.
    pub patches: Section,
    /// [`BrickRecord`]s.
    pub bricks: Section,
    /// `u16` surface indices that bricks refer to.
    pub palette: Section,
    /// `u16` grid entries (see [`GridEntry`]).
    pub grid: Section,
    /// Bytes: field samples and cell-to-palette indices.
    pub blob: Section,
    /// [`super::EdgeRecord`]s.
    pub edges: Section,
    /// [`super::SpanRecord`]s.
    pub spans: Section,
}

/// The part may be grabbed and moved.
pub const PART_GRABBABLE: u32 = 1;

/// A placed part.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct PartRecord {
    /// Index of its shape.
    pub shape: u32,
    /// [`PART_GRABBABLE`] or 0 (fixed).
    pub flags: u32,
    /// Shape origin in the world, m.
    pub position: [f32; 3],
    /// Shape to world, unit quaternion x, y, z, w.
    pub orientation: [f32; 4],
}

/// The mesh behind the field was not closed: its sign is a best estimate.
pub const SHAPE_LEAKY: u32 = 1;
/// The solid is convex: a sphere, or spanned by its edges.
pub const SHAPE_CONVEX: u32 = 2;

/// Geometry shared by all parts that place it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct ShapeRecord {
    /// Index of its field.
    pub field: u32,
    /// [`SHAPE_LEAKY`], [`SHAPE_CONVEX`].
    pub flags: u32,
    /// Its nodes, in preorder.
    pub first_node: u32,
    /// Number of nodes.
    pub node_count: u32,
    /// Its points.
    pub first_point: u32,
    /// Number of points.
    pub point_count: u32,
    /// Its faces; face ids in points and surface indices in palettes count from here.
    pub first_face: u32,
    /// Number of faces.
    pub face_count: u32,
    /// Its patches; surface indices in palettes count its faces, then these.
    pub first_patch: u32,
    /// Number of patches.
    pub patch_count: u32,
    /// Centre of a sphere about the whole shape, m.
    pub center: [f32; 3],
    /// Its radius, m.
    pub radius: f32,
    /// Volume, m³.
    pub volume: f32,
    /// Centre of mass, m.
    pub center_of_mass: [f32; 3],
    /// Inertia about the centre of mass at unit density, m⁵: xx, yy, zz, xy, xz, yz.
    pub inertia: [f32; 6],
    /// Nodes of the tree over its edges.
    pub first_edge_node: u32,
    /// Number of nodes.
    pub edge_node_count: u32,
    /// Pieces of its sharp convex edges.
    pub first_edge: u32,
    /// Number of pieces.
    pub edge_count: u32,
    /// Spans of its points.
    pub first_span: u32,
    /// Number of spans.
    pub span_count: u32,
}

/// Samples are `i8`.
pub const FORMAT_I8: u16 = 1;
/// Samples are `i16`.
pub const FORMAT_I16: u16 = 2;
/// No distances: two bits for each cell (see [`super::Voxel`]).
pub const FORMAT_OCCUPANCY: u16 = 3;

/// A signed-distance field, or a voxmap, on bricks of 8³ cells, in its shape's frame.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct FieldRecord {
    /// Position of sample (0,0,0), m.
    pub origin: [f32; 3],
    /// Cell edge, m.
    pub cell: f32,
    /// Metres per unit of a sample; in a voxmap the cell's edge, which is not used.
    pub scale: f32,
    /// Distance from the surface up to which samples are exact; they are clamped beyond, m. In a voxmap: every free voxel is at least this far from
    /// any surface voxel.
    pub band: f32,
    /// Bricks along x, y, z.
    pub brick_dims: [u16; 3],
    /// [`FORMAT_I8`], [`FORMAT_I16`] or [`FORMAT_OCCUPANCY`].
    pub format: u16,
    /// Its grid entries: `dims.x·dims.y·dims.z` of them, x fastest.
    pub first_grid: u32,
    /// Its bricks.
    pub first_brick: u32,
    /// Number of bricks.
    pub brick_count: u32,
}

impl FieldRecord {
    /// Smallest margin around the surface in the grid, cells: everything within `band` − √3 cells of the surface is in stored bricks, so in the grid.
    /// 0 in a voxmap.
    pub fn padding(&self) -> f32 {
        // The root, rounded up by more than the quotient's possible error.
        const DIAGONAL: f32 = 1.7321;
        if self.format == FORMAT_OCCUPANCY {
            return 0.0;
        }
        (self.band / self.cell - DIAGONAL).max(0.0)
    }
}

/// One entry of a field's brick grid, as stored in 16 bits.
///
/// Bit 15 clear: the number of a brick (from `first_brick`). Bit 15 set: no brick; bit 14 distinguishes inside (1) from outside (0), bits 0–13 are a
/// lower bound of the distance to the surface (in a voxmap: to a surface voxel) from anywhere in the brick's volume, in cells, rounded down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GridEntry {
    /// The surface may be near.
    Brick(u16),
    /// No surface nearby.
    Empty {
        /// Whether this volume is inside the solid.
        inside: bool,
        /// Lower bound of the distance, in cells.
        cells: u16,
    },
}

impl GridEntry {
    /// Most bricks a field can number.
    pub const MAX_BRICKS: usize = 0x8000;
    /// Largest bound of an entry; larger distances are stored as this.
    pub const MAX_CELLS: u16 = 0x3fff;

    /// From its 16 bits: every pattern is valid.
    #[inline]
    pub const fn from_bits(bits: u16) -> Self {
        if bits & 0x8000 == 0 {
            Self::Brick(bits)
        } else {
            Self::Empty {
                inside: bits & 0x4000 != 0,
                cells: bits & Self::MAX_CELLS,
            }
        }
    }

    /// To its 16 bits. A bound that is too large is stored as [`Self::MAX_CELLS`]; a brick number must be below [`Self::MAX_BRICKS`].
    pub const fn to_bits(self) -> u16 {
        match self {
            Self::Brick(number) => number & 0x7fff,
            Self::Empty { inside, cells } => {
                let cells = if cells > Self::MAX_CELLS {
                    Self::MAX_CELLS
                } else {
                    cells
                };
                0x8000 | if inside { 0x4000 } else { 0 } | cells
            }
        }
    }
}

/// [`BrickRecord::samples`] of a brick without samples.
pub const NO_SAMPLES: u32 = u32::MAX;

/// One brick of a field.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct BrickRecord {
    /// Byte offset in the blob of its 9³ samples, or 8³ voxels; a multiple of 4. [`NO_SAMPLES`]: none, because surfaces answer in every cell.
    pub samples: u32,
    /// Byte offset in the blob of its 8³ palette indices (`index_bits` each, low nibble first); unused when `index_bits` is 0.
    pub indices: u32,
    /// First entry in the palette section.
    pub palette: u32,
    /// Entries in its palette, at least 1.
    pub palette_len: u16,
    /// 0 (whole brick is palette entry 0), 4 or 8.
    pub index_bits: u8,
    /// 1: its samples are the upper bytes of those of a field in [`FORMAT_I16`]; otherwise 0.
    pub coarse: u8,
}

/// A sphere about a run of points, or of pieces of edges: one node of a tree.
///
/// Preorder: children follow their parent; `skip` is the next node to visit when this one is culled. A leaf has `skip == own index + 1`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct NodeRecord {
    /// Centre, m, shape frame.
    pub center: [f32; 3],
    /// Radius, m.
    pub radius: f32,
    /// First point in the subtree, counted from the shape's first point.
    pub first_point: u32,
    /// Number of points in the subtree.
    pub point_count: u32,
    /// Next node when culled, counted from the shape's first node; greater than the node's own index.
    pub skip: u32,
}

impl NodeRecord {
    /// The points (or pieces of edges) of this node's subtree, given all of its shape. Empty for a record out of range, which an opened image cannot
    /// contain.
    #[inline]
    pub fn points<'a, T>(&self, all: &'a [T]) -> &'a [T] {
        let first = self.first_point as usize;
        all.get(first..first + self.point_count as usize).unwrap_or(&[])
    }
}

/// A sample of the exact surface: a point, or the middle of a span of a sharp convex edge.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct PointRecord {
    /// Position, m, shape frame.
    pub position: [f32; 3],
    /// Outward unit normal, octahedral (see [`oct_decode`]).
    pub normal: [i16; 2],
    /// Its face, counted from the shape's first.
    pub face: u16,
    /// The second face if the point is on an edge, else [`NO_FACE`].
    pub edge_face: u16,
    /// Its span, counted from the shape's first; [`super::NO_SPAN`]: none.
    pub span: u16,
    /// Zero.
    pub reserved: u16,
}

/// Kinds of surface in [`FaceRecord::kind`].
pub mod surface_kind {
    /// No closed form.
    pub const OTHER: u32 = 0;
    /// Plane through `origin` with normal `axis`.
    pub const PLANE: u32 = 1;
    /// Cylinder with its axis through `origin` along `axis`, and `radius`.
    pub const CYLINDER: u32 = 2;
    /// Cone with `radius` at `origin`, which grows along `axis` by tan(`second`).
    pub const CONE: u32 = 3;
    /// Sphere with centre `origin` and `radius`.
    pub const SPHERE: u32 = 4;
    /// Torus with centre `origin`, major `radius` and minor `second`.
    pub const TORUS: u32 = 5;
}

/// The exact surface under a B-rep face, in its shape's frame.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct FaceRecord {
    /// One of [`surface_kind`].
    pub kind: u32,
    /// +1 when the outward normal is the surface's natural one, −1 when reversed.
    pub sense: f32,
    /// Origin, m.
    pub origin: [f32; 3],
    /// Unit vector.
    pub axis: [f32; 3],
    /// Radius, m.
    pub radius: f32,
    /// Half angle (cone, rad) or minor radius (torus, m).
    pub second: f32,
}

/// Kinds of patch in [`PatchRecord::kind`].
pub mod patch_kind {
    /// A height over a tangent plane.
    pub const HEIGHT: u16 = 0;
    /// One side of an edge along which two faces continue each other smoothly.
    pub const SIDE: u16 = 1;
}

/// A local patch of a face without closed form: a height over a tangent plane, w = h(u, v), in its shape's frame.
///
/// A point p has u = (p − `origin`)·`x`, v = (p − `origin`)·(`normal` × `x`), w = (p − `origin`)·`normal`. The patch stands for its face only in cells
/// that name it.
///
/// Of kind [`patch_kind::SIDE`] it is no surface but one side of the surface that the normals along a line or circle sweep: with the distance ρ from the
/// axis through `origin` along `normal`, a point is on it where (ρ − `height[0]`)·`height[1]` + w·`height[2]` > 0. Its distance is a great positive one
/// there, else a great negative one: in a clause it limits another face to that side, or leaves it out.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct PatchRecord {
    /// Origin of the tangent plane, m.
    pub origin: [f32; 3],
    /// Unit vector in the plane, along u.
    pub x: [f32; 3],
    /// Unit normal of the plane, outward.
    pub normal: [f32; 3],
    /// Coefficients of h, in powers of metres: 1, u, v, u², uv, v², u³, u²v, uv², v³.
    pub height: [f32; 10],
    /// Largest √(u² + v²) of a foot, m: farther out the height means nothing.
    pub radius: f32,
    /// The face that it is a part of, counted from the shape's first.
    pub face: u16,
    /// One of [`patch_kind`].
    pub kind: u16,
}

/// Unit vector from its octahedral code (Cigolla et al. 2014, "A Survey of Efficient Representations for Independent Unit Vectors"):
/// error at most 6.5·10⁻⁵ rad. Any pattern decodes to a finite, non-zero vector; the result is not normalised.
#[inline]
pub fn oct_decode(code: [i16; 2]) -> [f32; 3] {
    let x = f32::from(code[0]) * (1.0 / 32767.0);
    let y = f32::from(code[1]) * (1.0 / 32767.0);
    let z = 1.0 - x.abs() - y.abs();
    if z >= 0.0 {
        [x, y, z]
    } else {
        [(1.0 - y.abs()) * sign(x), (1.0 - x.abs()) * sign(y), z]
    }
}

/// Octahedral code of a unit vector; zero or non-finite input gives +z.
pub fn oct_encode(v: [f32; 3]) -> [i16; 2] {
    let norm = v[0].abs() + v[1].abs() + v[2].abs();
    if norm.is_nan() || norm.is_infinite() || norm < 1e-30 {
        return [0, 0];
    }
    let (mut x, mut y) = (v[0] / norm, v[1] / norm);
    if v[2] < 0.0 {
        (x, y) = ((1.0 - y.abs()) * sign(x), (1.0 - x.abs()) * sign(y));
    }
    [round(x * 32767.0), round(y * 32767.0)]
}

#[inline]
fn sign(x: f32) -> f32 {
    if x < 0.0 { -1.0 } else { 1.0 }
}

fn round(x: f32) -> i16 {
    (if x < 0.0 { x - 0.5 } else { x + 0.5 }) as i16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_have_the_documented_sizes() {
        assert_eq!(size_of::<Header>(), 128);
        assert_eq!(size_of::<PartRecord>(), 36);
        assert_eq!(size_of::<ShapeRecord>(), 120);
        assert_eq!(size_of::<FieldRecord>(), 44);
        assert_eq!(size_of::<BrickRecord>(), 16);
        assert_eq!(size_of::<NodeRecord>(), 28);
        assert_eq!(size_of::<PointRecord>(), 24);
        assert_eq!(size_of::<super::super::SpanRecord>(), 28);
        assert_eq!(size_of::<super::super::EdgeRecord>(), 60);
        assert_eq!(size_of::<FaceRecord>(), 40);
        assert_eq!(size_of::<PatchRecord>(), 84);
    }

    #[test]
    fn octahedral_code_is_close_everywhere() {
        let mut worst = 0.0f32;
        for i in 0..200 {
            for j in 0..200 {
                let z = -1.0 + 2.0 * (i as f32 + 0.5) / 200.0;
                let r = (1.0 - z * z).max(0.0);
                let r = r.powf(0.5);
                let a = j as f32 * 0.031_415_93;
                let v = [r * a.cos(), r * a.sin(), z];
                let d = oct_decode(oct_encode(v));
                let n = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).powf(0.5);
                let dot = (d[0] * v[0] + d[1] * v[1] + d[2] * v[2]) / n;
                let cross = [
                    d[1] * v[2] - d[2] * v[1],
                    d[2] * v[0] - d[0] * v[2],
                    d[0] * v[1] - d[1] * v[0],
                ];
                let sin = (cross[0].powi(2) + cross[1].powi(2) + cross[2].powi(2)).powf(0.5) / n;
                assert!(dot > 0.0);
                worst = worst.max(sin);
            }
        }
        // Half a step in x and y is 1/65534; z changes by both together, so the error is √6/65534 in the octahedron's face, and seen from the centre
        // at distance 1/√3, where the face is nearest, √18/65534.
        assert!(worst < 6.5e-5, "{worst}");
    }
}
