//! The area inside closed loops, as triangles.
//!
//! A constrained Delaunay triangulation (library `spade`) of all loops together, of which the triangles stay that the loops wind around: loops run
//! counter-clockwise around material, and clockwise around holes. Sides that two loops run in opposite directions cancel; sides that cross, as facets of nearly
//! coincident surfaces can, are divided where they cross. Cost: n log n for n points.

use std::collections::{HashMap, VecDeque};

use glam::DVec2;
use spade::handles::FixedVertexHandle;
use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation as _};

/// Triangles that cover the area inside loops, counter-clockwise, in the plane's coordinates, mm.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cap {
    /// Corners: the distinct points of the loops, then those where sides cross.
    pub points: Vec<DVec2>,
    /// Triangles: indices into `points`.
    pub triangles: Vec<[u32; 3]>,
}

impl Cap {
    /// Area of the triangles, mm².
    pub fn area(&self) -> f64 {
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| self.points[i as usize]);
            (b - a).perp_dot(c - a) / 2.0
        };
        self.triangles.iter().map(area).sum()
    }
}

/// Coordinates closer to zero than this are zero, mm: the library takes none that are smaller than its own limit, 1.8·10⁻⁴³.
const ZERO_MM: f64 = 1e-30;

/// The area that `loops` wind around.
pub fn cap(loops: &[Vec<DVec2>]) -> Cap {
    let mut outline = Outline::new(loops);
    for round in 0..=ROUNDS {
        if outline.points.len() < 3 {
            break;
        }
        let points = outline.points.iter().map(|p| Point2::new(p.x, p.y)).collect();
        let mut crossing = Vec::new();
        let made = ConstrainedDelaunayTriangulation::<Point2<f64>>::try_bulk_load_cdt(
            points,
            outline.sides(),
            |e| {
                crossing.push(e.map(|i| i as u32));
            },
        );
        let Ok(mesh) = made else { break };
        // After the last round a side that still crosses another, by rounding, is left out.
        if crossing.is_empty() || round == ROUNDS || !outline.divide(&crossing) {
            return inside(&mesh, &outline);
        }
    }
    Cap::default()
}

/// Most rounds in which crossing sides are divided: the pieces can cross others, by rounding.
const ROUNDS: usize = 4;

/// Distinct points of loops, and for each side how often it is run: forth less back.
struct Outline {
    points: Vec<DVec2>,
    net: HashMap<[u32; 2], i32>,
}

impl Outline {
    fn new(loops: &[Vec<DVec2>]) -> Self {
        let mut known: HashMap<[u64; 2], u32> = HashMap::new();
        let mut points = Vec::new();
        let mut net: HashMap<[u32; 2], i32> = HashMap::new();
        for points_of_loop in loops {
            let indices: Vec<u32> = points_of_loop
                .iter()
                .map(|p| {
                    let p = DVec2::from_array(p.to_array().map(|x| if x.abs() < ZERO_MM { 0.0 } else { x }));
                    *known.entry(p.to_array().map(f64::to_bits)).or_insert_with(|| {
                        points.push(p);
                        points.len() as u32 - 1
                    })
                })
                .collect();
            for (i, &from) in indices.iter().enumerate() {
                let to = indices[(i + 1) % indices.len()];
                if from != to {
                    let sign = if from < to { 1 } else { -1 };
                    *net.entry([from.min(to), from.max(to)]).or_default() += sign;
                }
            }
        }
        net.retain(|_, n| *n != 0);
        Self { points, net }
    }

    /// Sides in order, so that the result does not depend on the order of a map.
    fn sides(&self) -> Vec<[usize; 2]> {
        let mut sides: Vec<[usize; 2]> = self.net.keys().map(|k| k.map(|i| i as usize)).collect();
        sides.sort_unstable();
        sides
    }

    /// Divides the sides `crossing` and those that they cross where they do; false when nothing was divided.
    fn divide(&mut self, crossing: &[[u32; 2]]) -> bool {
        let sides = self.sides();
        let at = |i: usize| self.points[i];
        let mut cuts: HashMap<[usize; 2], Vec<DVec2>> = HashMap::new();
        for &[a, b] in crossing {
            let one = [a.min(b) as usize, a.max(b) as usize];
            for &other in &sides {
                if other != one
                    && let Some(p) = intersection(one.map(at), other.map(at))
                {
                    cuts.entry(one).or_default().push(p);
                    cuts.entry(other).or_default().push(p);
                }
            }
        }
        let mut known: HashMap<[u64; 2], u32> = self
            .points
            .iter()
            .enumerate()
            .map(|(i, p)| (p.to_array().map(f64::to_bits), i as u32))
            .collect();
        let mut cuts: Vec<_> = cuts.into_iter().collect();
        cuts.sort_unstable_by_key(|(side, _)| *side);
        for (side, mut points) in cuts.iter().cloned() {
            let [from, to] = side.map(|i| self.points[i]);
            points.sort_by(|p, q| p.distance_squared(from).total_cmp(&q.distance_squared(from)));
            let net = self.net.remove(&side.map(|i| i as u32)).unwrap_or(0);
            let mut last = side[0] as u32;
            for p in points.into_iter().chain([to]) {
                let next = *known.entry(p.to_array().map(f64::to_bits)).or_insert_with(|| {
                    self.points.push(p);
                    self.points.len() as u32 - 1
                });
                if next != last {
                    let sign = if last < next { net } else { -net };
                    *self.net.entry([last.min(next), last.max(next)]).or_default() += sign;
                }
                last = next;
            }
        }
        self.net.retain(|_, n| *n != 0);
        !cuts.is_empty()
    }

    /// How much the winding number grows from the right of a side to its left; `None` for a part of a side that passes through a point.
    fn step(&self, from: usize, to: usize) -> Option<i32> {
        let (from, to) = (from as u32, to as u32);
        let net = *self.net.get(&[from.min(to), from.max(to)])?;
        Some(if from < to { net } else { -net })
    }

    /// Winding number around `p`, by the sides that a ray along +x crosses.
    fn winding(&self, p: DVec2) -> i32 {
        let mut winding = 0;
        for (&[a, b], &net) in &self.net {
            let [a, b] = [a, b].map(|i| self.points[i as usize]);
            let rises = a.y <= p.y && p.y < b.y;
            let falls = b.y <= p.y && p.y < a.y;
            let left = (b - a).perp_dot(p - a);
            if rises && left > 0.0 {
                winding += net;
            } else if falls && left < 0.0 {
                winding -= net;
            }
        }
        winding
    }
}

/// Where two sides cross, ends excluded.
fn intersection([a, b]: [DVec2; 2], [c, d]: [DVec2; 2]) -> Option<DVec2> {
    let (u, v) = (b - a, d - c);
    let across = u.perp_dot(v);
    let (s, t) = ((c - a).perp_dot(v) / across, (c - a).perp_dot(u) / across);
    let inner = 0.0..=1.0;
    // Not finite where they are parallel.
    if !inner.contains(&s) || !inner.contains(&t) {
        return None;
    }
    let p = a + u * s;
    // An end that lies on the other side divides it alone.
    (p != a && p != b || p != c && p != d).then_some(p)
}

/// The triangles with a positive winding number. It is constant between constraints, and changes across one as the sides tell.
fn inside(mesh: &ConstrainedDelaunayTriangulation<Point2<f64>>, outline: &Outline) -> Cap {
    let corner = |i: usize| {
        let p = mesh.vertex(FixedVertexHandle::from_index(i)).position();
        DVec2::new(p.x, p.y)
    };
    let mut winding: Vec<Option<i32>> = vec![None; mesh.num_all_faces()];
    winding[mesh.outer_face().fix().index()] = Some(0);
    let mut queue = VecDeque::new();
    // From the hull inward.
    queue.extend(mesh.convex_hull().map(|e| (e.rev().fix(), 0)));
    while let Some((edge, there)) = queue.pop_front() {
        let edge = mesh.directed_edge(edge);
        // `edge` has the known face on its right here: the convex hull's edges run clockwise, with the outer face on their left.
        let Some(face) = edge.face().as_inner() else {
            continue;
        };
        let slot = &mut winding[face.fix().index()];
        if slot.is_some() {
            continue;
        }
        let [from, to] = [edge.from(), edge.to()].map(|v| v.fix().index());
        let here = if edge.is_constraint_edge() {
            outline.step(from, to).map(|step| there + step)
        } else {
            Some(there)
        };
        let here = here.unwrap_or_else(|| {
            let c = face.center();
            outline.winding(DVec2::new(c.x, c.y))
        });
        *slot = Some(here);
        queue.extend(face.adjacent_edges().iter().map(|e| (e.rev().fix(), here)));
    }
    let mut cap = Cap {
        points: (0..mesh.num_vertices()).map(corner).collect(),
        triangles: Vec::new(),
    };
    for face in mesh.inner_faces() {
        if winding[face.fix().index()].is_some_and(|w| w > 0) {
            cap.triangles
                .push(face.vertices().map(|v| v.fix().index() as u32));
        }
    }
    cap
}
