//! Probed distances against closed form: peg ø20 × 50 in hole ø20.2 through a 60 × 60 × 40 block.
//!
//! Both parts have their origin at their centre and the hole along z.

use std::path::{Path, PathBuf};

use glam::{DQuat, DVec3};
use mortise_lab::scene_p::{By, aside, ask};
use mortise_lab::variant::Variant;
use mortise_scenario::ScenarioError;
use mortise_scenario::probe::{NamedPose, ProbeScene, Resolution, read_poses};

/// Tolerance of gaps, mm: samples along circles are as dense as a bound of 5 µm requires (cell/100), which between curves of nearly equal radii
/// leaves a tenth of a micrometre, but a peg against a flat may touch between two samples.
const GAP_TOLERANCE_MM: f64 = 0.005;
/// Tolerance of depths, mm.
const DEPTH_TOLERANCE_MM: f64 = 0.010;

/// Largest error of a distance called exact, mm.
const EXACT_MM: f64 = 0.001;

fn file() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data/scene_p.step")
}

#[test]
fn scene_p_against_closed_form() {
    let asked = ask(&Variant::field(0.5)).expect("the file is part of the sources");
    let (gap, gap_at) = asked.worst(By::Probe, true);
    let (depth, depth_at) = asked.worst(By::Probe, false);
    println!("{} poses, image of {} bytes", asked.rows.len(), asked.image_bytes);
    println!("gap: {:.2} µm off at {gap_at}", 1e3 * gap);
    println!("depth: {:.2} µm off at {depth_at}", 1e3 * depth);
    for (exact, row) in &asked.rows {
        let off = 1e3 * (row.distance_mm - exact);
        let field = row
            .field_distance_mm
            .map_or(f64::NAN, |field| 1e3 * (field - exact));
        println!(
            "{off:9.2} µm, field {field:9.2} µm, exact {exact:8.4}, {:?}, {row}",
            row.resolution
        );
    }
    println!("median {} ns", asked.median_ns());
    for (exact, row) in &asked.rows {
        let off = (row.distance_mm - exact).abs();
        let tolerance = if *exact < 0.0 {
            DEPTH_TOLERANCE_MM
        } else {
            GAP_TOLERANCE_MM
        };
        assert!(off <= tolerance, "{exact} mm: {row}");
        // What is called exact is, and every stated error holds.
        assert!(row.error_um.is_none_or(|um| 1e3 * off <= um), "{off} mm: {row}");
        if row.resolution == Resolution::Exact {
            assert!(off <= EXACT_MM, "{off} mm: {row}");
        }
        // Every gap is proven; the depth of a part that is not convex is that of a sample.
        assert!(
            *exact < EXACT_MM || row.resolution == Resolution::Exact,
            "{exact} mm: {row}"
        );
        // Poses clearly apart have no contact; clearly penetrating ones have.
        if *exact > GAP_TOLERANCE_MM {
            assert_eq!(row.contacts, 0, "{row}");
            assert_eq!(row.force_n, [0.0; 3], "{row}");
        }
        if *exact < -DEPTH_TOLERANCE_MM {
            assert!(row.contacts > 0, "{row}");
            assert!(
                row.force_n.iter().chain(&row.torque_nm).any(|x| *x != 0.0),
                "{row}"
            );
        }
    }
}

/// The force on a part pushed into the wall points back out.
#[test]
fn force_points_out_of_the_wall() {
    let scene = ProbeScene::load(&file(), Some(0.5)).expect("the file is part of the sources");
    let pair = scene.pair("peg", Some("block")).expect("these parts");
    let pushed = NamedPose {
        name: "pushed".into(),
        position_mm: aside(0.15, 0.9),
        orientation: DQuat::IDENTITY,
    };
    let row = scene.probe(pair, &pushed).expect("a good pose");
    let force = DVec3::from_array(row.force_n.map(f64::from));
    // The samples are not symmetric about the line of contact: tolerance of half their spacing, 0.045 rad.
    assert!(
        force.normalize().dot(-aside(1.0, 0.9)) > f64::cos(0.05),
        "{row} {force}"
    );
    assert_eq!(usize::from(row.contacts), row.contact_points.len());
}

#[test]
fn mistakes_are_one_line() {
    let absent = read_poses(Path::new("absent.csv")).expect_err("there is none");
    assert!(matches!(absent, ScenarioError::Unreadable { .. }), "{absent}");
    let absent = ProbeScene::load(Path::new("absent.step"), None)
        .err()
        .expect("there is none");
    assert!(matches!(absent, ScenarioError::Unreadable { .. }), "{absent}");
    let scene = ProbeScene::load(&file(), Some(2.0)).expect("the file is part of the sources");
    let unknown = scene.pair("pin", None).expect_err("there is none");
    assert!(unknown.to_string().contains("no part `pin`"), "{unknown}");
    assert!(unknown.to_string().contains("block, peg"), "{unknown}");
    let same = scene.pair("peg", Some("peg")).expect_err("one part");
    for error in [absent, unknown, same] {
        assert!(!error.to_string().contains('\n'), "{error}");
    }
}
