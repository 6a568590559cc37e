//! Finds a peg in front of a hole and scripts the simulated hand that inserts it. Pure.
//!
//! A candidate is an outer cylinder of one part and a wider inner cylinder of another on nearly the same axis. This is no recognition of
//! mating faces; it only serves to demonstrate an insertion without an operator at the handle.

use glam::{DAffine3, DQuat, DVec3};
use mortise_brep::{CadModel, Shape, Surface};
use mortise_protocol::message::{HandScript, Keyframe};

use super::pose::{moved, to_wire};

/// Largest angle between the axes, rad.
const LEAN: f64 = 0.02;
/// Walls closer than this, mm and rad, are the same wall.
const SAME: f64 = 1e-6;
/// Largest difference of the radii of hole and peg, as a fraction of the hole's radius.
const SLACK: f64 = 0.2;

/// A peg in front of a hole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Insertion {
    /// Part with the peg.
    pub moving: usize,
    /// Part with the hole.
    pub fixed: usize,
    /// Direction of insertion, unit vector, world.
    pub direction: DVec3,
    /// Middle of the peg, world, mm.
    pub center: DVec3,
    /// Travel of the peg until its end meets the hole's far end, mm.
    pub travel_mm: f64,
    /// Length of the hole, mm.
    pub hole_mm: f64,
    /// Difference of the diameters, mm.
    pub clearance_mm: f64,
}

/// Parameters of the simulated insertion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Manner {
    /// Lateral offset from the axis at the start, mm.
    pub offset_mm: f64,
    /// Tilt at the start, rad.
    pub tilt_rad: f64,
    /// Speed, mm/s.
    pub speed_mm_per_s: f64,
    /// Sideways push at the end, N.
    pub sideways_n: f64,
}

impl Default for Manner {
    fn default() -> Self {
        Self {
            offset_mm: 0.2,
            tilt_rad: 0.5f64.to_radians(),
            speed_mm_per_s: 20.0,
            sideways_n: 1.5,
        }
    }
}

/// A wall of a cylinder, outer or inner.
#[derive(Clone, Debug)]
pub struct Wall {
    /// Part that the wall belongs to.
    pub part: usize,
    /// A point on the axis, mm.
    pub origin: DVec3,
    /// Direction of the axis, unit vector.
    pub axis: DVec3,
    /// Radius, mm.
    pub radius: f64,
    /// Ends along the axis from the origin, mm.
    pub ends: (f64, f64),
    /// Whether it is a bore's wall.
    pub inner: bool,
    /// The part's faces that make up the wall: a modeller may split a wall in halves.
    pub faces: Vec<u32>,
}

impl Wall {
    /// Middle of the axis between the ends.
    pub fn middle(&self) -> DVec3 {
        self.origin + 0.5 * (self.ends.0 + self.ends.1) * self.axis
    }

    /// Distance between the ends, mm.
    pub fn length(&self) -> f64 {
        self.ends.1 - self.ends.0
    }

    /// The wall transformed by `pose`.
    pub fn moved(&self, pose: &DAffine3) -> Self {
        Self {
            origin: pose.transform_point3(self.origin),
            axis: pose.transform_vector3(self.axis),
            ..self.clone()
        }
    }

    /// Merges `other` into this wall when it is another face of the same wall.
    fn absorb(&mut self, other: &Self) -> bool {
        let apart = other.origin - self.origin;
        let shift = apart.dot(self.axis);
        let same = (self.part, self.inner) == (other.part, other.inner)
            && (self.radius - other.radius).abs() < SAME
            && self.axis.cross(other.axis).length() < SAME
            && (apart - shift * self.axis).length() < SAME;
        if !same {
            return false;
        }
        let along = other.axis.dot(self.axis).signum();
        let [a, b] = [other.ends.0, other.ends.1].map(|end| shift + along * end);
        // Two separated bores on one axis are two walls.
        if a.min(b) > self.ends.1 + SAME || a.max(b) < self.ends.0 - SAME {
            return false;
        }
        self.ends = (self.ends.0.min(a.min(b)), self.ends.1.max(a.max(b)));
        self.faces.extend(&other.faces);
        true
    }
}

/// The pair with the least clearance whose peg is not yet fully inserted; `None` when there is none.
pub fn find(model: &CadModel, poses: &[DAffine3]) -> Option<Insertion> {
    let walls = walls(model, poses);
    let mut best: Option<Insertion> = None;
    for peg in walls.iter().filter(|w| !w.inner) {
        for hole in walls.iter().filter(|w| w.inner && w.part != peg.part) {
            let Some(found) = pair(peg, hole) else { continue };
            if best.is_none_or(|b| found.clearance_mm < b.clearance_mm) {
                best = Some(found);
            }
        }
    }
    best
}

fn pair(peg: &Wall, hole: &Wall) -> Option<Insertion> {
    let clearance_mm = 2.0 * (hole.radius - peg.radius);
    if clearance_mm < 0.0 || clearance_mm > 2.0 * SLACK * hole.radius {
        return None;
    }
    if peg.axis.cross(hole.axis).length() > LEAN {
        return None;
    }
    let between = hole.middle() - peg.middle();
    let aside = between - between.dot(hole.axis) * hole.axis;
    if aside.length() > clearance_mm + 0.05 * hole.radius {
        return None;
    }
    let along = between.dot(hole.axis);
    let direction = if along >= 0.0 { hole.axis } else { -hole.axis };
    let hole_mm = hole.ends.1 - hole.ends.0;
    let peg_mm = peg.ends.1 - peg.ends.0;
    // Both ends are measured from the peg's middle along the direction of insertion.
    let travel_mm = along.abs() + 0.5 * hole_mm - 0.5 * peg_mm;
    (travel_mm > 1e-3).then_some(Insertion {
        moving: peg.part,
        fixed: hole.part,
        direction,
        center: peg.middle(),
        travel_mm,
        hole_mm,
        clearance_mm,
    })
}

fn walls(model: &CadModel, poses: &[DAffine3]) -> Vec<Wall> {
    (local_walls(model).iter())
        .filter_map(|wall| Some(wall.moved(poses.get(wall.part)?)))
        .collect()
}

/// Every cylinder wall, in its part's frame, ordered by part and face.
pub fn local_walls(model: &CadModel) -> Vec<Wall> {
    let mut walls: Vec<Wall> = Vec::new();
    for (index, part) in model.parts.iter().enumerate() {
        let first = walls.len();
        for wall in (model.shapes.get(part.shape)).map_or_else(Vec::new, |shape| walls_of(shape, index)) {
            if !walls[first..].iter_mut().any(|known| known.absorb(&wall)) {
                walls.push(wall);
            }
        }
    }
    walls
}

fn walls_of(shape: &Shape, part: usize) -> Vec<Wall> {
    let mut ends = vec![(f64::INFINITY, f64::NEG_INFINITY); shape.faces.len()];
    for (corners, &face) in shape.mesh.triangles.iter().zip(&shape.mesh.triangle_face) {
        let Some((face, ends)) = shape.faces.get(face as usize).zip(ends.get_mut(face as usize)) else {
            continue;
        };
        let Surface::Cylinder { frame, .. } = &face.surface else {
            continue;
        };
        for point in corners
            .iter()
            .filter_map(|&c| shape.mesh.vertices.get(c as usize))
        {
            let along = (*point - frame.origin).dot(frame.z);
            *ends = (ends.0.min(along), ends.1.max(along));
        }
    }
    (shape.faces.iter().zip(ends).enumerate())
        .filter_map(|(id, (face, ends))| match face.surface {
            Surface::Cylinder { frame, radius } if ends.1 - ends.0 > SAME => Some(Wall {
                part,
                origin: frame.origin,
                axis: frame.z,
                radius,
                ends,
                inner: face.reversed,
                faces: vec![id as u32],
            }),
            _ => None,
        })
        .collect()
}

/// The hand's script: start offset and tilted, insert fully, then push against the wall. `handle` is the present pose of the handle; the
/// part is grabbed at its present pose, so the handle performs the part's motion.
pub fn script(insertion: &Insertion, handle: &DAffine3, manner: &Manner) -> HandScript {
    let aside = insertion.direction.any_orthonormal_vector();
    let tilt_axis = insertion.direction.cross(aside);
    let stiffness = 400.0;
    let ms = |mm: f64| (1e3 * mm / manner.speed_mm_per_s).ceil() as u32;
    let way = insertion.travel_mm;
    // Alignment is corrected during the approach: a tilted hand would wedge in a tight hole.
    let stations = [
        (0, 0.0, 0.0, 0.0),
        (400, 0.0, manner.tilt_rad, manner.offset_mm),
        (400 + ms(0.5 * way), 0.5 * way, manner.tilt_rad, manner.offset_mm),
        (400 + ms(way), way, 0.0, 0.0),
        (900 + ms(way), way, 0.0, 0.0),
        (1_600 + ms(way), way, 0.0, 1e3 * manner.sideways_n / stiffness),
    ];
    HandScript {
        stiffness: stiffness as f32,
        damping: 4.0,
        angular_stiffness: 2.0,
        angular_damping: 0.02,
        tremor: 0.0,
        tremor_hz: 0.0,
        keyframes: stations
            .iter()
            .map(|&(tick, depth, tilt, offset)| Keyframe {
                tick,
                pose: to_wire(&moved(
                    handle,
                    insertion.center,
                    DQuat::from_axis_angle(tilt_axis, tilt),
                    depth * insertion.direction + offset * aside,
                )),
                push: [0.0; 3],
            })
            .collect(),
    }
}

/// A script that keeps the handle at `pose`.
pub fn hold(pose: &DAffine3) -> HandScript {
    HandScript {
        stiffness: 400.0,
        damping: 4.0,
        angular_stiffness: 2.0,
        angular_damping: 0.02,
        tremor: 0.0,
        tremor_hz: 0.0,
        keyframes: [Keyframe {
            tick: 0,
            pose: to_wire(pose),
            push: [0.0; 3],
        }]
        .into_iter()
        .collect(),
    }
}

#[cfg(test)]
mod tests {
    use mortise_brep::{Face, Frame, Mesh, Part};

    use super::*;

    /// A lone cylinder wall from z = 0 to `length`.
    fn wall(radius: f64, length: f64, inner: bool) -> Shape {
        let frame = Frame {
            origin: DVec3::ZERO,
            x: DVec3::X,
            y: DVec3::Y,
            z: DVec3::Z,
        };
        Shape {
            faces: vec![Face {
                surface: Surface::Cylinder { frame, radius },
                fit_mm: None,
                reversed: inner,
                area_mm2: 1.0,
                edges: vec![],
                color: None,
            }],
            mesh: Mesh {
                vertices: vec![
                    radius * DVec3::X,
                    radius * DVec3::Y,
                    radius * DVec3::X + length * DVec3::Z,
                ],
                triangles: vec![[0, 1, 2]],
                triangle_face: vec![0],
            },
            ..Shape::default()
        }
    }

    fn model(gap: f64) -> (CadModel, Vec<DAffine3>) {
        let part = |name: &str, shape, z: f64| Part {
            name: name.into(),
            path: vec![],
            shape,
            placement: DAffine3::from_translation(z * DVec3::Z),
            color: None,
        };
        let model = CadModel {
            shapes: vec![wall(9.375, 40.0, true), wall(8.875, 60.0, false)],
            parts: vec![part("block", 0, -40.0), part("peg", 1, gap)],
            ..CadModel::default()
        };
        let poses = model.parts.iter().map(|p| p.placement).collect();
        (model, poses)
    }

    #[test]
    fn the_thesis_pair_is_found() {
        let (model, poses) = model(20.0);
        let found = find(&model, &poses).expect("peg before hole");
        assert_eq!((found.moving, found.fixed), (1, 0));
        assert!((found.direction + DVec3::Z).length() < 1e-12);
        assert!((found.travel_mm - 60.0).abs() < 1e-9 && (found.hole_mm - 40.0).abs() < 1e-9);
        assert!((found.clearance_mm - 1.0).abs() < 1e-9);
    }

    #[test]
    fn halves_of_a_wall_are_one_and_bores_in_a_row_are_two() {
        let (mut model, _) = model(20.0);
        let half = model.shapes[0].faces[0].clone();
        let shape = &mut model.shapes[0];
        shape.faces.push(half);
        let corners = shape.mesh.triangles[0];
        shape.mesh.triangles.push(corners);
        shape.mesh.triangle_face.push(1);
        let walls = local_walls(&model);
        assert_eq!(walls.len(), 2);
        assert_eq!(walls[0].faces, [0, 1]);
        let mut below = walls[0].clone();
        below.ends = (-50.0, -10.0);
        assert!(!below.absorb(&walls[0]));
    }

    #[test]
    fn neither_too_thick_nor_beside_nor_already_in() {
        let (mut thick, poses) = model(20.0);
        thick.shapes[1] = wall(9.5, 60.0, false);
        assert_eq!(find(&thick, &poses), None);
        let (model, mut poses) = model(20.0);
        poses[1].translation.x = 12.0;
        assert_eq!(find(&model, &poses), None);
        poses[1].translation = DVec3::new(0.0, 0.0, -40.0);
        assert_eq!(find(&model, &poses), None);
    }

    #[test]
    fn the_script_ends_at_full_depth() {
        let (model, poses) = model(20.0);
        let found = find(&model, &poses).expect("peg before hole");
        let handle = DAffine3::from_translation(DVec3::new(5.0, 0.0, 100.0));
        let script = script(&found, &handle, &Manner::default());
        assert!(script.keyframes.windows(2).all(|k| k[0].tick < k[1].tick));
        let first = script.keyframes.first().expect("some").pose;
        assert_eq!(first, to_wire(&handle), "starts where the handle is");
        let last = script.keyframes.last().expect("some").pose;
        // f32 metres: 0.1 m to 7e-9.
        assert!((f64::from(last.position[2]) - 0.040).abs() < 1e-7, "{last:?}");
    }
}
