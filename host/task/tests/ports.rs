//! Ports and connections of this project's test parts.

mod support;

use mortise_task::graph::{Connection, graph};
use mortise_task::ports::{Port, ports};

#[test]
fn a_hole_and_its_peg_are_ports() {
    let assembly = support::own("app/samples/pair_d18.75_clear1.00.step");
    let extrusions = |part: &str| -> Vec<Port> {
        ports(&assembly, assembly.part(part).unwrap())
            .into_iter()
            .filter(|p| matches!(p, Port::Extrusion { .. }))
            .collect()
    };
    let [
        Port::Extrusion {
            sex: "female",
            diameter_mm,
            capacity_mm: [low, high],
            through: Some(true),
            thread: false,
            span_deg,
            ..
        },
    ] = extrusions("block")[..]
    else {
        panic!("{:?}", extrusions("block"))
    };
    assert!((diameter_mm - 18.75).abs() < 1e-9 && high - low > 10.0 && span_deg > 359.0);
    let [
        Port::Extrusion {
            sex: "male",
            diameter_mm,
            through: None,
            ..
        },
    ] = extrusions("peg")[..]
    else {
        panic!("{:?}", extrusions("peg"))
    };
    assert!((diameter_mm - 17.75).abs() < 1e-9);
    assert_eq!(graph(&assembly).edge_count(), 0, "they are apart");
}

#[test]
fn connections_have_their_kinds() {
    let kinds = |file: &str| -> Vec<Connection> {
        let assembly = support::own(&format!("mating/tests/data/{file}"));
        graph(&assembly)
            .edge_weights()
            .flat_map(|e| e.kinds.clone())
            .collect()
    };
    assert_eq!(
        kinds("two_pin_exact.step"),
        [Connection::Inserted, Connection::Resting]
    );
    assert_eq!(kinds("cone_in_cone.step"), [Connection::Seated]);
    assert_eq!(kinds("ball_in_socket.step"), [Connection::Ball]);
    assert_eq!(kinds("ball_in_cylinder.step"), [Connection::Ball]);
}

#[test]
fn screws_of_the_box_are_screwed_into_it() {
    let Some(folder) = support::shared("screws_of_the_box_are_screwed_into_it") else {
        return;
    };
    let assembly = support::load(&folder.join("10_extraction"), "box_with_board.step");
    let box_part = assembly.part("box").unwrap();
    let screwed = graph(&assembly)
        .edge_weights()
        .filter(|e| e.parts.contains(&box_part) && e.kinds.contains(&Connection::Screwed))
        .count();
    assert_eq!(screwed, 4);
}
