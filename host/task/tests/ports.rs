//! Ports and connections of this project's test parts, and of random pairs with a profile in a hole.

use crate::support;
use mortise_shapes::KINDS;
use mortise_task::graph::{Edge, graph};
use mortise_task::ports::{Geometry, Port, ports};
use mortise_task::{Assembly, catalogue, report};

fn kinds(edge: &Edge) -> Vec<&'static str> {
    edge.kinds.iter().map(|kind| kind.kind().name.as_str()).collect()
}

#[test]
fn a_hole_and_its_peg_are_ports() {
    let assembly = support::own("app/samples/pair_d18.75_clear1.00.step");
    let rounds = |part: &str| -> Vec<Port> {
        ports(&assembly, assembly.part(part).unwrap())
            .into_iter()
            .filter(|p| matches!(p.geometry, Geometry::Extrusion { profile: None, .. }))
            .collect()
    };
    let holes = rounds("block");
    let [hole] = &holes[..] else { panic!("{holes:?}") };
    let Geometry::Extrusion {
        sex: "female",
        diameter_mm,
        capacity_mm: [low, high],
        through: Some(true),
        thread: false,
        span_deg,
        ..
    } = hole.geometry
    else {
        panic!("{hole:?}")
    };
    assert!((diameter_mm - 18.75).abs() < 1e-9 && high - low > 10.0 && span_deg > 359.0);
    assert_eq!(hole.is, ["through_bore", "bore", "female", "extrusion"]);
    let pegs = rounds("peg");
    let [peg] = &pegs[..] else { panic!("{pegs:?}") };
    let Geometry::Extrusion {
        sex: "male",
        diameter_mm,
        through: None,
        ..
    } = peg.geometry
    else {
        panic!("{peg:?}")
    };
    assert!((diameter_mm - 17.75).abs() < 1e-9);
    assert_eq!(graph(&assembly).edge_count(), 0, "they are apart");
}

/// The region of a plane has the area of the plane: that within its outer line less that within its holes.
#[test]
fn a_plane_has_a_region() {
    let assembly = support::own("app/samples/pair_d18.75_clear1.00.step");
    let mut holes = 0;
    for port in (0..2).flat_map(|part| ports(&assembly, part)) {
        let Geometry::Plane {
            normal,
            area_mm2,
            region_mm,
            ..
        } = port.geometry
        else {
            continue;
        };
        let normal = glam::DVec3::from(normal);
        let within = |line: &Vec<[f64; 3]>| -> f64 {
            let points: Vec<glam::DVec3> = line.iter().map(|p| (*p).into()).collect();
            let next = points.iter().cycle().skip(1);
            (points.iter().zip(next))
                .map(|(p, q)| 0.5 * (*p - points[0]).cross(*q - points[0]).dot(normal))
                .sum()
        };
        let areas: Vec<f64> = region_mm.iter().map(within).collect();
        holes += areas.iter().filter(|area| **area < 0.0).count();
        // Chords of a circle leave out less than a hundredth of its area.
        let sum: f64 = areas.iter().sum();
        assert!(
            (sum - area_mm2).abs() < 0.01 * area_mm2.max(sum),
            "{areas:?} {area_mm2}"
        );
    }
    assert_eq!(holes, 2, "the bore's ends");
}

#[test]
fn connections_have_their_kinds() {
    let connected = |file: &str| -> Vec<&str> {
        let assembly = support::own(&format!("mating/tests/data/{file}"));
        graph(&assembly).edge_weights().flat_map(kinds).collect()
    };
    assert_eq!(connected("two_pin_exact.step"), ["inserted", "resting"]);
    assert_eq!(connected("cone_in_cone.step"), ["seated"]);
    assert_eq!(connected("ball_in_socket.step"), ["ball"]);
    assert_eq!(connected("ball_in_cylinder.step"), ["ball"]);
}

/// Rings sit in the grooves at both ends of a pin; one that is moved between the grooves is in none.
#[test]
fn between_two_grooves_there_is_no_fit_of_their_diameter() {
    let Some(folder) = support::shared("between_two_grooves_there_is_no_fit_of_their_diameter") else {
        return;
    };
    let mut model = support::load(&folder.join("10_extraction"), "hinge.step").model;
    for count in [2, 1] {
        let assembly = Assembly::new(model.clone()).unwrap();
        let in_groove: Vec<f64> = (graph(&assembly).edge_weights())
            .flat_map(|edge| &edge.fits)
            .filter(|fit| fit.is_round && (fit.radius_mm - 2.5).abs() < 1e-9)
            .map(|fit| fit.length_mm)
            .collect();
        assert_eq!(in_groove.len(), count, "{in_groove:?}");
        assert!(
            in_groove.iter().all(|length| (length - 1.0).abs() < 1e-6),
            "{in_groove:?}"
        );
        // Along the pin.
        let ring = assembly.part("ring_left").unwrap();
        model.parts[ring].placement.translation.x += 20.0;
    }
}

/// Plugs and shafts of any form in holes of theirs: connected as guided, with the designed clearance to the accuracy of the tessellation.
#[test]
fn profiles_in_their_holes_are_fits() {
    // By place in `Designed::random`. Lobed plugs (splines) with clearance are extruded; it is radial there, and so never less than that of the outlines.
    for (kind, name, through) in [
        (1, "D plug", Some(false)),
        (2, "keyed shaft", Some(true)),
        (3, "polygonal plug", Some(false)),
        (9, "lobed", None),
    ] {
        for turn in 0..6 {
            let seed = turn * KINDS as u64 + kind;
            let (designed, assembly) = support::random(seed);
            if name == "lobed" && designed.clearance == 0.0 {
                continue;
            }
            assert_eq!(designed.kind, name, "seed {seed}");
            let graph = graph(&assembly);
            let fits: Vec<_> = (graph.edge_weights())
                .flat_map(|edge| edge.fits.iter().map(|fit| (kinds(edge), *fit)))
                .filter(|(_, fit)| !fit.is_round)
                .collect();
            let [(kinds, fit)] = &fits[..] else {
                panic!("seed {seed}, {name}: {fits:?}")
            };
            let chords: f64 = assembly
                .model
                .shapes
                .iter()
                .map(|shape| shape.deflection_mm)
                .sum();
            let off = fit.clearance_mm - designed.clearance;
            let least = if name == "lobed" {
                0.5 * designed.clearance
            } else {
                0.0
            };
            assert!(
                (-least - chords - 1e-6..=chords + 1e-6).contains(&off),
                "seed {seed}, {name}: {off} of {chords}"
            );
            assert!(kinds.contains(&"guided"), "seed {seed}, {name}: {kinds:?}");
            assert!(
                through.is_none_or(|through| fit.is_through == through),
                "seed {seed}, {name}"
            );
        }
    }
}

#[test]
fn a_catalogue_states_what_a_file_cannot() {
    let file = "mating/tests/data/two_pin_exact.step";
    let mut assembly = support::own(file);
    let [a, b] = [assembly.name(0).to_owned(), assembly.name(1).to_owned()];
    let connection =
        |kind: &str| format!("[[connection]]\nbetween = [\"{a}\", \"{b}\"]\nkind = \"{kind}\"\n");
    let stated = catalogue::read(&connection("welded"), &assembly).unwrap();
    assembly.stated = stated;
    let edges = graph(&assembly);
    let welded: Vec<&str> = edges.edge_weights().flat_map(kinds).collect();
    assert_eq!(welded, ["welded", "inserted", "resting"]);
    // What is welded does not come apart, and moves as one.
    let found = mortise_task::sequence::disassemble(&assembly, &[0, 1], std::time::Duration::from_secs(60));
    assert!(found.complete() && found.steps.is_empty());
    let stated = report::sequence(&assembly, &found, report::Sense::Disassembly);
    assert_eq!(stated.joined, [[a.as_str(), b.as_str()]]);
    // A thread that no name tells.
    let shaft = edges.edge_weights().next().unwrap().fits[0].parts[0];
    let name = assembly.name(shaft).to_owned();
    let text = format!("[[part]]\nname = \"{name}\"\nthread = true\n");
    assembly.stated = catalogue::read(&text, &assembly).unwrap();
    let edges = graph(&assembly);
    assert!(edges.edge_weights().flat_map(kinds).any(|kind| kind == "screwed"));
    // What is wrong is said.
    for (text, words) in [
        (
            connection("weldd"),
            "no kind of connection `weldd`; the kinds are welded",
        ),
        (connection("form_closure"), "no kind of connection `form_closure`"),
        (
            connection("welded").replace(&b, &a),
            "do not touch, so they are not welded",
        ),
        (
            connection("welded").replace(&b, "no such*"),
            "no part is named like `no such*`",
        ),
        ("[[part]]\nname = \"*\"\n".to_owned(), "missing field `thread`"),
        ("[[joint]]\n".to_owned(), "unknown field `joint`"),
        ("between = ".to_owned(), "TOML parse error at line 1"),
    ] {
        let error = catalogue::read(&text, &assembly).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
        assert_eq!(error.lines().count(), 1, "{error}");
    }
}

#[test]
fn screws_hold_in_the_last_part_or_in_their_nut() {
    let Some(folder) = support::shared("screws_hold_in_the_last_part_or_in_their_nut") else {
        return;
    };
    // Of each file: how many connections of a screw hold, and with what.
    for (file, count, with) in [
        ("10_extraction/box_with_board.step", 4, "box"),
        ("05_motor/motor_flat.step", 4, "back-cover"),
        ("real/as1-oc-214.stp", 8, "nut"),
    ] {
        let assembly = support::load(&folder, file);
        let graph = graph(&assembly);
        let screwed: Vec<[&str; 2]> = (graph.edge_weights())
            .filter(|edge| kinds(edge).contains(&"screwed"))
            .map(|edge| edge.parts.map(|part| assembly.name(part)))
            .collect();
        assert_eq!(screwed.len(), count, "{file}: {screwed:?}");
        let has = |pair: &[&str; 2]| pair.iter().any(|name| name.starts_with(with));
        assert!(screwed.iter().all(has), "{file}: {screwed:?}");
    }
}

/// Ports that are no planes, beside a table by hand from the dimensions with which the files were made: kind, diameter (of profiles none: their circle), length.
#[test]
fn shared_parts_have_the_ports_of_their_table() {
    let Some(folder) = support::shared("shared_parts_have_the_ports_of_their_table") else {
        return;
    };
    type Table<'a> = &'a [(&'a str, f64, f64)];
    let tables: &[(&str, &str, Table<'_>)] = &[
        // Grooves of 1.1 mm and ⌀ 5 at both ends of a pin of 58 mm.
        (
            "10_extraction/hinge.step",
            "hinge_pin",
            &[
                ("shaft", 6.0, 52.0),
                ("shaft", 6.0, 1.9),
                ("shaft", 6.0, 1.9),
                ("collar", 5.0, 1.1),
                ("collar", 5.0, 1.1),
            ],
        ),
        (
            "10_extraction/hinge.step",
            "bush_1",
            &[
                ("through_bore", 6.2, 9.85),
                ("shaft", 9.9, 8.85),
                ("collar", 14.0, 1.0),
            ],
        ),
        (
            "10_extraction/gearbox.step",
            "input_bearing",
            &[("through_bore", 10.04, 5.9), ("collar", 25.94, 5.9)],
        ),
        (
            "10_extraction/box_with_board.step",
            "screw_1",
            &[("threaded_shaft", 3.0, 18.0), ("threaded_shaft", 6.0, 2.5)],
        ),
        (
            "06_joints/cone_in_cone.step",
            "taper-plug",
            &[("shaft", 20.0, 15.0), ("taper", 20.0, 30.0)],
        ),
        (
            "06_joints/ball_in_socket.step",
            "socket",
            &[("socket", 20.0, 0.0), ("square_shaft", 40.0 * 2f64.sqrt(), 25.0)],
        ),
        (
            "06_joints/two_pin_exact.step",
            "socket-plate",
            &[
                ("through_bore", 6.0, 15.0),
                ("through_bore", 6.0, 15.0),
                ("prism", 60f64.hypot(40.0), 15.0),
                ("prism", 40f64.hypot(15.0), 60.0),
            ],
        ),
    ];
    for (file, part, table) in tables {
        let assembly = support::load(&folder, file);
        let found = ports(&assembly, assembly.part(part).unwrap());
        let mut found: Vec<(&str, f64, f64)> = (found.iter())
            .filter_map(|port| {
                let (diameter, [low, high]) = match port.geometry {
                    Geometry::Extrusion {
                        diameter_mm,
                        capacity_mm,
                        ..
                    } => (diameter_mm, capacity_mm),
                    Geometry::Taper {
                        diameters_mm: [a, b],
                        capacity_mm,
                        ..
                    } => (a.max(b), capacity_mm),
                    Geometry::Point { diameter_mm, .. } => (diameter_mm, [0.0; 2]),
                    Geometry::Plane { .. } => return None,
                };
                Some((port.is[0], diameter, high - low))
            })
            .collect();
        let mut wanted = table.to_vec();
        for list in [&mut found, &mut wanted] {
            list.sort_by(|a, b| {
                (a.0.cmp(b.0))
                    .then(a.1.total_cmp(&b.1))
                    .then(a.2.round().total_cmp(&b.2.round()))
            });
        }
        assert_eq!(found.len(), wanted.len(), "{file}, {part}: {found:?}");
        for (is, wanted) in found.iter().zip(&wanted) {
            let same = is.0 == wanted.0 && (is.1 - wanted.1).abs() < 1e-6 && (is.2 - wanted.2).abs() < 1e-6;
            assert!(same, "{file}, {part}: {is:?} for {wanted:?}");
        }
    }
}
