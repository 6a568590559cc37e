//! Freedoms against those known by hand: this project's joints, and the shared box with its board, lid and screws.

use crate::support;
use glam::{DAffine3, DVec3};
use mortise_task::mobility::{Freedoms, Reach, freedoms};
use mortise_task::{Assembly, Moved};
use serde_json::Value;

fn of(assembly: &Assembly, part: usize) -> Freedoms {
    let others: Vec<usize> = (0..assembly.count()).filter(|&p| p != part).collect();
    freedoms(
        assembly,
        &Moved {
            parts: &[part],
            by: DAffine3::IDENTITY,
        },
        &others,
        &[],
    )
}

/// Ways out along the axes, as `+x` and so on, sorted.
fn ways(found: &Freedoms) -> Vec<String> {
    let names = [
        ("+x", DVec3::X),
        ("-x", DVec3::NEG_X),
        ("+y", DVec3::Y),
        ("-y", DVec3::NEG_Y),
        ("+z", DVec3::Z),
        ("-z", DVec3::NEG_Z),
    ];
    let mut out: Vec<String> = found
        .ways_out()
        .filter_map(|d| names.iter().find(|(_, n)| n.dot(d) > 1.0 - 1e-6))
        .map(|(n, _)| (*n).to_owned())
        .collect();
    out.sort();
    out
}

#[test]
fn two_pins_leave_one_way() {
    let assembly = support::own("mating/tests/data/two_pin_exact.step");
    let link = of(&assembly, assembly.part("two-pin-link").unwrap());
    // Two bores leave their direction, the plate under the link one way of it.
    assert_eq!((link.lines, link.rays), (0, 1));
    assert_eq!(ways(&link), ["+z"]);
    assert_eq!(
        (link.translations.len(), link.rotations.len()),
        (1, 0),
        "{link:?}"
    );
}

#[test]
fn a_ball_in_a_bore_slides_both_ways_and_turns() {
    let assembly = support::own("mating/tests/data/ball_in_cylinder.step");
    let ball = of(&assembly, assembly.part("ball-with-stem").unwrap());
    assert_eq!(ways(&ball), ["+z", "-z"]);
    assert!(ball.translations.iter().all(|t| t.two_sided), "{ball:?}");
    let about_z = ball
        .rotations
        .iter()
        .find(|r| r.direction[2].abs() > 0.999)
        .unwrap();
    assert_eq!(about_z.reach, Reach::Full);
}

#[test]
fn a_taper_leaves_towards_its_wide_end_only() {
    let assembly = support::own("mating/tests/data/cone_in_cone.step");
    let plug = of(&assembly, assembly.part("taper-plug").unwrap());
    assert_eq!(ways(&plug), ["+z"]);
    // Half angle of the taper: its extreme rays are that far from the axis, and by the sampling of the cone's normals a little farther.
    let half = (3.0f64 / 30.0).atan();
    assert!(
        plug.rays >= 8
            && plug
                .translations
                .iter()
                .all(|t| t.direction[2] >= half.cos() - 1e-4),
        "{plug:?}"
    );
}

/// Of every part the ways out that the file beside it names, and no play below 0.1 mm counts as a freedom.
#[test]
fn the_box_has_the_freedoms_of_its_table() {
    let Some(folder) = support::shared("the_box_has_the_freedoms_of_its_table") else {
        return;
    };
    let folder = folder.join("10_extraction");
    let assembly = support::load(&folder, "box_with_board.step");
    let table: Value =
        serde_json::from_str(&std::fs::read_to_string(folder.join("box_with_board.freedoms.json")).unwrap())
            .unwrap();
    for part in 0..assembly.count() {
        let entry = &table["parts"][assembly.name(part)];
        let found = of(&assembly, part);
        let mut want: Vec<String> = entry["all_in_place"]
            .as_array()
            .unwrap()
            .iter()
            .map(|w| w.as_str().unwrap().to_owned())
            .collect();
        want.sort();
        assert_eq!(ways(&found), want, "{}", assembly.name(part));
        let turns = found.rotations.iter().any(|r| r.reach == Reach::Full);
        assert_eq!(turns, !entry["turn"].is_null(), "{}", assembly.name(part));
        assert!(
            found
                .translations
                .iter()
                .all(|t| t.range_mm.is_none_or(|mm| mm >= 0.1)),
            "{found:?}"
        );
    }
}
