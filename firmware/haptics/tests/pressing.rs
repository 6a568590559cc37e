//! A part pressed against a wall: the hand feels its own force, and the part stays outside.

use crate::support;
use crate::support::hand::{Hand, run};
use mortise_haptics::{Settings, State};

/// Force on the handle (N) and deepest penetration (m) when part 1 is pressed in a direction.
fn pressed(image: &support::image::Image, from: [f64; 3], direction: [f64; 3], force: f64) -> (f64, f64) {
    let scene = image.open();
    let mut state = State::new();
    state.load_scene(&scene);
    let mut hand = Hand::at(from);
    hand.spring_n_per_m = 0.0;
    state.grab(&scene, 1, &hand.pose()).unwrap();
    hand.push = direction.map(|d| d * force);
    let (out, seen) = run(
        &mut state,
        &scene,
        &Settings::default(),
        &mut hand,
        3000,
        |_, _, _| {},
    );
    let felt: f64 = (0..3)
        .map(|a| -direction[a] * f64::from(out.handle.force[a]))
        .sum();
    println!(
        "{force} N: felt {felt:.4} N, depth {:.2} um settled, {:.2} um at most, {:?}",
        1e6 * out.pairs[0].depth_m,
        1e6 * seen.deepest_m,
        seen
    );
    // Over no interval did the device deliver more energy than was stored.
    assert!(seen.made_j < 1e-6, "{seen:?}");
    (felt, f64::from(seen.deepest_m))
}

#[test]
fn on_a_flat_face() {
    let image = support::slab_and_box(0.5e-3, 7);
    for force in [1.0, 3.0, 5.0] {
        let (felt, deepest) = pressed(&image, [0.0, 0.0, 0.03], [0.0, 0.0, -1.0], force);
        assert!((felt - force).abs() < 0.02 * force, "{felt} of {force} N");
        assert!(deepest < 50e-6);
    }
}

#[test]
fn on_the_wall_of_a_hole() {
    let image = support::hole_and_peg(1e-3, 25e-3);
    for force in [1.0, 3.0, 5.0] {
        let (felt, deepest) = pressed(&image, [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], force);
        assert!((felt - force).abs() < 0.02 * force, "{felt} of {force} N");
        assert!(deepest < 50e-6);
    }
}

/// The thesis' large pair: 0.69 m in 0.7 m, on cells of 10 mm.
#[test]
fn a_large_part_on_coarse_cells() {
    use support::solids::{Block, Peg};
    let mut w = support::image::Writer::new(10e-3);
    let block = w.shape(&Block {
        half: [0.5, 0.5, 0.2],
        hole: 0.35,
        around: 128,
        across: 9,
    });
    let peg = w.shape(&Peg {
        radius: 0.345,
        half_length: 0.3,
        around: 128,
        rings: 3,
    });
    w.part(block, false, [0.0; 3], support::UPRIGHT);
    w.part(peg, true, [0.0; 3], support::UPRIGHT);
    let image = w.finish();
    for force in [1.0, 5.0] {
        let (felt, deepest) = pressed(&image, [0.0, 0.0, 0.0], [0.6, 0.8, 0.0], force);
        assert!((felt - force).abs() < 0.02 * force, "{felt} of {force} N");
        assert!(deepest < 50e-6);
    }
}
