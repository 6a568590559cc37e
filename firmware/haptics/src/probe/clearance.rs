//! Smallest distance of two parts of any form with analytic faces, with proven bounds.
//!
//! Two solids that are apart are nearest at a sharp convex edge (or the apex of a cone) of one and a face of the other, at two such edges, or inside
//! two faces of which one bulges: a pair inside two other faces can be shifted to an edge without growing. A face is its unbounded surface by formula;
//! whether the foot on it belongs to the part is the field's answer there. Of a pair, the part with the edge lies outside the face.
//!
//! A piece of an edge is excluded from a face when a lower bound of its distance (to second order, less a bound of the third) exceeds the smallest
//! distance found, when it lies wholly behind the face, or when the foot of its middle is farther from the part than feet move along the piece; else
//! it is halved. Insides of bulging faces lie at a known distance from a point, circle or line, and that is searched like an edge. Pieces that remain
//! when the budget is used up, or where the field is not exact, bound the result from below.
//!
//! Sources: Johnson & Cohen 2001, "Spatialized normal cone hierarchies" (bounding pairs of features); Lipschitz branch and bound. Metres, double
//! precision. Cost: one formula for a piece of a near edge and a face, a field query for each piece that could be nearest.

use glam::DVec3;
use mortise_protocol::image::{EdgeRecord, FaceRecord, Shape, surface_kind};

use crate::math::pose::Pose;
use crate::probe::conforming::{least_conforming, least_to_circle};
use crate::probe::convex::Separation;
use crate::probe::face_distance::{FaceDistance, THIRD, face_distance, wide};
use crate::probe::feature_curve::{Curve, Side, apex, bulges, exact_curve, nearest_of_segments, spine};
use crate::probe::nearest::Measure;
use crate::probe::on_surface::{ON_SURFACE_M, covered, foot, locate, on_surface};
use crate::probe::support::rounding;

/// Bounds closer than this are not improved further, m.
const CLOSE_M: f64 = 0.1e-6;
/// Pieces shorter than this are not halved, m.
const SHORT_M: f64 = 0.1e-6;
/// Share of a cell: pieces shorter than this whose field is not exact are not halved.
const SHORT_CELLS: f64 = 0.05;
/// Distance of a stored piece from its edge at most, m: the coarsest tolerance that the baker uses.
const PIECE_M: f64 = 150e-6;
/// Most evaluations of a query: some 1 ms on a PC where none is excluded early.
pub(crate) const BUDGET: u32 = 4_000;
/// Faces whose distance from a piece is found in the time of an evaluation.
const FACES_AN_EVALUATION: usize = 8;
/// Evaluations left once a piece is found that may touch.
const UNPROVEN: i64 = 500;
/// Shapes with more nodes of edges are searched without supporting planes.
const MOST_NODES: usize = 400;
/// Depth of halving: a length of a metre falls below [`SHORT_M`].
const DEPTH: usize = 48;

/// Distance of two surfaces.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Clearance {
    /// Smallest distance found between points of the two surfaces, m; the limit of the search if none was.
    pub upper: f64,
    /// No points of the surfaces are nearer than this, m, if the parts do not overlap.
    pub lower: f64,
    /// Whether a point of one part was found inside the other.
    pub overlap: bool,
    /// Signed distance of such a point of no larger magnitude than the true one, m.
    pub deepest: f64,
    /// The nearest points found: of the first shape and of the second, frame of the second, m.
    nearest: [DVec3; 2],
}

/// Which of the first 64 faces of a shape are planes with the whole shape behind them: it is spanned by its sharp convex edges and its balls and rings.
fn supporting_planes(shape: &Shape<'_>) -> u64 {
    let mut planes = 0;
    if shape.edge_nodes.len() > MOST_NODES {
        return planes;
    }
    let tolerance = on_surface(shape);
    for (index, face) in shape.faces.iter().enumerate().take(64) {
        if face.kind != surface_kind::PLANE {
            continue;
        }
        let normal = wide(face.axis) * f64::from(face.sense);
        let height = |p: [f32; 3]| (wide(p) - wide(face.origin)).dot(normal);
        let behind_pieces = shape.edges.iter().all(|edge| {
            let [half, bend] = [edge.half, edge.bend].map(|v| wide(v).dot(normal).abs());
            let slack = if edge.is_straight() { tolerance } else { PIECE_M };
            height(edge.center) + half + bend <= slack
        });
        let behind_faces = shape.faces.iter().filter(|face| bulges(face)).all(|ball| {
            let axis = wide(ball.axis);
            let (radius, second) = (f64::from(ball.radius), f64::from(ball.second));
            let tilt = axis.cross(normal).length();
            let reach = match ball.kind {
                surface_kind::SPHERE => radius,
                surface_kind::TORUS => radius * tilt + second,
                _ => return true,
            };
            height(ball.origin) + reach <= tolerance
        });
        if behind_pieces && behind_faces {
            planes |= 1 << index;
        }
    }
    planes
}

/// Search state.
struct Clearing<'s, 'i> {
    sides: [Side<'s, 'i>; 2],
    /// Distances within which points are on the surfaces, m.
    on: [f64; 2],
    /// Which of the first faces of each shape are planes with the whole shape behind them.
    supporting: [u64; 2],
    found: Clearance,
    /// Evaluations left.
    left: i64,
}

/// Clearance of `held` placed at `pose` in the frame of `other`; distances beyond `enough` are of no interest, and at most about
/// `budget` evaluations are made. `None` for shapes with faces that have no formula.
pub(crate) fn clearance(
    held: &Shape<'_>,
    other: &Shape<'_>,
    pose: &Pose,
    enough: f64,
    budget: u32,
) -> Option<Clearance> {
    if !(covered(held) && covered(other)) {
        return None;
    }
    let mut search = Clearing {
        sides: Side::both(held, other, pose),
        on: [on_surface(held), on_surface(other)],
        supporting: [held, other].map(supporting_planes),
        found: Clearance {
            upper: enough,
            lower: f64::INFINITY,
            overlap: false,
            deepest: 0.0,
            nearest: [DVec3::ZERO; 2],
        },
        left: i64::from(budget),
    };
    search.run();
    Some(search.found)
}

/// A face of the other side, by the index of the side that the curve belongs to.
#[derive(Clone, Copy)]
struct Against<'f> {
    own: usize,
    face: &'f FaceRecord,
}

impl Clearing<'_, '_> {
    fn run(&mut self) {
        self.edges(0, true);
        for own in [0, 1] {
            self.edges(own, false);
            self.insides(own);
            if self.found.overlap {
                return;
            }
        }
        let groove = |face: &&FaceRecord| face.kind == surface_kind::TORUS && !bulges(face);
        let grooves = |own: usize| self.sides[own].shape.faces.iter().any(|face| groove(&face));
        if grooves(0) && grooves(1) {
            // Two grooves that cross can be nearest inside both, which is not searched.
            self.note(0.0);
        }
    }

    /// Sharp edges of one side against those of the other, or against its faces.
    fn edges(&mut self, own: usize, against_edges: bool) {
        let shape = self.sides[own].shape;
        let other = self.sides[1 - own].shape;
        let mut index = 0;
        while let Some(node) = shape.edge_nodes.get(index) {
            let center = self.sides[own].to_other(wide(node.center));
            if locate(other, center).least - f64::from(node.radius) - PIECE_M > self.found.upper {
                index = node.skip as usize;
                continue;
            }
            index += 1;
            if node.skip as usize != index {
                continue;
            }
            for edge in node.points(shape.edges) {
                self.edge(own, edge, against_edges);
                if self.found.overlap {
                    return;
                }
            }
        }
    }

    /// One piece of an edge.
    fn edge(&mut self, own: usize, edge: &EdgeRecord, against_edges: bool) {
        self.left -= 1;
        let other = self.sides[1 - own].shape;
        let center = self.sides[own].to_other(wide(edge.center));
        let reach = f64::from(edge.radius) + PIECE_M;
        let least = locate(other, center).least;
        if least - reach > self.found.upper {
            return;
        }
        if least < -PIECE_M {
            self.inside(least + PIECE_M);
            return;
        }
        if self.left < 0 {
            self.note(least - reach);
            return;
        }
        let curves = exact_curve(self.sides[own].shape, edge);
        for curve in &curves {
            let curve = self.sides[own].placed(curve);
            if against_edges {
                self.curve_against_edges(1 - own, &curve, (center, reach));
            } else {
                self.faces(own, &curve, (center, reach));
            }
        }
    }

    /// A curve within a sphere against all faces of the other side.
    fn faces(&mut self, own: usize, curve: &Curve, (center, reach): (DVec3, f64)) {
        let other = self.sides[1 - own].shape;
        self.left -= (other.faces.len() / FACES_AN_EVALUATION) as i64;
        for face in other.faces {
            let distance = face_distance(face, center).unwrap_or(0.0);
            if distance - reach <= self.found.upper && distance + reach >= 0.0 {
                self.search(Against { own, face }, curve);
                if self.found.overlap {
                    return;
                }
            }
        }
    }

    /// Apexes and insides of the bulging faces of one side.
    fn insides(&mut self, own: usize) {
        let shape = self.sides[own].shape;
        let other = self.sides[1 - own].shape;
        for face in shape.faces.iter().filter(|face| bulges(face)) {
            if face.kind == surface_kind::CONE {
                let tip = apex(face);
                if locate(shape, tip).least.abs() <= self.on[own] {
                    let tip = self.sides[own].placed(&Curve::point(tip, 0.0));
                    let sphere = (tip.center, 0.0);
                    self.faces(own, &tip, sphere);
                    self.curve_against_edges(1 - own, &tip, sphere);
                }
            }
            let Some(spine) = spine(shape, face) else {
                continue;
            };
            let spine = self.sides[own].placed(&spine);
            for against in other.faces {
                // Along its generators a ruled face is nearest at an end, unless the other face bulges along them.
                let twice = own == 1 && face.kind == against.kind;
                let inside = match face.kind {
                    surface_kind::SPHERE | surface_kind::TORUS => true,
                    _ => match against.kind {
                        surface_kind::TORUS => !bulges(against),
                        surface_kind::CONE => bulges(against) && !twice,
                        surface_kind::CYLINDER => {
                            face.kind == surface_kind::CYLINDER && bulges(against) && !twice
                        }
                        _ => false,
                    },
                };
                if inside {
                    self.search(Against { own, face: against }, &spine);
                }
                if self.found.overlap {
                    return;
                }
            }
        }
    }

    /// One curve against one face.
    fn search(&mut self, at: Against<'_>, curve: &Curve) {
        let [own, other] = [at.own, 1 - at.own].map(|i| self.sides[i].shape);
        let [own_on, other_on] = [at.own, 1 - at.own].map(|i| self.on[i]);
        let cell = f64::from(other.field.record().cell);
        let speed = curve.most()[0];
        let mut stack: heapless::Vec<(f64, f64), DEPTH> = heapless::Vec::new();
        let _ = stack.push((0.0, 1.0));
        while let Some((t, h)) = stack.pop() {
            self.left -= 1;
            let p = curve.at(t);
            let reach = speed * h + curve.error;
            let radius = curve.radius + curve.taper * t;
            let distance = face_distance(at.face, p).unwrap_or(0.0);
            let taper = curve.taper.abs() * h;
            let conforming = least_conforming(at.face, curve, (t, h)) - radius - taper - curve.error;
            let Some(here) = FaceDistance::at(at.face, p) else {
                let lower = conforming.max(distance - reach - radius - taper);
                if lower >= self.found.upper - CLOSE_M {
                    self.note(lower);
                } else if distance + reach + taper >= radius {
                    self.split(&mut stack, (t, h), reach, lower);
                }
                continue;
            };
            let (lower, best) = least(&here, curve, (t, h));
            let lower = lower.max(conforming);
            if lower >= self.found.upper - CLOSE_M - 2.0 * curve.error {
                self.note(lower);
                continue;
            }
            let bend = here.bend_within(reach);
            let normal = here.normal;
            let at_foot = foot(other, p - normal * distance, normal, other_on);
            // Off the part by more than feet move along the curve.
            if at_foot.off > reach * (1.0 + (distance.abs() + reach) * bend) + other_on {
                continue;
            }
            if self.feet_before_a_plane(at, curve, (t, h), &here, bend) {
                continue;
            }
            let (mut sure, mut on) = (at_foot.sure, at_foot.on);
            if radius > 0.0 {
                let side = &self.sides[at.own];
                let own_foot = foot(
                    own,
                    side.bring_back(p - normal * radius),
                    -(side.rotation.transpose() * normal),
                    own_on,
                );
                if own_foot.off > reach * (1.0 + radius * bend) + taper + own_on {
                    continue;
                }
                sure &= own_foot.sure;
                on &= own_foot.on;
            }
            if sure && on {
                self.candidate(at, curve, t);
                self.candidate(at, curve, best);
                if self.found.overlap {
                    return;
                }
            }
            // Behind the face no pair is nearest.
            if distance + reach + taper < radius - other_on {
                continue;
            }
            let close = lower >= self.found.upper - CLOSE_M - 2.0 * curve.error;
            if close || !sure && reach < SHORT_CELLS * cell {
                self.note(lower);
            } else {
                self.split(&mut stack, (t, h), reach, lower);
            }
        }
    }

    /// Whether all feet of the part t ± h of a curve lie before a plane that the whole other part is behind.
    fn feet_before_a_plane(
        &self,
        at: Against<'_>,
        curve: &Curve,
        (t, h): (f64, f64),
        here: &FaceDistance,
        bend: f64,
    ) -> bool {
        let other = self.sides[1 - at.own].shape;
        let p = curve.at(t);
        let reach = curve.most()[0] * h + curve.error;
        let mut left = self.supporting[1 - at.own];
        while let Some(plane) = other.faces.get(left.trailing_zeros() as usize) {
            left &= left - 1;
            let normal = wide(plane.axis) * f64::from(plane.sense);
            let height = (p - wide(plane.origin)).dot(normal) - curve.speed_along(normal) * h - curve.error;
            // From the curve to its foot along a normal that turns by at most the curvature times the way.
            let turned = (normal.dot(here.normal).abs() + bend * reach).min(1.0);
            if height - (here.distance.abs() + reach) * turned > self.on[1 - at.own] {
                return true;
            }
        }
        false
    }

    /// The point of the own surface at t of a curve, and its foot on a face, if both are proven to belong to the parts.
    fn candidate(&mut self, at: Against<'_>, curve: &Curve, t: f64) {
        let p = curve.at(t);
        let radius = curve.radius + curve.taper * t;
        let Some(here) = FaceDistance::at(at.face, p) else {
            return;
        };
        let normal = here.normal;
        let q = p - normal * here.distance;
        let p = p - normal * radius;
        let [own, other] = [at.own, 1 - at.own];
        let own_p = self.sides[own].bring_back(p);
        let own_normal = -(self.sides[own].rotation.transpose() * normal);
        let shapes = [own, other].map(|side| self.sides[side].shape);
        if !foot(shapes[1], q, normal, self.on[other]).on
            || radius > 0.0 && !foot(shapes[0], own_p, own_normal, self.on[own]).on
        {
            return;
        }
        let into = 10.0 * ON_SURFACE_M + curve.error;
        let depth = locate(shapes[1], p).least;
        let depth_of_foot = locate(shapes[0], self.sides[own].bring_back(q)).least;
        if depth < -(self.on[other] + into) || depth_of_foot < -(self.on[own] + into) {
            self.inside(depth.min(depth_of_foot) + curve.error);
            return;
        }
        let distance = here.distance - radius;
        if distance < 0.0 {
            return;
        }
        self.offer(distance + curve.error, own, [p, q]);
    }

    /// Takes two points of the surfaces, the first of side `own`, in the frame of the other side, if they are the nearest.
    fn offer(&mut self, distance: f64, own: usize, [p, q]: [DVec3; 2]) {
        if distance < self.found.upper {
            self.found.upper = distance;
            self.found.nearest = if own == 0 {
                [p, q]
            } else {
                // The frame is the first side's: back to the second's.
                [q, p].map(|x| self.sides[1].bring_back(x))
            };
        }
    }

    /// A point of one part has this distance, or a lower one, from the other.
    fn inside(&mut self, distance: f64) {
        self.found.overlap = true;
        self.found.deepest = self.found.deepest.min(distance);
    }

    fn note(&mut self, lower: f64) {
        if lower < self.found.lower {
            if lower <= 0.0 && self.found.lower > 0.0 {
                // Nothing will be proven: what is left is to find near points.
                self.left = self.left.min(UNPROVEN);
            }
            self.found.lower = lower;
        }
    }

    /// Halves a part of a curve, the half at which the distance falls on top; or notes its bound when it is short or the budget is used up.
    fn split(
        &mut self,
        stack: &mut heapless::Vec<(f64, f64), DEPTH>,
        (t, h): (f64, f64),
        reach: f64,
        lower: f64,
    ) {
        let halves = [(t - 0.5 * h, 0.5 * h), (t + 0.5 * h, 0.5 * h)];
        if self.left < 0 || reach < SHORT_M || stack.len() + 2 > DEPTH {
            self.note(lower);
            return;
        }
        for half in halves {
            let _ = stack.push(half);
        }
    }

    /// A curve within a sphere, in the frame of side `of`, against its edges.
    fn curve_against_edges(&mut self, of: usize, curve: &Curve, (center, reach): (DVec3, f64)) {
        let shape = self.sides[of].shape;
        let apart =
            |c: [f32; 3], radius: f32| (center - wide(c)).length() - reach - f64::from(radius) - PIECE_M;
        let mut index = 0;
        while let Some(node) = shape.edge_nodes.get(index) {
            if apart(node.center, node.radius) > self.found.upper {
                index = node.skip as usize;
                continue;
            }
            index += 1;
            if node.skip as usize != index {
                continue;
            }
            for edge in node.points(shape.edges) {
                let apart = apart(edge.center, edge.radius);
                if apart > self.found.upper {
                    continue;
                }
                self.left -= 1;
                if self.left < 0 {
                    self.note(apart);
                    continue;
                }
                for other in &exact_curve(shape, edge) {
                    self.curves(1 - of, [(curve, 0.0, 1.0), (other, 0.0, 1.0)], DEPTH);
                }
            }
        }
    }

    /// Two parts of curves, the first of side `own`: the distance of their chords less the bulges; the more bulging one is halved.
    fn curves(&mut self, own: usize, [a, b]: [(&Curve, f64, f64); 2], depth: usize) {
        self.left -= 1;
        let chord = |(curve, t, h): (&Curve, f64, f64)| [curve.at(t - h), curve.at(t + h)];
        let ([p, q], [r, s]) = (chord(a), chord(b));
        let [along, beside] = nearest_of_segments([p, q], [r, s]);
        let apart = ((p + (q - p) * along) - (r + (s - r) * beside)).length();
        let error = a.0.error + b.0.error;
        let [bulge_a, bulge_b] = [a, b].map(|(curve, _, h)| curve.bulge(h));
        let lower = (apart - bulge_a - bulge_b)
            .max(least_to_circle(b.0, a.0, (a.1, a.2)))
            .max(least_to_circle(a.0, b.0, (b.1, b.2)))
            - error;
        if lower >= self.found.upper - CLOSE_M - 2.0 * error {
            self.note(lower);
            return;
        }
        let [t, u] = [(a, along), (b, beside)].map(|((_, t, h), share)| t + h * (2.0 * share - 1.0));
        let [x, y] = [a.0.at(t), b.0.at(u)];
        self.offer((x - y).length() + error, own, [x, y]);
        if lower >= self.found.upper - CLOSE_M - 2.0 * error || depth == 0 || self.left < 0 {
            self.note(lower);
            return;
        }
        let part = |(curve, t, h), k: f64| (curve, t + 0.5 * k * h, 0.5 * h);
        for k in [-1.0, 1.0] {
            let halves = if bulge_a >= bulge_b {
                [part(a, k), b]
            } else {
                [a, part(b, k)]
            };
            self.curves(own, halves, depth - 1);
        }
    }
}

/// Lower bound of the distance of the part t ± h of a curve from a face, less the curve's radius, to second order less a bound of the third; and where the
/// second order has its least value. `here` is the face's distance at t.
fn least(here: &FaceDistance, curve: &Curve, (t, h): (f64, f64)) -> (f64, f64) {
    let radius = curve.radius + curve.taper * t;
    let [most_first, most_second, most_third] = curve.most();
    let (reach, turn, twist) = (most_first * h, most_second * h * h, most_third * h * h * h);
    let plain = here.distance - radius - reach - curve.taper.abs() * h;
    let bend = here.bend_within(reach);
    let (first, second) = curve.derivatives(t);
    let slope = (here.normal.dot(first) - curve.taper) * h;
    let downhill = if slope > 0.0 { -1.0 } else { 1.0 };
    if bend.is_infinite() {
        return (plain - curve.error, t + downhill * h);
    }
    let curving = (here.second_along(first) + here.normal.dot(second)) * h * h;
    let (least, best) = if curving > slope.abs() {
        (-0.5 * slope * slope / curving, -slope / curving)
    } else {
        (0.5 * curving - slope.abs(), downhill)
    };
    let third = THIRD * bend * bend * reach * reach * reach + 3.0 * bend * reach * turn + twist;
    let bound = here.distance - radius + least - third / 6.0;
    (bound.max(plain) - curve.error, t + best * h)
}

impl Clearance {
    /// The same as a separation of `held` at `pose` from `other`, where the parts were shown to be apart.
    pub fn separation(&self, pose: &Pose, held: &Shape<'_>, other: &Shape<'_>) -> Option<Separation> {
        let lower = self.lower.min(self.upper);
        let fixed =
            rounding(held, pose) + rounding(other, &Pose::IDENTITY) + on_surface(held).max(on_surface(other));
        if self.overlap || lower <= fixed || self.upper.is_infinite() {
            return None;
        }
        let [a, b] = self.nearest;
        Some(Separation {
            distance: self.upper,
            error: self.upper - lower + fixed,
            normal: (a - b).normalize_or_zero(),
            a,
            measure: Measure::DeepestPoint,
        })
    }
}
