//! The repository's examples, round trips, and the messages about invalid descriptions.

use super::*;

#[test]
fn every_example_reads_can_work_and_comes_back_as_written() {
    for (name, text) in EXAMPLES {
        let rig = parse_rig(text, name).unwrap_or_else(|error| panic!("{error}"));
        let found = abilities(&rig).expect(name);
        assert!(found.resolution_mm < 0.2, "{found:?}");
        assert!(found.force_weakest_n > 0.4, "{found:?}");
        assert!(
            found.force_strongest_n <= f64::from(rig.ceilings.force),
            "{found:?}"
        );
        // Six digits in the file's units are within 2⁻¹⁷ of the value; writing them again gives the same text.
        let written = write_rig(&rig);
        let again = parse_rig(&written, name).unwrap_or_else(|error| panic!("{written}\n{error}"));
        assert_eq!(write_rig(&again), written);
        assert_eq!(again.joints.len(), rig.joints.len());
        for (joint, before) in again.joints.iter().zip(&rig.joints) {
            assert!((joint.home - before.home).abs() <= 1e-5 * before.home.abs());
            assert_eq!(joint.counts_per_turn, before.counts_per_turn);
        }
    }
}

/// The examples are complete: each key of each table appears in at least one of them.
#[test]
fn every_key_is_in_an_example_and_in_the_page() {
    let page = include_str!("../../../../docs/rigs.md");
    for row in mortise_protocol::rig::RIG_KEYS {
        let (_, key) = row.key.split_once('.').expect(row.key);
        let key = key.split('[').next().expect("has a first piece");
        assert!(
            EXAMPLES
                .iter()
                .any(|(_, text)| text.contains(&format!("\n{key} = "))),
            "{key}"
        );
        let line = format!("| `{}` | {} | {} | {} |", row.key, row.unit, row.min, row.max);
        assert!(page.contains(&line), "docs/rigs.md lacks: {line}");
    }
}

#[test]
fn what_is_wrong_is_said_with_place_value_range_and_what_to_do() {
    let (_, good) = EXAMPLES[2];
    let said = |from: &str, to: &str| {
        assert!(good.contains(from), "{from}");
        let text = good.replacen(from, to, 1);
        parse_rig(&text, "arm.toml")
            .map(|_| ())
            .expect_err(to)
            .to_string()
    };
    let words = said("current_limit_a = 3.0", "current_limit_a = 300.0");
    for piece in [
        "arm.toml",
        "current_limit_a of joint 1",
        "300",
        "0.01 to 30 A",
        "largest current",
    ] {
        assert!(words.contains(piece), "{words}");
    }
    assert!(said("upper_mm = 205", "upper_mm = nan").contains("kinematics.upper_mm is NaN"));
    assert!(said("upper_mm = 205", "uper_mm = 205").contains("uper_mm"));
    assert!(said("kind = \"serial-arm\"", "kind = \"spring\"").contains("spring"));
    assert!(said("kind = \"serial-arm\"", "kind = \"paddle\"").contains("radius_mm"));
    assert!(said("name = ", "name = 5 #").contains("line"));
    assert!(said("home_deg = 90", "home_deg = 170").contains("range_deg"));
    assert!(said("workspace_mm = ", "workspace_mm = 20 #").contains("outside ceilings.workspace_mm"));
    let long = format!("name = \"{}\" #", "x".repeat(40));
    assert!(said("name = ", &long).contains("shorten"));
    assert!(
        load_rig(Path::new("no such file.toml"))
            .expect_err("absent")
            .to_string()
            .contains("check the path")
    );
}

#[test]
fn nothing_that_is_read_makes_it_panic() {
    let mut random = fastrand::Rng::with_seed(7);
    for (name, good) in EXAMPLES {
        for _ in 0..2_000 {
            let mut bytes = good.as_bytes().to_vec();
            for _ in 0..random.usize(1..6) {
                let place = random.usize(0..bytes.len());
                bytes[place] = random.u8(b' '..b'~');
            }
            if let Ok(rig) = parse_rig(&String::from_utf8_lossy(&bytes), name) {
                // Every accepted description yields capabilities.
                assert!(abilities(&rig).is_ok());
            }
        }
    }
}
