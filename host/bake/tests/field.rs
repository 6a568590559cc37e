//! Sampled field against the closed form, through the board's own query.

use std::f64::consts::TAU;
use std::ops::ControlFlow;
use std::sync::LazyLock;

use crate::common::*;
use glam::{DAffine3, DVec3};
use mortise_bake::{BakeOptions, BakeReport, SampleFormat, Samples, bake};
use mortise_brep::Shape;
use mortise_protocol::image::{Field, Lookup, SceneImage};
use proptest::prelude::*;

struct Baked {
    image: SceneImage<'static>,
    report: BakeReport,
    bytes: &'static [u8],
}

impl Baked {
    fn one(shape: Shape, cell_mm: f64, format: SampleFormat, band_cells: f64) -> Self {
        let options = BakeOptions {
            cell_mm: Some(cell_mm),
            format,
            band_cells,
            samples: Samples::Everywhere,
            image_limit_bytes: 16 << 20,
            ..BakeOptions::default()
        };
        let baked = bake(
            &model(vec![("part", shape, DAffine3::IDENTITY)]),
            &options,
            &|_| ControlFlow::Continue(()),
        )
        .unwrap();
        let bytes = Box::leak(Box::new(AlignedBytes::new(&baked.image))).bytes();
        Self {
            image: SceneImage::open(bytes).unwrap(),
            report: baked.report,
            bytes,
        }
    }

    fn field(&self) -> Field<'static> {
        self.image.shape(0).field
    }

    fn step_mm(&self) -> f64 {
        self.report.shapes[0].scale_mm
    }
}

fn meters(p: DVec3) -> [f32; 3] {
    (p / 1000.0).as_vec3().to_array()
}

/// The position in millimetres that the board computes.
fn seen(p: [f32; 3]) -> DVec3 {
    DVec3::from_array(p.map(f64::from)) * 1000.0
}

/// Rounding in f32: 4 nm for a position up to 0.1 m, about 1e-5 cells for the index arithmetic.
const BOARD_MM: f64 = 2e-5;
const CELL: f64 = 0.5;

fn block_shape() -> Shape {
    block_with_hole([25.0, 20.0], 30.0, 9.375, 32)
}

static BLOCK: LazyLock<Baked> = LazyLock::new(|| Baked::one(block_shape(), CELL, SampleFormat::Int16, 2.0));
static BLOCK8: LazyLock<Baked> = LazyLock::new(|| Baked::one(block_shape(), CELL, SampleFormat::Int8, 1.0));
static SPHERE: LazyLock<Baked> =
    LazyLock::new(|| Baked::one(sphere(10.0, 24), 0.7, SampleFormat::Int16, 2.0));

fn block(p: DVec3) -> f64 {
    block_distance([25.0, 20.0], 30.0, 9.375, p)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20_000))]

    /// On the hole's wall: the second-order error of interpolation, cell²/8 times the sum of second derivatives, plus half a step.
    #[test]
    fn interpolation_on_the_hole_is_within_the_bound(off in -0.4f64..0.4, a in 0.0f64..TAU, z in 2.0f64..28.0) {
        for b in [&*BLOCK, &*BLOCK8] {
            let r = 9.375 + off;
            let p = meters(DVec3::new(r * a.cos(), r * a.sin(), z));
            let Lookup::Near(sample) = b.field().lookup(p) else {
                return Err(TestCaseError::fail("not stored"));
            };
            let error = f64::from(sample.distance) * 1000.0 - block(seen(p));
            // The distance has curvature 1/r across and none along; within the cell r can be smaller by a cell's diagonal.
            let bound = CELL * CELL / (8.0 * (r - 0.71)) + 0.5 * b.step_mm() + BOARD_MM;
            prop_assert!(error.abs() <= bound, "{error} > {bound}");
            let g = DVec3::from_array(sample.gradient.map(f64::from));
            let n = -DVec3::new(a.cos(), a.sin(), 0.0);
            // First order in the cell: h/(2R) each way, plus steps of the samples over a cell.
            prop_assert!(g.distance(n) < CELL / r + 4.0 * b.step_mm() / CELL, "{g} {n}");
            prop_assert_eq!(sample.face, 6);
        }
    }

    /// Planes are exact except for the quantisation of the samples.
    #[test]
    fn planes_are_exact(x in -24.0f64..24.0, y in 11.0f64..19.0, off in -0.9f64..0.9) {
        for p in [DVec3::new(x, y, 30.0 + off), DVec3::new(x, 20.0 + off, y), DVec3::new(25.0 + off, y - 15.0, 15.0)] {
            let p = meters(p);
            let Lookup::Near(sample) = BLOCK.field().lookup(p) else {
                return Err(TestCaseError::fail("not stored"));
            };
            // Near another face the nearer one curves the field.
            let inner = 20.0 - (y + off.abs());
            if inner > 2.0 * CELL {
                let error = f64::from(sample.distance) * 1000.0 - block(seen(p));
                prop_assert!(error.abs() <= BLOCK.step_mm() + BOARD_MM, "{error} at {:?}", p);
            }
        }
    }

    /// Everything within the band is stored; everything else has the right sign and a true lower bound.
    #[test]
    fn far_bounds_are_true(p in prop::array::uniform3(-45.0f64..45.0)) {
        check_bound(&BLOCK, block, DVec3::from_array(p))?;
        check_bound(&BLOCK8, block, DVec3::from_array(p))?;
        check_bound(&SPHERE, |p| p.length() - 10.0, DVec3::from_array(p))?;
    }

    /// Within the band no clamped sample is used: the error of a sphere's field is bounded by its curvature everywhere there.
    #[test]
    fn the_whole_band_is_sampled_exactly(d in -1.39f64..1.39, u in prop::array::uniform3(-1.0f64..1.0)) {
        let u = DVec3::from_array(u);
        prop_assume!(u.length() > 0.1);
        let p = meters(u.normalize() * (10.0 + d));
        let Lookup::Near(sample) = SPHERE.field().lookup(p) else {
            return Err(TestCaseError::fail("not stored"));
        };
        let r = seen(p).length();
        let error = f64::from(sample.distance) * 1000.0 - (r - 10.0);
        // A sphere has curvature 1/r in both directions; within the cell r can be smaller by a cell's diagonal.
        let bound = 2.0 * 0.7 * 0.7 / (8.0 * (r - 1.22)) + 0.5 * SPHERE.step_mm() + BOARD_MM;
        prop_assert!(error.abs() <= bound, "{error} > {bound}");
    }
}

fn check_bound(b: &Baked, exact: impl Fn(DVec3) -> f64, p: DVec3) -> Result<(), TestCaseError> {
    let p = meters(p);
    let d = exact(seen(p));
    let record = b.field().record();
    let band_mm = f64::from(record.band - record.cell * 3f32.sqrt()) * 1000.0;
    if let Lookup::Far { inside, bound } = b.field().lookup(p) {
        prop_assert!(d.abs() >= band_mm - BOARD_MM, "not stored at {d}");
        prop_assert_eq!(inside, d < 0.0);
        prop_assert!(f64::from(bound) * 1000.0 <= d.abs() + BOARD_MM, "{bound} > {d}");
    }
    Ok(())
}

/// The far bounds are tight: at most a cell and a half plus a tenth below the distance of the brick's nearest point.
#[test]
fn far_bounds_are_tight() {
    let field = SPHERE.field();
    let record = field.record();
    let brick_mm = f64::from(record.cell) * 8000.0;
    let origin = DVec3::from_array(record.origin.map(f64::from)) * 1000.0;
    let mut empty = 0;
    for z in 0..record.brick_dims[2] {
        for y in 0..record.brick_dims[1] {
            for x in 0..record.brick_dims[0] {
                let lo = origin + DVec3::new(f64::from(x), f64::from(y), f64::from(z)) * brick_mm;
                let Lookup::Far { inside, bound } = field.lookup(meters(lo + brick_mm / 2.0)) else {
                    continue;
                };
                empty += 1;
                let hi = lo + brick_mm;
                let true_bound = if inside {
                    10.0 - lo.abs().max(hi.abs()).length()
                } else {
                    DVec3::ZERO.clamp(lo, hi).length() - 10.0
                };
                let bound = f64::from(bound) * 1000.0;
                assert!(bound <= true_bound + BOARD_MM);
                assert!(bound >= 0.9 * true_bound - 1.6 * 0.7, "{bound} for {true_bound}");
            }
        }
    }
    assert!(empty > 0);
}

/// Outside the grid the distance to its box bounds the distance to the surface.
#[test]
fn beyond_the_grid_the_box_is_the_bound() {
    let far = f64::from(SPHERE.field().bound([0.5, 0.0, 0.0])) * 1000.0;
    assert!(far > 480.0 && far < 490.0, "{far}");
}

/// One thread and three give the same bytes.
#[test]
fn bytes_do_not_depend_on_threads() {
    let make = |threads: usize| {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap()
            .install(|| Baked::one(peg(8.875, 20.0, 24), 0.8, SampleFormat::Int16, 2.0).bytes)
    };
    assert!(make(1) == make(3));
}

/// A straight bore and flat sides repeat: equal bricks are stored once.
#[test]
fn repeated_bricks_are_stored_once() {
    let shape = &BLOCK.report.shapes[0];
    assert!(
        4 * shape.bricks < shape.stored_entries,
        "{} of {}",
        shape.bricks,
        shape.stored_entries
    );
}
