//! Probed distances against closed form: peg ø20 × 50 in hole ø20.2 through a 60 × 60 × 40 block.
//!
//! Both parts have their origin at their centre and the hole along z.

use std::path::{Path, PathBuf};

use glam::{DQuat, DVec3};
use mortise_lab::LabError;
use mortise_lab::probe::{NamedPose, ProbeRow, ProbeScene, Resolution, read_poses};

const PEG: f64 = 10.0;
const PEG_HALF: f64 = 25.0;
const HOLE: f64 = 10.1;
const BLOCK_HALF: f64 = 20.0;
const SIDE: f64 = 30.0;

/// Gaps: the samples along circles are as dense as a bound of 5 µm asks (cell/100), which between curves as alike as these leaves a tenth of
/// a micrometre, but a peg against a flat may come between two samples.
const GAP_TOLERANCE_MM: f64 = 0.005;
/// Depths likewise.
const DEPTH_TOLERANCE_MM: f64 = 0.010;

fn file() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/scene_p.step")
}

/// A pose, and the exact distance there.
struct Case {
    pose: NamedPose,
    exact_mm: f64,
}

fn case(name: String, position_mm: DVec3, orientation: DQuat, exact_mm: f64) -> Case {
    Case {
        pose: NamedPose {
            name,
            position_mm,
            orientation,
        },
        exact_mm,
    }
}

/// Where the peg is moved sideways, which way: not along the samples.
fn aside(by: f64, angle: f64) -> DVec3 {
    DVec3::new(by * angle.cos(), by * angle.sin(), 0.0)
}

fn cases() -> Vec<Case> {
    let none = DQuat::IDENTITY;
    let mut cases = Vec::new();
    // Inside the clearance, touching, and pushed into the wall: the gap is what the offset leaves of the clearance.
    for by in [0.0, 0.02, 0.05, 0.09, 0.1, 0.2, 0.3, 0.5, 0.8, 1.0, 1.1] {
        for angle in [0.0, 0.3, 1.23, 2.75, 4.0] {
            let exact = HOLE - PEG - by;
            let name = format!("{by} mm aside at {angle}");
            cases.push(case(name, aside(by, angle), none, exact));
        }
    }
    // Tilted: the rim comes nearest to the peg's side, and enters it.
    for tilt in [
        0.001, 0.002, 0.004, 0.0049, 0.0052, 0.006, 0.01, 0.02, 0.03, 0.04, 0.05,
    ] {
        for angle in [0.0, 0.7, 2.0, 3.3] {
            let axis = DVec3::new(-f64::sin(angle), f64::cos(angle), 0.0);
            let exact = HOLE * f64::cos(tilt) - BLOCK_HALF * f64::sin(tilt) - PEG;
            let name = format!("tilted by {tilt} at {angle}");
            cases.push(case(name, DVec3::ZERO, DQuat::from_axis_angle(axis, tilt), exact));
        }
    }
    // Over the block: flat on flat apart from the hole, rim to rim above it, and pressed into the top.
    for height in [40.0, 5.0, 1.0, 0.3, 0.02, 0.0, -0.1, -0.4, -1.0] {
        let up = DVec3::Z * (BLOCK_HALF + PEG_HALF + height);
        cases.push(case(
            format!("{height} mm over, 12 mm aside"),
            up + aside(12.0, 0.4),
            none,
            height,
        ));
        if height > 0.0 {
            let exact = f64::hypot(height, HOLE - PEG);
            cases.push(case(format!("{height} mm over the hole"), up, none, exact));
        }
    }
    // Beside the block, upright and lying: a generator, then the end's flat, against the block's side.
    for gap in [30.0, 3.0, 0.7, 0.05, 0.0, -0.1, -0.5, -0.9] {
        let beside = DVec3::new(SIDE + PEG + gap, 3.3, 1.7);
        for turn in [0.0, 0.37] {
            let name = format!("{gap} mm beside, turned by {turn}");
            cases.push(case(name, beside, DQuat::from_rotation_z(turn), gap));
        }
        let end = DVec3::new(SIDE + PEG_HALF + gap, 3.3, 1.7);
        cases.push(case(
            format!("{gap} mm beside, lying"),
            end,
            DQuat::from_rotation_y(f64::to_radians(90.0)),
            gap,
        ));
    }
    // Off a corner of the block: the peg's lower rim is nearest to it, as far away along the diagonal as above.
    for gap in [8.0, 0.6, 0.1] {
        let away = DVec3::new(SIDE, SIDE, 0.0) + DVec3::new(1.0, 1.0, 0.0).normalize() * (PEG + gap);
        let up = DVec3::Z * (BLOCK_HALF + PEG_HALF + gap);
        let exact = gap * f64::sqrt(2.0);
        cases.push(case(
            format!("{gap} mm off a corner"),
            away + up,
            DQuat::IDENTITY,
            exact,
        ));
    }
    cases
}

fn worst(rows: &[(f64, ProbeRow)], gaps: bool, error: impl Fn(f64, &ProbeRow) -> f64) -> (f64, &str) {
    (rows.iter())
        .filter(|(exact, _)| (*exact >= 0.0) == gaps)
        .map(|(exact, row)| (error(*exact, row).abs(), row.name.as_str()))
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .unwrap_or((f64::INFINITY, "none"))
}

#[test]
fn scene_p_against_closed_form() {
    let scene = ProbeScene::load(&file(), Some(0.5)).expect("the file is part of the sources");
    let pair = scene.pair("peg", None).expect("two parts");
    let rows: Vec<(f64, ProbeRow)> = (cases().into_iter())
        .map(|case| (case.exact_mm, scene.probe(pair, &case.pose).expect("a good pose")))
        .collect();
    let by_faces = |exact: f64, row: &ProbeRow| row.distance_mm - exact;
    let (gap, gap_at) = worst(&rows, true, by_faces);
    let (depth, depth_at) = worst(&rows, false, by_faces);
    println!("{} poses, image of {} bytes", rows.len(), scene.image_bytes());
    println!("gap: {:.2} µm off at {gap_at}", 1e3 * gap);
    println!("depth: {:.2} µm off at {depth_at}", 1e3 * depth);
    for (exact, row) in &rows {
        let off = 1e3 * (row.distance_mm - exact);
        let field = row
            .field_distance_mm
            .map_or(f64::NAN, |field| 1e3 * (field - exact));
        println!(
            "{off:9.2} µm, field {field:9.2} µm, exact {exact:8.4}, {:?}, {row}",
            row.resolution
        );
    }
    let mut times: Vec<u64> = rows.iter().map(|(_, row)| row.median_ns).collect();
    times.sort_unstable();
    println!(
        "median {} ns, largest {} ns",
        times[times.len() / 2],
        times[times.len() - 1]
    );
    for (exact, row) in &rows {
        let off = (row.distance_mm - exact).abs();
        let tolerance = if *exact < 0.0 {
            DEPTH_TOLERANCE_MM
        } else {
            GAP_TOLERANCE_MM
        };
        assert!(off <= tolerance, "{exact} mm: {row}");
        assert_eq!(row.resolution, Resolution::Exact, "{row}");
        // What is clearly apart has no contact, what is clearly inside one another has.
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

/// Pushed into the wall the force points back.
#[test]
fn force_points_out_of_the_wall() {
    let scene = ProbeScene::load(&file(), Some(0.5)).expect("the file is part of the sources");
    let pair = scene.pair("peg", Some("block")).expect("these parts");
    let pushed = case("pushed".into(), aside(0.15, 0.9), DQuat::IDENTITY, -0.05);
    let row = scene.probe(pair, &pushed.pose).expect("a good pose");
    let force = DVec3::from_array(row.force_n.map(f64::from));
    // The samples lie unevenly about the line of contact: half their spacing, 0.045 rad.
    assert!(
        force.normalize().dot(-aside(1.0, 0.9)) > f64::cos(0.05),
        "{row} {force}"
    );
    assert_eq!(usize::from(row.contacts), row.contact_points.len());
}

#[test]
fn mistakes_are_one_line() {
    let absent = read_poses(Path::new("absent.csv")).expect_err("there is none");
    assert!(matches!(absent, LabError::Unreadable { .. }), "{absent}");
    let absent = ProbeScene::load(Path::new("absent.step"), None)
        .err()
        .expect("there is none");
    assert!(matches!(absent, LabError::Unreadable { .. }), "{absent}");
    let scene = ProbeScene::load(&file(), Some(2.0)).expect("the file is part of the sources");
    let unknown = scene.pair("pin", None).expect_err("there is none");
    assert!(unknown.to_string().contains("no part `pin`"), "{unknown}");
    assert!(unknown.to_string().contains("block, peg"), "{unknown}");
    let same = scene.pair("peg", Some("peg")).expect_err("one part");
    for error in [absent, unknown, same] {
        assert!(!error.to_string().contains('\n'), "{error}");
    }
}
