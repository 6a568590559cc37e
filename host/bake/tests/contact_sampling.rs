//! The error-bounded pointshell, queried both ways, misses no contact by more than its bound, with as few points as the partners allow.
//!
//! Oracle: a point of one shape and a point of another, each on its convex hull, are brought together with opposite normals at a gap g. The plane
//! between them separates the two, so g is exactly their distance; the shells must find it to within ε. A peg in a hole, which no plane separates, is
//! compared with dense points on its four rims, and on its side where a rim passes a rim.

use std::f64::consts::{PI, TAU};

use crate::common::*;
use glam::{DAffine3, DMat3, DVec3};
use mortise_bake::{
    ExactSurface, Met, Partners, Pointshell, PointshellOptions, ShellPoint, sample_pointshell,
};
use mortise_brep::Shape;
use proptest::prelude::*;

const EPSILON: f64 = 0.05;
const MAX_SPACING: f64 = 2.0;
const GAP: f64 = 0.01;

struct Sampled {
    surface: ExactSurface,
    shell: Pointshell,
}

fn pair(a: &Shape, b: &Shape) -> [Sampled; 2] {
    let surfaces = [ExactSurface::new(a), ExactSurface::new(b)];
    let shell = |own: usize| {
        let options = PointshellOptions {
            epsilon_mm: EPSILON,
            crossing_epsilon_mm: EPSILON,
            // Assumes no radius below half a millimetre; of the kinds below only a cone's tip is sharper.
            least_spacing_mm: (4.0 * EPSILON * 0.5f64).sqrt(),
            max_spacing_mm: MAX_SPACING,
            partners: Partners::of([&surfaces[1 - own]]),
        };
        sample_pointshell(&surfaces[own], &options)
    };
    let shells = [shell(0), shell(1)];
    let mut shells = shells.into_iter();
    surfaces.map(|surface| Sampled {
        surface,
        shell: shells.next().unwrap(),
    })
}

/// Smallest signed distance of any sample of one shape to the other; `place` is the pose of `b` in `a`'s frame.
fn sampled_gap([a, b]: &[Sampled; 2], place: DAffine3) -> f64 {
    let back = place.inverse();
    let least = |points: &Pointshell, to: DAffine3, field: &ExactSurface| {
        let gap = |p: DVec3| field.nearest(to.transform_point3(p)).unwrap().distance;
        let deepest = |p: &ShellPoint| match p.span {
            Some(_) => least_along(p, gap),
            None => gap(p.position),
        };
        points.points.iter().map(deepest).fold(f64::INFINITY, f64::min)
    };
    least(&a.shell, back, &b.surface).min(least(&b.shell, place, &a.surface))
}

/// Least gap along the span of a point: the least of its quarters, then by halves of the interval.
fn least_along(span: &ShellPoint, gap: impl Fn(DVec3) -> f64) -> f64 {
    let at = |u: f64| gap(span.at(u));
    let start = [-1.0, -0.5, 0.0, 0.5, 1.0].map(|u| (at(u), u));
    let (mut least, mut u) = start.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
    let mut step = 0.25;
    while step > 1e-4 {
        let beside = [u - step, u + step]
            .map(|u| u.clamp(-1.0, 1.0))
            .map(|u| (at(u), u));
        match beside.into_iter().find(|(gap, _)| *gap < least) {
            Some(lower) => (least, u) = lower,
            None => step *= 0.5,
        }
    }
    least
}

/// A place on a shape's hull.
#[derive(Clone, Copy, Debug)]
struct Feature {
    point: DVec3,
    normal: DVec3,
    /// Whether the place is sharp: two sharp edges that cross have no bound.
    edge: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Peg { radius: f64, height: f64 },
    Sphere { radius: f64 },
    Torus { major: f64, minor: f64 },
    Cone { radius: f64, height: f64 },
    Block,
}

const BLOCK: ([f64; 2], f64, f64) = ([25.0, 20.0], 30.0, 9.375);

impl Kind {
    fn shape(self) -> Shape {
        match self {
            Self::Peg { radius, height } => peg(radius, height, 24),
            Self::Sphere { radius } => sphere(radius, 24),
            Self::Torus { major, minor } => torus(major, minor, 24),
            Self::Cone { radius, height } => cone(radius, height, 24),
            Self::Block => block_with_hole(BLOCK.0, BLOCK.1, BLOCK.2, 24),
        }
    }

    /// A place on the hull, chosen by `which` and `u`, `v`, `w` in 0..1.
    fn feature(self, which: u8, [u, v, w]: [f64; 3]) -> Feature {
        let radial = DVec3::new((TAU * u).cos(), (TAU * u).sin(), 0.0);
        let on = |point, normal: DVec3, edge| Feature {
            point,
            normal: normal.normalize(),
            edge,
        };
        let between = |a: DVec3, b: DVec3| a * (0.5 * PI * w).cos() + b * (0.5 * PI * w).sin();
        match self {
            Self::Peg { radius, height } => match which % 3 {
                0 => on(radial * radius + DVec3::Z * height * v, radial, false),
                1 => on(
                    radial * radius + DVec3::Z * height,
                    between(radial, DVec3::Z),
                    true,
                ),
                _ => on(radial * radius, between(radial, -DVec3::Z), true),
            },
            Self::Sphere { radius } => {
                let n = from_latitude(radial, (2.0 * v - 1.0).asin());
                on(n * radius, n, false)
            }
            Self::Torus { major, minor } => {
                let n = from_latitude(radial, 0.99 * (v - 0.5) * PI);
                on(radial * major + n * minor, n, false)
            }
            Self::Cone { radius, height } => {
                let side = (radial * height + DVec3::Z * radius).normalize();
                match which % 3 {
                    0 => on(radial * radius * (1.0 - v) + DVec3::Z * height * v, side, false),
                    1 => on(radial * radius, between(side, -DVec3::Z), true),
                    _ => {
                        let n = from_latitude(radial, side.z.asin() + (0.5 * PI - side.z.asin()) * w);
                        on(DVec3::Z * height, n, true)
                    }
                }
            }
            Self::Block => {
                let ([x, y], height, hole) = BLOCK;
                match which % 5 {
                    // Well inside the top, beside the hole.
                    0 => on(
                        DVec3::new(hole + 8.0, (2.0 * v - 1.0) * 12.0, height),
                        DVec3::Z,
                        false,
                    ),
                    1 => on(
                        DVec3::new(x, (2.0 * u - 1.0) * 12.0, 5.0 + v * 20.0),
                        DVec3::X,
                        false,
                    ),
                    2 => on(
                        DVec3::new(x, (2.0 * v - 1.0) * y, height),
                        between(DVec3::X, DVec3::Z),
                        true,
                    ),
                    3 => on(DVec3::new(x, y, v * height), between(DVec3::X, DVec3::Y), true),
                    _ => on(
                        DVec3::new(-x, y, height),
                        DVec3::new(-0.05 - u, 0.05 + v, 0.05 + w),
                        true,
                    ),
                }
            }
        }
    }
}

fn from_latitude(radial: DVec3, latitude: f64) -> DVec3 {
    radial * latitude.cos() + DVec3::Z * latitude.sin()
}

/// Brings `b` to `a` at [`GAP`], turned by `roll` about the common normal.
fn bring(a: Feature, b: Feature, roll: f64) -> DAffine3 {
    let frame = |z: DVec3| {
        let x = z.any_orthonormal_vector();
        DMat3::from_cols(x, z.cross(x), z)
    };
    let rotation = frame(a.normal) * DMat3::from_rotation_z(roll) * frame(-b.normal).transpose();
    DAffine3 {
        matrix3: rotation,
        translation: a.point + a.normal * GAP - rotation * b.point,
    }
}

fn kinds() -> Vec<Kind> {
    vec![
        Kind::Peg {
            radius: 8.875,
            height: 60.0,
        },
        Kind::Peg {
            radius: 3.0,
            height: 40.0,
        },
        Kind::Sphere { radius: 10.0 },
        Kind::Sphere { radius: 2.0 },
        Kind::Torus {
            major: 12.0,
            minor: 4.0,
        },
        Kind::Cone {
            radius: 8.0,
            height: 20.0,
        },
        Kind::Block,
    ]
}

/// Every pair of kinds, forty random contacts each.
#[test]
fn no_contact_is_missed_by_more_than_the_bound() {
    let mut state = 1u64;
    let mut random = move || {
        // Knuth's MMIX constants.
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    for (i, &a) in kinds().iter().enumerate() {
        for &b in &kinds()[i..] {
            let shells = pair(&a.shape(), &b.shape());
            let mut worst = 0.0f64;
            let mut tried = 0;
            while tried < 40 {
                let mut feature =
                    |kind: Kind| kind.feature((random() * 30.0) as u8, [random(), random(), random()]);
                let (fa, fb) = (feature(a), feature(b));
                // There is also no bound within a spacing of a cone's tip, where the radius approaches zero.
                let blunt = |kind: Kind, f: Feature| !matches!(kind, Kind::Cone { height, .. } if f.point.z > 0.9 * height && f.point.z < height);
                if fa.edge && fb.edge || !blunt(a, fa) || !blunt(b, fb) {
                    continue;
                }
                tried += 1;
                let roll = TAU * random();
                let found = sampled_gap(&shells, bring(fa, fb, roll));
                // A span lies within a quarter of a micrometre of its edge.
                assert!(found > GAP - 0.3e-3, "{a:?} {b:?}: {found}");
                assert!(
                    found <= GAP + 1.01 * EPSILON,
                    "{a:?} {b:?}: missed by {} at {fa:?} {fb:?} {roll}",
                    found - GAP
                );
                worst = worst.max(found - GAP);
            }
            let points = shells.each_ref().map(|s| s.shell.points.len());
            println!("{a:?} {b:?}: {points:?} points, worst {worst:.4} mm");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// A peg tilted and moved in a hole 0.05 mm wider: all contact is at the rims.
    #[test]
    fn a_tilted_peg_in_its_hole(
        tilt in 0.0f64..0.03, about in 0.0f64..TAU, x in -0.2f64..0.2, y in -0.2f64..0.2, z in -50.0f64..20.0,
    ) {
        let (half, height, hole) = BLOCK;
        let (radius, length) = (hole - 0.025, 60.0);
        thread_local! {
            static SHELLS: [Sampled; 2] = pair(
                &block_with_hole(BLOCK.0, BLOCK.1, BLOCK.2, 24),
                &peg(BLOCK.2 - 0.025, 60.0, 24),
            );
        }
        let axis = DVec3::new(about.cos(), about.sin(), 0.0);
        let place = DAffine3 {
            matrix3: DMat3::from_axis_angle(axis, tilt),
            translation: DVec3::new(x, y, z),
        };
        let back = place.inverse();
        let rim = |r: f64, z: f64| (0..20_000).map(move |i| {
            let a = TAU * f64::from(i) / 20_000.0;
            DVec3::new(r * a.cos(), r * a.sin(), z)
        });
        let own = [0.0, length].into_iter().flat_map(|z| rim(radius, z))
            .map(|p| block_distance(half, height, hole, place.transform_point3(p)));
        let other = [0.0, height].into_iter().flat_map(|z| rim(hole, z))
            .map(|p| peg_distance(radius, length, back.transform_point3(p)));
        let exact = own.chain(other).fold(f64::INFINITY, f64::min);
        // Where a rim passes a rim the side is deeper than either; the peg has points beside its rims.
        let beside = [4.0 * EPSILON, length - 4.0 * EPSILON].into_iter().flat_map(|z| rim(radius, z))
            .map(|p| block_distance(half, height, hole, place.transform_point3(p)));
        let deepest = beside.fold(exact, f64::min);
        let found = SHELLS.with(|shells| sampled_gap(shells, place));
        // Two rims may cross: a sample half a spacing (1 mm) away, under a face at the tilt.
        let bound = EPSILON * tilt.sin() + MAX_SPACING / 2.0 * tilt.sin() + 1e-3;
        // A span lies within a quarter of a micrometre of its edge.
        prop_assert!(found >= deepest - 0.3e-3 && found <= exact + bound, "{found} against {deepest} to {exact}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    /// A peg pressed to the wall where its rim passes the rim of its hole, so that neither rim is deep, but its side is. Oracle: dense points on the
    /// side itself, in closed form.
    #[test]
    fn a_rim_that_passes_a_rim(
        loose: bool, about in 0.0f64..TAU, deep in 0.0f64..1.8 * EPSILON, past in -2.5 * EPSILON..2.5 * EPSILON, tilt in 0.0f64..0.03,
    ) {
        let (half, height, hole) = BLOCK;
        let radius = hole - if loose { 0.5 } else { 0.01 };
        thread_local! {
            static SHELLS: [[Sampled; 2]; 2] = [0.01, 0.5].map(|room| pair(
                &block_with_hole(BLOCK.0, BLOCK.1, BLOCK.2, 24),
                &peg(BLOCK.2 - room, 60.0, 24),
            ));
        }
        // Its lower rim is `past` above the block's lower face and `deep` in the wall; the rest tilts away from the wall there.
        let wall = DVec3::new(about.cos(), about.sin(), 0.0);
        let place = DAffine3 {
            matrix3: DMat3::from_axis_angle(wall.cross(DVec3::Z), tilt),
            translation: wall * (hole - radius + deep) + DVec3::Z * past,
        };
        let mut exact = f64::INFINITY;
        for row in 0..200 {
            for column in -100..=100 {
                let angle = about + 0.005 * f64::from(column);
                let side = DVec3::new(radius * angle.cos(), radius * angle.sin(), 0.005 * f64::from(row));
                exact = exact.min(block_distance(half, height, hole, place.transform_point3(side)));
            }
        }
        let found = SHELLS.with(|shells| sampled_gap(&shells[usize::from(loose)], place));
        // The ring's density is such that, half-way between two points, the side at a depth of twice the bound is less deep by the bound; and the
        // ring, four bounds from the rim, is less deep by the tilt.
        let between = EPSILON * (hole - radius + deep) / (hole - radius + 2.0 * EPSILON);
        let bound = between * hole / radius + 4.0 * EPSILON * tilt.tan() + 1e-3;
        prop_assert!(found <= exact + bound, "{found} against {exact}, bound {bound}");
    }
}

/// Points that a peg and its block need: spans of rims and edges, corners, a ring beside each of the peg's rims, none inside.
#[test]
fn a_fit_needs_only_edges() {
    let [block, peg] = pair(&Kind::Block.shape(), &peg(9.365, 60.0, 24));
    let points = |s: &Sampled| (s.shell.face_points, s.shell.edge_points, s.shell.corner_points);
    // Eight spans a rim, and a ring of four points beside each, as for any tight fit.
    assert_eq!(points(&peg), (0, 2 * (8 + 4), 0));
    // No span is longer than 0.8 of the peg's radius.
    let straight = |l: f64| (l / (0.8 * 9.365)).ceil() as usize;
    let edges = 4 * (straight(50.0) + straight(40.0) + straight(30.0));
    assert_eq!(points(&block), (0, edges + 2 * 8, 8));
}

/// The sharper of two cylinders has the rows of points; the blunter one relies on them.
#[test]
fn rows_only_where_the_partner_is_no_sharper() {
    let [thick, thin] = pair(&peg(10.0, 60.0, 24), &peg(5.0, 60.0, 24));
    assert_eq!(thick.shell.face_points, 0);
    let rows = (60.0 / (4.0f64 * EPSILON * 10.0).sqrt()).ceil();
    let columns = (TAU * 5.0 / (4.0 * EPSILON / (0.2 + 0.1f64)).sqrt()).ceil();
    assert_eq!(thin.shell.face_points, (rows * columns) as usize);
    let [a, b] = pair(&peg(5.0, 60.0, 24), &peg(5.0, 60.0, 24));
    assert!(a.shell.face_points > 0 && a.shell == b.shell);
}

/// The foot of a boss, an inner corner, needs no sample; its top does.
#[test]
fn concave_edges_have_no_points() {
    let boss = revolve(
        &[
            (0.0, 0.0, 0),
            (20.0, 0.0, 1),
            (20.0, 5.0, 2),
            (8.0, 5.0, 3),
            (8.0, 15.0, 4),
            (0.0, 15.0, 4),
        ],
        false,
        &[
            (mortise_brep::Surface::Plane { frame: world() }, true),
            (
                mortise_brep::Surface::Cylinder {
                    frame: world(),
                    radius: 20.0,
                },
                false,
            ),
            (
                mortise_brep::Surface::Plane {
                    frame: frame_at(DVec3::Z * 5.0, DVec3::Z),
                },
                false,
            ),
            (
                mortise_brep::Surface::Cylinder {
                    frame: world(),
                    radius: 8.0,
                },
                false,
            ),
            (
                mortise_brep::Surface::Plane {
                    frame: frame_at(DVec3::Z * 15.0, DVec3::Z),
                },
                false,
            ),
        ],
        24,
    );
    let [sampled, _] = pair(&boss, &Kind::Block.shape());
    let at = |r: f64, z: f64| {
        sampled
            .shell
            .points
            .iter()
            .filter(|p| (p.position.truncate().length() - r).abs() < 1e-9 && (p.position.z - z).abs() < 1e-9)
            .count()
    };
    assert_eq!(at(8.0, 5.0), 0);
    assert!(at(8.0, 15.0) >= 8 && at(20.0, 5.0) >= 8 && at(20.0, 0.0) >= 8);
}

/// A lone shape, and one whose partners find every contact, still have enough points to be felt.
#[test]
fn no_shape_is_left_without_points() {
    let ball = ExactSurface::new(&sphere(10.0, 24));
    let ring = ExactSurface::new(&torus(12.0, 4.0, 24));
    for surface in [&ball, &ring] {
        let options = PointshellOptions {
            epsilon_mm: 5.0,
            crossing_epsilon_mm: 5.0,
            least_spacing_mm: 0.0,
            max_spacing_mm: 100.0,
            partners: Partners::Known(Met::default()),
        };
        let shell = sample_pointshell(surface, &options);
        assert!(shell.points.len() >= 8, "{}", shell.points.len());
    }
}
