//! Pieces of sharp convex edges in a baked image: they lie on the exact edges, cover them, and state the thickness of the solid behind them.

use crate::common::*;
use glam::{DAffine3, DVec3};
use mortise_bake::{BakeOptions, Grabbable, bake};
use mortise_brep::Shape;
use mortise_protocol::image::{EdgeRecord, SceneImage, oct_decode};
use proptest::prelude::*;
use std::ops::ControlFlow;

fn edges(shape: Shape) -> Vec<EdgeRecord> {
    let size = (shape.mesh.vertices.iter()).fold(0.0f64, |m, v| m.max(v.abs().max_element()));
    let options = BakeOptions {
        // The field is of no interest here.
        cell_mm: Some(size / 8.0),
        grabbable: Grabbable::All,
        ..BakeOptions::default()
    };
    let baked = bake(
        &model(vec![("part", shape, DAffine3::IDENTITY)]),
        &options,
        &|_| ControlFlow::Continue(()),
    );
    let image = baked.expect("it bakes").image;
    let image = AlignedBytes::new(&image);
    let scene = SceneImage::open(image.bytes()).expect("a scene");
    let shape = scene.shape(0);
    for node in shape.edge_nodes {
        let center = DVec3::from_array(node.center.map(f64::from));
        for piece in node.points(shape.edges) {
            for k in -8..=8 {
                let p = at(piece, f64::from(k) / 8.0) / 1000.0;
                assert!(
                    p.distance(center) <= f64::from(node.radius) + 1e-9,
                    "{node:?} {piece:?}"
                );
            }
        }
    }
    shape.edges.to_vec()
}

/// Point of a piece, mm.
fn at(piece: &EdgeRecord, t: f64) -> DVec3 {
    let [c, h, b] =
        [piece.center, piece.half, piece.bend].map(|v| DVec3::from_array(v.map(f64::from)) * 1000.0);
    c + h * t + b * (t * t)
}

fn length(pieces: &[EdgeRecord]) -> f64 {
    let steps = |p| {
        (0..64).map(move |k| at(p, f64::from(k) / 32.0 - 1.0).distance(at(p, f64::from(k + 1) / 32.0 - 1.0)))
    };
    pieces.iter().flat_map(steps).sum()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// Twelve straight pieces; behind each a sphere as thick as the thinnest size.
    #[test]
    fn a_box_has_twelve(x in 0.2f64..40.0, y in 1.0f64..40.0, z in 1.0f64..40.0) {
        let size = DVec3::new(x, y, z);
        let pieces = edges(block(size / 2.0));
        prop_assert_eq!(pieces.len(), 12);
        prop_assert!((length(&pieces) - 4.0 * size.element_sum()).abs() < 1e-3);
        for piece in &pieces {
            prop_assert!(piece.is_straight());
            let thinner = size.min_element();
            let stated = f64::from(piece.thickness) * 1000.0;
            prop_assert!(stated <= 1.001 * thinner && stated >= 0.75 * thinner, "{} of {}", stated, thinner);
            // The normals are those of two faces, outward.
            for n in piece.normals {
                let n = DVec3::from_array(oct_decode(n).map(f64::from));
                prop_assert!((n.abs().max_element() - 1.0).abs() < 1e-3 && n.dot(at(piece, 0.0)) > 0.0);
            }
        }
    }

    /// Two rims, within half a micrometre of the circles.
    #[test]
    fn a_peg_has_two_rims(radius in 0.5f64..60.0, height in 1.0f64..80.0) {
        let pieces = edges(peg(radius, height, 48));
        let around = std::f64::consts::TAU * radius;
        prop_assert!((length(&pieces) - 2.0 * around).abs() < 1e-3 * around);
        for piece in &pieces {
            for k in -16..=16 {
                let p = at(piece, f64::from(k) / 16.0);
                let off = (p.x.hypot(p.y) - radius).hypot(p.z.abs().min((p.z - height).abs()));
                // The tolerance, and rounding of positions of 80 mm.
                prop_assert!(off < 0.6e-3, "{} mm off, {} pieces", off, pieces.len());
            }
        }
        prop_assert!(pieces.len() <= 128, "{}", pieces.len());
    }
}

/// A concave edge is none: the floor of a hole meets its wall in no piece.
#[test]
fn a_hole_has_rims_but_no_concave_edges() {
    let pieces = edges(block_with_hole([20.0, 20.0], 12.0, 8.0, 32));
    // Four edges of 40 mm at either end, four of 12 mm between, and two rims.
    let expected = 8.0 * 40.0 + 4.0 * 12.0 + 2.0 * std::f64::consts::TAU * 8.0;
    assert!(
        (length(&pieces) - expected).abs() < 0.1,
        "{} {expected}",
        length(&pieces)
    );
    assert!(edges(sphere(10.0, 32)).is_empty());
}
