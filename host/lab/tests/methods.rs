//! Comparison of the methods where the textbook's fails: a centred peg with a gap of 10 µm all around.

use std::path::PathBuf;

use glam::{DQuat, DVec3};
use mortise_bake::{Method, PointshellKind};
use mortise_brep::load_step;
use mortise_scenario::probe::{Model, NamedPose, ProbeRow, ProbeScene, Resolution};

/// Block of 40 mm with a hole of 18.75 mm through it, along z from its top at z = 0; peg of 18.73 × 60 mm.
fn file() -> PathBuf {
    PathBuf::from(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/data/pair_d18.75_clear0.02.step"
    ))
}

const CELL_MM: f64 = 0.5;
/// Half the diametral clearance.
const GAP_MM: f64 = 0.01;

/// The peg on the hole's axis, its lower end this far below the block's top, rotated about its axis.
fn poses() -> Vec<NamedPose> {
    let model = load_step(file()).expect("the file is part of the sources");
    let part = |name: &str| {
        model
            .parts
            .iter()
            .find(|part| part.name == name)
            .expect("is there")
    };
    let low = |name: &str| {
        let vertices = &model.shapes[part(name).shape].mesh.vertices;
        vertices.iter().map(|v| v.z).fold(f64::INFINITY, f64::min)
    };
    let top = low("block") + 40.0;
    let mut poses = Vec::new();
    for depth in [5.0, 20.0, 45.0] {
        for turn in [0.0, 0.3, 1.1] {
            poses.push(NamedPose {
                name: format!("{depth} mm in, turned {turn}"),
                position_mm: DVec3::Z * (top - depth - low("peg")),
                orientation: DQuat::from_rotation_z(turn),
            });
        }
    }
    poses
}

fn scene(method: Method, shell: PointshellKind) -> ProbeScene {
    let model = Model {
        cell_mm: Some(CELL_MM),
        method: Some(method),
        shell,
    };
    ProbeScene::load_by(&file(), &model).expect("the file is part of the sources")
}

fn rows(method: Method, shell: PointshellKind) -> Vec<ProbeRow> {
    let scene = scene(method, shell);
    let pair = scene.pair("peg", Some("block")).expect("these parts");
    println!("{method}: image of {} bytes", scene.image_bytes());
    let rows: Vec<ProbeRow> = (poses().iter())
        .map(|pose| scene.probe(pair, pose).expect("a good pose"))
        .collect();
    rows.iter().for_each(|row| println!("{row}"));
    rows
}

#[test]
fn the_distance_field_sees_no_contact() {
    for row in rows(Method::DistanceField, PointshellKind::ErrorBounded) {
        assert_eq!(row.contacts, 0, "{row}");
        assert!((row.distance_mm - GAP_MM).abs() < 1e-3, "{row}");
    }
}

/// Phantom contacts in every pose, at most half a voxel's diagonal deep.
#[test]
fn occupancy_sees_contact_where_there_is_none() {
    for row in rows(Method::Occupancy, PointshellKind::ErrorBounded) {
        assert!(row.contacts > 0, "{row}");
        assert_eq!(row.resolution, Resolution::TangentPlane, "{row}");
        let half_diagonal = 0.5 * CELL_MM * 3f64.sqrt();
        assert!(
            row.distance_mm < -0.1 && row.distance_mm > -half_diagonal,
            "{row}"
        );
        // The two distances are equal: the voxmap has no other than the one on which the force law acts.
        assert_eq!(Some(row.distance_mm), row.field_distance_mm, "{row}");
    }
}

/// The whole textbook, its pointshell too, whose points are off the surface by up to another half of a voxel's diagonal.
#[test]
fn the_classic_shell_is_no_better() {
    let classic = PointshellKind::Classic {
        voxel_mm: None,
        shrink_percent: 0.0,
    };
    let rows = rows(Method::Occupancy, classic);
    for row in &rows {
        assert!(row.contacts > 0, "{row}");
        let diagonal = CELL_MM * 3f64.sqrt();
        assert!(row.distance_mm <= 0.0 && row.distance_mm > -diagonal, "{row}");
    }
    // With aligned grids the planes just touch; rotated, they do not.
    assert!(rows.iter().any(|row| row.distance_mm < -0.1));
}

#[test]
fn a_gap_is_only_a_bound_to_a_voxmap() {
    let scene = scene(Method::Occupancy, PointshellKind::ErrorBounded);
    let pair = scene.pair("peg", Some("block")).expect("these parts");
    let exact_mm = 12.0;
    let mut pose = poses().swap_remove(0);
    pose.position_mm.z += 5.0 + exact_mm;
    let row = scene.probe(pair, &pose).expect("a good pose");
    assert_eq!((row.resolution, row.contacts), (Resolution::Bound, 0), "{row}");
    // No more than the gap, and not far below it: a brick is 4 mm wide.
    assert!(
        row.distance_mm <= exact_mm && row.distance_mm > exact_mm - 8.0,
        "{row}"
    );
}
