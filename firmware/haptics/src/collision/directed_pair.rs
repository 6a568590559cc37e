//! Directed pair: the tree of one part against the field of the other, with the transforms between their frames.

use core::cell::Cell as Count;

use glam::{Mat3, Vec3};
use mortise_protocol::image::{
    BRICK_CELLS, Cell, EdgeRecord, Field, FieldRecord, Nearby, NodeRecord, Place, PointRecord, Shape,
    SpanRecord, Surfaces,
};

use crate::collision::exact_surface::exact;
use crate::collision::node_key::Keys;
use crate::collision::rules::ExcludedPairs;
use crate::collision::span::{Span, weight};
use crate::math::pose::Pose;

/// Rounding error of a position in a field, relative to the lengths summed: eight roundings of 2⁻²⁴ at most.
const ROUNDING: f32 = 1.0 / (1 << 20) as f32;

/// Tree of one part, field of the other, and the transforms between their frames: all that a search of this pair reads of the two parts, found once
/// for each search.
pub(crate) struct DirectedPair<'i> {
    pub index: u16,
    pub backward: bool,
    /// Whether a target guides the held part towards this part.
    pub guided: bool,
    /// Face pairs that contact exclusions keep apart.
    pub excluded: ExcludedPairs,
    pub nodes: &'i [NodeRecord],
    /// Keys of the nodes in the coherence tables.
    pub keys: Keys,
    pub points: &'i [PointRecord],
    pub spans: &'i [SpanRecord],
    pub edges: EdgeTree<'i>,
    /// Edges of the field's shape.
    pub field_edges: EdgeTree<'i>,
    pub field: Field<'i>,
    /// Record of the field of the tree's own shape.
    pub own_field: &'i FieldRecord,
    /// Exact surfaces of the field's shape.
    pub surfaces: Surfaces<'i>,
    /// Tree frame to field frame.
    pub to_field: Affine,
    /// Tree frame to lever arm (from the held part's centre of mass, world axes).
    pub to_arm: Affine,
    /// Field gradient to the direction, in the world, that pushes the held part away.
    pub to_push: Mat3,
    /// Surfaces of the edges and corners named by cells that were read, since [`Self::surfaces_read`] was last asked.
    read: Count<u32>,
}

/// Pieces of sharp convex edges under their tree.
#[derive(Clone, Copy)]
pub(crate) struct EdgeTree<'i> {
    pub nodes: &'i [NodeRecord],
    pub pieces: &'i [EdgeRecord],
}

impl<'i> EdgeTree<'i> {
    fn of(shape: &Shape<'i>) -> Self {
        Self {
            nodes: shape.edge_nodes,
            pieces: shape.edges,
        }
    }
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

    /// The point that [`Self::apply`] takes to `p`.
    pub fn unapply(&self, p: Vec3) -> Vec3 {
        self.linear.transpose_mul_vec3(p - self.offset)
    }

    /// Its rotation.
    pub fn rotation(&self) -> &Mat3 {
        &self.linear
    }

    /// Rotates a direction.
    #[inline]
    pub fn turn(&self, direction: Vec3) -> Vec3 {
        self.linear * direction
    }
}

impl<'i> DirectedPair<'i> {
    /// Whether the method does not use this direction: points of the other part against a voxmap of the held part.
    pub fn unused(&self) -> bool {
        self.backward && self.field.is_occupancy()
    }

    /// Position in the tree's frame of a point `p` of the field's, m.
    pub fn in_tree(&self, p: Vec3) -> [f32; 3] {
        self.to_field.unapply(p).to_array()
    }

    /// The span of a point of the tree, in the frame of the field; `None` for a point that stands for itself alone.
    #[inline(always)]
    pub fn span(&self, point: &PointRecord) -> Option<Span> {
        let record = self.spans.get(usize::from(point.span))?;
        Some(Span::placed(
            record,
            self.to_field.apply(point.position),
            &self.to_field.linear,
        ))
    }

    /// The `point`, which is the middle of a span, moved to `u` on it.
    pub fn moved(&self, point: &PointRecord, u: f32) -> PointRecord {
        let mut at = Vec3::from_array(point.position);
        if let Some(span) = self.spans.get(usize::from(point.span)) {
            at += Vec3::from_array(span.along) * u + Vec3::from_array(span.bend) * weight(span.round, u);
        }
        PointRecord {
            position: at.to_array(),
            ..*point
        }
    }

    /// Lower bound of the distance between the two shapes, m, by the axes of the boxes of their fields: positive where one of them separates the boxes.
    pub fn box_gap(&self) -> f32 {
        let [field, tree] = [self.field.record(), self.own_field].map(|record| {
            let half =
                Vec3::from_array(record.brick_dims.map(f32::from)) * (0.5 * BRICK_CELLS as f32 * record.cell);
            (Vec3::from_array(record.origin) + half, half)
        });
        let apart = self.to_field.apply(tree.0.to_array()) - field.0;
        let turn = self.to_field.linear;
        let sizes = Mat3::from_cols(turn.x_axis.abs(), turn.y_axis.abs(), turn.z_axis.abs());
        let across_field = apart.abs() - field.1 - sizes * tree.1;
        let across_tree = turn.transpose_mul_vec3(apart).abs() - tree.1 - sizes.transpose_mul_vec3(field.1);
        let extent = apart.abs().element_sum() + self.to_field.offset.abs().element_sum();
        across_field.max(across_tree).max_element() - ROUNDING * extent
    }

    /// Corners of a box that contains a point of the tree, or its span, in cells from the corner of the field's grid.
    pub fn in_cells(&self, point: &PointRecord) -> [Vec3; 2] {
        let in_field = self.to_field.apply(point.position);
        let half = self.span(point).map_or(Vec3::ZERO, |span| span.half_size());
        [in_field - half, in_field + half].map(|p| Vec3::from_array(self.field.in_cells(p.to_array())))
    }

    /// The one surface named by every cell within `clearance_m` of any of these points of the tree, if there is only one; at most `reads` reads, counted
    /// as in [`Field::all_at`].
    pub fn only_face_near<'p>(
        &self,
        points: impl Iterator<Item = &'p PointRecord>,
        clearance_m: f32,
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
                face = Some(cell.surface()?);
            }
            let half = self.span(point).map_or(Vec3::ZERO, |span| span.half_size());
            (low, high) = (low.min(in_field - half), high.max(in_field + half));
        }
        let extent = self.field.extent_m() + self.to_field.offset.abs().element_sum();
        let clearance = Vec3::splat(clearance_m + ROUNDING * extent);
        let [low, high] = [low - clearance, high + clearance].map(|p| self.field.in_cells(p.to_array()));
        face.filter(|face| self.field.all_at(low, high, &mut reads, *face))
    }

    /// Signed distance from `p` (tree frame, m) to the field's shape, or a bound; from exact surfaces where they are known.
    #[inline(always)]
    pub fn distance(&self, p: [f32; 3]) -> f32 {
        let in_field = self.to_field.apply(p);
        match self.field.place(in_field.to_array()) {
            Place::Cell(cell) => match exact(self.surfaces, self.nearby(&cell), in_field) {
                Some((distance, _)) => distance,
                None => self.field.distance(&cell),
            },
            Place::Far { inside: false, bound } => bound,
            Place::Far { inside: true, bound } => -bound,
        }
    }

    /// Surfaces that a cell names, each of which is then evaluated.
    #[inline(always)]
    pub fn nearby(&self, cell: &Cell<'_>) -> Nearby {
        let nearby = self.field.nearby(cell);
        if let Nearby::Convex(group) | Nearby::Reentrant(group) = nearby {
            self.read.set(self.read.get() + group.count());
        }
        nearby
    }

    /// Number of surfaces in the groups that cells named since this was last asked.
    pub fn surfaces_read(&self) -> u32 {
        self.read.take()
    }

    /// Directed pair `index` (odd: backward) of a held part and another one, each with its placement; `center` is the held part's centre of mass in
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
            keys: Keys::new(index, tree.nodes.len() + tree.edge_nodes.len()),
            points: tree.points,
            spans: tree.spans,
            edges: EdgeTree::of(tree),
            field_edges: EdgeTree::of(field),
            field: field.field,
            own_field: tree.field.record(),
            surfaces: field.surfaces(),
            to_field,
            to_arm: Affine {
                linear: rotation,
                offset: tree_pose.position - center,
            },
            to_push: field_pose.rotation() * if backward { -1.0 } else { 1.0 },
            read: Count::new(0),
        }
    }
}
