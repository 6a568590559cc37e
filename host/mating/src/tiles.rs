//! Division of a face into convex tiles that cover it exactly, up to an error bound.
//!
//! The triangles of the tessellation cover a plane face between straight edges, and the unrolled face of a cylinder, cone
//! or sphere. Where a plane's edge is an arc, the cap between chord and arc is added (the arc bulges out of the face) or
//! subtracted (a hole). What remains is the error on edges that are neither lines nor arcs, estimated from their curvature.

use std::collections::HashMap;
use std::ops::Range;

use glam::DVec3;
use mortise_brep::{Curve, Frame, Shape, Surface};

/// Corners of an arc's polygon in the coarse tiling; its error is 1/256 of the chord's.
const CAP_STEPS: f64 = 16.0;
/// Largest distance between an arc and its polygon in the fine tiling, mm.
const FINE_MM: f64 = 2e-6;
/// Largest number of corners of one cap.
const MOST_STEPS: f64 = 4096.0;

/// A convex tile: the range of its corners in [`Tiles::corners`], and its sign, +1 or −1.
pub(crate) type Tile = (Range<usize>, f64);

/// Tiles of one face, in the shape's frame.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tiles {
    pub corners: Vec<DVec3>,
    pub tiles: Vec<Tile>,
}

impl Tiles {
    fn push(&mut self, corners: impl IntoIterator<Item = DVec3>, sign: f64) {
        let start = self.corners.len();
        self.corners.extend(corners);
        self.tiles.push((start..self.corners.len(), sign));
    }

    /// Adds the tiles of `more`.
    pub fn append(&mut self, more: Self) {
        for (range, sign) in more.tiles {
            self.push(more.corners[range].iter().copied(), sign);
        }
    }
}

/// A boundary edge that the tiles follow only approximately; its error is an area, length × largest distance.
#[derive(Clone, Copy, Debug)]
struct Soft {
    ends: [DVec3; 2],
    error_mm2: f64,
    /// For an arc: the error of the fine tiling.
    fine_mm2: f64,
}

/// The tiling of one face with its error bounds.
#[derive(Clone, Debug)]
pub(crate) struct FaceTiles {
    pub coarse: Tiles,
    /// Box of the exact face.
    pub low: DVec3,
    pub high: DVec3,
    soft: Vec<Soft>,
}

impl FaceTiles {
    /// Bound on the area error of the tiles within a box: of the coarse and of the fine tiling.
    pub fn slack(&self, low: DVec3, high: DVec3) -> (f64, f64) {
        let inside = |s: &&Soft| {
            s.ends[0].min(s.ends[1]).cmple(high).all() && s.ends[0].max(s.ends[1]).cmpge(low).all()
        };
        let add = |(a, b): (f64, f64), s: &Soft| (a + s.error_mm2, b + s.fine_mm2);
        self.soft.iter().filter(inside).fold((0.0, 0.0), add)
    }
}

/// Tilings of all faces of a shape.
pub(crate) struct ShapeTiles<'a> {
    shape: &'a Shape,
    triangles: Vec<Vec<u32>>,
    /// Edge of each mesh segment, keyed by its two vertices, smaller first.
    segments: HashMap<(u32, u32), Vec<u32>>,
}

impl<'a> ShapeTiles<'a> {
    pub fn new(shape: &'a Shape) -> Self {
        let mut triangles = vec![Vec::new(); shape.faces.len()];
        for (i, &face) in shape.mesh.triangle_face.iter().enumerate() {
            triangles[face as usize].push(i as u32);
        }
        // The points of an edge are bitwise copies of mesh vertices.
        let key = |v: DVec3| v.to_array().map(f64::to_bits);
        let vertex: HashMap<[u64; 3], u32> = (shape.mesh.vertices.iter().enumerate())
            .map(|(i, &v)| (key(v), i as u32))
            .collect();
        let mut segments: HashMap<(u32, u32), Vec<u32>> = HashMap::new();
        for (id, edge) in shape.edges.iter().enumerate() {
            for pair in edge.polyline.windows(2) {
                if let (Some(&a), Some(&b)) = (vertex.get(&key(pair[0])), vertex.get(&key(pair[1]))) {
                    segments.entry((a.min(b), a.max(b))).or_default().push(id as u32);
                }
            }
        }
        Self {
            shape,
            triangles,
            segments,
        }
    }

    /// Tiling of one face.
    pub fn face(&self, face: u32) -> FaceTiles {
        let coarse = self.tiles(face, |_, _| CAP_STEPS);
        let surface = &self.shape.faces[face as usize].surface;
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for &c in &coarse.corners {
            low = low.min(c);
            high = high.max(c);
        }
        let soft = self.soft(face);
        // Extent of the exact face beyond its tiles: sideways at approximated edges, outward over chords of its surface.
        let edge = soft
            .iter()
            .map(|s| s.error_mm2 / s.ends[0].distance(s.ends[1]).max(1e-12))
            .fold(0.0, f64::max);
        let chord = coarse
            .tiles
            .iter()
            .flat_map(|(range, _)| middles(&coarse.corners[range.clone()]));
        let chord = chord
            .filter_map(|p| surface.distance(p))
            .map(|(d, _)| d.abs())
            .fold(0.0, f64::max);
        let reach = DVec3::splat(edge + 2.0 * chord);
        FaceTiles {
            coarse,
            low: low - reach,
            high: high + reach,
            soft,
        }
    }

    /// Tiling of one face with arcs followed to [`FINE_MM`].
    pub fn fine(&self, face: u32) -> Tiles {
        self.tiles(face, fine_steps)
    }

    fn tiles(&self, face: u32, steps: impl Fn(f64, f64) -> f64) -> Tiles {
        let mut tiles = Tiles::default();
        let out = match &self.shape.faces[face as usize] {
            f if f.reversed => -1.0,
            _ => 1.0,
        };
        let plane = match self.shape.faces[face as usize].surface {
            Surface::Plane { frame } => Some(frame.z * out),
            _ => None,
        };
        for &t in &self.triangles[face as usize] {
            let ids = self.shape.mesh.triangles[t as usize];
            let corners = ids.map(|v| self.shape.mesh.vertices[v as usize]);
            tiles.push(corners, 1.0);
            let Some(normal) = plane else { continue };
            for k in 0..3 {
                let Some((frame, radius)) = self.arc(face, ids[k], ids[(k + 1) % 3]) else {
                    continue;
                };
                let (a, b) = (corners[k], corners[(k + 1) % 3]);
                let Some(points) = arc_points(a, b, &frame, radius, &steps) else {
                    continue;
                };
                // The face lies to the left of a → b.
                let bulge = (b - a).cross(points[points.len() / 2] - a).dot(normal);
                tiles.push(points, if bulge < 0.0 { 1.0 } else { -1.0 });
            }
        }
        tiles
    }

    /// The circle of which a triangle side of `face` is a chord, if any.
    fn arc(&self, face: u32, a: u32, b: u32) -> Option<(Frame, f64)> {
        let edges = self.segments.get(&(a.min(b), a.max(b)))?;
        edges
            .iter()
            .map(|&e| &self.shape.edges[e as usize])
            .find_map(|e| match e.curve {
                Curve::Circle { frame, radius } if e.faces.contains(&face) => Some((frame, radius)),
                _ => None,
            })
    }

    fn soft(&self, face: u32) -> Vec<Soft> {
        let of = &self.shape.faces[face as usize];
        let mut soft = Vec::new();
        for edge in of.edges.iter().map(|&e| &self.shape.edges[e as usize]) {
            match (&of.surface, &edge.curve) {
                // Edges that are straight in the plane or on the unrolled cylinder or cone; a circle around the axis is
                // straight there.
                (
                    Surface::Plane { .. } | Surface::Cylinder { .. } | Surface::Cone { .. },
                    Curve::Line { .. },
                )
                | (Surface::Cylinder { .. } | Surface::Cone { .. }, Curve::Circle { .. }) => {}
                (Surface::Plane { .. }, &Curve::Circle { radius, .. }) => {
                    for pair in edge.polyline.windows(2) {
                        let length = pair[0].distance(pair[1]);
                        let angle = 2.0 * (length / (2.0 * radius)).min(1.0).asin();
                        let error = |steps: f64| length * radius * (angle / steps).powi(2) / 8.0;
                        soft.push(Soft {
                            ends: [pair[0], pair[1]],
                            error_mm2: error(CAP_STEPS),
                            fine_mm2: error(fine_steps(radius, angle)),
                        });
                    }
                }
                _ => soft.extend(turning(&edge.polyline, &of.surface)),
            }
        }
        soft
    }
}

fn fine_steps(radius: f64, angle: f64) -> f64 {
    (angle * (radius / (8.0 * FINE_MM)).sqrt())
        .ceil()
        .clamp(CAP_STEPS, MOST_STEPS)
}

/// The arc from `a` to `b`, less than half a turn, end points included.
fn arc_points(
    a: DVec3,
    b: DVec3,
    frame: &Frame,
    radius: f64,
    steps: &impl Fn(f64, f64) -> f64,
) -> Option<Vec<DVec3>> {
    let (u, v) = (
        (a - frame.origin).try_normalize()?,
        (b - frame.origin).try_normalize()?,
    );
    let angle = u.cross(v).length().atan2(u.dot(v));
    let side = (v - u * u.dot(v)).try_normalize()?;
    let n = steps(radius, angle).max(2.0) as usize;
    let inner = (1..n).map(|i| {
        let (sin, cos) = (angle * i as f64 / n as f64).sin_cos();
        frame.origin + (u * cos + side * sin) * radius
    });
    Some(std::iter::once(a).chain(inner).chain([b]).collect())
}

/// Errors of the segments of a curve that is neither line nor circle: a segment of length l whose direction turns by θ
/// within the surface deviates by about lθ/8.
fn turning(points: &[DVec3], surface: &Surface) -> Vec<Soft> {
    let turn = |i: usize| -> f64 {
        let (Some(p), Some(q)) = (i.checked_sub(1).and_then(|j| points.get(j)), points.get(i + 1)) else {
            return 0.0;
        };
        let Some((_, normal)) = surface.distance(points[i]) else {
            return 0.0;
        };
        let (u, v) = (
            (points[i] - *p).reject_from_normalized(normal),
            (*q - points[i]).reject_from_normalized(normal),
        );
        u.cross(v).length().atan2(u.dot(v))
    };
    let turns: Vec<f64> = (0..points.len()).map(turn).collect();
    let soft = |(i, pair): (usize, &[DVec3])| {
        let error = pair[0].distance_squared(pair[1]) * turns[i].max(turns[i + 1]) / 8.0;
        Soft {
            ends: [pair[0], pair[1]],
            error_mm2: error,
            fine_mm2: error,
        }
    };
    points.windows(2).enumerate().map(soft).collect()
}

/// Midpoints of the sides, and of the whole.
fn middles(corners: &[DVec3]) -> Vec<DVec3> {
    let n = corners.len();
    let sides = (0..n).map(|i| (corners[i] + corners[(i + 1) % n]) / 2.0);
    sides.chain([corners.iter().sum::<DVec3>() / n as f64]).collect()
}
