//! STEP texts written by the tests, compared with arithmetic results. Reads in-process.

use crate::support;
use std::f64::consts::PI;

use crate::support::StepText;
use glam::{DAffine3, DMat3, DQuat, DVec3};
use mortise_brep::{BrepError, CadModel, LoadOptions, Surface, load_step, load_step_with};
use proptest::prelude::*;

fn load(text: &str) -> Result<CadModel, BrepError> {
    load_step(support::file(text))
}

fn names(model: &CadModel) -> Vec<&str> {
    model.parts.iter().map(|p| p.name.as_str()).collect()
}

/// Corners of the bounding box of all mesh vertices of a placed part.
fn placed_box(model: &CadModel, part: usize) -> (DVec3, DVec3) {
    let part = &model.parts[part];
    let points = model.shapes[part.shape]
        .mesh
        .vertices
        .iter()
        .map(|&v| part.placement.transform_point3(v));
    points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| {
        (low.min(p), high.max(p))
    })
}

fn assert_near(a: DVec3, b: DVec3, tolerance: f64) {
    assert!((a - b).length() <= tolerance, "{a} is not {b} within {tolerance}");
}

#[test]
fn several_solids_in_one_product_are_a_part_each() {
    let mut text = StepText::millimetres();
    let solids = [
        text.solid_box("a", DVec3::splat(1.0), true),
        text.solid_box("b", DVec3::splat(2.0), true),
    ];
    text.part("pair", &solids);
    let model = load(&text.finish()).unwrap();
    assert_eq!(names(&model), ["pair.1", "pair.2"]);
    assert_eq!(model.shapes.len(), 2);
    assert!((model.shapes[1].volume_mm3 - 8.0).abs() < 1e-9);
}

#[test]
fn names_are_decoded_here() {
    let mut text = StepText::millimetres();
    let child = {
        let solid = text.solid_box("", DVec3::splat(1.0), true);
        text.part("SOLID", &[solid])
    };
    let root = text.assembly("root");
    let sub = text.assembly("\\X2\\6A5F4F53\\X0\\");
    text.component("", root, sub, DAffine3::IDENTITY);
    text.component("cover ''back'' \\\\ 1, #3; Ø", sub, child, DAffine3::IDENTITY);
    text.component(
        "cover ''back'' \\\\ 1, #3; Ø",
        sub,
        child,
        DAffine3::from_translation(DVec3::X * 5.0),
    );
    text.component(
        "=>[0:1:1:3]",
        sub,
        child,
        DAffine3::from_translation(DVec3::X * 9.0),
    );
    let model = load(&text.finish()).unwrap();
    assert_eq!(
        names(&model),
        ["cover 'back' \\ 1, #3; Ø", "cover 'back' \\ 1, #3; Ø (2)", "機体"]
    );
    assert_eq!(model.parts[0].path, ["機体"]);
    assert_eq!(model.shapes.len(), 1, "a shape placed three times is there once");
}

#[test]
fn an_inside_out_solid_is_turned() {
    let mut text = StepText::millimetres();
    let solid = text.solid_box("", DVec3::new(1.0, 2.0, 3.0), false);
    text.part("box", &[solid]);
    let model = load(&text.finish()).unwrap();
    assert!((model.shapes[0].volume_mm3 - 6.0).abs() < 1e-9);
    assert!(model.shapes[0].closed);
    assert_outward(&model.shapes[0], DVec3::new(0.5, 1.0, 1.5));
}

/// Checks that all faces of a convex shape point away from a point inside.
fn assert_outward(shape: &mortise_brep::Shape, inside: DVec3) {
    for (t, &face) in shape.mesh.triangles.iter().zip(&shape.mesh.triangle_face) {
        let [a, b, c] = t.map(|i| shape.mesh.vertices[i as usize]);
        let normal = (b - a).cross(c - a);
        assert!(normal.dot(a - inside) > 0.0);
        let face = &shape.faces[face as usize];
        let Surface::Plane { frame } = face.surface else {
            panic!("a box has planes")
        };
        let outward = if face.reversed { -frame.z } else { frame.z };
        assert!(normal.normalize().dot(outward) > 1.0 - 1e-12);
    }
}

#[test]
fn mapped_items_alone_make_an_assembly() {
    let mut text = StepText::millimetres();
    let solid = text.solid_box("", DVec3::new(1.0, 2.0, 3.0), true);
    let part = text.part("block", &[solid]);
    let here = text.axis(DVec3::new(10.0, 0.0, 0.0), DVec3::Z, DVec3::X);
    let there = text.axis(DVec3::new(0.0, 20.0, 0.0), DVec3::X, DVec3::Y);
    let items = [text.mapped(part, here), text.mapped(part, there)];
    let whole = text.representation("SHAPE_REPRESENTATION", &items);
    text.product("whole", whole);
    let model = load(&text.finish()).unwrap();
    assert_eq!(names(&model), ["block", "block (2)"]);
    assert_eq!(model.shapes.len(), 1);
    assert_near(placed_box(&model, 0).0, DVec3::new(10.0, 0.0, 0.0), 1e-9);
    // x → y, y → z, z → x: the box 1 × 2 × 3 becomes 3 × 1 × 2.
    assert_near(placed_box(&model, 1).0, DVec3::new(0.0, 20.0, 0.0), 1e-9);
    assert_near(placed_box(&model, 1).1, DVec3::new(3.0, 21.0, 2.0), 1e-9);
}

#[test]
fn mirrored_and_scaled_placements_become_shapes_of_their_own() {
    let mut text = StepText::millimetres();
    let solid = text.solid_box("", DVec3::new(1.0, 2.0, 3.0), true);
    let part = text.part("block", &[solid]);
    let plain = text.axis(DVec3::ZERO, DVec3::Z, DVec3::X);
    let mirrored = text.operator([-DVec3::X, DVec3::Y, DVec3::Z], DVec3::new(-5.0, 0.0, 0.0), 1.0);
    let doubled = text.operator(
        DMat3::IDENTITY.to_cols_array_2d().map(DVec3::from),
        DVec3::new(0.0, 0.0, 9.0),
        2.0,
    );
    let items = [plain, mirrored, doubled].map(|target| text.mapped(part, target));
    let whole = text.representation("SHAPE_REPRESENTATION", &items);
    text.product("whole", whole);
    let model = load(&text.finish()).unwrap();
    assert_eq!(model.parts.len(), 3, "{:?}", model.warnings);
    for part in &model.parts {
        let m = part.placement.matrix3;
        assert!(
            (m.determinant() - 1.0).abs() < 1e-9,
            "a placement is a rigid motion"
        );
        assert!(model.shapes[part.shape].closed);
    }
    let corners = [
        (DVec3::ZERO, DVec3::new(1.0, 2.0, 3.0)),
        (DVec3::new(-6.0, 0.0, 0.0), DVec3::new(-5.0, 2.0, 3.0)),
        (DVec3::new(0.0, 0.0, 9.0), DVec3::new(2.0, 4.0, 15.0)),
    ];
    for (i, (low, high)) in corners.into_iter().enumerate() {
        assert_near(placed_box(&model, i).0, low, 1e-9);
        assert_near(placed_box(&model, i).1, high, 1e-9);
        let shape = &model.shapes[model.parts[i].shape];
        let size = high - low;
        assert!((shape.volume_mm3 - size.x * size.y * size.z).abs() < 1e-9 * shape.volume_mm3);
        assert_outward(shape, shape.center_of_mass);
    }
}

#[test]
fn an_occurrence_may_be_placed_by_an_operator() {
    let mut text = StepText::millimetres();
    let solid = text.solid_box("", DVec3::new(1.0, 2.0, 3.0), true);
    let part = text.part("block", &[solid]);
    let inner = text.assembly("inner");
    let outer = text.assembly("outer");
    // Mirrored in y and three times as large, then moved.
    let axes = [DVec3::X, -DVec3::Y, DVec3::Z];
    let plain = text.operator(axes, DVec3::new(0.0, 0.0, 5.0), 3.0);
    let complex = text.complex_operator(axes, DVec3::new(0.0, 0.0, 5.0), 3.0);
    text.component_by_operator("a", inner, part, plain);
    text.component_by_operator("b", inner, part, complex);
    text.component("c", inner, part, DAffine3::IDENTITY);
    text.component("inner", outer, inner, DAffine3::from_translation(DVec3::X * 10.0));
    let model = load(&text.finish()).unwrap();
    assert_eq!(names(&model), ["a", "b", "c"]);
    assert_eq!(model.shapes.len(), 2, "the two mirrored ones are one shape");
    for i in 0..2 {
        assert_near(placed_box(&model, i).0, DVec3::new(10.0, -6.0, 5.0), 1e-9);
        assert_near(placed_box(&model, i).1, DVec3::new(13.0, 0.0, 14.0), 1e-9);
        let shape = &model.shapes[model.parts[i].shape];
        assert!(shape.closed && (shape.volume_mm3 - 162.0).abs() < 1e-6);
    }
    assert_near(placed_box(&model, 2).1, DVec3::new(11.0, 2.0, 3.0), 1e-9);
}

const MILLIMETRE: &str = "(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.))";
const CENTIMETRE: &str = "(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.CENTI.,.METRE.))";

/// An axis of a block and the axis of the assembly onto which it is placed, in millimetres: a quarter turn about x, and one about z.
fn quarter_turns(parent_mm: f64, child_mm: f64) -> [DAffine3; 2] {
    [
        DAffine3 {
            matrix3: DMat3::from_cols(DVec3::X, DVec3::Z, -DVec3::Y),
            translation: DVec3::new(5.0, -2.0, 3.0) / child_mm,
        },
        DAffine3 {
            matrix3: DMat3::from_cols(DVec3::Y, -DVec3::X, DVec3::Z),
            translation: DVec3::new(100.0, 20.0, 30.0) / parent_mm,
        },
    ]
}

/// ISO 10303-43 places p at item 2 · (item 1)⁻¹ · p. By hand for [`quarter_turns`]: with d = p − (5, −2, 3), the coordinates in the block's axis are
/// (d.x, d.z, −d.y), and the assembly's axis takes (u, v, w) to (100 − v, 20 + u, 30 + w); together (103 − p.z, 15 + p.x, 28 − p.y).
fn assert_on_its_axis(model: &CadModel, part: usize) {
    assert_near(placed_box(model, part).0, DVec3::new(100.0, 15.0, 26.0), 1e-9);
    assert_near(placed_box(model, part).1, DVec3::new(103.0, 16.0, 28.0), 1e-9);
}

#[test]
fn a_component_lies_with_its_own_axis_on_the_one_it_is_given() {
    for (parent, parent_mm) in [(MILLIMETRE, 1.0), (CENTIMETRE, 10.0)] {
        for (child, child_mm) in [(MILLIMETRE, 1.0), (CENTIMETRE, 10.0)] {
            let mut text = StepText::new(child);
            let solid = text.solid_box("", DVec3::new(1.0, 2.0, 3.0) / child_mm, true);
            let [from, to] = quarter_turns(parent_mm, child_mm);
            let own = text.axis_of(from);
            // As the standard requires: each axis is an item of its representation.
            let block = text.representation("ADVANCED_BREP_SHAPE_REPRESENTATION", &[solid, own]);
            let block = text.product("block", block);
            text.change_unit(parent);
            let given = text.axis_of(to);
            let root = text.representation("SHAPE_REPRESENTATION", &[given]);
            let root = text.product("root", root);
            text.component_by_entities("a", root, block, [own, given]);
            text.component_by_entities("axes swapped", root, block, [given, own]);
            text.component_reversed("ends swapped", root, block, [own, given]);
            text.component_by_axes("axes of no representation", root, block, [from, to]);
            let model = load(&text.finish()).unwrap();
            assert_eq!(
                (model.parts.len(), model.shapes.len()),
                (4, 1),
                "{:?}",
                model.warnings
            );
            for part in 0..4 {
                assert_on_its_axis(&model, part);
            }
        }
    }
}

#[test]
fn a_mapped_item_lies_with_its_own_axis_on_the_one_it_is_given() {
    for (operator, mm) in [(false, 1.0), (true, 1.0), (false, 10.0), (true, 10.0)] {
        let mut text = StepText::new(if mm == 1.0 { MILLIMETRE } else { CENTIMETRE });
        let solid = text.solid_box("", DVec3::new(1.0, 2.0, 3.0) / mm, true);
        let block = text.part("block", &[solid]);
        text.change_unit(MILLIMETRE);
        let [from, to] = quarter_turns(1.0, mm);
        let (own, given) = (text.axis_of(from), text.axis_of(to));
        let mut items = vec![text.mapped_from(block, own, given)];
        if operator {
            // Twice as large about the axis: 2 (103 − p.z, 15 + p.x, 28 − p.y) − (100, 20, 30).
            let axes = to.matrix3.to_cols_array_2d().map(DVec3::from);
            let doubled = text.operator(axes, to.translation, 2.0);
            items.push(text.mapped_from(block, own, doubled));
        }
        let whole = text.representation("SHAPE_REPRESENTATION", &items);
        text.product("whole", whole);
        let model = load(&text.finish()).unwrap();
        assert_eq!(model.parts.len(), items.len(), "{:?}", model.warnings);
        assert_eq!(names(&model)[0], "block");
        assert_on_its_axis(&model, 0);
        if operator {
            assert_near(placed_box(&model, 1).0, DVec3::new(100.0, 10.0, 22.0), 1e-9);
            assert_near(placed_box(&model, 1).1, DVec3::new(106.0, 12.0, 26.0), 1e-9);
        }
    }
}

/// ISO 10303-42 (function first_proj_axis): x is then the origin's, made orthogonal to z; if z is along x itself, the origin's y is used.
#[test]
fn an_axis_without_a_reference_direction_is_square_to_its_own() {
    for (z, x) in [
        (DVec3::Z, DVec3::X),
        (-DVec3::Z, DVec3::X),
        (DVec3::Y, DVec3::X),
        (-DVec3::X, DVec3::Y),
        (DVec3::new(0.6, 0.0, 0.8), DVec3::new(0.8, 0.0, -0.6)),
    ] {
        let mut text = StepText::millimetres();
        let solid = text.solid_box("", DVec3::new(1.0, 2.0, 3.0), true);
        let block = text.part("block", &[solid]);
        let root = text.assembly("root");
        let (at, along) = (text.point(DVec3::ONE), text.direction(z));
        let given = text.add(&format!("AXIS2_PLACEMENT_3D('',#{at},#{along},$)"));
        let own = text.origin();
        text.component_by_entities("a", root, block, [own, given]);
        text.component_by_entities("b", root, block, [given, own]);
        let model = load(&text.finish()).unwrap();
        let expected = DAffine3 {
            matrix3: DMat3::from_cols(x, z.cross(x), z),
            translation: DVec3::ONE,
        };
        for (part, expected) in model.parts.iter().zip([expected, expected.inverse()]) {
            assert!(
                part.placement.abs_diff_eq(expected, 1e-12),
                "{z}: {} is not {expected}",
                part.placement
            );
        }
    }
}

#[test]
fn open_shells_alone_are_a_leaky_part() {
    let mut text = StepText::millimetres();
    let faces = text.box_faces(DVec3::splat(2.0), true);
    let shell = text.add(&format!("OPEN_SHELL('',{})", support::list(&faces[1..])));
    let surface = text.add(&format!("SHELL_BASED_SURFACE_MODEL('',(#{shell}))"));
    let whole = text.representation("MANIFOLD_SURFACE_SHAPE_REPRESENTATION", &[surface]);
    text.product("tray", whole);
    let model = load(&text.finish()).unwrap();
    assert_eq!(names(&model), ["tray"]);
    assert!(!model.shapes[0].closed);
    assert_eq!((model.shapes[0].faces.len(), model.shapes[0].open_edges), (5, 4));
    assert!(
        model
            .warnings
            .iter()
            .any(|w| w.contains("tray: is not closed: 4 mesh edges")),
        "{:?}",
        model.warnings
    );
}

#[test]
fn faces_beside_solids_are_left_out_and_said_so() {
    let mut text = StepText::millimetres();
    let solid = text.solid_box("", DVec3::splat(2.0), true);
    let faces = text.box_faces(DVec3::splat(5.0), true);
    let shell = text.add(&format!("OPEN_SHELL('',{})", support::list(&faces[1..])));
    let surface = text.add(&format!("SHELL_BASED_SURFACE_MODEL('',(#{shell}))"));
    text.part("both", &[solid, surface]);
    let model = load(&text.finish()).unwrap();
    assert_eq!(names(&model), ["both"]);
    assert!(model.shapes[0].closed);
    assert!(
        model
            .warnings
            .iter()
            .any(|w| w.contains("5 faces outside its solids")),
        "{:?}",
        model.warnings
    );
}

#[test]
fn faces_and_solids_keep_their_colours() {
    let mut text = StepText::millimetres();
    let faces = text.box_faces(DVec3::ONE, true);
    let shell = text.add(&format!("CLOSED_SHELL('',{})", support::list(&faces)));
    let solid = text.add(&format!("MANIFOLD_SOLID_BREP('',#{shell})"));
    text.part("box", &[solid]);
    text.color(solid, [0.0, 1.0, 0.0]);
    text.color(faces[0], [1.0, 0.0, 0.0]);
    let model = load(&text.finish()).unwrap();
    assert_eq!(model.parts[0].color, Some([0.0, 1.0, 0.0]));
    let colored: Vec<_> = model.shapes[0]
        .faces
        .iter()
        .filter(|f| f.color.is_some())
        .collect();
    assert_eq!(colored.len(), 1);
    assert_eq!(colored[0].color, Some([1.0, 0.0, 0.0]));
    let Surface::Plane { frame } = colored[0].surface else {
        panic!("a plane")
    };
    assert!(
        frame.origin.z.abs() < 1e-12 && frame.z.z.abs() > 1.0 - 1e-12,
        "the bottom is red"
    );
}

#[test]
fn a_solid_that_the_kernel_loses_is_an_error_or_a_warning() {
    let mut text = StepText::millimetres();
    let good = text.solid_box("good", DVec3::splat(1.0), true);
    // A valid reference structure without geometry.
    let shell = text.add("CLOSED_SHELL('',())");
    let hollow = text.add(&format!("MANIFOLD_SOLID_BREP('hollow',#{shell})"));
    text.part("pair", &[good, hollow]);
    let text = text.finish();
    let error = load(&text).unwrap_err().to_string();
    assert!(
        error.contains("lost 1 of 2 solids") && error.contains("hollow") && !error.contains('\n'),
        "{error}"
    );
    let options = LoadOptions {
        allow_lost_solids: true,
        ..LoadOptions::default()
    };
    let model = load_step_with(support::file(&text), &options).unwrap();
    assert_eq!(names(&model), ["pair"]);
    assert!(
        model.warnings.iter().any(|w| w.contains("hollow")),
        "{:?}",
        model.warnings
    );
}

#[test]
fn an_assembly_that_unfolds_without_bound_is_refused() {
    let mut text = StepText::millimetres();
    let solid = text.solid_box("", DVec3::splat(1.0), true);
    let mut child = text.part("leaf", &[solid]);
    for level in 0..20 {
        let parent = text.assembly(&format!("level {level}"));
        text.component("left", parent, child, DAffine3::IDENTITY);
        text.component("right", parent, child, DAffine3::from_translation(DVec3::X));
        child = parent;
    }
    let options = LoadOptions {
        max_parts: 1000,
        ..LoadOptions::default()
    };
    let error = load_step_with(support::file(&text.finish()), &options).unwrap_err();
    assert!(error.to_string().contains("unfolds to 1048576 parts"), "{error}");
}

fn rigid() -> impl Strategy<Value = DAffine3> {
    let angle = -3.0..3.0f64;
    let along = -50.0..50.0f64;
    (
        (angle.clone(), angle.clone(), angle),
        (along.clone(), along.clone(), along),
    )
        .prop_map(|(r, t)| {
            let rotation = DQuat::from_euler(glam::EulerRot::XYZ, r.0, r.1, r.2);
            DAffine3::from_rotation_translation(rotation, DVec3::from(t))
        })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Placements through nested subassemblies multiply; mass properties do not depend on the unit.
    #[test]
    fn nested_placements_and_units(
        motions in proptest::collection::vec(rigid(), 1..6),
        size in (0.5..20.0f64, 0.5..20.0f64, 0.5..20.0f64),
        unit in 0usize..4,
    ) {
        let (body, name, mm) = [
            ("(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.))", "millimetre", 1.0),
            ("(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT($,.METRE.))", "metre", 1000.0),
            ("LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(0.0254),#SI);(CONVERSION_BASED_UNIT('INCH',#MEASURE)LENGTH_UNIT()NAMED_UNIT(#SI))", "inch", 25.4),
            ("LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(0.03),#SI);(CONVERSION_BASED_UNIT('sun',#MEASURE)LENGTH_UNIT()NAMED_UNIT(#SI))", "sun", 30.0),
        ][unit];
        let size = DVec3::from(size);
        let mut text = StepText::new(body);
        let solid = text.solid_box("", size, true);
        let mut child = text.part("leaf", &[solid]);
        let mut whole = DAffine3::IDENTITY;
        for (level, motion) in motions.iter().enumerate() {
            let parent = text.assembly(&format!("level {level}"));
            let inside = if level == 0 { "the leaf".into() } else { format!("sub {level}") };
            text.component(&inside, parent, child, *motion);
            whole = *motion * whole;
            child = parent;
        }
        let model = load(&text.finish()).unwrap();
        prop_assert_eq!(&model.unit, name);
        prop_assert_eq!(names(&model), ["the leaf"]);
        prop_assert_eq!(model.parts[0].path.len(), motions.len() - 1);
        let shape = &model.shapes[0];
        let (size, corner) = (size * mm, size * mm);
        let volume = size.x * size.y * size.z;
        // Planes only: quadrature is exact, so the difference is rounding.
        prop_assert!((shape.volume_mm3 / volume - 1.0).abs() < 1e-9);
        prop_assert!(shape.center_of_mass.distance(size / 2.0) < 1e-9 * size.length());
        let xx = volume * (size.y * size.y + size.z * size.z) / 12.0;
        prop_assert!((shape.inertia_mm5[0][0] / xx - 1.0).abs() < 1e-9);
        prop_assert!(shape.closed);
        prop_assert_eq!(shape.edges.len(), 12);
        prop_assert!(shape.edges.iter().all(|e| e.faces.len() == 2 && e.polyline.len() == 2));
        let placed = model.parts[0].placement.transform_point3(corner);
        let want = whole.matrix3 * corner + whole.translation * mm;
        prop_assert!(placed.distance(want) < 1e-9 * (1.0 + want.length()), "{} is not {}", placed, want);
    }
}

/// A bar of radius 3 that ends in a ball of radius 6.5; the circle between them crosses the ball's seam, and its edges have pcurves. Kernels before version
/// 7.9 take the ball for the dimple that it would leave in the bar.
#[test]
fn a_ball_on_a_bar_is_no_dimple() {
    let model = load(include_str!("data/ball_on_bar.step")).unwrap();
    let (bar, ball, length) = (3.0f64, 6.5f64, 14.0);
    let along = (ball * ball - bar * bar).sqrt();
    let common = 2.0 / 3.0 * PI * (ball.powi(3) - along.powi(3));
    let volume = 4.0 / 3.0 * PI * ball.powi(3) + PI * bar * bar * length - common;
    let found = model.shapes[0].volume_mm3;
    assert!((found - volume).abs() < 1e-6 * volume, "{found} is not {volume}");
    let (low, high) = placed_box(&model, 0);
    assert!((high.x - low.x - length - ball).abs() < 0.1, "{low} to {high}");
    assert_eq!(model.warnings, [""; 0]);
}
