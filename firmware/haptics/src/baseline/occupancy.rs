//! Contact of a pointshell with a voxmap, by tangent planes.
//!
//! The textbook method (McNeely, Puterbaugh & Troy 1999, tangent-plane force model), kept for comparison with the distance field. A point of the held
//! part in a *surface* voxel meets a plane through the voxel's centre with the point's own normal. With n the point's inward normal, p the point and
//! c the centre, the gap is φ = (p − c)·n, and the force acts along n. So a contact has the same quantities as one from a distance field, and both
//! integrators accept both. The depth is wrong by up to half a voxel's diagonal, and jumps where a point moves from voxel to voxel.
//!
//! As in the paper: only points of the held part are used, none of the other's; *interior* voxels exert no force, they are flagged [`Flags::DEEP`];
//! *proximity* voxels only brake, and only with [`crate::Integrator::Explicit`]. Unlike the paper, the force layer is at the surface, not two voxels
//! outside.
//!
//! *Shrinking* (McNeely et al.; Faas 2010, section 4.1.1) moves the points inward along their normals, by up to a voxel of the held part. It is a
//! setting of the running law ([`crate::ContactSettings::shrinking`]). It rises at once, which only releases contacts, and falls so slowly that
//! points moving outward push no faster than a hand would.
//!
//! A point and a voxel name the faces that cross them, two each: the contact of a point and a voxel of guided faces is guided, as in the hybrid
//! method of Faas 2010, section 5.4.

use glam::Vec3;
use mortise_protocol::image::{Field, NO_FACE, PointRecord, Voxel, VoxelSample, oct_decode};

use crate::collision::contact::Phase;
use crate::collision::cost::MATING;
use crate::collision::directed_pair::DirectedPair;
use crate::collision::node_cursor::NodeCursor;
use crate::collision::rules::{FacePairRules, Mating};
use crate::collision::search::Traversal;
use crate::io::Flags;
use crate::math::scalar::inverse_sqrt;
use crate::settings::ContactSettings;

/// Tangent plane that a point meets.
pub(crate) struct TangentPlane {
    /// Gap of the point, m: negative beyond the plane.
    pub gap: f32,
    /// Inward normal of the point, the direction of the force, world.
    push: Vec3,
}

/// Inward normal of a point, tree frame.
#[inline]
pub(crate) fn inward(point: &PointRecord) -> Vec3 {
    let code = Vec3::from_array(oct_decode(point.normal));
    // The decoded normal is no shorter than 1/√3 (the octahedron's faces).
    code * -inverse_sqrt(code.length_squared())
}

impl TangentPlane {
    /// Plane through the centre of the voxel that `p` (field frame) lies in.
    #[inline]
    pub fn of(pair: &DirectedPair<'_>, inward: Vec3, p: Vec3, voxel: &VoxelSample) -> Self {
        let in_field = pair.to_field.turn(inward);
        Self {
            gap: (p - Vec3::from_array(voxel.center)).dot(in_field),
            push: pair.to_arm.turn(inward),
        }
    }
}

/// Position of a point moved inward by `by_m`, tree frame, m.
#[inline]
pub(crate) fn shrunk(point: &PointRecord, by_m: f32) -> [f32; 3] {
    if by_m > 0.0 {
        (Vec3::from_array(point.position) + inward(point) * by_m).to_array()
    } else {
        point.position
    }
}

impl ContactSettings {
    /// Distance by which points of the part with this field are moved inward, m.
    pub(crate) fn shrunk_m(&self, field: &Field<'_>) -> f32 {
        if field.is_occupancy() {
            self.shrinking * field.record().cell
        } else {
            0.0
        }
    }
}

impl<R: FacePairRules> Traversal<'_, '_, '_, R> {
    /// Queries one point and offers it as a contact. Returns a lower bound of its distance from any surface voxel, m.
    pub fn voxel(&mut self, pair: &DirectedPair<'_>, leaf: NodeCursor, point: &PointRecord) -> f32 {
        let position = shrunk(point, self.search.shrunk_m);
        let p = pair.to_field.apply(position);
        let sample = pair.field.voxel(p.to_array());
        let braking_m = self.search.braking_m;
        match sample.voxel {
            Voxel::Free => return sample.bound,
            Voxel::Interior => {
                self.work.flags.insert(Flags::DEEP);
                return 0.0;
            }
            Voxel::Proximity if braking_m <= 0.0 => return 0.0,
            Voxel::Proximity | Voxel::Surface => {}
        }
        self.near += 1;
        let plane = TangentPlane::of(pair, inward(point), p, &sample);
        let arm = pair.to_arm.apply(position);
        let n = plane.push;
        let turn = arm.cross(n) * self.search.inverse_length;
        let row = [n.x, n.y, n.z, turn.x, turn.y, turn.z];
        let approach = self.search.approach(&row);
        let mating = self.mating_of_voxels(pair, leaf, point, &sample);
        let (gap, wanted) = if sample.voxel == Voxel::Surface {
            let gap = plane.gap + mating.allowance_m;
            (gap, gap < self.search.slack + approach)
        } else {
            // The method knows only that the point is within the braking distance; it is a candidate while it approaches.
            (braking_m, approach > 0.0)
        };
        if !wanted {
            return 0.0;
        }
        self.count_candidate();
        let arm2 = arm.length_squared();
        let reach_gap = gap - self.search.swing * arm2;
        if let Some(contact) = self.contacts.offer(gap, reach_gap, arm2) {
            contact.row = row;
            contact.arm = arm;
            contact.rate = 0.0;
            contact.phase = Phase::Free;
            contact.guided = mating.guided;
            (contact.moving_face, contact.static_face) = (point.face, sample.faces[0]);
            (contact.moving_edge_face, contact.static_edge_face) = (point.edge_face, sample.faces[1]);
            contact.edges = [NO_FACE; 2];
            contact.single = false;
            contact.leaf = leaf;
        }
        0.0
    }

    /// Mating of the faces at a point and of those that cross its voxel.
    fn mating_of_voxels(
        &mut self,
        pair: &DirectedPair<'_>,
        leaf: NodeCursor,
        point: &PointRecord,
        sample: &VoxelSample,
    ) -> Mating {
        if !pair.guided {
            return Mating::NONE;
        }
        self.spent += MATING;
        let moving = [point.face, point.edge_face];
        self.mating_of(leaf, moving, sample.faces)
    }
}
