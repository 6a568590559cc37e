//! The thesis pair against closed forms, and legal and illegal variants of its text. Reads in-process.

use crate::support::{self, check};
use glam::DVec3;
use mortise_brep::{BrepError, CadModel, Curve, LoadOptions, Surface, load_step, load_step_with};
use std::f64::consts::PI;

fn pair() -> String {
    std::fs::read_to_string(support::data("pair_d18.75_clear1.00.step")).unwrap()
}

fn load(text: &str) -> Result<CadModel, BrepError> {
    load_step(support::file(text))
}

#[test]
fn mass_properties_equal_closed_forms() {
    let model = load(&pair()).unwrap();
    assert_eq!(
        model.parts.iter().map(|p| p.name.as_str()).collect::<Vec<_>>(),
        ["block", "peg"]
    );
    assert_eq!(model.unit, "millimetre");
    assert!(model.warnings.is_empty(), "{:?}", model.warnings);
    check::check(&model, 1e-6);

    // Block 50 × 50 × 40 with a hole of diameter 18.75 along z.
    let block = &model.shapes[model.parts[0].shape];
    let (side, height, r) = (50.0, 40.0, 18.75 / 2.0);
    let volume = side * side * height - PI * r * r * height;
    let area = 2.0 * (side * side - PI * r * r) + 4.0 * side * height + 2.0 * PI * r * height;
    let zz = side * side * height * (side * side / 6.0) - PI * r * r * height * (r * r / 2.0);
    // 1e-9: quadrature of polynomials and circles by the kernel, which is exact except for rounding.
    assert!(
        (block.volume_mm3 / volume - 1.0).abs() < 1e-9,
        "{} {volume}",
        block.volume_mm3
    );
    assert!((block.area_mm2 / area - 1.0).abs() < 1e-9);
    assert!((block.inertia_mm5[2][2] / zz - 1.0).abs() < 1e-9);
    let center = model.parts[0].placement.transform_point3(block.center_of_mass);
    assert!(center.distance(DVec3::new(0.0, 0.0, -20.0)) < 1e-9);

    // Peg of diameter 17.75 and length 60, upside down, from 20 to 80 above the block.
    let peg = &model.shapes[model.parts[1].shape];
    let r: f64 = 17.75 / 2.0;
    assert!((peg.volume_mm3 / (PI * r * r * 60.0) - 1.0).abs() < 1e-9);
    let center = model.parts[1].placement.transform_point3(peg.center_of_mass);
    assert!(center.distance(DVec3::new(0.0, 0.0, 50.0)) < 1e-9);
    assert!((model.parts[1].placement.matrix3.z_axis - DVec3::NEG_Z).length() < 1e-12);
}

#[test]
fn faces_edges_and_colours_are_as_modelled() {
    let model = load(&pair()).unwrap();
    let block = &model.shapes[model.parts[0].shape];
    let hole: Vec<_> = block
        .faces
        .iter()
        .filter(|f| matches!(f.surface, Surface::Cylinder { .. }))
        .collect();
    let Surface::Cylinder { frame, radius } = hole[0].surface else {
        unreachable!()
    };
    assert_eq!((block.faces.len(), hole.len()), (7, 1));
    assert!((radius - 9.375).abs() < 1e-12 && frame.z.z.abs() > 1.0 - 1e-12);
    assert!(
        hole[0].reversed,
        "the outward normal of a hole's wall points to its axis"
    );
    // The wall is bounded by two circles and a seam; the seam lists its face twice.
    let seam = hole[0]
        .edges
        .iter()
        .map(|&e| &block.edges[e as usize])
        .find(|e| matches!(e.curve, Curve::Line { .. }));
    let seam = seam.expect("a seam");
    assert_eq!(seam.faces.len(), 2);
    assert_eq!(seam.faces[0], seam.faces[1]);
    assert!((seam.length_mm - 40.0).abs() < 1e-9);
    let circles = hole[0]
        .edges
        .iter()
        .filter(|&&e| matches!(block.edges[e as usize].curve, Curve::Circle { .. }));
    assert_eq!(circles.count(), 2);
    // The file's grey (0.6, 0.6, 0.62) and red (0.8, 0.2, 0.2) are sRGB, the model's linear (IEC 61966-2-1).
    let linear = |c: [f64; 3]| c.map(|v| ((v + 0.055) / 1.055).powf(2.4));
    for (part, color) in [(0, [0.6, 0.6, 0.62]), (1, [0.8, 0.2, 0.2])] {
        let got = model.parts[part].color.expect("a colour");
        for (got, want) in got.iter().zip(linear(color)) {
            // Single precision, and seven digits in the file.
            assert!((f64::from(*got) - want).abs() < 1e-5, "{got} is not {want}");
        }
    }
}

#[test]
fn a_finer_mesh_keeps_its_volume_within_the_deflection() {
    for deflection in [0.3, 0.03, 0.003] {
        let options = LoadOptions {
            linear_deflection_mm: Some(deflection),
            angular_deflection_rad: 1.0,
            ..LoadOptions::default()
        };
        let model = load_step_with(support::data("pair_d18.75_clear1.00.step"), &options).unwrap();
        for part in &model.parts {
            assert!(model.shapes[part.shape].closed);
            check::check_volume(&model.shapes[part.shape], deflection, &part.name);
        }
    }
}

#[test]
fn legal_spellings_of_the_same_text_give_the_same_model() {
    let plain = pair();
    let want = load(&plain).unwrap();
    let (head, rest) = plain.split_once("DATA;\n").unwrap();
    let (data, _) = rest.rsplit_once("ENDSEC;").unwrap();
    let entities: Vec<&str> = data.split(";\n").filter(|e| !e.trim().is_empty()).collect();
    let of = |entities: Vec<String>| {
        format!(
            "{head}DATA;\n{};\nENDSEC;\nEND-ISO-10303-21;\n",
            entities.join(";\n")
        )
    };
    let each = |change: &dyn Fn(&str) -> String| of(entities.iter().map(|e| change(e)).collect());
    let variants = [
        ("CRLF", plain.replace('\n', "\r\n")),
        ("one line", plain.replace('\n', "")),
        (
            "reversed",
            of(entities.iter().rev().map(|e| e.to_string()).collect()),
        ),
        ("comments", each(&|e| e.replacen('=', "= /* c; ' #1=X(); */", 1))),
        ("comments before =", each(&|e| e.replacen('=', " /* c; */ = ", 1))),
        ("large numbers", each(&|e| e.replace('#', "#70000000"))),
        (
            "lower case",
            each(&|e| {
                if e.contains('\'') {
                    e.replace("E-", "e-")
                } else {
                    e.to_lowercase()
                }
            }),
        ),
        ("byte order mark", format!("\u{feff}{plain}")),
    ];
    for (what, text) in variants {
        let model = load(&text).unwrap_or_else(|e| panic!("{what}: {e}"));
        let mut got: Vec<_> = model.parts.iter().collect();
        got.sort_by(|a, b| a.name.cmp(&b.name));
        assert_eq!(got.len(), want.parts.len(), "{what}");
        for (got, want_part) in got.iter().zip(&want.parts) {
            assert_eq!(got.name, want_part.name, "{what}");
            assert_eq!(got.placement, want_part.placement, "{what}");
            let (a, b) = (&model.shapes[got.shape], &want.shapes[want_part.shape]);
            assert_eq!(a.volume_mm3.to_bits(), b.volume_mm3.to_bits(), "{what}");
            assert_eq!(a.mesh.triangles.len(), b.mesh.triangles.len(), "{what}");
        }
    }
}

#[test]
fn broken_texts_give_one_line_that_names_the_fault() {
    let plain = pair();
    let cylinder = plain.find("CYLINDRICAL_SURFACE").unwrap();
    let end = cylinder + plain[cylinder..].find(';').unwrap();
    let old = &plain[cylinder..end];
    let axis = &old[old.find('#').unwrap()..old.rfind(',').unwrap()];
    let last = plain.rfind("ENDSEC;").unwrap();
    let with = |entity: &str| format!("{}{entity}\n{}", &plain[..last], &plain[last..]);
    let cases = [
        (String::new(), "empty"),
        (
            "solid x\nfacet normal 0 0 1\nendsolid x\n".into(),
            "not a STEP file",
        ),
        (plain[..plain.len() / 2].into(), "cut off"),
        (plain[..plain.len() - 20].into(), "cut off"),
        (
            plain.replacen(old, "CYLINDRICAL_SURFACE('',#999999,5.)", 1),
            "#999999, which does not exist",
        ),
        (
            plain.replacen(old, &format!("CYLINDRICAL_SURFACE('',{axis},-5.)"), 1),
            "the radius -5.",
        ),
        (
            plain.replacen(
                "CARTESIAN_POINT('',(0.,0.,0.))",
                "CARTESIAN_POINT('',(0.,0.,1.E400))",
                1,
            ),
            "1.E400",
        ),
        (
            with("#900001=REPRESENTATION_MAP(#900002,#900002);#900002=MAPPED_ITEM('',#900001,#900001);"),
            "each other",
        ),
        (with("#1=DIRECTION('',(1.,0.,0.));"), "#1 is defined twice"),
        (
            plain.replace("MANIFOLD_SOLID_BREP", "SOMETHING_ELSE"),
            "no solid or surface",
        ),
    ];
    for (text, want) in cases {
        let error = load(&text).expect_err(want).to_string();
        assert!(
            error.contains(want) && error.contains("; ") && !error.contains('\n'),
            "{want}: {error}"
        );
    }
    let missing = load_step(support::data("no such file.step"))
        .unwrap_err()
        .to_string();
    assert!(
        missing.contains("cannot be read") && missing.contains("check the path"),
        "{missing}"
    );
}

#[test]
fn a_part_five_levels_down_is_where_it_belongs() {
    let model = load_step(support::data("deep_nesting.step")).unwrap();
    assert_eq!(model.parts[0].name, "block-deep");
    assert_eq!(
        model.parts[0].path,
        ["level-1", "level-2", "level-3", "level-4", "level-5"]
    );
    assert!(model.parts[1].path.is_empty());
    // The shaft sits in the block's hole: their axes coincide.
    let axis = |part: usize| {
        let part = &model.parts[part];
        let wall = model.shapes[part.shape]
            .faces
            .iter()
            .find_map(|f| match f.surface {
                Surface::Cylinder { frame, .. } => Some(frame),
                _ => None,
            });
        let frame = wall.expect("a cylinder");
        (
            part.placement.transform_point3(frame.origin),
            part.placement.transform_vector3(frame.z),
        )
    };
    let ((p, a), (q, b)) = (axis(0), axis(1));
    assert!(a.cross(b).length() < 1e-9);
    // The file's coordinates have 15 digits at up to 60 mm; the result is five products of rotations.
    assert!(
        (q - p).reject_from(a).length() < 1e-9,
        "{}",
        (q - p).reject_from(a).length()
    );
}
