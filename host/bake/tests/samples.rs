//! Samples are stored only where they are interpolated: without the others the tick gets the same distances, contacts and forces, to the bit.

use std::ops::ControlFlow;
use std::path::Path;

use crate::common::*;
use glam::DAffine3;
use mortise_bake::{BakeOptions, Grabbable, Samples, bake};
use mortise_brep::{CadModel, load_step};
use mortise_haptics::{Pose, Prober, Quat, Settings, Vec3, rendered_distance};
use mortise_protocol::image::{Place, SceneImage};

/// Places at which the fields of each shape are compared, and poses of the second part in the first.
const PLACES: usize = 60_000;
const POSES: usize = 60;

fn baked(model: &CadModel, cell_mm: f64, samples: Samples) -> AlignedBytes {
    let options = BakeOptions {
        cell_mm: Some(cell_mm),
        samples,
        grabbable: Grabbable::All,
        image_limit_bytes: 16 << 20,
        ..BakeOptions::default()
    };
    let baked = bake(model, &options, &|_| ControlFlow::Continue(())).expect("it bakes");
    AlignedBytes::new(&baked.image)
}

/// Fractions, evenly spread.
fn spread(i: usize) -> [f32; 6] {
    let steps = [0.898_654, 0.807_578, 0.725_732, 0.652_182, 0.586_086, 0.526_690];
    steps.map(|step| ((i as f64 + 0.5) * step).fract() as f32)
}

/// Compares both images of `model`; returns the places without samples and all in cells, and the contacts.
fn compare(model: &CadModel, cell_mm: f64) -> (usize, usize, usize) {
    let all = baked(model, cell_mm, Samples::Everywhere);
    let few = baked(model, cell_mm, Samples::WhereInterpolated);
    assert!(few.bytes().len() <= all.bytes().len());
    let [all, few] = [&all, &few].map(|bytes| SceneImage::open(bytes.bytes()).expect("it opens"));
    let (mut without, mut cells) = (0, 0);
    for number in 0..all.shape_count() {
        let (a, b) = (all.shape(number), few.shape(number));
        let record = a.field.record();
        for i in 0..PLACES {
            let u = spread(i);
            let p = Vec3::from_array(core::array::from_fn(|axis| {
                record.origin[axis] + record.cell * 8.0 * f32::from(record.brick_dims[axis]) * u[axis]
            }));
            assert_eq!(rendered_distance(&a, p), rendered_distance(&b, p), "{p}");
            let Place::Cell(cell) = b.field.place(p.to_array()) else {
                continue;
            };
            cells += 1;
            if cell.has_samples() {
                let point = p.to_array();
                assert_eq!(a.field.lookup(point), b.field.lookup(point), "{p}");
            } else {
                without += 1;
            }
        }
    }
    let mut contacts = 0;
    let [radius, other] = [1, 0].map(|part| all.shape_of_part(part).record.radius);
    let (mut of_all, mut of_few) = (Prober::new(), Prober::new());
    for i in 0..POSES {
        let u = spread(i).map(|u| 2.0 * u - 1.0);
        let turn = Quat::from_xyzw(0.3 * u[3], 0.3 * u[4], 0.3 * u[5], 1.0).normalize();
        let at = Vec3::new(u[0], u[1], u[2]) * (0.6 * (radius + other));
        let pose = Pose::from_arrays(at.to_array(), turn.to_array());
        let contact = Settings::default().contact;
        let a = of_all.probe(&all, 1, 0, &pose, &contact).expect("a pose");
        let b = of_few.probe(&few, 1, 0, &pose, &contact).expect("a pose");
        // Sums depend on the order in which leaves are found, which bounds by samples change.
        let off = (a.wrench.force - b.wrench.force).length();
        assert!(off <= 1e-6 * a.wrench.force.length(), "pose {i}: {a:?} {b:?}");
        assert_eq!(a.contacts, b.contacts, "pose {i}");
        contacts += usize::from(a.contacts);
    }
    (without, cells, contacts)
}

#[test]
fn a_pair_of_analytic_parts_needs_no_samples() {
    let model = model(vec![
        (
            "block",
            block_with_hole([25.0, 20.0], 30.0, 9.375, 32),
            DAffine3::IDENTITY,
        ),
        ("peg", peg(9.365, 60.0, 32), DAffine3::IDENTITY),
    ]);
    for cell_mm in [0.7, 3.0, 9.0] {
        let (without, cells, contacts) = compare(&model, cell_mm);
        assert!(
            without == cells && cells > 1_000 && contacts > 20,
            "{cell_mm}: {without} {cells} {contacts}"
        );
    }
}

/// A shared free-form pair, if present: some of its bricks keep their samples.
#[test]
fn a_free_form_pair_keeps_samples_where_they_are_interpolated() {
    let root = std::env::var_os("MORTISE_SHARED").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared"),
        Into::into,
    );
    let file = root.join("cad/09_free_form/ellipsoid_socket.step");
    if !file.exists() {
        println!("skipped: no {}", file.display());
        return;
    }
    let (without, cells, contacts) = compare(&load_step(file).expect("a model"), 0.7);
    println!("{without} of {cells} places without samples");
    assert!(
        without < cells && contacts > 20,
        "{without} of {cells}, {contacts} contacts"
    );
}
