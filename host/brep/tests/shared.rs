//! Every shared test part against `expected.json` and `real/manifest.csv`. Skipped with a note when they are absent.

use crate::support::{self, check};
use mortise_brep::{CadModel, LoadOptions, Surface, load_step_with};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The shared folder, or a note that the test is skipped.
fn shared(test: &str) -> Option<PathBuf> {
    let found = support::shared();
    if found.is_none() {
        println!("skipped {test}: no shared test parts (set MORTISE_SHARED)");
    }
    found
}

fn files(folder: &Path, prefix: &str) -> Vec<PathBuf> {
    let mut found: Vec<PathBuf> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| {
            let extension = path
                .extension()
                .and_then(|e| e.to_str())
                .unwrap_or_default()
                .to_lowercase();
            let name = path.file_name().and_then(|n| n.to_str()).unwrap_or_default();
            (extension == "step" || extension == "stp") && name.starts_with(prefix)
        })
        .collect();
    found.sort();
    assert!(!found.is_empty(), "{} has no STEP files", folder.display());
    found
}

/// The smallest deflection that is fast enough for a test, so that volumes can be compared.
const OPTIONS: LoadOptions = LoadOptions {
    linear_deflection_mm: None,
    relative_deflection: 5e-4,
    angular_deflection_rad: 0.2,
    recognise_mm: 1e-4,
    time_limit_s: 300,
    memory_limit_bytes: 8 << 30,
    answer_limit_bytes: 1 << 30,
    text_limit_bytes: 1 << 30,
    max_parts: 100_000,
    allow_lost_solids: false,
};

fn load(path: &Path) -> CadModel {
    load_step_with(path, &OPTIONS).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn our_parts_are_all_there_closed_and_on_their_surfaces() {
    let Some(cad) = shared("our parts") else { return };
    let text = std::fs::read_to_string(cad.join("expected.json")).unwrap();
    let expected: HashMap<String, serde_json::Value> = serde_json::from_str(&text).unwrap();
    assert!(expected.len() >= 46);
    for (file, expected) in &expected {
        let model = load(&cad.join(file));
        let mut names: Vec<String> = model.parts.iter().map(|p| p.name.clone()).collect();
        let mut want: Vec<String> = expected["parts"].as_array().unwrap().iter().map(leaf).collect();
        if want.is_empty() {
            // The kernel alone reads nothing from this file, which is motor_flat in a different notation.
            let flat: Vec<_> = load(&cad.join("05_motor/motor_flat.step")).parts;
            want = flat.into_iter().map(|p| p.name).collect();
        }
        for (name, want) in names.iter_mut().zip(&mut want) {
            // For an occurrence without an ASCII letter the kernel has no name and gives its number instead.
            if want.chars().all(|c| c.is_ascii_digit()) {
                assert!(!name.is_ascii(), "{file}: {name}");
                want.clone_from(name);
            }
        }
        assert_eq!(names, want, "{file}");
        assert!(model.warnings.is_empty(), "{file}: {:?}", model.warnings);
        assert!(model.shapes.iter().all(|s| s.closed), "{file}");
        check::check(&model, 1e-6);
        for part in &model.parts {
            let shape = &model.shapes[part.shape];
            // The kernel's bounding box of a spline is that of its control points: up to twice as large.
            check::check_volume(
                shape,
                2.0 * OPTIONS.relative_deflection * diagonal(shape),
                &part.name,
            );
        }
    }
}

fn leaf(path: &serde_json::Value) -> String {
    // The reference data join the names of the tree's levels with slashes.
    path.as_str().unwrap().rsplit('/').next().unwrap().into()
}

fn diagonal(shape: &mortise_brep::Shape) -> f64 {
    let (low, high) = shape.mesh.vertices.iter().fold(
        (glam::DVec3::INFINITY, glam::DVec3::NEG_INFINITY),
        |(low, high), &v| (low.min(v), high.max(v)),
    );
    (high - low).length()
}

#[test]
fn the_motor_is_the_same_in_every_unit_schema_and_spelling() {
    let Some(cad) = shared("the motor") else { return };
    let volumes = |file: &str| -> HashMap<String, f64> {
        let model = load(&cad.join(file));
        model
            .parts
            .iter()
            .map(|p| (p.name.clone(), model.shapes[p.shape].volume_mm3))
            .collect()
    };
    let want = volumes("05_motor/motor_flat.step");
    // Bearing: ring of radii 4 and 11, 7 high.
    let bearing = std::f64::consts::PI * (121.0 - 16.0) * 7.0;
    assert!((want["bearing-front"] / bearing - 1.0).abs() < 1e-9);
    for file in [
        "05_motor/motor_nested.step",
        "08_hard/motor_inch_ap214.step",
        "08_hard/motor_metre_ap203.step",
        "08_hard/motor_ap242.step",
        "08_hard/ok_comments_before_equals.step",
    ] {
        let got = volumes(file);
        assert_eq!(got.len(), want.len(), "{file}");
        for (name, volume) in &want {
            // Inch and metre files have 15 digits per coordinate; conversion costs a few of them.
            assert!(
                (got[name] / volume - 1.0).abs() < 1e-8,
                "{file}: {name} {} {volume}",
                got[name]
            );
        }
    }
}

#[test]
fn a_cylinder_spelt_as_a_spline_has_the_volume_of_a_cylinder() {
    let Some(cad) = shared("the spline pair") else {
        return;
    };
    let model = load(&cad.join("08_hard/pair_clear0.10_nurbs.step"));
    let (block, peg) = (
        &model.shapes[model.parts[0].shape],
        &model.shapes[model.parts[1].shape],
    );
    assert!(block.faces.iter().chain(&peg.faces).all(|f| f.fit_mm.is_some()));
    let (hole, r) = (18.75f64 / 2.0, 18.65f64 / 2.0);
    let pi = std::f64::consts::PI;
    let exact = [50.0 * 50.0 * 40.0 - pi * hole * hole * 40.0, pi * r * r * 60.0];
    // Each of a handful of faces is integrated to 1e-6.
    assert!((block.volume_mm3 / exact[0] - 1.0).abs() < 1e-5);
    assert!((peg.volume_mm3 / exact[1] - 1.0).abs() < 1e-5);
    let area = 2.0 * pi * r * (r + 60.0);
    assert!(
        (peg.area_mm2 / area - 1.0).abs() < 1e-5,
        "{} {area}",
        peg.area_mm2
    );
    let zz = exact[1] * r * r / 2.0;
    assert!(
        (peg.inertia_mm5[2][2] / zz - 1.0).abs() < 1e-4,
        "{} {zz}",
        peg.inertia_mm5[2][2]
    );
}

#[test]
fn a_recognised_surface_is_the_one_the_other_file_writes() {
    let Some(cad) = shared("recognised surfaces") else {
        return;
    };
    let spline = load(&cad.join("08_hard/pair_clear0.10_nurbs.step"));
    let native = load(&cad.join("01_thesis_pair/pair_d18.75_clear0.10.step"));
    // Vertices and normals of the kernel's mesh lie on and along the recognised surfaces, within its rounding.
    check::check(&spline, 1e-9);
    for (part, other) in spline.parts.iter().zip(&native.parts) {
        assert_eq!(part.name, other.name);
        let (a, b) = (&spline.shapes[part.shape], &native.shapes[other.shape]);
        for (frame, radius, reversed) in a.faces.iter().filter_map(cylinder) {
            let same = b.faces.iter().filter_map(cylinder).any(|(f, r, turned)| {
                let [p, q] =
                    [(part, frame.origin), (other, f.origin)].map(|(p, at)| p.placement.transform_point3(at));
                let [u, v] = [(part, frame.z), (other, f.z)].map(|(p, z)| p.placement.transform_vector3(z));
                let beside = (p - q).reject_from(v).length();
                turned == reversed && (r - radius).abs() < 1e-9 && u.cross(v).length() < 1e-9 && beside < 1e-9
            });
            assert!(same, "{}: radius {radius} {frame:?}", part.name);
        }
        let planes = |shape: &mortise_brep::Shape| {
            let plane = |f: &&mortise_brep::Face| matches!(f.surface, Surface::Plane { .. });
            shape.faces.iter().filter(plane).count()
        };
        assert_eq!(planes(a), planes(b));
        // Edges as well: circles of the holes and straight edges.
        assert!(a.edges.iter().all(|e| e.curve != mortise_brep::Curve::Other));
    }
    let off = LoadOptions {
        recognise_mm: 0.0,
        ..OPTIONS
    };
    let plain = load_step_with(cad.join("08_hard/pair_clear0.10_nurbs.step"), &off).unwrap();
    assert!(
        plain
            .shapes
            .iter()
            .flat_map(|s| &s.faces)
            .all(|f| f.surface == Surface::Spline)
    );
}

fn cylinder(face: &mortise_brep::Face) -> Option<(mortise_brep::Frame, f64, bool)> {
    match face.surface {
        Surface::Cylinder { frame, radius } => Some((frame, radius, face.reversed)),
        _ => None,
    }
}

#[test]
fn broken_files_give_one_line_and_no_model() {
    let Some(cad) = shared("broken files") else { return };
    for file in files(&cad.join("08_hard"), "broken_") {
        let output = Command::new(env!("CARGO_BIN_EXE_mortise-brep"))
            .arg(&file)
            .output()
            .unwrap();
        let errors = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{}: {errors}", file.display());
        assert_eq!(errors.lines().count(), 1, "{errors}");
        assert!(errors.contains("; ") && output.stdout.is_empty(), "{errors}");
    }
}

#[test]
fn real_files_equal_the_manifest_or_say_why_not() {
    let Some(cad) = shared("real files") else { return };
    let manifest = std::fs::read_to_string(cad.join("real/manifest.csv")).unwrap();
    let mut lines = manifest.lines().map(fields);
    let columns = lines.next().unwrap();
    let column = |name: &str| columns.iter().position(|c| c == name).unwrap();
    let [file, solids, types, volume] = ["file", "solids", "face_types", "volume_mm3"].map(column);
    let mut read = 0;
    for row in lines {
        let name = &row[file];
        let result = load_step_with(cad.join("real").join(name), &OPTIONS);
        let Ok(want) = row[volume].parse::<f64>() else {
            let error = result.expect_err(name).to_string();
            assert!(!error.contains('\n'), "{error}");
            continue;
        };
        let model = result.unwrap();
        read += 1;
        // Vertices lie on an edge's curve, which can be off its surfaces by the modeller's tolerance.
        check::check(&model, 1e-2);
        let total: f64 = model.parts.iter().map(|p| model.shapes[p.shape].volume_mm3).sum();
        // The manifest counts the two bodies of this file twice: as definitions and as mapped items.
        let counted = if name == "chrono_assembly.stp" { 2.0 } else { 1.0 };
        // Its figures have one or two decimals, and come from the kernel's plain quadrature, which is a few tenths of a percent off on splines and
        // exact without them.
        let splines = row[types].contains("bsp");
        let tolerance = if splines { 3e-3 } else { 1e-6 } * want.abs() + 0.06;
        assert!(
            (counted * total - want).abs() <= tolerance,
            "{name}: {} {want}",
            counted * total
        );
        let Ok(solids) = row[solids].parse::<usize>() else {
            panic!("{name}: no count of solids")
        };
        if solids == 0 {
            assert!(model.parts.len() == 1 && !model.shapes[0].closed && !model.warnings.is_empty());
        } else {
            assert_eq!((counted as usize) * model.parts.len(), solids, "{name}");
            assert!(
                model.shapes.iter().all(|s| s.closed),
                "{name}: {:?}",
                model.warnings
            );
            for part in &model.parts {
                let shape = &model.shapes[part.shape];
                // Twice for the kernel's bounding box, twice for the amount by which the mesher may miss its bound without a warning.
                check::check_volume(
                    shape,
                    4.0 * OPTIONS.relative_deflection * diagonal(shape),
                    &part.name,
                );
            }
        }
        assert_eq!(
            face_types(&model, counted as usize),
            counts(&row[types]),
            "{name}"
        );
    }
    assert!(read >= 14, "only {read} real files were read");
}

fn face_types(model: &CadModel, times: usize) -> HashMap<String, usize> {
    let mut counts = HashMap::new();
    for face in model.parts.iter().flat_map(|p| &model.shapes[p.shape].faces) {
        let kind = match face.surface {
            _ if face.fit_mm.is_some() => "bsp",
            Surface::Plane { .. } => "pln",
            Surface::Cylinder { .. } => "cyl",
            Surface::Cone { .. } => "con",
            Surface::Sphere { .. } => "sph",
            Surface::Torus { .. } => "tor",
            Surface::Spline => "bsp",
        };
        *counts.entry(kind.to_string()).or_default() += times;
    }
    counts
}

/// "pln:90 bsp:70".
fn counts(text: &str) -> HashMap<String, usize> {
    text.split_whitespace()
        .map(|pair| pair.split_once(':').unwrap())
        .map(|(k, n)| (k.into(), n.parse().unwrap()))
        .collect()
}

/// Fields of one line of the manifest: commas within quotes do not separate.
fn fields(line: &str) -> Vec<String> {
    let mut fields = vec![String::new()];
    let mut quoted = false;
    for c in line.chars() {
        match c {
            '"' => quoted = !quoted,
            ',' if !quoted => fields.push(String::new()),
            c => fields.last_mut().unwrap().push(c),
        }
    }
    fields
}
