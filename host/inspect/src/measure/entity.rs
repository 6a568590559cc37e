//! One feature of a shape, with its exact curve or surface.

use std::f64::consts::{PI, TAU};

use glam::{DAffine3, DVec3};
use mortise_bake::ExactSurface;
use mortise_brep::{Curve, EDGE_TOLERANCE_MM, Edge, Face, Frame, Shape, Surface};

use super::line::{AxisLine, Straight};

/// A round feature, by its index in the shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Round {
    /// A cylinder, cone, sphere or torus.
    Face(u32),
    /// A circle or an arc.
    Edge(u32),
}

/// A feature of a shape that can be measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Feature {
    /// The first or last point of an edge.
    Vertex {
        /// Index of the edge.
        edge: u32,
        /// Whether it is the last one.
        last: bool,
    },
    /// The centre of a circle or sphere.
    Center(Round),
    /// An edge.
    Edge(u32),
    /// The axis of a circle, cylinder, cone or torus, as a line without ends.
    Axis(Round),
    /// A face.
    Face(u32),
}

/// What an entity is, without its place on the screen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum About {
    /// A point.
    Point {
        /// Where, mm.
        at: DVec3,
    },
    /// A straight edge.
    Line {
        /// Length, mm.
        length_mm: f64,
    },
    /// A circle or an arc.
    Circle {
        /// Radius, mm.
        radius_mm: f64,
        /// Length along it, mm.
        length_mm: f64,
        /// Centre, mm.
        center: DVec3,
        /// Whether it ends where it begins.
        closed: bool,
    },
    /// Any other edge.
    Curve {
        /// Length, mm.
        length_mm: f64,
    },
    /// An axis.
    Axis {
        /// The line.
        line: AxisLine,
        /// Radius of the circle or cylinder that it belongs to, mm.
        radius_mm: Option<f64>,
    },
    /// A face.
    Face {
        /// Area, mm².
        area_mm2: f64,
        /// The surface it lies on, in the shape's frame.
        surface: Surface,
        /// Whether the material lies outside of a round surface: a hole's wall, not a shaft's.
        hollow: bool,
    },
}

/// A feature prepared for measuring, in its shape's frame.
pub struct Entity {
    pub(super) kind: Kind,
    /// Bound of the error of distances, mm: 0 where curve and surface have closed forms.
    pub error_mm: f64,
}

pub(super) enum Kind {
    Point(DVec3),
    Line { straight: Straight, length_mm: f64 },
    Arc(Arc),
    Curve { points: Vec<DVec3>, length_mm: f64 },
    Axis { line: AxisLine, radius_mm: Option<f64> },
    Face(Box<Patch>),
}

/// A piece of a circle: the angles from `from` over `sweep`, either sign, in the frame's plane.
pub(super) struct Arc {
    pub frame: Frame,
    pub radius: f64,
    pub from: f64,
    pub sweep: f64,
    pub length_mm: f64,
}

/// One face.
pub(super) struct Patch {
    pub surface: ExactSurface,
    pub face: Face,
    /// Places at which searches begin, near the surface.
    pub starts: Vec<DVec3>,
}

/// Places at which a search begins on a face: so many inside, and so many along its edges.
const STARTS: usize = 240;
/// Places at which a search begins on an edge.
const EDGE_STARTS: usize = 64;

impl Entity {
    /// The entity of a feature of `shape`; `None` for a feature that the shape does not have, such as the axis of a plane.
    ///
    /// Cost: of a face linear in its triangles, some microseconds each; else none.
    pub fn of(shape: &Shape, feature: Feature) -> Option<Self> {
        let exact = |kind| Some(Self { kind, error_mm: 0.0 });
        match feature {
            Feature::Vertex { edge, last } => {
                let line = &shape.edges.get(edge as usize)?.polyline;
                let end = if last { line.last() } else { line.first() };
                exact(Kind::Point(*end?))
            }
            Feature::Center(round) => exact(Kind::Point(center(shape, round)?)),
            Feature::Axis(round) => {
                let (line, radius_mm) = axis(shape, round)?;
                exact(Kind::Axis { line, radius_mm })
            }
            Feature::Edge(index) => edge_of(shape, index),
            Feature::Face(index) => Patch::of(shape, index).map(|patch| Self {
                error_mm: patch.surface.surface_error_mm(),
                kind: Kind::Face(Box::new(patch)),
            }),
        }
    }

    /// What it is, at a pose (shape to world).
    pub fn about(&self, pose: &DAffine3) -> About {
        match &self.kind {
            Kind::Point(at) => About::Point {
                at: pose.transform_point3(*at),
            },
            Kind::Line { length_mm, .. } => About::Line {
                length_mm: *length_mm,
            },
            Kind::Arc(arc) => About::Circle {
                radius_mm: arc.radius,
                length_mm: arc.length_mm,
                center: pose.transform_point3(arc.frame.origin),
                closed: arc.sweep.abs() > TAU - 1e-6,
            },
            Kind::Curve { length_mm, .. } => About::Curve {
                length_mm: *length_mm,
            },
            Kind::Axis { line, radius_mm } => About::Axis {
                line: line.placed(pose),
                radius_mm: *radius_mm,
            },
            Kind::Face(patch) => About::Face {
                area_mm2: patch.face.area_mm2,
                surface: patch.face.surface,
                hollow: patch.face.reversed,
            },
        }
    }

    /// A point to which a label can be tied: near the middle of it, in the shape's frame, mm.
    pub fn anchor(&self) -> DVec3 {
        match &self.kind {
            Kind::Point(at) => *at,
            Kind::Line { straight, .. } => straight.ends().sum::<DVec3>() / 2.0,
            Kind::Arc(arc) => arc.at(arc.from + 0.5 * arc.sweep),
            Kind::Curve { points, .. } => points[points.len() / 2],
            Kind::Axis { line, .. } => line.origin,
            Kind::Face(patch) => patch.middle(),
        }
    }

    /// The axis of what is round about one, in the shape's frame.
    pub(super) fn axis(&self) -> Option<AxisLine> {
        match &self.kind {
            Kind::Axis { line, .. } => Some(*line),
            Kind::Arc(arc) => Some(along_z(&arc.frame)),
            Kind::Face(patch) => surface_axis(&patch.face.surface).map(|(line, _)| line),
            _ => None,
        }
    }

    /// Nearest point to `p`, both in the shape's frame, mm.
    pub(super) fn nearest(&self, p: DVec3) -> DVec3 {
        match &self.kind {
            Kind::Point(at) => *at,
            Kind::Line { straight, .. } => straight.nearest(p),
            Kind::Axis { line, .. } => line.nearest(p),
            Kind::Arc(arc) => arc.nearest(p),
            Kind::Curve { points, .. } => on_polyline(points, p),
            Kind::Face(patch) => patch.surface.nearest(p).map_or(p, |near| near.point),
        }
    }

    /// Places at which searches begin; none for an axis, which has no ends.
    pub(super) fn starts(&self) -> Vec<DVec3> {
        match &self.kind {
            Kind::Point(at) => vec![*at],
            Kind::Line { straight, .. } => straight.ends().collect(),
            Kind::Axis { .. } => Vec::new(),
            Kind::Arc(arc) => (0..=EDGE_STARTS)
                .map(|i| arc.at(arc.from + arc.sweep * i as f64 / EDGE_STARTS as f64))
                .collect(),
            Kind::Curve { points, .. } => strided(points, 4 * EDGE_STARTS).collect(),
            Kind::Face(patch) => patch.starts.clone(),
        }
    }
}

fn strided(points: &[DVec3], most: usize) -> impl Iterator<Item = DVec3> {
    let last = points.last().copied();
    let step = points.len().div_ceil(most).max(1);
    points.iter().step_by(step).copied().chain(last)
}

fn edge_of(shape: &Shape, index: u32) -> Option<Entity> {
    let edge = shape.edges.get(index as usize)?;
    let (first, last) = (*edge.polyline.first()?, *edge.polyline.last()?);
    let kind = match edge.curve {
        Curve::Line { origin, direction } => {
            let line = AxisLine { origin, direction };
            let [a, b] = [first, last].map(|end| (end - origin).dot(direction));
            let straight = Straight {
                line,
                from: a.min(b),
                to: a.max(b),
            };
            Kind::Line {
                straight,
                length_mm: edge.length_mm,
            }
        }
        Curve::Circle { frame, radius } => Kind::Arc(Arc::of(edge, frame, radius)),
        Curve::Other => {
            return Some(Entity {
                kind: Kind::Curve {
                    points: fine(shape, index, edge),
                    length_mm: edge.length_mm,
                },
                error_mm: EDGE_TOLERANCE_MM,
            });
        }
    };
    Some(Entity { kind, error_mm: 0.0 })
}

/// Points of an edge that has no closed form, as dense as the model has them.
fn fine(shape: &Shape, index: u32, edge: &Edge) -> Vec<DVec3> {
    let found = shape.curves.iter().find(|curve| curve.edge == index);
    let between = found.map_or(&[][..], |curve| curve.between.as_slice());
    let mut points = Vec::new();
    for (i, &p) in edge.polyline.iter().enumerate() {
        points.push(p);
        points.extend(between.get(i).into_iter().flatten());
    }
    points
}

impl Arc {
    fn of(edge: &Edge, frame: Frame, radius: f64) -> Self {
        let angle = |p: DVec3| {
            let d = p - frame.origin;
            d.dot(frame.y).atan2(d.dot(frame.x))
        };
        let sweep = edge.polyline.windows(2).map(|side| {
            let turned = angle(side[1]) - angle(side[0]);
            (turned + PI).rem_euclid(TAU) - PI
        });
        Self {
            frame,
            radius,
            from: edge.polyline.first().map_or(0.0, |&p| angle(p)),
            sweep: sweep.sum(),
            length_mm: edge.length_mm,
        }
    }

    fn at(&self, angle: f64) -> DVec3 {
        let (sin, cos) = angle.sin_cos();
        self.frame.origin + self.radius * (cos * self.frame.x + sin * self.frame.y)
    }

    fn nearest(&self, p: DVec3) -> DVec3 {
        let d = p - self.frame.origin;
        let (x, y) = (d.dot(self.frame.x), d.dot(self.frame.y));
        let ends = [self.from, self.from + self.sweep].map(|angle| self.at(angle));
        let onward = (y.atan2(x) - self.from) * self.sweep.signum();
        if onward.rem_euclid(TAU) <= self.sweep.abs() && x.hypot(y) > 0.0 {
            return self.at(y.atan2(x));
        }
        let [a, b] = ends;
        if a.distance_squared(p) <= b.distance_squared(p) {
            a
        } else {
            b
        }
    }
}

fn on_polyline(points: &[DVec3], p: DVec3) -> DVec3 {
    let on = |side: &[DVec3]| {
        let along = side[1] - side[0];
        let share = (p - side[0]).dot(along) / along.length_squared().max(f64::MIN_POSITIVE);
        side[0] + along * share.clamp(0.0, 1.0)
    };
    let near = points.windows(2).map(on);
    near.min_by(|a, b| a.distance_squared(p).total_cmp(&b.distance_squared(p)))
        .unwrap_or_else(|| points.first().copied().unwrap_or(p))
}

fn along_z(frame: &Frame) -> AxisLine {
    AxisLine {
        origin: frame.origin,
        direction: frame.z,
    }
}

/// Axis of a surface that has just one, and its radius where it is the same all along.
fn surface_axis(surface: &Surface) -> Option<(AxisLine, Option<f64>)> {
    match surface {
        Surface::Cylinder { frame, radius } => Some((along_z(frame), Some(*radius))),
        Surface::Cone { frame, .. } | Surface::Torus { frame, .. } => Some((along_z(frame), None)),
        Surface::Plane { .. } | Surface::Sphere { .. } | Surface::Spline => None,
    }
}

fn axis(shape: &Shape, round: Round) -> Option<(AxisLine, Option<f64>)> {
    match round {
        Round::Face(face) => {
            let face = shape.faces.get(face as usize)?;
            let (line, radius) = surface_axis(&face.surface)?;
            // The origin of a file's frame may lie far from the face: near it, a mark can be drawn.
            let middle = middle_of(shape, face)?;
            let origin = line.nearest(middle);
            Some((AxisLine { origin, ..line }, radius))
        }
        Round::Edge(edge) => match shape.edges.get(edge as usize)?.curve {
            Curve::Circle { frame, radius } => Some((along_z(&frame), Some(radius))),
            _ => None,
        },
    }
}

/// Mean of the points of a face's edges.
fn middle_of(shape: &Shape, face: &Face) -> Option<DVec3> {
    let edges = face.edges.iter().filter_map(|&e| shape.edges.get(e as usize));
    let (mut sum, mut count) = (DVec3::ZERO, 0.0);
    for p in edges.flat_map(|edge| &edge.polyline) {
        (sum, count) = (sum + *p, count + 1.0);
    }
    (count > 0.0).then(|| sum / count)
}

fn center(shape: &Shape, round: Round) -> Option<DVec3> {
    match round {
        Round::Face(face) => match shape.faces.get(face as usize)?.surface {
            Surface::Sphere { frame, .. } => Some(frame.origin),
            _ => None,
        },
        Round::Edge(edge) => match shape.edges.get(edge as usize)?.curve {
            Curve::Circle { frame, .. } => Some(frame.origin),
            _ => None,
        },
    }
}

impl Patch {
    fn of(shape: &Shape, index: u32) -> Option<Self> {
        let alone = alone(shape, index)?;
        let starts = starts(&alone);
        Some(Self {
            face: alone.faces[0].clone(),
            surface: ExactSurface::new(&alone),
            starts,
        })
    }

    /// A point of the face near the middle of its box.
    pub fn middle(&self) -> DVec3 {
        let (low, high) = self
            .starts
            .iter()
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), &p| {
                (low.min(p), high.max(p))
            });
        let middle = low.midpoint(high);
        self.surface.nearest(middle).map_or(middle, |near| near.point)
    }
}

/// A shape of one face of `shape`, whose index becomes 0; `None` for a face without triangles.
fn alone(shape: &Shape, index: u32) -> Option<Shape> {
    let mut face = shape.faces.get(index as usize)?.clone();
    let mut one = Shape {
        deflection_mm: shape.deflection_mm,
        ..Shape::default()
    };
    let mut number = vec![u32::MAX; shape.mesh.vertices.len()];
    let own = (shape.mesh.triangles.iter().zip(&shape.mesh.triangle_face)).filter(|(_, f)| **f == index);
    for (corners, _) in own {
        let mut triangle = [0; 3];
        for (to, &from) in triangle.iter_mut().zip(corners) {
            let known = number.get_mut(from as usize)?;
            if *known == u32::MAX {
                *known = one.mesh.vertices.len() as u32;
                one.mesh.vertices.push(shape.mesh.vertices[from as usize]);
            }
            *to = *known;
        }
        one.mesh.triangles.push(triangle);
        one.mesh.triangle_face.push(0);
    }
    if one.mesh.triangles.is_empty() {
        return None;
    }
    let edges: Vec<u32> = std::mem::take(&mut face.edges);
    for old in edges {
        let edge = shape.edges.get(old as usize)?;
        let new = one.edges.len() as u32;
        let fine = shape.curves.iter().filter(|curve| curve.edge == old);
        one.curves.extend(fine.cloned().map(|mut curve| {
            curve.edge = new;
            curve
        }));
        one.edges.push(Edge {
            faces: edge.faces.iter().filter(|f| **f == index).map(|_| 0).collect(),
            ..edge.clone()
        });
        face.edges.push(new);
    }
    let spline = shape.splines.iter().filter(|spline| spline.face == index);
    one.splines.extend(spline.cloned().map(|mut spline| {
        spline.face = 0;
        spline
    }));
    one.faces.push(face);
    Some(one)
}

/// Places spread over the triangles by their area, and along the edges.
fn starts(shape: &Shape) -> Vec<DVec3> {
    let mesh = &shape.mesh;
    let corners = |t: &[u32; 3]| t.map(|v| mesh.vertices[v as usize]);
    let area = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a).length();
    let whole: f64 = mesh.triangles.iter().map(|t| area(corners(t))).sum();
    let mut starts = Vec::new();
    let mut owed = 0.0;
    for t in &mesh.triangles {
        let [a, b, c] = corners(t);
        owed += STARTS as f64 * area([a, b, c]) / whole.max(f64::MIN_POSITIVE);
        // Rows of a triangular grid with at least as many places as are owed.
        let rows = if owed < 1.0 {
            0
        } else {
            (2.0 * owed).sqrt().ceil() as usize
        };
        for i in 0..rows {
            for j in 0..rows - i {
                let share = |k: usize| (k as f64 + 1.0 / 3.0) / rows as f64;
                starts.push(a + (b - a) * share(i) + (c - a) * share(j));
                owed -= 1.0;
            }
        }
    }
    for edge in &shape.edges {
        starts.extend(strided(&edge.polyline, EDGE_STARTS));
    }
    starts
}
