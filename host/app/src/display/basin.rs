//! The basin of a geometric energy as a mesh: from where it draws the middle of a part into a fit. Pure.
//!
//! Shells one in another, each the places of the middle at which the energy has a share of its depth ([`LEVELS`]), with the part turned as on the way beside. A shell is a
//! ring about each place of the way, whose radius is where the energy rises above its level. Where more shells lie over each other the energy is deeper.

use std::f64::consts::TAU;

use glam::{DAffine3, DVec3, Vec3};
use mortise_energy::BakedEnergy;

use super::mesh::{ShapeMesh, Vertex};

/// Depths of the shells.
pub const LEVELS: [f64; 8] = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8];
/// Corners of a ring.
const AROUND: usize = 24;
/// Distances from the way at which the energy is sampled, mm: those for which it is fitted, and a little more.
const STEP_MM: f64 = 0.5;
const STEPS: usize = 13;

/// The shells of an energy in the fixed part's frame, mm. `poses` of the moving part in that frame follow its way, no farther from one another than its bends need; `middle` is
/// in the moving part's frame. Cost: 300 evaluations of the energy a pose, about 5 ms.
pub fn basin(energy: &BakedEnergy, poses: &[DAffine3], middle: DVec3) -> ShapeMesh {
    let stations = stations(energy, poses, middle);
    let mut mesh = ShapeMesh::default();
    for level in LEVELS {
        shell(&stations, level, &mut mesh);
    }
    normals(&mut mesh);
    mesh
}

/// A place of the way.
struct Station {
    at: DVec3,
    /// Directions away from the way.
    away: [DVec3; AROUND],
    /// Depth of the energy in each of them, at each distance.
    depths: [[f64; STEPS]; AROUND],
}

impl Station {
    /// How far from the way the energy first rises above a level, mm.
    fn radius(&self, direction: usize, level: f64) -> f64 {
        let depths = &self.depths[direction];
        match depths.iter().position(|depth| *depth < level) {
            Some(0) => 0.0,
            Some(k) => {
                let (inner, outer) = (depths[k - 1], depths[k]);
                STEP_MM * (k as f64 - (level - outer) / (inner - outer))
            }
            None => STEP_MM * (STEPS - 1) as f64,
        }
    }
}

fn stations(energy: &BakedEnergy, poses: &[DAffine3], middle: DVec3) -> Vec<Station> {
    let at: Vec<DVec3> = poses.iter().map(|pose| pose.transform_point3(middle)).collect();
    let mut across = DVec3::ZERO;
    let mut stations = Vec::with_capacity(poses.len());
    for (k, pose) in poses.iter().enumerate() {
        let (before, after) = (at[k.saturating_sub(1)], at[(k + 1).min(at.len() - 1)]);
        let along = (after - before).normalize_or(DVec3::Z);
        // Turned no more than the way is, so that the shells are not twisted.
        across = (across - along * across.dot(along))
            .try_normalize()
            .unwrap_or_else(|| along.any_orthonormal_vector());
        let other = along.cross(across);
        let away = std::array::from_fn(|j| {
            let (sin, cos) = (TAU * j as f64 / AROUND as f64).sin_cos();
            across * cos + other * sin
        });
        let depths = away.map(|away: DVec3| {
            std::array::from_fn(|k| {
                let aside = DAffine3::from_translation(away * (STEP_MM * k as f64));
                -energy.at(&(aside * *pose), DVec3::ZERO).energy
            })
        });
        stations.push(Station {
            at: at[k],
            away,
            depths,
        });
    }
    stations
}

/// Adds the shell of a level; it is closed at both ends of the way.
fn shell(stations: &[Station], level: f64, mesh: &mut ShapeMesh) {
    let last = stations.len().saturating_sub(1);
    let first = mesh.vertices.len() as u32;
    let mut open = Vec::with_capacity(stations.len());
    for (k, station) in stations.iter().enumerate() {
        let ends = k == 0 || k == last;
        let radii: [f64; AROUND] = std::array::from_fn(|j| if ends { 0.0 } else { station.radius(j, level) });
        open.push(radii.iter().any(|radius| *radius > 0.0));
        for (radius, away) in radii.iter().zip(station.away) {
            mesh.vertices.push(Vertex {
                position: (station.at + away * *radius).as_vec3().to_array(),
                normal: [0.0; 3],
                color: [0; 4],
                face: 0,
            });
        }
    }
    let around = AROUND as u32;
    for (k, ends) in open.windows(2).enumerate() {
        if !ends.contains(&true) {
            continue;
        }
        let row = first + around * k as u32;
        for j in 0..around {
            let next = (j + 1) % around;
            let [a, b, c, d] = [row + j, row + next, row + around + j, row + around + next];
            mesh.indices.extend([a, b, d, a, d, c]);
        }
    }
}

/// Normals of the triangles around each corner, weighted by their areas.
fn normals(mesh: &mut ShapeMesh) {
    let mut sums = vec![Vec3::ZERO; mesh.vertices.len()];
    for triangle in mesh.indices.chunks_exact(3) {
        let [a, b, c] = [0, 1, 2].map(|k| Vec3::from(mesh.vertices[triangle[k] as usize].position));
        let area = (b - a).cross(c - a);
        for &corner in triangle {
            sums[corner as usize] += area;
        }
    }
    for (vertex, sum) in mesh.vertices.iter_mut().zip(sums) {
        vertex.normal = sum.normalize_or(Vec3::Z).to_array();
    }
}

#[cfg(test)]
mod tests {
    use mortise_protocol::image::{ChargeRecord, EnergyRecord};

    use super::*;

    /// Nodes of the lattice along each axis, 1 mm apart, and the distance at which its density has faded, mm.
    const NODES: u16 = 31;
    const FADED_MM: f64 = 10.0;

    /// Middle of the moving part, its frame, mm.
    const MIDDLE: DVec3 = DVec3::new(3.0, 0.0, 2.0);

    /// One charge at the middle of the part in a density that fades evenly about the origin: with the middle at a distance d the depth is 1 − d/10 mm.
    fn round() -> BakedEnergy {
        let middle = 0.5 * f64::from(NODES - 1);
        let node = |i: u16| f64::from(i) - middle;
        let nodes = (0..NODES).flat_map(|z| (0..NODES).flat_map(move |y| (0..NODES).map(move |x| [x, y, z])));
        let density = |at: [u16; 3]| {
            let depth = 1.0 - DVec3::from_array(at.map(node)).length() / FADED_MM;
            [(127.0 * depth.max(0.0)).round() as i8, 0]
        };
        BakedEnergy {
            record: EnergyRecord {
                origin: [-1e-3 * middle as f32; 3],
                step: 1e-3,
                size: [NODES; 3],
                largest_force: 100.0,
                way: [0.0, 0.0, 1.0],
                ..EnergyRecord::default()
            },
            charges: vec![ChargeRecord {
                at: (MIDDLE * 1e-3).as_vec3().to_array(),
                charge: [1.0 / 127.0, 0.0],
            }],
            nodes: nodes.map(density).collect(),
            deviation: 0.0,
        }
    }

    #[test]
    fn each_shell_is_where_the_energy_has_its_share_of_the_depth() {
        let poses: Vec<DAffine3> = (-12..=12)
            .map(|z| DAffine3::from_translation(f64::from(z) * DVec3::Z - MIDDLE))
            .collect();
        let mesh = basin(&round(), &poses, MIDDLE);
        assert_eq!(mesh.vertices.len(), LEVELS.len() * poses.len() * AROUND);
        for (level, shell) in LEVELS.iter().zip(mesh.vertices.chunks(poses.len() * AROUND)) {
            let want = FADED_MM * (1.0 - level);
            let most = STEP_MM * (STEPS - 1) as f64;
            let mut seen = 0;
            for vertex in shell {
                let at = DVec3::from(vertex.position.map(f64::from));
                let radius = at.truncate().length();
                if radius > 0.0 && radius < most - 0.01 {
                    seen += 1;
                    assert!((at.length() - want).abs() < 0.15, "{level}: {at}");
                } else if radius == 0.0 {
                    assert!(at.length() > want - 0.15, "{level}: closed at {at}");
                }
                assert!((Vec3::from(vertex.normal).length() - 1.0).abs() < 1e-5);
            }
            assert!(seen > AROUND, "{level}: {seen}");
        }
        assert!(
            mesh.indices
                .iter()
                .all(|index| (*index as usize) < mesh.vertices.len())
        );
    }

    #[test]
    fn beside_every_energy_there_is_no_shell() {
        let far = DAffine3::from_translation(500.0 * DVec3::X);
        assert!(basin(&round(), &[far, far, far], DVec3::ZERO).indices.is_empty());
        assert!(basin(&round(), &[], DVec3::ZERO).vertices.is_empty());
    }
}
