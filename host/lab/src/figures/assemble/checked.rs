//! Ways checked by engines that share nothing with the search: distances of fine meshes by parry3d, and the exact distance every 10 µm of travel.

use std::path::Path as File;

use glam::{DAffine3, DVec3};
use mortise_brep::{CadModel, LoadOptions, Shape, load_step_with};
use mortise_task::removal::Path;
use mortise_task::{Assembly, Moved};
use parry3d_f64::query::PointQueryWithLocation as _;
use parry3d_f64::shape::{TriMesh, TriMeshFlags};

use super::assembly_file::{load, refused};
use crate::LabError;

/// Travel between two checks by the meshes, and by the exact distance, mm.
const MESH_STEP_MM: f64 = 0.1;
const EXACT_STEP_MM: f64 = 0.01;
/// Deviation of the meshes, spacing of points along their edges, and distance within which points are looked at, mm.
pub const DEVIATION_MM: f64 = 0.002;
const ALONG_MM: f64 = 0.3;
const WITHIN_MM: f64 = 0.5;

/// Overlaps on checked ways beyond those of the file, mm.
#[derive(Clone, Copy, Debug, Default)]
pub struct Overlap {
    /// By meshes.
    pub meshes_mm: f64,
    /// By the exact distance.
    pub exact_mm: f64,
    /// Ways checked.
    pub ways: usize,
}

impl Overlap {
    /// The larger of both, and all ways.
    pub fn and(self, other: Self) -> Self {
        Self {
            meshes_mm: self.meshes_mm.max(other.meshes_mm),
            exact_mm: self.exact_mm.max(other.exact_mm),
            ways: self.ways + other.ways,
        }
    }
}

/// A shape as a fine mesh: its triangles, and points of its surface.
struct Fine {
    mesh: TriMesh,
    points: Vec<DVec3>,
}

impl Fine {
    fn new(shape: &Shape) -> Option<Self> {
        let vertices = shape.mesh.vertices.iter().map(|p| p.to_array().into()).collect();
        let mesh =
            TriMesh::with_flags(vertices, shape.mesh.triangles.clone(), TriMeshFlags::ORIENTED).ok()?;
        let mut points: Vec<DVec3> = shape.mesh.vertices.clone();
        for edge in &shape.edges {
            for pair in edge.polyline.windows(2) {
                let steps = (pair[0].distance(pair[1]) / ALONG_MM).ceil() as usize;
                points.extend((1..steps).map(|i| pair[0].lerp(pair[1], i as f64 / steps as f64)));
            }
        }
        Some(Self { mesh, points })
    }

    /// Depth of the deepest of `points`, moved by `to` into the mesh's frame, mm; 0 where none is inside.
    fn depth(&self, points: &[DVec3], to: DAffine3) -> f64 {
        let bounds = self.mesh.local_aabb();
        let (low, high) = (
            DVec3::from_array(bounds.mins.into()) - WITHIN_MM,
            DVec3::from_array(bounds.maxs.into()) + WITHIN_MM,
        );
        points
            .iter()
            .map(|p| to.transform_point3(*p))
            .filter(|p| p.clamp(low, high) == *p)
            .filter_map(|p| {
                let at = p.to_array().into();
                let (near, _) = self
                    .mesh
                    .project_local_point_and_get_location_with_max_dist(at, false, WITHIN_MM)?;
                near.is_inside
                    .then(|| p.distance(DVec3::from_array(near.point.into())))
            })
            .fold(0.0, f64::max)
    }
}

/// An assembly with its meshes.
pub struct Checked {
    /// The assembly, as the search takes it.
    pub assembly: Assembly,
    fine: Vec<Fine>,
    model: CadModel,
}

impl Checked {
    /// Reads a file twice: as the search does, and with fine meshes.
    ///
    /// # Errors
    /// A file that cannot be used.
    pub fn load(file: &File) -> Result<Self, LabError> {
        let options = LoadOptions {
            linear_deflection_mm: Some(DEVIATION_MM),
            angular_deflection_rad: 0.1,
            ..LoadOptions::default()
        };
        let model = load_step_with(file, &options)?;
        let fine: Option<Vec<Fine>> = model.shapes.iter().map(Fine::new).collect();
        Ok(Self {
            assembly: load(file)?,
            fine: fine.ok_or_else(|| refused(file, &std::io::Error::other("a part has no mesh")))?,
            model,
        })
    }

    /// Depth of parts `a`, moved by `by`, and `b` by their meshes, mm.
    fn depth(&self, a: usize, b: usize, by: DAffine3) -> f64 {
        let [pa, pb] = [a, b].map(|p| &self.model.parts[p]);
        let (xa, xb) = (by * pa.placement, pb.placement);
        let (fa, fb) = (&self.fine[pa.shape], &self.fine[pb.shape]);
        fb.depth(&fa.points, xb.inverse() * xa)
            .max(fa.depth(&fb.points, xa.inverse() * xb))
    }

    /// Overlap on a way of `group` from among `others`, beyond what each pair has in the file; twice the deviation of the meshes is no overlap.
    pub fn overlap(&self, group: &[usize], others: &[usize], path: &Path) -> Overlap {
        let mut found = Overlap {
            ways: 1,
            ..Overlap::default()
        };
        let mut by = DAffine3::IDENTITY;
        for leg in &path.legs {
            for &a in group {
                for &b in others {
                    let ((al, ah), (bl, bh)) = (
                        self.assembly.bounds(a, by),
                        self.assembly.bounds(b, DAffine3::IDENTITY),
                    );
                    let reach = leg.speed(leg.arm((al + ah) / 2.0) + al.distance(ah) / 2.0);
                    if (al - bh).max(bl - ah).max_element() > reach {
                        continue;
                    }
                    let pressed = self.assembly.pressed_mm(a, b);
                    let steps = (reach / MESH_STEP_MM).ceil().max(1.0) as usize;
                    for i in 0..=steps {
                        let at = leg.at(i as f64 / steps as f64) * by;
                        let depth = self.depth(a, b, at) - pressed - 2.0 * DEVIATION_MM;
                        found.meshes_mm = found.meshes_mm.max(depth);
                    }
                    let moved = Moved { parts: &[a], by };
                    let least = self
                        .assembly
                        .least_over(&moved, &[b], leg, EXACT_STEP_MM, -pressed);
                    if let Some((t, _)) = least {
                        let moved = Moved {
                            parts: &[a],
                            by: leg.at(t) * by,
                        };
                        let exact = self.assembly.clearance(&moved, &[b], 1.0, true);
                        let depth = exact.map_or(0.0, |c| -c.gap.distance_mm) - pressed;
                        found.exact_mm = found.exact_mm.max(depth);
                    }
                }
            }
            by = leg.at(1.0) * by;
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mortise_task::Motion;

    /// A link on two pins leaves along them without overlap, and across them both engines see it overlap.
    #[test]
    fn a_way_through_the_other_part_is_found() {
        let file = File::new(env!("CARGO_MANIFEST_DIR")).join("../mating/tests/data/two_pin_exact.step");
        let checked = Checked::load(&file).expect("the sample is read");
        let contacts = &checked.assembly.contacts;
        let along = (contacts.iter().map(|contact| contact.axis.direction))
            .next()
            .expect("the pins touch the link");
        let across = along.any_orthonormal_vector();
        let overlap = |way: DVec3| {
            let legs = vec![Motion::slide(way)];
            checked.overlap(&[1], &[0], &Path { legs })
        };
        let free = [along, -along]
            .map(|way| overlap(way * 3.0))
            .map(|found| found.meshes_mm.max(found.exact_mm));
        assert!(free[0].min(free[1]) < 1e-3, "{free:?}");
        let found = overlap(across);
        assert!(found.meshes_mm > 0.3 && found.exact_mm > 0.3, "{found:?}");
    }
}
