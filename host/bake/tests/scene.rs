//! Whole scenes: shared data, grabbable parts, fit to the limit, rejected input.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};

use crate::common::*;
use glam::{DAffine3, DQuat, DVec3};
use mortise_bake::{BakeError, BakeOptions, Baked, Grabbable, SampleFormat, Samples, Stage, bake};
use mortise_brep::{CadModel, Shape};
use mortise_protocol::image::{PART_GRABBABLE, SHAPE_LEAKY, SceneImage};

fn coarse() -> BakeOptions {
    BakeOptions {
        cell_mm: Some(2.0),
        ..BakeOptions::default()
    }
}

fn run(model: &CadModel, options: &BakeOptions) -> Result<Baked, BakeError> {
    bake(model, options, &|_| ControlFlow::Continue(()))
}

fn pair() -> CadModel {
    let turned = DAffine3::from_rotation_translation(DQuat::from_rotation_y(0.5), DVec3::new(0.0, 0.0, 80.0));
    model(vec![
        (
            "block",
            block_with_hole([25.0, 25.0], 40.0, 9.375, 24),
            DAffine3::IDENTITY,
        ),
        ("peg", peg(8.875, 60.0, 24), turned),
    ])
}

#[test]
fn parts_are_placed_in_meters() {
    let baked = run(&pair(), &coarse()).unwrap();
    let aligned = AlignedBytes::new(&baked.image);
    let image = SceneImage::open(aligned.bytes()).unwrap();
    assert_eq!(baked.report.image_bytes, baked.image.len());
    let parts = image.parts();
    assert_eq!(parts.len(), 2);
    assert_eq!((parts[0].flags, parts[1].flags), (0, PART_GRABBABLE));
    assert_eq!(parts[1].position, [0.0, 0.0, 0.08]);
    assert!((parts[1].orientation[1] - 0.25f32.sin()).abs() < 1e-7);
    let peg = image.shape_of_part(1);
    assert!(
        (peg.record.volume - 1.484e-5).abs() < 2e-7,
        "{}",
        peg.record.volume
    );
    // The sphere around the shape contains all its points and its whole surface.
    for i in 0..image.shape_count() {
        let shape = image.shape(i);
        let c = shape.record.center;
        for p in shape.points {
            let d: f32 = (0..3).map(|k| (p.position[k] - c[k]).powi(2)).sum();
            assert!(d.sqrt() <= shape.record.radius);
        }
    }
}

/// The default for a pair of this size is 0.5 mm cells, and the image fits half a megabyte.
#[test]
fn the_pair_fits_half_a_megabyte() {
    let baked = run(&pair(), &BakeOptions::default()).unwrap();
    for shape in &baked.report.shapes {
        assert!((shape.cell_mm - 0.5).abs() < 1e-6, "{}", shape.cell_mm);
    }
    assert!(baked.image.len() <= 512 << 10, "{}", baked.image.len());
    let total: usize = baked.report.shapes.iter().map(|s| s.bytes.total()).sum();
    assert_eq!(baked.report.bytes.total(), total);
    assert!(baked.image.len() >= total && baked.image.len() < total + 2048);
}

/// A smaller limit gives coarser cells, and most of the allowed bytes are used.
#[test]
fn free_cells_fill_the_room_there_is() {
    for limit in [48 << 10, 90 << 10] {
        let options = BakeOptions {
            image_limit_bytes: limit,
            ..BakeOptions::default()
        };
        let baked = run(&pair(), &options).unwrap();
        assert!(baked.image.len() as u64 <= limit);
        assert!(
            baked.image.len() as u64 > limit / 2,
            "{} of {limit}",
            baked.image.len()
        );
    }
}

#[test]
fn identical_shapes_are_stored_once() {
    let at = |x: f64| DAffine3::from_translation(DVec3::X * x);
    // Two of them, so that the pointshell expects a partner of the same shape.
    let two = run(
        &model(vec![
            ("a", peg(5.0, 20.0, 24), at(0.0)),
            ("b", peg(5.0, 20.0, 24), at(30.0)),
        ]),
        &coarse(),
    )
    .unwrap();
    // Once as the same shape placed twice, once as an equal shape written twice.
    let mut twice = model(vec![
        ("a", peg(5.0, 20.0, 24), at(0.0)),
        ("b", peg(5.0, 20.0, 24), at(30.0)),
    ]);
    let mut again = twice.parts[0].clone();
    again.name = "c".to_owned();
    twice.parts.push(again);
    let baked = run(&twice, &coarse()).unwrap();
    assert_eq!((baked.report.parts.len(), baked.report.shapes.len()), (3, 1));
    assert_eq!(baked.report.parts[1].bytes, 0);
    // One more part record of 36 bytes.
    assert_eq!(baked.image.len(), two.image.len() + 36);
}

#[test]
fn grabbable_parts_follow_the_rule() {
    let flags = |rule: Grabbable| {
        let options = BakeOptions {
            grabbable: rule,
            ..coarse()
        };
        run(&pair(), &options).map(|b| b.report.parts.iter().map(|p| p.grabbable).collect::<Vec<_>>())
    };
    assert_eq!(flags(Grabbable::AllButLargest).unwrap(), [false, true]);
    assert_eq!(flags(Grabbable::All).unwrap(), [true, true]);
    assert_eq!(
        flags(Grabbable::Named(vec!["block".to_owned()])).unwrap(),
        [true, false]
    );
    let error = flags(Grabbable::Named(vec!["bolt".to_owned()])).unwrap_err();
    assert_eq!(
        error.to_string(),
        "no part is named \"bolt\"; the model has: block, peg"
    );
}

#[test]
fn a_leaky_shape_is_reported_and_flagged() {
    let mut shape = peg(5.0, 20.0, 24);
    shape.mesh.triangles.remove(30);
    shape.mesh.triangle_face.remove(30);
    let baked = run(
        &model(vec![("shell", finish(shape), DAffine3::IDENTITY)]),
        &coarse(),
    )
    .unwrap();
    let aligned = AlignedBytes::new(&baked.image);
    let image = SceneImage::open(aligned.bytes()).unwrap();
    assert_eq!(image.shape(0).record.flags, SHAPE_LEAKY);
    assert_eq!(baked.report.shapes[0].open_edges, 3);
    assert!(baked.report.warnings[0].contains("\"shell\" is not closed (3 open mesh edges)"));
    let json = serde_json::to_value(&baked.report).unwrap();
    assert_eq!(json["shapes"][0]["open_edges"], 3);
    assert_eq!(json["shapes"][0]["format"], "int16");
}

/// A part that is only wires or points is skipped with a warning; each part of the image states its index in the model.
#[test]
fn a_part_without_surface_is_left_out() {
    let mut model = pair();
    model.shapes.insert(0, Shape::default());
    let mut wire = model.parts[0].clone();
    for part in &mut model.parts {
        part.shape += 1;
    }
    wire.name = "wire".to_owned();
    model.parts.insert(0, wire);
    let baked = run(&model, &coarse()).unwrap();
    assert_eq!(baked.report.parts[0].model_part, 1);
    assert!(baked.report.warnings[0].contains("\"wire\" has no surface"));

    model.parts.truncate(1);
    assert_eq!(
        run(&model, &coarse()).unwrap_err(),
        BakeError::NothingToBake { parts: 1 }
    );
}

#[test]
fn what_cannot_be_baked_is_refused_in_one_line() {
    let mut broken = pair();
    broken.shapes[1].mesh.vertices[0].x = f64::NAN;
    let error = run(&broken, &coarse()).unwrap_err().to_string();
    assert_eq!(
        error,
        "part \"peg\" has broken geometry (a mesh vertex is not finite): repair or re-export it"
    );
    let mut broken = pair();
    broken.shapes[0].mesh.triangles[3][1] = 9999;
    assert!(matches!(
        run(&broken, &coarse()),
        Err(BakeError::BrokenGeometry { .. })
    ));
    let mut broken = pair();
    broken.parts[0].shape = 7;
    assert!(matches!(
        run(&broken, &coarse()),
        Err(BakeError::BrokenGeometry { .. })
    ));

    for (options, word) in [
        (
            BakeOptions {
                cell_mm: Some(f64::NAN),
                ..BakeOptions::default()
            },
            "cell_mm",
        ),
        (
            BakeOptions {
                band_cells: 0.5,
                ..BakeOptions::default()
            },
            "band_cells",
        ),
        (
            BakeOptions {
                epsilon_mm: Some(0.0),
                ..BakeOptions::default()
            },
            "epsilon_mm",
        ),
        // More than a million grid entries.
        (
            BakeOptions {
                cell_mm: Some(0.02),
                ..BakeOptions::default()
            },
            "use cells of at least",
        ),
        (
            BakeOptions {
                cell_mm: Some(0.5),
                image_limit_bytes: 50_000,
                ..BakeOptions::default()
            },
            "does not fit into 50000",
        ),
        (
            BakeOptions {
                image_limit_bytes: 1000,
                ..BakeOptions::default()
            },
            "does not fit into 1000",
        ),
    ] {
        let error = run(&pair(), &options).unwrap_err().to_string();
        assert!(error.contains(word) && !error.contains('\n'), "{error}");
    }
}

#[test]
fn progress_is_reported_and_can_stop() {
    let calls = AtomicUsize::new(0);
    let last = std::sync::Mutex::new(None);
    let seen = |p: mortise_bake::Progress<'_>| {
        calls.fetch_add(1, Ordering::Relaxed);
        assert!((0.0..=1.0).contains(&p.fraction) && p.shape.0 <= p.shape.1);
        *last.lock().unwrap() = Some((p.stage, p.fraction));
        ControlFlow::Continue(())
    };
    bake(&pair(), &coarse(), &seen).unwrap();
    assert!(calls.load(Ordering::Relaxed) > 10);
    assert_eq!(*last.lock().unwrap(), Some((Stage::Image, 1.0)));

    let after = AtomicUsize::new(0);
    let stop = |_: mortise_bake::Progress<'_>| {
        if after.fetch_add(1, Ordering::Relaxed) > 20 {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    };
    assert_eq!(bake(&pair(), &coarse(), &stop).unwrap_err(), BakeError::Cancelled);
}

/// int8 halves the samples.
#[test]
fn bytes_go_with_the_format() {
    let bytes = |format: SampleFormat| {
        let options = BakeOptions {
            format,
            samples: Samples::Everywhere,
            ..coarse()
        };
        run(&pair(), &options).unwrap().report.shapes[0].bytes.samples as f64
    };
    let ratio = bytes(SampleFormat::Int16) / bytes(SampleFormat::Int8);
    // Coarser steps make a few more bricks equal.
    assert!((1.9..3.0).contains(&ratio), "{ratio}");
}
