//! The commands as a person or a script runs them: the real program, its output and its exit code.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

const SAMPLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/samples/pair_d18.75_clear1.00.step");

fn mortise(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_mortise"))
        .args(arguments)
        .output()
        .expect("the program starts")
}

/// The program with a cache of its own.
fn mortise_with_cache(cache: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_mortise"))
        .env("XDG_CACHE_HOME", cache)
        .args(arguments)
        .output()
        .expect("the program starts")
}

fn json(output: &Output) -> Value {
    assert!(output.status.success(), "{output:?}");
    let text = std::str::from_utf8(&output.stdout).expect("UTF-8");
    serde_json::from_str(text).expect("JSON")
}

/// Checks for exit code 2, nothing on standard output, and one line on standard error that names `what`.
fn refused(arguments: &[&str], what: &str) {
    let output = mortise(arguments);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {output:?}");
    assert!(output.stdout.is_empty(), "{output:?}");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(said.lines().count(), 1, "{said}");
    assert!(said.starts_with("mortise: ") && said.contains(what), "{said}");
}

/// Folder of the shared parts, if present.
fn shared() -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    let folder = std::env::var_os("MORTISE_SHARED").map_or(beside, PathBuf::from);
    folder.join("cad").is_dir().then_some(folder)
}

/// No window opens for any of these; on a display the program would otherwise run until the window is closed.
#[test]
fn a_mistyped_command_gets_a_suggestion_and_no_window() {
    refused(&["opne"], "did you mean `open`?");
    refused(&["inspct", "x.step"], "did you mean `inspect`?");
    refused(&["insepct"], "did you mean `inspect`?");
    refused(&["gearbox"], "neither a command nor a file");
    refused(&["no-such.step"], "there is no file no-such.step");
    refused(&["open", "no-such.step"], "there is no file no-such.step");
    refused(&["."], "is a folder");
}

#[test]
fn a_value_that_no_option_takes_is_refused_for_what_it_is() {
    for (option, value, what) in [
        ("--accuracy", "-5um", "accuracy = -0.005 is out of range"),
        ("--accuracy", "nan", "is not a length"),
        ("--flash", "-1", "is not a size"),
        ("--tick", "-5", "not a number of instructions"),
        ("--cell", "1e-300", "cell_mm = 1e-300 is out of range"),
        ("--cell", "nan", "is out of range"),
        ("--cell", "abc", "`abc` is not a number"),
        ("--timeout", "0", "is not a time limit"),
    ] {
        refused(
            &["bake", SAMPLE, "-o", "never.image", "--no-cache", option, value],
            what,
        );
    }
}

#[test]
fn inspect_says_what_is_in_the_file() {
    let report = json(&mortise(&["inspect", SAMPLE, "--json"]));
    assert_eq!(report["unit"], "millimetre");
    assert_eq!(report["warnings"], Value::Array(vec![]));
    let parts = report["parts"].as_array().expect("parts");
    assert_eq!(parts.len(), 2);
    assert_eq!(
        (&parts[0]["name"], &parts[1]["name"]),
        (&"block".into(), &"peg".into())
    );
    assert_eq!(parts[0]["faces"], serde_json::json!({"plane": 6, "cylinder": 1}));
    assert_eq!(parts[1]["faces"], serde_json::json!({"plane": 2, "cylinder": 1}));
    assert_eq!(parts[1]["closed"], true);
    // Volume of 60 mm of a 17.75 mm cylinder, by the kernel's integration: relative error below 1e-6.
    let exact = std::f64::consts::PI * 8.875f64.powi(2) * 60.0;
    let volume = parts[1]["volume_mm3"].as_f64().expect("number");
    assert!((volume / exact - 1.0).abs() < 1e-6, "{volume}");
    let text = String::from_utf8(mortise(&["inspect", SAMPLE]).stdout).expect("UTF-8");
    assert!(text.starts_with("2 parts, unit millimetre\n"), "{text}");
}

#[test]
fn a_section_has_the_areas_of_the_parts() {
    let bounds = json(&mortise(&["inspect", SAMPLE, "--json"]));
    let com = &bounds["parts"][0]["center_of_mass_mm"];
    let plane = format!("z={}mm", com[2].as_f64().expect("number"));
    let report = json(&mortise(&["section", SAMPLE, "--plane", &plane, "--json"]));
    // The block is 50 mm square and has a through hole of 18.75 mm along z.
    let parts = report["parts"].as_array().expect("parts");
    let block = parts.iter().find(|p| p["name"] == "block").expect("block");
    assert_eq!((&block["outlines"], &block["open_lines"]), (&2.into(), &0.into()));
    let want = 50.0 * 50.0 - std::f64::consts::PI * 9.375f64.powi(2);
    let area = block["area_mm2"].as_f64().expect("number");
    // Sides within 1 µm of the circle: at most the circumference times that.
    assert!((area - want).abs() < 0.059, "{area} {want}");
    let one = json(&mortise(&[
        "section", SAMPLE, "--plane", &plane, "--part", "block", "--json",
    ]));
    assert_eq!(one["parts"], serde_json::json!([block]));
    let none = json(&mortise(&["section", SAMPLE, "--plane", "x=9000mm", "--json"]));
    assert_eq!(none["parts"], Value::Array(vec![]));
    let said = String::from_utf8(mortise(&["section", SAMPLE, "--plane", &plane]).stdout).expect("UTF-8");
    assert!(
        said.contains("block: ") && said.contains(" mm², 2 outlines"),
        "{said}"
    );
    refused(&["section", SAMPLE, "--plane", "q=1mm"], "is not a plane");
    refused(
        &["section", SAMPLE, "--plane", "z=1mm", "--part", "lid"],
        "there is no part lid; the file has block, peg",
    );
}

#[test]
fn a_recorded_demo_replays() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("run.mcap");
    let file = file.to_str().expect("UTF-8");
    let demo = [
        "demo",
        "--headless",
        "--rig",
        "sim-fast",
        "--json",
        "--record",
        file,
    ];
    json(&mortise(&demo));
    let report = json(&mortise(&["replay", file, "--check", "--json"]));
    assert_eq!(report["complete"], true, "{report}");
    assert_eq!(report["replayed"]["same_bits"], true, "{report}");
    assert_eq!(report["replayed"]["compared"], report["ticks"], "{report}");
    assert!(
        report["ticks"].as_u64().is_some_and(|ticks| ticks > 1000),
        "{report}"
    );
    let changed = mortise(&["replay", file, "--set", "CouplingStiffness=400", "--json"]);
    assert_eq!(changed.status.code(), Some(1), "{changed:?}");
    let changed: Value = serde_json::from_slice(&changed.stdout).expect("JSON");
    let tick = &changed["replayed"]["first_difference"]["tick"];
    assert!(tick.as_u64().is_some_and(|tick| tick > 0), "{changed}");
    let csv = folder.path().join("run.csv");
    let path = csv.to_str().expect("UTF-8");
    json(&mortise(&["replay", file, "--csv", path, "--json"]));
    let table = std::fs::read_to_string(&csv).expect("a table");
    let columns = |line: &str| line.split(',').count();
    let mut widths = table.lines().map(columns);
    let first = widths.next().expect("a header");
    assert!(widths.all(|width| width == first));
    assert_eq!(
        table.lines().count() as u64,
        report["telemetry"].as_u64().expect("a number") + 1
    );
    refused(&["replay", file, "--csv", path], "--force");
    refused(&["replay", SAMPLE], "is not a recording");
    refused(&["replay", file, "--set", "Nonsense=1"], "no parameter");
    refused(&demo, "no recording is replaced");
}

#[test]
fn clearances_are_listed_up_to_a_gap() {
    let file = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../mating/tests/data/two_pin_exact.step"
    );
    let report = json(&mortise(&["clearance", file, "--json", "--below", "100um"]));
    let pair = &report["pairs"][0];
    assert_eq!(
        serde_json::json!([pair["a"], pair["b"], pair["state"], report["overlapping"]]),
        serde_json::json!(["socket-plate", "two-pin-link", "touching", 0])
    );
    // In the sample the peg lies beside the block.
    let apart = json(&mortise(&["clearance", SAMPLE, "--json"]));
    assert_eq!(apart["pairs"], Value::Array(vec![]));
    let far = json(&mortise(&["clearance", SAMPLE, "--json", "--below", "1000mm"]));
    assert!(far["pairs"][0]["clearance_um"].as_f64().expect("number") > 1000.0);
    refused(&["clearance", SAMPLE, "--below", "0mm"], "must be more than 0");
}

#[test]
fn contacts_of_two_pins_in_their_holes() {
    let file = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../mating/tests/data/two_pin_exact.step"
    );
    let report = json(&mortise(&["contacts", file, "--json"]));
    assert_eq!(
        report["parts"],
        serde_json::json!(["socket-plate", "two-pin-link"])
    );
    let contacts = report["contacts"].as_array().expect("contacts");
    let row = |c: &Value| serde_json::json!([c["kind"], c["a"], c["b"], c["count"]]);
    assert_eq!(
        contacts.iter().map(row).collect::<Value>(),
        serde_json::json!([
            ["planar", "socket-plate", "two-pin-link", 1],
            ["cylindrical", "socket-plate", "two-pin-link", 2]
        ])
    );
    // Two pins of 6 mm, 12 mm long; the areas of unrolled walls are exact.
    let area = contacts[1]["area_mm2"].as_f64().expect("number");
    assert!(
        (area / (2.0 * std::f64::consts::PI * 6.0 * 12.0) - 1.0).abs() < 1e-9,
        "{area}"
    );
    assert_eq!(
        (&contacts[1]["radius_mm"], &contacts[1]["fit_um"]),
        (&3.0.into(), &0.0.into())
    );
    let text = String::from_utf8(mortise(&["contacts", file]).stdout).expect("UTF-8");
    assert!(
        text.starts_with("2 parts, 2 pairs of surfaces in contact\n"),
        "{text}"
    );
    // In the sample as delivered, nothing touches.
    let apart = json(&mortise(&["contacts", SAMPLE, "--json"]));
    assert_eq!(apart["contacts"], Value::Array(vec![]));
    refused(&["contacts", "no-such-file.step", "--json"], "no-such-file.step");
}

/// The sample's peg is beside its block: it is put on the hole's axis, either way round.
#[test]
fn a_fit_of_the_sample_is_on_the_holes_axis() {
    let output = mortise(&["fit", SAMPLE, "--moving", "peg", "--against", "block", "--json"]);
    let report = json(&output);
    let fits = report["fits"].as_array().expect("fits");
    assert_eq!(fits.len(), 2, "{report}");
    for fit in fits {
        for gap in ["min", "median", "max"] {
            let um = fit["clearance_um"][gap].as_f64().expect("number");
            assert!((um - 500.0).abs() < 1.0, "{fit}");
        }
        assert_eq!(
            (&fit["freedom"], &fit["path"]["kind"]),
            (&2.into(), &"line".into()),
            "{fit}"
        );
        let rotation = fit["pose"]["rotation"].as_array().expect("rotation");
        assert_eq!(rotation.len(), 9);
        assert!(
            (rotation[8].as_f64().expect("number").abs() - 1.0).abs() < 1e-6,
            "{fit}"
        );
    }
    refused(
        &["fit", SAMPLE, "--moving", "pg", "--against", "block"],
        "no part `pg`",
    );
    refused(
        &["fit", SAMPLE, "--moving", "peg", "--against", "peg"],
        "choose two parts",
    );
    refused(
        &[
            "fit",
            SAMPLE,
            "--moving",
            "peg",
            "--against",
            "block",
            "--overlap",
            "-1",
        ],
        "0 to 100",
    );
}

#[test]
fn what_cannot_be_read_is_refused_in_one_line() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let write = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).expect("written");
        path.into_os_string().into_string().expect("UTF-8")
    };
    let empty = write("empty.step", b"");
    let prose = write("prose.step", b"Dear all,\nplease find attached\n");
    let sample = std::fs::read(SAMPLE).expect("sample");
    let half = write("half.step", &sample[..sample.len() / 2]);
    refused(&["inspect", "no-such-file.step", "--json"], "no-such-file.step");
    for (path, name) in [(empty, "empty.step"), (prose, "prose.step"), (half, "half.step")] {
        refused(&["inspect", &path], name);
        refused(&["bake", &path, "-o", "never-written.image"], name);
    }
    assert!(!Path::new("never-written.image").exists());
}

#[test]
fn shared_broken_files_are_refused_and_none_crashes_the_program() {
    let Some(shared) = shared() else {
        println!("skipped: the broken files of ../shared/cad are not here");
        return;
    };
    let mut seen = 0;
    for entry in std::fs::read_dir(shared.join("cad/08_hard")).expect("folder") {
        let path = entry.expect("entry").path();
        let name = path.file_name().expect("name").to_string_lossy().into_owned();
        if name.starts_with("broken_") {
            seen += 1;
            refused(&["inspect", &path.to_string_lossy(), "--json"], &name);
        }
    }
    assert!(seen > 0, "the folder has broken files");
}

#[test]
fn bake_writes_an_image_a_board_would_take() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let out = folder.path().join("pair.image");
    let report = json(&mortise(&[
        "bake",
        SAMPLE,
        "--no-cache",
        "-o",
        &out.to_string_lossy(),
        "--json",
    ]));
    let bytes = std::fs::read(&out).expect("written");
    assert_eq!(report["plan"]["report"]["image_bytes"], bytes.len());
    // Without options 10 µm are planned for a slot of the board.
    assert_eq!(report["request"]["accuracy_mm"], 0.01);
    assert_eq!(report["request"]["flash_bytes"], 512 << 10);
    assert_eq!(
        (&report["met"], &report["limit"]),
        (&true.into(), &"accuracy".into())
    );
    // Reading in place requires the alignment of flash; a byte vector has none.
    let words: Vec<u32> = (bytes.chunks_exact(4))
        .map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]))
        .collect();
    let image = mortise_protocol::image::SceneImage::open(bytemuck::cast_slice(&words)).expect("sound");
    assert_eq!(image.parts().len(), 2);
    let left_over: Vec<_> = std::fs::read_dir(folder.path()).expect("folder").collect();
    assert_eq!(left_over.len(), 1, "nothing but the image is left");
    refused(
        &["bake", SAMPLE, "-o", "/nowhere/at/all.image"],
        "/nowhere/at/all.image",
    );
    refused(
        &[
            "bake",
            SAMPLE,
            "-o",
            &out.to_string_lossy(),
            "--force",
            "--grabbable",
            "handle",
        ],
        "handle",
    );
    assert_eq!(std::fs::read(&out).expect("still there"), bytes);
}

#[test]
fn bake_plans_for_an_accuracy() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let out = folder.path().join("pair.image");
    let path = out.to_string_lossy().into_owned();
    let ask = |more: &[&str]| {
        let arguments = ["bake", SAMPLE, "--no-cache", "-o", &path, "--accuracy", "5um"];
        mortise(&[&arguments[..], more].concat())
    };
    let met = json(&ask(&["--flash", "1MiB", "--tick", "120000", "--json"]));
    assert_eq!((&met["met"], &met["fits"]), (&true.into(), &true.into()));
    assert_eq!(
        met["plan"]["report"]["image_bytes"],
        std::fs::read(&out).expect("written").len()
    );
    for shape in met["plan"]["shapes"].as_array().expect("shapes") {
        assert!(shape["field_error_in_fits_mm"].as_f64().expect("a number") <= 0.005);
        assert!(!shape["why"].as_str().expect("words").is_empty());
    }
    let best = ask(&["--flash", "11KiB", "--force"]);
    let text = String::from_utf8_lossy(&best.stdout);
    assert!(
        best.status.success() && text.contains("5.0 µm was asked; limited by the size"),
        "{text}"
    );
    assert!(std::fs::read(&out).expect("written").len() <= 11 << 10);
    std::fs::remove_file(&out).expect("there");
    let missed = ask(&["--flash", "4KiB"]);
    assert_eq!(missed.status.code(), Some(1));
    let text = String::from_utf8_lossy(&missed.stdout);
    assert!(text.contains("no model fits"), "{text}");
    assert!(!out.exists(), "nothing is written");
    assert_eq!(ask(&["--cell", "0.5"]).status.code(), Some(2));
    assert_eq!(ask(&["--flash", "1MB"]).status.code(), Some(2));
}

#[test]
fn an_unchanged_file_is_planned_from_the_cache() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let cache = folder.path().join("cache");
    let bake = |name: &str, more: &[&str]| {
        let out = folder.path().join(name).to_string_lossy().into_owned();
        let arguments = [&["bake", SAMPLE, "-o", &out, "--json"][..], more].concat();
        let output = mortise_with_cache(&cache, &arguments);
        let plan = json(&output)["plan"].clone();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        (std::fs::read(out).expect("written"), plan, said)
    };
    let (image, plan, said) = bake("without", &["--no-cache"]);
    assert!(said.is_empty() && !cache.exists(), "{said}");
    assert_eq!(bake("first", &[]), (image.clone(), plan.clone(), String::new()));
    assert_eq!(bake("again", &[]), (image.clone(), plan.clone(), String::new()));
    let files = || -> Vec<PathBuf> {
        let files = std::fs::read_dir(cache.join("mortise/bake")).expect("kept");
        files.map(|file| file.expect("file").path()).collect()
    };
    assert!(files().len() > 2, "{:?}", files());
    // Damage is reported, ignored and repaired.
    for file in files() {
        let mut bytes = std::fs::read(&file).expect("kept");
        let last = bytes.len() - 1;
        bytes[last] ^= 1;
        std::fs::write(&file, bytes).expect("written");
    }
    let (same_image, same_plan, said) = bake("damaged", &[]);
    assert!(
        said.starts_with("warning: ") && said.contains("damaged file"),
        "{said}"
    );
    assert_eq!((same_image, same_plan), (image.clone(), plan.clone()));
    assert_eq!(bake("repaired", &[]), (image, plan, String::new()));
}

#[test]
fn bake_by_the_textbooks_method() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let out = folder.path().join("voxels.scene");
    let out = out.to_str().expect("UTF-8");
    let report = json(&mortise(&[
        "bake",
        SAMPLE,
        "-o",
        out,
        "--cell",
        "1",
        "--method",
        "occupancy",
        "--json",
    ]));
    assert_eq!(report["shapes"][0]["method"], "occupancy");
    let poses = folder.path().join("poses.csv");
    std::fs::write(&poses, "name,x,y,z,qw,qx,qy,qz\nas drawn,0,0,0,1,0,0,0\n").expect("written");
    let poses = poses.to_str().expect("UTF-8");
    // An image states its own method.
    refused(
        &[
            "probe",
            out,
            "--moving",
            "1",
            "--poses",
            poses,
            "--method",
            "distance-field",
        ],
        "it is the other one",
    );
    let unknown = mortise(&["bake", SAMPLE, "-o", out, "--method", "voxels"]);
    assert_eq!(unknown.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&unknown.stderr).contains("distance-field or occupancy"));
}

#[test]
fn ports_lists_the_simulated_rigs_first() {
    let rigs = json(&mortise(&["ports", "--json"]));
    let rigs = rigs.as_array().expect("array");
    assert_eq!(rigs[0]["rig"], "sim");
    assert_eq!(rigs[0]["available"], true);
    assert_eq!(rigs[1]["rig"], "emulated");
    assert!(
        rigs[1]["available"] == true
            || rigs[1]["hint"]
                .as_str()
                .is_some_and(|h| h.contains("cargo xtask"))
    );
}

#[test]
fn two_runs_of_the_demonstration_are_the_same_run() {
    let run = || json(&mortise(&["demo", "--headless", "--rig", "sim", "--json"]));
    let (first, second) = (run(), run());
    assert_eq!(first["state_hash"], second["state_hash"]);
    assert!(first["inserted_mm"].as_f64() >= first["hole_mm"].as_f64());
    assert_eq!(first["missed_ticks"], 0);
    for field in ["ticks", "instructions_per_tick_max", "peak_force_n", "rig"] {
        assert!(first.get(field).is_some(), "{field}");
    }
}

#[test]
fn a_rig_that_is_not_there_is_refused() {
    refused(
        &["demo", "--headless", "--rig", "/dev/no-such-port"],
        "/dev/no-such-port",
    );
    let output = mortise(&["demo", "--headless", "--rig", "emulated:sideways"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("emulated:sideways"));
}
