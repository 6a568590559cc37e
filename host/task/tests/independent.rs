//! Every way of every task, checked by engines that share nothing with the search: distances of fine meshes by parry3d, and the exact distance every 10 µm of
//! travel. No overlap beyond 10 µm.

mod support;

use std::path::Path as File;
use std::time::{Duration, Instant};

use glam::{DAffine3, DVec3};
use mortise_brep::{CadModel, LoadOptions, Shape};
use mortise_task::removal::{Budget, Path, Removal, remove};
use mortise_task::{Assembly, Moved, sequence};
use parry3d_f64::query::PointQueryWithLocation as _;
use parry3d_f64::shape::{TriMesh, TriMeshFlags};

/// Overlap that is accepted, mm.
const OVERLAP_MM: f64 = 0.01;
/// Travel between two checks by the meshes, and by the exact distance, mm.
const MESH_STEP_MM: f64 = 0.1;
const EXACT_STEP_MM: f64 = 0.01;
/// Deviation of the meshes, spacing of points along their edges, and distance within which points are looked at, mm.
const DEVIATION_MM: f64 = 0.002;
const ALONG_MM: f64 = 0.3;
const WITHIN_MM: f64 = 0.5;

/// A shape as a fine mesh: its triangles, and points of its surface.
struct Fine {
    mesh: TriMesh,
    points: Vec<DVec3>,
}

impl Fine {
    fn new(shape: &Shape) -> Self {
        let vertices = shape.mesh.vertices.iter().map(|p| p.to_array().into()).collect();
        let mesh =
            TriMesh::with_flags(vertices, shape.mesh.triangles.clone(), TriMeshFlags::ORIENTED).unwrap();
        let mut points: Vec<DVec3> = shape.mesh.vertices.clone();
        for edge in &shape.edges {
            for pair in edge.polyline.windows(2) {
                let steps = (pair[0].distance(pair[1]) / ALONG_MM).ceil() as usize;
                points.extend((1..steps).map(|i| pair[0].lerp(pair[1], i as f64 / steps as f64)));
            }
        }
        Self { mesh, points }
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

struct Checked {
    assembly: Assembly,
    fine: Vec<Fine>,
    model: CadModel,
}

impl Checked {
    fn load(file: &File) -> Self {
        let options = LoadOptions {
            linear_deflection_mm: Some(DEVIATION_MM),
            angular_deflection_rad: 0.1,
            ..LoadOptions::default()
        };
        let model = mortise_brep::load_step_with(file, &options).unwrap();
        Self {
            assembly: Assembly::new(mortise_brep::load_step(file).unwrap()).unwrap(),
            fine: model.shapes.iter().map(Fine::new).collect(),
            model,
        }
    }

    fn depth(&self, a: usize, b: usize, by: DAffine3) -> f64 {
        let [pa, pb] = [a, b].map(|p| &self.model.parts[p]);
        let (xa, xb) = (by * pa.placement, pb.placement);
        let (fa, fb) = (&self.fine[pa.shape], &self.fine[pb.shape]);
        fb.depth(&fa.points, xb.inverse() * xa)
            .max(fa.depth(&fb.points, xa.inverse() * xb))
    }

    /// Checks a way of `group` from among `others`; what it overlaps by in the file is allowed of each pair.
    fn check(&self, name: &str, group: &[usize], others: &[usize], path: &Path) {
        let mut by = DAffine3::IDENTITY;
        for (number, leg) in path.legs.iter().enumerate() {
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
                    let steps = (reach / MESH_STEP_MM).ceil() as usize;
                    for i in 0..=steps {
                        let at = leg.at(i as f64 / steps as f64) * by;
                        let depth = self.depth(a, b, at);
                        assert!(
                            depth <= OVERLAP_MM + pressed + 2.0 * DEVIATION_MM,
                            "{name}: {depth} mm by meshes, leg {number}, {i} of {steps}"
                        );
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
                        let depth = exact.map_or(0.0, |c| -c.gap.distance_mm);
                        assert!(
                            depth <= OVERLAP_MM + pressed,
                            "{name}: {depth} mm by the exact distance, leg {number} at {t}"
                        );
                    }
                }
            }
            by = leg.at(1.0) * by;
        }
    }
}

/// Checks the way of part 1 from part 0 for some seeds.
fn task(file: &File, name: &str, seeds: std::ops::Range<u64>) {
    let checked = Checked::load(file);
    for seed in seeds {
        let budget = Budget {
            seed,
            ..Budget::lasting(Duration::from_secs(240))
        };
        let Removal::Out(path) = remove(&checked.assembly, &[1], &[0], &[], &budget) else {
            panic!("{name} stays in with seed {seed}");
        };
        checked.check(name, &[1], &[0], &path);
    }
}

/// Checks the whole sequence of a file.
fn whole(file: &File, name: &str) {
    let checked = Checked::load(file);
    let all: Vec<usize> = (0..checked.assembly.count()).collect();
    let found = sequence::disassemble(&checked.assembly, &all, Duration::from_secs(240));
    assert!(found.complete(), "{name}");
    for step in &found.steps {
        checked.check(name, &step.group, &step.onto, &step.path);
    }
}

#[test]
fn ways_of_our_samples_are_free() {
    let host = File::new(env!("CARGO_MANIFEST_DIR")).join("..");
    for name in [
        "two_pin_exact",
        "cone_in_cone",
        "ball_in_cylinder",
        "ball_in_socket",
    ] {
        let file = host.join(format!("mating/tests/data/{name}.step"));
        let start = Instant::now();
        whole(&file, name);
        eprintln!("{name}: {:.1} s", start.elapsed().as_secs_f64());
    }
}

#[test]
fn ways_of_the_extraction_tasks_are_free() {
    let Some(folder) = support::shared("ways_of_the_extraction_tasks_are_free") else {
        return;
    };
    let folder = folder.join("10_extraction");
    for (name, seeds) in [
        ("tbolt_slot", 1),
        ("ring_hook", 3),
        ("ubolt_plate", 1),
        ("cross_pin", 1),
        ("gear_housing", 3),
        ("flange_l_passage", 1),
        ("lock_maze", 1),
        ("bent_tube", 1),
        ("keyhole_loose_30um", 1),
    ] {
        let start = Instant::now();
        task(&folder.join(format!("{name}.step")), name, 0..seeds);
        eprintln!("{name}: {:.1} s", start.elapsed().as_secs_f64());
    }
    for name in ["box_with_board", "hinge"] {
        let start = Instant::now();
        whole(&folder.join(format!("{name}.step")), name);
        eprintln!("{name}: {:.1} s", start.elapsed().as_secs_f64());
    }
}
