//! `mortise probe` from the command line.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn scene() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../lab/data/scene_p.step")
}

fn probe(scene: &Path, moving: &str, poses: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_mortise"))
        .arg("probe")
        .arg(scene)
        .args(["--cell", "1", "--json", "--moving", moving, "--poses"])
        .arg(poses)
        .output()
        .expect("the program runs")
}

#[test]
fn a_row_a_pose() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let poses = directory.path().join("poses.csv");
    let text = "name,x,y,z,qw,qx,qy,qz\nin,0,0,0,1,0,0,0\npressed,0,0.2,0,1,0,0,0\n";
    std::fs::write(&poses, text).expect("written");
    let output = probe(&scene(), "peg", &poses);
    assert!(output.status.success(), "{output:?}");
    let rows: Vec<serde_json::Value> = String::from_utf8_lossy(&output.stdout)
        .lines()
        .map(|line| serde_json::from_str(line).expect("one JSON object a line"))
        .collect();
    assert_eq!(rows.len(), 2);
    for (row, (name, exact)) in rows.iter().zip([("in", 0.1), ("pressed", -0.1)]) {
        assert_eq!(row["name"], name);
        let distance = row["distance_mm"].as_f64().expect("a number");
        // The same bound as in the lab's test of this scene: 5 µm.
        assert!((distance - exact).abs() < 5e-3, "{row}");
        for key in ["contacts", "points", "least_ns"] {
            assert!(row[key].is_u64(), "{row}");
        }
    }
    assert!(
        rows[1]["force_n"][1].as_f64().is_some_and(|force| force < 0.0),
        "{}",
        rows[1]
    );
}

/// From above its hole the peg goes down it, from beside it onto the block's top, 20 mm over the middle, with its end 25 mm below its middle.
#[test]
fn first_touch_along_a_motion() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let poses = directory.path().join("poses.csv");
    let text = "name,x,y,z,qw,qx,qy,qz\nover,0,0,46,1,0,0,0\nbeside,3,0,46,1,0,0,0\n";
    std::fs::write(&poses, text).expect("written");
    let output = Command::new(env!("CARGO_BIN_EXE_mortise"))
        .arg("probe")
        .arg(scene())
        .args([
            "--cell", "2", "--json", "--moving", "peg", "--along", "0,0,-4", "--poses",
        ])
        .arg(&poses)
        .output()
        .expect("the program runs");
    assert!(output.status.success(), "{output:?}");
    let rows: Vec<serde_json::Value> = String::from_utf8_lossy(&output.stdout)
        .lines()
        .map(|line| serde_json::from_str(line).expect("one JSON object a line"))
        .collect();
    let number = |row: &serde_json::Value, key: &str| row[key].as_f64().expect("a number");
    assert_eq!(rows[0]["happens"], "free");
    assert!((number(&rows[0], "gap_mm") - 0.1).abs() < 1e-3, "{}", rows[0]);
    assert_eq!(rows[1]["happens"], "touch");
    let (share, error) = (number(&rows[1], "share"), number(&rows[1], "share_error"));
    assert!(
        share <= 0.25 + 1e-4 && share + error >= 0.25 - 1e-4 && error < 0.01,
        "{}",
        rows[1]
    );
}

#[test]
fn mistakes_end_with_2_and_one_line() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let header = "name,x,y,z,qw,qx,qy,qz";
    let file = |name: &str, text: &str| {
        let path = directory.path().join(name);
        std::fs::write(&path, text).expect("written");
        path
    };
    let good = file("good.csv", &format!("{header}\na,0,0,0,1,0,0,0\n"));
    let cases = [
        (scene(), "peg", directory.path().join("absent.csv"), "absent.csv"),
        (PathBuf::from("absent.step"), "peg", good.clone(), "absent.step"),
        (scene(), "pin", good, "no part `pin`"),
        (
            scene(),
            "peg",
            file("columns.csv", "name,x,y,z\na,0,0,0\n"),
            "columns.csv:1: no column `qw`",
        ),
        (
            scene(),
            "peg",
            file("nan.csv", &format!("{header}\na,NaN,0,0,1,0,0,0\n")),
            "nan.csv:2: x is NaN",
        ),
        (
            scene(),
            "peg",
            file("unit.csv", &format!("{header}\na,0,0,0,2,0,0,0\n")),
            "unit.csv:2: the quaternion",
        ),
    ];
    for (scene, moving, poses, part) in cases {
        let output = probe(&scene, moving, &poses);
        let error = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{error}");
        assert_eq!(error.lines().count(), 1, "{error}");
        assert!(error.contains(part), "{part}: {error}");
    }
}
