//! From telemetry to constraint targets: the desktop's half of guidance.
//!
//! The recogniser says which constraints the touching faces could keep; this sends them to the board, refreshes them before they expire, and clears
//! what is let go. Faces that share an edge with touching ones count as touched too: a peg that lands on the rim of its hole touches the
//! top with its end. A part that guidance holds off the walls touches nothing; as long as its surface is still in or at the other it is
//! near, and stays guided.
//!
//! Planes that face each other are not sent: they meet by contact, and a plane held could hold a part up. Cost: that of the recogniser, once for each
//! message of telemetry.

use std::collections::BTreeMap;

use glam::{DAffine3, DQuat, DVec3};
use heapless::Vec as BoundedVec;
use mortise_brep::{CadModel, Shape, Surface};
use mortise_mating::Tolerances;
use mortise_mating::recognise::{
    Observation, Recogniser, Target, TargetId, TargetKind, Thresholds, TouchingFaces,
};
use mortise_protocol::limits::MAX_TARGETS;
use mortise_protocol::message::{ConstraintKind, ConstraintTarget, Feature, Telemetry, ToDevice};

/// How targets are sent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GuideSettings {
    /// k_g, N/m.
    pub stiffness_n_per_m: f32,
    /// F_g, N.
    pub force_cap_n: f32,
    /// The same of torques, N m.
    pub torque_cap_nm: f32,
    /// A target fades this long after its last refresh, ticks.
    pub expiry_ticks: u16,
    /// Surfaces whose extents along the axis overlap by more than this are near, mm (negative: a gap).
    pub near_mm: f64,
}

impl Default for GuideSettings {
    /// A cap well below the coupling's 10 N; an expiry of 0.3 s.
    fn default() -> Self {
        Self {
            stiffness_n_per_m: 1e6,
            force_cap_n: 3.0,
            torque_cap_nm: 0.1,
            expiry_ticks: 300,
            near_mm: -0.5,
        }
    }
}

/// Keeps a board's targets up to date.
pub struct Guide<'a> {
    model: &'a CadModel,
    /// Model part of each part of the image.
    parts: Vec<usize>,
    /// Of each shape, of each face: faces across an edge.
    neighbours: Vec<Vec<Vec<u32>>>,
    recogniser: Recogniser<'a>,
    settings: GuideSettings,
    sent: BTreeMap<TargetId, Sent>,
    ids: u16,
    sequence: u16,
}

struct Sent {
    id: u16,
    /// Tick at which it is sent again.
    due: u32,
}

impl<'a> Guide<'a> {
    /// For a scene baked from `model`; `parts` names the model part of each part of the image.
    pub fn new(model: &'a CadModel, parts: Vec<usize>, settings: GuideSettings) -> Self {
        Self {
            model,
            parts,
            neighbours: model.shapes.iter().map(neighbours).collect(),
            recogniser: Recogniser::new(model, &Tolerances::default(), Thresholds::default()),
            settings,
            sent: BTreeMap::new(),
            ids: 0,
            sequence: 0,
        }
    }

    /// The list the targets come from, for who shows it or chooses in it.
    pub fn recogniser(&mut self) -> &mut Recogniser<'a> {
        &mut self.recogniser
    }

    /// What to send after this sample.
    pub fn hear(&mut self, sample: &Telemetry) -> Vec<ToDevice> {
        let Some((held, pose)) = &sample.object else {
            // Letting go ends all guidance on the board.
            self.sent.clear();
            return Vec::new();
        };
        let Some(&moving_part) = self.parts.get(usize::from(*held)) else {
            return Vec::new();
        };
        let mut poses: Vec<DAffine3> = self.model.parts.iter().map(|part| part.placement).collect();
        let orientation = DQuat::from_array(pose.orientation.map(f64::from)).normalize();
        let position = DVec3::from_array(pose.position.map(f64::from)) * 1000.0;
        if let Some(place) = poses.get_mut(moving_part) {
            *place = DAffine3::from_rotation_translation(orientation, position);
        }
        let mut touching = self.touched(moving_part, sample);
        touching.extend(self.near(&poses));
        self.recogniser.update(&Observation {
            moving_part,
            poses: &poses,
            touching: &touching,
        });
        self.messages(sample.tick)
    }

    /// Faces that touch, and those across an edge from them.
    fn touched(&self, moving_part: usize, sample: &Telemetry) -> Vec<TouchingFaces> {
        let mut out = Vec::new();
        for pair in &sample.pairs {
            let Some(&fixed_part) = self.parts.get(usize::from(pair.static_part)) else {
                continue;
            };
            let moving = self.with_neighbours(moving_part, pair.moving_face);
            let fixed = self.with_neighbours(fixed_part, pair.static_face);
            for &moving_face in &moving {
                for &fixed_face in &fixed {
                    let touches = moving_face == u32::from(pair.moving_face)
                        && fixed_face == u32::from(pair.static_face);
                    out.push(TouchingFaces {
                        moving_face,
                        fixed_part,
                        fixed_face,
                        depth_mm: if touches {
                            1000.0 * f64::from(pair.depth)
                        } else {
                            0.0
                        },
                    });
                }
            }
        }
        out
    }

    fn with_neighbours(&self, part: usize, face: u16) -> Vec<u32> {
        let mut faces = vec![u32::from(face)];
        let of_shape = self
            .model
            .parts
            .get(part)
            .and_then(|p| self.neighbours.get(p.shape));
        if let Some(more) = of_shape.and_then(|faces| faces.get(usize::from(face))) {
            faces.extend(more);
        }
        faces
    }

    /// Targets in force whose surfaces are still in or at each other.
    fn near(&self, poses: &[DAffine3]) -> Vec<TouchingFaces> {
        let near = |target: &&Target| {
            let (a, b) = (target.id.moving_part, target.id.fixed_part);
            let (Some(at), Some(fixed)) = (poses.get(a), poses.get(b)) else {
                return false;
            };
            let axis = fixed.transform_vector3(target.fixed.direction);
            let extent = |part: usize, faces: &[u32], at: &DAffine3| {
                extent(&self.model.shapes[self.model.parts[part].shape], faces, at, axis)
            };
            let (low, high) = extent(a, &target.moving_faces, at);
            let (from, to) = extent(b, &target.fixed_faces, fixed);
            high.min(to) - low.max(from) > self.settings.near_mm
        };
        (self.recogniser.active().filter(near))
            .filter_map(|target| {
                Some(TouchingFaces {
                    moving_face: *target.moving_faces.first()?,
                    fixed_part: target.id.fixed_part,
                    fixed_face: *target.fixed_faces.first()?,
                    depth_mm: 0.0,
                })
            })
            .collect()
    }

    fn messages(&mut self, tick: u32) -> Vec<ToDevice> {
        let active: Vec<Target> = (self.recogniser.active())
            .filter(|target| self.kind(target).is_some())
            .take(MAX_TARGETS / 2)
            .cloned()
            .collect();
        let mut out = Vec::new();
        self.sent.retain(|id, sent| {
            let kept = active.iter().any(|target| target.id == *id);
            if !kept {
                out.push(ToDevice::ClearTarget { id: sent.id });
            }
            kept
        });
        let refresh = u32::from(self.settings.expiry_ticks / 3);
        for target in &active {
            let sent = self.sent.entry(target.id).or_insert_with(|| {
                self.ids = self.ids.wrapping_add(1);
                Sent {
                    id: self.ids,
                    due: tick,
                }
            });
            if (tick.wrapping_sub(sent.due) as i32) < 0 {
                continue;
            }
            sent.due = tick.wrapping_add(refresh);
            let id = sent.id;
            self.sequence = self.sequence.wrapping_add(1);
            out.extend(self.to_wire(target, id).map(ToDevice::SetTarget));
        }
        out
    }

    /// The board's word for a target's kind, if it is sent at all.
    fn kind(&self, target: &Target) -> Option<ConstraintKind> {
        match target.kind {
            TargetKind::Concentric => Some(ConstraintKind::Concentric),
            TargetKind::Conical => Some(ConstraintKind::Conical),
            TargetKind::Spherical => Some(ConstraintKind::Spherical),
            // The board knows bores of fixed parts.
            TargetKind::Annular => target.ball_moves.then_some(ConstraintKind::Annular),
            TargetKind::Coplanar => None,
        }
    }

    fn to_wire(&self, target: &Target, id: u16) -> Option<ConstraintTarget> {
        let image_part = |part: usize| {
            let index = self.parts.iter().position(|&p| p == part)?;
            u16::try_from(index).ok()
        };
        let feature = |origin: DVec3, direction: DVec3| Feature {
            point: (origin / 1000.0).as_vec3().to_array(),
            direction: direction.normalize().as_vec3().to_array(),
        };
        let mut faces = BoundedVec::new();
        for &moving in &target.moving_faces {
            for &fixed in &target.fixed_faces {
                if let (Ok(moving), Ok(fixed)) = (u16::try_from(moving), u16::try_from(fixed)) {
                    // The first few are the surface's largest share; the rest is felt as contact.
                    let _ = faces.push((moving, fixed));
                }
            }
        }
        Some(ConstraintTarget {
            id,
            sequence: self.sequence,
            kind: self.kind(target)?,
            moving: feature(target.moving.origin, target.moving.direction),
            static_part: image_part(target.id.fixed_part)?,
            fixed: feature(target.fixed.origin, target.fixed.direction),
            stiffness: self.settings.stiffness_n_per_m,
            force_cap: self.settings.force_cap_n,
            torque_cap: self.settings.torque_cap_nm,
            expiry_ticks: self.settings.expiry_ticks,
            faces,
        })
    }
}

/// Of each face, the curved faces across its edges.
fn neighbours(shape: &Shape) -> Vec<Vec<u32>> {
    let mut all = vec![Vec::new(); shape.faces.len()];
    let curved = |face: u32| {
        let surface = shape.faces.get(face as usize).map(|f| f.surface);
        !matches!(surface, None | Some(Surface::Plane { .. } | Surface::Spline))
    };
    for edge in &shape.edges {
        for &a in &edge.faces {
            for &b in edge.faces.iter().filter(|&&b| b != a && curved(b)) {
                if let Some(list) = all.get_mut(a as usize)
                    && !list.contains(&b)
                {
                    list.push(b);
                }
            }
        }
    }
    all
}

/// From where to where the mesh of `faces` reaches along `axis`, placed at `at`.
fn extent(shape: &Shape, faces: &[u32], at: &DAffine3, axis: DVec3) -> (f64, f64) {
    let mesh = &shape.mesh;
    let own = mesh.triangles.iter().zip(&mesh.triangle_face);
    (own.filter(|(_, face)| faces.contains(face)))
        .flat_map(|(triangle, _)| triangle)
        .map(|&v| at.transform_point3(mesh.vertices[v as usize]).dot(axis))
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
            (low.min(x), high.max(x))
        })
}
