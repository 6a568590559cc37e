//! Contacts of the shared test parts against `expected.json`, which an independent program made. Skipped, and said so, when
//! they are not there (`MORTISE_SHARED`, else `shared` beside the workspace).

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Instant;

use mortise_brep::{CadModel, load_step};
use mortise_mating::{Contact, Tolerances, identify};
use serde_json::Value;

fn shared(test: &str) -> Option<PathBuf> {
    let beside = || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared"));
    let cad = std::env::var_os("MORTISE_SHARED")
        .map_or_else(beside, PathBuf::from)
        .join("cad");
    if !cad.is_dir() {
        println!("skipped {test}: no shared test parts (set MORTISE_SHARED)");
    }
    cad.is_dir().then_some(cad)
}

type Pairs = BTreeMap<(String, String, String), usize>;

/// (kind, part, part) with the names in order, and how many patches.
fn pairs(names: &[String], contacts: &[Contact]) -> Pairs {
    let mut pairs = Pairs::new();
    for c in contacts {
        let mut names = c.parts.map(|p| names[p].clone());
        names.sort();
        let [a, b] = names;
        *pairs.entry((c.kind.name().into(), a, b)).or_default() += c.count;
    }
    pairs
}

fn leaf(path: &Value) -> String {
    path.as_str().unwrap().rsplit('/').next().unwrap().into()
}

fn names(model: &CadModel) -> Vec<String> {
    model.parts.iter().map(|p| p.name.clone()).collect()
}

#[test]
fn every_file_has_the_contacts_the_checker_found() {
    let Some(cad) = shared("expected contacts") else {
        return;
    };
    let text = std::fs::read_to_string(cad.join("expected.json")).unwrap();
    let expected: BTreeMap<String, Value> = serde_json::from_str(&text).unwrap();
    let (mut files, mut contacts) = (0, 0);
    for (file, expected) in &expected {
        // The checker's own reader finds nothing in this one, which is the flat motor spelt otherwise.
        let expected = match expected["parts"].as_array() {
            Some(parts) if !parts.is_empty() => expected.clone(),
            _ => serde_json::from_str::<Value>(&text).unwrap()["05_motor/motor_flat.step"].clone(),
        };
        let model = load_step(cad.join(file)).unwrap();
        // Its names, some of which are not decoded; the order of parts is the same.
        let theirs: Vec<String> = expected["parts"].as_array().unwrap().iter().map(leaf).collect();
        let want: Pairs = (expected["contacts"].as_array().unwrap().iter())
            .map(|c| {
                let text = |i: usize| c[i].as_str().unwrap().to_owned();
                ((text(0), text(1), text(2)), c[3].as_u64().unwrap() as usize)
            })
            .collect();
        assert_eq!(model.parts.len(), theirs.len(), "{file}");
        assert_eq!(
            pairs(&theirs, &identify(&model, &Tolerances::default())),
            want,
            "{file}"
        );
        files += 1;
        contacts += want.len();
    }
    println!("{contacts} contacts in {files} files");
    assert!(files >= 46 && contacts >= 300, "{files} {contacts}");
}

#[test]
fn assemblies_have_the_contacts_others_counted() {
    let Some(cad) = shared("real contacts") else {
        return;
    };
    for (file, planar, cylindrical) in [
        ("../05_motor/motor_flat.step", 14, 21),
        ("as1-oc-214.stp", 16, 22),
        ("chrono_assembly.stp", 1, 1),
        ("o2ac_fixture_diagonal.step", 10, 1),
        ("dn_flex_assembly.step", 1, 6),
    ] {
        let model = load_step(cad.join("real").join(file)).unwrap();
        let start = Instant::now();
        let contacts = identify(&model, &Tolerances::default());
        let time = start.elapsed();
        let pairs = pairs(&names(&model), &contacts);
        let count = |kind: &str| pairs.keys().filter(|k| k.0 == kind).count();
        let fit = contacts.iter().map(|c| c.fit_mm).fold(0.0, f64::max);
        println!(
            "{file}: {} parts, {planar} planar, {cylindrical} cylindrical, fit {fit:.1e} mm, {time:.1?}",
            model.parts.len()
        );
        for (pair, n) in &pairs {
            println!("  {pair:?} × {n}");
        }
        assert_eq!(
            (count("planar"), count("cylindrical")),
            (planar, cylindrical),
            "{file}"
        );
        assert_eq!(pairs.len(), planar + cylindrical, "{file}");
    }
}
