//! Features of a shape in a cell: the faces near it, and places at which a rule for its distance must prove itself.
//!
//! A rule that omits a face, or that continues a face beyond its edge, errs next to that face or edge. So every face, edge and corner that enters the
//! cell contributes places on itself and beside itself, however little of it the cell contains: a lattice alone misses a slot narrower than its step.
//! A face beyond the cell may be nearest to points in it: next to its own corners and edges, and where a thin wall or slot leaves the cell, nowhere
//! more than in its middle. Those are places too.

use glam::DVec3;
use mortise_protocol::image::{NO_FACE, Nearby};

use crate::distance::ExactSurface;
use crate::rule::SAME_MM;
use crate::topology::NONE;

/// Most places on each face, for tests and for fits, and most places along each edge and corners.
const MOST_ON_FACE: usize = 8;
const MOST_FOR_FIT: usize = 24;
const MOST_ON_EDGE: usize = 3;
const MOST_CORNERS: usize = 6;
/// Most places in the middle of walls and slots, and most on each face from which they are found.
const MOST_MIDDLES: usize = 12;
const MOST_AT_BORDER: usize = 12;
/// Most places on features beyond the cell that are tried, most of the cell's places next to them, the same where no face enters the cell, and distance of
/// the features from the cell, as a share of it. Each place costs an exact query in every cell.
const MOST_BEYOND: usize = 48;
const MOST_BESIDE_CELL: usize = 24;
const MOST_BESIDE_UNCROSSED: usize = 8;
const BEYOND_CELL: f64 = 0.5;
/// Thickness up to which a wall or slot has such places, as a share of the cell: a lattice finds thicker ones.
const THIN: f64 = 0.5;
/// Largest product of the normals of a wall's two sides.
const OPPOSITE: f64 = -0.5;
/// Distance of places beside an edge or corner from it, as a share of the cell.
const BESIDE: f64 = 0.05;

/// Faces and places of a cell.
#[derive(Default)]
pub(crate) struct CellFeatures {
    /// Faces that can hold the point nearest to some point of the cell, ascending.
    pub faces: Vec<u16>,
    /// Those of them that enter the cell, ascending.
    pub entering: Vec<u16>,
    /// Places on and beside the features in the cell, mm.
    pub places: Vec<DVec3>,
}

/// Part of a triangle in a cube.
struct FacePart {
    face: u16,
    triangle: u32,
    /// Corners of a convex polygon.
    corners: Vec<DVec3>,
}

impl FacePart {
    /// Its corners, the middles of its sides and its own: face, triangle and place.
    fn places(&self) -> impl Iterator<Item = (u16, u32, DVec3)> + '_ {
        let next = self.corners.iter().cycle().skip(1);
        let sides = self.corners.iter().zip(next).map(|(a, b)| 0.5 * (*a + *b));
        (self.corners.iter().copied())
            .chain(sides)
            .chain([mean(&self.corners)])
            .map(|p| (self.face, self.triangle, p))
    }
}

/// Places on the parts of a face: few, evenly chosen of the middles and of the corners.
fn spread_on_face(parts: &[FacePart]) -> impl Iterator<Item = DVec3> {
    let middles = parts.iter().map(|part| mean(&part.corners));
    let corners = parts.iter().flat_map(|part| part.corners.iter().copied());
    let few = MOST_ON_FACE / 2;
    spread(middles.collect(), few).chain(spread(corners.collect(), few))
}

/// Parts in a cube of the triangles within `radius` of its centre, by face; `near` receives the face and number of each such triangle.
fn parts_in(
    surface: &ExactSurface,
    cube: Cube,
    radius: f64,
    mut near: impl FnMut(u16, u32),
) -> Vec<FacePart> {
    let mut parts = Vec::new();
    let mut examined = 0;
    surface.triangles.within(cube.center, radius, |triangle, _, _| {
        examined += 1;
        let face = surface.shape.mesh.triangle_face[triangle as usize] as u16;
        near(face, triangle);
        let corners = cube.clip(surface.triangles.corners(triangle));
        if !corners.is_empty() {
            parts.push(FacePart {
                face,
                triangle,
                corners,
            });
        }
    });
    surface.work().add(examined);
    parts.sort_by_key(|part| (part.face, part.triangle));
    parts
}

/// Places on the triangles of each face that enters the cube with this centre and edge, mm: face, triangle and place.
pub(crate) fn places_on_faces(surface: &ExactSurface, center: DVec3, edge: f64) -> Vec<(u16, u32, DVec3)> {
    let cube = Cube {
        center,
        half: 0.5 * edge,
    };
    let parts = parts_in(surface, cube, 0.8661 * edge, |_, _| ());
    (parts.chunk_by(|a, b| a.face == b.face))
        .flat_map(|of_face| {
            let all: Vec<(u16, u32, DVec3)> = of_face.iter().flat_map(FacePart::places).collect();
            spread(all, MOST_FOR_FIT)
        })
        .collect()
}

/// A cube with this centre and half edge.
#[derive(Clone, Copy)]
struct Cube {
    center: DVec3,
    half: f64,
}

impl CellFeatures {
    /// Of the cube with this centre and edge, mm; `radius` bounds the distance from the centre of all surface points nearest to points of the cube.
    pub fn of(surface: &ExactSurface, center: DVec3, edge: f64, radius: f64) -> Self {
        let cube = Cube {
            center,
            half: 0.5 * edge,
        };
        let mut faces = Vec::new();
        let mut triangles = Vec::new();
        let parts = parts_in(surface, cube, radius, |face, triangle| {
            faces.push(face);
            triangles.push((face, triangle));
        });
        faces.sort_unstable();
        faces.dedup();
        faces.retain(|&face| face <= Nearby::MAX_FACES && face != NO_FACE);
        let mut pieces: Vec<u32> = (parts.iter())
            .flat_map(|part| surface.topology.triangle_pieces[part.triangle as usize])
            .filter(|&i| i != NONE)
            .collect();
        pieces.sort_unstable();
        pieces.dedup();
        let mut all = Self {
            faces,
            ..Self::default()
        };
        for of_face in parts.chunk_by(|a, b| a.face == b.face) {
            all.entering.push(of_face[0].face);
            all.places.extend(spread_on_face(of_face));
        }
        all.add_edges(surface, cube, &pieces);
        all.places.extend(middles(surface, cube, &parts));
        triangles.retain(|(face, _)| all.entering.binary_search(face).is_err());
        let most = if all.entering.is_empty() {
            MOST_BESIDE_UNCROSSED
        } else {
            MOST_BESIDE_CELL
        };
        all.places.extend(beside_cell(surface, cube, triangles, most));
        all
    }

    /// Places at and beside boundary pieces and their corners.
    fn add_edges(&mut self, surface: &ExactSurface, cube: Cube, pieces: &[u32]) {
        let topology = &surface.topology;
        let step = 2.0 * cube.half * BESIDE;
        let mut along: Vec<(Option<u32>, u32, DVec3)> = Vec::new();
        let mut corners: Vec<DVec3> = Vec::new();
        for &i in pieces {
            let piece = &topology.pieces[i as usize];
            let [a, b] = piece.points;
            if let Some([from, to]) = cube.span(a, b) {
                let middle = piece.nearest(a + (b - a) * (0.5 * (from + to))).point;
                along.push((piece.edge, i, middle));
            }
            for (end, vertex) in piece.points.into_iter().zip(piece.ends) {
                let meeting = topology.vertex_pieces.get(&vertex).map_or(0, Vec::len);
                if meeting > 2 && cube.holds(end) && !corners.contains(&end) {
                    corners.push(end);
                }
            }
        }
        along.sort_by_key(|(edge, i, _)| (*edge, *i));
        let mut add = |p: DVec3| {
            if cube.holds(p) {
                self.places.push(p);
            }
        };
        for of_edge in along.chunk_by(|a, b| a.0 == b.0) {
            let few: Vec<(u32, DVec3)> = of_edge.iter().map(|&(_, i, middle)| (i, middle)).collect();
            for (i, middle) in spread(few, MOST_ON_EDGE) {
                let piece = &topology.pieces[i as usize];
                let tangent = piece.tangent(middle);
                add(middle);
                for side in &piece.sides {
                    let normal = topology.outward(&surface.shape, side.triangle, middle);
                    let inward = normal.cross(tangent * if side.forward { 1.0 } else { -1.0 });
                    for beside in [inward, -inward, normal] {
                        add(middle + beside * step);
                    }
                }
            }
        }
        for corner in spread(corners, MOST_CORNERS) {
            add(corner);
            for i in 0..8 {
                let way = DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2)) * 2.0 - 1.0;
                add(corner + way * (0.7 * step));
            }
        }
    }
}

/// Places in the middle of the thin walls and slots between `parts`, where those leave the cube and a third face is nearer than both.
fn middles(surface: &ExactSurface, cube: Cube, parts: &[FacePart]) -> Vec<DVec3> {
    let normal = |part: &FacePart| {
        let [a, b, c] = surface.triangles.corners(part.triangle);
        (b - a).cross(c - a).normalize_or_zero()
    };
    let mut found = Vec::new();
    for of_face in parts.chunk_by(|a, b| a.face == b.face) {
        let places = of_face.iter().flat_map(|part| {
            let own = normal(part);
            (part.places()).map(move |(face, _, p)| (face, p, own))
        });
        let at_border = places.filter(|(_, p, _)| cube.is_border(*p)).collect();
        for (face, p, own) in spread(at_border, MOST_AT_BORDER) {
            let across = parts.iter().filter(|part| part.face >= face).filter_map(|part| {
                let other = normal(part);
                let half_way = 0.5 * other * other.dot(part.corners[0] - p);
                let is_wall = own.dot(other) < OPPOSITE
                    && half_way.length() < THIN * cube.half
                    && cube.holds(p + half_way);
                is_wall.then_some((half_way, part.face))
            });
            let thinnest = across.min_by(|a, b| a.0.length().total_cmp(&b.0.length()));
            let Some((half_way, other)) = thinnest else {
                continue;
            };
            let middle = p + half_way;
            let mut has_third = false;
            (surface.triangles).within(middle, half_way.length() - SAME_MM, |triangle, _, _| {
                let third = surface.shape.mesh.triangle_face[triangle as usize] as u16;
                has_third |= third != face && third != other;
            });
            if has_third {
                found.push(middle);
            }
        }
    }
    spread(found, MOST_MIDDLES).collect()
}

/// Places on the cube's border, at most `most`, whose nearest points are on parts of `triangles`, which are beyond it.
fn beside_cell(
    surface: &ExactSurface,
    cube: Cube,
    mut triangles: Vec<(u16, u32)>,
    most: usize,
) -> Vec<DVec3> {
    triangles.sort_unstable();
    let about = Cube {
        half: cube.half * (1.0 + 2.0 * BEYOND_CELL),
        ..cube
    };
    let parts = triangles.iter().map(|&(face, triangle)| FacePart {
        face,
        triangle,
        corners: about.clip(surface.triangles.corners(triangle)),
    });
    let mut beyond: Vec<DVec3> = Vec::new();
    for part in parts.filter(|part| !part.corners.is_empty()) {
        beyond.extend(part.places().map(|(_, _, p)| p));
    }
    let is_nearest = |at: DVec3, p: DVec3| {
        let mut nearer = false;
        let radius = at.distance(p) - SAME_MM;
        (surface.triangles).within(at, radius, |_, _, _| nearer = true);
        !nearer
    };
    let found = (spread(beyond, MOST_BEYOND))
        .map(|p| (p.clamp(cube.center - cube.half, cube.center + cube.half), p))
        .filter(|&(at, p)| is_nearest(at, p))
        .map(|(at, _)| at)
        .collect();
    spread(found, most).collect()
}

fn mean(points: &[DVec3]) -> DVec3 {
    points.iter().sum::<DVec3>() / points.len() as f64
}

/// At most `most` of these, evenly chosen.
fn spread<T>(all: Vec<T>, most: usize) -> impl Iterator<Item = T> {
    let step = all.len().div_ceil(most).max(1);
    all.into_iter().step_by(step)
}

impl Cube {
    fn holds(self, p: DVec3) -> bool {
        (p - self.center).abs().max_element() <= self.half
    }

    /// Whether a point in the cube is on its border.
    fn is_border(self, p: DVec3) -> bool {
        (p - self.center).abs().max_element() >= self.half * (1.0 - 1e-6)
    }

    /// The part of a triangle in the cube: corners of a convex polygon.
    fn clip(self, triangle: [DVec3; 3]) -> Vec<DVec3> {
        let [low, high] =
            [DVec3::min, DVec3::max].map(|of| triangle.into_iter().reduce(of).unwrap_or(DVec3::NAN));
        let (first, last) = (self.center - self.half, self.center + self.half);
        if low.cmpgt(last).any() || high.cmplt(first).any() {
            return Vec::new();
        }
        let mut polygon = triangle.to_vec();
        for axis in 0..3 {
            for (sign, end) in [(1.0, last[axis]), (-1.0, first[axis])] {
                let beyond = |p: DVec3| sign * (p[axis] - end);
                let mut kept = Vec::with_capacity(polygon.len() + 1);
                for (i, &p) in polygon.iter().enumerate() {
                    let q = polygon[(i + 1) % polygon.len()];
                    let (dp, dq) = (beyond(p), beyond(q));
                    if dp <= 0.0 {
                        kept.push(p);
                    }
                    if dp * dq < 0.0 {
                        kept.push(p + (q - p) * (dp / (dp - dq)));
                    }
                }
                polygon = kept;
            }
        }
        polygon
    }

    /// Fractions between which a segment lies in the cube.
    fn span(self, a: DVec3, b: DVec3) -> Option<[f64; 2]> {
        let (mut from, mut to) = (0.0f64, 1.0f64);
        for axis in 0..3 {
            let (start, way) = (a[axis] - self.center[axis], b[axis] - a[axis]);
            if way == 0.0 {
                if start.abs() > self.half {
                    return None;
                }
                continue;
            }
            let ends = [(-self.half - start) / way, (self.half - start) / way];
            from = from.max(ends[0].min(ends[1]));
            to = to.min(ends[0].max(ends[1]));
        }
        (from <= to).then_some([from, to])
    }
}
