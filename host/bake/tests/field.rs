//! Sampled field against the closed form, through the same look-up as the board's.

mod common;

use common::*;
use glam::{DAffine3, DVec3};
use mortise_bake::{BakeOptions, Baked, SampleFormat, bake};
use mortise_brep::Shape;
use mortise_protocol::image::{Lookup, SceneImage};
use proptest::prelude::*;
use std::ops::ControlFlow;

fn bake_one(shape: Shape, cell_mm: f64, format: SampleFormat, band_cells: f64) -> Baked {
    let options = BakeOptions {
        cell_mm: Some(cell_mm),
        format,
        band_cells,
        image_limit_bytes: 16 << 20,
        ..BakeOptions::default()
    };
    bake(
        &model(vec![("part", shape, DAffine3::IDENTITY)]),
        &options,
        &|_| ControlFlow::Continue(()),
    )
    .unwrap()
}

fn meters(p: DVec3) -> [f32; 3] {
    (p / 1000.0).as_vec3().to_array()
}

/// Back to the millimetres the board really saw.
fn seen(p: [f32; 3]) -> DVec3 {
    DVec3::from_array(p.map(f64::from)) * 1000.0
}

/// f32 rounding of a position up to 0.1 m is 4 nm, of the index arithmetic about 1e-5 cells.
const BOARD_MM: f64 = 2e-5;

thread_local! {
    static BLOCK: Baked = bake_one(block_with_hole([25.0, 20.0], 30.0, 9.375, 32), 0.5, SampleFormat::Int16, 2.0);
    static BLOCK8: Baked = bake_one(block_with_hole([25.0, 20.0], 30.0, 9.375, 32), 0.5, SampleFormat::Int8, 1.0);
    static SPHERE: Baked = bake_one(sphere(10.0, 24), 0.7, SampleFormat::Int16, 2.0);
}

fn block(p: DVec3) -> f64 {
    block_distance([25.0, 20.0], 30.0, 9.375, p)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    /// On the hole's wall: cell²/(8R), the second-order term of interpolation, twice over (both directions across), plus half a step.
    #[test]
    fn interpolation_on_the_hole_is_within_the_bound(off in -0.4f64..0.4, a in 0.0f64..6.283, z in 2.0f64..28.0) {
        for (baked, wide) in [(&BLOCK, 0.5), (&BLOCK8, 0.5)] {
            baked.with(|b| {
                let aligned = AlignedBytes::new(&b.image);
                let image = SceneImage::open(aligned.bytes()).unwrap();
                let r = 9.375 + off;
                let p = meters(DVec3::new(r * a.cos(), r * a.sin(), z));
                let Lookup::Near(sample) = image.shape(0).field.lookup(p) else {
                    return Err(TestCaseError::fail("not stored"));
                };
                let error = f64::from(sample.distance) * 1000.0 - block(seen(p));
                // Curvature of the distance is 1/r across, 0 along: h²/8 · (∂xx + ∂yy) = h²/(8r); r shrinks by the cell's diagonal.
                let bound = wide * wide / (8.0 * (r - 0.71)) + 0.5 * b.report.shapes[0].scale_mm + BOARD_MM;
                prop_assert!(error.abs() <= bound, "{error} > {bound}");
                let g = DVec3::from_array(sample.gradient.map(f64::from));
                let n = -DVec3::new(a.cos(), a.sin(), 0.0);
                // First order in the cell: h/(2R) each way, plus steps of the samples over a cell.
                prop_assert!(g.distance(n) < wide / r + 4.0 * b.report.shapes[0].scale_mm / wide, "{g} {n}");
                prop_assert_eq!(sample.face, 6);
                Ok(())
            })?;
        }
    }

    /// Planes are exact but for the steps of the samples; edges on sample layers are too.
    #[test]
    fn planes_are_exact(x in -24.0f64..24.0, y in 11.0f64..19.0, off in -0.4f64..0.9) {
        BLOCK.with(|b| {
            let aligned = AlignedBytes::new(&b.image);
            let image = SceneImage::open(aligned.bytes()).unwrap();
            for p in [DVec3::new(x, y, 30.0 + off), DVec3::new(x, 20.0 + off, y), DVec3::new(25.0 + off, y - 15.0, 15.0)] {
                let p = meters(p);
                let Lookup::Near(sample) = image.shape(0).field.lookup(p) else {
                    return Err(TestCaseError::fail("not stored"));
                };
                let error = f64::from(sample.distance) * 1000.0 - block(seen(p));
                prop_assert!(error.abs() <= b.report.shapes[0].scale_mm + BOARD_MM, "{error} at {:?}", p);
            }
            Ok(())
        })?;
    }

    /// Everything within the band is stored; whatever is not has the right sign and a true lower bound.
    #[test]
    fn far_bounds_are_true(p in prop::array::uniform3(-45.0f64..45.0)) {
        BLOCK.with(|b| check_bound(b, block, DVec3::from_array(p), 2.0 * 0.5))?;
        SPHERE.with(|b| check_bound(b, |p| p.length() - 10.0, DVec3::from_array(p), 2.0 * 0.7))?;
    }
}

fn check_bound(b: &Baked, exact: impl Fn(DVec3) -> f64, p: DVec3, band_mm: f64) -> Result<(), TestCaseError> {
    let aligned = AlignedBytes::new(&b.image);
    let image = SceneImage::open(aligned.bytes()).unwrap();
    let p = meters(p);
    let d = exact(seen(p));
    match image.shape(0).field.lookup(p) {
        Lookup::Near(_) => {}
        Lookup::Far { inside, bound } => {
            prop_assert!(d.abs() >= band_mm - BOARD_MM, "not stored at {d}");
            prop_assert_eq!(inside, d < 0.0);
            prop_assert!(f64::from(bound) * 1000.0 <= d.abs() + BOARD_MM, "{bound} > {d}");
        }
    }
    Ok(())
}

/// The far bounds are worth having: on average within two cells and a tenth of the true distance of the brick.
#[test]
fn far_bounds_are_tight() {
    SPHERE.with(|b| {
        let aligned = AlignedBytes::new(&b.image);
        let image = SceneImage::open(aligned.bytes()).unwrap();
        let field = image.shape(0).field;
        let center = field.bound([0.0; 3]);
        // The brick about the centre reaches at most its diagonal (8·0.7·√3 = 9.7 mm) out; its bound is that of its farthest corner.
        assert!(center < 0.0, "{center}");
        let far = f64::from(field.bound([0.5, 0.0, 0.0])) * 1000.0;
        assert!(far > 480.0, "{far}");
    });
}

/// The same bytes on one thread and on three.
#[test]
fn bytes_do_not_depend_on_threads() {
    let make = |threads: usize| {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap()
            .install(|| bake_one(peg(8.875, 20.0, 24), 0.8, SampleFormat::Int16, 2.0).image)
    };
    assert!(make(1) == make(3));
}

/// Interpolated values over a whole brick are never clamped in 16 bits, also in the far corners of stored bricks.
#[test]
fn sixteen_bits_hold_whole_bricks() {
    SPHERE.with(|b| {
        let aligned = AlignedBytes::new(&b.image);
        let image = SceneImage::open(aligned.bytes()).unwrap();
        let field = image.shape(0).field;
        let mut worst = 0.0f64;
        let mut tested = 0;
        for i in 0..40_000u32 {
            let u = |base: f64| (f64::from(i) * base).fract() * 40.0 - 20.0;
            let p = meters(DVec3::new(u(0.819_172_5), u(0.671_043_6), u(0.549_700_5)));
            if let Lookup::Near(s) = field.lookup(p) {
                let r = seen(p).length();
                if r > 2.0 {
                    tested += 1;
                    worst = worst.max(
                        (f64::from(s.distance) * 1000.0 - (r - 10.0)).abs()
                            - 0.7 * 0.7 / (4.0 * (r - 1.3)).max(0.1),
                    );
                }
            }
        }
        assert!(tested > 1000);
        // 2·h²/(8r): a sphere curves both ways.
        assert!(worst < 1e-3, "{worst}");
    });
}
