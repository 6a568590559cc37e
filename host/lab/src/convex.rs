//! Convex solids: boxes, prisms, bars, wedges, chamfered blocks and cylinders of random size; balls, as STEP solids and as support functions.

use glam::{DVec2, DVec3};

use crate::step_text::StepText;

/// Distance from a plane within which a corner lies on it, mm.
const ON_PLANE_MM: f64 = 1e-7;
/// Smallest angle between the planes that define a corner, as the determinant of their normals.
const INDEPENDENT: f64 = 1e-9;

/// A convex solid in its own frame, its middle near the origin, mm.
#[derive(Clone, Debug)]
pub(crate) enum Convex {
    /// A polytope.
    Polytope(Polytope),
    /// A cylinder about z.
    Cylinder {
        /// Radius.
        radius: f64,
        /// Half of its length.
        half: f64,
    },
    /// A ball about the origin.
    Ball {
        /// Radius.
        radius: f64,
    },
}

/// A convex polytope.
#[derive(Clone, Debug)]
pub(crate) struct Polytope {
    /// Corners.
    pub corners: Vec<DVec3>,
    /// Corners of each face, counter-clockwise seen from outside.
    pub faces: Vec<Vec<usize>>,
    /// Outward unit normal of each face.
    pub normals: Vec<DVec3>,
    /// Unit directions of the edges, parallel ones once.
    pub edges: Vec<DVec3>,
}

impl Polytope {
    /// The intersection of half spaces n·x ≤ d, n of unit length; `None` where a face is thinner than a plane's tolerance resolves.
    pub fn of(planes: &[(DVec3, f64)]) -> Option<Self> {
        let mut corners: Vec<DVec3> = Vec::new();
        for (i, a) in planes.iter().enumerate() {
            for (j, b) in planes.iter().enumerate().skip(i + 1) {
                for c in &planes[j + 1..] {
                    let det = a.0.dot(b.0.cross(c.0));
                    if det.abs() < INDEPENDENT {
                        continue;
                    }
                    let p = (b.0.cross(c.0) * a.1 + c.0.cross(a.0) * b.1 + a.0.cross(b.0) * c.1) / det;
                    let inside = planes.iter().all(|(n, d)| n.dot(p) <= d + ON_PLANE_MM);
                    if inside && corners.iter().all(|q| q.distance(p) > 10.0 * ON_PLANE_MM) {
                        corners.push(p);
                    }
                }
            }
        }
        let mut solid = Self {
            corners,
            faces: Vec::new(),
            normals: Vec::new(),
            edges: Vec::new(),
        };
        for &(normal, d) in planes {
            let mut face: Vec<usize> = (0..solid.corners.len())
                .filter(|&k| (normal.dot(solid.corners[k]) - d).abs() < ON_PLANE_MM)
                .collect();
            if face.len() < 3 {
                return None;
            }
            let middle = face.iter().map(|&k| solid.corners[k]).sum::<DVec3>() / face.len() as f64;
            let x = normal.any_orthonormal_vector();
            let angle = |k: usize| {
                let from = solid.corners[k] - middle;
                from.dot(normal.cross(x)).atan2(from.dot(x))
            };
            face.sort_by(|&a, &b| angle(a).total_cmp(&angle(b)));
            solid.faces.push(face);
            solid.normals.push(normal);
        }
        solid.edges = solid.edge_directions();
        // Euler: corners − edges + faces = 2, so that no plane touches in a corner or an edge alone.
        let sides: usize = solid.faces.iter().map(Vec::len).sum();
        (solid.corners.len() + solid.faces.len() == sides / 2 + 2).then_some(solid)
    }

    fn edge_directions(&self) -> Vec<DVec3> {
        let mut edges: Vec<DVec3> = Vec::new();
        for face in &self.faces {
            for (&a, &b) in face.iter().zip(face.iter().cycle().skip(1)) {
                let along = (self.corners[b] - self.corners[a]).normalize();
                if edges.iter().all(|edge| edge.cross(along).length() > 1e-9) {
                    edges.push(along);
                }
            }
        }
        edges
    }

    /// A box of these half edges.
    pub fn cuboid(half: DVec3) -> Option<Self> {
        Self::of(&box_planes(half))
    }
}

fn box_planes(half: DVec3) -> Vec<(DVec3, f64)> {
    [(DVec3::X, half.x), (DVec3::Y, half.y), (DVec3::Z, half.z)]
        .into_iter()
        .flat_map(|(n, d)| [(n, d), (-n, d)])
        .collect()
}

impl Convex {
    /// Point farthest along `direction`.
    pub fn support(&self, direction: DVec3) -> DVec3 {
        match self {
            Self::Polytope(solid) => (solid.corners.iter().copied())
                .max_by(|a, b| a.dot(direction).total_cmp(&b.dot(direction)))
                .unwrap_or_default(),
            Self::Cylinder { radius, half } => {
                let across = direction.truncate().try_normalize().unwrap_or(DVec2::X) * *radius;
                across.extend(half.copysign(direction.z))
            }
            Self::Ball { radius } => direction.normalize_or_zero() * *radius,
        }
    }

    /// Outward normals of its flat faces.
    pub fn normals(&self) -> Vec<DVec3> {
        match self {
            Self::Polytope(solid) => solid.normals.clone(),
            Self::Cylinder { .. } => vec![DVec3::Z],
            Self::Ball { .. } => Vec::new(),
        }
    }

    /// Directions of its straight edges and generators, parallel ones once.
    pub fn straight(&self) -> Vec<DVec3> {
        match self {
            Self::Polytope(solid) => solid.edges.clone(),
            Self::Cylinder { .. } => vec![DVec3::Z],
            Self::Ball { .. } => Vec::new(),
        }
    }

    /// Radius of a sphere about the origin that holds it.
    pub fn radius(&self) -> f64 {
        match self {
            Self::Polytope(solid) => solid.corners.iter().map(|p| p.length()).fold(0.0, f64::max),
            Self::Cylinder { radius, half } => radius.hypot(*half),
            Self::Ball { radius } => *radius,
        }
    }

    /// Its STEP solid.
    pub fn write(&self, text: &mut StepText) -> u64 {
        match self {
            Self::Polytope(solid) => text.polyhedron(&solid.corners, &solid.faces),
            Self::Cylinder { radius, half } => text.cylinder(*radius, *half),
            Self::Ball { radius } => text.ball(*radius),
        }
    }

    /// A random solid whose longest side is `length_mm`: box, prism, bar of square or flat section with a ratio up to 1 : 200, wedge, chamfered block,
    /// or cylinder, in turn as `kind` counts.
    pub fn random(kind: usize, length_mm: f64, random: &mut fastrand::Rng) -> Self {
        let half = 0.5 * length_mm;
        let mut share = |least: f64| half * least.powf(random.f64());
        let solid = match kind % 6 {
            0 => Polytope::cuboid(DVec3::new(half, share(0.1), share(0.1))),
            1 => {
                let radius = share(0.1);
                prism(half, radius, 3 + random.usize(..8), random)
            }
            2 => {
                let thin = share(1.0 / 200.0);
                let wide = thin
                    * if random.bool() {
                        1.0
                    } else {
                        1.0 + 4.0 * random.f64()
                    };
                Polytope::cuboid(DVec3::new(half, wide.min(half), thin))
            }
            3 => {
                let radius = share(0.1);
                Some(DVec3::new(half, radius, radius)).and_then(|half| wedge(half, random))
            }
            4 => {
                let sides = DVec3::new(half, share(0.2), share(0.2));
                chamfered(sides, random)
            }
            _ => {
                return Self::Cylinder {
                    radius: share(1.0 / 50.0),
                    half,
                };
            }
        };
        // A chamfer may cut off a whole face; the plain box stands in for it.
        let solid = solid.or_else(|| Polytope::cuboid(DVec3::new(half, 0.5 * half, 0.3 * half)));
        solid.map_or(Self::Cylinder { radius: half, half }, Self::Polytope)
    }
}

/// A prism along x with an irregular section.
fn prism(half: f64, radius: f64, sides: usize, random: &mut fastrand::Rng) -> Option<Polytope> {
    let mut planes = vec![(DVec3::X, half), (-DVec3::X, half)];
    for side in 0..sides {
        let angle = std::f64::consts::TAU * (side as f64 + 0.3 * random.f64()) / sides as f64;
        planes.push((DVec3::new(0.0, angle.cos(), angle.sin()), radius));
    }
    Polytope::of(&planes)
}

/// A box whose top is inclined by up to 40°.
fn wedge(half: DVec3, random: &mut fastrand::Rng) -> Option<Polytope> {
    let mut planes = box_planes(half);
    let angle = 0.7 * random.f64() * if random.bool() { 1.0 } else { -1.0 };
    planes[4].0 = DVec3::new(0.0, angle.sin(), angle.cos());
    Polytope::of(&planes)
}

/// A box with two stacked chamfers along some of its edges.
fn chamfered(half: DVec3, random: &mut fastrand::Rng) -> Option<Polytope> {
    let mut planes = box_planes(half);
    let cut = 0.3 * half.min_element() * (0.2 + random.f64());
    for [slope, depth] in [[1.0, 1.0], [2.0, 0.8]] {
        let normal = DVec3::new(0.0, 1.0, slope).normalize();
        planes.push((normal, normal.dot(half) - cut * depth * normal.y));
        let normal = DVec3::new(slope, 0.0, -1.0).normalize();
        planes.push((normal, normal.abs().dot(half) - cut * depth * normal.z.abs()));
    }
    Polytope::of(&planes)
}
