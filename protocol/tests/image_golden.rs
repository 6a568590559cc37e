//! The scene image's layout is frozen: bytes made by hand, kept in `tests/golden`, read back through the board's look-up.

mod scene;

use mortise_protocol::image::*;
use scene::Aligned;

const GOLDEN: &[u8] = include_bytes!("golden/tiny.scene");

/// A change of layout or meaning shows here. Count up `LAYOUT_VERSION`, then write the file anew with `MORTISE_BLESS=1`.
#[test]
fn golden_bytes_have_not_changed() {
    let made = scene::bytes();
    if std::env::var_os("MORTISE_BLESS").is_some() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden/tiny.scene");
        std::fs::write(path, &made).expect("the golden file can be written");
        return;
    }
    assert!(
        made == GOLDEN,
        "the layout changed: raise LAYOUT_VERSION and run with MORTISE_BLESS=1"
    );
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
    // 3 mm beside and 4 mm above the box of 8 × 8 × 16 mm.
    assert!(beside <= 0.005 && beside > 0.00498, "{beside}");

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

/// A position that is not finite, or far beyond anything, gives a bound, never a panic and never NaN.
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
