//! Smallest distance of the surfaces of two parts of any form, with proven bounds.
//!
//! Two surfaces are nearest at an edge of one and a face of the other, at two edges, or inside two faces of which one is curved. A face is its
//! unbounded surface by formula; whether a foot on it belongs to the part is the field's answer there. A piece of an edge is excluded from a face
//! when a bound of its distance (to second order) exceeds the smallest distance found, or when the foot of its middle is farther from the part than
//! feet move along the piece; else it is halved. Insides of faces: a sphere, torus or cylinder is all that lies a radius about a point, circle or
//! line, and that is searched like an edge. Pieces that remain when the budget is used up, or where the field is not proven, bound the result from
//! below.
//!
//! Sources: Johnson & Cohen 2001, "Spatialized normal cone hierarchies" (bounding pairs of features); Lipschitz branch and bound. Metres. Cost: one
//! formula for a node or piece and a face, a field query for each piece that could be nearest.

use glam::{Mat3, Vec3};
use mortise_protocol::image::{EDGE_ERROR_CELLS, FaceRecord, Place, SHAPE_LEAKY, Shape, surface_kind};

use crate::collision::exact_surface::{exact, signed};
use crate::math::pose::Pose;
use crate::math::scalar::{larger, smaller};
use crate::math::vector::length;
use crate::probe::convex::Separation;
use crate::probe::curve::{Curve, Side, nearest_of_segments, on_edge, placed, refined};
use crate::probe::face_bounds::{bending, foot_speed, radius_at_axis, turn_of_foot};
use crate::probe::nearest::Measure;
use crate::probe::support::rounding;

/// A point is on a surface within this distance, m.
const ON_SURFACE_M: f32 = 1e-7;
/// Bounds closer than this are not improved further, m.
const CLOSE_M: f32 = 0.1e-6;
/// Pieces shorter than this are not halved, m.
const SHORT_M: f32 = 0.1e-6;
/// Evaluations of a piece at most.
const BUDGET: u32 = 40_000;
/// Depth of halving: a length of a metre falls below [`SHORT_M`].
const DEPTH: usize = 48;

/// Distance of two surfaces.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Clearance {
    /// Smallest distance found between points of the two surfaces, m; infinite if none was.
    pub upper: f32,
    /// No points of the surfaces are nearer than this, m.
    pub lower: f32,
    /// Whether a point of one part was found inside the other.
    pub overlap: bool,
    /// Smallest distance of such a point, m, negative.
    pub deepest: f32,
    /// The nearest points found: of the first shape and of the second, frame of the second, m.
    pub nearest: [Vec3; 2],
}

/// Search state.
struct Clearing {
    found: Clearance,
    spent: u32,
    /// Whether the first shape's curves are searched, against the second's faces.
    forward: bool,
}

/// Clearance of `held` placed at `pose` in the frame of `other`; distances beyond `enough` are of no interest.
pub(crate) fn clearance(held: &Shape<'_>, other: &Shape<'_>, pose: &Pose, enough: f32) -> Clearance {
    let rotation = pose.rotation();
    let back = rotation.transpose();
    let sides = [
        Side {
            shape: held,
            rotation,
            offset: pose.position,
        },
        Side {
            shape: other,
            rotation: back,
            offset: -(back * pose.position),
        },
    ];
    let mut search = Clearing {
        found: Clearance {
            upper: enough,
            lower: f32::INFINITY,
            overlap: false,
            deepest: 0.0,
            nearest: [Vec3::ZERO; 2],
        },
        spent: 0,
        forward: true,
    };
    for forward in [true, false] {
        search.forward = forward;
        let [own, against] = if forward { [0, 1] } else { [1, 0] }.map(|i| &sides[i]);
        search.vertex_inside(own, against);
        for face in against.shape.faces {
            search.edges_against(own, against, face);
            search.insides_against(own, against, face);
            if search.found.overlap {
                return search.found;
            }
        }
    }
    search.forward = true;
    search.edges_against_edges(&sides);
    if !insides_are_known(&sides, search.found.upper) {
        search.found.lower = f32::NEG_INFINITY;
    }
    search.found
}

/// Distance by the field: lower bound of its magnitude with its sign, and whether a value of zero means the surface.
fn by_field(shape: &Shape<'_>, p: Vec3) -> (f32, bool) {
    match shape.field.place(p.to_array()) {
        Place::Far { inside, bound } => (if inside { -bound } else { bound }, false),
        Place::Cell(cell) => match exact(shape.surfaces(), shape.field.nearby(&cell), p) {
            Some((distance, _)) => (distance, true),
            None => {
                let record = shape.field.record();
                let found = shape.field.distance(&cell);
                let error = EDGE_ERROR_CELLS * record.cell;
                let least = (found.abs() - error).max(0.0).min(record.band);
                (if found < 0.0 { -least } else { least }, false)
            }
        },
    }
}

/// Whether `p` is proven to lie inside the shape.
pub(crate) fn is_inside(shape: &Shape<'_>, p: Vec3) -> bool {
    let (distance, sure) = by_field(shape, p);
    sure && distance < -10.0 * ON_SURFACE_M
}

/// Whether a face is curved and bulges outward.
fn bulges(face: &FaceRecord) -> bool {
    face.kind != surface_kind::PLANE && face.sense > 0.0
}

/// Whether every pair of faces that could be nearest inside both is searched: all but cones with cones or with grooves of a torus, unless their edges
/// show them to be farther apart than `upper`.
fn insides_are_known(sides: &[Side<'_, '_>; 2], upper: f32) -> bool {
    let cone = |face: &FaceRecord| face.kind == surface_kind::CONE && bulges(face);
    let groove = |face: &FaceRecord| face.kind == surface_kind::TORUS && !bulges(face);
    let all = |side: &Side<'_, '_>| {
        let closed = side
            .shape
            .faces
            .iter()
            .all(|face| face.kind != surface_kind::OTHER);
        closed && side.shape.record.flags & SHAPE_LEAKY == 0
    };
    let apart = |i: usize, j: usize| {
        let sphere = |side: &Side<'_, '_>, face: usize| {
            let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
            for edge in side
                .shape
                .edges
                .iter()
                .filter(|e| e.faces.contains(&(face as u16)))
            {
                let reach =
                    Vec3::splat(length(Vec3::from_array(edge.half)) + length(Vec3::from_array(edge.bend)));
                let center = Vec3::from_array(edge.center);
                (low, high) = (low.min(center - reach), high.max(center + reach));
            }
            (0.5 * (low + high), 0.5 * length(high - low))
        };
        let (a, ra) = sphere(&sides[0], i);
        let (b, rb) = sphere(&sides[1], j);
        ra.is_finite() && rb.is_finite() && length(sides[0].to_other(a) - b) - ra - rb > upper
    };
    all(&sides[0])
        && all(&sides[1])
        && (sides[0].shape.faces.iter().enumerate()).all(|(i, a)| {
            (sides[1].shape.faces.iter().enumerate()).all(|(j, b)| {
                let hidden = cone(a) && (cone(b) || groove(b)) || groove(a) && cone(b);
                !hidden || apart(i, j)
            })
        })
}

impl Clearing {
    /// Finds a part that lies wholly inside the other by one point of its surface.
    fn vertex_inside(&mut self, own: &Side<'_, '_>, against: &Side<'_, '_>) {
        let vertex = own.shape.edges.first().map(|edge| edge.center);
        if let Some(p) = vertex.or(own.shape.points.first().map(|p| p.position)) {
            let (inside, _) = by_field(against.shape, own.to_other(Vec3::from_array(p)));
            self.overlapping(inside);
        }
    }

    /// Pieces of edges against one face.
    fn edges_against(&mut self, own: &Side<'_, '_>, against: &Side<'_, '_>, face: &FaceRecord) {
        let mut index = 0;
        while let Some(node) = own.shape.edge_nodes.get(index) {
            let center = own.to_other(Vec3::from_array(node.center));
            let distance = signed(face, center).map_or(0.0, |(d, _)| d.abs());
            if distance - node.radius > self.found.upper {
                index = node.skip as usize;
                continue;
            }
            index += 1;
            if node.skip as usize == index {
                for edge in node.points(own.shape.edges) {
                    self.curve_against(own, against, face, &placed(own, edge));
                }
            }
        }
    }

    /// Points, circles and lines about which the bulging faces lie, against one face.
    fn insides_against(&mut self, own: &Side<'_, '_>, against: &Side<'_, '_>, face: &FaceRecord) {
        for bulging in own.shape.faces.iter().filter(|face| bulges(face)) {
            let origin = Vec3::from_array(bulging.origin);
            let axis = Vec3::from_array(bulging.axis);
            let mut curve = Curve {
                center: own.to_other(origin),
                half: Vec3::ZERO,
                bend: Vec3::ZERO,
                circle: false,
                radius: bulging.radius,
                faces: None,
                error: 0.0,
            };
            match bulging.kind {
                surface_kind::SPHERE => {}
                surface_kind::TORUS => {
                    let x = axis.any_orthonormal_vector();
                    curve.half = own.rotation * (x * bulging.radius);
                    curve.bend = own.rotation * (axis.cross(x) * bulging.radius);
                    curve.circle = true;
                    curve.radius = bulging.second;
                }
                // Ruled faces are nearest at their ends, unless they bulge towards each other.
                surface_kind::CYLINDER if bulges(face) => {
                    let middle = Vec3::from_array(own.shape.record.center) - origin;
                    curve.center = own.to_other(origin + axis * middle.dot(axis));
                    curve.half = own.rotation * (axis * own.shape.record.radius);
                }
                surface_kind::CONE => {
                    let along = bulging.radius / libm::tanf(bulging.second);
                    curve.center = own.to_other(origin - axis * along);
                    curve.radius = 0.0;
                }
                _ => continue,
            }
            self.curve_against(own, against, face, &curve);
        }
    }

    /// One curve against one face.
    fn curve_against(
        &mut self,
        own: &Side<'_, '_>,
        against: &Side<'_, '_>,
        face: &FaceRecord,
        curve: &Curve,
    ) {
        let far = signed(face, curve.center).map_or(0.0, |(d, _)| (d.abs() - curve.radius).abs());
        let far = far - curve.speed() - curve.error;
        if far > self.found.upper {
            self.note(far);
            return;
        }
        for curve in refined(own, curve) {
            self.search(own, against, face, &curve);
        }
    }

    /// One curve whose error is known against one face.
    fn search(&mut self, own: &Side<'_, '_>, against: &Side<'_, '_>, face: &FaceRecord, curve: &Curve) {
        let mut stack: heapless::Vec<(f32, f32), DEPTH> = heapless::Vec::new();
        let _ = stack.push((0.0, 1.0));
        while let Some((t, h)) = stack.pop() {
            self.spent += 1;
            let p = curve.at(t);
            let reach = curve.speed() * h;
            let Some((d, n)) = signed(face, p) else {
                // On the axis or at the centre, where the surface is a radius away.
                let lower = (radius_at_axis(face) - curve.radius).abs() - reach - curve.error;
                if lower < self.found.upper {
                    self.split(&mut stack, t, h, reach, if lower > 0.0 { lower } else { 0.0 });
                }
                continue;
            };
            let least = self.least(face, curve, (t, h), (p, d, n)) - curve.radius;
            // The own surface may lie beyond the face: then it is the nearer to it, the farther the curve.
            let beyond = curve.radius - (d.abs() + reach);
            let lower = (if least > beyond { least } else { beyond }) - curve.error;
            if lower >= self.found.upper - CLOSE_M - 2.0 * curve.error {
                self.note(lower);
                continue;
            }
            let side = if d < 0.0 { -1.0 } else { 1.0 };
            let foot = p - n * d;
            let own_foot = p - n * (side * curve.radius);
            let (at_foot, sure) = by_field(against.shape, foot);
            let (at_own, own_sure) = if curve.radius > 0.0 {
                by_field(own.shape, own.bring_back(own_foot))
            } else {
                (0.0, true)
            };
            let moves = reach * foot_speed(face, d, reach);
            if at_foot.abs() > moves + ON_SURFACE_M
                || at_own.abs() > reach + turn_of_foot(face, d, reach, curve.radius) + ON_SURFACE_M
            {
                continue;
            }
            if sure && own_sure && at_foot.abs() <= ON_SURFACE_M && at_own.abs() <= ON_SURFACE_M {
                self.candidate([own, against], face, curve, own_foot);
                if self.found.overlap {
                    return;
                }
            }
            if h == 1.0 {
                self.descend(own, against, face, curve, n.dot(curve.derivatives(t).0) * side);
            }
            let unproven = !(sure && own_sure) && reach < 0.05 * against.shape.field.record().cell;
            if unproven || lower >= self.found.upper - CLOSE_M - 2.0 * curve.error {
                self.note(lower);
            } else {
                self.split(&mut stack, t, h, reach, lower);
            }
        }
    }

    /// The end of a whole curve towards which the distance falls, as a candidate: straight pieces are nearest there.
    fn descend(
        &mut self,
        own: &Side<'_, '_>,
        against: &Side<'_, '_>,
        face: &FaceRecord,
        curve: &Curve,
        slope: f32,
    ) {
        let p = curve.at(if slope > 0.0 { -1.0 } else { 1.0 });
        let Some((d, n)) = signed(face, p) else {
            return;
        };
        let own_foot = p - n * if d < 0.0 { -curve.radius } else { curve.radius };
        let feet = [(against.shape, p - n * d), (own.shape, own.bring_back(own_foot))];
        let count = if curve.radius > 0.0 { 2 } else { 1 };
        if feet.iter().take(count).all(|&(shape, foot)| {
            let (at, sure) = by_field(shape, foot);
            sure && at.abs() <= ON_SURFACE_M
        }) {
            self.candidate([own, against], face, curve, own_foot);
        }
    }

    /// Lower bound of the distance of the part t ± h of a curve from a face's surface: to second order, less a bound of the third.
    fn least(
        &self,
        face: &FaceRecord,
        curve: &Curve,
        (t, h): (f32, f32),
        (p, d, n): (Vec3, f32, Vec3),
    ) -> f32 {
        let reach = curve.speed() * h;
        let plain = d.abs() - reach;
        let sign = if d < 0.0 { -1.0 } else { 1.0 };
        let (first, second) = curve.derivatives(t);
        let (first, second) = (first * h, second * (h * h));
        let (bending, curl) = bending(face, p, n, first, reach);
        if curl == f32::MAX {
            return plain;
        }
        let turning = if curve.circle {
            length(second) * core::f32::consts::PI * h
        } else {
            0.0
        };
        let turn = length(second) + turning;
        let third = 3.0 * reach * curl * (reach * reach * curl + turn) + turning;
        let (slope, curving) = (n.dot(first).abs(), sign * (bending + n.dot(second)));
        let least = if curving > slope {
            -0.5 * slope * slope / curving
        } else {
            0.5 * curving - slope
        };
        let bound = d.abs() + least - third * (1.0 / 6.0);
        if bound > plain { bound } else { plain }
    }

    /// A point `p` of the own surface at a curve, and its foot on a face, which is known to be part of the other surface there.
    fn candidate(&mut self, [own, against]: [&Side<'_, '_>; 2], face: &FaceRecord, curve: &Curve, p: Vec3) {
        let (p, error) = on_edge(own, curve, p);
        let Some((d, n)) = signed(face, p) else {
            return;
        };
        let (inside, sure) = by_field(against.shape, p);
        if sure {
            self.overlapping(inside + error);
        }
        if d.abs() + error < self.found.upper {
            self.found.upper = d.abs() + error;
            let foot = p - n * d;
            self.found.nearest = if self.forward {
                [p, foot]
            } else {
                [against.to_other(foot), against.to_other(p)]
            };
        }
    }

    fn overlapping(&mut self, inside: f32) {
        if inside < -10.0 * ON_SURFACE_M {
            self.found.overlap = true;
            if inside < self.found.deepest {
                self.found.deepest = inside;
            }
        }
    }

    fn note(&mut self, lower: f32) {
        if lower < self.found.lower {
            self.found.lower = lower;
        }
    }

    /// Halves a part of a curve, or notes its bound when it is short or the budget is used up.
    fn split(
        &mut self,
        stack: &mut heapless::Vec<(f32, f32), DEPTH>,
        t: f32,
        h: f32,
        reach: f32,
        lower: f32,
    ) {
        let halves = [(t - 0.5 * h, 0.5 * h), (t + 0.5 * h, 0.5 * h)];
        if self.spent > BUDGET || reach < SHORT_M || halves.iter().any(|&half| stack.push(half).is_err()) {
            self.note(lower);
        }
    }

    /// Edges of one shape against edges of the other.
    fn edges_against_edges(&mut self, sides: &[Side<'_, '_>; 2]) {
        let [own, against] = sides;
        let resting = Side {
            shape: against.shape,
            rotation: Mat3::IDENTITY,
            offset: Vec3::ZERO,
        };
        for edge in own.shape.edges {
            for curve in refined(own, &placed(own, edge)) {
                self.near_edges(own, &resting, &curve);
            }
        }
    }

    /// One piece of an edge against the edges of the other shape, which are at rest.
    fn near_edges(&mut self, own: &Side<'_, '_>, resting: &Side<'_, '_>, curve: &Curve) {
        let reach = length(curve.half) + length(curve.bend);
        let mut index = 0;
        while let Some(node) = resting.shape.edge_nodes.get(index) {
            let far = length(curve.center - Vec3::from_array(node.center)) - reach - node.radius;
            if far > self.found.upper {
                index = node.skip as usize;
                continue;
            }
            index += 1;
            if node.skip as usize != index {
                continue;
            }
            for other in node.points(resting.shape.edges) {
                let other = placed(resting, other);
                let ends = |curve: &Curve| [curve.center - curve.half, curve.center + curve.half];
                let [t, u] = nearest_of_segments(ends(curve), ends(&other)).map(|share| 2.0 * share - 1.0);
                let apart = (curve.center + curve.half * t) - (other.center + other.half * u);
                let bulges = length(curve.bend) + length(other.bend) + curve.error + other.error;
                if length(apart) - bulges > self.found.upper {
                    continue;
                }
                for other in refined(resting, &other) {
                    self.curve_against_curve([own, resting], [(curve, 0.0, 1.0), (&other, 0.0, 1.0)], DEPTH);
                }
            }
        }
    }

    /// Two parts of curves: the distance of their chords less the bulges; the more bulging one is halved.
    fn curve_against_curve(
        &mut self,
        sides: [&Side<'_, '_>; 2],
        [a, b]: [(&Curve, f32, f32); 2],
        depth: usize,
    ) {
        self.spent += 1;
        let chord = |(curve, t, h): (&Curve, f32, f32)| [curve.at(t - h), curve.at(t + h)];
        let ([p, q], [r, s]) = (chord(a), chord(b));
        let [along, beside] = nearest_of_segments([p, q], [r, s]);
        let apart = (p + (q - p) * along) - (r + (s - r) * beside);
        let n = apart * (1.0 / (length(apart) + f32::MIN_POSITIVE));
        // A quadratic bulges by h²·bend to one side of its chord: that matters as far as it is towards the other curve.
        let towards = |(curve, _, h): (&Curve, f32, f32), n: Vec3| larger(curve.bend.dot(n) * h * h, 0.0);
        let own = smaller(p.dot(n), q.dot(n)) - towards(a, n);
        let others = larger(r.dot(n), s.dot(n)) + towards(b, -n);
        let error = a.0.error + b.0.error;
        let lower = own - others - error;
        if lower >= self.found.upper - CLOSE_M - 2.0 * error {
            self.note(lower);
            return;
        }
        let [t, u] = [(a, along), (b, beside)].map(|((_, t, h), share)| t + h * (2.0 * share - 1.0));
        let (x, off_x) = on_edge(sides[0], a.0, a.0.at(t));
        let (y, off_y) = on_edge(sides[1], b.0, b.0.at(u));
        let distance = length(x - y) + off_x + off_y;
        if distance < self.found.upper {
            self.found.upper = distance;
            self.found.nearest = [x, y];
        }
        if lower >= self.found.upper - CLOSE_M - 2.0 * error || depth == 0 || self.spent > BUDGET {
            self.note(lower);
            return;
        }
        let size = |(curve, _, h): (&Curve, f32, f32)| (length(curve.half) + length(curve.bend)) * h;
        for k in [-1.0, 1.0] {
            let part = |(t, h): (f32, f32)| (t + 0.5 * k * h, 0.5 * h);
            if size(a) >= size(b) {
                let (t, h) = part((a.1, a.2));
                self.curve_against_curve(sides, [(a.0, t, h), b], depth - 1);
            } else {
                let (t, h) = part((b.1, b.2));
                self.curve_against_curve(sides, [a, (b.0, t, h)], depth - 1);
            }
        }
    }
}

impl Clearance {
    /// The same as a separation of `held` at `pose` from `other`, where the surfaces were shown to be apart.
    pub fn separation(&self, pose: &Pose, held: &Shape<'_>, other: &Shape<'_>) -> Option<Separation> {
        let lower = if self.lower < self.upper {
            self.lower
        } else {
            self.upper
        };
        if self.overlap || lower <= 0.0 || self.upper.is_infinite() {
            return None;
        }
        let [a, b] = self.nearest.map(|p| p.as_dvec3());
        let [upper, lower] = [self.upper, lower].map(f64::from);
        // A foot may be off its surface by the tolerance, and moves as far along the surface as that surface is off.
        let fixed = rounding(held, pose) + rounding(other, &Pose::IDENTITY) + 2.0 * f64::from(ON_SURFACE_M);
        Some(Separation {
            distance: upper,
            error: upper - lower + fixed,
            normal: (a - b).normalize_or_zero(),
            a,
            measure: Measure::DeepestPoint,
        })
    }
}
