//! `docs/scene-image.md` states every record's size and every field's offset as in the code.

use std::mem::offset_of;

use mortise_protocol::image::*;

/// Rows `| offset | `field` |` under the heading `## Name, N bytes`.
fn check(page: &str, name: &str, size: usize, fields: &[(&str, usize)]) {
    let heading = format!("## {name}, {size} bytes\n");
    let start = page
        .find(&heading)
        .unwrap_or_else(|| panic!("no heading {heading:?}"));
    let section = &page[start + heading.len()..];
    let section = &section[..section.find("\n## ").unwrap_or(section.len())];
    for (field, offset) in fields {
        let row = format!("| {offset} | `{field}` |");
        assert!(section.contains(&row), "{name}: no row {row}");
    }
    let rows = section
        .lines()
        .filter(|line| line.starts_with("| ") && line.contains(" | `"))
        .count();
    assert_eq!(rows, fields.len(), "{name}: rows for fields that are not there");
}

macro_rules! record {
    ($page:expr, $name:literal, $record:ty, $($field:ident)*) => {
        check(
            $page,
            $name,
            size_of::<$record>(),
            &[$((stringify!($field), offset_of!($record, $field))),*],
        )
    };
}

#[test]
fn page_and_records_agree() {
    let page = include_str!("../../docs/scene-image.md");
    assert!(page.starts_with(&format!("# Scene image, layout {LAYOUT_VERSION}\n")));
    record!(page, "Header", Header, magic layout length crc energies parts shapes fields nodes points faces patches bricks palette grid blob edges spans);
    record!(page, "Part", PartRecord, shape flags position orientation);
    record!(page, "Shape", ShapeRecord, field flags first_node node_count first_point point_count first_face face_count first_patch patch_count center radius volume center_of_mass inertia first_edge_node edge_node_count first_edge edge_count first_span span_count);
    record!(page, "Field", FieldRecord, origin cell scale band brick_dims format first_grid first_brick brick_count);
    record!(page, "Brick", BrickRecord, samples indices palette palette_len index_bits coarse);
    record!(page, "Node", NodeRecord, center radius first_point point_count skip);
    record!(page, "Point", PointRecord, position normal face edge_face span reserved);
    record!(page, "Span", SpanRecord, along bend round);
    record!(page, "Face", FaceRecord, kind sense origin axis radius second);
    record!(page, "Edge", EdgeRecord, center half bend normals faces thickness edge radius);
    record!(page, "Patch", PatchRecord, origin x normal height radius face kind);
    record!(page, "Energy block", EnergyBlock, energies charges nodes);
    record!(page, "Energy record", EnergyRecord, moving fixed first_node first_charge charge_count origin step size reserved largest_force way across along turning);
    record!(page, "Charge", ChargeRecord, at charge);
    for limit in [
        ENERGY_DEPTHS,
        BRICK_CELLS,
        BRICK_SAMPLES,
        GridEntry::MAX_BRICKS,
        usize::from(NO_FACE),
    ] {
        assert!(page.contains(&limit.to_string()), "{limit}");
    }
}
