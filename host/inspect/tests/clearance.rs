//! Clearances and maps of them against closed forms.

use crate::support::shapes;
use glam::{DAffine3, DQuat, DVec3};
use mortise_inspect::{ClearanceMap, MapOptions, Pair, Solid, TOUCH_MM, clearance_map, clearances};
use mortise_task::{Body, Placed};
use proptest::prelude::*;

fn place(bodies: &[(Body, DAffine3)], within: f64) -> Vec<Pair> {
    let placed: Vec<Placed<'_>> = bodies
        .iter()
        .map(|(body, pose)| Placed { body, pose: *pose })
        .collect();
    clearances(&placed, within)
}

fn at(x: f64, y: f64, z: f64) -> DAffine3 {
    DAffine3::from_translation(DVec3::new(x, y, z))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    /// Gap of a ball and a block, or how deep they are in each other where the centre is outside, within a micrometre.
    #[test]
    fn a_ball_at_a_block(c in prop::array::uniform3(-6.0..6.0f64), about in 0.0..6.0f64) {
        let half = DVec3::new(2.0, 3.0, 4.0);
        let c = DVec3::from_array(c);
        let want = shapes::box_distance(-half, half, c) - 1.0;
        prop_assume!(want > -0.9 && want < 3.0);
        let turn = DAffine3::from_rotation_z(about);
        let bodies = [
            (Body::new(&shapes::block(half)).unwrap(), turn),
            (Body::new(&shapes::sphere(1.0, 24)).unwrap(), turn * DAffine3::from_translation(c)),
        ];
        let found = place(&bodies, 3.5);
        prop_assert_eq!(found.len(), 1);
        let least = found[0].least;
        prop_assert!((least.distance_mm - want).abs() < 1e-3, "{} {want}", least.distance_mm);
        // The place lies on one of the surfaces, and as deep in the other.
        let place = turn.inverse().transform_point3(least.point);
        let (in_block, in_ball) = (shapes::box_distance(-half, half, place), place.distance(c) - 1.0);
        prop_assert!(in_block.abs().min(in_ball.abs()) < 1e-6);
        prop_assert!((in_block + in_ball - want).abs() < 1e-3);
        prop_assert_eq!(found[0].overlaps(), want < -TOUCH_MM);
    }

    #[test]
    fn a_peg_in_its_hole(aside in 0.0..0.2f64, about in 0.0..6.0f64) {
        let (radius, hole) = (4.9, 5.0);
        let bodies = [
            (Body::new(&shapes::block_with_hole([10.0, 10.0], 8.0, hole, 48)).unwrap(), DAffine3::IDENTITY),
            (Body::new(&shapes::peg(radius, 12.0, 48)).unwrap(), at(aside * about.cos(), aside * about.sin(), -2.0)),
        ];
        let found = place(&bodies, 0.5);
        prop_assert!((found[0].least.distance_mm - (hole - radius - aside)).abs() < 1e-3);
    }
}

#[test]
fn pairs_come_in_order_and_only_near_ones() {
    let block = || Body::new(&shapes::block(DVec3::ONE)).unwrap();
    // 0 and 1 overlap by 0.1, 1 and 2 touch, 2 and 3 are 0.3 apart, 4 is far.
    let bodies = [
        (block(), 0.0),
        (block(), 1.9),
        (block(), 3.9),
        (block(), 6.2),
        (block(), 20.0),
    ]
    .map(|(body, x)| (body, at(x, 0.0, 0.0)));
    let found = place(&bodies, 0.5);
    assert_eq!(
        found.iter().map(|p| p.parts).collect::<Vec<_>>(),
        [[0, 1], [1, 2], [2, 3]]
    );
    assert!((found[0].least.distance_mm + 0.1).abs() < 1e-6 && found[0].overlaps());
    assert!(found[1].touches() && !found[1].overlaps());
    assert!((found[2].least.distance_mm - 0.3).abs() < 1e-6);
    assert_eq!(place(&bodies, 0.2).len(), 2);
}

/// Largest difference of the map's linear distances from `exact` at random points of its triangles nearer than 0.1 mm, mm. Points of triangles that did not
/// meet the tolerance are counted.
fn compare(map: &ClearanceMap, part: &Solid, points: usize, exact: impl Fn(DVec3) -> f64) -> (f64, usize) {
    let mut random = fastrand::Rng::with_seed(3);
    let (mut worst, mut unmet) = (0f64, 0);
    // Evenly over the surface: by the sums of the triangles' areas.
    let mut sums = Vec::new();
    let mut sum = 0.0;
    for t in &map.triangles {
        let [a, b, c] = t.map(|v| map.points[v as usize]);
        sum += (b - a).cross(c - a).length();
        sums.push(sum);
    }
    for _ in 0..points {
        let share = random.f64() * sum;
        let i = sums.partition_point(|&s| s < share);
        let (mut u, mut v) = (random.f64(), random.f64());
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        let t = map.triangles[i].map(|v| v as usize);
        let mix = |a: f64, b: f64, c: f64| a + (b - a) * u + (c - a) * v;
        let flat = t.map(|v| map.points[v]);
        let p = flat[0] + (flat[1] - flat[0]) * u + (flat[2] - flat[0]) * v;
        let p = part.surface().nearest(p).unwrap().point;
        let shown = mix(
            map.distances_mm[t[0]],
            map.distances_mm[t[1]],
            map.distances_mm[t[2]],
        );
        let want = exact(p);
        if !map.met[i] {
            unmet += 1;
            continue;
        }
        if want.abs() < 0.1 {
            // Within a micrometre, so beyond it the sign is right.
            worst = worst.max((shown - want).abs());
        } else {
            assert_eq!(shown < 0.0, want < 0.0, "{shown} {want}");
        }
    }
    (worst, unmet)
}

/// The map of a peg in its hole, at its vertices and between them, against the closed form: 10⁴ points.
#[test]
fn a_map_is_exact_to_a_micrometre() {
    let (half, height, hole) = ([10.0, 10.0], 8.0, 5.0);
    let peg = Solid::new(&shapes::peg(4.96, 12.0, 40));
    let block = Solid::new(&shapes::block_with_hole(half, height, hole, 40));
    for (i, (x, tilt)) in [(0.0, 0.0), (0.03, 0.0), (0.055, 0.0), (0.01, 0.003)]
        .into_iter()
        .enumerate()
    {
        let to = DAffine3::from_rotation_translation(DQuat::from_rotation_y(tilt), DVec3::new(x, 0.0, -2.0));
        let exact = |p: DVec3| shapes::block_distance(half, height, hole, to.transform_point3(p));
        let map = clearance_map(&peg, &block, &to, &MapOptions::default());
        for (&p, &d) in map.points.iter().zip(&map.distances_mm) {
            assert!((d - exact(p)).abs() < 1e-6, "{i}: {d} {}", exact(p));
            assert!(shapes::peg_distance(4.96, 12.0, p).abs() < 1e-6);
        }
        let (worst, unmet) = compare(&map, &peg, 10_000, exact);
        println!(
            "{i}: {} vertices, worst {worst:.1e} mm, {unmet} of 10000 points beside kinks",
            map.points.len()
        );
        assert!(worst < 1e-3 && unmet < 500, "{i}: {worst} {unmet}");
        let (_, least) = map.least().unwrap();
        if tilt == 0.0 {
            assert!((least - (hole - 4.96 - x)).abs() < 1e-3, "{i}: {least}");
        }
        // No gap opens: all sides but those of the border are shared.
        let mut sides = std::collections::HashSet::new();
        for t in &map.triangles {
            for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                assert!(sides.insert((a, b)), "a side is used twice");
            }
        }
    }
}

#[test]
fn a_map_beyond_its_range_is_empty() {
    let ball = Solid::new(&shapes::sphere(3.0, 24));
    let map = clearance_map(&ball, &ball, &at(8.0, 0.0, 0.0), &MapOptions::default());
    assert!(map.triangles.is_empty() && map.least().is_none());
    let map = clearance_map(&ball, &ball, &at(6.01, 0.0, 0.0), &MapOptions::default());
    // The least lies between vertices: a ball's distance from another grows with the square of the way.
    assert!((map.least().unwrap().1 - 0.01).abs() < 0.2);
}
