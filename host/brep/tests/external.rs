//! Assemblies whose parts are in separate files beside them: they read like the same assembly in one file, and nothing outside the folder is read.
//! Reads in-process.

use crate::support::{self, Product, StepText};
use glam::{DAffine3, DQuat, DVec3};
use mortise_brep::{BrepError, CadModel, load_step};
use std::path::Path;

const SUBS: usize = 4;
const PARTS: usize = 8;
/// Body of a length unit entity and its size in millimetres.
const UNITS: [(&str, f64); 3] = [
    ("(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.))", 1.0),
    (
        "LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(0.0254),#SI);(CONVERSION_BASED_UNIT('INCH',#MEASURE)LENGTH_UNIT()NAMED_UNIT(#SI))",
        25.4,
    ),
    ("(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT($,.METRE.))", 1000.0),
];

/// Size of part `i`, mm.
fn size(i: usize) -> DVec3 {
    DVec3::new(10.0 + i as f64, 7.0 + 2.0 * i as f64, 3.0 + 0.5 * i as f64)
}

fn motion(i: usize) -> DAffine3 {
    let i = i as f64;
    let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.3 * i, 0.2 - 0.1 * i, 0.7 * i);
    DAffine3::from_rotation_translation(turn, DVec3::new(12.0 * i, -5.0 * i, 3.0 + i))
}

/// Axis of the placed product relative to which its placement is given.
fn axis(i: usize) -> DAffine3 {
    motion(i + 3)
}

fn in_unit(motion: DAffine3, mm: f64) -> DAffine3 {
    DAffine3 {
        translation: motion.translation / mm,
        ..motion
    }
}

fn part(text: &mut StepText, i: usize, mm: f64) -> Product {
    let solid = text.solid_box("", size(i) / mm, true);
    text.color(solid, [0.1 * i as f64, 0.5, 1.0 - 0.1 * i as f64]);
    text.part(&format!("part {i}"), &[solid])
}

/// Places the parts of sub-assembly `sub`; `child` creates the products.
fn sub(
    text: &mut StepText,
    sub: usize,
    mm: f64,
    mut child: impl FnMut(&mut StepText, usize) -> Product,
) -> Product {
    let parent = text.assembly(&format!("sub {sub}"));
    for i in [2 * sub, 2 * sub + 1] {
        let product = child(text, i);
        let axes = [axis(i), motion(i)].map(|motion| in_unit(motion, mm));
        text.component_by_axes(&format!("its part {i}"), parent, product, axes);
    }
    parent
}

fn whole(text: &mut StepText, mut child: impl FnMut(&mut StepText, usize) -> Product) {
    let root = text.assembly("root");
    for i in 0..SUBS {
        let product = child(text, i);
        text.component_by_axes(
            &format!("its sub {i}"),
            root,
            product,
            [axis(i + 20), motion(i + 10)],
        );
    }
}

fn flat() -> String {
    let mut text = StepText::millimetres();
    whole(&mut text, |text, i| {
        sub(text, i, 1.0, |text, part_number| part(text, part_number, 1.0))
    });
    text.finish()
}

/// Thirteen files: one assembly, four sub-assemblies, eight parts; the files cycle through the units.
fn write_set(folder: &Path) {
    let write = |name: &str, text: StepText| std::fs::write(folder.join(name), text.finish()).unwrap();
    let stub = |text: &mut StepText, product: &str, file: &str| {
        let product = text.assembly(product);
        text.in_file(product, file);
        product
    };
    let mut main = StepText::millimetres();
    whole(&mut main, |text, i| {
        stub(text, &format!("sub {i}"), &format!("SUB_{i}.stp"))
    });
    write("main.step", main);
    for i in 0..SUBS {
        let (unit, mm) = UNITS[(i + 1) % UNITS.len()];
        let mut text = StepText::new(unit);
        sub(&mut text, i, mm, |text, i| {
            stub(text, &format!("part {i}"), &format!("part-{i}.step"))
        });
        write(&format!("SUB_{i}.stp"), text);
    }
    for i in 0..PARTS {
        let (unit, mm) = UNITS[i % UNITS.len()];
        let mut text = StepText::new(unit);
        part(&mut text, i, mm);
        write(&format!("part-{i}.step"), text);
    }
}

/// Compares every part of both models: name, path, colour, volume and the positions of its corners.
fn assert_same(a: &CadModel, b: &CadModel) {
    assert_eq!(a.parts.len(), b.parts.len());
    for (one, other) in a.parts.iter().zip(&b.parts) {
        assert_eq!((&one.name, &one.path), (&other.name, &other.path));
        assert_eq!(one.color.is_some(), other.color.is_some());
        for (c, d) in one.color.iter().flatten().zip(other.color.iter().flatten()) {
            assert!((c - d).abs() < 1e-6);
        }
        let (shape, like) = (&a.shapes[one.shape], &b.shapes[other.shape]);
        // Planes: quadrature is exact, so the difference is the rounding of a unit's conversion, a few parts in 10¹⁶ of 100 mm.
        assert!((shape.volume_mm3 / like.volume_mm3 - 1.0).abs() < 1e-12);
        let far = 100.0;
        for corner in [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z] {
            let [p, q] = [one, other].map(|part| part.placement.transform_point3(corner * far));
            assert!(p.distance(q) < 1e-9, "{}: {p} is not {q}", one.name);
        }
    }
}

#[test]
fn a_set_of_thirteen_files_reads_as_the_flat_file() {
    let folder = tempfile::tempdir().unwrap();
    write_set(folder.path());
    let set = load_step(folder.path().join("main.step")).unwrap();
    let flat = load_step(support::file(&flat())).unwrap();
    assert_eq!((set.parts.len(), set.shapes.len()), (PARTS, PARTS));
    assert_eq!(set.warnings, Vec::<String>::new());
    assert_eq!(
        (set.unit.as_str(), set.files.len()),
        ("millimetre", 1 + SUBS + PARTS)
    );
    assert_same(&set, &flat);
    // ISO 10303-43: the motion that takes the placed product's axis onto the given axis.
    for (i, part) in flat.parts.iter().enumerate() {
        let sub = i / 2;
        let of_sub = motion(sub + 10) * axis(sub + 20).inverse();
        let expected = of_sub * motion(i) * axis(i).inverse();
        assert!(
            part.placement.abs_diff_eq(expected, 1e-9),
            "{}: {} is not {expected}",
            part.name,
            part.placement
        );
    }
}

#[test]
fn a_missing_file_is_named_and_the_rest_is_read() {
    let folder = tempfile::tempdir().unwrap();
    write_set(folder.path());
    std::fs::remove_file(folder.path().join("part-5.step")).unwrap();
    let set = load_step(folder.path().join("main.step")).unwrap();
    assert_eq!(set.parts.len(), PARTS - 1);
    let reported = set.warnings.join("\n");
    assert!(
        reported.contains("part 5") && reported.contains("\"part-5.step\" is missing"),
        "{reported}"
    );
    for i in 0..PARTS {
        let _ = std::fs::remove_file(folder.path().join(format!("part-{i}.step")));
    }
    let error = load_step(folder.path().join("main.step"))
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("missing beside it") && error.contains("part-0.step"),
        "{error}"
    );
}

#[test]
fn a_name_may_differ_in_case_and_one_file_serves_several_places() {
    let folder = tempfile::tempdir().unwrap();
    let mut text = StepText::millimetres();
    let root = text.assembly("root");
    for i in 0..3 {
        let stub = text.assembly("bolt");
        text.in_file(stub, "./Bolt.STP");
        text.component(&format!("bolt {i}"), root, stub, motion(i));
    }
    std::fs::write(folder.path().join("main.step"), text.finish()).unwrap();
    let mut bolt = StepText::millimetres();
    part(&mut bolt, 1, 1.0);
    std::fs::write(folder.path().join("bolt.stp"), bolt.finish()).unwrap();
    let model = load_step(folder.path().join("main.step")).unwrap();
    assert_eq!(
        (model.parts.len(), model.shapes.len(), model.files.len()),
        (3, 1, 2)
    );
    for (i, part) in model.parts.iter().enumerate() {
        assert!(part.placement.abs_diff_eq(motion(i), 1e-9));
    }
}

/// A main file with a valid part and a reference to the file `name`.
fn main_for(folder: &Path, name: &str) -> Result<CadModel, BrepError> {
    let mut text = StepText::millimetres();
    let root = text.assembly("root");
    let own = part(&mut text, 0, 1.0);
    text.component("own", root, own, DAffine3::IDENTITY);
    let stub = text.assembly("stub");
    text.in_file(stub, name);
    text.component("other", root, stub, DAffine3::IDENTITY);
    std::fs::write(folder.join("main.step"), text.finish()).unwrap();
    load_step(folder.join("main.step"))
}

#[test]
fn nothing_outside_the_folder_is_read() {
    let outer = tempfile::tempdir().unwrap();
    let folder = outer.path().join("set");
    std::fs::create_dir_all(folder.join("below")).unwrap();
    let mut evil = StepText::millimetres();
    part(&mut evil, 7, 1.0);
    let evil = evil.finish();
    let path = outer.path().join("evil.step");
    std::fs::write(&path, &evil).unwrap();
    std::fs::write(folder.join("below/evil.step"), &evil).unwrap();
    let absolute = path.to_str().unwrap().replace('\\', "\\\\");
    for name in [
        "../evil.step",
        "..\\\\evil.step",
        "below/evil.step",
        "./../evil.step",
        "C:evil.step",
        absolute.as_str(),
    ] {
        let error = main_for(&folder, name)
            .map(|model| model.parts.len())
            .unwrap_err();
        assert!(matches!(error, BrepError::Reference { .. }), "{name}: {error}");
        let words = error.to_string();
        assert!(
            words.contains("evil.step") && words.contains("same folder"),
            "{words}"
        );
    }
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(&path, folder.join("link.step")).unwrap();
        let error = main_for(&folder, "link.step")
            .map(|model| model.parts.len())
            .unwrap_err();
        assert!(error.to_string().contains("a symbolic link"), "{error}");
        let error = main_for(&folder, "below.step").map(|model| model.parts.len());
        assert_eq!(error.unwrap(), 1, "what is not there is left out");
    }
    std::fs::create_dir(folder.join("folder.step")).unwrap();
    let error = main_for(&folder, "folder.step")
        .map(|model| model.parts.len())
        .unwrap_err();
    assert!(error.to_string().contains("not a regular file"), "{error}");
}

#[test]
fn files_that_refer_to_each_other_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, other: &str| {
        let mut text = StepText::millimetres();
        let root = text.assembly(name);
        let stub = text.assembly(other);
        text.in_file(stub, &format!("{other}.step"));
        text.component("inside", root, stub, DAffine3::IDENTITY);
        std::fs::write(folder.path().join(format!("{name}.step")), text.finish()).unwrap();
    };
    write("a", "b");
    write("b", "c");
    write("c", "a");
    let error = load_step(folder.path().join("a.step")).unwrap_err().to_string();
    assert!(
        error.contains("refers back to it") && error.contains("c.step"),
        "{error}"
    );
    write("a", "a");
    let error = load_step(folder.path().join("a.step")).unwrap_err().to_string();
    assert!(error.contains("refers back to it"), "{error}");
}

#[test]
fn a_chain_of_files_is_bounded() {
    let folder = tempfile::tempdir().unwrap();
    for i in 0..40 {
        let mut text = StepText::millimetres();
        let root = text.assembly(&format!("level {i}"));
        let stub = text.assembly(&format!("level {}", i + 1));
        text.in_file(stub, &format!("{}.step", i + 1));
        text.component("inside", root, stub, DAffine3::IDENTITY);
        std::fs::write(folder.path().join(format!("{i}.step")), text.finish()).unwrap();
    }
    let error = load_step(folder.path().join("0.step")).unwrap_err().to_string();
    assert!(error.contains("beyond 32 levels"), "{error}");
}

#[test]
fn a_fault_in_a_referenced_file_is_reported_with_its_name() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("other.step"), "Dear all,\n").unwrap();
    let error = main_for(folder.path(), "other.step")
        .map(|model| model.parts.len())
        .unwrap_err();
    assert!(
        matches!(&error, BrepError::NotStep { path, .. } if path.ends_with("other.step")),
        "{error}"
    );
}

/// The kernel opens referenced files by itself, from the working directory: it must not receive their names.
#[test]
fn a_part_that_has_its_shape_here_is_not_read_from_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let mut text = StepText::millimetres();
    let own = part(&mut text, 0, 1.0);
    text.in_file(own, "elsewhere.step");
    std::fs::write(folder.path().join("main.step"), text.finish()).unwrap();
    let model = load_step(folder.path().join("main.step")).unwrap();
    assert_eq!((model.parts.len(), model.files.len()), (1, 1));
    assert!(
        model
            .warnings
            .iter()
            .any(|reported| reported.contains("have a shape here"))
    );
}
