//! A shape prepared for clearance queries: its exact surface, and samples of that surface under a tree of spheres.
//!
//! Samples inside faces are as dense as a chord error of [`SAMPLE_ERROR_MM`] requires, samples along edges no farther apart than a share of the shape's
//! size. Lengths are mm, in the shape's frame. Cost: sampling is proportional to area over spacing²; a tree over n samples has 2n − 1 nodes.

use glam::{DAffine3, DVec3};
use mortise_bake::{ExactSurface, Nearest, PointshellOptions, sample_pointshell};
use mortise_brep::{Curve, Face, Frame, Shape, Surface};

use crate::kept::Kept;
use crate::motion::Motion;
use crate::work::work;

/// Chord error between neighbouring samples inside a face, mm.
pub const SAMPLE_ERROR_MM: f64 = 0.01;
/// Smallest and largest spacing of samples inside faces, mm.
const FACE_SPACING_MM: [f64; 2] = [0.8, 8.0];
/// Smallest and largest spacing of samples along edges, mm.
const EDGE_SPACING_MM: [f64; 2] = [0.25, 2.0];
/// Share of the box's diagonal that is the spacing inside faces and along edges, between these limits.
const SHARES: [f64; 2] = [1.0 / 40.0, 1.0 / 160.0];
/// Chord error and share of the diagonal that bound the spacing of the coarse samples.
const COARSE_MM: f64 = 0.03;
const COARSE_SHARE: f64 = 1.0 / 40.0;

/// Time of a query of the exact surface in visits of a sphere.
const NEAREST_WORK: u64 = 20;

/// Largest sine of the angle between what is parallel: 1e-7 mm over 100 mm; and distance from an axis of what is on it, mm.
const PARALLEL: f64 = 1e-9;
const ON_AXIS_MM: f64 = 1e-7;

/// Largest share of its speed at which a sample goes outwards and still counts as led.
const ALONG: f64 = 1e-7;

/// Distance below which the line to the nearest point has no reliable direction, mm.
const ON_SURFACE_MM: f64 = 1e-6;

/// A sample of a shape's surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Position, mm.
    pub position: DVec3,
    /// Outward unit normal inside a face; `None` on an edge or corner.
    pub normal: Option<DVec3>,
    /// Face it lies on (one of them on an edge).
    pub face: u32,
    /// What it is inside of: number of the face, or of the edge counted after the faces; `u32::MAX` elsewhere.
    inside: u32,
    /// Outward unit normals of the faces beside it, one or two; not numbers where there may be more, or one is not known.
    normals: [DVec3; 2],
    spacing: Spacing,
}

impl Sample {
    /// Whether a velocity brings it outwards of a face beside it; else it goes where the body was before.
    pub(crate) fn leads(&self, velocity: DVec3) -> bool {
        let most = ALONG * velocity.length();
        !self.normals.iter().all(|normal| normal.dot(velocity) <= most)
    }
}

/// How dense samples of a kind must be.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Spacing {
    /// As the face.
    Inside,
    /// On a straight edge.
    Line,
    /// On an edge of this radius, mm.
    Arc(f64),
    /// All are kept.
    All,
}

/// A sphere that contains a consecutive range of samples.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Node {
    pub center: DVec3,
    pub radius: f64,
    /// First child, the second follows its subtree; of a leaf the sample.
    pub first: u32,
    /// Second child; `u32::MAX` for a leaf.
    pub second: u32,
    /// Face or edge inside which all of its samples are, as [`Sample::inside`].
    pub inside: u32,
}

impl Node {
    pub fn is_leaf(&self) -> bool {
        self.second == u32::MAX
    }
}

/// A shape prepared for clearance queries.
pub struct Body {
    surface: ExactSurface,
    samples: Vec<Sample>,
    /// Tree over the samples that can be the first to meet another part.
    nodes: Vec<Node>,
    /// Tree over some of these: as dense as a chord error of [`COARSE_MM`] requires.
    coarse: Vec<Node>,
    low: DVec3,
    high: DVec3,
    kept: Kept,
}

impl Body {
    /// Prepares `shape`; `None` for a shape without triangles.
    pub fn new(shape: &Shape) -> Option<Self> {
        let surface = ExactSurface::new(shape);
        let mesh = &surface.shape().mesh;
        let used = || {
            mesh.triangles
                .iter()
                .flatten()
                .map(|&v| mesh.vertices[v as usize])
        };
        let (low, high) = used().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| {
            (low.min(p), high.max(p))
        });
        if !low.is_finite() || !high.is_finite() {
            return None;
        }
        let size = low.distance(high).max(1e-3);
        let samples = sample(&surface, size);
        let meets =
            |s: &Sample| s.normal.is_none() || surface.shape().faces.get(s.face as usize).is_none_or(bulges);
        let mut order: Vec<u32> = (0..samples.len() as u32)
            .filter(|&i| meets(&samples[i as usize]))
            .collect();
        let mut nodes = Vec::with_capacity(2 * samples.len());
        if !order.is_empty() {
            split(&samples, &mut order, &mut nodes);
        }
        let mut coarse = Vec::new();
        let mut order = thin(&surface, &samples, order, size);
        if !order.is_empty() {
            split(&samples, &mut order, &mut coarse);
        }
        let chord = surface.chord_error_mm();
        Some(Self {
            coarse,
            low: low - chord,
            high: high + chord,
            kept: Kept::new(&surface, low, high),
            surface,
            samples,
            nodes,
        })
    }

    /// The exact surface.
    pub fn surface(&self) -> &ExactSurface {
        &self.surface
    }

    /// The samples.
    pub fn samples(&self) -> &[Sample] {
        &self.samples
    }

    /// Box of the shape: low and high corner, mm.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        (self.low, self.high)
    }

    /// Tree over the samples; `coarse`: over few of them.
    pub(crate) fn nodes(&self, coarse: bool) -> &[Node] {
        if coarse { &self.coarse } else { &self.nodes }
    }

    /// Nearest point of the exact surface; infinitely far for a shape without triangles.
    pub(crate) fn nearest(&self, p: DVec3) -> Option<Nearest> {
        self.surface.nearest(p)
    }

    fn nearest_counted(&self, p: DVec3) -> Option<Nearest> {
        work(NEAREST_WORK);
        self.nearest(p)
    }

    /// Signed distance of `p`, mm, negative inside.
    pub(crate) fn distance(&self, p: DVec3) -> f64 {
        match self.by_face(p) {
            Some((distance, _)) => distance,
            None => self.nearest_counted(p).map_or(f64::INFINITY, |n| n.distance),
        }
    }

    /// As [`Self::distance`], for points of which no others are near: keeps nothing.
    pub(crate) fn distance_once(&self, p: DVec3) -> f64 {
        self.nearest(p).map_or(f64::INFINITY, |n| n.distance)
    }

    /// Signed distance of `p`, and the direction in which it grows as [`Self::outward`] states it.
    pub(crate) fn distance_outward(&self, p: DVec3) -> Option<(f64, DVec3)> {
        self.by_face(p).or_else(|| {
            self.nearest_counted(p)
                .map(|near| (near.distance, self.outward_at(p, &near)))
        })
    }

    /// Signed distance and outward normal by the one face that can be nearest to `p`, where the cell of `p` has one.
    fn by_face(&self, p: DVec3) -> Option<(f64, DVec3)> {
        let known = self.kept.of(&self.surface, p, 2)?;
        self.of_face(known.face?, p)
    }

    /// Signed distance of `p` from the surface of a face, and its outward normal.
    fn of_face(&self, face: u16, p: DVec3) -> Option<(f64, DVec3)> {
        let face = self.surface.shape().faces.get(usize::from(face))?;
        let (distance, natural) = face.surface.distance(p)?;
        Some(if face.reversed {
            (-distance, -natural)
        } else {
            (distance, natural)
        })
    }

    /// Of each face and then of each edge whether a motion carries it along itself, with the body placed by `pose`: planes, cylinders and straight edges along a
    /// slide; surfaces of revolution and circles about the axis of a turn; cylinders about the axis of a screw.
    pub(crate) fn carried_along(&self, motion: &Motion, pose: &DAffine3) -> Vec<bool> {
        let shape = self.surface.shape();
        let back = pose.inverse();
        let (slide, axis) = (
            back.transform_vector3(motion.slide).normalize_or_zero(),
            back.transform_vector3(motion.axis),
        );
        let point = back.transform_point3(motion.point);
        let (slides, turns) = (slide != DVec3::ZERO, motion.angle != 0.0);
        if slides && turns && slide.cross(axis).length() > PARALLEL {
            return Vec::new();
        }
        let is_parallel = |d: DVec3, to: DVec3| d.cross(to).length() <= PARALLEL;
        let is_on_axis = |p: DVec3| (p - point).reject_from_normalized(axis).length() <= ON_AXIS_MM;
        let is_about = |frame: &Frame| is_parallel(frame.z, axis) && is_on_axis(frame.origin);
        let of_face = |surface: &Surface| match surface {
            Surface::Plane { frame } if turns => !slides && is_parallel(frame.z, axis),
            Surface::Plane { frame } => frame.z.dot(slide).abs() <= PARALLEL,
            Surface::Cylinder { frame, .. } if turns => is_about(frame),
            Surface::Cylinder { frame, .. } => is_parallel(frame.z, slide),
            Surface::Cone { frame, .. } | Surface::Torus { frame, .. } => turns && !slides && is_about(frame),
            Surface::Sphere { frame, .. } => turns && !slides && is_on_axis(frame.origin),
            Surface::Spline => false,
        };
        let of_edge = |curve: &Curve| match curve {
            Curve::Line { direction, .. } => !turns && is_parallel(*direction, slide),
            Curve::Circle { frame, .. } => turns && !slides && is_about(frame),
            Curve::Other => false,
        };
        let faces = shape.faces.iter().map(|face| of_face(&face.surface));
        faces
            .chain(shape.edges.iter().map(|edge| of_edge(&edge.curve)))
            .collect()
    }

    /// Direction in which the signed distance of `p` grows, unit length: from its nearest point, or the face's normal where it lies on the surface; zero
    /// where that is unknown.
    pub(crate) fn outward(&self, p: DVec3) -> DVec3 {
        self.nearest(p)
            .map_or(DVec3::ZERO, |near| self.outward_at(p, &near))
    }

    /// As [`Self::outward`], of which the nearest point is known.
    fn outward_at(&self, p: DVec3, near: &Nearest) -> DVec3 {
        if near.distance.abs() > ON_SURFACE_MM {
            return ((p - near.point) * near.distance.signum()).normalize_or_zero();
        }
        self.face_normal(near.face, p).unwrap_or(DVec3::ZERO)
    }

    /// Outward unit normal of a face at the foot of `p`; `None` for a free-form face.
    pub(crate) fn face_normal(&self, face: u32, p: DVec3) -> Option<DVec3> {
        outward(self.surface.shape(), face, p)
    }

    /// Whether the signed distance of `p` exceeds `least`. The distance changes by no more than its point moves, so the distance at the middle of the
    /// cell of `p`, which is kept, decides most questions.
    pub(crate) fn exceeds(&self, p: DVec3, least: f64) -> bool {
        (0..3)
            .find_map(|level| self.by_cell(p, least, level))
            .unwrap_or_else(|| self.distance(p) > least)
    }

    /// Whether the distances kept alone tell that the signed distance of `p` exceeds `least`.
    pub(crate) fn surely_exceeds(&self, p: DVec3, least: f64) -> bool {
        (0..2).any(|level| self.by_cell(p, least, level) == Some(true))
    }

    fn by_cell(&self, p: DVec3, least: f64, level: u8) -> Option<bool> {
        // Distance to the box, a lower bound outside of it.
        let off = p.clamp(self.low, self.high).distance(p);
        if off > 0.0 && off > least {
            return Some(true);
        }
        let known = match self.kept.of(&self.surface, p, level) {
            Some(known) => match known.face {
                Some(face) => return Some(self.of_face(face, p)?.0 > least),
                None => known,
            },
            // Beyond the cells: by the nearest block.
            None if level == 0 => self.kept.of(&self.surface, p.clamp(self.low, self.high), 0)?,
            None => return None,
        };
        // The value is rounded to seven digits.
        let there = f64::from(known.distance);
        let apart = p.distance(known.at) + there.abs() * 1e-6;
        if there - apart > least {
            return Some(true);
        }
        (there + apart <= least).then_some(false)
    }
}

/// Whether the inside of a face can be what first meets another part: it is convex in some direction. Planes, bores and sockets are met by the edges and
/// bulging faces of the other part, which has samples there.
fn bulges(face: &Face) -> bool {
    match face.surface {
        Surface::Plane { .. } => false,
        Surface::Cylinder { .. } | Surface::Cone { .. } | Surface::Sphere { .. } => !face.reversed,
        Surface::Torus { .. } | Surface::Spline => true,
    }
}

/// Outward unit normal of a face at the foot of `p`; `None` for a free-form face.
fn outward(shape: &Shape, face: u32, p: DVec3) -> Option<DVec3> {
    let face = shape.faces.get(face as usize)?;
    let (_, natural) = face.surface.distance(p)?;
    Some(if face.reversed { -natural } else { natural })
}

fn sample(surface: &ExactSurface, size: f64) -> Vec<Sample> {
    let [inside, along] = [
        (size * SHARES[0]).clamp(FACE_SPACING_MM[0], FACE_SPACING_MM[1]),
        (size * SHARES[1]).clamp(EDGE_SPACING_MM[0], EDGE_SPACING_MM[1]),
    ];
    let mut options = PointshellOptions::everywhere(SAMPLE_ERROR_MM, inside);
    options.least_spacing_mm = along;
    let shell = sample_pointshell(surface, &options);
    // Points along edges are sampled below, at even spacing.
    let mut samples: Vec<Sample> = (shell
        .points
        .iter()
        .take(shell.face_points)
        .map(|p| (p, Some(p.normal), Spacing::Inside)))
    .chain(
        shell
            .points
            .iter()
            .skip(shell.face_points + shell.edge_points)
            .map(|p| (p, None, Spacing::All)),
    )
    .map(|(p, normal, spacing)| Sample {
        position: p.position,
        normal,
        face: u32::from(p.face),
        inside: match normal {
            Some(_) => u32::from(p.face),
            None => u32::MAX,
        },
        normals: [normal.unwrap_or(DVec3::NAN); 2],
        spacing,
    })
    .collect();
    let shape = surface.shape();
    for (number, edge) in shape.edges.iter().enumerate() {
        let Some(&face) = edge.faces.first() else { continue };
        for (piece, pair) in edge.polyline.windows(2).enumerate() {
            let steps = (pair[0].distance(pair[1]) / along).ceil().clamp(1.0, 1e4) as usize;
            for i in 0..steps {
                let chord = pair[0].lerp(pair[1], i as f64 / steps as f64);
                let position = match edge.curve {
                    Curve::Line { origin, direction } => origin + direction * (chord - origin).dot(direction),
                    Curve::Circle { frame, radius } => {
                        let across = (chord - frame.origin).reject_from_normalized(frame.z);
                        across
                            .try_normalize()
                            .map_or(chord, |out| frame.origin + out * radius)
                    }
                    Curve::Other => surface.nearest(chord).map_or(chord, |n| n.point),
                };
                samples.push(Sample {
                    position,
                    normal: None,
                    face,
                    // Its first sample is a corner.
                    inside: if piece > 0 || i > 0 {
                        (shape.faces.len() + number) as u32
                    } else {
                        u32::MAX
                    },
                    normals: match edge.faces[..] {
                        [a, b] => [a, b].map(|face| outward(shape, face, position).unwrap_or(DVec3::NAN)),
                        _ => [DVec3::NAN; 2],
                    },
                    spacing: match edge.curve {
                        Curve::Line { .. } => Spacing::Line,
                        Curve::Circle { radius, .. } => Spacing::Arc(radius),
                        Curve::Other => Spacing::All,
                    },
                });
            }
        }
    }
    samples
}

/// Of the samples `order` some that are as far from each other as a chord error of [`COARSE_MM`] allows; all of those at corners and on free-form faces and edges.
fn thin(surface: &ExactSurface, samples: &[Sample], order: Vec<u32>, size: f64) -> Vec<u32> {
    let shape = surface.shape();
    let most = (size * COARSE_SHARE).clamp(EDGE_SPACING_MM[0], FACE_SPACING_MM[1]);
    // An edge meets round faces of the other part, whose radius is not known here: every second sample.
    let line = 1.9 * (size * SHARES[1]).clamp(EDGE_SPACING_MM[0], EDGE_SPACING_MM[1]);
    // Gaps between samples that are left are up to twice the distance that all keep.
    let arc = |radius: f64| ((8.0 * radius * COARSE_MM).sqrt() / 1.7).min(most);
    let of_face = |face: u32| match shape.faces.get(face as usize).map(|f| &f.surface) {
        Some(Surface::Plane { .. }) => most,
        Some(
            Surface::Cylinder { radius, .. } | Surface::Cone { radius, .. } | Surface::Sphere { radius, .. },
        ) => arc(*radius),
        Some(Surface::Torus { minor, .. }) => arc(*minor),
        Some(Surface::Spline) | None => 0.0,
    };
    let mut cells: std::collections::HashMap<(u32, bool, [i64; 3]), Vec<DVec3>> =
        std::collections::HashMap::new();
    let mut kept = Vec::new();
    for i in order {
        let s = &samples[i as usize];
        let inside = s.normal.is_some();
        let spacing = match s.spacing {
            Spacing::Inside => of_face(s.face),
            Spacing::Line => line,
            Spacing::Arc(radius) => arc(radius),
            Spacing::All => 0.0,
        };
        if spacing <= 0.0 {
            kept.push(i);
            continue;
        }
        let at = (s.position / spacing).floor().to_array().map(|x| x as i64);
        let mut near = (-1..=1).flat_map(|x| (-1..=1).flat_map(move |y| (-1..=1).map(move |z| [x, y, z])));
        let taken = near.any(|d| {
            let key = (s.face, inside, [0, 1, 2].map(|k| at[k] + d[k]));
            cells
                .get(&key)
                .is_some_and(|c| c.iter().any(|p| p.distance(s.position) < spacing))
        });
        if !taken {
            cells.entry((s.face, inside, at)).or_default().push(s.position);
            kept.push(i);
        }
    }
    kept
}

/// Builds the tree of `order` in preorder and returns the index of its root. Splits along the longest axis at the median.
fn split(samples: &[Sample], order: &mut [u32], nodes: &mut Vec<Node>) -> u32 {
    let at = nodes.len() as u32;
    let position = |i: u32| samples[i as usize].position;
    let inside = |i: u32| samples[i as usize].inside;
    if let [only] = order {
        nodes.push(Node {
            center: position(*only),
            radius: 0.0,
            first: *only,
            second: u32::MAX,
            inside: inside(*only),
        });
        return at;
    }
    let (low, high) = order
        .iter()
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), &i| {
            (low.min(position(i)), high.max(position(i)))
        });
    let center = (low + high) / 2.0;
    let radius = order
        .iter()
        .map(|&i| position(i).distance(center))
        .fold(0.0, f64::max);
    nodes.push(Node {
        center,
        radius,
        first: 0,
        second: 0,
        inside: order
            .iter()
            .map(|&i| inside(i))
            .reduce(|one, other| if one == other { one } else { u32::MAX })
            .unwrap_or(u32::MAX),
    });
    let extent = high - low;
    let axis = (0..3)
        .max_by(|&a, &b| extent[a].total_cmp(&extent[b]))
        .unwrap_or(0);
    let half = order.len() / 2;
    order.select_nth_unstable_by(half, |&a, &b| position(a)[axis].total_cmp(&position(b)[axis]));
    let (left, right) = order.split_at_mut(half);
    let first = split(samples, left, nodes);
    let second = split(samples, right, nodes);
    nodes[at as usize].first = first;
    nodes[at as usize].second = second;
    at
}

#[cfg(test)]
mod tests {
    use std::sync::OnceLock;

    use super::*;
    use proptest::prelude::*;

    /// Bodies of shapes with planes, bores, a ball, a taper.
    fn bodies() -> &'static Vec<Body> {
        static BODIES: OnceLock<Vec<Body>> = OnceLock::new();
        BODIES.get_or_init(|| {
            let host = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
            [
                "app/samples/pair_d18.75_clear1.00.step",
                "mating/tests/data/ball_in_cylinder.step",
                "mating/tests/data/cone_in_cone.step",
            ]
            .iter()
            .flat_map(|file| mortise_brep::load_step(host.join(file)).unwrap().shapes)
            .map(|shape| Body::new(&shape).unwrap())
            .collect()
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        /// What is kept of a cell changes neither distances nor directions nor answers, near a sample or anywhere.
        #[test]
        fn kept_distances_are_exact(which in 0..6usize, sample in 0.0..1.0f64, x in prop::array::uniform3(-1.0..1.0f64), far in 0.01..8.0f64, least in -1.0..1.0f64) {
            let bodies = bodies();
            let body = &bodies[which % bodies.len()];
            let from = body.samples()[(sample * body.samples().len() as f64) as usize].position;
            let p = from + DVec3::from_array(x) * far;
            let near = body.nearest(p).unwrap();
            prop_assert!((body.distance(p) - near.distance).abs() < 1e-9);
            let (distance, outward) = body.distance_outward(p).unwrap();
            prop_assert!((distance - near.distance).abs() < 1e-9);
            prop_assert!(outward.dot(body.outward_at(p, &near)) > 1.0 - 1e-6);
            let least = near.distance + least * far;
            prop_assert_eq!(body.exceeds(p, least), near.distance > least);
            prop_assert!(!body.surely_exceeds(p, least) || near.distance > least);
        }

        /// No sample of the dense tree is far from all of the coarse one, compared with the curvature there.
        #[test]
        fn coarse_samples_are_everywhere(which in 0..6usize, sample in 0.0..1.0f64) {
            let bodies = bodies();
            let body = &bodies[which % bodies.len()];
            let leaves = |coarse: bool| body.nodes(coarse).iter().filter(|n| n.is_leaf()).map(|n| n.center).collect::<Vec<_>>();
            let (all, few) = (leaves(false), leaves(true));
            prop_assert!(few.len() <= all.len());
            let p = all[(sample * all.len() as f64) as usize];
            let (low, high) = body.bounds();
            let apart = few.iter().map(|q| q.distance(p)).fold(f64::INFINITY, f64::min);
            prop_assert!(apart <= low.distance(high) * COARSE_SHARE + 1e-9, "{apart}");
        }
    }
}
