//! The scene image's layout is frozen: hand-made bytes, stored in `tests/golden`, are read back through the board's query.

use crate::scene::{self, Aligned};
use mortise_protocol::image::*;

const GOLDEN: &[u8] = include_bytes!("golden/tiny.scene");
const GOLDEN_OCCUPANCY: &[u8] = include_bytes!("golden/occupancy.scene");
const GOLDEN_ENERGY: &[u8] = include_bytes!("golden/energy.scene");

/// This test fails on a change of layout or meaning. Increment `LAYOUT_VERSION`, then rewrite the file with `MORTISE_BLESS=1`.
#[test]
fn golden_bytes_have_not_changed() {
    let all = [
        ("tiny", scene::bytes(), GOLDEN),
        ("occupancy", scene::occupancy_bytes(), GOLDEN_OCCUPANCY),
        ("energy", scene::energy_bytes(), GOLDEN_ENERGY),
    ];
    for (name, made, golden) in all {
        if std::env::var_os("MORTISE_BLESS").is_some() {
            let path = format!("{}/tests/golden/{name}.scene", env!("CARGO_MANIFEST_DIR"));
            std::fs::write(path, &made).expect("the golden file can be written");
            continue;
        }
        assert!(
            made == golden,
            "{name}: the layout changed: raise LAYOUT_VERSION and run with MORTISE_BLESS=1"
        );
    }
}

#[test]
fn golden_voxmap_reads_back() {
    let aligned = Aligned::new(GOLDEN_OCCUPANCY);
    let image = SceneImage::open(aligned.bytes()).unwrap();
    let field = image.shape(0).field;
    assert!(field.is_occupancy());
    // (height in mm, expected voxel, least distance to a surface voxel in mm)
    for (z, voxel, bound) in [
        (-3.2f32, Voxel::Interior, 4.0f32),
        (1.5, Voxel::Interior, 0.0),
        (4.01, Voxel::Surface, 0.0),
        (4.99, Voxel::Surface, 0.0),
        (5.3, Voxel::Proximity, 0.0),
        (6.1, Voxel::Free, 1.0),
        (9.0, Voxel::Free, 3.0),
    ] {
        let p = [0.0023, 0.0071, 1e-3 * z];
        let sample = field.voxel(p);
        assert_eq!(sample.voxel, voxel, "{z}");
        assert!((sample.bound - 1e-3 * bound).abs() < 1e-9, "{z}: {sample:?}");
        let inside = voxel == Voxel::Interior;
        // The distance query returns only bounds.
        assert_eq!(
            field.lookup(p),
            Lookup::Far {
                inside,
                bound: sample.bound
            },
            "{z}"
        );
        if bound < 2.0 {
            let center = [0.0025, 0.0075, 1e-3 * (z.floor() + 0.5)];
            for (found, wanted) in sample.center.iter().zip(center) {
                assert!((found - wanted).abs() < 2e-9, "{z}: {sample:?}");
            }
            assert_eq!(sample.faces, [0, NO_FACE]);
        }
    }
    // Beside the box: the distance to it.
    let beside = field.voxel([-0.003, 0.004, 0.020]);
    assert_eq!(beside.voxel, Voxel::Free);
    assert!(beside.bound <= 0.005 && beside.bound > 0.00498, "{beside:?}");
    assert_eq!(field.voxel([f32::NAN; 3]).voxel, Voxel::Free);
    // A distance field has no voxels.
    let aligned = Aligned::new(GOLDEN);
    let image = SceneImage::open(aligned.bytes()).unwrap();
    assert!(!image.shape(0).field.is_occupancy());
    assert_eq!(image.shape(0).field.voxel([0.001; 3]).voxel, Voxel::Free);
}

#[test]
fn golden_scene_reads_back() {
    let aligned = Aligned::new(GOLDEN);
    let image = SceneImage::open(aligned.bytes()).unwrap();
    assert_eq!(image.header().layout, LAYOUT_VERSION);
    assert_eq!((image.parts().len(), image.shape_count()), (3, 2));
    assert_eq!(image.parts()[1].flags, PART_GRABBABLE);
    assert_eq!(image.shape_of_part(2).record.flags, SHAPE_LEAKY);

    let shape = image.shape_of_part(1);
    assert_eq!(
        (shape.nodes.len(), shape.points.len(), shape.faces.len()),
        (3, 3, 2)
    );
    assert_eq!(oct_decode(shape.points[0].normal), [0.0, 0.0, 1.0]);
    let [node] = shape.edge_nodes else {
        panic!("{:?}", shape.edge_nodes)
    };
    let [edge] = node.points(shape.edges) else {
        panic!("{:?}", shape.edges)
    };
    assert_eq!(
        (edge.faces, edge.is_straight(), oct_decode(edge.normals[1])),
        ([0, 1], true, [0.0, -1.0, 0.0])
    );
    assert!(image.shape(1).edges.is_empty());
    let spans: Vec<u16> = shape.points.iter().map(|p| p.span).collect();
    assert_eq!(spans, [NO_SPAN, NO_SPAN, 0]);
    assert_eq!((shape.spans.len(), shape.spans[0].along), (1, [0.002, 0.0, 0.0]));
    let near = |x: f32, y: f32, z: f32| match shape.field.lookup([x, y, z]) {
        Lookup::Near(sample) => sample,
        far => panic!("{far:?}"),
    };
    let sample = near(0.0015, 0.003, 0.0063);
    assert!((sample.distance - 0.0023).abs() < 1e-7, "{sample:?}");
    assert!((sample.gradient[2] - 1.0).abs() < 1e-6 && sample.gradient[0] == 0.0);
    assert_eq!((sample.face, near(0.0061, 0.003, 0.001).face), (0, 1));
    let above = shape.field.lookup([0.004, 0.004, 0.012]);
    assert!(matches!(above, Lookup::Far { inside: false, bound } if (bound - 0.004).abs() < 1e-9));
    let beside = shape.field.bound([-0.003, 0.004, 0.020]);
    // 3 mm beside and 4 mm above the box of 8 × 8 × 16 mm; the surface is at least the padding away from each of its sides.
    let record = shape.field.record();
    let padding = record.padding() * record.cell;
    // 4 mm from both sides.
    let far = (0.003 + padding)
        .hypot(0.004 + padding)
        .hypot((padding - 0.004).max(0.0));
    assert!(
        padding > 0.0 && beside <= far && beside > 0.996 * far,
        "{beside} {far}"
    );

    let surfaces = image.shape(1).surfaces();
    assert!(matches!(surfaces.get(1), Some(Surface::Face(_))));
    assert!(matches!(surfaces.get(2), Some(Surface::Patch(patch)) if patch.height[9] == 16.0));
    assert!(surfaces.get(3).is_none() && image.shape(0).surfaces().get(2).is_none());
    assert_eq!([0, 2, 3].map(|i| surfaces.face_of(i)), [0, 1, NO_FACE]);

    let bytes = image.shape(1).field;
    let Lookup::Near(sample) = bytes.lookup([0.0045, 0.001, 0.001]) else {
        panic!("stored");
    };
    assert!((sample.distance - 0.0025).abs() < 1e-7);
    assert_eq!(sample.face, 1);
    let face = |x: f32| match bytes.lookup([x, 0.0005, 0.0005]) {
        Lookup::Near(sample) => sample.face,
        far => panic!("{far:?}"),
    };
    assert_eq!([face(0.0085), face(0.0095), face(0.0105)], [0, 1, NO_FACE]);
}

/// A position that is not finite, or extremely far away, gives a bound, never a panic and never NaN.
#[test]
fn odd_positions_are_far_outside() {
    let aligned = Aligned::new(GOLDEN);
    let image = SceneImage::open(aligned.bytes()).unwrap();
    for odd in [f32::NAN, f32::INFINITY, -f32::INFINITY, f32::MAX, f32::MIN, 1e25] {
        for axis in 0..3 {
            let mut p = [0.004f32; 3];
            p[axis] = odd;
            match image.shape(0).field.lookup(p) {
                Lookup::Far { inside: false, bound } => {
                    assert!(bound >= 0.0 && bound.is_finite(), "{bound} at {p:?}");
                    assert!(!odd.is_nan() || bound < 1e-12);
                }
                other => panic!("{other:?} at {p:?}"),
            }
        }
    }
    assert!(matches!(
        image.shape(0).field.lookup([-1e-30, 0.001, 0.001]),
        Lookup::Far { inside: false, .. }
    ));
}
