//! `docs/protocol.md` agrees with the code: the same messages, refusals, limits and parameters, no more and no fewer.

use mortise_protocol::limits;
use mortise_protocol::message::{FromDevice, Refusal, ToDevice};
use mortise_protocol::parameter::PARAMETERS;
use postcard_schema::Schema;
use postcard_schema::schema::DataModelType;

fn page() -> String {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/protocol.md");
    std::fs::read_to_string(path).expect("docs/protocol.md is part of the repository")
}

/// Rows of the table under `heading`, each as its cells.
fn table(heading: &str) -> Vec<Vec<String>> {
    let page = page();
    let (_, section) = page.split_once(&format!("\n## {heading}\n")).expect(heading);
    let section = section.split("\n## ").next().unwrap_or_default();
    section
        .lines()
        .filter(|line| line.starts_with("| `"))
        .map(|line| {
            let cells = line.trim_matches('|').split('|');
            cells
                .map(|cell| cell.trim().trim_matches('`').to_owned())
                .collect()
        })
        .collect()
}

fn names(heading: &str) -> Vec<String> {
    table(heading).into_iter().map(|row| row[0].clone()).collect()
}

fn variants<M: Schema>() -> Vec<&'static str> {
    match M::SCHEMA.ty {
        DataModelType::Enum(variants) => variants.iter().map(|variant| variant.name).collect(),
        _ => panic!("not an enum"),
    }
}

#[test]
fn the_page_lists_every_message_and_refusal_in_order() {
    assert_eq!(names("Host to board"), variants::<ToDevice>());
    assert_eq!(names("Board to host"), variants::<FromDevice>());
    assert_eq!(names("Refusals"), variants::<Refusal>());
}

#[test]
fn the_page_has_the_limits_of_the_code() {
    let expected = [
        ("MAX_MESSAGE", limits::MAX_MESSAGE),
        ("MAX_FRAME", limits::MAX_FRAME),
        ("MAX_CHUNK", limits::MAX_CHUNK),
        ("MAX_PARTS", limits::MAX_PARTS),
        ("MAX_PAIRS", limits::MAX_PAIRS),
        ("MAX_TARGETS", limits::MAX_TARGETS),
        ("MAX_TARGET_PAIRS", limits::MAX_TARGET_PAIRS),
        ("MAX_PATH_RATE", limits::MAX_PATH_RATE as usize),
        ("MAX_KEYFRAMES", limits::MAX_KEYFRAMES),
        ("MAX_INPUT_FAULTS", limits::MAX_INPUT_FAULTS),
        ("MAX_LOG", limits::MAX_LOG),
        ("MAX_JOINTS", limits::MAX_JOINTS),
        ("MAX_ENCODERS", limits::MAX_ENCODERS),
        ("MAX_NAME", limits::MAX_NAME),
    ];
    let found: Vec<(String, String)> = table("Limits")
        .into_iter()
        .map(|row| (row[0].clone(), row[1].clone()))
        .collect();
    let expected: Vec<(String, String)> = expected
        .iter()
        .map(|(name, value)| ((*name).to_owned(), value.to_string()))
        .collect();
    assert_eq!(found, expected);
}

#[test]
fn the_page_has_every_parameter_with_its_range() {
    let rows = table("Parameters");
    assert_eq!(rows.len(), PARAMETERS.len());
    for (row, parameter) in rows.iter().zip(PARAMETERS) {
        assert_eq!(row[0], parameter.name);
        assert_eq!(row[1], parameter.unit, "{}", parameter.name);
        for (cell, value) in row[2..5]
            .iter()
            .zip([parameter.min, parameter.max, parameter.default])
        {
            let written: f32 = cell.parse().expect(cell);
            assert_eq!(written, value, "{}", parameter.name);
        }
    }
}
