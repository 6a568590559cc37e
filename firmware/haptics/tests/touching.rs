//! Touching face pairs: the faces that face each other, with both faces of an edge, and the insertion depth.

use crate::support;
use crate::support::hand::{Hand, run};
use crate::support::{BLOCK_HALF, PEG_HALF};
use mortise_haptics::{FacePair, FacePairs, Quat, Settings, State};
use mortise_protocol::image::NO_FACE;

/// Faces of the peg.
const SIDE: u16 = 0;
const END: u16 = 1;
/// Faces of the block.
const TOP: u16 = 0;
const HOLE: u16 = 3;

/// Touching pairs after the hand has moved by `offset` and tilted for a while, with the peg `engaged` in its hole.
fn touching(engaged: f64, offset: f64, tilt: f32) -> FacePairs {
    let image = support::exact_hole_and_peg(0.2e-3, engaged);
    let scene = image.open();
    let mut state = State::new();
    state.load_scene(&scene);
    let mut hand = Hand::at([0.0, 0.0, BLOCK_HALF + PEG_HALF - engaged]);
    state.grab(&scene, 1, &hand.pose()).unwrap();
    let still = Settings::default();
    let (out, _) = run(&mut state, &scene, &still, &mut hand, 1500, |t, hand, _| {
        let ease = (t as f32 / 500.0).min(1.0);
        hand.orientation = Quat::from_rotation_y(tilt * ease);
        hand.goal[0] = offset * f64::from(ease);
    });
    out.pairs
}

fn pair(pairs: &FacePairs, faces: (u16, u16)) -> &FacePair {
    let found = pairs.iter().find(|p| (p.moving_face, p.static_face) == faces);
    found.unwrap_or_else(|| panic!("no {faces:?} in {pairs:?}"))
}

/// Tilted in its hole the peg touches with the edge of its end on one side, and with the block's rim on the other: the insertion depth is that of the
/// peg.
#[test]
fn a_tilted_peg_touches_with_edges_as_deep_as_it_is_in() {
    for engaged in [6e-3, 10e-3, 16e-3] {
        let pairs = touching(engaged, 0.0, 0.05);
        let p = pair(&pairs, (SIDE, HOLE));
        let edges = [(END, NO_FACE), (NO_FACE, TOP)];
        assert!(edges.contains(&(p.moving_edge_face, p.static_edge_face)), "{p:?}");
        // Tilt at most the clearance over the depth; the end's radius R lies across the axis.
        let tilt = 0.2e-3 / engaged;
        assert!(
            (f64::from(p.insertion_m) - engaged).abs() < 2.0 * support::HOLE * tilt,
            "{engaged}: {p:?}"
        );
    }
}

/// To the wall: the rim and the wall are one pair, for the rim's points face the peg's side with the hole's face.
#[test]
fn a_rim_belongs_to_the_face_that_faces_the_other() {
    let pairs = touching(16e-3, 5e-3, 0.0);
    let p = pair(&pairs, (SIDE, HOLE));
    assert_eq!(pairs.len(), 1, "{pairs:?}");
    assert!(p.count >= 2 && p.depth_m > 0.0 && p.insertion_m > 1e-3, "{p:?}");
}

/// Set down beside the hole: end on top, planes without an axis.
#[test]
fn planes_have_no_insertion() {
    let image = support::slab_and_box(0.2e-3, 5);
    let scene = image.open();
    let mut state = State::new();
    state.load_scene(&scene);
    let mut hand = Hand::at([0.0; 3]);
    state.grab(&scene, 1, &hand.pose()).unwrap();
    hand.push = [0.0, 0.0, -3.0];
    let (out, _) = run(
        &mut state,
        &scene,
        &Settings::default(),
        &mut hand,
        1000,
        |_, _, _| {},
    );
    assert!(!out.pairs.is_empty());
    for p in &out.pairs {
        assert_eq!(p.insertion_m, 0.0, "{p:?}");
        assert!(
            p.point.z.abs() < 1e-4 && p.point.truncate().length() < 15e-3,
            "{p:?}"
        );
    }
}
