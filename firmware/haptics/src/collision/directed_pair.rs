//! One way round of one pair of parts: the tree of one, the field of the other, and the way between their frames.

use glam::{Mat3, Vec3};
use mortise_protocol::image::{FaceRecord, Field, NodeRecord, Place, PointRecord, Shape};

use crate::collision::exact_surface::exact;
use crate::collision::node_key::Keys;
use crate::collision::rules::ExcludedPairs;
use crate::math::pose::Pose;

/// A position in a field is off by less than this times the lengths it is summed up from: eight roundings of 2⁻²⁴ at most.
const ROUNDING: f32 = 1.0 / (1 << 20) as f32;

/// Trees and fields of one pair, and the way between their frames.
pub(crate) struct DirectedPair<'i> {
    pub index: u16,
    pub backward: bool,
    /// A target guides to this part.
    pub guided: bool,
    /// Faces that exclusions keep apart.
    pub excluded: ExcludedPairs,
    pub nodes: &'i [NodeRecord],
    /// What is known of them goes by these.
    pub keys: Keys,
    pub points: &'i [PointRecord],
    pub field: Field<'i>,
    /// Exact surfaces of the field's shape.
    pub faces: &'i [FaceRecord],
    /// Tree frame to field frame.
    pub to_field: Affine,
    /// Tree frame to arm (from the held part's centre of mass, world axes).
    pub to_arm: Affine,
    /// Field gradient to the direction, in the world, that pushes the held part away.
    pub to_push: Mat3,
}

#[derive(Clone, Copy)]
pub(crate) struct Affine {
    linear: Mat3,
    offset: Vec3,
}

impl Affine {
    #[inline]
    pub fn apply(&self, p: [f32; 3]) -> Vec3 {
        self.linear * Vec3::from_array(p) + self.offset
    }

    /// A direction.
    #[inline]
    pub fn turn(&self, direction: Vec3) -> Vec3 {
        self.linear * direction
    }
}

impl<'i> DirectedPair<'i> {
    /// Whether this way round is not part of the method: points of the other part against a voxmap of the held one.
    pub fn left_out(&self) -> bool {
        self.backward && self.field.is_occupancy()
    }

    /// A point of the tree in cells from the corner of the field's grid.
    pub fn in_cells(&self, point: &PointRecord) -> [f32; 3] {
        let in_field = self.to_field.apply(point.position);
        self.field.in_cells(in_field.to_array())
    }

    /// The face that every cell within `free_m` of any of these points of the tree names all over, if it is one; at a cost of `reads` at most, as of
    /// [`Field::all_at`].
    pub fn only_face_near<'p>(
        &self,
        points: impl Iterator<Item = &'p PointRecord>,
        free_m: f32,
        mut reads: u32,
    ) -> Option<u16> {
        let mut face = None;
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for point in points {
            let in_field = self.to_field.apply(point.position);
            if face.is_none() {
                let Place::Cell(cell) = self.field.place(in_field.to_array()) else {
                    return None;
                };
                face = Some(cell.face()?);
            }
            (low, high) = (low.min(in_field), high.max(in_field));
        }
        let extent = self.field.extent_m() + self.to_field.offset.abs().element_sum();
        let free = Vec3::splat(free_m + ROUNDING * extent);
        let [low, high] = [low - free, high + free].map(|p| self.field.in_cells(p.to_array()));
        face.filter(|face| self.field.all_at(low, high, &mut reads, *face))
    }

    /// Signed distance of the field's shape from `p` (tree frame), or a bound: by exact surfaces where they are known.
    #[inline(always)]
    pub fn distance(&self, p: [f32; 3]) -> f32 {
        let in_field = self.to_field.apply(p);
        match self.field.place(in_field.to_array()) {
            Place::Cell(cell) => match exact(self.faces, self.field.nearby(&cell), in_field) {
                Some((distance, _)) => distance,
                None => self.field.distance(&cell),
            },
            Place::Far { inside: false, bound } => bound,
            Place::Far { inside: true, bound } => -bound,
        }
    }

    /// DirectedPair `index` (odd: backward) of a held part and another one, each with its placement; `center` is the held part's centre of mass in
    /// the world.
    pub fn new(index: u16, held: (&Shape<'i>, Pose), other: (&Shape<'i>, Pose), center: Vec3) -> Self {
        let backward = !index.is_multiple_of(2);
        let ((tree, tree_pose), (field, field_pose)) = if backward { (other, held) } else { (held, other) };
        let back = field_pose.rotation().transpose();
        let apart = tree_pose.position - field_pose.position;
        let rotation = tree_pose.rotation();
        let to_field = Affine {
            linear: back * rotation,
            offset: back * apart,
        };
        Self {
            index,
            backward,
            guided: false,
            excluded: ExcludedPairs::new(),
            nodes: tree.nodes,
            keys: Keys::new(index, tree.nodes.len()),
            points: tree.points,
            field: field.field,
            faces: field.faces,
            to_field,
            to_arm: Affine {
                linear: rotation,
                offset: tree_pose.position - center,
            },
            to_push: field_pose.rotation() * if backward { -1.0 } else { 1.0 },
        }
    }
}
